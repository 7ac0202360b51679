"""The judge's own idea of shapes: what the scene writes is what the problem says, and every change of it is seen."""

from __future__ import annotations

import re
from typing import Any

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch

from dexplan import pipeline
from dexplan.problems.read import build_problem
from dexplan.scene.shape import Shape
from dexplan.sim.judge.object_shape import (
    find_departures_of_object,
    has_edges,
    integrate,
    measure_edge_distance,
)
from dexplan.sim.judge.reading import Reader, build_sensed_model
from dexplan.sim.judge.world import read_world
from dexplan.spatial import make_pose, rotate_about

RNG = np.random.default_rng(5)
CLOUD = np.round(RNG.normal(size=(24, 3)) * [0.02, 0.014, 0.03] + 0.003, 5).tolist()
SHAPES: dict[str, dict[str, Any]] = {
    "egg": {"kind": "ellipsoid", "semi_axes_m": [0.03, 0.027, 0.04]},
    "capsule": {"kind": "capsule", "radius_m": 0.014, "half_length_m": 0.04},
    "cylinder": {"kind": "cylinder", "radius_m": 0.03, "half_length_m": 0.035},
    "rounded": {"kind": "cylinder", "radius_m": 0.03, "half_length_m": 0.035, "rim_m": 0.004},
    "box": {"kind": "box", "half_sizes_m": [0.03, 0.02, 0.04]},
    "cloud": {"kind": "mesh", "vertices_m": CLOUD},
}
ROUND = np.array([[np.cos(a), np.sin(a)] for a in np.arange(24) * np.pi / 12]) * 0.03
SHAPES["faceted"] = {"kind": "mesh", "vertices_m": [[*p, z] for p in ROUND.tolist() for z in (-0.03, 0.03)]}
GIVEN = {
    "com_m": [0.004, -0.003, 0.002],
    "inertia_kg_m2": [[5e-5, 4e-6, 0.0], [4e-6, 6e-5, -3e-6], [0.0, -3e-6, 4e-5]],
}


def build(shape: dict[str, Any], **given: Any) -> tuple[mujoco.MjModel, dict[str, Any]]:
    """Return a compiled scene, and its problem's object as data."""
    asked = {"shape": shape, "mass_kg": 0.083, **given}
    turn = {"rotation": {"axis": [0.0, 0.0, 1.0], "angle_deg": 30.0}}
    problem = build_problem({"format": 1, "name": "a_shape", "object": asked, "goal": turn})
    return pipeline.build_scene(problem).model, problem.as_dict()["object"]


def list_departures(model: mujoco.MjModel, section: dict[str, Any]) -> list[str]:
    return list(find_departures_of_object(model, model.geom("object/surface").id, section))


@pytest.mark.parametrize("given", [{}, GIVEN], ids=["homogeneous", "given"])
@pytest.mark.parametrize("name", SHAPES)
def test_what_the_scene_writes_is_the_problem(name: str, given: dict[str, Any]) -> None:
    assert list_departures(*build(SHAPES[name], **given)) == []


@pytest.mark.parametrize("other", SHAPES)
@pytest.mark.parametrize("name", SHAPES)
def test_another_shape_is_seen(name: str, other: str) -> None:
    model, _ = build(SHAPES[name])
    _, section = build(SHAPES[other])
    assert bool(list_departures(model, section)) == (name != other)


