"""The page that compares releases of MuJoCo: one table, one row per item, one column per release."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from version_items import HOME, ROOT, Row

from dexplan.testing.baseline import Baseline, Drift, as_key, compare, find_baseline

WHERE = {
    "scene": ROOT / "tests" / "testing" / "contact_baselines",
    "contacts": ROOT / "tests" / "baselines",
}
HEADINGS = {
    "scene": "Foreign scenes: contacts against those of MuJoCo {home}",
    "contacts": "dexplan's hand: contacts against those of MuJoCo {home}",
    "problem": "Built-in problems: planned, carried out, judged",
    "tests": "Tests",
}
LEAD = """# dexplan on releases of MuJoCo

The same contacts, problems and tests on each release, written by `scripts/versions`; all other packages are those of
`constraints.txt`.  `pyproject.toml` asks for the releases that are here without a failure; CI installs {home} and runs all
tests on it.  A release before {home} cannot run what uses `mujoco.batch`; measuring contacts and verdicts
(`dexplan.testing`) does not.

A contact row says which verdicts changed, and the largest drift of any quantity from its baseline of MuJoCo {home}, with the
share of what its tolerance allows (above 1 would fail on {home} itself; on another release it informs).

"""


def write_page(path: Path, packages: Mapping[str, str], rows: Sequence[Row]) -> None:
    """Write the page of ``rows`` for the releases in ``packages``, which has the packages of each."""
    releases = sorted(packages, key=lambda r: [int(part) for part in r.split(".")])
    cells: dict[str, dict[str, dict[str, str]]] = {kind: {} for kind in HEADINGS}
    for row in rows:
        release, kind, name = row["key"].split(" ", 2)
        cells[kind].setdefault(name, {})[release] = _tell(kind, name, row)
    out = [LEAD.format(home=HOME), "| | " + " | ".join(f"MuJoCo {r}" for r in releases) + " |"]
    out.append("| --- |" + " --- |" * len(releases))
    others = [packages[r].replace(f"mujoco {r} ", "") for r in releases]
    out.append("| with | " + " | ".join(others) + " |")
    for kind, heading in HEADINGS.items():
        if cells[kind]:
            out.append(f"| **{heading.format(home=HOME)}** |" + " |" * len(releases))
            for name, of in sorted(cells[kind].items()):
                out.append(f"| {name} | " + " | ".join(of.get(r, "not asked") for r in releases) + " |")
    failed = [(row["key"], name) for row in rows for name in row.get("failed", ())]
    if failed:
        out += ["", "Failing tests:", ""]
        out += [f"* {key.split(' ')[0]}: `{name}`" for key, name in failed]
    path.write_text("\n".join(out) + "\n", encoding="utf-8")


def _tell(kind: str, name: str, row: Mapping[str, Any]) -> str:
    """Return the cell of an item."""
    if kind not in WHERE or not row["is_well"]:
        mark = "" if row["is_well"] else "**failed**: "
        told = re.sub(r"^(PASS|FAIL) \S+ *", r"\1 ", str(row["told"]))
        return (mark + re.sub(r"^PASS .*?(friction used [\d.]+).*", r"PASS, \1", told)).replace("|", "/")[
            :120
        ]
    now = Baseline.load(Path(row["told"]))
    found = find_baseline(WHERE[kind], name, HOME)
    if found is None:
        return "no baseline"
    is_home = as_key(now.versions["mujoco"]) == as_key(HOME)
    return _tell_drift(compare(Baseline.load(found[0]), now, found[0].name, is_same_version=is_home))


def _tell_drift(drift: Drift) -> str:
    if drift.changed_words:
        return (
            "**" + "; ".join(f"{what}: {was} became {now}" for what, was, now in drift.changed_words) + "**"
        )
    worst = max(drift.rows, key=lambda row: row.share)
    if worst.share == 0.0:
        return "the same"
    change = (
        f"{worst.name.rpartition(': ')[2]} {worst.was:.3g} → {worst.now:.3g} {worst.unit.strip('-')}".strip()
    )
    return f"{worst.share:.2g} ({change})"
