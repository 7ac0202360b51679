"""README and ``docs/``: which code blocks a page has, and how they are run; read by ``test_docs.py`` and ``scripts/docs``.

A fenced block says its language.  ``python`` is run, all blocks of a page in one namespace; a ``text`` block right after it is
what it prints.  ``console`` holds commands after ``$ `` and what they print; ``toml`` is a problem file, or tables of one.  A
block whose first line names a file (``# turn.toml``, ``# test_pinch.py``) is saved under that name for the commands after it.
``text`` alone is not run.

What a block needs beyond that stands in a comment before it:

``<!-- slow: why -->``           ``scripts/docs --slow`` runs it, in a copy of the repository, instead of the tests
``<!-- needs: a.toml b.xml -->`` these files of ``examples/`` have to be there
``<!-- in: runs/turn -->``       it runs in this folder
``<!-- exit: 1 -->``             the block's last command ends with this code; ``any``: it depends on the machine
``<!-- setup`` lines ``-->``     Python that is run and not shown
"""

from __future__ import annotations

import contextlib
import doctest
import fcntl
import hashlib
import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
RUN = ("python", "console", "toml", "setup")
LANGUAGES = (*RUN, "text", "json", "xml")
LOOSE = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
"""``...`` stands for anything, line breaks included, and runs of white space are equal."""
COMMENT = re.compile(r"<!-- (slow|needs|exit|in): (.*?) -->")
FILE = re.compile(r"# ([\w-]+\.(?:toml|py))")


@dataclass(frozen=True)
class Block:
    """One code block of a page: where its text begins, what it is, what it prints, and what the comment before it says."""

    page: Path
    line: int
    language: str
    text: str
    says: Mapping[str, str] = field(default_factory=dict)
    output: str | None = None

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT).as_posix()}:{self.line}"

    @property
    def is_slow(self) -> bool:
        """Whether the tests leave it to ``scripts/docs --slow``."""
        return "slow" in self.says

    @property
    def file(self) -> str | None:
        """Name of the file that the block shows, where its first line says one."""
        found = FILE.fullmatch(self.text.partition("\n")[0])
        return found[1] if found else None


def read_blocks(page: Path) -> list[Block]:
    """Return the blocks of a page in their order."""
    blocks: list[Block] = []
    says: dict[str, str] = {}
    lines = iter(enumerate(page.read_text(encoding="utf-8").splitlines(), start=1))
    is_beside = False
    for number, line in lines:
        if line.startswith("```"):
            language = line.removeprefix("```").strip()
            text = "".join(f"{inside}\n" for _, inside in _until(lines, "```"))
            if language == "text" and is_beside and blocks[-1].language == "python":
                last = blocks.pop()
                blocks.append(Block(page, last.line, "python", last.text, last.says, text))
            else:
                blocks.append(Block(page, number + 1, language, text, says))
            says, is_beside = {}, True
        elif line == "<!-- setup":
            blocks.append(
                Block(page, number + 1, "setup", "".join(f"{x}\n" for _, x in _until(lines, "-->")))
            )
        elif found := COMMENT.fullmatch(line):
            says = {**says, found[1]: found[2]}
        elif line.strip() and line != "<!-- end -->":
            says, is_beside = {}, False
    return blocks


def _until(lines: Iterator[tuple[int, str]], end: str) -> Iterator[tuple[int, str]]:
    for number, line in lines:
        if line == end:
            return
        yield number, line
    raise AssertionError(f"no {end!r} before the end of the page")


