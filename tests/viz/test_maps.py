"""Maps of reach: numbers against the closed form of a pair's load, and a picture that shows every finger."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from small_hand import MU, make_hand

from dexplan.kinematics.workspace import Workspace
from dexplan.planning.admissible.hand import HandModel
from dexplan.scene.description import ContactCone
from dexplan.viz import reach as questions
from dexplan.viz.maps import describe_reach, draw_reach
from dexplan.viz.palette import as_rgb, get_finger_color
from dexplan.viz.reach import compute_reach


@pytest.fixture(scope="module")
def hand() -> HandModel:
    return make_hand()


@pytest.fixture(autouse=True)
def _coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(questions, "PLACEMENTS", 40)


def test_regions_and_pairs_cover_the_hand(hand: HandModel) -> None:
    reach = compute_reach(hand)
    assert len(reach.regions.contactable) == 3
    assert all(0.2 < region.area / (4.0 * np.pi) < 0.5 for region in reach.regions.contactable)
    assert [loads.fingers for loads in reach.loads] == [(0, 1), (0, 2), (1, 2)]
    assert np.allclose(reach.azimuths, [0.0, 120.0, -120.0], atol=1e-4)
    assert np.degrees(reach.phi_min) == pytest.approx(180.0 - 2.0 * np.degrees(np.arctan(MU)))
    assert compute_reach(hand) is reach


def test_no_pair_below_the_force_closed_angle_is_admissible(hand: HandModel) -> None:
    reach = compute_reach(hand)
    for loads in reach.loads:
        assert loads.is_admissible.any()
        assert (loads.angle[loads.is_admissible] > reach.phi_min).all()
        assert np.isfinite(loads.load[loads.is_admissible]).all()
        assert sum(loads.refusals.values()) == (~loads.is_admissible).sum()


def test_load_margin_is_that_of_the_closed_form(hand: HandModel) -> None:
    """Opposite contacts carry the weight by friction alone: utilisation mg / (2 mu N) at the planner's squeeze N."""
    loads = compute_reach(hand).loads[0]
    opposite = loads.is_admissible & (loads.angle > np.radians(179.0))
    assert opposite.any()
    used = 0.060 * 9.81 / (2.0 * MU * hand.normal_force)
    assert np.allclose(loads.load[opposite], 1.0 - used, atol=0.01)


def test_text_has_a_line_per_finger_and_per_pair(hand: HandModel) -> None:
    text = describe_reach(hand)
    lines = text.splitlines()
    assert "believed friction: sliding 0.423, torsional 1.92 mm" in lines[0]
    assert "134.1 deg" in lines[0]
    assert [line.split()[0] for line in lines if line.startswith("  finger_")] == [
        "finger_1",
        "finger_2",
        "finger_3",
    ]
    pairs = [line for line in lines if line.startswith("  fingers ")]
    assert [line.split()[1:3] for line in pairs] == [["1", "2"], ["1", "3"], ["2", "3"]]
    assert "nan" not in text
    assert "inf" not in text


def test_picture_shows_every_finger(hand: HandModel, tmp_path: Path) -> None:
    path = draw_reach(hand, tmp_path / "deep" / "inspect.png")
    assert [entry.name for entry in path.parent.iterdir()] == ["inspect.png"]
    pixels = imread(path)[..., :3]
    for finger in range(3):
        share = (np.abs(pixels - as_rgb(get_finger_color(finger))).max(axis=-1) < 0.02).mean()
        assert share > 0.005


def test_a_hand_that_reaches_nothing_is_drawn_and_described(hand: HandModel, tmp_path: Path) -> None:
    empty = tuple(
        Workspace(w.chain, w.postures[:0], w.positions[:0], w.poles[:0], w.joint_margin[:0], w.spin[:0], 0, 1)
        for w in hand.workspaces
    )
    idle = HandModel(hand.fingers, hand.object, empty, hand.friction, hand.probe)
    draw_reach(idle, tmp_path / "inspect.png")
    text = describe_reach(idle)
    assert text.count("nothing") == 3
    assert text.count("none") == 3


def test_pairs_are_only_asked_about_where_contacts_are_allowed(hand: HandModel) -> None:
    """Cones around finger 1's side and the side opposite: fingers 2 and 3 are 120 degrees apart and share none of them."""
    half = np.radians(25.0)
    cones = tuple(ContactCone(np.array(axis), half) for axis in ([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]))
    cut = replace(hand, object=replace(hand.object, allowed_regions=cones))
    for loads in compute_reach(cut).loads:
        region = compute_reach(cut).regions.pair(*loads.fingers)
        assert loads.is_admissible.any() <= (not region.is_empty)
    assert not compute_reach(cut).loads[2].is_admissible.any()
    line = describe_reach(cut).splitlines()[-1]
    assert line.split()[:6] == ["fingers", "2", "3", "0", "of", "0"]
    assert "no allowed contacts" in line
