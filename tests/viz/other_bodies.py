"""Scenes around objects that are no balls, for pictures: the built-in scene's text with another geom, nothing simulated."""

from __future__ import annotations

import re

import numpy as np

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.edged import BoxBody, CylinderBody
from dexplan.contact.bodies.polyhedron import PolyhedronBody
from dexplan.contact.bodies.smooth import CapsuleBody, EllipsoidBody
from dexplan.sim.trace import Trace

_ROCK = np.random.default_rng(3).normal(size=(30, 3))
BODIES: dict[str, ConvexBody] = {
    "box": BoxBody(0.031, 0.026, 0.037),
    "cylinder": CylinderBody(0.028, 0.041),
    "capsule": CapsuleBody(0.019, 0.033),
    "ellipsoid": EllipsoidBody(0.031, 0.027, 0.039),
    "polyhedron": PolyhedronBody(0.034 * _ROCK / np.linalg.norm(_ROCK, axis=1)[:, None] + [0.0, 0.003, 0.0]),
}
_BALL = re.compile(r'(<geom name="object/surface"[^>]*?) type="sphere" size="0.035"')


def swap_body(xml: str, body: ConvexBody) -> str:
    """Return a scene's text with the ball replaced by ``body``."""
    match body:
        case BoxBody():
            geom = f'type="box" size="{body.a} {body.b} {body.c}"'
        case CylinderBody():
            geom = f'type="cylinder" size="{body.radius} {body.half_length}"'
        case CapsuleBody():
            geom = f'type="capsule" size="{body.radius} {body.half_length}"'
        case EllipsoidBody():
            geom = f'type="ellipsoid" size="{body.a} {body.b} {body.c}"'
        case PolyhedronBody():
            numbers = " ".join(f"{x:.9f}" for x in body.vertices.ravel())
            xml = xml.replace("<asset>", f'<asset><mesh name="object/hull" vertex="{numbers}"/>', 1)
            geom = 'type="mesh" mesh="object/hull"'
        case _:
            raise ValueError(f"{body}; a body that is no ball is accepted")
    changed, count = _BALL.subn(rf"\1 {geom}", xml)
    assert count == 1
    return changed


def swap_trace(trace: Trace, body: ConvexBody) -> Trace:
    """Return a run of the ball with ``body`` in its place; contacts stay where they are."""
    return Trace(swap_body(trace.model_xml, body), trace.columns, trace.meta)
