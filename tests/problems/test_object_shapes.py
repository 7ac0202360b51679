"""Objects of any convex shape in problem files: read, written, overridden, built, and refused in one sentence."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dexplan.builders import build_scene
from dexplan.contact.bodies.smooth import BallBody
from dexplan.errors import ProblemError
from dexplan.problems.problem import Problem
from dexplan.problems.read import build_problem, load_problem
from dexplan.problems.words import describe_problem

GOAL = {"rotation": {"axis": [0, 0, 1], "angle_deg": 20}}
TETRAHEDRON = [[0.03, 0.03, 0.03], [-0.03, -0.03, 0.03], [-0.03, 0.03, -0.03], [0.03, -0.03, -0.03]]
SHAPES: dict[str, dict[str, Any]] = {
    "ellipsoid": {"kind": "ellipsoid", "semi_axes_m": [0.03, 0.03, 0.04]},
    "capsule": {"kind": "capsule", "radius_m": 0.02, "half_length_m": 0.03},
    "cylinder": {"kind": "cylinder", "radius_m": 0.03, "half_length_m": 0.04},
    "rounded": {"kind": "cylinder", "radius_m": 0.03, "half_length_m": 0.04, "rim_m": 0.003},
    "box": {"kind": "box", "half_sizes_m": [0.03, 0.025, 0.04]},
    "mesh": {"kind": "mesh", "vertices_m": TETRAHEDRON},
}


def read(thing: dict[str, Any], **more: object) -> Problem:
    return build_problem({"format": 1, "goal": GOAL, "object": thing, **more}, "p.toml", "p")


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_is_read_written_and_built(name: str, tmp_path: Path) -> None:
    inertia = [3e-5, 4e-5, 5e-5]
    problem = read({"shape": SHAPES[name], "com_m": [0.001, 0.0, -0.002], "inertia_kg_m2": inertia})
    again = Problem.load(problem.save(tmp_path / "copy.toml"))
    assert again == problem
    assert problem.object.radius_m is None
    assert "radius_m" not in problem.as_dict()["object"]
    thing = build_scene(problem).object
    np.testing.assert_allclose(thing.mass_properties.com, [0.001, 0.0, -0.002], atol=1e-9)
    np.testing.assert_allclose(thing.mass_properties.inertia, np.diag(inertia), atol=1e-11)
    assert not isinstance(thing.body, BallBody)
    words = dict(describe_problem(problem))["object"]
    assert words.endswith("60 g, centre of mass and inertia given")


def test_whole_inertia_and_principal_moments_are_the_same() -> None:
    matrix = np.diag([3e-5, 4e-5, 5e-5]).tolist()
    assert read({"inertia_kg_m2": matrix}) == read({"inertia_kg_m2": [3e-5, 4e-5, 5e-5]})


def test_an_override_of_a_shape_takes_the_radius_away_and_back(tmp_path: Path) -> None:
    """A run folder's copy writes the radius out, and takes the same overrides as the file that it came from."""
    path = read({}).save(tmp_path / "ball.toml")
    box = load_problem(path, {"object.shape": SHAPES["box"]})
    assert box == load_problem(
        path, {"object.shape.kind": "box", "object.shape.half_sizes_m": [0.03, 0.025, 0.04]}
    )
    assert box.object.shape is not None
    ball = load_problem(box.save(tmp_path / "box.toml"), {"object.radius_m": 0.03})
    assert (ball.object.radius_m, ball.object.shape) == (0.03, None)
    taller = load_problem(tmp_path / "box.toml", {"object.shape.half_sizes_m.2": 0.05})
    assert taller.object.shape is not None
    assert taller.object.shape.half_sizes_m == (0.03, 0.025, 0.05)


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "both": (
        {"radius_m": 0.03, "shape": SHAPES["box"]},
        "object: both radius_m and shape are given; accepted",
    ),
    "no kind": ({"shape": {"radius_m": 0.03}}, 'object.shape.kind: missing; accepted: "ellipsoid"'),
    "ball": (
        {"shape": {"kind": "sphere", "radius_m": 0.03}},
        "'sphere' is no shape; accepted: object.radius_m",
    ),
    "typing slip": ({"shape": {"kind": "elipsoid"}}, "unknown shape 'elipsoid'; did you mean 'ellipsoid'?"),
    "number": ({"shape": {"kind": 3}}, "unknown shape 3; accepted"),
    "no table": ({"shape": "box"}, "object.shape: 'box' does not fit; accepted: a table"),
    "unknown key": ({"shape": {**SHAPES["box"], "sizes": 1}}, "unknown key 'sizes'"),
    "another's key": (
        {"shape": {**SHAPES["box"], "rim_m": 0.001}},
        "object.shape.rim_m: given for a box; accepted for box: half_sizes_m",
    ),
    "missing": ({"shape": {"kind": "capsule", "radius_m": 0.02}}, "half_length_m: missing for a capsule"),
    "negative": ({"shape": {"kind": "box", "half_sizes_m": [0.03, -0.03, 0.03]}}, "-0.03 is out of range"),
    "two sizes": (
        {"shape": {"kind": "box", "half_sizes_m": [0.03, 0.03]}},
        "half_sizes_m: [0.03, 0.03] does not fit",
    ),
    "rim": (
        {"shape": {**SHAPES["rounded"], "rim_m": 0.03}},
        "object.shape: a cylinder with a rim of 0.03 m; accepted",
    ),
    "few": (
        {"shape": {"kind": "mesh", "vertices_m": TETRAHEDRON[:3]}},
        "vertices_m: has 3 points; accepted: 4 to",
    ),
    "flat": (
        {"shape": {"kind": "mesh", "vertices_m": [[0.01, 0, 0], [0, 0.01, 0], [-0.01, 0, 0], [0, -0.01, 0]]}},
        "object.shape: the vertices lie in one plane; accepted: points that enclose a volume",
    ),
    "beside": (
        {"shape": {"kind": "mesh", "vertices_m": [[x + 0.1, y, z] for x, y, z in TETRAHEDRON]}},
        "object.shape: the origin is not inside the hull; accepted",
    ),
    "com": ({"com_m": [0.0, 0.04, 0.0]}, "object.com_m: [0.0, 0.04, 0.0] lies outside the object; accepted"),
    "com in mm": ({"shape": SHAPES["box"], "com_m": [0.0, 0.0, 2.0]}, "object.com_m[2]: 2.0 is out of range"),
    "triangle": (
        {"inertia_kg_m2": [1e-5, 1e-5, 3e-5]},
        "object.inertia_kg_m2: no body has the principal moments",
    ),
    "skew": (
        {"inertia_kg_m2": [[1e-5, 1e-6, 0], [0, 1e-5, 0], [0, 0, 1e-5]]},
        "is not symmetric; accepted: a symmetric one",
    ),
    "two moments": (
        {"inertia_kg_m2": [1e-5, 1e-5]},
        "object.inertia_kg_m2: [1e-05, 1e-05] does not fit; accepted",
    ),
    "no moment": ({"inertia_kg_m2": [0.0, 1e-5, 1e-5]}, "it has the principal moment 0; accepted"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_object_is_refused_in_one_sentence(name: str) -> None:
    thing, words = BAD[name]
    with pytest.raises(ProblemError) as caught:
        read(thing)
    message = str(caught.value)
    assert words in message
    assert message.startswith("p.toml: object")
    assert "\n" not in message
