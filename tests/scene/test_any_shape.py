"""Every shape as a scene: what MuJoCo compiled is what was asked for, in the axes in which it was asked."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from dexplan.contact.bodies.edged import CylinderBody
from dexplan.contact.bodies.polyhedron import PolyhedronBody
from dexplan.errors import DexplanError, UnknownNameError
from dexplan.scene.compose import build_model_xml
from dexplan.scene.description import SceneParameters
from dexplan.scene.object_parts import compute_mass_properties
from dexplan.scene.scene import Scene, build_scene, scene_from_xml
from dexplan.scene.shape import Shape

RNG = np.random.default_rng(3)
CLOUD = tuple(map(tuple, np.round(RNG.normal(size=(30, 3)) * [0.02, 0.012, 0.03] + 0.004, 5).tolist()))
SHAPES = {
    "ball": Shape.ball(0.031),
    "egg": Shape("ellipsoid", (0.03, 0.027, 0.04)),
    "capsule": Shape("capsule", (0.012, 0.04)),
    "cylinder": Shape("cylinder", (0.03, 0.035, 0.0)),
    "rounded": Shape("cylinder", (0.03, 0.035, 0.004)),
    "box": Shape("box", (0.03, 0.02, 0.04)),
    "cloud": Shape("polyhedron", vertices=CLOUD),
}


def build(shape: Shape, **changes: object) -> Scene:
    return build_scene(SceneParameters(object_shape=shape, object_mass=0.083, **changes))


@pytest.mark.parametrize("name", SHAPES)
def test_what_is_compiled_is_what_was_asked_for(name: str) -> None:
    shape = SHAPES[name]
    scene, body = build(shape), shape.as_body()
    assert type(scene.object.body) is type(body)
    around = RNG.normal(size=(200, 3)) * 1.5 * body.bound
    found, asked = scene.object.body.project(around), body.project(around)
    np.testing.assert_allclose(found.distance, asked.distance, atol=1e-8)
    solid = body.solid
    properties = scene.object.mass_properties
    assert properties.mass == pytest.approx(0.083, rel=1e-9)
    np.testing.assert_allclose(properties.com, solid.com, atol=1e-9)
    inertia = 0.083 / solid.volume * solid.inertia
    np.testing.assert_allclose(properties.inertia, inertia, atol=1e-7 * inertia.max())


@pytest.mark.parametrize("name", SHAPES)
def test_mujoco_measures_to_the_same_surface(name: str) -> None:
    """Tip against object, the object turned: the distance that MuJoCo finds is that of ``project``."""
    shape = SHAPES[name]
    scene = build(shape)
    data, tip = mujoco.MjData(scene.model), int(scene.tip_geoms[0])
    q = np.stack([finger.q_home for finger in scene.fingers])
    X_WO = scene.object.X_WO_home.copy()
    # A cylinder with a rounded rim is a polyhedron for MuJoCo, which is so near to it.
    tolerance = 3e-5 if name == "rounded" else 2e-7
    for turn in RNG.normal(size=(12, 4)):
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, turn / np.linalg.norm(turn))
        X_WO[:3, :3] = R.reshape(3, 3)
        data.qpos[:] = scene.as_qpos(q, X_WO)
        mujoco.mj_kinematics(scene.model, data)
        found = mujoco.mj_geomDistance(scene.model, data, tip, scene.object_geom, 1.0, None)
        center = X_WO[:3, :3].T @ (data.geom_xpos[tip] - X_WO[:3, 3])
        asked = scene.object.body.project(center).distance - scene.fingers[0].tip_radius
        assert found == pytest.approx(asked, abs=tolerance)


@pytest.mark.parametrize("name", ["ball", "box", "cloud", "rounded"])
def test_centre_of_mass_and_inertia_as_given(name: str) -> None:
    com = (0.003, -0.002, 0.005)
    inertia = ((5e-5, 1e-6, -2e-6), (1e-6, 4e-5, 3e-6), (-2e-6, 3e-6, 3e-5))
    scene = build(SHAPES[name], object_com=com, object_inertia=inertia)
    properties = scene.object.mass_properties
    np.testing.assert_allclose(properties.com, com, atol=1e-9)
    np.testing.assert_allclose(properties.inertia, inertia, atol=1e-12)
    # The frame of the body is where it was: home is the origin's pose, not the centre of mass's.
    np.testing.assert_allclose(scene.object.X_WO_home[:3, 3], [0.0, 0.0, 0.16], atol=1e-12)


def test_centre_of_mass_alone_keeps_the_inertia() -> None:
    parameters = SceneParameters(object_shape=SHAPES["box"], object_mass=0.083, object_com=(0.0, 0.0, -0.01))
    solid = SHAPES["box"].as_body().solid
    own = compute_mass_properties(parameters)
    np.testing.assert_allclose(own.inertia, 0.083 / solid.volume * solid.inertia)
    np.testing.assert_allclose(
        build_scene(parameters).object.mass_properties.inertia, own.inertia, rtol=1e-8, atol=1e-12
    )


@pytest.mark.parametrize("name", SHAPES)
def test_fingers_at_home_stand_clear(name: str) -> None:
    scene = build(SHAPES[name])
    data = mujoco.MjData(scene.model)
    data.qpos[:] = scene.as_qpos(np.stack([f.q_home for f in scene.fingers]), scene.object.X_WO_home)
    mujoco.mj_forward(scene.model, data)
    assert data.ncon == 0


def test_a_mesh_that_is_not_its_cylinder_is_refused() -> None:
    xml = build_model_xml(SceneParameters(object_shape=SHAPES["rounded"]))
    changed = xml.replace('data="0.03 0.035 0.004"', 'data="0.03 0.036 0.004"')
    assert changed != xml
    assert isinstance(scene_from_xml("rounded", xml).object.body, CylinderBody)
    with pytest.raises(DexplanError, match="is not the cylinder"):
        scene_from_xml("changed", changed)


def test_a_prism_keeps_its_faces_whole() -> None:
    """Single precision in MuJoCo must not break a face into triangles with edges between them."""
    around = np.radians(60.0 * np.arange(6) + 11.0)
    ring = 0.03 * np.column_stack([np.cos(around), np.sin(around)])
    points = [(*map(float, xy), z) for z in (-0.04, 0.04) for xy in ring]
    body = build(Shape("polyhedron", vertices=tuple(points))).object.body
    assert isinstance(body, PolyhedronBody)
    assert len(body.flats) == 8


@pytest.mark.parametrize(
    ("kind", "sizes", "error"),
    [
        ("cube", (0.03, 0.03, 0.03), UnknownNameError),
        ("box", (0.03,), ValueError),
        ("box", (0.03, -0.03, 0.03), ValueError),
        ("cylinder", (0.03, 0.03, 0.04), ValueError),
        ("polyhedron", (), ValueError),
    ],
)
def test_shapes_that_are_none(kind: str, sizes: tuple[float, ...], error: type[Exception]) -> None:
    with pytest.raises(error):
        Shape(kind, sizes)
