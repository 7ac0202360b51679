"""Step a recorded world again and read off what happened, knowing nothing of planner or controller.

Together with the rollout this is the only place that steps MuJoCo.  Stepping is the recipe of the record and
nothing else: ``mj_setState(initial_state)``, then per sample ``ctrl`` and ``mj_step(nstep)``.  Everything is
read from copies of the states (warm start included) that go through ``mj_forward`` afterwards, many at once: that
is exactly the first half of the step that follows, so contacts belong to the sample's own state and control,
and no reading can disturb the stepping.
"""

from __future__ import annotations

import mujoco
import numpy as np
from mujoco.batch import Batch

from dexplan.errors import RunFolderError
from dexplan.sim.judge.clearances import OBSTACLE_KINDS
from dexplan.sim.judge.reading import (
    INTEGRATION,
    SAMPLES,
    OtherContact,
    Reader,
    Replay,
    build_sensed_model,
)
from dexplan.sim.judge.world import read_world
from dexplan.spatial import Array

__all__ = ["OBSTACLE_KINDS", "OtherContact", "Replay", "replay"]


def replay(
    model_xml: str,
    initial_state: Array,
    ctrl: Array,
    physics_steps_per_sample: int,
    xfrc_applied: Array | None = None,
    *,
    clearance_stride: int = 5,
    clearance_horizon: float = 0.02,
) -> Replay:
    """Step ``model_xml`` from ``initial_state`` (mjSTATE_INTEGRATION) under ``ctrl`` (T, nu) and read every
    sample.

    ``xfrc_applied`` (T, nbody, 6) is a declared disturbance [N, N m, W].  Clearances are read at every
    ``clearance_stride``-th sample, out to ``clearance_horizon`` [m].  Raises RunFolderError where shapes do
    not fit the model.
    """
    world = read_world(model_xml)
    model = world.model
    ctrl = np.asarray(ctrl, dtype=np.float64)
    state = np.asarray(initial_state, dtype=np.float64)
    size = mujoco.mj_stateSize(model, INTEGRATION)
    _require_shape("ctrl", ctrl, (len(ctrl) if ctrl.ndim else 0, model.nu))
    _require_shape("initial_state", state, (size,))
    if xfrc_applied is not None:
        _require_shape("xfrc_applied", np.asarray(xfrc_applied), (len(ctrl), model.nbody, 6))
    if physics_steps_per_sample < 1:
        raise RunFolderError(
            "trace.npz", f"physics_steps_per_sample is {physics_steps_per_sample}", "1 or more is needed"
        )
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, state, INTEGRATION)
    batch = Batch(build_sensed_model(model_xml, world.fingers), SAMPLES, 1)
    reader = Reader(world, batch, len(ctrl), clearance_stride, clearance_horizon)
    rows = list(batch.state)
    for t in range(len(ctrl)):
        data.ctrl[:] = ctrl[t]
        if xfrc_applied is not None:
            data.xfrc_applied[:] = xfrc_applied[t]
        mujoco.mj_getState(model, data, rows[t % SAMPLES], INTEGRATION)
        if (t + 1) % SAMPLES == 0 or t + 1 == len(ctrl):
            reader.read(t - t % SAMPLES, t % SAMPLES + 1)
        if t + 1 < len(ctrl):
            mujoco.mj_step(model, data, nstep=physics_steps_per_sample)
    return reader.as_replay(data)


def _require_shape(name: str, array: Array, shape: tuple[int, ...]) -> None:
    """Raise RunFolderError where a column does not fit the model."""
    if array.shape != shape:
        raise RunFolderError("trace.npz", f"{name} has shape {array.shape}", f"the model needs {shape}")
