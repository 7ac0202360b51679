"""Which setting may cure a verdict, and whether it does: by trying it."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from dexplan.testing.measurement import Measurement
from dexplan.testing.parties import name_geom
from dexplan.testing.verdict import GRAVITY_OF_KINDS, Judgement, Kind, Verdict, judge_contacts

IMPRATIO = 100.0
"""Stiffness of friction against that of normals: creep is linear in its inverse, and 100 is where dexplan's profiles begin."""
NOSLIP = 50
FIRM = 0.004
"""Time constant of a firm contact [s], the one measured in most of our scenes."""


CREPT_MM = 0.1
"""Creep beyond which a slip that follows is creep's doing: the contact was no longer where it had been put."""


@dataclass(frozen=True)
class Cure:
    """A change of a setting: as it stands in MJCF, why it should help, and what it does to a compiled model."""

    text: str
    why: str
    apply: Callable[[mujoco.MjModel], None]


@dataclass(frozen=True)
class Trial:
    """What became of a verdict under a cure: the kinds and amounts before and after; ``after`` None: the pair never met."""

    cure: Cure
    before: Verdict
    after: Verdict | None

    @property
    def is_cured(self) -> bool:
        """Whether the pair now holds: it sticks, or it does what is less grave than it was and no loss."""
        if self.after is None:
            return False
        if self.after.kind == Kind.STUCK:
            return True
        was, now = (GRAVITY_OF_KINDS.index(v.kind) for v in (self.before, self.after))
        return now < min(was, GRAVITY_OF_KINDS.index(Kind.BOUNCING))

    def __str__(self) -> str:
        word = "cures" if self.is_cured else "does not cure"
        now = "no touch" if self.after is None else _tell(self.after)
        return f"{word}: {self.cure.text}: {_tell(self.before)} -> {now}"


def _tell(verdict: Verdict) -> str:
    finding = verdict.find(verdict.kind)
    return str(verdict.kind) if finding is None else f"{verdict.kind} ({finding.amount:.3g} {finding.unit})"


def propose_cures(model: mujoco.MjModel, measured: Measurement, verdict: Verdict) -> list[Cure]:
    """Return settings that may cure ``verdict``, most likely first; nothing for a contact that holds."""
    causes = {finding.kind for finding in verdict.findings}
    has_slipped = bool(causes & {Kind.COULOMB_SLIP, Kind.TORSIONAL_SLIP})
    out: list[Cure] = []
    if verdict.kind in {Kind.STUCK, Kind.ROLLING}:
        causes &= {Kind.PENETRATING}
    if Kind.OVERLOADED in causes:
        out += _strengthen(model, measured, verdict)
    if _is_creep_the_cause(verdict):
        out += _stiffen_friction(model)
    if Kind.TORSIONAL_SLIP in causes:
        out += _resist_turning(model, measured, verdict)
    if Kind.COULOMB_SLIP in causes:
        out += _raise_friction(model, measured, verdict)
    if Kind.BOUNCING in causes and not has_slipped:
        out += _soften(model, measured, verdict)
    if Kind.LOST in causes:
        out += _stiffen_friction(model)
    if Kind.PENETRATING in causes:
        out += _firm_up(model, measured, verdict)
    return list({cure.text: cure for cure in out}.values())


def _is_creep_the_cause(verdict: Verdict) -> bool:
    """Return whether the contact crept, and had crept further than slip is allowed when it began to slip, if it did."""
    creep = verdict.find(Kind.CREEPING)
    if creep is None:
        return False
    slips = [f for f in map(verdict.find, (Kind.COULOMB_SLIP, Kind.TORSIONAL_SLIP)) if f is not None]
    before = min((slip.start_s for slip in slips), default=math.inf) - creep.start_s
    return before == math.inf or (creep.unit == "um/s" and 1e-3 * creep.amount * before > CREPT_MM)


def try_cures(
    model: mujoco.MjModel,
    judged: Judgement,
    measured: Measurement,
    run: Callable[[mujoco.MjModel], Measurement],
) -> Iterator[Trial]:
    """Yield, for every pair that does not hold, a trial of each proposed cure until one cures; ``run`` measures a model."""
    worst: dict[tuple[str, str], Verdict] = {}
    for verdict in judged.verdicts:
        pair = verdict.by, verdict.on
        if pair not in worst or _weigh(verdict) > _weigh(worst[pair]):
            worst[pair] = verdict
    seen: dict[str, Judgement] = {}
    for (by, on), before in worst.items():
        if before.kind in {Kind.STUCK, Kind.ROLLING}:
            continue
        for cure in propose_cures(model, measured, before):
            if cure.text not in seen:
                changed = copy.deepcopy(model)
                cure.apply(changed)
                seen[cure.text] = judge_contacts(run(changed))
            after = max(seen[cure.text].of(by, on), key=_weigh, default=None)
            trial = Trial(cure, before, after)
            yield trial
            if trial.is_cured:
                break


def _weigh(verdict: Verdict) -> int:
    return GRAVITY_OF_KINDS.index(verdict.kind)


def _list_condims(measured: Measurement, verdict: Verdict) -> np.ndarray:
    """Return the condims of the contacts that the pair had."""
    rows, names = measured.contacts, measured.parties.names
    return rows.dim[(rows.by == names.index(verdict.by)) & (rows.on == names.index(verdict.on))]


