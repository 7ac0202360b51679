"""From parameters to the one model text: the finger attached once per base, the object, the floor, the obstacles.

The text that comes out is the model: it is written to the run folder, and what is simulated is compiled from it.
"""

from __future__ import annotations

import math
import warnings
from importlib import resources
from pathlib import Path
from typing import Any

from dexplan.errors import UnknownNameError
from dexplan.scene.description import SceneParameters
from dexplan.scene.finger_models import FINGER_MODELS, SIX_HINGES
from dexplan.scene.object_parts import write_inertial, write_object

with warnings.catch_warnings():
    # dm_control looks for a window system on import and warns where there is none; nothing here needs one.
    warnings.simplefilter("ignore")
    from dm_control import mjcf

_USUAL = FINGER_MODELS[SIX_HINGES]
HOME_POSITION = (0.0, 0.0, _USUAL.object_height)
"""Centre of the object at home, in the world, among fingers of the usual kind [m]."""
BASE_DISTANCE, BASE_HEIGHT = _USUAL.base_distance, _USUAL.base_height

PROFILES = {
    # The most faithful contact MuJoCo offers for fingertips.  The last pass without the cone's softness is run to convergence:
    # stopped after a few sweeps it leaves the contact that was solved first creeping, ten times as fast as the others.  Tips on a
    # light ball are coupled through its small inertia and take hundreds of sweeps; on a ball of 60 g the tolerance ends it at 30.
    "firm": {"impratio": 100.0, "noslip_iterations": 300, "noslip_tolerance": 1e-10},
    # What engines without that pass can do: creep falls with impratio instead.
    "portable": {"impratio": 3000.0, "noslip_iterations": 0, "noslip_tolerance": 1e-6},
}


def build_model_xml(parameters: SceneParameters) -> str:
    """Return the MJCF text of the scene with ``parameters``; needs no other file.

    Raises UnknownNameError for an unknown physics profile or kind of finger.
    """
    if parameters.physics_profile not in PROFILES:
        raise UnknownNameError("physics profile", parameters.physics_profile, PROFILES)
    if parameters.finger not in FINGER_MODELS:
        raise UnknownNameError("finger", parameters.finger, FINGER_MODELS)
    kind = FINGER_MODELS[parameters.finger]
    root = _load("arena", parameters)
    root.model = parameters.scene
    ranges = {name: (lower, upper) for name, lower, upper in parameters.joint_ranges_deg}
    bases = zip(parameters.base_azimuths_deg, parameters.tip_radii, strict=True)
    for k, (azimuth, radius) in enumerate(bases, start=1):
        finger = _load(kind.part, parameters)
        finger.model = f"finger_{k}"
        finger.find("geom", "tip").size = [radius]
        if (seen := finger.find("mesh", "hemisphere")) is not None:
            seen.scale = [radius] * 3
        for joint in finger.find_all("joint"):
            if (key := f"finger_{k}.{joint.name}") in ranges:
                joint.range = [math.radians(limit) for limit in ranges.pop(key)]
        yaw, turn = math.radians(azimuth), math.radians(azimuth + kind.turn_deg)
        mount = root.worldbody.add(
            "site",
            name=f"mount_{k}",
            pos=[kind.base_distance * math.cos(yaw), kind.base_distance * math.sin(yaw), kind.base_height],
            quat=[math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2)],
            size=[0.002],
            group=4,
        )
        mount.attach(finger)
    if ranges:
        known = (
            f"finger_{k}.joint_{j}"
            for k in range(1, len(parameters.tip_radii) + 1)
            for j in range(1, kind.n_joints + 1)
        )
        raise UnknownNameError("joint", next(iter(ranges)), known)
    thing = _load("ball", parameters)
    write_object(thing, parameters)
    home = root.worldbody.add(
        "site", name="object_home", pos=[0.0, 0.0, kind.object_height], size=[0.002], group=4
    )
    frame = home.attach(thing)
    frame.add("freejoint", name="free")
    write_inertial(frame, parameters)
    # Last, because attaching a part brings its own options along.
    for option, value in PROFILES[parameters.physics_profile].items():
        setattr(root.option, option, value)
    for k, obstacle in enumerate(parameters.obstacles, start=1):
        root.worldbody.add(
            "geom",
            name=f"obstacle_{k}",
            type=obstacle.kind,
            pos=obstacle.position,
            size=obstacle.size,
            rgba=[0.55, 0.35, 0.35, 1.0],
        )
    return str(root.to_xml_string(precision=9))


def _load(name: str, parameters: SceneParameters) -> Any:
    """Return the named part with the friction of ``parameters``; every part carries the same contact defaults."""
    text = resources.files("dexplan.models").joinpath(f"{name}.xml").read_text(encoding="utf-8")
    part = mjcf.from_xml_string(text)
    part.default.geom.friction = [parameters.sliding_friction, parameters.torsional_friction, 1e-4]
    return part


def main() -> None:
    """Write the assembled text of the default scene beside its parts, where a test compares it with what is built."""
    parameters = SceneParameters()
    target = Path(str(resources.files("dexplan.models"))) / f"{parameters.scene}.xml"
    target.write_text(build_model_xml(parameters), encoding="utf-8")
    print(target)


if __name__ == "__main__":
    main()
