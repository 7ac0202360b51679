"""Which body a model's object is: read off its geoms, so that a trace can be drawn without its problem."""

from __future__ import annotations

import mujoco

from dexplan.contact.bodies.body import ConvexBody
from dexplan.errors import DexplanError
from dexplan.scene.object_parts import SURFACE, read_object

__all__ = ["SURFACE", "find_body", "read_body"]


def read_body(model: mujoco.MjModel) -> ConvexBody | None:
    """Return the object's body in the axes of its MuJoCo body; None for a model without one of ours."""
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, SURFACE) < 0:
        return None
    try:
        return read_object(model)[0]
    except DexplanError:
        return None


def find_body(xml: str) -> ConvexBody | None:
    """Return the object's body in the model of the text ``xml``; None for a shape that is not known here."""
    return read_body(mujoco.MjModel.from_xml_string(xml))
