"""Run a foreign scene under given controls and measure its contacts: the only file here that steps MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from dexplan.errors import SceneError, UnknownNameError
from dexplan.spatial import Array
from dexplan.testing.measurement import Measurement
from dexplan.testing.reading import INTEGRATION
from dexplan.testing.recorder import ContactRecorder


def measure_contacts(
    model: mujoco.MjModel,
    initial_state: ArrayLike | str | None,
    ctrl: ArrayLike,
    *,
    tips: Sequence[str] | None = None,
    object: str | None = None,
    steps_per_sample: int = 1,
) -> Measurement:
    """Simulate ``model`` and return what happened at its contacts.

    Args:
      model: any MuJoCo model; it is not changed.
      initial_state: a ``mjSTATE_INTEGRATION`` vector, the name of a keyframe, or None for the model's own start.
      ctrl: (T, nu), row t held over the ``steps_per_sample`` steps that follow sample t.  A model without actuators takes
        an array of shape (T, 0).
      tips: names of bodies or geoms; None: nobody is a tip.
      object: name of a body or geom; None: nothing is the object.
      steps_per_sample: steps of MuJoCo per row of ``ctrl``.

    Returns: T samples, the state before each row's steps.
    Raises: SceneError, UnknownNameError: what does not fit the model, in one line.
    """
    rows = _check_ctrl(model, ctrl)
    if (
        isinstance(steps_per_sample, bool)
        or not isinstance(steps_per_sample, int | np.integer)
        or steps_per_sample < 1
    ):
        raise SceneError(
            "steps_per_sample", f"{steps_per_sample!r} is no count", "accepted: a whole number, 1 or more"
        )
    data = build_data(model, initial_state)
    recorder = ContactRecorder(model, data, tips=tips, object=object)
    for row in rows:
        data.ctrl[:] = row
        recorder.record()
        mujoco.mj_step(model, data, nstep=int(steps_per_sample))
    return recorder.measure()


def build_data(model: mujoco.MjModel, initial_state: ArrayLike | str | None) -> mujoco.MjData:
    """Return data of ``model`` in a state given as a vector, by the name of a keyframe, or not at all."""
    data = mujoco.MjData(model)
    if initial_state is None:
        mujoco.mj_resetData(model, data)
        return data
    if isinstance(initial_state, str):
        key = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, initial_state)
        if key < 0:
            names = [model.key(k).name for k in range(model.nkey)]
            if not any(names):
                raise SceneError(
                    "state",
                    f"there is no keyframe {initial_state!r}",
                    "the scene has no named keyframe at all",
                )
            raise UnknownNameError("keyframe", initial_state, [n for n in names if n])
        mujoco.mj_resetDataKeyframe(model, data, key)
        return data
    size = mujoco.mj_stateSize(model, INTEGRATION)
    state = _as_numbers("initial_state", initial_state)
    if state.shape != (size,):
        raise SceneError(
            "initial_state",
            f"has shape {state.shape}",
            f"accepted: ({size},), a mjSTATE_INTEGRATION of this model",
        )
    mujoco.mj_setState(model, data, state, INTEGRATION)
    return data


def _check_ctrl(model: mujoco.MjModel, ctrl: ArrayLike) -> Array:
    rows = _as_numbers("ctrl", ctrl)
    if rows.ndim != 2 or rows.shape[1] != model.nu or not len(rows):
        raise SceneError(
            "ctrl", f"has shape {rows.shape}", f"accepted: (T, {model.nu}), one column per actuator"
        )
    return rows


def _as_numbers(name: str, values: ArrayLike) -> Array:
    try:
        if np.iscomplexobj(values):
            raise TypeError("complex")
        numbers = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise SceneError(name, f"is no array of numbers ({error})", "accepted: finite numbers") from error
    if not np.isfinite(numbers).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(numbers))[0])
        raise SceneError(name, f"{float(numbers[where])} at {where}", "accepted: finite numbers")
    return numbers
