"""Why are there no contact forces?  What would have to give way, by how much, and at which contacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from dexplan.brief import brief_repr
from dexplan.grasp.force.program import INFINITY, ForceRows, Program
from dexplan.spatial import Array

_NOTHING = 1e-6
"""Loosening [N] that is none."""
_SECOND = 1e-4
"""Weight of the second aim beside the first: small enough to yield, large enough for the LP to see."""


@dataclass(frozen=True)
class Loosening:
    """Limits of one ``group`` widened by ``amount`` (``unit`` N or N m), the least that will do.

    "friction": as if a contact pressed by that much more, for friction only; "normal force": floors lower and ceilings
    higher; "wrench": force components off by no more than that, torque components by no more than that times the object's
    length.  ``contacts`` (in the order of the columns of G): to widen the limits of these is enough; ``bound``: "upper",
    "lower" or "both" of them.  Both are empty for the wrench.
    """

    group: str
    amount: float
    unit: str
    contacts: tuple[int, ...] = ()
    bound: str = ""

    __repr__ = brief_repr


class Diagnosis(NamedTuple):
    """``cures``, each enough by itself (none for a feasible program); x (n,) ``nearest`` to the wrench that keeps every other
    limit, or None.
    """

    cures: tuple[tuple[Loosening, ...], ...]
    nearest: Array | None


class Relaxed(NamedTuple):
    """Per group the largest widening, of each row (k,) what its contact was granted, and x (n,) that keeps within it."""

    amounts: dict[str, float]
    widened: Array
    x: Array


def relax(program: Program, rows: ForceRows, names: Sequence[str]) -> Relaxed | None:
    """Widen the limits of the groups ``names`` until the program is feasible; None if that is never.

    The largest widening of each group is made as small as can be (their sum, for several groups), and then the
    sum over the contacts of what each has to give.
    """
    _, _, A, lower, upper = program
    above, below = np.flatnonzero(upper < INFINITY), np.flatnonzero(lower > -INFINITY)
    size, count = A.shape[1], len(names)
    # One widening per group and contact, none larger than that of the group.
    owners = [(j, c) for j, name in enumerate(names) for c in np.unique(rows.contact[rows.groups[name]])]
    loose, ceiling = np.zeros((len(A), len(owners))), np.zeros((len(owners), count + len(owners)))
    for column, (j, contact) in enumerate(owners):
        part = rows.groups[names[j]]
        loose[part, column] = rows.room[part] * (rows.contact[part] == contact)
        ceiling[column, j], ceiling[column, count + column] = -1.0, 1.0
    bounds = np.column_stack(
        [
            np.concatenate([A[above], -A[below]]),
            np.zeros((len(above) + len(below), count)),
            -np.concatenate([loose[above], loose[below]]),
        ]
    )
    # Nothing makes a contact pull, whatever limits give way.
    free: list[tuple[float | None, None]] = [(None, None)] * size
    for index in rows.normal:
        free[index] = (0.0, None)
    answer = linprog(
        np.concatenate([np.zeros(size), np.ones(count), np.full(len(owners), _SECOND)]),
        A_ub=np.vstack([bounds, np.column_stack([np.zeros((len(owners), size)), ceiling])]),
        b_ub=np.concatenate([upper[above], -lower[below], np.zeros(len(owners))]),
        bounds=free + [(0.0, None)] * (count + len(owners)),
        options={"presolve": False},  # takes longer than it saves on programs this small
    )
    if answer.status != 0:
        return None
    amounts = dict(zip(names, answer.x[size : size + count].tolist(), strict=True))
    widened = (loose > 0.0) @ answer.x[size + count :]
    return Relaxed(amounts, widened, answer.x[:size])


def diagnose(rows: ForceRows) -> Diagnosis:
    """Return what would make an infeasible program feasible.

    First every group alone; then those that are not the wrench together, as any problem yields if the object need not be
    held; then the wrench alone; at last everything together.
    """
    program, groups = rows.as_program(), rows.groups
    limits = tuple(name for name in groups if name != "wrench")
    free = relax(program, rows, ["wrench"])
    nearest = None if free is None else free.x
    if free is not None and free.amounts["wrench"] < _NOTHING:
        return Diagnosis((), nearest)
    single = [relax(program, rows, [name]) for name in limits]
    found = [answer for answer in single if answer is not None]
    if not found:
        for names in (limits, ("wrench",), tuple(groups)):
            answer = free if names == ("wrench",) else relax(program, rows, names)
            if answer is not None:
                found = [answer]
                break
    cures = tuple(tuple(_describe(rows, program, answer)) for answer in found)
    return Diagnosis(tuple(cure for cure in cures if cure), nearest)


def _describe(rows: ForceRows, program: Program, answer: Relaxed) -> list[Loosening]:
    needed = []
    for name, amount in answer.amounts.items():
        if amount < _NOTHING:
            continue
        if name == "wrench":
            needed.append(Loosening(name, amount, "N"))
            continue
        part = rows.groups[name]
        # The x found is the witness that widening just these is enough.
        value, must = program.A[part] @ answer.x, answer.widened[part] > _NOTHING
        contacts = tuple(int(i) for i in np.unique(rows.contact[part][must]))
        sides = {"upper"} if (value - program.upper[part] > _NOTHING).any() else set()
        sides |= {"lower"} if (program.lower[part] - value > _NOTHING).any() else set()
        bound = "both" if len(sides) == 2 else "".join(sides)
        unit, scale = ("N m", rows.settings.reach) if name == "joint torque" else ("N", 1.0)
        needed.append(Loosening(name, amount * scale, unit, contacts, bound))
    return needed


def explain(cures: Sequence[Sequence[Loosening]], length: float) -> str:
    """Return the cures as a sentence that says what would do."""
    if not cures:
        return "no limit can be named"
    if [loosening.group for cure in cures for loosening in cure] == ["wrench"]:
        amount = cures[0][0].amount
        return (
            "only another wrench would do: the contacts come no closer to this one than "
            f"{amount:.3g} N and {amount * length:.3g} N m"
        )
    return " or ".join(
        " together with ".join(_phrase(item, length) for item in cure) + " would do" for cure in cures
    )


def _phrase(item: Loosening, length: float) -> str:
    if item.group == "wrench":
        return f"another wrench, by {item.amount:.3g} N and {item.amount * length:.3g} N m,"
    noun = "contacts" if len(item.contacts) > 1 else "contact"
    where = f"{_BOUNDS[item.group, item.bound]}{noun} {', '.join(map(str, item.contacts))}"
    return f"{_PHRASES[item.group].format(item.amount)} ({where})"


_PHRASES = {
    "friction": "friction worth {:.3g} N more normal force per contact",
    "normal force": "normal-force limits wider by {:.3g} N",
    "joint torque": "{:.3g} N m more joint torque",
}
_BOUNDS = {
    ("friction", "upper"): "",
    ("normal force", "upper"): "ceiling of ",
    ("normal force", "lower"): "floor of ",
    ("normal force", "both"): "floor and ceiling of ",
    ("joint torque", "upper"): "upper limit of ",
    ("joint torque", "lower"): "lower limit of ",
    ("joint torque", "both"): "both limits of ",
}
