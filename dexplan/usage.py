"""What is wrong with a command line, said in terms of the command that was asked for.

The commands are dataclasses annotated for tyro; what each accepts is read off them, so that there is one list of options.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import tyro

from dexplan.errors import DexplanError

WORDS = {
    "FILE": "a new file such as my_problem.toml",
    "RUN": "a folder written by `dexplan run`, or a problem as for `dexplan run`",
    "PROBLEM": "a built-in name of `dexplan list` or a .toml file",
    "DIR": "a folder written by `dexplan run`",
    "ACTION": "record or check",
    "SOURCE": "a folder written by `dexplan run`, or an MJCF file",
}
"""What each positional word stands for, told where it is missing."""
NEGATIVE_NUMBER = re.compile(r"-\.?\d.*")


class UsageError(DexplanError):
    """The arguments are no command."""


@dataclass(frozen=True)
class Option:
    """One option of a command: the name after its dashes, and the word that stands for its value (None: a flag).

    ``is_alias``: whether this is another spelling of an option, which need not be told.
    """

    name: str
    metavar: str | None
    is_whole: bool = False
    is_path: bool = False
    is_number: bool = False
    is_alias: bool = False


@dataclass(frozen=True)
class Usage:
    """What one command accepts: the words that stand for its positional arguments, and its options by their spelling.

    The first ``needed`` words have to be given; where ``is_open_ended`` the last one may be given any number of times.
    """

    words: tuple[str, ...]
    options: Mapping[str, Option]
    needed: int
    is_open_ended: bool = False

    def describe(self) -> str:
        """Return the options as they are written."""
        told = [
            f"{name} {o.metavar}" if o.metavar else name for name, o in self.options.items() if not o.is_alias
        ]
        return ", ".join(told) or "no options"


def check_usage(argv: Sequence[str], commands: Mapping[str, type]) -> None:
    """Raise UsageError, in one sentence, for a command line that is none; ``commands`` are the dataclasses by name."""
    if not argv or argv[0] not in commands:
        raise UsageError(f"{_describe_unknown(argv, commands)} (see dexplan --help)")
    command = argv[0]
    usage = read_usage(commands[command])
    given: list[str] = []
    rest = list(argv[1:])
    while rest:
        word = rest.pop(0)
        if not word.startswith("-") or word == "-" or NEGATIVE_NUMBER.fullmatch(word):
            given.append(word)
            continue
        spelling, equals, value = word.partition("=")
        option = usage.options.get(spelling.replace("_", "-"))
        if option is None:
            raise UsageError(_describe_unknown_option(command, spelling, commands))
        if option.metavar is None:
            if equals:
                raise UsageError(
                    f"{spelling} takes no value, {value!r} was given (see dexplan {command} --help)"
                )
            continue
        if not equals:
            if not rest or rest[0] in usage.options:
                raise UsageError(f"{spelling} needs a value; accepted: {spelling} {option.metavar}")
            value = rest.pop(0)
        _check_value(spelling, option, value)
    _check_count(command, usage, given)


@cache
def read_usage(command: type) -> Usage:
    """Return what a command accepts, from its dataclass."""
    hints = get_type_hints(command, include_extras=True)
    words, options, needed, is_open_ended = [], {}, 0, False
    # What a command shares with others comes after what is its own.
    for field in sorted(
        fields(command), key=lambda f: f.name not in vars(command).get("__annotations__", {})
    ):
        hint, marks = hints[field.name], get_args(hints[field.name])[1:]
        arg = next((m for m in marks if hasattr(m, "metavar") and hasattr(m, "name")), None)
        metavar = (arg.metavar if arg else None) or field.name.upper()
        if tyro.conf.Positional in _find_markers(hint):
            words.append(metavar)
            needed += field.default is MISSING
            is_open_ended = is_open_ended or _holds_many(hint)
            continue
        name = (arg.name if arg else None) or field.name.replace("_", "-")
        if bool in (hint, *get_args(hint)[:1]):
            options[f"--{name}"] = Option(name, None)
            if tyro.conf.FlagCreatePairsOff not in _find_markers(hint):
                options[f"--no-{name}"] = Option(name, None)
            for alias in (arg.aliases if arg else None) or ():
                options[alias] = Option(name, None, is_alias=True)
        else:
            inner = {part for part in _flatten(hint) if isinstance(part, type)}
            options[f"--{name}"] = Option(name, metavar, int in inner, Path in inner, float in inner)
    return Usage(tuple(words), options, needed, is_open_ended)


def _find_markers(hint: Any) -> list[Any]:
    """Return tyro's markers on a type: ``Positional[T]`` is an annotated type whose marks say so."""
    marks = get_args(hint)[1:]
    return [m for m in (tyro.conf.Positional, tyro.conf.FlagCreatePairsOff) if get_args(m[int])[1] in marks]


