"""The picture of a refusal: how far contacts are out of reach, and by how much friction cones miss."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from small_hand import MU, make_hand
from turning_run import make_plan

from dexplan.contact.bodies.edged import BoxBody
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.regions.regions import compute_regions
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.spatial import Array, direction_from_angles, make_pose
from dexplan.viz.refusal import draw_refusal
from dexplan.viz.sections import Asked, find_sections, find_widest
from dexplan.viz.site_refusal import find_site_sections


@pytest.fixture(scope="module")
def hand() -> HandModel:
    return make_hand()


def _ask(*azimuths: float | None) -> Asked:
    return tuple(None if a is None else direction_from_angles(a, 0.0) for a in azimuths)


def _refuse(hand: HandModel, status: Status, shift: Array | None = None) -> Plan:
    home = hand.object.X_WO_home
    goal = home if shift is None else make_pose(home[:3, :3], home[:3, 3] + shift)
    plan = replace(make_plan(), status=status, reason="made by hand: $nothing$ moves", actions=())
    return replace(plan, X_WO_start=home, X_WO_goal=goal)


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Every text that is written into a picture."""
    words: list[str] = []
    for owner, name, place in (
        (Figure, "text", 2),
        (Axes, "text", 2),
        (Axes, "annotate", 0),
        (Axes, "set_title", 0),
    ):
        write = getattr(owner, name)

        def spy(self, *given, _write=write, _place=place, **look):
            words.append(str(given[_place]))
            return _write(self, *given, **look)

        monkeypatch.setattr(owner, name, spy)
    return words


def test_cones_miss_by_what_geometry_says(hand: HandModel) -> None:
    """Two contacts 110 degrees apart make 35 degrees with their chord; the cone reaches atan mu."""
    regions = compute_regions(hand, hand.object.X_WO_home)
    (section,) = find_sections(hand, regions, _ask(0.0, 110.0, None))
    assert section.fingers == (0, 1)
    assert np.degrees(section.missed) == pytest.approx(35.0 - np.degrees(np.arctan(MU)))
    assert "110° apart, 138° asked for" in str(section)
    assert section.rule == "cones meet from 134° apart, planning asks for 138° to keep a margin"
    assert "misses the other contact by 12.1°" in str(section)
    (opposite,) = find_sections(hand, regions, _ask(0.0, 180.0, None))
    assert opposite.missed < 0.0
    assert "the cones meet" in str(opposite)


def test_pairs_left_to_the_planner_are_shown_at_their_widest(hand: HandModel) -> None:
    regions = compute_regions(hand, hand.object.X_WO_home)
    sections = find_sections(hand, regions, None)
    assert [section.fingers for section in sections] == [(0, 1), (0, 2), (1, 2)]
    assert all(np.degrees(section.angle) > 177.0 for section in sections)
    far = compute_regions(hand, make_pose(p=hand.object.X_WO_home[:3, 3] + [0.0, 0.0, 0.5]))
    assert find_widest(far, 0, 1) is None
    assert find_sections(hand, far, None) == []


def test_a_contact_out_of_reach_is_told_by_how_much(hand: HandModel, tmp_path: Path, said: list[str]) -> None:
    path = tmp_path / "deep" / "refusal.png"
    plan = _refuse(hand, Status.START_UNREACHABLE)
    draw_refusal(hand, plan, _ask(-150.0, 120.0, 240.0), None, path, "odd_start")
    assert path.read_bytes().startswith(b"\x89PNG")
    assert [entry.name for entry in path.parent.iterdir()] == ["refusal.png"]
    (told,) = [words for words in said if words.startswith("out of reach by ")]
    assert 50 < float(told.removeprefix("out of reach by ").removesuffix("°")) < 90
    assert "odd_start: refused, start_unreachable" in said
    assert "at the start" in said
    assert "at the goal" not in said


def test_a_goal_that_nothing_reaches_is_drawn(hand: HandModel, tmp_path: Path, said: list[str]) -> None:
    plan = _refuse(hand, Status.GOAL_UNREACHABLE, np.array([0.0, 0.0, 0.5]))
    draw_refusal(hand, plan, None, None, tmp_path / "refusal.png")
    assert said.count("reaches nothing here") == 3
    assert "at the start" not in said


def test_a_refusal_about_the_way_shows_both_ends_and_is_the_same_each_time(
    hand: HandModel, tmp_path: Path, said: list[str]
) -> None:
    plan = replace(_refuse(hand, Status.NO_GAIT), reason="word " * 500)
    pictures = [
        draw_refusal(hand, plan, _ask(0.0, 120.0, None), None, tmp_path / f"{k}.png").read_bytes()
        for k in range(2)
    ]
    assert pictures[0] == pictures[1]
    assert said.count("at the start") == said.count("at the goal") == 2


def _box_hand(hand: HandModel) -> HandModel:
    return replace(hand, object=replace(hand.object, body=BoxBody(0.03, 0.026, 0.031)))


def test_neighbouring_faces_of_a_box_never_hold_and_opposite_ones_do(hand: HandModel) -> None:
    box = _box_hand(hand)
    asked = (np.array([0.03, 0.0, 0.0]), np.array([0.0, 0.026, 0.0]), np.array([-0.03, 0.004, 0.0]))
    sections = {s.fingers: s for s in find_site_sections(box, asked)}
    assert "a cone misses the other contact by " in str(sections[0, 1])
    assert sections[0, 1].lean > np.pi / 4.0 - 1e-9
    assert "the cones meet" in str(sections[0, 2])
    assert np.degrees(sections[0, 2].lean) == pytest.approx(np.degrees(np.arctan(4.0 / 60.0)))
    assert find_site_sections(box, (asked[0], None, None)) == []


def test_a_refusal_about_a_box_is_drawn_on_the_box(hand: HandModel, tmp_path: Path, said: list[str]) -> None:
    asked = (np.array([0.03, 0.0, 0.0]), np.array([0.0, 0.026, 0.0]), None)
    plan = _refuse(hand, Status.START_UNREACHABLE)
    path = draw_refusal(_box_hand(hand), plan, asked, None, tmp_path / "refusal.png", "odd_box")
    assert path.read_bytes().startswith(b"\x89PNG")
    assert "odd_box: refused, start_unreachable" in said
    assert sum(words.startswith("finger ") and words.endswith("of the box") for words in said) == 3
    assert any(words.startswith("✗ fingers 1 and 2: the line leans") for words in said)
    assert {"A", "C"} <= set(said)


def test_contacts_asked_for_at_the_start_alone_are_looked_at(
    hand: HandModel, tmp_path: Path, said: list[str]
) -> None:
    asked = (np.array([0.03, 0.0, 0.0]), np.array([0.0, 0.026, 0.0]), None)
    draw_refusal(_box_hand(hand), _refuse(hand, Status.NO_GAIT), asked, None, tmp_path / "refusal.png")
    assert {"at the start", "at the goal"} <= set(said)
    assert any("contacts asked for, at the start" in words for words in said)