@dataclass
class Reader:
    """Does what a reader of one page does: block after block, in a folder of its own.

    Runs are kept in ``kept``, for all readers: the same command on the same files is carried out once.
    """

    folder: Path
    kept: Path
    namespace: dict[str, Any] = field(default_factory=lambda: {"__name__": "__main__"})

    def run(self, block: Block) -> None:
        """Run a block that is not slow; AssertionError where it does not do what the page says."""
        for name in block.says.get("needs", "").split():
            shutil.copy(EXAMPLES / name, self.folder)
        if block.file:
            (self.folder / block.file).write_text(block.text, encoding="utf-8")
        with contextlib.chdir(self.folder / block.says.get("in", "")):
            if block.language == "toml":
                check_toml(block)
            elif block.language == "console":
                self._run_console(block)
            elif block.language in ("python", "setup") and not (block.file or "").startswith("test_"):
                self._run_python(block)

    def _run_python(self, block: Block) -> None:
        printed = io.StringIO()
        # Tracebacks name the page and its line.
        code = compile("\n" * (block.line - 1) + block.text, str(block.page), "exec")
        with contextlib.redirect_stdout(printed):
            exec(code, self.namespace)
        if block.language == "python":
            compare(block, block.output or "", printed.getvalue())

    def _run_console(self, block: Block) -> None:
        steps = read_console(block)
        for k, (command, wanted) in enumerate(steps):
            code, printed = self._run_command(command)
            expected = block.says.get("exit", "0") if k == len(steps) - 1 else "0"
            assert expected in (str(code), "any"), (
                f"{block}: `{command}` ends with {code}, not {expected}\n{printed}"
            )
            if wanted:
                compare(block, wanted, printed)

    def _run_command(self, command: str) -> tuple[int, str]:
        """Return the exit code and all that was printed."""
        program, *words = shlex.split(command)
        if program == "dexplan":
            return self._run_kept(words) if words[0] == "run" else run_dexplan(words)
        if program not in ("python", "pytest"):
            raise AssertionError(f"{command!r}: tests run dexplan, python and pytest; mark the block slow")
        module = ["-m", "pytest", "-p", "no:cacheprovider"] if program == "pytest" else []
        if module and not any(entry.name == "dexplan" for entry in entry_points(group="pytest11")):
            module += ["-p", "dexplan.testing.plugin"]
        # Where this dexplan is: a checkout need not be the installed one.
        paths = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
        done = subprocess.run(
            [sys.executable, *module, *words],
            env={**os.environ, "PYTHONPATH": paths},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        return done.returncode, done.stdout

    def _run_kept(self, words: list[str]) -> tuple[int, str]:
        """Run ``dexplan run``, or take what it printed and wrote from the first time."""
        # A controller is named as FILE.py:NAME.
        given = [path for word in words if (path := Path(word.partition(":")[0])).is_file()]
        digest = hashlib.sha256(repr(words).encode())
        for path in given:
            digest.update(path.read_bytes())
        home = self.kept / digest.hexdigest()[:16]
        self.kept.mkdir(parents=True, exist_ok=True)
        with (self.kept / f"{home.name}.lock").open("w") as lock:
            # Tests of other pages may run in other processes.
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not (home / "answer.json").is_file():
                shutil.rmtree(home, ignore_errors=True)
                home.mkdir()
                for path in given:
                    shutil.copy(path, home)
                with contextlib.chdir(home):
                    answer = run_dexplan(words)
                (home / "answer.json").write_text(json.dumps(answer), encoding="utf-8")
        shutil.copytree(home, self.folder, dirs_exist_ok=True, ignore=lambda *_: {"answer.json"})
        code, printed = json.loads((home / "answer.json").read_text(encoding="utf-8"))
        return code, printed


def run_dexplan(words: list[str]) -> tuple[int, str]:
    """Run a dexplan command in this process; return its exit code and all that it printed."""
    from dexplan.cli import main

    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        code = main(words)
    return code, printed.getvalue()


def read_console(block: Block) -> list[tuple[str, str]]:
    """Return the commands of a console block, each with what it prints as the page says."""
    steps: list[tuple[str, str]] = []
    for line in block.text.replace("\\\n", "").splitlines():
        if line.startswith("$ "):
            steps.append((line[2:], ""))
        else:
            assert steps, f"{block}: a console block begins with a command, '$ ...'"
            steps[-1] = (steps[-1][0], f"{steps[-1][1]}{line}\n")
    return steps


def compare(block: Block, wanted: str, printed: str) -> None:
    """AssertionError with a difference where ``printed`` is not what the page shows."""
    checker = doctest.OutputChecker()
    if not checker.check_output(wanted, printed, LOOSE):
        shown = checker.output_difference(doctest.Example("", wanted), printed, doctest.REPORT_NDIFF)
        raise AssertionError(f"{block}: it prints something else\n{shown}")


def check_toml(block: Block) -> None:
    """Read a block as a problem file; tables that are shown alone are completed with what a file has to have."""
    from dexplan.problems.read import load_problem

    if "format" in tomllib.loads(block.text):
        text = block.text
    else:
        has_goal = re.search(r"^\[goal", block.text, re.MULTILINE)
        goal = "" if has_goal else "\n[goal]\ntranslation_m = [0.0, 0.0, 0.0]\n"
        text = f"format = 1\n{block.text}{goal}"
    path = Path(block.file or "shown.toml")
    path.write_text(text, encoding="utf-8")
    load_problem(str(path))
