"""What a film tells in words, what it measures, and that texts stay within their room."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from other_bodies import swap_trace
from turning_run import LIFT, MOVE, PLACE, make_plan, make_trace

from dexplan.contact.bodies.edged import BoxBody, CylinderBody
from dexplan.contact.bodies.names import name_place
from dexplan.errors import UnknownNameError
from dexplan.plans.motion import ObjectMotion
from dexplan.sim.trace import Trace
from dexplan.viz import panels
from dexplan.viz.dress import dress_model
from dexplan.viz.facts import compute_facts
from dexplan.viz.film import FilmOptionError, FilmOptions, parse_size
from dexplan.viz.layout import Box, lay_out
from dexplan.viz.panels import draw_header
from dexplan.viz.sketch import ELLIPSIS, Sketch, measure_text
from dexplan.viz.story import build_captions, describe_motion, read_captions, speak, speak_fingers, tell_story

FINGERS = ("finger_1", "finger_2", "finger_3")


def test_a_headline_says_which_finger_moves_and_which_is_near_its_limit() -> None:
    plan = make_plan()
    limited = replace(plan.actions[PLACE], limiting_finger=0, limit="a singular posture")
    plan = replace(plan, actions=(*plan.actions[:PLACE], limited, *plan.actions[LIFT:]))
    story = tell_story(plan, make_trace())
    assert [c.get_headline(0) for c in story.chapters] == [
        "fingers 1 and 2 hold the object still",
        "fingers 1 and 2 turn the object by 90° · finger 2 comes near its limit",
        "finger 3 moves to its new place · finger 1 is near its limit",
        "finger 1 hands over its load",
    ]
    assert story.chapters[PLACE].get_headline(1).startswith("finger 3 touches down")
    assert story.chapters[PLACE].get_headline(9) == story.chapters[PLACE].headlines[-1]
    assert [c.movers for c in story.chapters] == [(), (), (2,), (0,)]
    assert story.chapters[MOVE].why == "made by hand"
    assert story.chapters[PLACE].why == "why: made by hand"


def test_the_goal_of_the_story_is_the_plans() -> None:
    plan = make_plan(450.0)
    story = tell_story(plan, make_trace())
    assert story.turn == pytest.approx(np.radians(450.0))
    assert story.X_WO_goal == pytest.approx(plan.X_WO_goal, abs=1e-9)
    tilted = replace(plan, axis_W=None, turned_angle=None)
    assert tell_story(tilted, make_trace()).turn == pytest.approx(np.radians(90.0))


def test_a_trace_tells_the_same_story_without_its_plan() -> None:
    plan, trace = make_plan(), make_trace()
    told = Trace(trace.model_xml, trace.columns, {"captions": build_captions(plan)})
    with_plan, without = tell_story(plan, trace), tell_story(None, told)
    assert without.chapters == with_plan.chapters
    assert without.axis_W == pytest.approx(with_plan.axis_W)


@pytest.mark.parametrize(
    "captions",
    [
        {},
        {"actions": 3},
        {"actions": [3]},
        {"actions": [[]], "axis_W": [0, 0]},
        {"actions": [["a"]], "goal_pose": [1]},
    ],
)
def test_odd_captions_are_none(captions: dict[str, object]) -> None:
    story = read_captions(captions)
    assert story.chapters == ()
    assert story.axis_W == pytest.approx([0.0, 0.0, 1.0])


def test_captions_of_earlier_runs_are_still_told() -> None:
    story = read_captions({"actions": [["1/2 hold"], ["2/2 lift finger_1"]], "axis_W": [0.0, 1.0, 0.0]})
    assert story.find_chapter(1).get_headline(0) == "2/2 lift finger_1"
    assert story.find_chapter(7).get_headline(0) == ""


def test_names_as_they_are_spoken() -> None:
    assert speak("a detour keeps finger_2/link_4 off finger_1", FINGERS) == (
        "a detour keeps finger 2 link 4 off finger 1"
    )
    assert speak_fingers(FINGERS, (0, 1, 2)) == "fingers 1, 2 and 3"
    assert speak_fingers(("thumb", "index"), (0, 1)) == "thumb and index"
    motion = ObjectMotion(np.eye(4), np.array([0.0, 0.0, 1.0]), -0.5, np.array([0.0, 0.012, 0.0]))
    assert describe_motion(motion, is_many=True) == "turn the object by 29° and shift it by 12 mm"


def test_facts_of_a_run() -> None:
    plan, trace = make_plan(), make_trace()
    facts = compute_facts(trace, tell_story(plan, trace), dress_model(trace.model_xml, FINGERS), FINGERS)
    assert np.degrees(facts.turned[-1]) == pytest.approx(90.0)
    assert facts.sliding, facts.torsional == (0.55, 0.0025)
    active = trace["contact_active"]
    assert np.array_equal(np.isfinite(facts.share), active)
    used = np.hypot(np.hypot(0.3, 0.9) / 0.55, 0.001 / 0.0025) / 5.0
    assert facts.share[active] == pytest.approx(used)
    # Finger after finger: when it touched first, and where.
    assert [e.finger for e in facts.episodes] == [0, 1, 2]
    assert facts.episodes[2].start == pytest.approx(0.86)
    assert facts.episodes[0].point_O[0] == pytest.approx(trace["contact_point_O"][0, 0])


def test_friction_used_is_the_largest_of_the_last_fifth_of_a_second() -> None:
    trace = make_trace(duration=2.0)
    force = trace["contact_force"].copy()
    force[50, 1, :2] = [0.0, 2.0]
    spiked = Trace(trace.model_xml, {**trace.columns, "contact_force": force}, {})
    story = tell_story(make_plan(), trace)
    share = compute_facts(spiked, story, dress_model(trace.model_xml, FINGERS), FINGERS).share[:, 1]
    assert share[49] < 0.5 * share[50]
    assert (share[50:60] == share[50]).all()
    assert share[61] == pytest.approx(share[49])


def test_words_of_any_length_stay_within_the_header() -> None:
    """What does not fit is set smaller, and what does not fit then ends in an ellipsis; the time's room stays free."""
    layout = lay_out(FilmOptions())
    sketch = Sketch(1280, 720)
    ground = None
    for words in ("", "finger 3 moves to its new place · finger 2 is near its limit " * 4):
        draw_header(sketch, layout.header, layout.scale, "88 of 88:", words, f"until {words}")
        room = sketch.pixels[: layout.header.height // 2, 1130:].copy()
        edge = sketch.pixels[: layout.header.height, 1276:].copy()
        if ground is not None:
            assert np.array_equal(room, ground[0])
            assert np.array_equal(edge, ground[1])
        ground = room, edge


def test_texts_are_cut_to_their_room() -> None:
    sketch = Sketch(200, 50)
    (line,) = sketch.fold_text("a long line of words that nobody reads", 12.0, 100.0)
    assert line.endswith(ELLIPSIS)
    assert measure_text(line, 12.0) <= 100.0
    assert sketch.fold_text("short", 12.0, 100.0) == ["short"]
    lines = sketch.fold_text("a line of words for two lines", 12.0, 110.0, most=2)
    assert len(lines) == 2
    assert max(measure_text(line, 12.0) for line in lines) <= 110.0


def test_text_is_painted_where_it_was_asked_for() -> None:
    sketch = Sketch(200, 50)
    sketch.pixels[:] = 0
    sketch.draw_text(190.0, 25.0, "12", 14.0, "#FF0000", "right")
    rows, columns = np.nonzero(sketch.pixels[..., 0] > 128)
    assert 189 - measure_text("12", 14.0) - 2 < columns.min() < columns.max() < 191
    assert rows.mean() == pytest.approx(25.0, abs=1.0)
    # Beyond the edge nothing is drawn, and nothing goes wrong.
    sketch.draw_text(-500.0, -500.0, "12", 14.0)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"size": (8, 480)}, "size 8x480: each side of 64"),
        ({"cameras": ()}, "0 cameras: one, or two"),
        ({"fps": 0.0}, "0 pictures per second: 1 to 120"),
        ({"speed": 0.0}, "0 times as fast: 0.01 to 100"),
    ],
)
def test_options_that_make_no_film_are_refused(given: dict[str, object], said: str) -> None:
    with pytest.raises(FilmOptionError, match=said):
        FilmOptions(**given)  # type: ignore[arg-type]


