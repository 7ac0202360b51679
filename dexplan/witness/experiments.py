"""Four experiments with a boundary each: what theory says of it, and what the simulated hand does on either side.

Every experiment is one dial ``x`` at a friction coefficient mu.  The contact forces are those of the best margin under the
load (:func:`dexplan.grasp.closure.compute_load_margin`) at the preload, so theory's boundary is where that margin is zero;
the hand is told to press with exactly these forces, and the world decides.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from dexplan.contact.friction import ContactModel, HardFinger, SoftFinger
from dexplan.grasp.closure import compute_load_margin
from dexplan.grasp.grasp import Grasp, contact_on_sphere
from dexplan.scene.library import load_scene
from dexplan.scene.shape import Shape
from dexplan.sim.judge.replay import replay
from dexplan.spatial import GRAVITY, Array, direction_from_angles
from dexplan.witness.outcome import HARD_TORSION, Outcome, classify
from dexplan.witness.stance import solve_stance

RADIUS, MASS = 0.035, 0.060
"""The object: radius [m], mass [kg]."""
PRELOAD = 10.0
"""Mean normal force [N]."""
PATCH = 0.0025 / 0.55
"""Torsional over sliding friction of a soft finger [m]: mu_t = (3 pi / 16) mu a for one patch radius a (Hertz)."""
MIDDLE_DEG = 60.0
"""Azimuth midway between the two fingers of a pair: between the bases of fingers 1 and 2."""

STEPS = 4
"""Physics steps of 1 ms per sample."""
RAMP, SETTLE, PULSE, REST = 0.3, 0.1, 0.1, 0.2
"""Times [s]: the load grows smoothly, then stays; three pulses nudge the object; then it is left alone."""
NUDGE = 0.05
"""Height [N] of the pulses along x, y and z: an equilibrium that stands only while nobody touches it is none."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """One dial ``x`` and the boundary on it.

    ``model(mu)`` is the contact model of every finger; ``place(x)`` the contacts' outward directions per finger;
    ``load(x)`` (6,) the wrench (f, tau) [N, N m] about the object's centre in W that acts on it besides its weight;
    ``closed_form(mu)`` the boundary without weight; ``holds_above``: whether larger ``x`` is safer;
    ``demand(closed)`` how near the simulated boundary must come to the load-aware one; ``span`` the grid of the picture.
    """

    name: str
    title: str
    quantity: str
    unit: str
    holds_above: bool
    model: Callable[[float], ContactModel]
    place: Callable[[float], Mapping[int, Array]]
    load: Callable[[float], Array]
    closed_form: Callable[[float], float]
    demand: Callable[[float], float]
    span: tuple[float, float]


def build_grasp(directions: Mapping[int, Array], model: ContactModel) -> Grasp:
    """Return contacts of one model on the ball at outward ``directions`` per finger."""
    return Grasp(tuple(contact_on_sphere(i, d, RADIUS, model) for i, d in directions.items()))


def solve_forces(grasp: Grasp, load: Array, preload: float, mass: float = MASS) -> tuple[float, Array | None]:
    """Return the load margin [-] and the forces (N, 4) that attain it, under weight and ``load`` (6,) at ``preload`` [N].

    Forces are None where no contact forces at all balance the load.
    """
    carried = -np.asarray(load, dtype=np.float64)
    carried[2] += mass * GRAVITY
    result = compute_load_margin(grasp, carried, preload)
    if result.internal_forces is None:
        return -math.inf, None
    forces = np.zeros((len(grasp.contacts), 4))
    for k, part in enumerate(grasp.slices):
        forces[k, : part.stop - part.start] = result.internal_forces[part]
    return result.margin, forces


def compute_margin(experiment: Experiment, mu: float, x: float) -> float:
    """Return the load margin of ``experiment`` at ``x``: positive where theory says that it holds."""
    grasp = build_grasp(experiment.place(x), experiment.model(mu))
    return solve_forces(grasp, experiment.load(x), PRELOAD)[0]


def compute_load_aware(experiment: Experiment, mu: float) -> float:
    """Return the boundary on ``x`` under weight at the preload: where the load margin is zero."""
    closed = experiment.closed_form(mu)
    worse, better = (0.95, 1.15) if experiment.holds_above else (1.3, 0.5)
    ends = (worse * closed, min(better * closed, 180.0) if experiment.holds_above else better * closed)
    return float(
        brentq(lambda x: max(compute_margin(experiment, mu, x), -1.0), *ends, xtol=1e-6 * abs(closed))
    )


def run(experiment: Experiment, mu: float, x: float, believed: float | None = None) -> Outcome | None:
    """Return what the simulated hand does at ``x``, or None where no posture reaches it clear of the rest with its torques.

    ``mu`` is the world's friction; ``believed`` (default: the same) the one for which the forces are chosen.
    """
    model, directions = experiment.model(mu), experiment.place(x)
    grasp = build_grasp(directions, experiment.model(mu if believed is None else believed))
    load = experiment.load(x)
    sets = [solve_forces(grasp, load * share, PRELOAD)[1] for share in ((0.0, 1.0) if load.any() else (0.0,))]
    found = [forces for forces in sets if forces is not None]
    if len(found) < len(sets):
        return None
    torsional = model.torsional if isinstance(model, SoftFinger) else HARD_TORSION
    scene = load_scene(
        object_shape=Shape.ball(RADIUS), object_mass=MASS, sliding_friction=mu, torsional_friction=torsional
    )
    stance = solve_stance(scene, directions, np.stack(found))
    if stance is None or stance.compute_torque_share(np.stack(found)) > 1.0:
        return None
    # Forces between two that balance their loads balance the load between.
    time = np.arange(0.0, (RAMP if load.any() else 0.0) + SETTLE + 3.0 * PULSE + REST, 1e-3 * STEPS)
    grown = smooth(time / RAMP) if load.any() else np.ones_like(time)
    forces = found[0] + grown[:, None, None] * (found[-1] - found[0])
    push = np.zeros((len(time), scene.model.nbody, 6))
    push[:, scene.object_body] = grown[:, None] * load
    push[:, scene.object_body] += build_nudges(time, float(time[-1]) - 3.0 * PULSE - REST)
    command = stance.compute_command(forces)
    done = replay(scene.xml, stance.state, command, STEPS, push, clearance_stride=len(time))
    return classify(done, tuple(directions))


def build_nudges(time: Array, start: float) -> Array:
    """Return three pulses (T, 6) of force [N] on the object at ``time`` (T,) from ``start`` on: along x, y and z of W."""
    nudges = np.zeros((len(time), 6))
    for axis in range(3):
        phase = np.clip((time - start) / PULSE - axis, 0.0, 1.0)
        nudges[:, axis] = NUDGE * np.sin(np.pi * phase)
    return nudges


def smooth(share: Array) -> Array:
    """Return a step from 0 to 1 with no velocity or acceleration at either end, for ``share`` of its time."""
    s = np.clip(share, 0.0, 1.0)
    step: Array = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return step


def _place_pair(separation_deg: float) -> Mapping[int, Array]:
    half = 0.5 * separation_deg
    return {
        0: direction_from_angles(MIDDLE_DEG - half, 0.0),
        1: direction_from_angles(MIDDLE_DEG + half, 0.0),
    }


def _place_triple(height: float) -> Mapping[int, Array]:
    elevation = math.degrees(math.asin(height))
    return {i: direction_from_angles(120.0 * i, elevation) for i in range(3)}


def _soft(mu: float) -> SoftFinger:
    return SoftFinger(mu, mu * PATCH)


CHORD = _place_pair(180.0)[1]
"""Unit axis (3,) of two antipodal fingers, in W."""

EXPERIMENTS = (
    Experiment(
        name="pair",
        title="two soft fingers",
        quantity="separation",
        unit="deg",
        holds_above=True,
        model=_soft,
        place=_place_pair,
        load=lambda x: np.zeros(6),
        closed_form=lambda mu: 180.0 - 2.0 * math.degrees(math.atan(mu)),
        demand=lambda closed: 2.0,
        span=(90.0, 174.0),
    ),
    Experiment(
        name="triple",
        title="three hard fingers on a circle of latitude",
        quantity="height of their plane",
        unit="r",
        holds_above=False,
        model=HardFinger,
        place=_place_triple,
        load=lambda x: np.zeros(6),
        closed_form=lambda mu: math.sin(math.atan(mu)),
        demand=lambda closed: 0.02,
        span=(0.1, 0.75),
    ),
    Experiment(
        name="torsion",
        title="torsion about the axis of two opposite soft fingers",
        quantity="torque",
        unit="N mm",
        holds_above=False,
        model=_soft,
        place=lambda x: _place_pair(180.0),
        load=lambda x: np.concatenate([np.zeros(3), 1e-3 * x * CHORD]),
        closed_form=lambda mu: 1e3 * 2.0 * mu * PATCH * PRELOAD,
        demand=lambda closed: 0.1 * closed,
        span=(10.0, 100.0),
    ),
    Experiment(
        name="shear",
        title="upward pull on a ball between two opposite soft fingers",
        quantity="force",
        unit="N",
        holds_above=False,
        model=_soft,
        place=lambda x: _place_pair(180.0),
        # Downwards the same force would ask the shoulders for more than their 1.5 N m at mu 0.8.
        load=lambda x: np.array([0.0, 0.0, x, 0.0, 0.0, 0.0]),
        closed_form=lambda mu: 2.0 * mu * PRELOAD,
        demand=lambda closed: 0.1 * closed,
        span=(2.0, 22.0),
    ),
)
"""The experiments of the phase diagram, by panel."""