@pytest.mark.parametrize("name", SHAPES)
def test_a_size_that_is_off_by_a_hundredth_is_seen(name: str) -> None:
    model, _ = build(SHAPES[name])
    larger = {
        k: v if k in ("kind", "rim_m") else (1.01 * np.array(v)).tolist() for k, v in SHAPES[name].items()
    }
    _, section = build(larger)
    words = " ".join(list_departures(model, section))
    assert "object/surface" in words
    assert "inertia" in words


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("body_mass", 0.084, "mass"),
        ("body_ipos", [0.0, 1e-4, 0.0], "centre of mass"),
        ("body_inertia", [6e-5, 6e-5, 6e-5], "inertia"),
        ("body_iquat", [0.8, 0.6, 0.0, 0.0], "inertia"),
        ("geom_pos", [0.0, 0.0, 1e-3], "object/surface"),
    ],
)
@pytest.mark.parametrize("name", ["egg", "box", "cloud"])
def test_a_body_that_is_tampered_with_is_seen(name: str, key: str, value: Any, said: str) -> None:
    model, section = build(SHAPES[name])
    index = model.geom("object/surface").id
    array = getattr(model, key)
    array[index if key.startswith("geom") else model.geom_bodyid[index]] = value
    assert re.search(said, " ".join(list_departures(model, section)))


@pytest.mark.parametrize("name", SHAPES)
def test_solids_are_those_of_bodies(name: str) -> None:
    """Worked out twice, by different ways: both cannot be wrong in the same."""
    shape = SHAPES[name]
    sizes = [x for key in ("semi_axes_m", "half_sizes_m") for x in shape.get(key, ())]
    sizes += [shape[key] for key in ("radius_m", "half_length_m") if key in shape]
    if shape["kind"] == "cylinder":
        sizes.append(shape.get("rim_m", 0.0))
    kind = "polyhedron" if shape["kind"] == "mesh" else shape["kind"]
    body = Shape(kind, tuple(sizes), tuple(map(tuple, shape.get("vertices_m", ())))).as_body()
    mine, theirs = integrate(shape), body.solid
    assert mine.volume == pytest.approx(theirs.volume, rel=1e-8)
    np.testing.assert_allclose(mine.com, theirs.com, atol=1e-10)
    np.testing.assert_allclose(mine.inertia, theirs.inertia, atol=1e-8 * theirs.inertia.max())
    if has_edges({"shape": shape}):
        points = body.project(RNG.normal(size=(300, 3)) * 0.05).point
        distance = measure_edge_distance({"shape": shape}, points)
        np.testing.assert_allclose(distance, body.measure_edge_distance(points), atol=1e-7)


@pytest.mark.parametrize("name", ["egg", "cloud", "rounded"])
def test_contacts_are_read_in_the_axes_of_the_body(name: str) -> None:
    """MuJoCo keeps a mesh in axes of its own, which are not the object's."""
    asked = {"shape": SHAPES[name], "mass_kg": 0.083}
    turn = {"rotation": {"axis": [0.0, 0.0, 1.0], "angle_deg": 30.0}}
    problem = build_problem({"format": 1, "name": "a_shape", "object": asked, "goal": turn})
    scene = pipeline.build_scene(problem)
    body, tip = scene.object.body, scene.fingers[1]
    world = read_world(scene.xml)
    batch = Batch(build_sensed_model(scene.xml, world.fingers), 1, 1)
    data, q = mujoco.MjData(scene.model), np.stack([f.q_home for f in scene.fingers])
    R_WO = rotate_about([0.6, 0.0, 0.8], 1.1)
    point = body.radial([0.5, -0.7, 0.3])
    X_WO = make_pose(R_WO, np.zeros(3))
    data.qpos[:] = scene.as_qpos(q, X_WO)
    mujoco.mj_kinematics(scene.model, data)
    center_O = point + (tip.tip_radius - 1e-4) * body.normal_at(point)
    X_WO[:3, 3] = data.site_xpos[scene.tip_sites[1]] - R_WO @ center_O
    data.qpos[:] = scene.as_qpos(q, X_WO)
    mujoco.mj_getState(scene.model, data, batch.state[0], mujoco.mjtState.mjSTATE_INTEGRATION)
    reader = Reader(world, batch, 1, 1, 0.02)
    reader.read(0, 1)
    assert reader.active[0, 1]
    np.testing.assert_allclose(reader.point[0, 1], point, atol=2e-4)
    np.testing.assert_allclose(reader.rotation[0, 1, :, 2], -body.normal_at(point), atol=0.06)
