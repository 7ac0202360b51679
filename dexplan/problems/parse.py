"""Text, or the dict of a problem file, to a checked value of :class:`~dexplan.problems.sections.ProblemFields` or a class of it.

Anything that cannot be read as a problem ends as one ``ProblemError`` of one line: source, key, value, and what would be
accepted.  Order: text, keys, numbers, types, sense.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec
import numpy as np

from dexplan.errors import ProblemError
from dexplan.problems.check import check_problem
from dexplan.problems.derived import as_name, fill_derived, forget_derived
from dexplan.problems.override import apply_override
from dexplan.problems.rules import describe_accepted, load_limits, spell, suggest
from dexplan.problems.sections import FORMAT, ProblemFields
from dexplan.problems.shapes import choose_rival, resolve_object
from dexplan.sim.judge.limits import explain_refusal

P = TypeVar("P", bound=ProblemFields)
"""The class of the value that is built."""

LARGEST_FILE = 1 << 20
"""A problem file is a page of text; more than this many bytes is something else."""

RANDOM = "random"
"""A goal attitude that is drawn from the problem's seed."""

GOALS = {"rotation", "orientation_wxyz", "translation_m", "contacts_deg", "waypoints"}
"""Keys of ``[goal]`` that ask for something."""
LONGEST_COMPLAINT = 160

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


@dataclass(frozen=True)
class Origin:
    """Where a problem comes from: its ``source`` as messages name it, the name it has where it gives none, and the ``folder``
    from which it names files.
    """

    source: str
    default_name: str = ""
    folder: Path = Path()


def parse_file(path: Path, cls: type[P], overrides: Mapping[str, object] = {}) -> P:
    """Return the problem in the file at ``path``, as a value of ``cls``."""
    source = str(path) if str(path).isprintable() else repr(str(path))
    accepted = "accepted: a problem file in TOML"
    try:
        if path.is_dir():
            inside = path / "problem.toml"
            hint = f", such as {str(inside)!r}" if inside.is_file() else ""
            raise ProblemError(source, "", "is a directory", accepted + hint)
        if not path.exists():
            raise ProblemError(source, "", "no such file", accepted)
        if not path.is_file():
            raise ProblemError(source, "", "is not a regular file", accepted)
        if path.stat().st_size > LARGEST_FILE:
            raise ProblemError(
                source, "", f"has {path.stat().st_size} bytes", f"{accepted} of at most {LARGEST_FILE}"
            )
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ProblemError(source, "", f"cannot be read ({reason})", accepted) from None
    return parse_text(content, cls, Origin(source, path.stem, path.parent), overrides)


def parse_data(data: Mapping[str, Any], cls: type[P], origin: Origin) -> P:
    """Return the checked problem that ``data``, the dict of a problem file, describes."""
    try:
        return _build(dict(data), cls, origin)
    except RecursionError:
        raise ProblemError(
            origin.source, "", "is nested too deeply", "accepted: a problem file of format 1"
        ) from None


