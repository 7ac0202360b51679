"""What is told of contacts: one row per contact and sample, and sums per pair of parties.

Signs and frames (``docs/contacts.md`` has the picture).  Each contact is told as what the party ``by`` does to the party
``on``: ``on`` is the object where it takes part, else the side that is no tip, else the geom that MuJoCo's normal points to.
The contact frame C has the columns t1, t2, n of ``rotation_W``, with **n into** ``on``; its origin is the contact point.

* ``force`` acts **on** ``on``, from ``by``; its normal component is positive: contacts push.
* ``slip`` is the velocity of ``by`` against ``on`` at the contact point, so friction on ``on`` points along it.
* ``spin`` is the turning of ``by`` against ``on`` about n, right-handed.

A row belongs to the state before the step that was taken from there, with the controls of that step; MuJoCo's own
``data.contact``, read after ``mj_step``, belongs to that same state and not to the one ``data.qpos`` then shows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dexplan.brief import brief_repr
from dexplan.spatial import Array, lock_arrays
from dexplan.testing.parties import Indices

AT_BORDER = 0.99
"""Utilisation from which a contact counts as at the border of its cone.  A sliding one is at 1 to the solver's tolerance;
one per cent keeps coarse solvers there, and is half of what verdicts may be wrong by."""


@dataclass(frozen=True, eq=False)
class ContactRows:
    """N contacts, in order of samples.

    ``sample``, ``on``, ``by`` (N,) are indices of samples and parties; ``geom_on``, ``geom_by`` (N,) those of the model's
    geoms.  ``dim`` (N,) is condim: 1, 3, 4 or 6.  ``point_W`` (N, 3) [m]; ``rotation_W`` (N, 3, 3).  In the contact frame
    (t1, t2, n): ``force`` (N, 3) [N] and ``moment`` (N, 3) [N m] about the contact point; ``slip`` (N, 3) [m/s], whose last
    component is the speed of approach; ``spin`` (N,) and ``roll`` (N, 2) [rad/s] about n and about t1, t2.  ``friction``
    (N, 5): sliding along t1, t2 [-], torsional [m], rolling about t1, t2 [m], as the contact has them.  ``utilisation``
    (N,): the share of the contact's own cone or pyramid that is used, 1 at its border, NaN where there is no normal force
    or no friction.  ``penetration`` (N,) [m].  ``creep`` (N, 3): the slip along t1, t2 [m/s] and the spin [rad/s] at
    which MuJoCo's softness lets a contact under this force drift that is inside its cone.  ``softness`` (N,) [m/s/N]: how fast
    its first constraint row gives way, R/B.
    """

    sample: Indices
    on: Indices
    by: Indices
    geom_on: Indices
    geom_by: Indices
    dim: Indices
    point_W: Array
    rotation_W: Array
    force: Array
    moment: Array
    slip: Array
    spin: Array
    roll: Array
    friction: Array
    utilisation: Array
    penetration: Array
    creep: Array
    softness: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    @property
    def force_W(self) -> Array:
        """The forces (N, 3) [N] on ``on``, in the world."""
        return np.einsum("nij,nj->ni", self.rotation_W, self.force)


@dataclass(frozen=True, eq=False)
class PairRows:
    """M sums over all contacts that two parties have with each other at one sample; only pairs that press are told.

    ``point_W`` (M, 3) is the centre of pressure and ``normal_W`` (M, 3) the mean normal, into ``on``; ``force_W`` (M, 3)
    [N] and ``moment_W`` (M, 3) [N m] about the centre of pressure act on ``on``.  ``slip_W`` (M, 3) [m/s] is along the
    contact, ``spin`` (M,), ``roll_W`` (M, 3) [rad/s].  These and ``utilisation`` are means weighted by normal force, so that
    ``utilisation`` is 1 only where every contact that carries is at its border.  ``creep_W`` (M, 3) and
    ``creep_spin`` (M,) are means over the contacts inside their cones, which decide the drift of the pair; zero where there
    are none.  ``held`` (M,) is the share of the normal force that these carry.  ``net_creep_W`` (M, 3) is the drift of
    pyramids which share the pair's force as they share its normal force, for a body that trembles on them; zero with
    elliptic cones.
    ``count`` (M,) contacts, of which ``dim`` (M,) is the largest condim; ``penetration`` (M,) [m] is the deepest;
    ``normal_force`` (M,) [N].
    """

    sample: Indices
    on: Indices
    by: Indices
    count: Indices
    dim: Indices
    point_W: Array
    normal_W: Array
    force_W: Array
    moment_W: Array
    normal_force: Array
    slip_W: Array
    spin: Array
    roll_W: Array
    utilisation: Array
    penetration: Array
    creep_W: Array
    creep_spin: Array
    held: Array
    net_creep_W: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)
