"""The report of a judgement: its verdict, its checks, and what has to be said beside them."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from dexplan.brief import brief_repr
from dexplan.errors import RunFolderError
from dexplan.notebook import as_html_table
from dexplan.sim.judge.checks_case import CheckResult
from dexplan.sim.judge.groups import GROUPS, find_group
from dexplan.sim.judge.limits import INTEGRITY
from dexplan.sim.judge.true_world import describe_untrue

FORMAT = 1
"""The report format this package reads and writes."""

HEADS = ("check", "status", "value", "limit", "unit", "at s", "note")
"""What stands over the columns of the table."""
HEADLINES = (
    ("turned_angle", "turn off by"),
    ("position_error_max", "position within"),
    ("rotation_error_max", "rotation within"),
    ("friction_utilisation_max", "friction used"),
    ("coulomb_slip_max", "slip"),
)
"""What the one-line summary of a passed run tells."""


@dataclass(frozen=True, eq=False)
class ValidationReport:
    """The judgement of one run: ``verdict`` is "pass" iff no check fails; the rest is what one needs to
    believe it.

    ``physics`` are the parameters simulated under, ``timing`` seconds simulated and spent, ``versions`` and
    ``machine`` of what judged.  ``recorded`` are versions and machine of the record as it states them, with its
    ``differences`` from here, and the ``controller``, None for dexplan's own; ``loose_limits`` maps limits looser than
    their defaults to ``value`` and ``default``; ``groups`` are those whose checks were judged; ``untrue`` maps each parameter
    of the world that was not as ``believed`` to that and what is ``true``.
    """

    name: str
    verdict: Literal["pass", "fail"]
    checks: tuple[CheckResult, ...]
    physics: Mapping[str, Any]
    timing: Mapping[str, Any]
    versions: Mapping[str, str]
    seed: int
    format: int = FORMAT
    machine: Mapping[str, str] = field(default_factory=dict)
    recorded: Mapping[str, Any] = field(default_factory=dict)
    loose_limits: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    groups: tuple[str, ...] = tuple(GROUPS)
    untrue: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "checks", tuple(self.checks))
        object.__setattr__(self, "groups", tuple(self.groups))
        for key in ("physics", "timing", "versions", "machine", "recorded", "loose_limits", "untrue"):
            object.__setattr__(self, key, MappingProxyType(json.loads(json.dumps(dict(getattr(self, key))))))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ValidationReport) and self.as_dict() == other.as_dict()

    __hash__ = None  # type: ignore[assignment]

    def __str__(self) -> str:
        return f"{self.table()}\n{self.summary_line()}"

    def __getitem__(self, name: str) -> CheckResult:
        """Return the result of the check ``name``; KeyError where there is none."""
        for check in self.checks:
            if check.name == name:
                return check
        raise KeyError(name)

    @property
    def is_passed(self) -> bool:
        """Whether the physics confirms the plan."""
        return self.verdict == "pass"

    @property
    def failures(self) -> tuple[CheckResult, ...]:
        """The checks that failed, in order."""
        return tuple(check for check in self.checks if check.status == "fail")

    def as_dict(self) -> dict[str, Any]:
        """Return the report as JSON data (``report.json``)."""
        return {
            "format": self.format,
            "name": self.name,
            "verdict": self.verdict,
            "checks": [asdict(check) for check in self.checks],
            "physics": dict(self.physics),
            "timing": dict(self.timing),
            "versions": dict(self.versions),
            "seed": self.seed,
            "machine": dict(self.machine),
            "recorded": dict(self.recorded),
            "loose_limits": dict(self.loose_limits),
            "groups": list(self.groups),
            "untrue": dict(self.untrue),
        }

    @property
    def reservations(self) -> tuple[str, ...]:
        """What has to be said beside the verdict, one sentence each: another controller, groups left out, a world that is
        not as believed, looser limits, a record from elsewhere.
        """
        told = []
        unrecorded = {find_group(check.name) for check in self.checks if check.status == "not_recorded"}
        words = [f"run by {self.recorded['controller']}"] if self.recorded.get("controller") else []
        if len(self.groups) < len(GROUPS):
            words.append(f"judged: {', '.join(self.groups)}")
            for why, names in (("recorded", unrecorded), ("judged", set(GROUPS) - unrecorded)):
                left_out = [name for name in GROUPS if name in names and name not in self.groups]
                words += [f"not {why}: {', '.join(left_out)}"] if left_out else []
        told += ["; ".join(words)] if words else []
        if self.untrue:
            told.append(f"the world is not as believed: {describe_untrue(self.untrue)}")
        if self.loose_limits:
            words = [
                f"{key} {x['value']:g} instead of {x['default']:g}" for key, x in self.loose_limits.items()
            ]
            told.append(f"limits looser than default ({len(words)}): {', '.join(words)}")
        if self.recorded.get("differences"):
            told.append(
                f"recorded elsewhere ({'; '.join(self.recorded['differences'])}), judged from the replay"
            )
        return tuple(told)

    def summary_line(self) -> str:
        """Return :meth:`verdict_line` and, after it in the same line, the reservations."""
        return "; ".join([self.verdict_line(), *self.reservations])

    def verdict_line(self) -> str:
        """Return one line: PASS with a few numbers, or FAIL with the first check that failed."""
        # One line, whatever stands in the names of a foreign model.
        return " ".join(self._verdict_words().split())

    def _verdict_words(self) -> str:
        if self.is_passed:
            told = [(word, check) for name, word in HEADLINES for check in self.checks if check.name == name]
            parts = [
                f"{word} {_spell(c.value)} {c.unit}".replace(" –", "")
                for word, c in told
                if c.value is not None
            ]
            return f"PASS {self.name}: {', '.join(parts)}"
        first = self.failures[0]
        value = "without a value" if first.value is None else f"{_spell(first.value)} {first.unit}"
        limit = "" if first.limit is None else f" (limit {_spell(first.limit)})"
        moment = "" if first.worst_time_s is None else f" at {first.worst_time_s:.2f} s"
        is_told = first.value is None or first.name in INTEGRITY
        note = f": {_shorten(first.note)}" if is_told and first.note else ""
        return f"FAIL {first.name} {value}{limit}{moment}{note}"

    def table(self) -> str:
        """Return all checks as aligned text."""
        rows = [HEADS, *self._list_rows()]
        widths = [max(len(row[i]) for row in rows) for i in range(len(HEADS))]
        return "\n".join(
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
            for row in rows
        )

    def _list_rows(self) -> list[tuple[str, ...]]:
        """Return a row of text per check, under :data:`HEADS`."""
        return [
            (
                c.name,
                c.status.replace("_", " "),
                _spell(c.value),
                _spell(c.limit),
                c.unit,
                "" if c.worst_time_s is None else f"{c.worst_time_s:.2f}",
                c.note,
            )
            for c in self.checks
        ]

    def _repr_html_(self) -> str:
        """Return the report as notebooks show it: the verdict, and a row per check, those that failed in bold."""
        failed = [k for k, check in enumerate(self.checks) if check.status == "fail"]
        return as_html_table(HEADS, self._list_rows(), failed, caption=self.summary_line())

    def save(self, path: str | Path) -> Path:
        """Write report.json, whole or not at all.  Returns the path."""
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
        try:
            text = json.dumps(self.as_dict(), indent=1, ensure_ascii=False, allow_nan=False)
            temporary.write_text(text + "\n", encoding="utf-8")
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
        return path

    @classmethod
    def load(cls, path: str | Path) -> ValidationReport:
        """Read a report that :meth:`save` wrote; equal to it.  Raises RunFolderError for anything else."""
        accepted = "a report.json as `dexplan validate` writes it is needed"
        try:
            data = json.loads(Path(path).read_text(encoding="utf-8"))
            if data["format"] != FORMAT:
                raise RunFolderError(
                    str(path), f"it has report format {data['format']}", f"format {FORMAT} is read here"
                )
            results = tuple(CheckResult(**check) for check in data.pop("checks"))
            report = cls(checks=results, **data)
            # Whatever cannot be told is no report, however it was made.
            str(report)
            return report
        except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            raise RunFolderError(str(path), f"it cannot be read as a report ({error})", accepted) from error


def _spell(value: float | None) -> str:
    """Return a number with four digits, nothing for None."""
    return "" if value is None else f"{value:.4g}"


def _shorten(note: str) -> str:
    """Return the beginning of a note that is too long for a line."""
    return note if len(note) <= 200 else f"{note[:199]}…"
