"""On which machine, with which versions: what decides whether two runs of MuJoCo can be the same bit for bit."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

LONGEST = 80
"""More characters of a foreign text are not repeated."""
DETAILS = {
    "cpu family": "family",
    "model": "model",
    "stepping": "stepping",
    "CPU implementer": "implementer",
    "CPU part": "part",
}
"""Lines of /proc/cpuinfo that tell processors of one name apart, and what they are called here."""


def describe_machine() -> dict[str, str]:
    """Return what of this machine the last bit of a simulation may depend on, as text."""
    return dict(_describe_machine())


@lru_cache
def _describe_machine() -> tuple[tuple[str, str], ...]:
    return (
        ("processor", _read_processor()),
        ("architecture", platform.machine()),
        ("system", platform.system()),
        # Its sines and roots pick instructions by processor and release.
        ("c_library", " ".join(platform.libc_ver()).strip()),
    )


def _read_processor() -> str:
    """Return the processor's name, with family, model and stepping where the system tells: names of servers are coarse."""
    found: dict[str, str] = {}
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            key, _, value = line.partition(":")
            if key.strip() in found:
                break  # the next core
            found[key.strip()] = " ".join(value.split())
    except OSError:
        pass  # not a Linux
    name = found.get("model name") or platform.processor() or platform.machine()
    details = [f"{key} {found[word]}" for word, key in DETAILS.items() if found.get(word)]
    return f"{name} ({', '.join(details)})" if details else name


def describe_versions(*names: str) -> dict[str, str]:
    """Return the versions of Python and of installed packages."""
    return {"python": platform.python_version(), **{name: _find_version(name) for name in names}}


def find_differences(meta: Mapping[str, Any]) -> tuple[str, ...]:
    """Return in what the machine that recorded a run differs from this one, empty for the same machine.

    Only what can change a bit of MuJoCo's counts.  What the record does not say is taken to be the same, so that saying
    nothing gains nothing: the replay then has to match.
    """
    pairs = [("MuJoCo", _look_up(meta, "versions", "mujoco"), _find_version("mujoco"))]
    pairs += [
        (key.replace("_", " "), _look_up(meta, "machine", key), here)
        for key, here in describe_machine().items()
    ]
    return tuple(
        f"{what} {_quote(there)}, here {_quote(here)}"
        for what, there, here in pairs
        if there is not None and there != here
    )


def _look_up(meta: Mapping[str, Any], table: str, key: str) -> Any:
    values = meta.get(table)
    return values.get(key) if isinstance(values, Mapping) else None


def _quote(value: Any) -> str:
    """Return a foreign value as a short printable text, so that it cannot pretend to be lines of ours."""
    text = ascii(str(value))
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def _find_version(name: str) -> str:
    """Return the installed version of a package."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"
