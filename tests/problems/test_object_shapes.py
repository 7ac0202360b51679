"""Objects of any convex shape in problem files: read, written, overridden, built, and refused in one sentence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dexplan.builders import build_scene
from dexplan.contact.bodies.sites import EDGE_BAND, build_sites
from dexplan.contact.bodies.smooth import BallBody
from dexplan.errors import DexplanError, ProblemError
from dexplan.problems.override import parse_assignment
from dexplan.problems.problem import Problem, compute_contact_directions
from dexplan.problems.read import build_problem, list_problems, load_problem
from dexplan.problems.true_world import check_world
from dexplan.problems.words import describe_problem
from dexplan.sim.judge.true_world import find_untrue, join_world

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
    "box in mm": (
        {"shape": {"kind": "box", "half_sizes_m": [30.0, 30.0, 30.0]}},
        "half_sizes_m[0]: 30.0 is out of range; accepted: a number from 0.001 to 1 m; 30 mm are 0.03 m",
    ),
    "vertices in mm": (
        {"shape": {"kind": "mesh", "vertices_m": (1e3 * np.array(TETRAHEDRON)).tolist()}},
        "is out of range; accepted: a number from -1 to 1 m; 30 mm are 0.03 m",
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


def write_obj(path: Path, points: np.ndarray, faces: list[list[int]]) -> Path:
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points]
    lines += ["f " + " ".join(str(k + 1) for k in face) for face in faces]
    path.write_text("\n".join(lines) + "\n")
    return path


CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
SQUARES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def read_mesh_problem(folder: Path, **shape: object) -> Problem:
    path = folder / "p.toml"
    keys = ", ".join(f"{key} = {json.dumps(value)}" for key, value in shape.items())
    path.write_text(
        'format = 1\n[object]\nshape = { kind = "mesh", path = "thing.obj"'
        + (f", {keys}" if keys else "")
        + " }\n[goal]\nrotation = { axis = [0, 0, 1], angle_deg = 20 }\n"
    )
    return Problem.load(path)


def dent(depth: float) -> tuple[np.ndarray, list[list[int]]]:
    """Return a cube with the middle of its upper face pressed in."""
    faces = [face for face in SQUARES if face != [1, 5, 7, 3]]
    ring = [1, 5, 7, 3]
    faces += [[ring[k], ring[(k + 1) % 4], 8] for k in range(4)]
    return np.vstack([CUBE, [0.0, 0.0, 1.0 - depth]]), faces


def test_a_mesh_file_becomes_its_hull(tmp_path: Path) -> None:
    points, faces = dent(0.3)
    write_obj(tmp_path / "thing.obj", 30.0 * points, faces)
    problem = read_mesh_problem(tmp_path, scale=1e-3)
    shape = problem.object.shape
    assert shape is not None
    assert (shape.path, shape.taken_from, len(shape.vertices_m or ())) == (None, "thing.obj", 8)
    np.testing.assert_allclose(np.abs(shape.vertices_m), 0.03, atol=1e-8)
    # A pyramid of 30 % of half the height over the square of the face is missing: 5 %.
    assert shape.mesh_volume_m3 == pytest.approx(0.95 * 0.06**3, rel=1e-5)
    words = dict(describe_problem(problem))["object"]
    assert (
        words
        == "the convex hull of thing.obj, 5.3 % more volume than the mesh, 8 points within 52 mm and 60 g"
    )
    # The copy needs no file, and an override may name another.
    copy = problem.save(tmp_path / "elsewhere" / "copy.toml")
    assert Problem.load(copy) == problem
    write_obj(tmp_path / "elsewhere" / "flat.obj", 0.02 * CUBE, SQUARES)
    other = load_problem(copy, {"object.shape.path": "flat.obj"}).object.shape
    assert other is not None
    assert other.mesh_volume_m3 == pytest.approx(0.04**3, rel=1e-5)


def test_an_origin_can_be_chosen(tmp_path: Path) -> None:
    write_obj(tmp_path / "thing.obj", 0.03 * CUBE + [0.2, 0.0, 0.03], SQUARES)
    shape = read_mesh_problem(tmp_path, origin_m=[0.2, 0.0, 0.02]).object.shape
    assert shape is not None
    np.testing.assert_allclose(np.mean(shape.vertices_m, axis=0), [0.0, 0.0, 0.01], atol=1e-8)


BAD_MESHES = {
    "missing": (
        None,
        {},
        "'thing.obj': it cannot be read (No such file or directory); accepted: a mesh file",
    ),
    "open": (
        (0.03 * CUBE, SQUARES[:5]),
        {},
        "it is open: 4 edges do not belong to exactly two triangles; accepted: a closed",
    ),
    "in millimetres": (
        (30.0 * CUBE, SQUARES),
        {},
        "it is 60 m long; accepted: metres, from 0.002 to 1 m; in millimetres",
    ),
    "in kilometres": ((3e-5 * CUBE, SQUARES), {}, "it is 6e-05 m long; accepted: metres"),
    "dented": (
        (lambda p, f: (0.03 * p, f))(*dent(1.9)),
        {},
        "it is not convex: its hull has 46 % more volume",
    ),
    "beside": (
        (0.03 * CUBE + [0.0, 0.0, 0.03], SQUARES),
        {},
        "origin_m: 'thing.obj': its origin is not inside; accepted: origin_m = [0, 0,",
    ),
    "flat": ((0.03 * CUBE * [1.0, 1.0, 0.0], SQUARES), {}, "thing.obj"),
    "scale": (
        (0.03 * CUBE, SQUARES),
        {"scale": 0.0},
        "object.shape.scale: 0.0 does not fit; accepted: metres per unit",
    ),
    "origin": (
        (0.03 * CUBE, SQUARES),
        {"origin_m": [0.0, 1.0]},
        "object.shape.origin_m: [0.0, 1.0] does not fit",
    ),
    "both": ((0.03 * CUBE, SQUARES), {"vertices_m": [[0, 0, 0]]}, "both path and vertices_m are given"),
}


@pytest.mark.parametrize("name", BAD_MESHES)
def test_what_is_no_mesh_is_refused_in_one_sentence(name: str, tmp_path: Path) -> None:
    mesh, keys, words = BAD_MESHES[name]
    if mesh is not None:
        write_obj(tmp_path / "thing.obj", *mesh)
    with pytest.raises(ProblemError) as caught:
        read_mesh_problem(tmp_path, **keys)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("thing.ply", b""),
        ("thing.stl", b"solid\n facet normal"),
        ("thing.obj", b"hello"),
        ("thing.stl", b"x" * 90),
    ],
)
def test_files_that_hold_no_mesh(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    path = read({}).save(tmp_path / "p.toml")
    with pytest.raises(DexplanError, match=f"object.shape.path: '{name}': .*; accepted: "):
        load_problem(path, {"object.shape.kind": "mesh", "object.shape.path": name})


CONTACTS = {
    "in the air": (
        [[0, 0], {"point_m": [-0.032, 0.0, 0.0]}, "free"],
        "start.contacts_deg[1].point_m: [-0.032, 0.0, 0.0] lies 2 mm outside the object's surface; accepted: a point of it, "
        "the nearest is [-0.03, 0, 0]",
    ),
    "inside": ([[0, 0], {"point_m": [-0.02, 0.0, 0.0]}, "free"], "lies 10 mm inside the object's surface"),
    "edge": (
        [[43, 0], [180, 0], "free"],
        "start.contacts_deg[0]: [0.03, 0.02798, 0] is 2 mm from an edge of the object; accepted",
    ),
    "edge by a point": (
        [[0, 0], {"point_m": [-0.03, 0.027, 0.0]}, "free"],
        "is 3 mm from an edge of the object",
    ),
    "corner": ([[45, 35.26], [180, 0], "free"], "from an edge of the object"),
    "overlap": (
        [[0, 0], [180, 0], [190, 0]],
        "fingers 2 and 3 would overlap: their centres are 5.29 mm apart; accepted: more than 24",
    ),
    "around an edge": ([[180, 0], [40.5, 0], [49.5, 0]], "the tips of fingers 2 and 3 would overlap"),
    "elevation": ([[0, 91], [180, 0], "free"], "elevation 91.0 is out of range"),
}


@pytest.mark.parametrize("name", CONTACTS)
@pytest.mark.parametrize("key", ["start", "goal"])
def test_contacts_that_no_finger_could_make(name: str, key: str) -> None:
    contacts, words = CONTACTS[name]
    hand = {"tip_radii_m": [0.012] * 3}
    asked = (
        {"goal": {**GOAL, "contacts_deg": contacts}}
        if key == "goal"
        else {"start": {"contacts_deg": contacts}}
    )
    box = {"kind": "box", "half_sizes_m": [0.03, 0.03, 0.03]}
    with pytest.raises(ProblemError) as caught:
        read({"shape": box}, hand=hand, **asked)
    assert words.replace("start.", f"{key}.") in str(caught.value)


def test_a_direction_is_where_its_ray_leaves_the_body() -> None:
    box = {"kind": "box", "half_sizes_m": [0.03, 0.02, 0.05]}
    contacts = [[20, 30], {"point_m": [-0.03, 0.01, 0.02]}, "free"]
    problem = read({"shape": box}, hand={"tip_radii_m": [0.012] * 3}, start={"contacts_deg": contacts})
    body = build_scene(problem).object.body
    assert isinstance(problem.start.contacts_deg, tuple)
    first, second, third = compute_contact_directions(problem.start.contacts_deg)
    assert first is not None
    assert second is not None
    assert third is None
    np.testing.assert_allclose(body.radial(second), [-0.03, 0.01, 0.02], atol=1e-12)
    np.testing.assert_allclose(np.cross(body.radial(first), first), 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("shape", "widest"),
    [
        (SHAPES["box"], 0.3 * 0.018),
        (SHAPES["mesh"], 0.3 * 0.018),
        (SHAPES["cylinder"], 0.3 * 0.018),
        # Two half balls of 8 mm at the ends: r R / (r + R) with tips of 18 mm.
        (
            {"kind": "capsule", "radius_m": 0.008, "half_length_m": 0.1},
            3 * np.pi / 16 * 0.018 * 0.008 / 0.026,
        ),
        ({"kind": "ellipsoid", "semi_axes_m": [0.01, 0.01, 0.02]}, 3 * np.pi / 16 / (1 / 0.018 + 200.0)),
        (None, 0.3 * 0.018),
    ],
)
def test_torsion_is_bounded_by_the_patch(shape: dict[str, Any] | None, widest: float) -> None:
    thing = {} if shape is None else {"shape": shape}
    most = 0.55 * widest
    assert read(thing).friction.torsional_m == pytest.approx(min(0.0025, most))
    assert read(thing, friction={"torsional_m": 0.999 * most}).friction.torsional_m == 0.999 * most
    with pytest.raises(
        ProblemError,
        match=r"friction.torsional_m: .* implies a contact patch .*; accepted: at most 0\.(3|59) \*",
    ):
        read(thing, friction={"torsional_m": 1.001 * most})


def test_a_path_is_a_word_of_the_command_line() -> None:
    for path in ("thing.obj", "../meshes/thing_2.stl", "/meshes/a-b.obj"):
        assert parse_assignment(f"object.shape.path={path}") == ("object.shape.path", path)


BOX = {"shape": SHAPES["box"]}


@pytest.mark.parametrize(
    ("believed", "true", "differs"),
    [
        (BOX, {"shape": {"kind": "box", "half_sizes_m": [0.031, 0.025, 0.04]}}, {"object.shape"}),
        ({}, {"shape": SHAPES["ellipsoid"]}, {"object.shape", "object.radius_m"}),
        (BOX, {"radius_m": 0.03}, {"object.shape", "object.radius_m"}),
        ({**BOX, "com_m": [0.0, 0.0, 0.01]}, BOX, {"object.com_m"}),
        (BOX, {**BOX, "com_m": [0.0, 0.001, 0.0], "mass_kg": 0.08}, {"object.com_m", "object.mass_kg"}),
        ({**BOX, "inertia_kg_m2": [3e-5, 3e-5, 3e-5]}, BOX, {"object.inertia_kg_m2"}),
    ],
)
def test_a_true_world_may_have_another_body(
    believed: dict[str, Any], true: dict[str, Any], differs: set[str]
) -> None:
    problem, world = read(believed), read(true)
    check_world(problem, world)
    assert set(find_untrue(problem.as_dict(), world.as_dict())) == differs
    joined = join_world(problem.as_dict(), world.as_dict())
    assert joined["object"] == world.as_dict()["object"]


EXAMPLES = sorted((Path(__file__).parents[2] / "examples" / "bodies").glob("*.toml"))
BODIES = [name for name in list_problems() if load_problem(name).object.shape is not None]


@pytest.mark.parametrize("source", [*BODIES, *EXAMPLES], ids=lambda source: Path(source).stem)
def test_shipped_bodies_are_scenes_with_room_for_contacts(source: str | Path, tmp_path: Path) -> None:
    problem = load_problem(str(source))
    assert load_problem(str(problem.save(tmp_path / "copy.toml"))) == problem
    assert problem.name == Path(source).stem
    scene = build_scene(problem)
    sites = build_sites(scene.object.body, 0.008, EDGE_BAND)
    assert len(sites) > 60


def test_the_built_in_mesh_is_the_one_of_the_example() -> None:
    built_in = load_problem("mesh_turn").object.shape
    from_file = load_problem(str(EXAMPLES[0])).object.shape
    # Read from a file, corners are rounded once more, to a nanometre about the centroid.
    assert np.allclose(sorted(built_in.vertices_m), sorted(from_file.vertices_m), atol=5e-9)
