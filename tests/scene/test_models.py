"""The model: the checked-in text, its names, the facts that honest physics rests on, and every kind of overlap as a contact."""

from __future__ import annotations

from dataclasses import replace
from importlib import resources
from itertools import combinations

import mujoco
import numpy as np
import pytest

from dexplan.errors import UnknownNameError
from dexplan.scene.compose import (
    BASE_DISTANCE,
    BASE_HEIGHT,
    HOME_POSITION,
    PROFILES,
    build_model_xml,
)
from dexplan.scene.description import Obstacle, SceneParameters
from dexplan.scene.library import load_scene, load_scene_with
from dexplan.scene.scene import Scene
from dexplan.scene.shape import Shape

MODELS = resources.files("dexplan.models")
PARTS = sorted(entry.name for entry in MODELS.iterdir() if entry.name.endswith(".xml"))
FINGERS = ("finger_1", "finger_2", "finger_3")
FAR = (0.0, 0.0, 3.0)
"""Where the object is out of every finger's way [m]."""


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene()


def _compile(**changes: object) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(build_model_xml(replace(SceneParameters(), **changes)))  # type: ignore[arg-type]


# -- the text ----------------------------------------------------------------------------------------------------------------


def test_checked_in_text_is_what_is_built() -> None:
    text = MODELS.joinpath("three_finger_sphere.xml").read_text(encoding="utf-8")
    assert text == build_model_xml(SceneParameters()), (
        "a part of the model has changed; `python -m dexplan.scene.compose` writes the assembled text anew"
    )


def test_scene_carries_the_text_it_was_compiled_from(scene: Scene) -> None:
    assert scene.xml == build_model_xml(SceneParameters())


@pytest.mark.parametrize("name", PARTS)
def test_each_file_loads_alone(name: str) -> None:
    model = mujoco.MjModel.from_xml_string(MODELS.joinpath(name).read_text(encoding="utf-8"))
    assert model.ngeom > 0
    mujoco.mj_forward(model, mujoco.MjData(model))


@pytest.mark.parametrize("name", PARTS)
def test_everything_is_named(name: str) -> None:
    model = mujoco.MjModel.from_xml_string(MODELS.joinpath(name).read_text(encoding="utf-8"))
    kinds = {
        "geom": model.ngeom,
        "joint": model.njnt,
        "body": model.nbody,
        "site": model.nsite,
        "actuator": model.nu,
        "camera": model.ncam,
        "light": model.nlight,
        "material": model.nmat,
        "mesh": model.nmesh,
        "texture": model.ntex,
    }
    nameless = [
        f"{kind} {k}" for kind, n in kinds.items() for k in range(n) if not getattr(model, kind)(k).name
    ]
    assert not nameless


def test_text_needs_no_other_file(scene: Scene) -> None:
    assert "file=" not in scene.xml
    assert "<include" not in scene.xml


# -- what honest physics rests on --------------------------------------------------------------------------------------------


def test_nothing_but_contact_can_hold_the_object(scene: Scene) -> None:
    model = scene.model
    for count in ("nexclude", "neq", "nmocap", "ntendon", "nflex", "nplugin", "npair", "nkey"):
        assert getattr(model, count) == 0, count
    assert tuple(model.opt.gravity) == (0.0, 0.0, -9.81)
    assert model.opt.disableflags == model.opt.enableflags == 0
    assert model.opt.density == model.opt.viscosity == 0.0
    assert not model.opt.wind.any()
    assert not model.body_gravcomp.any()
    free = slice(scene.object_dof, scene.object_dof + 6)
    for name in ("dof_damping", "dof_armature", "dof_frictionloss"):
        assert not getattr(model, name)[free].any(), name
    assert not model.dof_frictionloss.any()
    assert not model.jnt_stiffness.any()
    joints = {model.joint(j).name: model.jnt_type[j] for j in range(model.njnt)}
    assert joints.pop("object/free/") == mujoco.mjtJoint.mjJNT_FREE
    assert all(kind == mujoco.mjtJoint.mjJNT_HINGE for kind in joints.values())


def test_object_is_a_solid_ball(scene: Scene) -> None:
    model, body = scene.model, scene.object_body
    assert model.body_mass[body] == 0.060
    assert model.geom_size[scene.object_geom, 0] == 0.035
    assert np.allclose(model.body_inertia[body], 0.4 * 0.060 * 0.035**2, rtol=1e-9)
    assert np.allclose(model.body_ipos[body], 0.0, atol=1e-12)
    assert model.body_geomnum[body] == 1


