"""Maps of sites: a ball seen as any body agrees with its closed forms, and a box's faces are what a stranger expects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from other_bodies import BODIES
from small_hand import make_hand

from dexplan.contact.bodies.edged import BoxBody
from dexplan.contact.bodies.sites import EDGE_BAND
from dexplan.planning.admissible.admissibility import Margins
from dexplan.planning.admissible.hand import HandModel
from dexplan.viz import site_reach
from dexplan.viz.body_view import look_from
from dexplan.viz.maps import describe_reach, draw_reach
from dexplan.viz.palette import as_rgb, get_finger_color
from dexplan.viz.reach import compute_reach
from dexplan.viz.site_reach import compute_site_reach, find_faces


def hold(body: object) -> HandModel:
    """Return the small hand around another body."""
    hand = make_hand()
    return replace(hand, object=replace(hand.object, body=body))


class _NoLoads:
    """Stands for the judge of states where a test is about places alone."""

    def __init__(self, hand: HandModel) -> None:
        pass

    def compute_margins(self, *asked: object) -> Margins:
        return Margins(joint=0.2, dexterity=0.5, load=0.5, torque=0.3, clearance=0.01)


@pytest.fixture
def _without_loads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(site_reach, "Admissibility", _NoLoads)


def test_a_ball_seen_as_any_body_agrees_with_its_closed_forms(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regions are shares of the surface there, and shares of evenly spread sites here; loads are of like placements."""
    monkeypatch.setattr(site_reach, "PLACEMENTS", 30)
    hand = make_hand()
    sites, known = compute_site_reach(hand), compute_reach(hand)
    for finger, region in enumerate(known.regions.contactable):
        assert sites.lands[finger].mean() == pytest.approx(region.area / (4.0 * np.pi), abs=0.03)
    for pair in sites.pairs:
        i, j = pair.fingers
        for own, other in ((i, j), (j, i)):
            held = sites.lands[own] & sites.holds(own, (other,))
            inside = known.regions.pair(own, other).contains(sites.sites.normals)
            # The planner's margin, and partners only where there are sites, leave a border out.
            assert (held & ~inside).sum() <= 3
            assert (inside & ~held).mean() < 0.06
        assert pair.is_admissible.any()
    assert 2.0 * sites.lean_max == pytest.approx(np.pi - known.phi_min)


@pytest.mark.usefixtures("_without_loads")
def test_a_box_is_held_across_opposite_faces() -> None:
    """Each site that holds has an opposite one on the opposite face; neighbouring faces never hold."""
    hand = hold(BoxBody(0.03, 0.027, 0.025))
    reach = compute_site_reach(hand)
    assert set(reach.face.tolist()) == set(range(6))
    assert (hand.object.body.measure_edge_distance(reach.sites.points) >= EDGE_BAND - 1e-9).all()
    for pair in reach.pairs:
        faces = [set(reach.face[held].tolist()) for held in pair.holds]
        assert {k ^ 1 for k in faces[0]} == faces[1]
        assert pair.count > 0
    both = reach.holds(0, (1, 2))
    assert (both <= reach.holds(0, (1,))).all()
    assert (reach.holds(0, (1,)) <= reach.lands[0]).all()


@pytest.mark.usefixtures("_without_loads")
@pytest.mark.parametrize("kind", ["box", "cylinder", "polyhedron"])
def test_text_names_the_body_and_its_faces(kind: str) -> None:
    text = describe_reach(hold(BODIES[kind]))
    assert f"on the {kind}" in text
    assert "ball" not in text
    assert "equator" not in text
    assert ("by face: A" in text) == (kind != "polyhedron")


@pytest.mark.usefixtures("_without_loads")
def test_picture_shows_every_finger(tmp_path: Path) -> None:
    pixels = imread(draw_reach(hold(BODIES["box"]), tmp_path / "inspect.png"))[..., :3]
    for finger in range(3):
        share = (np.abs(pixels - as_rgb(get_finger_color(finger))).max(axis=-1) < 0.02).mean()
        assert share > 0.002


def test_faces_of_points() -> None:
    box = BODIES["box"]
    points = np.stack([flat.center for flat in box.flats])
    assert find_faces(box, points).tolist() == list(range(6))
    assert find_faces(BODIES["ellipsoid"], BODIES["ellipsoid"].radial(np.eye(3))).tolist() == [-1, -1, -1]


def test_a_view_looks_from_where_it_says() -> None:
    sight = look_from(30.0, np.eye(3), 0.0)
    towards = np.array([np.cos(np.radians(30.0)), np.sin(np.radians(30.0)), 0.0])
    assert sight.sees(towards)
    assert not sight.sees(-towards)
    assert np.allclose(sight.project(np.array([0.0, 0.0, 1.0])), [0.0, 1.0])
    # What is to the left of who looks inwards, seen from above counterclockwise, is on the right in the picture.
    assert np.allclose(sight.project(np.array([-towards[1], towards[0], 0.0])), [1.0, 0.0])
