"""Baselines of contact behaviour: numbers of one run as MuJoCo version so-and-so gave them, kept in JSON, and how far a run
has drifted from them.

One file per run and version of MuJoCo (major and minor), ``<name>.mujoco-3.17.json``.  A version without a file of its own is
compared with the nearest older one, else with the nearest newer one.
"""

from __future__ import annotations

import json
import math
import platform
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType
from typing import Any

from dexplan.errors import SceneError

FORMAT = 1
"""The format of baseline files that this package reads and writes."""
RELATIVE = 0.10
"""Share of its baseline by which a quantity may move where nothing else is said: MuJoCo's patch releases move contacts by a
few per cent, a friction that is wrong by a fifth by more than twice that."""
DIGITS = 6
"""Significant digits that are stored: far finer than any tolerance, coarse enough to read."""
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


@dataclass(frozen=True)
class Quantity:
    """A number with its unit and how far it may move: by ``relative`` of itself or by ``floor``, whichever is more."""

    value: float
    unit: str = "-"
    relative: float = RELATIVE
    floor: float = 0.0

    @property
    def allowed(self) -> float:
        """By how much the quantity may differ."""
        return max(self.relative * abs(self.value), self.floor)


@dataclass(frozen=True)
class Baseline:
    """What one run showed: its quantities, words that have to stay the same (verdicts), and what it was measured with."""

    name: str
    quantities: Mapping[str, Quantity]
    words: Mapping[str, str] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    platform: str = ""

    def __post_init__(self) -> None:
        for name in ("quantities", "words", "versions"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def save(self, path: Path) -> None:
        """Write the baseline, whole or not at all."""
        content = {
            "format": FORMAT,
            "name": self.name,
            "versions": dict(self.versions),
            "platform": self.platform,
            "words": dict(self.words),
            "quantities": {name: asdict(q) for name, q in self.quantities.items()},
        }
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_name(path.name + ".part")
        draft.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        draft.replace(path)

    @staticmethod
    def load(path: Path) -> Baseline:
        """Read a baseline; SceneError, in one line, where the file is none."""
        accepted = f"accepted: a contact baseline of format {FORMAT}"
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise SceneError(str(path), f"cannot be read ({error.strerror})", accepted) from error
        except ValueError as error:
            raise SceneError(str(path), f"is no JSON ({error})", accepted) from error
        try:
            if content["format"] != FORMAT:
                raise SceneError(str(path), f"format {content['format']!r}", accepted)
            quantities = {str(k): _read_quantity(v) for k, v in content["quantities"].items()}
            return Baseline(
                str(content["name"]), quantities, content["words"], content["versions"], content["platform"]
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise SceneError(str(path), f"lacks or misspells something ({error})", accepted) from error


def _read_quantity(content: Mapping[str, Any]) -> Quantity:
    q = Quantity(**content)
    if not all(map(math.isfinite, (q.value, q.relative, q.floor))) or min(q.relative, q.floor) < 0.0:
        raise ValueError(f"no tolerable quantity: {dict(content)}")
    return q


@dataclass(frozen=True)
class DriftRow:
    """One quantity: then, now (NaN: it was not there), and the share of what is allowed by which it moved; beyond 1 fails."""

    name: str
    unit: str
    was: float
    now: float
    share: float


@dataclass(frozen=True)
class Drift:
    """How far a run has moved from a baseline.

    ``is_same_version`` of MuJoCo: else numbers only inform, for another version may move them, and only words decide.
    """

    name: str
    source: str
    is_same_version: bool
    rows: tuple[DriftRow, ...]
    changed_words: tuple[tuple[str, str, str], ...]
    changed_versions: tuple[str, ...]

    @property
    def is_within(self) -> bool:
        """Whether the run may pass."""
        return not self.changed_words and (not self.is_same_version or not self.has_moved)

    @property
    def has_moved(self) -> bool:
        """Whether any number is beyond its tolerance."""
        return any(row.share > 1.0 for row in self.rows)

    def table(self) -> str:
        """Return the drift as text, worst first."""
        versions = ", ".join(self.changed_versions) or "as in the baseline"
        lines = [f"{self.name}, against {self.source}; versions: {versions}"]
        lines += [f"{what}: {was!r} became {now!r}" for what, was, now in self.changed_words]
        width = max([len("quantity"), *(len(row.name) for row in self.rows)]) + 2
        lines.append(f"{'quantity':{width}}{'baseline':>12}{'now':>12}{'change':>12}  unit")
        for row in sorted(self.rows, key=lambda row: -row.share):
            mark = "  <-- beyond tolerance" if row.share > 1.0 else ""
            change = row.now - row.was
            lines.append(f"{row.name:{width}}{row.was:12.5g}{row.now:12.5g}{change:+12.3g}  {row.unit}{mark}")
        return "\n".join(lines)


def compare(baseline: Baseline, now: Baseline, source: str, *, is_same_version: bool) -> Drift:
    """Return how far ``now`` is from ``baseline``, read from ``source``; tolerances are those of the baseline.

    A quantity that one of them lacks is as far off as can be.
    """
    rows = []
    for name in sorted({*baseline.quantities, *now.quantities}):
        was, value = baseline.quantities.get(name), now.quantities.get(name)
        if was is None or value is None:
            known = was or value
            assert known is not None
            a, b = (q.value if q else math.nan for q in (was, value))
            rows.append(DriftRow(name, known.unit, a, b, math.inf))
            continue
        change = abs(value.value - was.value)
        if change == 0.0:
            share = 0.0
        else:
            share = change / was.allowed if was.allowed > 0.0 and math.isfinite(change) else math.inf
        rows.append(DriftRow(name, was.unit, was.value, value.value, share))
    words = tuple(
        (what, baseline.words.get(what, "nothing"), now.words.get(what, "nothing"))
        for what in sorted({*baseline.words, *now.words})
        if baseline.words.get(what) != now.words.get(what)
    )
    versions = tuple(
        f"{what} {was} -> {now.versions.get(what, 'none')}"
        for what, was in sorted(baseline.versions.items())
        if now.versions.get(what) != was
    )
    return Drift(baseline.name, source, is_same_version, tuple(rows), words, versions)


def make_baseline(
    name: str, quantities: Mapping[str, Quantity], words: Mapping[str, str] | None = None, *packages: str
) -> Baseline:
    """Return a baseline of what was measured here and now, with the versions of MuJoCo, Python and other ``packages``."""
    if not NAME.fullmatch(name):
        raise SceneError(
            "baseline", f"the name {name!r} is no file name", "accepted: letters, digits, '.', '_', '-'"
        )
    rounded = {}
    for key, q in quantities.items():
        if not math.isfinite(q.value):
            raise SceneError(f"baseline {name}", f"{key} is {q.value}", "accepted: finite numbers")
        rounded[key] = Quantity(float(f"{q.value:.{DIGITS}g}"), q.unit, q.relative, q.floor)
    versions = {package: find_version(package) for package in ("mujoco", *packages)}
    versions["python"] = platform.python_version()
    return Baseline(name, rounded, words or {}, versions, f"{platform.system()} {platform.machine()}")


def find_version(package: str) -> str:
    """Return the installed version of a package."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def as_key(text: str) -> tuple[int, ...]:
    """Return "3.17.0" as (3, 17)."""
    return tuple(int(part) for part in re.findall(r"\d+", text)[:2])


def name_file(name: str, mujoco_version: str) -> str:
    """Return the name of the baseline file of a run."""
    return f"{name}.mujoco-{'.'.join(map(str, as_key(mujoco_version)))}.json"


def find_baseline(folder: Path, name: str, mujoco_version: str) -> tuple[Path, bool] | None:
    """Return the file of a run for a version of MuJoCo, and whether it is that version's own; else the nearest older, then
    newer one.
    """
    pattern = re.compile(rf"{re.escape(name)}\.mujoco-(\d+\.\d+)\.json")
    found = ((pattern.fullmatch(path.name), path) for path in sorted(folder.glob("*.json")))
    stored = {as_key(match[1]): path for match, path in found if match}
    wanted = as_key(mujoco_version)
    if wanted in stored:
        return stored[wanted], True
    older = [key for key in stored if key < wanted]
    if stored:
        return stored[max(older) if older else min(stored)], False
    return None
