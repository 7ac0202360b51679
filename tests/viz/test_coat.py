"""The coat of a body: it lies on the surface, faces outwards, its faces are told apart, and nothing of it is physics."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
import pytest
from other_bodies import BODIES, swap_body
from turning_run import make_trace

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.edged import BoxBody, CylinderBody
from dexplan.contact.bodies.names import name_body, name_flats
from dexplan.contact.bodies.polyhedron import PolyhedronBody
from dexplan.contact.bodies.smooth import BallBody
from dexplan.viz.body import read_body
from dexplan.viz.coat import build_coat
from dexplan.viz.dress import COAT, dress_model
from dexplan.viz.pattern import TINTS, is_on_arrow, trace_arrow

FINGERS = ("finger_1", "finger_2", "finger_3")
KINDS = tuple(BODIES)
PEN, RIMMED = BODIES["capsule"], CylinderBody(0.03, 0.04, 0.006)


@pytest.fixture(params=[*KINDS, "rimmed"])
def body(request: pytest.FixtureRequest) -> ConvexBody:
    return RIMMED if request.param == "rimmed" else BODIES[request.param]


def _read_models() -> Iterator[tuple[str, mujoco.MjModel]]:
    for kind, one in BODIES.items():
        yield kind, mujoco.MjModel.from_xml_string(swap_body(make_trace().model_xml, one))


def test_a_body_is_read_off_its_model() -> None:
    """Also a mesh, which MuJoCo moves to its centre of mass and turns to its axes of inertia."""
    for kind, model in _read_models():
        read = read_body(model)
        assert name_body(read) == kind
        directions = np.random.default_rng(0).normal(size=(50, 3))
        assert read is not None
        assert np.allclose(read.radial(directions), BODIES[kind].radial(directions), atol=1e-8), kind


def test_a_ball_is_a_ball_and_nothing_is_nothing() -> None:
    assert isinstance(read_body(mujoco.MjModel.from_xml_string(make_trace().model_xml)), BallBody)
    xml = '<mujoco><worldbody><geom name="g" size="1"/></worldbody></mujoco>'
    assert read_body(mujoco.MjModel.from_xml_string(xml)) is None
    assert name_body(None) == "object"


def test_the_coat_lies_on_the_surface_and_faces_outwards(body: ConvexBody) -> None:
    coat = build_coat(body)
    found = body.project(coat.corners)
    assert np.abs(found.distance).max() < 1e-9
    a, b, c = np.moveaxis(coat.corners[coat.triangles], 1, 0)
    turned = np.cross(b - a, c - a)
    areas = 0.5 * np.linalg.norm(turned, axis=1)
    assert areas.min() > 0.0
    assert (np.sum(turned * coat.normals[coat.triangles[:, 0]], axis=1) > 0.0).all()
    # Closed: the volume under the triangles is the body's, but for what is cut off at what is round.
    volume = np.sum(np.sum(a * np.cross(b, c), axis=1)) / 6.0
    assert volume == pytest.approx(body.solid.volume, rel=0.01)
    assert ((coat.places >= 0.0) & (coat.places <= 1.0)).all()


def test_every_place_of_the_coat_shows_its_own_face() -> None:
    """Seen at the middle of its triangles, off its letter, a box's face has its own tint, and six faces have six."""
    box = BODIES["box"]
    coat = build_coat(box)
    side = len(coat.picture)
    seen = []
    for triangle in coat.triangles:
        weights = np.random.default_rng(1).dirichlet([1.0, 1.0, 1.0], 400)
        columns, rows = np.floor(side * (weights @ coat.places[triangle])).astype(int).T
        colors, counts = np.unique(coat.picture[rows, columns], axis=0, return_counts=True)
        k = int(np.argmax([f.normal @ coat.normals[triangle[0]] for f in box.flats]))
        assert tuple(colors[np.argmax(counts)]) == TINTS[k]
        seen.append(k)
    assert sorted(set(seen)) == list(range(6))
    assert len(set(TINTS)) == 6


def test_letters_belong_to_faces() -> None:
    assert name_flats(BODIES["box"]) == tuple("ABCDEF")
    assert name_flats(BODIES["cylinder"]) == ("A", "B")
    assert name_flats(BODIES["ellipsoid"]) == ()
    many = BODIES["polyhedron"]
    assert len(many.flats) > 26
    assert set(name_flats(many)) == {""}


def test_the_arrow_is_where_its_ghost_is_drawn(body: ConvexBody) -> None:
    """The goal's ghost lies over the painted arrow when the object is there, and repeats after a whole turn only."""
    shaft, *wings = trace_arrow(body, 0.0)
    assert is_on_arrow(body, shaft[:-1]).all()
    assert len(wings) == 2
    raised = trace_arrow(body, 0.003)
    away = body.project(np.concatenate(raised)).distance
    assert away.min() > 0.002
    assert away.max() < 0.003 + 1e-9
    points = body.radial(np.random.default_rng(0).normal(size=(4000, 3)))
    before = is_on_arrow(body, points)
    for flip in ([-1, -1, 1], [1, -1, -1], [-1, 1, -1]):
        assert (is_on_arrow(body, points * flip) != before).mean() > 0.005, flip


@pytest.mark.parametrize("kind", ["box", "polyhedron"])
def test_physics_is_the_same_bit_for_bit(kind: str) -> None:
    xml = swap_body(make_trace().model_xml, BODIES[kind])
    plain, dressed = mujoco.MjModel.from_xml_string(xml), dress_model(xml, FINGERS)
    for name in ("body_mass", "body_inertia", "body_ipos", "body_iquat", "dof_armature", "body_subtreemass"):
        assert np.array_equal(getattr(dressed, name), getattr(plain, name)), name
    coat = dressed.geom(COAT)
    assert not coat.contype.any()
    assert not coat.conaffinity.any()
    runs = []
    for model in (plain, dressed):
        data = mujoco.MjData(model)
        data.qpos[:] = make_trace()["qpos"][0]
        for _ in range(100):
            mujoco.mj_step(model, data)
        runs.append(np.concatenate([data.qpos, data.qvel]))
    assert np.array_equal(*runs)


def test_a_prism_has_its_faces() -> None:
    """Faces of several triangles are one piece each."""
    angles = np.arange(6) * np.pi / 3.0
    rims = [[0.03 * np.cos(a), 0.03 * np.sin(a), z] for a in angles for z in (-0.02, 0.02)]
    prism = PolyhedronBody(np.array(rims))
    assert len(prism.flats) == 8
    coat = build_coat(prism)
    assert len(coat.corners) == 6 * 4 + 2 * 6
    assert isinstance(BODIES["box"], BoxBody)