def _holds_many(hint: Any) -> bool:
    """Whether a type is a tuple of any length."""
    return any(get_origin(part) is tuple and get_args(part)[1:] == (...,) for part in _flatten(hint))


def _flatten(hint: Any) -> list[Any]:
    parts = get_args(hint)
    return [hint, *(inner for part in parts for inner in _flatten(part))]


def _describe_unknown(argv: Sequence[str], commands: Mapping[str, type]) -> str:
    accepted = f"accepted: {', '.join(commands)}"
    first = next((word for word in argv if not word.startswith("-")), None)
    if first is None:
        return f"no command in {' '.join(argv)!r}; {accepted}" if argv else f"no command; {accepted}"
    command = next((word for word in argv if word in commands), None)
    if command is not None:
        return f"{argv[0]!r} stands before the command; accepted: dexplan {command} ... {argv[0]}"
    if Path(first).suffix == ".toml":
        return (
            f"no command before {first!r}; accepted: dexplan run {first}, or another of {', '.join(commands)}"
        )
    near = difflib.get_close_matches(first, commands, n=1)
    return f"unknown command {first!r}; {f'did you mean {near[0]!r}? ' if near else ''}{accepted}"


def _describe_unknown_option(command: str, spelling: str, commands: Mapping[str, type]) -> str:
    """Say which option of this command may have been meant, or which commands have it, and what this one accepts."""
    usage = read_usage(commands[command])
    near = difflib.get_close_matches(spelling, usage.options, n=1)
    others = [name for name, cls in commands.items() if spelling in read_usage(cls).options]
    if others:
        hint = f" (an option of {', '.join(others)})"
    else:
        hint = f"; did you mean {near[0]}?" if near else ""
    accepted = f"{command} accepts: {usage.describe()}"
    if spelling == "--seed" and "--set" in usage.options:
        accepted += ", where --set seed=N replaces the seed"
    return f"{command} has no option {spelling}{hint}; {accepted}"


def _check_value(spelling: str, option: Option, value: str) -> None:
    accepted = f"accepted: {spelling} {option.metavar}"
    if not value.strip():
        raise UsageError(f"{spelling}: {value!r} says nothing; {accepted}")
    if "\0" in value:
        raise UsageError(f"{spelling}: {value!r} holds a zero byte; {accepted}")
    if option.is_whole and not re.fullmatch(r"[+-]?[0-9]{1,30}", value):
        raise UsageError(f"{spelling}: {value!r} is no whole number; accepted: a whole number, 0 or more")
    if option.is_number and not _is_number(value):
        raise UsageError(f"{spelling}: {value!r} is no number; {accepted}")


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _check_count(command: str, usage: Usage, given: Sequence[str]) -> None:
    see = f"(see dexplan {command} --help)"
    if len(given) < usage.needed:
        word = usage.words[len(given)]
        cure = WORDS[word]
        raise UsageError(f"{word} is missing; accepted: dexplan {command} {word}, {cure} {see}")
    if len(given) > len(usage.words) and not usage.is_open_ended:
        extra = given[len(usage.words)]
        hint = "; each KEY=VALUE needs its own --set" if "=" in extra and "--set" in usage.options else ""
        words = " ".join(("dexplan", command, *usage.words))
        raise UsageError(f"{extra!r} is one argument too many{hint}; accepted: {words} {see}")
    for place, text in enumerate(given):
        word = usage.words[min(place, len(usage.words) - 1)]
        if not text.strip() or "\0" in text:
            raise UsageError(f"{text!r} is no {word} {see}")