def parse_text(content: bytes, cls: type[P], origin: Origin, overrides: Mapping[str, object] = {}) -> P:
    """Return the problem in the bytes of a file: decode, parse, override, build."""
    source = origin.source
    try:
        # Some editors begin a file with a byte-order mark.
        data = tomllib.loads(content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        fact = f"byte {error.start} (line {line}) is not text"
        raise ProblemError(source, "", fact, "accepted: a problem file in TOML, UTF-8") from None
    except (ValueError, RecursionError) as error:
        raise ProblemError(
            source, "", f"is not TOML ({_one_line(error)})", "accepted: a problem file in TOML"
        ) from None
    if not data:
        raise ProblemError(source, "", "is empty", "accepted: format = 1 and a [goal] at least")
    if overrides:
        forget_derived(data)
        choose_rival(data, overrides)
    for key, value in overrides.items():
        apply_override(data, key, value, source)
    return parse_data(data, cls, origin)


def _build(data: dict[str, Any], cls: type[P], origin: Origin) -> P:
    source = origin.source
    _check_format(data, source)
    _check_keys(data, cls, "", source)
    _check_plain_values(data, "", source)
    if not data.get("goal"):
        accepted = "accepted: a table [goal] with rotation, orientation_wxyz, translation_m or contacts_deg"
        raise ProblemError(source, "goal", "missing" if "goal" not in data else "says nothing", accepted)
    data.setdefault("name", as_name(origin.default_name))
    _check_goal_says_something(data["goal"], source)
    resolve_object(data, source, origin.folder)
    fill_derived(data)
    _draw_orientation(data)
    _flatten_joint_ranges(data, source)
    data["acceptance"] = _resolve_acceptance(data.get("acceptance", {}), source)
    problem = _convert(data, cls, source)
    check_problem(problem, source)
    return problem


def _check_format(data: dict[str, Any], source: str) -> None:
    version = data.pop("format", None)
    if type(version) is not int or version != FORMAT:
        fact = "missing" if version is None else f"{spell(version)} is not a format this version reads"
        raise ProblemError(source, "format", fact, f"accepted: format = {FORMAT}")


def _check_goal_says_something(goal: Any, source: str) -> None:
    if isinstance(goal, dict) and not GOALS & set(goal):
        accepted = "accepted: rotation, orientation_wxyz, translation_m, contacts_deg or waypoints"
        raise ProblemError(source, "goal", "names no goal", accepted)


def _draw_orientation(data: dict[str, Any]) -> None:
    """Put a goal attitude, uniform over all rotations and drawn from the problem's seed, in the place of "random"."""
    goal, seed = data["goal"], data.get("seed", 0)
    if not (isinstance(goal, dict) and goal.get("orientation_wxyz") == RANDOM):
        return
    # A seed that is none is refused later by its own name, whatever is drawn here.
    rng = np.random.default_rng(seed if type(seed) is int and seed >= 0 else 0)
    quaternion = rng.normal(size=4)
    quaternion *= np.copysign(1.0, quaternion[0]) / np.linalg.norm(quaternion)
    data["goal"] = {**goal, "orientation_wxyz": quaternion.tolist()}


def _nested_class(annotation: Any) -> type | None:
    """Return the dataclass inside a field's type (one at most), through unions and tuples."""
    if isinstance(annotation, type) and is_dataclass(annotation):
        return annotation
    return next((found for inner in get_args(annotation) if (found := _nested_class(inner))), None)


def _known_keys(cls: type) -> dict[str, type | None]:
    """Return key -> class of the table below it, for the table that ``cls`` describes."""
    hints = get_type_hints(cls)
    return {f.name: _nested_class(hints[f.name]) for f in fields(cls)}


def _check_keys(value: Any, cls: type, key: str, source: str) -> None:
    """Refuse the first key that the format does not know, with the nearest that it does."""
    if isinstance(value, list):
        for index, item in enumerate(value):
            _check_keys(item, cls, f"{key}[{index}]", source)
    if not isinstance(value, dict):
        return
    known = _known_keys(cls)
    for name, item in value.items():
        where = _join(key, name)
        if name not in known:
            raise ProblemError(source, where, f"unknown key {spell(name)}", _suggest_key(name, list(known)))
        inner = known[name]
        if inner is not None:
            _check_keys(item, inner, where, source)


def _suggest_key(name: str, siblings: list[str]) -> str:
    """Return a suggestion from the same table, else the same word in another table, else the table's keys."""
    elsewhere = [
        f"{section}.{inner}"
        for section, cls in _known_keys(ProblemFields).items()
        if cls is not None
        for inner in _known_keys(cls)
        if inner == name
    ]
    return f"did you mean {elsewhere[0]!r}?" if elsewhere else suggest(name, siblings)


def _check_plain_values(value: Any, key: str, source: str) -> None:
    """Refuse NaN, infinities and integers beyond 64 bits wherever they stand."""
    if isinstance(value, dict):
        for name, item in value.items():
            _check_plain_values(item, _join(key, name), source)
    elif isinstance(value, list | tuple):
        for index, item in enumerate(value):
            _check_plain_values(item, f"{key}[{index}]", source)
    elif isinstance(value, float) and not math.isfinite(value):
        raise ProblemError(source, key, f"{value} is not a finite number", describe_accepted(key))
    elif isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise ProblemError(source, key, "the number has more than 64 bits", describe_accepted(key))


def _flatten_joint_ranges(data: dict[str, Any], source: str) -> None:
    """Let ``finger_1.joint_1 = [..]`` mean the same with and without quotes, and check that each range is
    two numbers.
    """
    hand = data.get("hand")
    if not (isinstance(hand, dict) and isinstance(hand.get("joint_ranges_deg"), dict)):
        return
    flat: dict[str, Any] = {}
    for name, value in hand["joint_ranges_deg"].items():
        flat |= (
            {f"{name}.{joint}": item for joint, item in value.items()}
            if isinstance(value, dict)
            else {name: value}
        )
    for name, value in flat.items():
        numbers = isinstance(value, list | tuple) and all(type(item) in (int, float) for item in value)
        if not numbers or len(value) != 2:
            key = f"hand.joint_ranges_deg.{name if name.isprintable() else repr(name)}"
            raise ProblemError(
                source, key, f"{spell(value)} is no range", "accepted: [lowest, highest] in degrees"
            )
    data["hand"] = {**hand, "joint_ranges_deg": flat}


def _resolve_acceptance(given: Any, source: str) -> dict[str, bool | float]:
    """Return every limit: the packaged default, replaced where the file gives its own."""
    limits = dict(load_limits())
    if not isinstance(given, dict):
        raise ProblemError(
            source, "acceptance", f"{spell(given)} is no table", describe_accepted("acceptance")
        )
    for name, value in given.items():
        key = _join("acceptance", name)
        if name not in limits:
            raise ProblemError(source, key, f"unknown limit {spell(name)}", suggest(name, limits))
        if isinstance(limits[name], bool):
            if not isinstance(value, bool):
                raise ProblemError(
                    source, key, f"{spell(value)} is neither true nor false", "accepted: true or false"
                )
        elif isinstance(value, bool) or not isinstance(value, int | float):
            raise ProblemError(source, key, f"{spell(value)} is no number", "accepted: a number")
        elif (refusal := explain_refusal(name, float(value))) is not None:
            raise ProblemError(source, key, *refusal)
        limits[name] = value if isinstance(value, bool) else float(value)
    return limits


def _convert(data: dict[str, Any], cls: type[P], source: str) -> P:
    """Decode strictly; turn msgspec's complaint into ours, which names the value and what the key accepts."""
    try:
        return msgspec.convert(data, cls, strict=True)
    except msgspec.ValidationError as error:
        match = re.fullmatch(r"(?s)(.*?)(?: - at `\$\.?(.*)`)?", str(error))
        fact, key = (match[1], match[2] or "") if match else (_one_line(error), "")
    missing = re.search(r"missing required field `(\w+)`", fact)
    if missing:
        key = _join(key, missing[1])
        raise ProblemError(source, key, "missing", describe_accepted(key))
    value: Any = data
    for step in re.findall(r"[^.\[\]]+", key):
        value = value[int(step)] if isinstance(value, list | tuple) else value.get(step)
    raise ProblemError(source, key, f"{spell(value)} does not fit", describe_accepted(key))


def _join(key: str, name: str) -> str:
    """Return the dotted key of ``name`` below ``key``, quoted where TOML would quote it."""
    spelled = name if _BARE_KEY.fullmatch(name) else spell(name)
    return f"{key}.{spelled}" if key else spelled


def _one_line(error: BaseException) -> str:
    """Return what ``error`` says in one line; of a long one its middle is left out, for the place comes last."""
    text = " ".join(str(error).split())
    return text if len(text) <= LONGEST_COMPLAINT else f"{text[:80]} ... {text[-60:]}"
