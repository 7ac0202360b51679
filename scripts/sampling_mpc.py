"""The usual answer to compare with: sampling MPC on the same model and goal (cross-entropy over joint targets)."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from typing import Any

import mujoco
import mujoco.rollout
import numpy as np

from dexplan.scene.scene import Scene
from dexplan.sim.trace import Trace
from dexplan.spatial import Array, as_pose, rotation_vector

STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


@dataclass(frozen=True)
class SamplingOptions:
    """``samples`` sequences of ``knots`` joint targets, each held for ``hold`` [s]; the best ``elites`` of them are averaged and
    their spread kept, ``rounds`` times, before the first target is carried out.  ``spread`` [rad] to begin with.
    """

    samples: int = 32
    knots: int = 2
    hold: float = 0.04
    elites: int = 6
    rounds: int = 1
    spread: float = 0.02
    seed: int = 0


def run_sampling_mpc(scene: Scene, start: Trace, duration: float, options: SamplingOptions) -> dict[str, Any]:
    """Follow the object's reference in the trace ``start`` from its first sample on for ``duration`` [s]; return what came of it.

    Cost of a sequence, summed over its states: squared errors of the object's position (in cm) and rotation (in 0.1 rad) from
    where the reference has it, and ten times the squared joint targets' distance from the first ones.  Compute is counted over
    all cores.
    """
    model, rng = scene.model, np.random.default_rng(options.seed)
    threads, steps = os.cpu_count() or 1, round(options.hold / model.opt.timestep)
    data, pool = mujoco.MjData(model), [mujoco.MjData(model) for _ in range(threads)]
    mujoco.mj_setState(model, data, start["initial_state"], mujoco.mjtState.mjSTATE_INTEGRATION)
    path = as_pose(start["object_pose_reference"])
    times, home = start["time"], start["ctrl"][0].copy()
    p0 = data.qpos[scene.object_qpos : scene.object_qpos + 3].copy()
    mean, began, dropped = np.tile(home, (options.knots, 1)), time.process_time(), None
    first = 1 + scene.object_qpos
    with mujoco.rollout.Rollout(nthread=threads) as roller:
        while data.time < duration and dropped is None:
            spread = np.full_like(mean, options.spread)
            state = np.empty(mujoco.mj_stateSize(model, STATE))
            mujoco.mj_getState(model, data, state, STATE)
            ahead = data.time + options.hold * np.arange(1, options.knots + 1)
            X = path[np.minimum(np.searchsorted(times, ahead), len(path) - 1)]
            for _ in range(options.rounds):
                drawn = mean + spread * rng.normal(size=(options.samples, *mean.shape))
                drawn[0] = mean
                states, _ = roller.rollout(
                    model, pool, np.tile(state, (options.samples, 1)), np.repeat(drawn, steps, axis=1)
                )
                ends = states[:, steps - 1 :: steps]
                cost = np.array([_price(row[:, first : first + 7], X) for row in ends])
                cost += 10.0 * np.square(drawn - home).sum(axis=(1, 2))
                best = np.argsort(cost)[: options.elites]
                mean, spread = drawn[best].mean(axis=0), drawn[best].std(axis=0)
            data.ctrl[:] = mean[0]
            mujoco.mj_step(model, data, nstep=steps)
            mean = np.concatenate([mean[1:], mean[-1:]])
            if data.qpos[scene.object_qpos + 2] < p0[2] - 0.05:
                dropped = float(data.time)
    spent, simulated = time.process_time() - began, float(data.time)
    X_WO = as_pose(data.qpos[scene.object_qpos : scene.object_qpos + 7])
    X_end = path[min(int(np.searchsorted(times, simulated)), len(path) - 1)]
    return {
        "dropped_at_s": dropped,
        "simulated_s": simulated,
        "compute_per_simulated_s": spent / simulated,
        "position_error_mm": 1e3 * float(np.linalg.norm(X_WO[:3, 3] - X_end[:3, 3])),
        "rotation_error_deg": float(
            np.degrees(np.linalg.norm(rotation_vector(X_WO[:3, :3] @ X_end[:3, :3].T)))
        ),
    }


def _price(poses: Array, wanted: Array) -> float:
    """Return what object poses (K, 7) cost where ``wanted`` (K, 4, 4) are asked for."""
    found = as_pose(poses)
    off = 1e2 * (found[:, :3, 3] - wanted[:, :3, 3])
    turns = found[:, :3, :3] @ wanted[:, :3, :3].swapaxes(1, 2)
    angle = np.arccos(np.clip(0.5 * (np.trace(turns, axis1=1, axis2=2) - 1.0), -1.0, 1.0))
    return float(np.square(off).sum() + np.square(10.0 * angle).sum())
