"""Marks on the things of a picture: goals and targets through the real renderer, cones and forces by their corners."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from matplotlib.image import imread
from other_bodies import BODIES, swap_trace
from turning_run import make_plan, make_trace

from dexplan.plans.contacts import GoalContact
from dexplan.sim.trace import Trace
from dexplan.spatial import Array, make_pose, rotate_about
from dexplan.viz import marks
from dexplan.viz.dress import dress_model
from dexplan.viz.facts import Facts, compute_facts
from dexplan.viz.film import FilmOptions
from dexplan.viz.frames import draw_frames
from dexplan.viz.palette import as_rgb, get_finger_color, get_share_color
from dexplan.viz.sketch import Sketch
from dexplan.viz.stage import Projection, choose_azimuth
from dexplan.viz.story import tell_story
from dexplan.viz.video import render_frame

UP = np.array([0.0, 0.0, 1.0])
RADIUS = 0.035
PLAIN = FilmOptions((240, 240), ("top",), is_told=False)
FINGERS = ("finger_1", "finger_2", "finger_3")


def draw(path: Path, *goals: GoalContact | None) -> Array:
    """Return the middle of the picture (H, W, 3) from above at the start of a run that stays where it is."""
    plan = replace(make_plan(0.0), goal_contacts=goals or None)
    trace = make_trace(0.0)
    free = Trace(
        trace.model_xml, {k: v for k, v in trace.columns.items() if k != "contact_force"}, trace.meta
    )
    render_frame(free, 0.0, path, plan=plan, options=PLAIN)
    return np.asarray(imread(path)[80:160, 80:160, :3], dtype=float)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Array:
    return draw(tmp_path_factory.mktemp("plain") / "plain.png")


def test_a_goal_on_top_of_the_ball_is_seen_from_above_in_its_fingers_colour(
    plain: Array, tmp_path: Path
) -> None:
    goals = [GoalContact(f, RADIUS * UP, UP) if f == 1 else None for f in range(3)]
    marked = draw(tmp_path / "1.png", *goals)
    changed = np.abs(marked - plain).max(axis=2) > 0.1
    rows, columns = np.nonzero(changed)
    assert 12 < changed.sum() < 250
    # A knob where the ball's top is: the camera stands 20 mm beside it, 820 mm above the floor, and sees 38 degrees.
    beside = 120.0 / np.tan(np.radians(19.0)) * 0.02 / (0.82 - 0.16 - RADIUS)
    assert np.array([rows.mean(), columns.mean()]) == pytest.approx([39.5 - beside, 39.5], abs=1.5)
    # Dark, and of the finger's hue.
    colour, own = marked[changed].mean(axis=0), np.array(as_rgb(get_finger_color(1)))
    assert colour.max() < 0.75 * own.max()
    assert np.argmax(colour) == np.argmax(own)


def test_a_goal_below_the_ball_is_hidden(plain: Array, tmp_path: Path) -> None:
    below = draw(tmp_path / "below.png", GoalContact(0, -RADIUS * UP, -UP), None, None)
    assert np.array_equal(plain, below)


class _Corners(Sketch):
    """Remembers the polygons that are drawn, with their colours."""

    def __init__(self) -> None:
        super().__init__(400, 400)
        self.polygons: list[tuple[Array, str | None]] = []

    def draw_polygon(self, points: Any, fill: str | None = None, *given: Any, **more: Any) -> None:
        self.polygons.append((np.asarray(points), fill))


def look_down() -> Projection:
    """Return a camera a metre above the origin that looks down, 1000 pixels per unit of slope."""
    axes = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
    return Projection(np.array([0.0, 0.0, 1.0]), axes, 1000.0, np.array([200.0, 200.0]))


@pytest.fixture(scope="module")
def facts() -> Facts:
    trace, plan = make_trace(), make_plan()
    return compute_facts(trace, tell_story(plan, trace), dress_model(trace.model_xml, FINGERS), FINGERS)


def _draw_one(
    facts: Facts, force: tuple[float, ...], turn_deg: float = 0.0
) -> Iterator[tuple[Array, str | None]]:
    """Yield the polygons of the first finger's cone: contact at (R, 0, 0) of an object that is turned about the vertical."""
    trace = make_trace()
    one = np.full((1, 3, 4), np.nan)
    one[0, 0] = force
    frame = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    columns = {
        "contact_force": one,
        "contact_point_O": np.broadcast_to([RADIUS, 0.0, 0.0], (1, 3, 3)),
        "contact_rotation_O": np.broadcast_to(frame, (1, 3, 3, 3)),
    }
    share = np.hypot(force[0], force[1]) / facts.sliding / force[2]
    only = replace(facts, share=np.array([[share, np.nan, np.nan]]))
    sketch = _Corners()
    X_WO = make_pose(rotate_about(UP, np.radians(turn_deg)), np.zeros(3))
    marks.draw_cones(sketch, look_down(), X_WO, Trace(trace.model_xml, columns, {}), 0, only)
    yield from sketch.polygons


