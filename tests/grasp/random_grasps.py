"""Grasps for the tests of statics: rings on a sphere, random ones on it and on no surface in particular."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dexplan.contact.friction import ContactModel, HardFinger, SoftFinger
from dexplan.grasp.grasp import Contact, Grasp, contact_on_sphere
from dexplan.spatial import build_frame, direction_from_angles

R = 0.03


def directions(azimuths: Sequence[float], elevation: float = 0.0) -> np.ndarray:
    return np.array([direction_from_angles(a, elevation) for a in azimuths])


def ring(azimuths: Sequence[float], model: ContactModel, elevation: float = 0.0, radius: float = R) -> Grasp:
    return on_sphere(directions(azimuths, elevation), model, radius)


def on_sphere(d: np.ndarray, model: ContactModel, radius: float = R) -> Grasp:
    return Grasp(tuple(contact_on_sphere(i, row, radius, model) for i, row in enumerate(d)))


def anywhere(points: np.ndarray, normals: np.ndarray, models: Sequence[ContactModel]) -> Grasp:
    """Contacts at points with **outward** normals, both in rows."""
    units = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    rows = zip(points, units, models, strict=True)
    return Grasp(tuple(Contact(i, p, build_frame(-n), model) for i, (p, n, model) in enumerate(rows)))


def random_grasp(seed: int, count: int, hard: bool | None = None) -> Grasp:
    """A random grasp on a lumpy object; ``hard`` None mixes hard and soft fingers."""
    rng = np.random.default_rng(seed)
    d = rng.normal(size=(count, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    points = R * d * rng.uniform(0.6, 1.4, size=(count, 1))
    models: list[ContactModel] = []
    for _ in range(count):
        mu, mu_t = rng.uniform(0.3, 1.0), rng.uniform(0.001, 0.004)
        is_hard = bool(rng.integers(2)) if hard is None else hard
        models.append(HardFinger(mu) if is_hard else SoftFinger(mu, mu_t))
    return anywhere(points, d + 0.3 * rng.normal(size=(count, 3)), models)


def turned(grasp: Grasp, rotation: np.ndarray) -> Grasp:
    """The whole grasp turned about the object's origin."""
    moved = (replace(c, p_OC=rotation @ c.p_OC, R_OC=rotation @ c.R_OC) for c in grasp.contacts)
    return Grasp(tuple(moved))


def spun(grasp: Grasp, angle: float) -> Grasp:
    """The same grasp with the tangents of every contact frame turned about its normal."""
    c, s = np.cos(angle), np.sin(angle)
    spin = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Grasp(tuple(replace(contact, R_OC=contact.R_OC @ spin) for contact in grasp.contacts))


def with_friction(grasp: Grasp, factor: float) -> Grasp:
    return Grasp(tuple(replace(c, model=c.model.scaled(factor)) for c in grasp.contacts))
