"""The whitelist knows every cheat that keeps a ball up, and every way in which a model can depart from the
problem.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np
import pytest
from held_ball import MODEL_XML, make_case, make_problem, record

from dexplan.sim.judge.checks_case import Case
from dexplan.sim.judge.checks_physics import check_physics_untouched, find_departures


@lru_cache
def honest() -> Case:
    """A ball held by honest fingers."""
    return make_case(record(samples=25))


def tampered(edit: Callable[[mujoco.MjSpec], Any]) -> Case:
    """Return the case of the held ball in an edited world."""
    spec = mujoco.MjSpec.from_string(MODEL_XML)
    edit(spec)
    spec.compile()
    return make_case(record(spec.to_xml(), samples=5, settle=5))


def ball(spec: mujoco.MjSpec) -> Any:
    """Return the object's geom."""
    return spec.geom("object/surface")


def free(spec: mujoco.MjSpec) -> Any:
    """Return the object's free joint."""
    return spec.joint("object/free/")


def assign(find: Callable[[mujoco.MjSpec], Any], **values: Any) -> Callable[[mujoco.MjSpec], None]:
    """Return an edit that sets attributes of what ``find`` returns."""

    def edit(spec: mujoco.MjSpec) -> None:
        for name, value in values.items():
            target = find(spec)
            if isinstance(value, list):
                getattr(target, name)[: len(value)] = value
            else:
                setattr(target, name, value)

    return edit


def add_weld(spec: mujoco.MjSpec) -> None:
    """Weld the ball to the world."""
    spec.add_equality(
        type=mujoco.mjtEq.mjEQ_WELD,
        name1="object/",
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        data=[0, 0, 0, 0, 0, 0.16, 1, 0, 0, 0, 1, 0],
    )


def add_mocap(spec: mujoco.MjSpec) -> None:
    """Put a hand of god under the ball."""
    body = spec.worldbody.add_body(name="hand", mocap=True, pos=[0, 0, 0.1])
    body.add_geom(name="palm", size=[0.02, 0.02, 0.02])


def add_thruster(spec: mujoco.MjSpec) -> None:
    """Drive the ball itself."""
    thruster = spec.add_actuator(
        name="thruster", target="object/free/", trntype=mujoco.mjtTrn.mjTRN_JOINT, gear=[0, 0, 1, 0, 0, 0]
    )
    thruster.set_to_motor()


def add_tendon(spec: mujoco.MjSpec) -> None:
    """Hang the ball on a string."""
    spec.worldbody.add_site(name="hook", pos=[0, 0, 0.3])
    tendon = spec.add_tendon(name="string", stiffness=10.0)
    tendon.wrap_site("hook")
    tendon.wrap_site("object/center")


def add_shelf(spec: mujoco.MjSpec) -> None:
    """Put a shelf into the world that the problem does not know."""
    spec.worldbody.add_geom(
        name="shelf", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.02, 0.02, 0.005], pos=[0, 0, 0.05]
    )


def add_exclude(spec: mujoco.MjSpec) -> None:
    """Let links pass through the ball."""
    spec.add_exclude(bodyname1="finger_1/link_4", bodyname2="object/")


def add_pair(spec: mujoco.MjSpec) -> None:
    """Give one contact settings of its own."""
    spec.add_pair(
        geomname1="finger_1/tip", geomname2="object/surface", friction=[2, 2, 0.1, 0.1, 0.1], condim=6
    )


def add_weight(spec: mujoco.MjSpec) -> None:
    """Hang a second geom on the object."""
    spec.body("object/").add_geom(name="keel", size=[0.005, 0, 0], pos=[0, 0, -0.03], mass=0.01)


