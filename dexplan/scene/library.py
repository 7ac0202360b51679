"""The built-in scenes by name."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from dexplan.errors import UnknownNameError
from dexplan.scene.description import SceneParameters
from dexplan.scene.finger_models import TRIFINGER_PRO
from dexplan.scene.scene import Scene, build_scene
from dexplan.scene.shape import Shape

SCENES = {
    "three_finger_sphere": SceneParameters(scene="three_finger_sphere"),
}
"""Default parameters of each built-in scene."""

TRIFINGER_BALL = SceneParameters(
    scene="trifinger_ball",
    object_shape=Shape.ball(0.0325),
    tip_radii=(0.010,) * 3,
    base_azimuths_deg=(90.0, -30.0, -150.0),
    torsional_friction=1.65e-3,
    finger=TRIFINGER_PRO,
)
"""TriFinger Pro around a ball of 65 mm and 60 g.  Torsional friction is the most that tips of 10 mm can have.  No scene of
problem files, whose tasks plan for fingers that keep their tips' poses on the object."""


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
