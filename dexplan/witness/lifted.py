"""One finger lifted from a random three-finger grasp: what the load margin of the other two predicts, and what happens.

The hand stands on the ball with three soft fingers that press with the forces of the three's best load margin.  Smoothly
the wanted forces then go over to those of the remaining pair: any mixture of two sets of forces that carry the weight carries
it too, so nothing moves as long as both stay in their cones.  The finger that is left without force is drawn back along its
normal, the ball is nudged, and what became of it is read off.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import mujoco
import numpy as np

from dexplan.brief import brief_repr
from dexplan.contact.friction import SoftFinger
from dexplan.kinematics.chain import compute_tip_pose, solve_ik
from dexplan.scene.description import SceneParameters
from dexplan.scene.scene import build_scene
from dexplan.scene.shape import Shape
from dexplan.sim.judge.replay import replay
from dexplan.spatial import Array, angles_from_direction, direction_from_angles
from dexplan.witness.experiments import (
    MASS,
    PULSE,
    RADIUS,
    REST,
    STEPS,
    build_grasp,
    build_nudges,
    smooth,
    solve_forces,
)
from dexplan.witness.outcome import Kind, Outcome, classify
from dexplan.witness.stance import Stance, solve_stance

SLIDING, PATCH, PRELOAD = (0.3, 0.8), (0.3e-3, 5e-3), (5.0, 12.0)
"""What is drawn: mu uniformly, mu_t / mu [m] uniformly in its logarithm, mean normal force [N] uniformly."""
AZIMUTH_DEG, ELEVATION_DEG = 45.0, (-25.0, 45.0)
"""Contacts are drawn within this of their finger's base azimuth, and in this range of elevation."""
CLEARANCE = 3e-3
"""Fingertips stand at least this far apart [m]."""
LEAST_MARGIN = 0.1
"""Load margin that the three fingers together must have."""
ANY_TORSION = 1.0
"""Torsional friction [m] of fingertips that could bear any torque about their normals: what is left is to balance forces."""
BAND = 0.02
"""A margin nearer to zero than this predicts nothing."""
SPIN_BAND = 0.15
"""Spin is only predicted clearly where force balance has this margin.  A contact that turns at its limit while it uses the
share u of its cone for force slides along by (mu_t / mu) u / sqrt(1 - u^2) per radian, which has no bound towards u = 1: what
begins as a spin moves the contacts, and from little margin ends as a drop.  Here u = 0.85.  (Set wider than :data:`BAND` after
seeds 0 to 261, of which one with margin 0.10 spun by 10 degrees and then dropped the ball.)"""
TRANSFER, DRAWN, RETREAT = 0.4, 0.3, 0.012
"""Time [s] in which the forces go over to the pair, time and way [m] in which the finger is drawn back."""
LEAD = 0.1


@dataclass(frozen=True, eq=False)
class Draw:
    """A random grasp: contacts' outward ``directions`` (3, 3), frictions, preload [N], and which finger is lifted."""

    seed: int
    directions: Array
    sliding: float
    torsional: float
    preload: float
    lifted: int

    @property
    def pair(self) -> tuple[int, int]:
        """The fingers that stay."""
        first, second = (i for i in range(3) if i != self.lifted)
        return first, second


@dataclass(frozen=True)
class LiftedFinger:
    """One grasp, one finger lifted: predicted and observed.

    ``margin_three`` and ``margin_pair`` are load margins [-]; ``margin_pivot`` is the pair's with torsional friction that
    bears anything.  ``predicted`` is hold where the pair's margin is positive, spin where only torsion is missing, else drop
    (the chord leaves the cones: the tips slide or lose the ball).  ``is_clear`` says that the margins that decide are at
    least :data:`BAND` from zero (:data:`SPIN_BAND` for the force balance of a spin); ``agrees`` that what was observed is
    what was predicted.
    """

    seed: int
    sliding: float
    torsional_mm: float
    preload_N: float
    contacts_deg: tuple[tuple[float, float], ...]
    lifted: int
    separation_deg: float
    margin_three: float
    margin_pair: float
    margin_pivot: float
    predicted: str
    is_clear: bool
    agrees: bool
    lifted_is_off: bool
    torque_share_wanted: float
    outcome: Outcome

    __repr__ = brief_repr

    def as_json(self) -> dict[str, Any]:
        """Return plain data."""
        return asdict(self)


def predict(margin_pair: float, margin_pivot: float) -> tuple[Kind, bool]:
    """Return what the margins of a pair predict, and whether they are clear of zero."""
    if margin_pair > 0.0:
        return Kind.HOLD, margin_pair > BAND
    if margin_pivot > 0.0:
        return Kind.SPIN, margin_pair < -BAND and margin_pivot > SPIN_BAND
    return Kind.DROP, margin_pivot < -BAND


def draw(seed: int) -> Draw:
    """Return the random grasp of ``seed``; nothing is checked yet."""
    rng = np.random.default_rng(seed)
    azimuths = np.array([0.0, 120.0, 240.0]) + rng.uniform(-AZIMUTH_DEG, AZIMUTH_DEG, 3)
    directions = direction_from_angles(azimuths, rng.uniform(*ELEVATION_DEG, 3))
    sliding = rng.uniform(*SLIDING)
    patch = math.exp(rng.uniform(*np.log(PATCH)))
    return Draw(
        seed,
        directions,
        float(sliding),
        float(sliding * patch),
        float(rng.uniform(*PRELOAD)),
        int(rng.integers(3)),
    )


