"""Convex bodies: nearest points against MuJoCo's distances, mass against MuJoCo's, and what a site is."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull, cKDTree

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.edged import BoxBody, CylinderBody
from dexplan.contact.bodies.polyhedron import PolyhedronBody
from dexplan.contact.bodies.sites import build_sites
from dexplan.contact.bodies.smooth import BallBody, CapsuleBody, EllipsoidBody
from dexplan.icosphere import build_icosphere
from dexplan.spatial import Array

COUNT = 10_000


def _stone(seed: int, count: int = 40) -> Array:
    """Return corners of an irregular polyhedron of about 60 mm."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions * [0.033, 0.028, 0.025]


def _prism(corners: int) -> Array:
    angle = 2.0 * np.pi * np.arange(corners) / corners
    ring = 0.03 * np.stack([np.cos(angle), np.sin(angle), np.zeros(corners)], axis=1)
    return np.concatenate([ring + np.array([0.0, 0.0, 0.04]), ring - np.array([0.0, 0.0, 0.04])])


BODIES: dict[str, ConvexBody] = {
    "ball": BallBody(0.035),
    "ellipsoid": EllipsoidBody(0.025, 0.035, 0.045),
    "egg": EllipsoidBody(0.03, 0.03, 0.04),
    "capsule": CapsuleBody(0.008, 0.1),
    "box": BoxBody(0.03, 0.025, 0.02),
    "cylinder": CylinderBody(0.03, 0.04),
    "stone": PolyhedronBody(_stone(3)),
    "prism": PolyhedronBody(_prism(6)),
    # Shapes far from a ball, where what converges slowly would show.
    "needle": CapsuleBody(0.0013, 0.09),
    "sheet": BoxBody(0.047, 0.019, 0.0023),
    "disc": CylinderBody(0.043, 0.0031),
}
ROUNDED = CylinderBody(0.03, 0.04, 0.006)
# MuJoCo's distance from the leaf is exact to 3e-9 m alone; that the point is the nearest one is tested without MuJoCo.
LEAF, LOZENGE = EllipsoidBody(0.006, 0.021, 0.057), CylinderBody(0.037, 0.0113, 0.0109)
ALL = {**BODIES, "rounded": ROUNDED, "leaf": LEAF, "lozenge": LOZENGE}


def _as_geom(body: ConvexBody) -> str:
    match body:
        case BallBody():
            return f'type="sphere" size="{body.radius}"'
        case EllipsoidBody():
            return f'type="ellipsoid" size="{body.a} {body.b} {body.c}"'
        case CapsuleBody():
            return f'type="capsule" size="{body.radius} {body.half_length}"'
        case BoxBody():
            return f'type="box" size="{body.a} {body.b} {body.c}"'
        case CylinderBody():
            return f'type="cylinder" size="{body.radius} {body.half_length}"'
    return 'type="mesh" mesh="hull"'


def _build_model(body: ConvexBody) -> mujoco.MjModel:
    asset = ""
    if isinstance(body, PolyhedronBody):
        text = " ".join(repr(float(x)) for x in body.vertices.ravel())
        asset = f'<asset><mesh name="hull" vertex="{text}" inertia="exact"/></asset>'
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco>{asset}<worldbody>
          <body name="body"><freejoint/><geom name="body" density="1000" {_as_geom(body)}/></body>
          <body><freejoint/><geom name="probe" type="sphere" size="0.001"/></body>
        </worldbody></mujoco>""")


def _sample(body: ConvexBody, seed: int, count: int = 2 * COUNT) -> Array:
    """Return points outside a body, from right beside it to twice its size away."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3))
    surface = body.radial(directions)
    away = rng.normal(size=(count, 3))
    away *= np.where(np.sum(away * body.normal_at(surface), axis=1) < 0.0, -1.0, 1.0)[:, None]
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    points = surface + body.bound * 10.0 ** rng.uniform(-2.0, 0.3, (count, 1)) * away
    return points[body.project(points).distance > 0.0015][:COUNT]


@pytest.mark.parametrize("name", BODIES)
def test_distances_are_those_of_mujoco(name: str) -> None:
    body = BODIES[name]
    model = _build_model(body)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    target, probe = (model.geom(n).id for n in ("body", "probe"))
    if isinstance(body, PolyhedronBody):
        # MuJoCo keeps the corners of a mesh in single precision, about its centre of mass: these are compared.
        R, X = data.geom_xmat[target].reshape(3, 3), data.geom_xpos[target]
        body = PolyhedronBody(model.mesh_vert.astype(np.float64) @ R.T + X)
    points = _sample(body, 1)
    assert len(points) == COUNT
    ours = body.project(points)
    line = np.zeros(6)
    theirs = np.empty(len(points))
    for k, point in enumerate(points):
        data.geom_xpos[probe] = point
        theirs[k] = mujoco.mj_geomDistance(model, data, target, probe, 1.0, line) + 0.001
    assert np.abs(theirs - ours.distance).max() < 1e-9


