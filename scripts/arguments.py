"""Arguments of the scripts: ``--help`` with the script's docstring, wrong input in one line on stderr and exit code 2."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable
from typing import NoReturn

from dexplan.errors import DexplanError
from dexplan.terminal import describe_refusal

BAD_INPUT, INTERRUPTED, BROKEN_PIPE = 2, 130, 141


class Arguments(argparse.ArgumentParser):
    """A parser that shows the docstring as it is written and complains in one line."""

    def __init__(self, description: str | None) -> None:
        super().__init__(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)

    def error(self, message: str) -> NoReturn:
        """Say what was wrong and where to read on, and exit."""
        self.exit(BAD_INPUT, f"{self.prog}: {' '.join(message.split())} (see {self.prog} --help)\n")


def whole(least: int) -> Callable[[str], int]:
    """Return what reads a whole number of ``least`` or more."""

    def read(text: str) -> int:
        try:
            number = int(text)
        except ValueError:
            number = None
        if number is None or number < least:
            raise argparse.ArgumentTypeError(
                f"{text!r} is refused; accepted: a whole number, {least} or more"
            )
        return number

    return read


def positive(text: str) -> float:
    """Read a finite number above 0."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not (math.isfinite(number) and number > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r} is refused; accepted: a number above 0")
    return number


def run_script(main: Callable[[], int | None]) -> NoReturn:
    """Run a script's ``main`` and exit with its code; what its caller can mend is told in one line, exit code 2."""
    name = os.path.basename(sys.argv[0])
    try:
        sys.exit(main())
    except DexplanError as error:
        print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(BAD_INPUT)
    except BrokenPipeError:
        # Whoever read the output went away; what Python flushes at its exit goes nowhere.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(BROKEN_PIPE)
    except OSError as error:
        sentence = describe_refusal(error)
        if sentence is None:
            raise
        print(f"{name}: {sentence}", file=sys.stderr)
        sys.exit(BAD_INPUT)
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
