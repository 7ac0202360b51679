"""The built-in scenes by name."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from dexplan.errors import UnknownNameError
from dexplan.scene.description import SceneParameters
from dexplan.scene.scene import Scene, build_scene

SCENES = {
    "three_finger_sphere": SceneParameters(scene="three_finger_sphere"),
}
"""Default parameters of each built-in scene."""


def load_scene(name: str = "three_finger_sphere", **changes: object) -> Scene:
    """Return the built-in scene ``name``, its parameters replaced by ``changes`` (fields of SceneParameters).

    Raises UnknownNameError for a scene that is not built in.
    """
    if name not in SCENES:
        raise UnknownNameError("scene", name, SCENES)
    return load_scene_with(replace(SCENES[name], **changes))  # type: ignore[arg-type]


@lru_cache(maxsize=8)
def load_scene_with(parameters: SceneParameters) -> Scene:
    """Return the scene of ``parameters``, composed once per process."""
    return build_scene(parameters)