def lift(drawn: Draw) -> LiftedFinger | None:
    """Return what lifting does, or None where the grasp is none to begin with.

    That is: fingertips too near to one another, a contact out of reach, torques beyond the servos (of the three, and of a
    pair that would not drop), other geoms in touch, or three fingers that would not hold with :data:`LEAST_MARGIN`.
    """
    model = SoftFinger(drawn.sliding, drawn.torsional)
    directions = dict(enumerate(drawn.directions))
    margin_three, three = solve_forces(build_grasp(directions, model), np.zeros(6), drawn.preload)
    if three is None or margin_three < LEAST_MARGIN or not _stand_clear(drawn.directions):
        return None
    staying = {i: directions[i] for i in drawn.pair}
    margin_pair, pair = solve_forces(build_grasp(staying, model), np.zeros(6), drawn.preload)
    margin_pivot, pivot = solve_forces(
        build_grasp(staying, SoftFinger(drawn.sliding, ANY_TORSION)), np.zeros(6), drawn.preload
    )
    predicted, is_clear = predict(margin_pair, margin_pivot)
    if pair is None or pivot is None:
        return None
    alone = np.zeros_like(three)
    alone[list(drawn.pair)] = pair
    scene = build_scene(
        SceneParameters(
            object_shape=Shape.ball(RADIUS),
            object_mass=MASS,
            sliding_friction=drawn.sliding,
            torsional_friction=drawn.torsional,
        )
    )
    stance = solve_stance(scene, directions, np.stack([three, alone]))
    if stance is None or stance.compute_torque_share(three) > 1.0:
        return None
    if predicted is not Kind.DROP and stance.compute_torque_share(alone) > 1.0:
        return None  # theory speaks of forces that the servos cannot give; where even those would not hold, it may
    samples = round((LEAD + TRANSFER + DRAWN + 3.0 * PULSE + REST) / (1e-3 * STEPS))
    time = np.arange(samples, dtype=np.float64) * (1e-3 * STEPS)
    forces = three + smooth((time - LEAD) / TRANSFER)[:, None, None] * (alone - three)
    command = stance.compute_command(forces)
    way = smooth((time - LEAD - TRANSFER) / DRAWN)
    command[:, scene.actuators[drawn.lifted]] += _draw_back(stance, drawn.lifted, way)
    push = np.zeros((samples, scene.model.nbody, 6))
    push[:, scene.object_body] = build_nudges(time, float(time[-1]) - 3.0 * PULSE - REST)
    done = replay(scene.xml, stance.state, command, STEPS, push, clearance_stride=samples)
    if any(other.sample == 0 for other in done.other_contacts):
        return None
    outcome = classify(done, drawn.pair)
    # A chord outside the cones lets the tips slide; whether the ball is out already when it is judged is a matter of speed.
    seen = Kind.DROP if outcome.kind is Kind.SLIP else outcome.kind
    azimuth, elevation = angles_from_direction(drawn.directions)
    first, second = (drawn.directions[i] for i in drawn.pair)
    return LiftedFinger(
        seed=drawn.seed,
        sliding=drawn.sliding,
        torsional_mm=1e3 * drawn.torsional,
        preload_N=drawn.preload,
        contacts_deg=tuple((float(a), float(e)) for a, e in zip(azimuth, elevation, strict=True)),
        lifted=drawn.lifted,
        separation_deg=math.degrees(math.acos(float(np.clip(first @ second, -1.0, 1.0)))),
        margin_three=margin_three,
        margin_pair=margin_pair,
        margin_pivot=margin_pivot,
        predicted=str(predicted),
        is_clear=is_clear,
        agrees=seen is predicted,
        lifted_is_off=not bool(done.contact_active[-1, drawn.lifted]),
        torque_share_wanted=stance.compute_torque_share(np.stack([three, alone])),
        outcome=outcome,
    )


def _stand_clear(directions: Array) -> bool:
    tip_radius = max(SceneParameters().tip_radii)
    centers = (RADIUS + tip_radius) * directions
    apart = np.linalg.norm(centers - np.roll(centers, 1, axis=0), axis=1)
    return bool(apart.min() > 2.0 * tip_radius + CLEARANCE)


def _draw_back(stance: Stance, finger: int, share: Array) -> Array:
    """Return what the finger's command changes by (T, J) [rad] while its tip goes out by ``share`` (T,) of :data:`RETREAT`.

    Its own weight is carried along the way.
    """
    scene = stance.scene
    tip, start = scene.fingers[finger], stance.q[finger]
    X_WF = compute_tip_pose(tip.chain, start)
    outward = X_WF[:3, 3] - scene.object.X_WO_home[:3, 3]
    outward = outward / np.linalg.norm(outward)
    knots = np.linspace(0.0, 1.0, 7)
    change = np.zeros((len(knots), len(start)))
    data, q = mujoco.MjData(scene.model), np.array(stance.q)
    for k, knot in enumerate(knots):
        target = X_WF.copy()
        target[:3, 3] += knot * RETREAT * outward
        q[finger] = solve_ik(tip.chain, target[None], q[finger][None])[0][0]
        data.qpos[:] = scene.as_qpos(q, scene.object.X_WO_home)
        mujoco.mj_forward(scene.model, data)
        weight = data.qfrc_bias[scene.joint_dof[finger]] - stance.bias[finger]
        change[k] = q[finger] - start + weight / tip.servo_gain
    return np.stack([np.interp(share, knots, column) for column in change.T], axis=1)