CHEATS: dict[str, tuple[Callable[[mujoco.MjSpec], None], str]] = {
    "gravcomp": (assign(lambda s: s.body("object/"), gravcomp=1.0), "gravcomp of object/"),
    "frictionloss": (assign(free, frictionloss=0.6), "frictionloss of joint object/free/"),
    "viscosity": (assign(lambda s: s.option, viscosity=100.0), "option viscosity"),
    "density": (assign(lambda s: s.option, density=1000.0), "option density"),
    "wind": (assign(lambda s: s.option, wind=[0, 0, 1.0]), "option wind"),
    "armature": (assign(free, armature=10.0), "armature of joint object/free/"),
    "damping": (assign(free, damping=[10.0]), "damping of joint object/free/"),
    "gravity": (assign(lambda s: s.option, gravity=[0, 0, -1.0]), "option gravity"),
    "timestep": (assign(lambda s: s.option, timestep=0.002), "option timestep"),
    "impratio": (assign(lambda s: s.option, impratio=1000.0), "option impratio"),
    "noslip": (assign(lambda s: s.option, noslip_iterations=50), "option noslip_iterations"),
    "flags": (assign(lambda s: s.option, disableflags=1 << 7), "option disableflags"),
    "weld": (add_weld, "model neq"),
    "mocap": (add_mocap, "model nmocap"),
    "thruster": (add_thruster, "actuator 'thruster' does not act on a finger joint"),
    "tendon": (add_tendon, "model ntendon"),
    "shelf": (add_shelf, "geom shelf is not in the problem"),
    "exclude": (add_exclude, "model nexclude"),
    "pair": (add_pair, "model npair"),
    "friction of the ball": (assign(ball, friction=[2.0, 0.0025, 1e-4]), "friction of geom object/surface"),
    "friction of a tip": (
        assign(lambda s: s.geom("finger_2/tip"), friction=[0.55, 0.1, 1e-4]),
        "friction of geom finger_2/tip",
    ),
    "solref": (assign(ball, solref=[0.02, 1.0]), "solref of geom object/surface"),
    "solimp": (assign(ball, solimp=[0.9, 0.95, 0.001]), "solimp of geom object/surface"),
    "condim": (assign(ball, condim=6), "condim of geom object/surface"),
    "priority": (assign(ball, priority=1), "priority of geom object/surface"),
    "margin": (assign(ball, margin=0.001), "margin of geom object/surface"),
    "gap": (assign(ball, gap=0.001), "gap of geom object/surface"),
    "ghost link": (
        assign(lambda s: s.geom("finger_1/link_4"), contype=0, conaffinity=0),
        "contype of geom finger_1/link_4",
    ),
    "lighter": (assign(ball, mass=0.03), "object mass"),
    "smaller": (assign(ball, size=[0.034]), "size of object/surface"),
    "bigger tip": (assign(lambda s: s.geom("finger_3/tip"), size=[0.02]), "radius of finger_3/tip"),
    "inertia": (
        assign(
            lambda s: s.body("object/"),
            explicitinertial=True,
            mass=0.06,
            inertia=[1e-3, 1e-3, 1e-3],
            ipos=[0, 0, 0],
        ),
        "object inertia",
    ),
    "second geom": (add_weight, "number of geoms on the object"),
    "sticky joint": (
        assign(lambda s: s.joint("finger_1/joint_2"), frictionloss=0.5),
        "frictionloss of joint finger_1/joint_2",
    ),
    "heavy gear": (
        assign(lambda s: s.joint("finger_1/joint_2"), armature=0.1),
        "armature of joint finger_1/joint_2",
    ),
    "spring": (
        assign(lambda s: s.joint("finger_1/joint_2"), stiffness=[5.0]),
        "stiffness of joint finger_1/joint_2",
    ),
    "lighter link": (
        assign(lambda s: s.geom("finger_1/link_2"), mass=0.02),
        "mass of body finger_1/link_2",
    ),
    "longer link": (
        assign(lambda s: s.body("finger_2/link_5"), pos=[0.1, 0, 0]),
        "position of body finger_2/link_5",
    ),
    "tip measured elsewhere": (
        assign(lambda s: s.site("finger_1/tip_center"), pos=[0.041, 0, 0]),
        "position of site finger_1/tip_center",
    ),
    "tip beside its centre": (
        assign(lambda s: s.geom("finger_1/tip"), pos=[0.041, 0, 0]),
        "position of geom finger_1/tip",
    ),
    "thin link": (assign(lambda s: s.geom("finger_3/link_4"), size=[0.001]), "size of geom finger_3/link_4"),
    "wide joint": (
        assign(lambda s: s.joint("finger_1/joint_1"), range=[-3, 3]),
        "range of joint finger_1/joint_1",
    ),
    "turned joint": (
        assign(lambda s: s.joint("finger_1/joint_2"), axis=[0, 0, 1]),
        "axis of joint finger_1/joint_2",
    ),
    "stiff servo": (
        assign(lambda s: s.actuator("finger_1/servo_2"), gainprm=[80.0], biasprm=[0.0, -80.0, -0.6]),
        "gainprm of actuator finger_1/servo_2",
    ),
    "moved base": (assign(lambda s: s.body("finger_1/"), pos=[0.17, 0, 0.21]), "position of body finger_1/"),
    "moved home": (assign(lambda s: s.body("object/"), pos=[0, 0, 0.165]), "position of body object/"),
    "raised floor": (assign(lambda s: s.geom("floor"), pos=[0, 0, 0.02]), "position of geom floor"),
    "extra link": (
        lambda s: s.body("finger_1/link_6").add_geom(
            name="finger_1/nail", size=[0.003, 0, 0], pos=[0.06, 0, 0]
        ),
        "geom 'finger_1/nail' is not in the scene",
    ),
    "clamped servo": (
        assign(lambda s: s.actuator("finger_1/servo_2"), ctrlrange=[-1e-3, 1e-3], ctrllimited=1),
        "a control is out of its actuator's range",
    ),
    "strong servo": (
        assign(lambda s: s.actuator("finger_1/servo_2"), forcerange=[-5.0, 5.0]),
        "torque limit of actuator finger_1/servo_2",
    ),
}


