"""A grasp as a value, and the two linear maps of its statics: grasp map and hand Jacobian."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dexplan.brief import brief_repr
from dexplan.contact.friction import ContactModel
from dexplan.spatial import Array, build_frame, hat, read_only, skew


@dataclass(frozen=True, eq=False)
class Contact:
    """One fingertip on the object.

    ``finger`` is its index in the hand, ``p_OC`` (3,) [m] the contact point and ``R_OC`` (3, 3) the contact
    frame in object axes, columns (t1, t2, n **into the object**); ``model`` says what it can transmit.
    """

    finger: int
    p_OC: Array
    R_OC: Array
    model: ContactModel

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        p, R = read_only(self.p_OC), read_only(self.R_OC)
        if p.shape != (3,) or R.shape != (3, 3):
            raise ValueError(f"contact has p_OC {p.shape}, R_OC {R.shape}; shapes (3,), (3, 3) are accepted")
        if not np.allclose(R.T @ R, np.eye(3), atol=1e-6) or np.linalg.det(R) < 0.0:
            raise ValueError(
                f"R_OC of finger {self.finger} is not a rotation; a right-handed frame is accepted"
            )
        object.__setattr__(self, "p_OC", p)
        object.__setattr__(self, "R_OC", R)

    @property
    def n_O(self) -> Array:
        """**Outward** unit normal (3,) of the object at the contact, in object axes."""
        return -self.R_OC[:, 2]


@dataclass(frozen=True)
class Grasp:
    """Contacts that hold one object together, in the order in which forces are stacked."""

    contacts: tuple[Contact, ...]

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        fingers = [contact.finger for contact in self.contacts]
        if not fingers or len(set(fingers)) != len(fingers):
            raise ValueError(
                f"grasp has contacts of fingers {fingers}; one contact each of some fingers is accepted"
            )

    @property
    def models(self) -> tuple[ContactModel, ...]:
        """Contact models in the order of the contacts."""
        return tuple(contact.model for contact in self.contacts)

    @property
    def slices(self) -> tuple[slice, ...]:
        """Where each contact's components stand in the stacked force vector."""
        ends = np.cumsum([model.dimension for model in self.models])
        return tuple(
            slice(int(e) - model.dimension, int(e)) for e, model in zip(ends, self.models, strict=True)
        )


def contact_on_sphere(finger: int, direction_O: ArrayLike, radius: float, model: ContactModel) -> Contact:
    """Return the contact on a sphere about the origin, in an **outward** direction; t2 is near object z.

    Raises ValueError for a zero direction.
    """
    direction = np.asarray(direction_O, dtype=np.float64)
    length = np.linalg.norm(direction)
    if length == 0.0:
        raise ValueError(f"direction of finger {finger} is zero; a vector that points somewhere is accepted")
    n_O = direction / length
    return Contact(finger, radius * n_O, build_frame(-n_O), model)


def compute_grasp_map(grasp: Grasp) -> Array:
    """Return G (6, sum m): the wrench on the object about its origin, in its axes, is ``G @ f_c``.

    Column block i is Ad^-T of the contact frame times its wrench basis [MLS 1994, eq. 5.6].
    """
    return np.concatenate([_map_contact(contact) for contact in grasp.contacts], axis=1)


def _map_contact(contact: Contact) -> Array:
    # f_O = R f_c and tau_O = R tau_c + p x R f_c
    R, basis = contact.R_OC, contact.model.wrench_basis()
    force = R @ basis[:3]
    return np.concatenate([force, R @ basis[3:] + hat(contact.p_OC) @ force])


def compute_hand_jacobian(
    grasp: Grasp, tip_jacobians: Sequence[ArrayLike], tip_points: Sequence[ArrayLike], X_WO: ArrayLike
) -> Array:
    """Return J_h (sum m, n) with ``J_h @ qdot == G.T @ V_WO_O`` while all contacts roll [MLS 1994, eq. 5.14].

    Both sides are the velocities, in the contact frames, that friction locks together; V_WO_O (6,) is the
    object's twist (v of its origin, w) in object axes.

    Args:
        grasp: the contacts.
        tip_jacobians: per contact (6, n), mapping the qdot of the **whole hand** to (v, w) of the fingertip
            in world axes, v that of the tip-fixed point named next.
        tip_points: per contact, the point (3,) [m] in world axes at which v is taken.
        X_WO: pose (4, 4) of the object.
    """
    X = np.asarray(X_WO, dtype=np.float64)
    rows = []
    for contact, tip_jacobian, tip_point in zip(grasp.contacts, tip_jacobians, tip_points, strict=True):
        jacobian = np.asarray(tip_jacobian, dtype=np.float64)
        R_WC = X[:3, :3] @ contact.R_OC
        p_WC = X[:3, :3] @ contact.p_OC + X[:3, 3]
        # v_C = v + w x (p_C - p_tip)
        at_contact = jacobian[:3] - hat(p_WC - np.asarray(tip_point, dtype=np.float64)) @ jacobian[3:]
        twist = np.concatenate([R_WC.T @ at_contact, R_WC.T @ jacobian[3:]])
        rows.append(contact.model.wrench_basis().T @ twist)
    return np.concatenate(rows)


def map_contact(J: Array, arm: Array, offset: Array, normal: Array | None = None) -> tuple[Array, Array]:
    """Return what a soft contact's forces do to the object and to the finger, all in one frame's axes.

    Args:
        J: Jacobian (6, J) of the tip's centre.
        arm: contact point from the object's origin (3,).
        offset: contact point from the tip's centre (3,).
        normal: **outward** unit normal (3,) of the object at the contact; None on a ball, where it is the arm's direction.

    Returns:
        The contact's columns of the grasp map (6, 4), and the joint torques (J, 4) that exert each force component.
    """
    R = build_frame(-(arm / np.sqrt(arm.dot(arm)) if normal is None else normal))
    columns, torques = np.zeros((6, 4)), np.zeros((J.shape[1], 4))
    columns[:3, :3] = R
    columns[3:, :3] = skew(arm) @ R
    columns[3:, 3] = R[:, 2]
    torques[:, :3] = (J[:3] - skew(offset) @ J[3:]).T @ R
    torques[:, 3] = J[3:].T @ R[:, 2]
    return columns, torques