def test_a_cone_opens_into_the_object_from_the_contact(facts: Facts) -> None:
    """Seen from above: its point at the contact, as high as the normal force is strong, as wide as friction says."""
    (cone, color), (arrow, _) = _draw_one(facts, (0.0, 0.0, 5.0, 0.0))
    height = 5.0 * marks.FORCE_LENGTH
    assert cone[:, 0].max() == pytest.approx(200.0 + 1000.0 * RADIUS, abs=0.01)
    assert cone[:, 0].min() == pytest.approx(200.0 + 1000.0 * (RADIUS - height), rel=0.02)
    # Rims are nearer to the camera and further away.
    assert np.ptp(cone[:, 1]) == pytest.approx(2000.0 * facts.sliding * height, rel=0.03)
    assert color == get_share_color(0.0)
    assert arrow[:, 0].min() == pytest.approx(200.0 + 1000.0 * (RADIUS - height), abs=0.01)


def test_a_force_that_slides_lies_on_the_cones_edge(facts: Facts) -> None:
    """In the contact's own axes: its first tangent is y here, which is up in the picture."""
    (cone, color), (arrow, _) = _draw_one(facts, (facts.sliding * 5.0, 0.0, 5.0, 0.0))
    head = arrow[3]
    assert np.linalg.norm(cone - head, axis=1).min() < 0.6
    assert head[1] < 200.0 - 5.0
    assert color == get_share_color(1.0)


def test_cones_turn_with_the_object(facts: Facts) -> None:
    (cone, _), _ = _draw_one(facts, (0.0, 0.0, 5.0, 0.0), turn_deg=90.0)
    tip = cone[np.argmin(cone[:, 1])]
    assert tip == pytest.approx([200.0, 200.0 - 1000.0 * RADIUS], abs=0.01)


def test_no_cone_without_a_force(facts: Facts) -> None:
    assert list(_draw_one(facts, (np.nan, 0.0, 5.0, 0.0))) == []
    assert list(_draw_one(facts, (0.0, 0.0, 0.01, 0.0))) == []


def test_shares_of_friction_get_darker_towards_sliding() -> None:
    """So that they can be told without seeing hues."""
    brightness = [
        float(as_rgb(get_share_color(s)) @ [0.299, 0.587, 0.114]) for s in np.linspace(0.0, 1.0, 21)
    ]
    assert (np.diff(brightness) < 0.0).all()
    assert brightness[0] - brightness[-1] > 0.5
    assert get_share_color(1.7) == get_share_color(1.0)


def test_a_row_that_stops_early_says_how_much_there_is_more(tmp_path: Path) -> None:
    """A word in the lower right corner under the last picture, and none under a row that ends with the run."""
    corners = []
    for most in (2, 4):
        picture = imread(
            draw_frames(make_trace(), make_plan(), tmp_path / f"{most}.png", most=most, columns=2)
        )
        height, width = picture.shape[:2]
        line = 0.25 * 110 / max(1, most // 2)
        corners.append(picture[int(height - line) :, int(0.85 * width) :, :3])
    ink = [(corner < 0.5).any(axis=2).sum() for corner in corners]
    assert ink[0] > 15
    assert ink[1] == 0


def test_the_close_up_stands_between_two_fingers() -> None:
    model = mujoco.MjModel.from_xml_string(make_trace().model_xml)
    thing = model.body("object/").id
    assert choose_azimuth(model, thing) % 360.0 == pytest.approx(300.0, abs=0.01)
    third = model.body("finger_3/")
    model.body_pos[third.id, :2] = [0.0, -0.18]
    assert choose_azimuth(model, thing) % 360.0 == pytest.approx(195.0, abs=0.01)


def test_the_goals_ghost_is_seen_on_a_box(tmp_path: Path) -> None:
    """A box that has to be turned shows where its arrow has to end, in the ghost's colour; at rest there is none."""
    seen = []
    for turn in (0.0, 90.0):
        trace = swap_trace(make_trace(turn), BODIES["box"])
        bare = {k: v for k, v in trace.columns.items() if k != "contact_force"}
        path = tmp_path / f"{turn}.png"
        render_frame(Trace(trace.model_xml, bare, {}), 0.0, path, plan=make_plan(turn), options=PLAIN)
        pixels = np.asarray(imread(path)[80:160, 80:160, :3], dtype=float)
        seen.append(((pixels[..., 2] - pixels[..., 0]) > 0.2).sum())
    assert seen[1] > seen[0] + 20
