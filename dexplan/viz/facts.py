"""What a film measures: per sample of a run how far the object has come, how near to slipping it is, and where it was touched."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from dexplan.brief import brief_repr
from dexplan.errors import RenderError
from dexplan.sim.trace import Trace
from dexplan.spatial import Array, lock_arrays
from dexplan.viz.curves import compute_utilisation
from dexplan.viz.story import Story
from dexplan.viz.timeline import compute_turned_angle

MEMORY = 0.2
"""Numbers show the largest share of friction of so many seconds, since what flickers cannot be read."""
TRAIL_STEP = 0.04
"""Contact trails have a point at least every so many seconds."""
AT_GOAL = np.radians(3.0)
"""A finger is said to be at its goal contact within this share of the goal's distance from the object's centre: 3° on a ball."""
_COLUMNS = ("contact_active", "contact_point_O", "contact_rotation_O", "contact_force")


@dataclass(frozen=True, eq=False)
class Episode:
    """One touch of a finger, from ``start`` to ``end`` [s]: contact points (N, 3) [m] at ``times`` (N,), in object axes, and in
    the axes of the body that the tip belongs to; ``normal_O`` (3,) is the object's outward normal at the first of them.
    """

    finger: int
    start: float
    end: float
    times: Array
    point_O: Array
    point_B: Array
    normal_O: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(frozen=True, eq=False)
class Facts:
    """Numbers of a run at its T samples, for F fingers.

    ``qpos`` (T, nq) without samples that are no numbers; ``pose`` (T, 7) of the object; ``turned`` (T,) [rad] and ``shift`` (T,)
    [m] since the start; ``share`` (T, F) of friction used, NaN where a finger does not touch; ``normal`` (T, F) [N];
    ``is_at_goal`` (T, F); ``sliding`` and ``torsional`` friction [-], [m].
    """

    qpos: Array
    pose: Array
    turned: Array
    shift: Array
    share: Array
    normal: Array
    is_at_goal: NDArray[np.bool_]
    episodes: tuple[Episode, ...]
    sliding: float
    torsional: float

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def compute_facts(trace: Trace, story: Story, model: mujoco.MjModel, fingers: tuple[str, ...]) -> Facts:
    """Return the numbers of a run.  Raises RenderError for a trace that has nothing to show."""
    missing = [name for name in ("time", "qpos") if name not in trace]
    if missing:
        raise RenderError(f"the trace lacks {' and '.join(missing)}; a trace of a run is needed")
    qpos = fill_poses(trace["qpos"])
    address = int(model.joint("object/free/").qposadr[0])
    pose = qpos[:, address : address + 7]
    count, width = len(qpos), len(fingers)
    share, normal = np.full((count, width), np.nan), np.full((count, width), np.nan)
    is_at_goal = np.zeros((count, width), dtype=bool)
    episodes: tuple[Episode, ...] = ()
    sliding, torsional = _read_friction(model, fingers)
    if width and all(name in trace for name in _COLUMNS):
        force, active = trace["contact_force"], trace["contact_active"]
        used = np.where(active, compute_utilisation(force, sliding, torsional), np.nan)
        share = _keep_largest(trace["time"], used)
        normal = np.where(active, force[..., 2], np.nan)
        is_at_goal = _find_at_goal(trace["contact_point_O"], active, story)
        episodes = _find_episodes(trace, qpos, model, fingers)
    return Facts(
        qpos=qpos,
        pose=pose,
        turned=compute_turned_angle(pose, story.axis_W),
        shift=np.linalg.norm(pose[:, :3] - pose[0, :3], axis=1),
        share=share,
        normal=normal,
        is_at_goal=is_at_goal,
        episodes=episodes,
        sliding=sliding,
        torsional=torsional,
    )


def fill_poses(qpos: Array) -> Array:
    """Return ``qpos`` (T, nq) with every sample that is no number replaced by the last good one before it."""
    is_good = np.isfinite(qpos).all(axis=1)
    if not is_good.any():
        raise RenderError("the trace has no sample to show: a run of at least one finite pose is needed")
    latest = np.maximum.accumulate(np.where(is_good, np.arange(len(qpos)), -1))
    filled: Array = qpos[np.where(latest < 0, int(np.argmax(is_good)), latest)]
    return filled


def _read_friction(model: mujoco.MjModel, fingers: tuple[str, ...]) -> tuple[float, float]:
    """Return sliding [-] and torsional [m] friction between the first tip and the object."""
    names = [f"{finger}/tip" for finger in fingers[:1]] + ["object/surface"]
    ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name) for name in names]
    # MuJoCo takes the larger friction of the two geoms.
    pair = model.geom_friction[[g for g in ids if g >= 0]].max(axis=0, initial=1e-6)
    return float(pair[0]), float(pair[1])


def _keep_largest(time: Array, used: Array) -> Array:
    """Return per sample the largest of the last ``MEMORY`` seconds; NaN where there is none now."""
    if len(time) < 2:
        return used
    width = max(1, round(MEMORY / float(np.median(np.diff(time)))))
    known = np.where(np.isfinite(used), used, 0.0)
    largest = maximum_filter1d(known, width, axis=0, origin=(width - 1) // 2, mode="nearest")
    return np.where(np.isfinite(used), largest, np.nan)


def _find_at_goal(points: Array, active: NDArray[np.bool_], story: Story) -> NDArray[np.bool_]:
    is_at_goal = np.zeros(active.shape, dtype=bool)
    for finger, goal in enumerate(story.goal_points[: active.shape[1]]):
        if goal is None:
            is_at_goal[:, finger] = ~active[:, finger]
            continue
        off = np.linalg.norm(points[:, finger] - goal, axis=1)
        is_at_goal[:, finger] = active[:, finger] & (off < AT_GOAL * np.linalg.norm(goal))
    return is_at_goal


def _find_episodes(
    trace: Trace, qpos: Array, model: mujoco.MjModel, fingers: tuple[str, ...]
) -> tuple[Episode, ...]:
    """Return every touch of every finger, in the order of their starts."""
    time, active, points = trace["time"], trace["contact_active"], trace["contact_point_O"]
    data = mujoco.MjData(model)
    bodies = [int(model.geom_bodyid[model.geom(f"{finger}/tip").id]) for finger in fingers]
    thing = int(model.geom_bodyid[model.geom("object/surface").id])
    found = []
    for finger, body in enumerate(bodies):
        is_good = active[:, finger] & np.isfinite(points[:, finger]).all(axis=1)
        edges = np.flatnonzero(np.diff(is_good.astype(np.int8), prepend=0, append=0))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            step = max(1, round(TRAIL_STEP * (b - a) / max(time[b - 1] - time[a], TRAIL_STEP)))
            samples = np.unique(np.append(np.arange(a, b, step), b - 1))
            point_O = points[samples, finger]
            point_B = np.empty_like(point_O)
            for k, sample in enumerate(samples):
                data.qpos[:] = qpos[sample]
                mujoco.mj_kinematics(model, data)
                p_W = data.xmat[thing].reshape(3, 3) @ point_O[k] + data.xpos[thing]
                point_B[k] = data.xmat[body].reshape(3, 3).T @ (p_W - data.xpos[body])
            end = float(time[min(b, len(time) - 1)])
            normal_O = -trace["contact_rotation_O"][a, finger, :, 2]
            found.append(Episode(finger, float(time[a]), end, time[samples], point_O, point_B, normal_O))
    return tuple(sorted(found, key=lambda e: (e.start, e.finger)))
