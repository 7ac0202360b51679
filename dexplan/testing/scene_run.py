"""What a user says of a foreign scene on the command line; nothing is loaded here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class SceneRun:
    """Which scene is run, and how.

    ``scene`` is a file (``dexplan stability`` also takes a run folder), ``state`` the name of a keyframe, ``ctrl`` a file of
    controls; without it the keyframe's controls are held for ``seconds``.  ``object`` and ``tips`` are names of bodies or
    geoms.
    """

    scene: Path
    state: str | None = None
    ctrl: Path | None = None
    object: str | None = None
    tips: tuple[str, ...] = ()
    seconds: float = 2.0