def _list_geoms(measured: Measurement, verdict: Verdict) -> list[tuple[int, int]]:
    """Return the pairs (geom of ``by``, geom of ``on``) that touched."""
    rows, names = measured.contacts, measured.parties.names
    is_pair = (rows.by == names.index(verdict.by)) & (rows.on == names.index(verdict.on))
    return sorted(
        {(int(a), int(b)) for a, b in zip(rows.geom_by[is_pair], rows.geom_on[is_pair], strict=True)}
    )


def _pick_geoms(model: mujoco.MjModel, measured: Measurement, verdict: Verdict) -> list[int]:
    """Return the geoms whose settings are to change: those of higher priority, else those of ``on``, which all tips share."""
    return sorted(
        {
            a if model.geom_priority[a] > model.geom_priority[b] else b
            for a, b in _list_geoms(measured, verdict)
        }
    )


def _read_friction(measured: Measurement, verdict: Verdict) -> np.ndarray:
    """Return the largest friction (sliding, torsional, rolling) that a contact of the pair had."""
    rows, names = measured.contacts, measured.parties.names
    is_pair = (rows.by == names.index(verdict.by)) & (rows.on == names.index(verdict.on))
    return rows.friction[is_pair].max(axis=0)[[0, 2, 3]]


def _set_geoms(
    model: mujoco.MjModel, geoms: list[int], field: str, value: np.ndarray | float, why: str
) -> Cure:
    """Return the cure that gives a field of geoms a value."""
    attribute = field.removeprefix("geom_")
    shown = " ".join(f"{x:g}" for x in np.atleast_1d(value))
    names = ", ".join(name_geom(model, g) for g in geoms)

    def apply(changed: mujoco.MjModel) -> None:
        getattr(changed, field)[geoms] = value

    return Cure(f'{attribute}="{shown}" for the geoms {names}', why, apply)


def _raise_friction(model: mujoco.MjModel, measured: Measurement, verdict: Verdict) -> list[Cure]:
    geoms = _pick_geoms(model, measured, verdict)
    if _list_condims(measured, verdict).max() == 1:
        return [_set_geoms(model, geoms, "geom_condim", 3, "this contact has no friction")]
    mu = _read_friction(measured, verdict)
    why = "the contact is at the border of its cone: it lacks friction, or normal force"
    return [
        _set_geoms(model, geoms, "geom_friction", np.array([factor * mu[0], mu[1], mu[2]]), why)
        for factor in (1.5, 3.0)
    ]


def _resist_turning(model: mujoco.MjModel, measured: Measurement, verdict: Verdict) -> list[Cure]:
    geoms = _pick_geoms(model, measured, verdict)
    mu = _read_friction(measured, verdict)
    if _list_condims(measured, verdict).max() < 4:
        return [
            _set_geoms(model, geoms, "geom_condim", 4, "condim 3 does not resist turning about the normal")
        ]
    why = "the contact is at its torsional border"
    return [
        _set_geoms(model, geoms, "geom_friction", np.array([mu[0], factor * mu[1], mu[2]]), why)
        for factor in (1.5, 4.0)
    ]


def _stiffen_friction(model: mujoco.MjModel) -> list[Cure]:
    out = []
    option = f'cone="elliptic" impratio="{IMPRATIO:g}"'
    if model.opt.cone != mujoco.mjtCone.mjCONE_ELLIPTIC or model.opt.impratio < IMPRATIO:
        why = "creep is linear in 1/impratio, which needs elliptic cones"
        out.append(Cure(f"<option {option}/>", why, _make_stiff))
    if model.opt.noslip_iterations < NOSLIP:
        text = f'<option {option} noslip_iterations="{NOSLIP}"/>'
        out.append(Cure(text, "noslip takes friction's softness away (not on a GPU)", _make_noslip))
    return out


def _make_stiff(model: mujoco.MjModel) -> None:
    model.opt.cone = int(mujoco.mjtCone.mjCONE_ELLIPTIC)
    model.opt.impratio = max(IMPRATIO, float(model.opt.impratio))


def _make_noslip(model: mujoco.MjModel) -> None:
    _make_stiff(model)
    model.opt.noslip_iterations = NOSLIP


def _soften(model: mujoco.MjModel, measured: Measurement, verdict: Verdict) -> list[Cure]:
    geoms = sorted({g for pair in _list_geoms(measured, verdict) for g in pair})
    value = np.array([max(0.02, 2.0 * model.opt.timestep), 1.0])
    return [_set_geoms(model, geoms, "geom_solref", value, "a contact damped critically does not bounce")]


def _firm_up(model: mujoco.MjModel, measured: Measurement, verdict: Verdict) -> list[Cure]:
    geoms = sorted({g for pair in _list_geoms(measured, verdict) for g in pair})
    value = np.array([max(FIRM, 2.0 * model.opt.timestep), 1.0])
    return [
        _set_geoms(model, geoms, "geom_solref", value, "depth grows with the square of the time constant")
    ]


def _strengthen(model: mujoco.MjModel, measured: Measurement, verdict: Verdict) -> list[Cure]:
    finding = verdict.find(Kind.OVERLOADED)
    assert finding is not None
    a = measured.actuators.index(finding.note)
    if not model.actuator_forcelimited[a]:
        return []
    value = 2.0 * model.actuator_forcerange[a]

    def apply(changed: mujoco.MjModel) -> None:
        changed.actuator_forcerange[a] = value

    text = f'forcerange="{value[0]:g} {value[1]:g}" for the actuator {finding.note}'
    return [Cure(text, "it gives all it can", apply)]
