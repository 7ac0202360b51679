"""The command line: from arguments to a command, from what it raises to an exit code.

0 the physics confirms the plan; 1 an honest no; 2 the input cannot be read, or the output not be written (one line on stderr); 70
a defect of ours (traceback); 130 interrupted, 143 terminated (128 and the signal's number); 141 the reader of stdout went away.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
import traceback
from collections.abc import Sequence

import tyro

from dexplan.arguments import COMMANDS, Command, Speaking
from dexplan.commands.voice import Voice, speaking
from dexplan.errors import DexplanError
from dexplan.terminal import (
    Terminated,
    describe_refusal,
    ending_on_signals,
    make_printable,
    prepare_environment,
)
from dexplan.usage import UsageError, check_usage

BAD_INPUT, DEFECT, INTERRUPTED, BROKEN_PIPE = 2, 70, 130, 141
SIGNALLED = 128
"""Added to the number of the signal that ended the process."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line (``sys.argv`` by default) and return its exit code."""
    make_printable()
    try:
        with ending_on_signals():
            prepare_environment()
            code = _run(sys.argv[1:] if argv is None else list(argv))
            sys.stdout.flush()
        return code
    except DexplanError as error:
        # A note says what was kept of a run that the error cut short.
        return _complain("; ".join([str(error), *getattr(error, "__notes__", [])]), BAD_INPUT)
    except KeyboardInterrupt as error:
        told = [
            "terminated" if isinstance(error, Terminated) else "interrupted",
            *getattr(error, "__notes__", []),
        ]
        code = SIGNALLED + error.signum if isinstance(error, Terminated) else INTERRUPTED
        return _complain("; ".join(told), code)
    except BrokenPipeError:
        _drop_output()
        return BROKEN_PIPE
    except OSError as error:
        sentence = describe_refusal(error)
        if sentence is None:
            traceback.print_exc()
            return DEFECT
        if error.filename is None:
            # It may have been stdout itself, which Python would flush once more.
            _drop_output()
        return _complain(sentence, BAD_INPUT)
    except Exception:
        traceback.print_exc()
        return DEFECT


def _complain(text: str, code: int) -> int:
    """Say in one line on stderr what was wrong, and return the exit code."""
    with contextlib.suppress(OSError):
        print(f"dexplan: {' '.join(text.split())}", file=sys.stderr)
    return code


def _drop_output() -> None:
    """Let what Python flushes at its exit go nowhere: there is nobody to read it."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _run(argv: list[str]) -> int:
    if argv == ["--version"]:
        from dexplan import __version__

        print(f"dexplan {__version__}")
        return 0
    command = _parse([*argv[1:], "--help"] if argv[:1] == ["help"] else argv)
    if command is None:
        return 0
    with speaking(_choose_voice(command)):
        return int(command.run())


def _choose_voice(command: Command) -> Voice:
    """Return how much ``command`` was asked to say."""
    if not isinstance(command, Speaking):
        return Voice.NORMAL
    if command.verbose and command.quiet:
        raise UsageError("--verbose and --quiet contradict each other; accepted: one of the two")
    if command.verbose:
        return Voice.VERBOSE
    return Voice.QUIET if command.quiet else Voice.NORMAL


def _parse(argv: list[str]) -> Command | None:
    """Return the command in ``argv``, None when help was asked for and given.

    What can be wrong is looked for first, for tyro draws its complaints in a box that suggests other commands' options.
    """
    if not {"-h", "--help"} & set(argv):
        check_usage(argv, COMMANDS)
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            return tyro.cli(
                Command,
                prog="dexplan",
                description="Dexterous manipulation by rolling and finger gaiting, judged by MuJoCo.",
                args=argv,
            )
    except SystemExit as exit_:
        if not exit_.code:
            return None
    raise UsageError(f"the arguments {' '.join(argv)!r} cannot be read (see dexplan --help)")


if __name__ == "__main__":
    raise SystemExit(main())
