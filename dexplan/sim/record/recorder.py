"""What a run keeps of every sample, and the reading of contacts from many samples at once.

At a sample only the simulator's state and what the controller said are kept.  Contacts, forces and slip belong to that state
and its control, so they are evaluated afterwards, one batch of samples after the other, in a single call to MuJoCo per batch; the
world that is stepped is never asked.
"""

from __future__ import annotations

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from dexplan.control.controller import Command
from dexplan.control.foreign import ForeignCommand
from dexplan.grasp.force.solver import ForceSolution
from dexplan.scene.scene import Scene
from dexplan.scene.touch import TOUCH_FIELDS, Touches, read_touches
from dexplan.spatial import Array, as_pose7

BATCH = 256
"""Samples that are evaluated together.  More take more memory and hardly less time."""
STATE = mujoco.mjtState.mjSTATE_INTEGRATION
Columns = dict[str, NDArray[np.generic]]


class Recorder:
    """Keeps samples, evaluates them in batches, and gives them back as columns.

    Evaluating a batch again gives the same, so that a run that is cut short anywhere keeps all of its whole samples.
    """

    def __init__(self, scene: Scene, batch: Batch, has_internals: bool) -> None:
        """``batch`` has :data:`BATCH` simulations of the scene's model with touch sensors; ``has_internals``: whether dexplan's
        own controller is recorded, which says more than its controls.
        """
        self._scene, self._batch, self._has_internals = scene, batch, has_internals
        self._model = scene.model
        self._fields = {name: batch.bind(name) for name in TOUCH_FIELDS}
        self._states = {name: batch.bind(name) for name in ("time", "qpos", "qvel", "ctrl")}
        self._rows = list(batch.state)
        self._commands: list[Command | ForeignCommand] = []
        self._done: list[Columns] = []

    @property
    def count(self) -> int:
        """Number of samples kept."""
        return BATCH * len(self._done) + len(self._commands)

    def keep(self, data: mujoco.MjData, command: Command | ForeignCommand) -> None:
        """Keep the sample that ``data`` is at, with the controls that follow from it, and what led to them."""
        if len(self._commands) == BATCH:
            self._done, self._commands = [*self._done, self._evaluate()], []
        mujoco.mj_getState(self._model, data, self._rows[len(self._commands)], STATE)
        self._commands.append(command)

    def as_columns(self) -> Columns:
        """Return the columns of all samples kept."""
        parts = [*self._done, self._evaluate()]
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def _evaluate(self) -> Columns:
        """Return the columns of the samples kept since the last batch."""
        commands, n = self._commands, len(self._commands)
        columns: Columns = {name: values[:n].copy() for name, values in self._states.items()}
        self._batch.forward(np.arange(n))
        touches = read_touches(self._scene, {name: field[:n] for name, field in self._fields.items()})
        own = [command for command in commands if isinstance(command, Command)]
        return columns | {
            "object_pose_reference": as_pose7(np.array([c.X_WO_ref for c in commands]).reshape(n, 4, 4)),
            "action_index": np.array([c.action_index for c in commands], dtype=np.int64),
            "phase_index": np.array([c.phase_index for c in commands], dtype=np.int64),
            "contact_active": touches.active,
            "contact_point_O": touches.point_O,
            "contact_rotation_O": touches.rotation_O,
            "contact_force": touches.force,
            "contact_slip_velocity": touches.slip_velocity,
            "tip_contact_angle": touches.pole_angle,
            **(_read_internals(own, touches) if self._has_internals else {}),
        }


def _read_internals(commands: list[Command], touches: Touches) -> Columns:
    """Return what dexplan's own controller says of each of N samples beside its controls."""
    forces_W = np.array([c.forces_W for c in commands]).reshape(*touches.active.shape, 4)
    wanted = np.einsum("tfij,tfi->tfj", touches.rotation_W, forces_W[..., :3])
    twist = np.where(touches.active, forces_W[..., 3], np.nan)
    return {
        "contact_force_reference": np.concatenate([wanted, twist[..., None]], axis=-1),
        "qp_status": np.array([c.qp is not None and not c.qp.is_solved for c in commands], dtype=np.int64),
        "qp_wrench_residual": _compute_residuals([c.qp for c in commands]),
        "tip_tracking_error": np.array([c.tip_error for c in commands], dtype=np.float64),
        "ik_at_limit": np.array([c.ik_at_limit for c in commands], dtype=bool),
    }


def _compute_residuals(answers: list[ForceSolution | None]) -> Array:
    """Return the largest entry of ``|G f - wrench|`` (T,) of each answer [N, N m]; 0 where nothing was asked."""
    out = np.zeros(len(answers))
    by_size: dict[int, list[int]] = {}
    for k, answer in enumerate(answers):
        if answer is not None:
            by_size.setdefault(answer.problem.G.shape[1], []).append(k)
    for rows in by_size.values():
        asked = [answer for k in rows if (answer := answers[k]) is not None]
        G = np.array([answer.problem.G for answer in asked])
        # Forces are padded to four components; of the first problem the others have the sizes.
        padded = [4 * i + k for i, model in enumerate(asked[0].models) for k in range(model.dimension)]
        f = np.array([answer.forces for answer in asked]).reshape(len(asked), -1)[:, padded]
        wrench = np.array([answer.problem.wrench for answer in asked])
        out[rows] = np.abs((G @ f[..., None])[..., 0] - wrench).max(axis=1)
    return out
