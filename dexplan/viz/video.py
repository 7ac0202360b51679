"""Pictures and films of a run, drawn offscreen in a process of their own.

MuJoCo chooses its GL platform once, when it is imported.  So each attempt is a new process: EGL first, then
OSMesa.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from dexplan.errors import RenderError, RunFolderError
from dexplan.plans.plan import Plan
from dexplan.sim.trace import Trace
from dexplan.viz.encoder import GIF, find_encoder
from dexplan.viz.film import GIF_FPS, Film, FilmOptionError, FilmOptions, count_pictures

BACKENDS = ("egl", "osmesa")
"""GL platforms that need no display, in the order in which they are tried."""
FILMS = (".mp4", ".gif")
STILLS = (".png",)
"""What can be written, by suffix."""
STILL = FilmOptions(quality="fine")
"""Stills can afford shadows."""

NO_RENDERER = (
    "no offscreen renderer could be started; install EGL with `apt-get install libegl1 libgl1`"
    " or OSMesa with `apt-get install libosmesa6`"
)

Progress = Callable[[float], None]


def render_video(
    trace: Trace,
    plan: Plan | None,
    path: str | os.PathLike[str],
    options: FilmOptions | None = None,
    *,
    progress: Progress | None = None,
) -> Film:
    """Write the film of ``trace``, whole or not at all; return it.

    ``.mp4`` is H.264 in yuv420p, ``.gif`` an animation of at most 20 pictures a second.  Words and goals come from the plan,
    without one from what the trace carries.  ``progress`` is called with the share done.
    Raises RenderError where nothing can be drawn on this machine, and for another suffix; FilmOptionError for a size that
    cannot be encoded, and for an unknown camera.
    """
    target = Path(path)
    _check_suffix(target, FILMS)
    options = _fit(options or FilmOptions(), target)
    with tempfile.TemporaryDirectory(prefix="dexplan-") as folder:
        files = _save_values(trace, plan, Path(folder))
        return _film(trace, *files, target, options, progress)


def render_run(
    folder: str | os.PathLike[str],
    options: FilmOptions | None = None,
    *,
    path: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> Film:
    """Film a run folder, from its trace and its plan if it has one, into its ``video.mp4`` or ``path``; return the film."""
    folder = Path(folder)
    source, plan = folder / "trace.npz", folder / "plan.json"
    if not source.is_file():
        raise RunFolderError(
            str(source), "there is no such file", "a folder written by `dexplan run` is needed"
        )
    target = folder / "video.mp4" if path is None else Path(path)
    _check_suffix(target, FILMS)
    options = _fit(options or FilmOptions(), target)
    trace = Trace.load(source)
    return _film(trace, source, plan if plan.is_file() else None, target, options, progress)


def render_frame(
    trace: Trace,
    time: float,
    path: str | os.PathLike[str],
    *,
    plan: Plan | None = None,
    options: FilmOptions | None = None,
) -> Path:
    """Write the sample nearest to ``time`` [s] as PNG, with shadows and smooth edges; return its path."""
    target = Path(path)
    _check_suffix(target, STILLS)
    _draw_stills(trace, plan, {target: time}, options or STILL)
    return target


def render_frames(
    trace: Trace,
    times: Sequence[float],
    folder: str | os.PathLike[str],
    *,
    plan: Plan | None = None,
    options: FilmOptions | None = None,
    progress: Progress | None = None,
) -> tuple[Path, ...]:
    """Write the samples at ``times`` [s] to ``folder``, ``frame_001.png`` and so on; return their paths."""
    targets = {Path(folder) / f"frame_{k:03d}.png": time for k, time in enumerate(times, start=1)}
    if targets:
        _draw_stills(trace, plan, targets, options or STILL, progress)
    return tuple(targets)


def _draw_stills(
    trace: Trace,
    plan: Plan | None,
    targets: Mapping[Path, float],
    options: FilmOptions,
    progress: Progress | None = None,
) -> None:
    partials = {target: _partial(target) for target in targets}
    stills = [{"time": float(t), "path": str(partials[target].absolute())} for target, t in targets.items()]
    try:
        with tempfile.TemporaryDirectory(prefix="dexplan-") as folder:
            files = _save_values(trace, plan, Path(folder))
            _run_job(_build_job(*files, options, stills=stills), progress)
        for target, partial in partials.items():
            partial.replace(target)
    finally:
        for partial in partials.values():
            partial.unlink(missing_ok=True)


def _fit(options: FilmOptions, target: Path) -> FilmOptions:
    """Return options that the container of ``target`` can hold."""
    width, height = options.size
    if width % 2 or height % 2:
        raise FilmOptionError(
            f"a video of {width}x{height} cannot be encoded; even width and height are accepted"
        )
    is_gif = target.suffix.lower() == GIF
    return replace(options, fps=min(options.fps, GIF_FPS)) if is_gif else options


def _film(
    trace: Trace,
    source: Path,
    plan: Path | None,
    target: Path,
    options: FilmOptions,
    progress: Progress | None,
) -> Film:
    partial = _partial(target)
    film = {
        "ffmpeg": find_encoder(),
        "path": str(partial.absolute()),
        "container": target.suffix.lower(),
    }
    try:
        _run_job(_build_job(source, plan, options, film=film), progress)
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)
    return Film(target, options.size, count_pictures(trace, options) / options.fps, options.fps)


def _check_suffix(path: Path, accepted: tuple[str, ...]) -> None:
    if path.suffix.lower() not in accepted:
        fact = f"has the suffix {path.suffix!r}" if path.suffix else "has no suffix"
        raise RenderError(f"{str(path)!r} {fact}; accepted: {' or '.join(accepted)}")


def _partial(target: Path) -> Path:
    """Return the name under which ``target`` is written until it is complete; makes its folder."""
    target.parent.mkdir(parents=True, exist_ok=True)
    return target.with_name(f".{target.name}.{os.getpid()}.partial")


def _save_values(trace: Trace, plan: Plan | None, folder: Path) -> tuple[Path, Path | None]:
    trace_path = trace.save(folder / "trace.npz")
    if plan is None:
        return trace_path, None
    plan.save(folder / "plan.json")
    return trace_path, folder / "plan.json"


def _build_job(trace: Path, plan: Path | None, options: FilmOptions, **output: object) -> dict[str, Any]:
    """Return what ``render_process`` has to do; ``output`` is either ``stills`` or a ``film``."""
    return {
        "trace": str(trace.absolute()),
        "plan": None if plan is None else str(plan.absolute()),
        "options": asdict(options),
        "stills": [],
        "film": None,
        **output,
    }


def _run_job(job: Mapping[str, Any], progress: Progress | None) -> None:
    """Have a process do ``job`` on the first GL platform that starts; raise what it could not do."""
    facts = []
    for backend in BACKENDS:
        fact = _attempt(job, backend, progress)
        if fact is None:
            return
        facts.append(f"{backend}: {fact}")
    error = RenderError(NO_RENDERER)
    for fact in facts:
        error.add_note(fact)
    raise error


def _attempt(job: Mapping[str, Any], backend: str, progress: Progress | None) -> str | None:
    """Do ``job`` on one GL platform; return None when done, the reason where the platform does not start."""
    package_home = str(Path(__file__).resolve().parents[2])
    search = os.pathsep.join(filter(None, [package_home, os.environ.get("PYTHONPATH")]))
    environment = {**os.environ, "MUJOCO_GL": backend, "PYOPENGL_PLATFORM": backend, "PYTHONPATH": search}
    # What the process says is read as UTF-8, and it draws with a canvas that needs no window, whatever is set here.
    environment |= {"PYTHONIOENCODING": "utf-8", "MPLBACKEND": "agg"}
    # Its own folder as working directory, because MuJoCo writes its log where it stands.
    with tempfile.TemporaryDirectory(prefix="dexplan-") as folder, tempfile.TemporaryFile() as complaints:
        job_path = Path(folder) / "job.json"
        job_path.write_text(json.dumps(job), encoding="utf-8")
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "dexplan.viz.render_process", str(job_path)],
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=complaints,
            text=True,
            encoding="utf-8",
        )
        said: dict[str, Any] = {}
        try:
            assert process.stdout is not None
            for line in process.stdout:
                message = _read_message(line)
                said[message.get("event", "")] = message
                if progress is not None and "share" in message:
                    progress(message["share"])
            code = process.wait()
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
            if process.stdout is not None:
                process.stdout.close()
        if code == 0:
            return None
        if "no_renderer" in said:
            return str(said["no_renderer"]["fact"])
        if "refused" in said:
            kind = RenderError if said["refused"]["kind"] == RenderError.__name__ else FilmOptionError
            raise kind(said["refused"]["message"])
        complaints.seek(0)
        complaint = complaints.read().decode(errors="replace").strip()
    if "ready" not in said and code < 0:
        return f"the process ended by signal {-code}"
    raise RuntimeError(f"the drawing process ended with code {code}\n{complaint}")


def _read_message(line: str) -> dict[str, Any]:
    """Return one line of the process as data; {} for a line that some library printed."""
    try:
        message = json.loads(line)
    except ValueError:
        return {}
    return message if isinstance(message, dict) else {}
