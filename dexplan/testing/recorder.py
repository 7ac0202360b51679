"""Record states in somebody else's stepping loop, cheaply; evaluate them when the run is over."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import mujoco
import numpy as np
from mujoco import mj_getState

from dexplan.spatial import Array
from dexplan.testing.measurement import Measurement, Physics
from dexplan.testing.parties import find_drives, find_parties, name_geom
from dexplan.testing.reading import INTEGRATION, read_states

FIRST_ROWS = 1024
"""States that the first buffer holds; it is doubled when it is full."""
LOOK_EVERY = 32
"""Records from one look at :data:`OFTEN_CHANGED` to the next: a look at each of them costs a microsecond."""
OFTEN_CHANGED = ("geom_friction", "geom_solref", "body_mass", "actuator_gainprm", "dof_damping")
"""Fields of a model that are changed in loops (randomisation) and looked at on the way; all are compared at the end."""


class ContactRecorder:
    """Records a run of any MuJoCo model for :meth:`measure`.

    ::

        recorder = ContactRecorder(model, data, tips=["left_finger", "right_finger"], object="cube")
        while data.time < 2.0:
            data.ctrl[:] = controller(data)
            recorder.record()            # after the controls are set, before the step
            mujoco.mj_step(model, data)
        measured = recorder.measure()

    ``tips`` and ``object`` are names of bodies or geoms (see ``find_parties``); without any of them all contacts are kept.
    What ``record`` copies is MuJoCo's whole integration state: positions, velocities, activations, controls, applied
    forces, mocap poses, switched equalities, warm start.  What stands in the *model* is taken as it is when the recorder is
    made; a change made later is noticed and named in ``Measurement.not_recorded``.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        *,
        tips: Sequence[str] | None = None,
        object: str | None = None,
    ) -> None:
        self.parties = find_parties(model, tips, object)
        self._model, self._data = model, data
        self._kept = copy.deepcopy(model)
        self._states = np.empty((FIRST_ROWS, mujoco.mj_stateSize(model, INTEGRATION)))
        self._rows = list(self._states)
        self._count = 0
        self._changed: dict[str, int] = {}

    def __len__(self) -> int:
        return self._count

    def record(self) -> None:
        """Keep the state as it is, with the controls of the step to come."""
        count = self._count
        if count == len(self._rows):
            self._states = np.concatenate([self._states, np.empty_like(self._states)])
            self._rows = list(self._states)
        mj_getState(self._model, self._data, self._rows[count], INTEGRATION)
        if count % LOOK_EVERY == 0:
            self._look(OFTEN_CHANGED)
        self._count = count + 1

    @property
    def states(self) -> Array:
        """The recorded states (T, n), a copy."""
        return self._states[: self._count].copy()

    def measure(self) -> Measurement:
        """Return what happened at the contacts of all recorded states; steps nothing and changes nothing."""
        model, parties = self._kept, self.parties
        self._look([name for name in dir(model) if not name.startswith("_")])
        count = self._find_end()
        readings = read_states(model, parties, self._states[:count])
        return Measurement(
            parties=parties,
            physics=_read_physics(model, parties.object_body),
            time=readings.time,
            states=self._states[:count],
            contacts=readings.contacts,
            newton_residual=readings.newton_residual,
            saturated=readings.saturated,
            actuators=tuple(model.actuator(a).name or f"actuator#{a}" for a in range(model.nu)),
            drives=find_drives(model, parties),
            solver_iterations=readings.solver_iterations,
            geom_names=tuple(name_geom(model, g) for g in range(model.ngeom)),
            not_recorded=tuple(self._describe_changes(count)),
            warnings=_read_warnings(self._data),
        )

    def _look(self, names: Sequence[str]) -> None:
        """Note which fields of the model are no longer what they were when recording began."""
        for name in names:
            if name in self._changed:
                continue
            was, now = getattr(self._kept, name), getattr(self._model, name)
            if name == "opt":
                for option in (o for o in dir(was) if not o.startswith("_")):
                    a, b = getattr(was, option), getattr(now, option)
                    if not callable(a) and not np.array_equal(a, b, equal_nan=True):
                        self._changed[f"opt.{option}"] = self._count
            elif isinstance(was, np.ndarray) and was.dtype.kind in "fiub" and was.tobytes() != now.tobytes():
                self._changed[name] = self._count

    def _find_end(self) -> int:
        """Return how many states belong to one run: time does not go back, and nothing is NaN."""
        states = self._states[: self._count]
        # Time is the first number of a state.
        is_on = np.append(True, np.diff(states[:, 0]) >= 0.0) if len(states) else np.zeros(0, dtype=bool)
        is_on &= np.isfinite(states).all(axis=1)
        return self._count if is_on.all() else int(np.argmin(is_on))

    def _describe_changes(self, count: int) -> list[str]:
        cut = [
            f"time went back, or something is NaN, at sample {count} (a reset, MuJoCo's own after it diverged?): what follows "
            "is left out"
        ]
        return (cut if count < self._count else []) + [
            f"model.{name} was changed after recording began (noticed at sample {count}): contacts are told as if it had not"
            for name, count in sorted(self._changed.items())
        ]


def _read_physics(model: mujoco.MjModel, body: int) -> Physics:
    weight = float(model.body_subtreemass[body] * np.linalg.norm(model.opt.gravity)) if body > 0 else np.nan
    return Physics(
        cone="elliptic" if model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC else "pyramidal",
        timestep=float(model.opt.timestep),
        impratio=float(model.opt.impratio),
        noslip_iterations=int(model.opt.noslip_iterations),
        iterations=int(model.opt.iterations),
        object_weight=weight if weight > 0.0 else np.nan,
        mujoco=mujoco.__version__,
    )


def _read_warnings(data: mujoco.MjData) -> dict[str, int]:
    counts = {
        mujoco.mjtWarning(i).name.removeprefix("mjWARN_").lower(): int(data.warning[i].number)
        for i in range(mujoco.mjtWarning.mjNWARNING.value)
    }
    return {name: count for name, count in counts.items() if count}
