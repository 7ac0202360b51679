"""Settings of MuJoCo that do not do what they seem to, told where they matter."""

from __future__ import annotations

import mujoco
import numpy as np

from dexplan.testing.measurement import Measurement
from dexplan.testing.parties import name_geom
from dexplan.testing.verdict import Judgement, Kind

OFTEN = 0.01
"""Share of samples from which on a solver that used all its iterations is told."""


def find_bites(model: mujoco.MjModel, measured: Measurement, judged: Judgement) -> list[str]:
    """Return one sentence per setting that bites in this run."""
    return [
        *_tell_friction(model, measured),
        *_tell_refsafe(model, measured),
        *_tell_impratio(model),
        *_tell_condim(judged),
        *_tell_noslip(measured, judged),
        *_tell_solver(model, measured),
    ]


def _tell_friction(model: mujoco.MjModel, measured: Measurement) -> list[str]:
    """Tell where one geom's friction is not the one that counts."""
    rows, out = measured.contacts, []
    for a, b in sorted(set(zip(rows.geom_by.tolist(), rows.geom_on.tolist(), strict=True))):
        own = model.geom_friction[a, 0], model.geom_friction[b, 0]
        is_pair = (rows.geom_by == a) & (rows.geom_on == b)
        used = float(rows.friction[is_pair][0, 0])
        # An explicit <pair> has a friction of its own, which is what it seems to be.
        if own[0] == own[1] or used not in own:
            continue
        wins, loses = (a, b) if own[0] == used else (b, a)
        by_priority = model.geom_priority[a] != model.geom_priority[b]
        rule = "has the higher priority" if by_priority else "is the larger of the two"
        out.append(
            f"friction: {name_geom(model, wins)} on {name_geom(model, loses)} has {used:g}, since that of "
            f"{name_geom(model, wins)} {rule}; the {model.geom_friction[loses, 0]:g} of {name_geom(model, loses)} does not count"
        )
    return out


def _tell_refsafe(model: mujoco.MjModel, measured: Measurement) -> list[str]:
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_REFSAFE):
        return []
    rows, least = measured.contacts, 2.0 * model.opt.timestep
    geoms = (
        np.unique(np.concatenate([rows.geom_by, rows.geom_on]))
        if len(rows.sample)
        else np.array([], dtype=int)
    )
    fast = [g for g in geoms if 0.0 < model.geom_solref[g, 0] < least]
    if not fast:
        return []
    names = ", ".join(name_geom(model, g) for g in fast)
    asked = min(float(model.geom_solref[g, 0]) for g in fast)
    return [
        f"refsafe: solref {asked:g} s of {names} counts as {least:g} s, twice the time step; a smaller time step makes contacts "
        "as firm as was asked for"
    ]


def _tell_impratio(model: mujoco.MjModel) -> list[str]:
    if model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC or model.opt.impratio <= 1.0:
        return []
    return [
        f'impratio: {model.opt.impratio:g} needs cone="elliptic"; with pyramids it makes normals soft or friction jumpy'
    ]


def _tell_condim(judged: Judgement) -> list[str]:
    out = []
    for verdict in judged.verdicts:
        finding = verdict.find(Kind.TORSIONAL_SLIP)
        if finding is not None and "condim 3" in finding.note:
            out.append(
                f"condim: {verdict.by} on {verdict.on} turns freely, for condim 3 has no torsional friction"
            )
    return list(dict.fromkeys(out))


def _tell_noslip(measured: Measurement, judged: Judgement) -> list[str]:
    if not measured.physics.noslip_iterations or not any(v.find(Kind.CREEPING) for v in judged.verdicts):
        return []
    return [
        "noslip: it is on, so the predicted creep is an upper bound; what is left comes from motion or too few iterations"
    ]


def _tell_solver(model: mujoco.MjModel, measured: Measurement) -> list[str]:
    full = measured.solver_iterations >= model.opt.iterations
    if full.mean() <= OFTEN:
        return []
    return [
        f"solver: it used all {model.opt.iterations} iterations in {100 * full.mean():.0f} % of the samples; raise iterations"
    ]
