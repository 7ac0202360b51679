"""What stands between us and the terminal: text that survives any encoding, an environment that libraries accept, signals.

Nothing here imports a library, so the command line can call it before anything else loads.
"""

from __future__ import annotations

import codecs
import errno
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from dexplan.errors import DexplanError

PLAINER = {
    "°": " deg",
    "µ": "u",
    "μ": "u",
    "γ": "gamma",
    "–": "-",
    "—": "-",
    "−": "-",
    "·": "|",
    "…": "...",
    "×": "x",
    "±": "+-",
    "²": "^2",
    "³": "^3",
    "→": "->",
    "≥": ">=",
    "≤": "<=",
    "│": "|",
    "─": "-",
    **dict.fromkeys("╭╮╰╯├┤┬┴┼", "+"),
}
"""What a sign is written as where the terminal's encoding lacks it; any other becomes its escape."""

GL_PLATFORMS = ("egl", "glfw", "osmesa")
"""What MuJoCo and dm_control both take in MUJOCO_GL, empty and unset aside."""
GL_OFF = ("disable", "disabled", "off", "false", "0")
GL_ON = ("enable", "enabled", "on", "true", "1", "glx", "wgl")

REFUSALS_OF_THE_SYSTEM = frozenset(
    {
        errno.ENOSPC,
        errno.EDQUOT,
        errno.EFBIG,
        errno.EROFS,
        errno.EACCES,
        errno.EPERM,
        errno.EIO,
        errno.ENAMETOOLONG,
        errno.ELOOP,
        errno.EMFILE,
        errno.ENFILE,
        errno.ENOMEM,
        errno.ENODEV,
        errno.ENXIO,
        errno.ESTALE,
    }
)
"""What an operating system says when something outside of this program has to be mended: disks, rights, devices."""


class Terminated(KeyboardInterrupt):
    """A signal asked the process to end, as Ctrl-C does; ``signum`` says which."""

    def __init__(self, signum: int) -> None:
        super().__init__(signal.Signals(signum).name)
        self.signum = signum


def make_printable() -> None:
    """Let stdout and stderr take every text, whatever their encoding; what they lack is written in plainer signs."""
    codecs.register_error("dexplan.plainer", _write_plainer)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            # Closed by whoever started us: what is said goes nowhere.
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 - as long as the process
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="dexplan.plainer")


def _write_plainer(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    plainer = []
    for sign in error.object[error.start : error.end]:
        text = PLAINER.get(sign, sign)
        plainer.append(text.encode("ascii", "backslashreplace").decode("ascii"))
    return "".join(plainer), error.end


def prepare_environment() -> None:
    """Set what libraries read while they load, and refuse what they would choke on.

    Nothing is drawn in this process: pictures of the world come from one that is started with a GL platform of its own, plots
    from matplotlib's canvas without a window.  So neither needs a window system here, nor may a missing one stop a run.  Raises
    DexplanError for a GL platform that does not exist.
    """
    # The matrices here are small: threads of the linear-algebra library only get in each other's way.  Set before numpy loads.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    check_gl_platform()
    os.environ["MUJOCO_GL"] = "off"
    os.environ["MPLBACKEND"] = "agg"


def check_gl_platform() -> None:
    """Raise DexplanError where MUJOCO_GL names a GL platform that does not exist."""
    asked = os.environ.get("MUJOCO_GL", "")
    if asked.strip().lower() not in ("", *GL_PLATFORMS, *GL_OFF, *GL_ON):
        raise DexplanError(
            f"MUJOCO_GL={asked!r} is no GL platform; accepted: {', '.join(GL_PLATFORMS)}, or none:"
            " unset MUJOCO_GL, dexplan finds one by itself"
        )


def describe_refusal(error: OSError) -> str | None:
    """Return what the operating system refused, as a sentence with its cure; None for anything that may be a defect of ours."""
    if error.errno not in REFUSALS_OF_THE_SYSTEM:
        return None
    subject = "output" if error.filename is None else repr(os.fspath(error.filename))
    cure = {
        errno.ENOSPC: "free some space on that disk, or choose another with --out",
        errno.EDQUOT: "free some of your quota, or choose another disk with --out",
        errno.EFBIG: "raise the limit on file sizes, or choose another disk with --out",
    }.get(error.errno or 0, "accepted: a place that can be read and written")
    return f"{subject} cannot be read or written ({error.strerror or os.strerror(error.errno or 0)}); {cure}"


@contextmanager
def ending_on_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the work as Ctrl-C does: by an exception, so that what was made so far is kept."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    names = [s for s in ("SIGTERM", "SIGHUP") if hasattr(signal, s)]
    before = {getattr(signal, name): signal.getsignal(getattr(signal, name)) for name in names}
    for signum, handler in before.items():
        # Whoever asked for signals to be ignored (nohup) meant it.
        if handler == signal.SIG_DFL:
            signal.signal(signum, _end)
    try:
        yield
    finally:
        for signum, handler in before.items():
            if handler == signal.SIG_DFL:
                signal.signal(signum, handler)


def _end(signum: int, frame: FrameType | None) -> None:
    raise Terminated(signum)
