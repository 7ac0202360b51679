"""What was measured at the contacts of a run: one row per contact and sample, and their sums per pair.

Signs and frames are those of :mod:`dexplan.testing.rows`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.spatial import Array, lock_arrays
from dexplan.testing.pairs import sum_pairs
from dexplan.testing.parties import Indices, Parties
from dexplan.testing.rows import ContactRows, PairRows

Flags = NDArray[np.bool_]


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

    ``time`` (T,) [s]; ``states`` (T, n) are MuJoCo's integration states, with the controls of the step that follows.
    ``newton_residual`` (T,) [N]: by how much the contact forces on the object miss the force its
    acceleration needs, NaN where the object is not free.  ``saturated`` (T, nu) actuators at the end of their force
    range, named by ``actuators``; ``drives`` (nu, P) says which of them move which party.  ``solver_iterations`` (T,).
    ``not_recorded`` are sentences about what the user changed unseen; ``warnings`` counts MuJoCo's own warnings by name.
    """

    parties: Parties
    physics: Physics
    time: Array
    states: Array
    contacts: ContactRows
    newton_residual: Array
    saturated: Flags
    actuators: tuple[str, ...]
    drives: Flags
    solver_iterations: Indices
    geom_names: tuple[str, ...]
    not_recorded: tuple[str, ...] = ()
    warnings: Mapping[str, int] = field(default_factory=dict)

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

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
        is_elliptic = self.physics.cone == "elliptic"
        return sum_pairs(self.contacts, len(self.parties.names), is_elliptic=is_elliptic)
