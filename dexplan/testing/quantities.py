"""What a baseline keeps of a measured run: a few numbers per pair of parties, and the verdicts."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dexplan.errors import SceneError
from dexplan.testing.baseline import Baseline, Quantity, make_baseline
from dexplan.testing.measurement import Measurement
from dexplan.testing.verdict import Judgement, Kind, Verdict, VerdictOptions, judge_contacts

FLOORS: Mapping[str, tuple[str, float]] = {
    "utilisation_max": ("-", 0.01),
    "coulomb_slip_mm": ("mm", 0.05),
    "torsional_slip_deg": ("deg", 0.5),
    "creep_um_s": ("um/s", 1.0),
    "penetration_max_um": ("um", 2.0),
    "normal_force_mean_N": ("N", 0.05),
    "touch_s": ("s", 0.02),
}
"""Per quantity of a pair its unit and by how much it may move however small it is: what one would not notice."""

Measured = Measurement | Baseline | Mapping[str, float | Quantity]


@dataclass(frozen=True)
class _Pair:
    by: str
    on: str
    verdicts: tuple[Verdict, ...]


def describe_run(name: str, measured: Measured, options: VerdictOptions | None = None) -> Baseline:
    """Return what a baseline keeps of ``measured``: a measurement of contacts, or the caller's own named numbers."""
    if isinstance(measured, Baseline):
        return measured
    if isinstance(measured, Measurement):
        judged = judge_contacts(measured, options)
        return make_baseline(name, _collect(measured, judged), _collect_words(judged))
    if not isinstance(measured, Mapping):
        kinds = "a Measurement of measure_contacts or ContactRecorder, or a mapping of names to numbers"
        raise SceneError(
            f"baseline {name}", f"{type(measured).__name__} cannot be kept", f"accepted: {kinds}"
        )
    quantities = {}
    for key, value in measured.items():
        try:
            quantities[str(key)] = (
                value if isinstance(value, Quantity) else Quantity(float(value), _find_unit(key))
            )
        except (TypeError, ValueError) as error:
            raise SceneError(
                f"baseline {name}", f"{key!r} is no number: {value!r}", "accepted: numbers"
            ) from error
    return make_baseline(name, quantities)


def _find_unit(name: str) -> str:
    """Return the unit at the end of a name such as ``depth_mm``."""
    found = re.search(r"_(mm|um|m|deg|rad|N|Nm|s|um_s|m_s|deg_s)$", str(name))
    return found[1].replace("_", "/") if found else "-"


def _list_pairs(judged: Judgement) -> list[_Pair]:
    names = dict.fromkeys((v.by, v.on) for v in judged.verdicts)
    return [_Pair(by, on, tuple(v for v in judged.verdicts if (v.by, v.on) == (by, on))) for by, on in names]


def _collect(measured: Measurement, judged: Judgement) -> dict[str, Quantity]:
    rows, out = measured.contacts, {}
    for pair in _list_pairs(judged):
        spent = np.array([v.end_s - v.start_s for v in pair.verdicts])
        force = np.array([v.normal_force_mean for v in pair.verdicts])
        used = [v.utilisation_max for v in pair.verdicts if np.isfinite(v.utilisation_max)]
        by, on = measured.parties.names.index(pair.by), measured.parties.names.index(pair.on)
        values = {
            "utilisation_max": max(used, default=0.0),
            "coulomb_slip_mm": _add(pair, Kind.COULOMB_SLIP, ""),
            "torsional_slip_deg": _add(pair, Kind.TORSIONAL_SLIP, ""),
            "creep_um_s": _add(pair, Kind.CREEPING, "um/s"),
            "penetration_max_um": 1e6 * float(rows.penetration[(rows.by == by) & (rows.on == on)].max()),
            "normal_force_mean_N": float(np.average(force, weights=spent)),
            "touch_s": float(spent.sum()),
        }
        for key, value in values.items():
            unit, floor = FLOORS[key]
            out[f"{pair.by} on {pair.on}: {key}"] = Quantity(float(value), unit, floor=floor)
    return out


def _add(pair: _Pair, kind: Kind, unit: str) -> float:
    """Return what a pair shows of one kind, over all its episodes; rates are the largest, paths their sum."""
    amounts = [f.amount for v in pair.verdicts for f in v.findings if f.kind == kind and unit in ("", f.unit)]
    return max(amounts, default=0.0) if unit else float(sum(amounts))


def _collect_words(judged: Judgement) -> dict[str, str]:
    return {
        f"{pair.by} on {pair.on}: verdict": ", ".join(dict.fromkeys(str(v.kind) for v in pair.verdicts))
        for pair in _list_pairs(judged)
    }