@pytest.mark.parametrize("name", ALL)
def test_the_nearest_point_lies_on_the_surface_and_the_normal_points_back(name: str) -> None:
    body = ALL[name]
    points = _sample(body, 2)
    found = body.project(points)
    assert np.allclose(found.point + found.distance[:, None] * found.normal, points, atol=1e-13)
    away = (points - found.point) / np.linalg.norm(points - found.point, axis=1, keepdims=True)
    assert np.abs(np.cross(away, found.normal)).max() < 1e-10
    assert np.abs(body.project(found.point).distance).max() < 1e-12
    # No point of the surface is farther along the normal: the body lies behind the tangent plane.
    ahead = np.sum((body.support(found.normal) - found.point) * found.normal, axis=1)
    assert np.abs(ahead).max() < 1e-12


@pytest.mark.parametrize("name", ALL)
def test_inside_points_go_to_the_nearest_surface(name: str) -> None:
    body, rng = ALL[name], np.random.default_rng(5)
    surface = body.radial(rng.normal(size=(4000, 3)))
    points = surface * rng.uniform(0.0, 0.999, (4000, 1))
    points[0] = 0.0
    found = body.project(points)
    assert (found.distance <= 1e-15).all()
    assert np.allclose(found.point + found.distance[:, None] * found.normal, points, atol=1e-12)
    assert np.abs(body.project(found.point).distance).max() < 1e-12
    # Nothing that was sampled of the surface is nearer.
    assert (cKDTree(surface).query(points)[0] >= -found.distance - 1e-12).all()


@pytest.mark.parametrize("name", ALL)
def test_radial_points_lie_on_their_rays_and_on_the_surface(name: str) -> None:
    body, rng = ALL[name], np.random.default_rng(6)
    directions = rng.normal(size=(2000, 3)) * rng.uniform(0.1, 9.0, (2000, 1))
    points = body.radial(directions)
    assert np.abs(body.project(points).distance).max() < 1e-12
    assert (np.sum(points * directions, axis=1) > 0.0).all()
    assert np.abs(np.cross(points, directions)).max() < 1e-12
    assert np.linalg.norm(points, axis=1).max() <= body.bound + 1e-12
    # One vector is answered as many are.
    assert np.allclose(body.radial(directions[0]), points[0], atol=1e-15)
    assert body.project(points[0] * 1.3).point.shape == (3,)


@pytest.mark.parametrize("name", BODIES)
def test_mass_is_that_of_mujoco(name: str) -> None:
    body = BODIES[name]
    model = _build_model(body)
    own, solid = model.body("body"), body.solid
    assert solid.volume * 1000.0 == pytest.approx(
        own.mass[0], rel=1e-6 if isinstance(body, PolyhedronBody) else 1e-9
    )
    assert np.allclose(solid.com, own.ipos, atol=1e-8)
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, own.iquat)
    R = R.reshape(3, 3)
    assert np.allclose(1000.0 * solid.inertia, R @ np.diag(own.inertia) @ R.T, rtol=1e-6, atol=1e-10)


def test_a_rounded_cylinder_lies_between_the_sharp_one_and_its_core() -> None:
    sharp = CylinderBody(0.03, 0.04)
    assert CylinderBody(0.03, 0.04, 1e-9).solid.volume == pytest.approx(sharp.solid.volume, rel=1e-7)
    # What the rim takes away on either side: a square of side ``rim`` turned about the axis, without its quarter circle [Pappus].
    rim, inner = ROUNDED.rim, 0.03 - ROUNDED.rim
    square, quarter = rim**2 * (inner + rim / 2.0), np.pi / 4.0 * rim**2 * (inner + 4.0 * rim / (3.0 * np.pi))
    gone = 2.0 * 2.0 * np.pi * (square - quarter)
    assert sharp.solid.volume - ROUNDED.solid.volume == pytest.approx(gone, rel=1e-9)
    rng = np.random.default_rng(7)
    points = rng.uniform(-0.05, 0.05, (400_000, 3))
    inside = points[ROUNDED.project(points).distance < 0.0]
    assert len(inside) / len(points) * 1e-3 == pytest.approx(ROUNDED.solid.volume, rel=1e-2)
    second = inside.T @ inside / len(inside) * ROUNDED.solid.volume
    assert np.allclose(np.trace(second) * np.eye(3) - second, ROUNDED.solid.inertia, rtol=2e-2, atol=1e-9)


SLENDER = pytest.mark.xfail(
    strict=True, reason="candidates along rays from the origin leave holes on slender bodies"
)


@pytest.mark.parametrize(
    ("name", "band"),
    [pytest.param(n, b, marks=SLENDER if n in ("needle", "leaf") else ()) for n in ALL for b in (0.0, 0.004)],
)
def test_sites_are_even_and_away_from_edges(name: str, band: float) -> None:
    body, spacing = ALL[name], 0.007
    sites = build_sites(body, spacing, band)
    assert np.abs(body.project(sites.points).distance).max() < 1e-12
    assert (body.measure_edge_distance(sites.points) >= band - 1e-9).all()
    gap = cKDTree(sites.points).query(sites.points, k=2)[0][:, 1]
    assert gap.min() >= 0.999 * spacing
    # No hole: what may be landed on has a site within a spacing and the third of one that candidates are apart.
    everywhere = body.radial(np.random.default_rng(8).normal(size=(4000, 3)))
    everywhere = everywhere[body.measure_edge_distance(everywhere) >= band]
    assert cKDTree(sites.points).query(everywhere)[0].max() < 1.35 * spacing
    again = build_sites(body, spacing, band)
    assert np.array_equal(sites.points, again.points)


