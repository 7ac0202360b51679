"""What was measured at the contacts of a run: one row per contact and sample, and their sums per pair.

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

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.spatial import Array
from dexplan.testing.parties import Indices, Parties

Flags = NDArray[np.bool_]


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
    which MuJoCo's softness lets a contact under this force drift that is inside its cone.
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

    __repr__ = brief_repr

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
    ``utilisation`` is 1 only where every contact that carries is at its border.  ``creep_W`` (M, 3) and ``creep_spin`` (M,) are
    means over the contacts inside their cones, which decide the drift of the pair; zero where there are none.
    ``count`` (M,) contacts; ``penetration`` (M,) [m] is the deepest; ``normal_force`` (M,) [N].
    """

    sample: Indices
    on: Indices
    by: Indices
    count: Indices
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

    __repr__ = brief_repr


@dataclass(frozen=True, eq=False)
class Physics:
    """The settings of a run that its contacts depend on: ``cone`` ("elliptic" or "pyramidal"), the time step [s] and
    MuJoCo's options of these names; ``object_weight`` [N], NaN without an object or where nothing pulls it.
    """

    cone: str
    timestep: float
    impratio: float
    noslip_iterations: int
    iterations: int
    object_weight: float
    mujoco: str


@dataclass(frozen=True, eq=False)
class Measurement:
    """A recorded run of T samples: who is there, the contacts, and what is needed to judge them.

    ``time`` (T,) [s].  ``newton_residual`` (T,) [N]: by how much the contact forces on the object miss the force its
    acceleration needs, NaN where the object is not free.  ``saturated`` (T, nu) actuators at the end of their force
    range, named by ``actuators``; ``solver_iterations`` (T,).  ``not_recorded`` are sentences about what the user
    changed unseen; ``warnings`` counts MuJoCo's own warnings by name.
    """

    parties: Parties
    physics: Physics
    time: Array
    contacts: ContactRows
    newton_residual: Array
    saturated: Flags
    actuators: tuple[str, ...]
    solver_iterations: Indices
    geom_names: tuple[str, ...]
    not_recorded: tuple[str, ...] = ()
    warnings: Mapping[str, int] = field(default_factory=dict)

    __repr__ = brief_repr

    def table(self) -> dict[str, NDArray]:
        """Return the contacts as named columns of equal length, ready for ``pandas.DataFrame`` or a CSV file."""
        rows, names = self.contacts, np.array([*self.parties.names, ""])
        geoms = np.array([*self.geom_names, ""])
        force_W = rows.force_W
        columns: dict[str, NDArray] = {
            "time_s": self.time[rows.sample],
            "on": names[rows.on],
            "by": names[rows.by],
            "geom_on": geoms[rows.geom_on],
            "geom_by": geoms[rows.geom_by],
            "condim": rows.dim,
            "force_t1_N": rows.force[:, 0],
            "force_t2_N": rows.force[:, 1],
            "force_n_N": rows.force[:, 2],
            "moment_n_Nm": rows.moment[:, 2],
            "slip_t1_m_s": rows.slip[:, 0],
            "slip_t2_m_s": rows.slip[:, 1],
            "spin_rad_s": rows.spin,
            "utilisation": rows.utilisation,
            "penetration_m": rows.penetration,
            "friction": rows.friction[:, 0],
        }
        for name, values in (
            ("point_W_m", rows.point_W),
            ("normal_W", rows.rotation_W[:, :, 2]),
            ("force_W_N", force_W),
        ):
            columns |= {f"{name}_{axis}": values[:, k] for k, axis in enumerate("xyz")}
        return columns

    def pairs(self) -> PairRows:
        """Return the contacts summed per sample and pair of parties."""
        from dexplan.testing.pairs import sum_pairs

        return sum_pairs(self.contacts, len(self.parties.names))