def test_unknown_quality_and_odd_sizes_are_told() -> None:
    with pytest.raises(UnknownNameError, match="unknown quality 'best'; known: draft, fine, normal"):
        FilmOptions(quality="best")
    assert parse_size("640X480") == (640, 480)
    with pytest.raises(FilmOptionError, match="'640' is no size; accepted: width x height"):
        parse_size("640")


@pytest.mark.parametrize("size", [(1280, 720), (640, 360), (480, 640), (1920, 1080), (321, 241)])
@pytest.mark.parametrize("cameras", [("overview",), ("overview", "closeup")])
def test_views_fill_the_room_between_header_and_footer(
    size: tuple[int, int], cameras: tuple[str, ...]
) -> None:
    layout = lay_out(FilmOptions(size, cameras))
    assert sum(view.width for view in layout.views) >= size[0] - 2
    assert layout.header.height + layout.views[0].height + layout.strip.height == size[1]
    assert layout.strip.width + layout.gauges.width == size[0]
    assert lay_out(FilmOptions(size, cameras, is_told=False)).views[0].height == size[1]


def test_a_finger_that_lands_is_no_alarm_at_its_friction_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """A light touch slides whatever it does; one that moves and presses as firmly as the others is told as it is."""
    words: list[str] = []

    def note(self: Sketch, x: float, y: float, text: str, *given: object, **look: object) -> float:
        words.append(text)
        return 0.0

    monkeypatch.setattr(Sketch, "draw_text", note)
    box = Box(0, 0, 400, 120)
    for normals, expected in (([0.2, 5.0], "light touch"), ([4.8, 5.0], "presses 4.8 N")):
        words.clear()
        panels.draw_gauges(Sketch(500, 120), box, 1.0, [0.99, 0.4], normals, movers=(0,))
        assert expected in words
        assert "presses 5.0 N" in words
    words.clear()
    panels.draw_gauges(Sketch(500, 120), box, 1.0, [0.99, 0.4], [0.2, 5.0], movers=())
    assert "presses 0.2 N" in words


def test_on_a_box_the_face_is_named() -> None:
    """The third finger is placed; its contact is on face D of a box whose side is where the ball's surface was."""
    plan = make_plan()
    point = plan.actions[PLACE].contacts_end[2].point_O
    box = BoxBody(0.035, abs(float(point[1])), 0.035)
    trace = swap_trace(make_trace(), box)
    heads = tell_story(plan, trace).chapters[PLACE].headlines
    assert [head.removesuffix(" on face D") != head for head in heads] == [True, True, True]
    told = Trace(trace.model_xml, trace.columns, {"captions": build_captions(plan, box)})
    assert tell_story(None, told).chapters == tell_story(plan, trace).chapters
    assert not any("face" in head for c in tell_story(plan, make_trace()).chapters for head in c.headlines)


def test_a_place_is_on_a_face_or_on_none() -> None:
    box = BoxBody(0.03, 0.02, 0.01)
    assert name_place(box, [0.03, 0.011, -0.004]) == "A"
    assert name_place(box, [0.0, -0.02, 0.0]) == "D"
    assert name_place(CylinderBody(0.03, 0.04), [0.03, 0.0, 0.0]) == ""
    assert name_place(CylinderBody(0.03, 0.04), [0.01, 0.0, -0.04]) == "B"