@pytest.mark.parametrize("finger", FINGERS)
def test_motors_and_joints_are_modest(scene: Scene, finger: str) -> None:
    model = scene.model
    for j in range(1, 7):
        servo, joint = model.actuator(f"{finger}/servo_{j}"), model.joint(f"{finger}/joint_{j}")
        dof = joint.dofadr[0]
        limit = 1.5 if j <= 3 else 0.5
        assert servo.forcelimited[0]
        assert -servo.forcerange[0] == servo.forcerange[1] <= limit
        assert tuple(servo.gear) == (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        assert servo.trnid[0] == joint.id
        assert servo.trntype[0] == mujoco.mjtTrn.mjTRN_JOINT
        # The target is a joint angle: f = kp (target - q) - kv qdot, no more gain than the description tells.
        assert servo.biasprm[1] == -servo.gainprm[0]
        assert servo.biasprm[2] < 0.0
        assert joint.limited[0]
        assert 0.0 < model.dof_armature[dof] <= 5e-3
        assert 0.0 < model.dof_damping[dof] <= 0.1
    assert model.nu == 18


def test_masses(scene: Scene) -> None:
    model = scene.model
    expected = {
        "": 0.2,
        "link_1": 0.030,
        "link_2": 0.045,
        "link_3": 0.025,
        "link_4": 0.028,
        "link_5": 0.008,
        "link_6": 0.018,
    }
    for finger in FINGERS:
        assert {b: round(float(model.body(f"{finger}/{b}").mass[0]), 9) for b in expected} == expected
    assert float(model.body_mass.sum()) == pytest.approx(3 * 0.354 + 0.060)


def test_every_contact_has_the_same_surface(scene: Scene) -> None:
    model = scene.model
    assert set(model.geom_condim) == {4}
    assert not model.geom_priority.any()
    assert not model.geom_margin.any()
    assert not model.geom_gap.any()
    assert (model.geom_solmix == 1.0).all()
    assert np.allclose(model.geom_friction, [0.55, 0.0025, 1e-4], atol=0)
    assert np.allclose(model.geom_solref, [0.002, 1.0], atol=0)
    assert np.allclose(model.geom_solimp, [0.95, 0.99, 0.001, 0.5, 2.0], atol=0)
    # MuJoCo raises a time constant below twice the step without a word.
    assert model.geom_solref[:, 0].min() >= 2.0 * model.opt.timestep
    assert model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert model.opt.jacobian == mujoco.mjtJacobian.mjJAC_DENSE


def test_what_is_only_seen_does_not_collide_or_weigh(scene: Scene) -> None:
    model = scene.model
    for g in range(model.ngeom):
        name = model.geom(g).name
        collides = (int(model.geom_contype[g]), int(model.geom_conaffinity[g]))
        assert collides == ((0, 0) if name.endswith("_visual") else (1, 1)), name
    seen = {model.geom(g).name for g in range(model.ngeom) if not model.geom_contype[g]}
    assert seen == {f"{finger}/{part}_visual" for finger in FINGERS for part in ("neck", "tip")}
    # What is seen of the tip is part of the sphere that collides; the neck is thinner than the joint balls it links.
    for finger in FINGERS:
        site, tip = model.site(f"{finger}/tip_center"), model.geom(f"{finger}/tip")
        assert np.allclose(site.pos, tip.pos, atol=1e-12)
        assert model.geom_rbound[model.geom(f"{finger}/tip_visual").id] <= 1.75 * tip.size[0]
        assert model.geom(f"{finger}/neck_visual").size[0] < model.geom(f"{finger}/link_3").size[0]


# -- parameters --------------------------------------------------------------------------------------------------------------


def test_friction_and_object_come_from_the_parameters() -> None:
    model = _compile(
        sliding_friction=0.7, torsional_friction=0.003, object_shape=Shape.ball(0.03), object_mass=0.05
    )
    assert np.allclose(model.geom_friction, [0.7, 0.003, 1e-4], atol=0)
    assert model.geom("object/surface").size[0] == 0.03
    assert model.body("object/").mass[0] == pytest.approx(0.05)
    assert np.allclose(model.body("object/").inertia, 0.4 * 0.05 * 0.03**2)


@pytest.mark.parametrize("azimuths", [(0.0, 180.0), (10.0, 100.0, 190.0, 280.0)])
def test_a_finger_is_attached_once_per_base(azimuths: tuple[float, ...]) -> None:
    radii = tuple(0.015 + 0.001 * k for k in range(len(azimuths)))
    model = _compile(base_azimuths_deg=azimuths, tip_radii=radii)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    assert model.njnt == 6 * len(azimuths) + 1
    assert model.nu == 6 * len(azimuths)
    for k, (azimuth, radius) in enumerate(zip(azimuths, radii, strict=True), start=1):
        yaw = np.radians(azimuth)
        outward = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        assert np.allclose(data.site(f"mount_{k}").xpos, BASE_DISTANCE * outward + [0, 0, BASE_HEIGHT])
        # x of the first link looks at the axis through the object's home.
        assert np.allclose(data.body(f"finger_{k}/link_1").xmat.reshape(3, 3)[:, 0], -outward)
        assert model.geom(f"finger_{k}/tip").size[0] == radius
        mesh = model.mesh(f"finger_{k}/hemisphere")
        vertices = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
        # The compiler turns a mesh into its principal axes; a hemisphere is widest at twice its radius.
        assert np.ptp(vertices, axis=0).max() == pytest.approx(2.0 * radius, rel=1e-3)


def test_fingers_are_one_finger(scene: Scene) -> None:
    first, *others = scene.fingers
    for finger in others:
        for name in ("axes", "X_JF", "lower", "upper"):
            assert np.allclose(getattr(finger.chain, name), getattr(first.chain, name), atol=1e-12)
        assert np.allclose(finger.chain.offsets[1:], first.chain.offsets[1:], atol=1e-12)
    # The parts hold one finger; the assembled text names it once per base.
    assert MODELS.joinpath("finger.xml").read_text(encoding="utf-8").count('name="tip"') == 1


@pytest.mark.parametrize("profile", sorted(PROFILES))
def test_physics_profile_is_honoured(profile: str) -> None:
    option = _compile(physics_profile=profile).opt
    for name, value in PROFILES[profile].items():
        assert getattr(option, name) == value


def test_unknown_physics_profile_is_refused_with_the_known_ones() -> None:
    with pytest.raises(UnknownNameError, match="unknown physics profile 'soft'; known: firm, portable"):
        build_model_xml(SceneParameters(physics_profile="soft"))


def test_obstacles_stand_where_they_are_asked_for() -> None:
    obstacles = (
        Obstacle("box", (0.0, 0.0, 0.05), (0.02, 0.03, 0.005)),
        Obstacle("sphere", (0.1, 0.0, 0.3), (0.01,)),
        Obstacle("capsule", (0.0, 0.1, 0.3), (0.01, 0.02)),
    )
    model = _compile(obstacles=obstacles)
    for k, obstacle in enumerate(obstacles, start=1):
        geom = model.geom(f"obstacle_{k}")
        assert tuple(geom.pos) == obstacle.position
        assert tuple(geom.size[: len(obstacle.size)]) == obstacle.size
        assert geom.bodyid[0] == 0
        assert tuple(geom.friction) == (0.55, 0.0025, 1e-4)


def test_joint_ranges_are_honoured_for_that_joint_only() -> None:
    model = _compile(joint_ranges_deg=(("finger_2.joint_1", -30.0, 40.0),))
    default = _compile()
    assert np.allclose(np.degrees(model.joint("finger_2/joint_1").range), [-30.0, 40.0])
    others = [j for j in range(model.njnt) if model.joint(j).name != "finger_2/joint_1"]
    assert np.array_equal(model.jnt_range[others], default.jnt_range[others])


def test_unknown_joint_is_refused_with_the_known_ones() -> None:
    with pytest.raises(
        UnknownNameError,
        match=r"unknown joint 'finger_1\.elbow'; known: finger_1\.joint_1, .*finger_3\.joint_6",
    ):
        build_model_xml(SceneParameters(joint_ranges_deg=(("finger_1.elbow", 0.0, 1.0),)))


# -- every kind of overlap is a contact --------------------------------------------------------------------------------------


def _find_contacts(
    scene: Scene, postures: dict[int, tuple[float, ...]], object_at: tuple[float, ...]
) -> set[frozenset[str]]:
    """Return the names of all touching pairs; fingers without a posture stand at home."""
    q = np.stack([finger.q_home for finger in scene.fingers])
    for finger, posture in postures.items():
        q[finger - 1] = posture
    X_WO = np.eye(4)
    X_WO[:3, 3] = object_at
    data = mujoco.MjData(scene.model)
    data.qpos[:] = scene.as_qpos(q, X_WO)
    mujoco.mj_forward(scene.model, data)
    contacts = data.contact
    return {
        frozenset(scene.model.geom(g).name for g in pair)
        for pair, dist, row in zip(contacts.geom, contacts.dist, contacts.efc_address, strict=True)
        if dist < 0.0 and row >= 0
    }


def test_home_touches_nothing(scene: Scene) -> None:
    assert not _find_contacts(scene, {}, HOME_POSITION)


# Postures [rad], each within the joint limits.
OVERLAPS = [
    # Links of one finger that are not neighbours.
    ("finger_1/base", "finger_1/link_2", {1: (0.0, 1.0, 2.5, -0.9, 0.4, 0.0)}),
    ("finger_1/base", "finger_1/link_3", {1: (-0.3, 1.37, 2.5, -2.2, 0.5, 0.0)}),
    ("finger_1/base", "finger_1/link_4", {1: (-1.25, 0.7, 2.15, -1.6, 2.1, 0.0)}),
    ("finger_1/base", "finger_1/link_4_fork", {1: (1.14, 0.65, 1.84, 2.84, 2.34, 0.0)}),
    ("finger_1/base", "finger_1/link_5", {1: (0.91, 1.09, 0.79, 0.24, -0.31, 0.0)}),
    ("finger_1/base", "finger_1/stem", {1: (0.91, 1.09, 0.79, 0.24, -0.31, 0.0)}),
    ("finger_1/base", "finger_1/tip", {1: (-0.9, 1.17, 1.05, -2.45, 0.71, 0.0)}),
    ("finger_1/link_1", "finger_1/link_4", {1: (0.33, -1.44, 2.66, -1.6, 0.0, 0.0)}),
    ("finger_1/link_1", "finger_1/link_4_fork", {1: (-0.91, -2.56, 2.69, -1.45, 2.58, 0.0)}),
    ("finger_1/link_1", "finger_1/stem", {1: (-1.04, -1.82, 2.68, 2.87, -1.63, 0.0)}),
    ("finger_1/link_1", "finger_1/tip", {1: (-1.25, -1.31, 2.51, -0.17, 2.18, 0.0)}),
    ("finger_1/link_2", "finger_1/link_4_root", {1: (-1.25, 0.7, 2.15, -1.6, 2.1, 0.0)}),
    ("finger_1/link_2", "finger_1/link_4", {1: (-1.25, 0.7, 2.15, -1.6, 2.1, 0.0)}),
    ("finger_1/link_2", "finger_1/stem", {1: (0.85, -1.0, 2.69, 3.02, -2.25, 0.0)}),
    ("finger_1/link_2", "finger_1/tip", {1: (-1.25, -1.31, 2.51, -0.17, 2.18, 0.0)}),
    # Finger against finger, tip against tip.
    ("finger_1/link_4", "finger_2/link_4", {1: (-0.3, -0.2, 0.5, 2.1, 0.2, 0.0), 2: (0.4, -0.4, 0.9, 1.5, 1.7, 0.0)}),
    ("finger_1/link_3", "finger_2/stem", {1: (-0.2, -0.2, 1.1, -2.5, 1.2, 0.0), 2: (0.4, -0.3, 0.3, 0.0, 0.4, 0.0)}),
    ("finger_1/link_5", "finger_2/stem", {1: (-0.1, -0.5, 1.2, 2.0, 1.1, 0.0), 2: (0.2, -0.5, 1.1, -1.9, 0.3, 0.0)}),
    ("finger_1/stem", "finger_2/stem", {1: (-0.4, -0.9, 1.5, -1.5, -2.4, 0.0), 2: (0.5, -0.6, 0.7, 2.0, -1.0, 0.0)}),
    ("finger_1/tip", "finger_2/link_4", {1: (-0.2, -0.3, 1.0, 0.9, -0.6, 0.0), 2: (0.4, 0.3, 0.4, 2.9, 0.1, 0.0)}),
    ("finger_1/tip", "finger_3/link_3", {1: (0.43, -0.27, 0.31, 0.94, -0.48, 0.0)}),
    ("finger_1/tip", "finger_2/tip", {1: (0.1, -0.3, 1.6, 0.3, -1.1, 0.0), 2: (0.2, 0.0, 0.4, -0.6, 1.0, 0.0)}),
    # The floor.
    ("finger_1/tip", "floor", {1: (-0.1, 1.0, 0.6, 0.3, 0.0, 0.0)}),
    ("finger_1/stem", "floor", {1: (-0.1, 1.0, 0.6, 0.3, 0.0, 0.0)}),
]  # fmt: skip


@pytest.mark.parametrize(("a", "b", "postures"), OVERLAPS, ids=lambda v: v if isinstance(v, str) else "")
def test_overlap_of_the_hand_is_a_contact(
    scene: Scene, a: str, b: str, postures: dict[int, tuple[float, ...]]
) -> None:
    for finger, posture in postures.items():
        chain = scene.fingers[finger - 1].chain
        assert (chain.lower <= posture).all()
        assert (posture <= chain.upper).all()
    assert frozenset((a, b)) in _find_contacts(scene, postures, FAR)


@pytest.mark.parametrize(
    "part",
    ["base", "link_1", "link_2", "link_3", "link_4_root", "link_4", "link_4_fork", "link_5", "stem", "tip"],
)
@pytest.mark.parametrize("finger", FINGERS)
def test_object_touches_every_part_of_a_finger(scene: Scene, finger: str, part: str) -> None:
    data = mujoco.MjData(scene.model)
    data.qpos[:] = scene.as_qpos(np.stack([f.q_home for f in scene.fingers]), np.eye(4))
    mujoco.mj_kinematics(scene.model, data)
    touching = _find_contacts(scene, {}, tuple(data.geom(f"{finger}/{part}").xpos))
    assert frozenset((f"{finger}/{part}", "object/surface")) in touching


def test_object_touches_the_floor(scene: Scene) -> None:
    assert _find_contacts(scene, {}, (0.3, 0.3, 0.03)) == {frozenset(("floor", "object/surface"))}


def test_obstacles_touch_tip_link_and_object(scene: Scene) -> None:
    data = mujoco.MjData(scene.model)
    data.qpos[:] = scene.as_qpos(np.stack([f.q_home for f in scene.fingers]), scene.object.X_WO_home)
    mujoco.mj_kinematics(scene.model, data)
    size = {"box": (0.01, 0.01, 0.01), "capsule": (0.01, 0.01), "sphere": (0.01,)}
    wanted = {
        "finger_1/tip": "box",
        "finger_2/link_4": "capsule",
        "finger_3/link_2": "sphere",
        "object/surface": "box",
    }
    # Beside the centre of the part: the direction of a contact between two coincident centres is not defined.
    obstacles = tuple(
        Obstacle(kind, tuple(data.geom(name).xpos - 0.004 * np.eye(3)[2]), size[kind])
        for name, kind in wanted.items()
    )
    crowded = load_scene_with(replace(SceneParameters(), obstacles=obstacles))
    touching = _find_contacts(crowded, {}, HOME_POSITION)
    for k, name in enumerate(wanted, start=1):
        assert frozenset((name, f"obstacle_{k}")) in touching


def test_no_overlap_goes_unseen(scene: Scene) -> None:
    """Distances measured pair by pair against the contacts found, in random postures; neighbours in a chain excepted."""
    model, data = scene.model, mujoco.MjData(scene.model)
    rng = np.random.default_rng(0)
    solid = [g for g in range(model.ngeom) if model.geom_contype[g]]
    body = model.geom_bodyid

    def may_touch(a: int, b: int) -> bool:
        if model.body_weldid[body[a]] == model.body_weldid[body[b]]:
            return False
        pair = {int(body[a]), int(body[b])}
        parents = {int(model.body_parentid[k]) for k in pair}
        neighbours = bool(pair & parents)
        # A neighbour that is fixed to the world is seen all the same.
        return not neighbours or any(model.body_weldid[k] == 0 for k in pair)

    pairs = [(a, b) for a, b in combinations(solid, 2) if may_touch(a, b)]
    found = 0
    for _ in range(30):
        q = np.stack([rng.uniform(f.chain.lower, f.chain.upper) for f in scene.fingers])
        X_WO = np.eye(4)
        X_WO[:3, 3] = HOME_POSITION + rng.uniform(-0.15, 0.15, 3)
        data.qpos[:] = scene.as_qpos(q, X_WO)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        seen = {
            tuple(sorted(int(g) for g in pair))
            for pair, dist in zip(data.contact.geom, data.contact.dist, strict=True)
            if dist < -1e-6
        }
        measured = {p for p in pairs if mujoco.mj_geomDistance(model, data, *p, 0.01, None) < -1e-6}
        assert seen == measured
        found += len(measured)
    assert found > 50
