"""Pictures and films of a run, drawn offscreen in a process of their own.

MuJoCo chooses its GL platform once, when it is imported.  So each attempt is a new process: EGL first, then
OSMesa.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from dexplan.errors import RenderError, RunFolderError
from dexplan.plans.plan import Plan
from dexplan.sim.trace import Trace

BACKENDS = ("egl", "osmesa")
"""GL platforms that need no display, in the order in which they are tried."""
FILMS = (".mp4", ".gif")
STILLS = (".png",)
"""What can be written, by suffix."""
SIZE = (640, 480)
FPS = 30.0
GIF_FPS = 20.0
"""A GIF counts in hundredths of a second; more pictures would not keep the time of the run."""
CAMERA = "overview"

NO_RENDERER = (
    "no offscreen renderer could be started; install EGL with `apt-get install libegl1 libgl1`"
    " or OSMesa with `apt-get install libosmesa6`"
)

Progress = Callable[[float], None]


def render_video(
    trace: Trace,
    plan: Plan | None,
    path: str | os.PathLike[str],
    *,
    size: tuple[int, int] = SIZE,
    fps: float = FPS,
    camera: str = CAMERA,
    progress: Progress | None = None,
) -> Path:
    """Write the film of ``trace`` at the speed of the run, whole or not at all; return its path.

    ``.mp4`` is H.264 in yuv420p, ``.gif`` an animation of at most 20 pictures a second.  Captions come from the plan, without
    one from what the trace carries; marks of goal contacts need the plan.  ``progress`` is called with the share done.
    Raises RenderError where nothing can be drawn on this machine, and for another suffix, an odd size or an unknown camera.
    """
    _check_suffix(Path(path), FILMS)
    with tempfile.TemporaryDirectory(prefix="dexplan-") as folder:
        files = _save_values(trace, plan, Path(folder))
        return _film(*files, Path(path), size, fps, camera, progress)


def render_run(
    folder: str | os.PathLike[str],
    *,
    size: tuple[int, int] = SIZE,
    fps: float = FPS,
    camera: str = CAMERA,
    progress: Progress | None = None,
) -> Path:
    """Write ``video.mp4`` into a run folder, from its trace and its plan if it has one; return its path."""
    folder = Path(folder)
    trace, plan = folder / "trace.npz", folder / "plan.json"
    if not trace.is_file():
        raise RunFolderError(
            str(trace), "there is no such file", "a folder written by `dexplan run` is needed"
        )
    return _film(trace, plan if plan.is_file() else None, folder / "video.mp4", size, fps, camera, progress)


def render_frame(
    trace: Trace,
    time: float,
    path: str | os.PathLike[str],
    *,
    plan: Plan | None = None,
    size: tuple[int, int] = SIZE,
    camera: str = CAMERA,
) -> Path:
    """Write the sample nearest to ``time`` [s] as PNG, with shadows and smooth edges; return its path."""
    target = Path(path)
    _check_suffix(target, STILLS)
    _draw_stills(trace, plan, {target: time}, size, camera)
    return target


def render_frames(
    trace: Trace,
    times: Sequence[float],
    folder: str | os.PathLike[str],
    *,
    plan: Plan | None = None,
    size: tuple[int, int] = SIZE,
    camera: str = CAMERA,
    progress: Progress | None = None,
) -> tuple[Path, ...]:
    """Write the samples at ``times`` [s] to ``folder``, ``frame_001.png`` and so on; return their paths."""
    targets = {Path(folder) / f"frame_{k:03d}.png": time for k, time in enumerate(times, start=1)}
    if targets:
        _draw_stills(trace, plan, targets, size, camera, progress)
    return tuple(targets)


def _draw_stills(
    trace: Trace,
    plan: Plan | None,
    targets: Mapping[Path, float],
    size: tuple[int, int],
    camera: str,
    progress: Progress | None = None,
) -> None:
    partials = {target: _partial(target) for target in targets}
    stills = [{"time": float(t), "path": str(partials[target].absolute())} for target, t in targets.items()]
    try:
        with tempfile.TemporaryDirectory(prefix="dexplan-") as folder:
            files = _save_values(trace, plan, Path(folder))
            _run_job(_build_job(*files, size, camera, stills=stills), progress)
        for target, partial in partials.items():
            partial.replace(target)
    finally:
        for partial in partials.values():
            partial.unlink(missing_ok=True)


def _film(
    trace: Path,
    plan: Path | None,
    target: Path,
    size: tuple[int, int],
    fps: float,
    camera: str,
    progress: Progress | None,
) -> Path:
    if size[0] % 2 or size[1] % 2:
        raise RenderError(
            f"a video of {size[0]}x{size[1]} cannot be encoded; even width and height are accepted"
        )
    container = target.suffix.lower()
    if container == ".gif":
        fps = min(fps, GIF_FPS)
    film = {"fps": fps, "ffmpeg": _find_encoder(), "container": container}
    partial = _partial(target)
    film["video"] = str(partial.absolute())
    try:
        _run_job(_build_job(trace, plan, size, camera, **film), progress)
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)
    return target


def _find_encoder() -> str:
    import imageio_ffmpeg

    try:
        encoder = str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError as error:
        raise RenderError(
            "no video encoder was found; install ffmpeg, or imageio-ffmpeg from a wheel that brings one"
        ) from error
    if shutil.which(encoder) is None:
        raise RenderError(
            f"the video encoder {encoder!r} is no program; unset IMAGEIO_FFMPEG_EXE or let it name an ffmpeg"
        )
    return encoder


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


def _build_job(
    trace: Path, plan: Path | None, size: tuple[int, int], camera: str, **output: object
) -> dict[str, Any]:
    """Return what ``render_process`` has to do; ``output`` is either ``stills`` or a film."""
    return {
        "trace": str(trace.absolute()),
        "plan": None if plan is None else str(plan.absolute()),
        "size": list(size),
        "camera": camera,
        "stills": [],
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
            raise RenderError(said["refused"]["message"])
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