def test_the_middle_of_a_face_is_a_site_and_edges_are_measured_along_faces() -> None:
    box = BoxBody(0.03, 0.03, 0.03)
    sites = build_sites(box, 0.01, 0.008)
    for flat in box.flats:
        assert np.linalg.norm(sites.points - flat.center, axis=1).min() < 1e-12
    assert box.measure_edge_distance([0.03, 0.01, -0.02]) == pytest.approx(0.01)
    same = PolyhedronBody(np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 0.03)
    assert len(same.flats) == len(same.planes) == 6
    points = box.radial(np.random.default_rng(9).normal(size=(500, 3)))
    assert np.allclose(same.measure_edge_distance(points), box.measure_edge_distance(points), atol=1e-12)
    assert CylinderBody(0.03, 0.04).measure_edge_distance([0.01, 0.0, 0.04]) == pytest.approx(0.02)


@pytest.mark.parametrize(("corners", "is_round"), [(17, False), (19, True), (40, True)])
def test_edges_that_hardly_bend_are_a_round_surface_cut_into_facets(corners: int, is_round: bool) -> None:
    """A prism of 18 faces bends by 20 degrees from one to the next; its rims are sharp whatever the number."""
    body = PolyhedronBody(_prism(corners))
    assert len(body.edges) == (2 if is_round else 3) * corners
    wall = body.radial(np.array([[np.cos(a), np.sin(a), 0.2] for a in np.linspace(0.0, 6.0, 50)]))
    nearest = body.measure_edge_distance(wall).min()
    assert (nearest > 0.02) == is_round
    assert len(build_sites(body, 0.01, 0.004)) > 30


def test_a_fine_mesh_of_an_egg_is_as_good_to_land_on_as_the_egg() -> None:
    egg = EllipsoidBody(0.03, 0.03, 0.04)
    mesh = PolyhedronBody(build_icosphere(3).vertices * [0.03, 0.03, 0.04])
    assert len(mesh.edges) == 0
    count, least = len(build_sites(mesh, 0.008, 0.004)), len(build_sites(egg, 0.008, 0.004))
    assert count > 0.8 * least
    assert np.isinf(mesh.measure_edge_distance(mesh.radial(np.eye(3)))).all()


def test_symmetry() -> None:
    assert BallBody(0.03).is_symmetric_about([1.0, 2.0, 3.0])
    assert EllipsoidBody(0.03, 0.03, 0.04).is_symmetric_about([0.0, 0.0, -2.0])
    assert EllipsoidBody(0.04, 0.03, 0.03).is_symmetric_about([1.0, 0.0, 0.0])
    assert not EllipsoidBody(0.02, 0.03, 0.04).is_symmetric_about([0.0, 0.0, 1.0])
    assert not CapsuleBody(0.01, 0.02).is_symmetric_about([1.0, 0.0, 0.0])
    assert not BoxBody(0.03, 0.03, 0.03).is_symmetric_about([0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: BallBody(0.0), "radius 0.0 m; positive"),
        (lambda: EllipsoidBody(0.03, float("nan"), 0.02), "b nan m; positive"),
        (lambda: BoxBody(0.03, -0.01, 0.02), "b -0.01 m; positive"),
        (lambda: CylinderBody(0.03, 0.04, 0.03), "less than 0.03 m is accepted"),
        (lambda: PolyhedronBody(np.zeros((3, 3))), "four or more"),
        (lambda: PolyhedronBody(np.eye(4, 3) * [1.0, 1.0, 0.0]), "lie in one plane"),
        (lambda: PolyhedronBody(_stone(1) + np.array([0.1, 0.0, 0.0])), "origin is not inside"),
        (lambda: PolyhedronBody(_stone(1) * [1.0, np.inf, 1.0]), "not finite"),
        (lambda: build_sites(BallBody(0.03), 0.0), "positive spacing"),
        (lambda: build_sites(BallBody(0.03), 0.01, -1.0), "0 or more"),
        (lambda: BallBody(0.03).project([1.0, 2.0]), r"\(\.\.\., 3\) is accepted"),
    ],
)
def test_mistakes_are_named(make: object, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()  # type: ignore[operator]


def test_points_inside_a_hull_are_dropped() -> None:
    stone = _stone(4)
    body = PolyhedronBody(np.concatenate([stone, 0.5 * stone]))
    assert len(body.hull) == len(ConvexHull(stone).vertices)
    assert body.solid.volume == pytest.approx(ConvexHull(stone).volume, rel=1e-12)