def test_honest_world_is_clean() -> None:
    assert list(find_departures(honest())) == []


@pytest.mark.parametrize("name", CHEATS)
def test_cheat_is_found_and_named(name: str) -> None:
    edit, said = CHEATS[name]
    case = tampered(edit)
    assert check_physics_untouched(case).status == "fail"
    assert any(line.startswith(said) for line in find_departures(case)), list(find_departures(case))


def test_undeclared_force_is_found() -> None:
    xfrc = np.zeros((5, honest().replay.world.model.nbody, 6))
    xfrc[:, -1, 2] = 0.1
    case = make_case(record(samples=5, xfrc=xfrc))
    assert "the record applies a force that the problem does not declare" in list(find_departures(case))


@pytest.mark.parametrize("key", ["qfrc_applied", "xfrc_applied"])
def test_force_in_the_initial_state_is_found(key: str) -> None:
    model = honest().replay.world.model
    data = mujoco.MjData(model)
    signature = mujoco.mjtState.mjSTATE_INTEGRATION
    mujoco.mj_setState(model, data, np.array(honest().initial_state), signature)
    getattr(data, key).flat[-1] = 0.1
    state = np.empty(mujoco.mj_stateSize(model, signature))
    mujoco.mj_getState(model, data, state, signature)
    case = replace(honest(), initial_state=state)
    assert list(find_departures(case)) == [f"the initial state applies a force ({key})"]


def test_control_that_is_no_number_is_found() -> None:
    ctrl = np.array(honest().columns["ctrl"])
    ctrl[3, 3] = np.nan
    case = replace(honest(), columns={**honest().columns, "ctrl": ctrl})
    assert list(find_departures(case)) == ["a control is not a number"]


@pytest.mark.parametrize(
    "problem",
    [
        make_problem(friction={"sliding": 0.5}),
        make_problem(friction={"torsional_m": 0.002}),
        make_problem(object={"radius_m": 0.03}),
        make_problem(object={"mass_kg": 0.05}),
        make_problem(hand={"tip_radii_m": [0.018, 0.018]}),
        make_problem(hand={"base_azimuths_deg": [0.0, 121.0, 240.0]}),
        make_problem(hand={"joint_ranges_deg": {"finger_2.joint_3": [10.0, 90.0]}}),
        make_problem(scene="no_such_scene"),
        make_problem(control={"physics_profile": "portable"}),
        make_problem(obstacles=[{"kind": "box", "pos_m": [0, 0, 0], "size_m": [0.1, 0.1, 0.1]}]),
    ],
    ids=[
        "sliding",
        "torsional",
        "radius",
        "mass",
        "fingers",
        "base",
        "range",
        "scene",
        "profile",
        "obstacle",
    ],
)
def test_model_of_another_problem_is_found(problem: dict[str, Any]) -> None:
    assert check_physics_untouched(replace(honest(), problem=problem)).status == "fail"


def test_contact_with_other_settings_is_found() -> None:
    row = honest().replay.contact_settings[0]
    met = replace(honest().replay, contact_settings=(row, (0.8, *row[1:])))
    assert len(list(find_departures(replace(honest(), replay=met)))) == 1
