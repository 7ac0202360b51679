"""Read a foreign scene, its controls and its state from files; whatever is wrong with them is one line."""

from __future__ import annotations

import xml.etree.ElementTree as ET
import zipfile
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from dexplan.brief import brief_repr
from dexplan.errors import SceneError
from dexplan.spatial import Array, lock_arrays

SCENE_ACCEPTED = "accepted: an MJCF file that this MuJoCo compiles, or an .mjb of it"
ASSET_TAGS = {
    "mesh": "meshdir",
    "hfield": "meshdir",
    "skin": "meshdir",
    "flexcomp": "meshdir",
    "texture": "texturedir",
}
"""Which of the compiler's folders a file is looked for in; others (include, model) stand beside the scene."""


@dataclass(frozen=True, eq=False)
class Drive:
    """How a scene is driven: ``ctrl`` (T, nu), the ``initial_state`` or the name of a keyframe, steps of MuJoCo per row."""

    ctrl: Array
    initial_state: Array | str | None
    steps_per_sample: int

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def load_model(path: Path) -> mujoco.MjModel:
    """Compile the scene at ``path``; SceneError where it, an include or an asset is missing, outside its folder, or wrong."""
    if not path.is_file():
        fact = "is a folder" if path.is_dir() else "no such file"
        raise SceneError(str(path), fact, SCENE_ACCEPTED)
    try:
        if path.suffix == ".mjb":
            model = mujoco.MjModel.from_binary_path(str(path))
        else:
            _check_files(path, path.parent.resolve())
            model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, mujoco.FatalError) as error:
        raise SceneError(str(path), f"MuJoCo cannot compile it ({error})", SCENE_ACCEPTED) from error
    _check_numbers(path, model)
    return model


def _check_numbers(path: Path, model: mujoco.MjModel) -> None:
    """Raise SceneError where a model that compiled has a number that cannot be simulated."""
    if not model.opt.timestep > 0.0:
        fact = f"its timestep is {model.opt.timestep:g}"
        raise SceneError(str(path), fact, "accepted: seconds above 0")
    values = {
        f"option {name}": getattr(model.opt, name) for name in ("gravity", "wind", "impratio", "tolerance")
    }
    for name in dir(model):
        # What belongs to the user may be anything.
        if name.startswith(("_", "user")) or name.endswith("_user"):
            continue
        value = getattr(model, name)
        if isinstance(value, np.ndarray) and value.dtype.kind == "f":
            values[name] = value
    for name, value in values.items():
        if np.isnan(value).any():
            raise SceneError(str(path), f"{name} has a NaN", "accepted: numbers")


def _check_files(path: Path, home: Path, seen: frozenset[Path] = frozenset()) -> None:
    """Raise SceneError for files that a scene names and that are missing or outside of ``home``, its own folder."""
    try:
        root = ET.parse(path).getroot()
    except (ET.ParseError, OSError, ValueError) as error:
        raise SceneError(str(path), f"is no XML ({error})", SCENE_ACCEPTED) from error
    folders = dict.fromkeys(("meshdir", "texturedir"), home)
    for compiler in root.iter("compiler"):
        for key in folders:
            folders[key] = home / compiler.get(key, compiler.get("assetdir", ""))
    for element in root.iter():
        # A cube's texture has a file for each of its faces.
        for name in (value for key, value in element.attrib.items() if key.startswith("file")):
            folder = folders.get(ASSET_TAGS.get(element.tag, ""), home)
            if not (folder / name).resolve().is_relative_to(home):
                fact = f"the {element.tag} {name!r} is outside its folder"
                raise SceneError(str(path), fact, "accepted: files in the scene's own folder")
            # A missing asset is MuJoCo's to tell: it knows more ways to look for one.
            if element.tag == "include":
                if not (folder / name).is_file():
                    fact = f"the include {name!r} is missing"
                    raise SceneError(str(path), fact, "accepted: files that are there")
                if folder / name not in seen:
                    _check_files(folder / name, home, seen | {folder / name})


def load_drive(model: mujoco.MjModel, path: Path | None, key: str | None, seconds: float) -> Drive:
    """Return how to drive ``model``: by a file of controls, else by a keyframe's, else by its first ones, held.

    An .npz has ``ctrl`` (T, nu) and may have ``initial_state`` and ``steps_per_sample`` (``physics_steps_per_sample`` of our
    traces counts as well); an .npy is ``ctrl`` alone.  ``key``, a keyframe, decides the state where it is given.
    """
    if path is None:
        steps = max(1, round(seconds / model.opt.timestep))
        ctrl = np.zeros(model.nu)
        if key is not None:
            index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, key)
            ctrl = model.key_ctrl[index] if index >= 0 else ctrl
        return Drive(np.tile(ctrl, (steps, 1)), key, 1)
    accepted = "accepted: an .npz with ctrl (T, nu), or an .npy of it"
    try:
        content = np.load(path, allow_pickle=False)
        if isinstance(content, np.ndarray):
            columns = {"ctrl": content}
        else:
            with content:
                columns = {name: content[name] for name in content.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        fact = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise SceneError(str(path), f"cannot be read ({fact})", accepted) from error
    if "ctrl" not in columns:
        raise SceneError(str(path), f"has no ctrl, but {', '.join(columns) or 'nothing'}", accepted)
    steps_name = "steps_per_sample" if "steps_per_sample" in columns else "physics_steps_per_sample"
    state = key if key is not None else columns.get("initial_state")
    try:
        steps = columns.get(steps_name, np.array(1)).item()
        if steps != int(steps):
            raise ValueError(steps)
    except (TypeError, ValueError, OverflowError) as error:
        raise SceneError(str(path), f"{steps_name} is no count", "accepted: one whole number") from error
    return Drive(columns["ctrl"], state, int(steps))


def find_object(model: mujoco.MjModel) -> str | None:
    """Return the name of the only free body that nothing else moves, which is the object where none was named; else None."""
    free = [
        int(model.jnt_bodyid[j])
        for j in range(model.njnt)
        if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_FREE)
    ]
    bare = [body for body in free if model.body_subtreemass[body] == model.body_mass[body]]
    return (str(model.body(bare[0]).name) or None) if len(bare) == 1 else None
