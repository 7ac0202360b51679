"""The process that draws.  ``video.py`` starts it with MUJOCO_GL set, and a JSON file tells it its job.

It answers in JSON lines on stdout: ``{"event": "ready"}`` once a renderer runs, ``{"event": "no_renderer",
"fact": ..}`` where none starts, ``{"event": "refused", "message": ..}`` for a job that cannot be done, and
``{"event": "progress", "share": ..}`` meanwhile.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dexplan.errors import DexplanError, RenderError, UnknownNameError
from dexplan.plans.plan import Plan
from dexplan.sim.trace import Trace
from dexplan.spatial import Array, make_pose
from dexplan.viz.canvas import SOFTWARE
from dexplan.viz.palette import as_rgb, get_finger_color
from dexplan.viz.timeline import (
    choose_axis,
    compute_turned_angle,
    describe_action,
    read_caption,
    read_finger_names,
)

try:
    import mujoco

    from dexplan.viz import overlay

    _no_mujoco: str | None = None
except Exception as error:
    # MuJoCo loads its GL platform while it is imported, and reports a missing one in many ways.
    _no_mujoco = f"{type(error).__name__}: {error}"

Picture = NDArray[np.uint8]

STILL_SAMPLES = 4
STILL_SHADOW = 2048
"""Stills can afford smooth edges and shadows; in a film they would take three quarters of the time."""


class SceneRenderer:
    """Draws samples of one trace, offscreen, from one camera."""

    def __init__(
        self, trace: Trace, plan: Plan | None, size: tuple[int, int], camera: str, is_still: bool
    ) -> None:
        self._trace, self._plan, self._size = trace, plan, size
        missing = [name for name in ("time", "qpos") if name not in trace]
        if missing:
            raise RenderError(f"the trace lacks {' and '.join(missing)}; a trace of a run is needed")
        self._names = read_finger_names(trace)
        self._model = model = mujoco.MjModel.from_xml_string(trace.model_xml)
        cameras = [model.camera(k).name for k in range(model.ncam)]
        if camera not in cameras:
            raise UnknownNameError("camera", camera, cameras)
        _paint_tips(model, self._names)
        join_tips(model, self._names)
        width, height = size
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        model.vis.quality.offsamples = STILL_SAMPLES if is_still else 0
        model.vis.quality.shadowsize = STILL_SHADOW if is_still else 0
        self._data = mujoco.MjData(model)
        self._object = model.joint("object/free/")
        self._poses = _fill_poses(trace["qpos"])
        address = int(self._object.qposadr[0])
        turned = compute_turned_angle(self._poses[:, address : address + 7], choose_axis(plan, trace))
        self._turned_deg = np.degrees(turned)
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = model.camera(camera).id
        self._option = mujoco.MjvOption()
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + 200)
        self._arrows = mujoco.MjvScene(model, maxgeom=64)
        for scene in (self._scene, self._arrows):
            scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = is_still and scene is self._scene
            scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._arrows.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = False
        self._rect = mujoco.MjrRect(0, 0, width, height)
        self._picture = np.zeros((height, width, 3), dtype=np.uint8)
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)

    def __enter__(self) -> SceneRenderer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._context.free()

    def draw(self, time: float) -> Picture:
        """Return the picture (H, W, 3) of the sample nearest to ``time`` [s], arrows, goals and texts included."""
        sample = _find_nearest(self._trace["time"], time)
        data = self._data
        data.qpos[:] = self._poses[sample]
        # All that a picture needs; forces come from the trace and are not computed again.
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        mujoco.mj_camlight(self._model, data)
        catalogue = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(
            self._model, data, self._option, None, self._camera, catalogue.value, self._scene
        )
        self._add_arrows(self._scene, sample)
        if self._plan is not None:
            overlay.add_goal_marks(self._scene, self._find_object(), self._plan)
        picture = self._render(self._scene)
        self._arrows.ngeom = self._arrows.nlight = 0
        self._add_arrows(self._arrows, sample)
        if self._arrows.ngeom:
            mujoco.mjv_updateCamera(self._model, data, self._camera, self._arrows)
            overlay.blend_hidden(picture, self._render(self._arrows))
        overlay.draw_legend(picture, self._names)
        overlay.draw_caption(picture, self._describe(sample), self._measure(sample))
        return picture

    def _add_arrows(self, scene: Any, sample: int) -> None:
        names = ("contact_point_O", "contact_rotation_O", "contact_force")
        if all(name in self._trace for name in names):
            overlay.add_force_arrows(
                scene, self._find_object(), *(self._trace[name][sample] for name in names)
            )

    def _find_object(self) -> Array:
        body = int(self._model.jnt_bodyid[self._object.id])
        return make_pose(self._data.xmat[body].reshape(3, 3), self._data.xpos[body])

    def _render(self, scene: Any) -> Picture:
        mujoco.mjr_render(self._rect, scene, self._context)
        mujoco.mjr_readPixels(self._picture, None, self._rect, self._context)
        return self._picture[::-1].copy()

    def _describe(self, sample: int) -> str:
        if "action_index" not in self._trace:
            return ""
        action = int(self._trace["action_index"][sample])
        phase = int(self._trace["phase_index"][sample]) if "phase_index" in self._trace else 0
        if self._plan is not None:
            return describe_action(self._plan, action, phase)
        return read_caption(self._trace, action, phase)

    def _measure(self, sample: int) -> str:
        # Adding zero turns -0 into 0.
        turned = round(float(self._turned_deg[sample])) + 0
        return f"turned {turned:+d}°   {self._trace['time'][sample]:.1f} s"


def main(job_path: str) -> int:
    """Do the job; return the exit code."""
    job = json.loads(Path(job_path).read_text(encoding="utf-8"))
    if _no_mujoco is not None:
        _say(event="no_renderer", fact=_no_mujoco)
        return 1
    width, height = job["size"]
    try:
        window = mujoco.GLContext(width, height)
        window.make_current()
        # The first call that needs the GL functions themselves.
        mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 100).free()
    except Exception as error:
        _say(event="no_renderer", fact=f"{type(error).__name__}: {error}")
        return 1
    _say(event="ready")
    try:
        _work(job, (width, height))
    except DexplanError as error:
        _say(event="refused", message=str(error))
        return 1
    finally:
        window.free()
    return 0


def _work(job: Mapping[str, Any], size: tuple[int, int]) -> None:
    trace = Trace.load(job["trace"])
    plan = None if job["plan"] is None else Plan.load(job["plan"])
    stills = job["stills"]
    with SceneRenderer(trace, plan, size, job["camera"], is_still=bool(stills)) as renderer:
        if stills:
            from matplotlib.image import imsave

            for k, still in enumerate(stills):
                imsave(
                    still["path"], renderer.draw(still["time"]), format="png", metadata={"Software": SOFTWARE}
                )
                _say(event="progress", share=(k + 1) / len(stills))
        else:
            _film(renderer, trace, job, size)


def _film(renderer: SceneRenderer, trace: Trace, job: Mapping[str, Any], size: tuple[int, int]) -> None:
    """Draw the run in real time and hand each picture to the encoder."""
    fps, time = job["fps"], trace["time"]
    count = max(1, round(float(time[-1] - time[0]) * fps))
    is_gif = job["container"] == ".gif"
    # The process stands in a folder of its own, which is removed with all that is in it.
    film = "film.mp4" if is_gif else job["video"]
    with tempfile.TemporaryFile() as complaints:
        encoder = subprocess.Popen(
            _encoder_command(job["ffmpeg"], size, fps, film),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=complaints,
        )
        assert encoder.stdin is not None
        try:
            for k in range(count):
                encoder.stdin.write(renderer.draw(float(time[0]) + k / fps).data)
                _say(event="progress", share=(k + 1) / count)
            encoder.stdin.close()
        except BrokenPipeError:
            pass
        if encoder.wait() != 0:
            complaints.seek(0)
            lines = complaints.read().decode(errors="replace").strip().splitlines()
            raise RenderError(f"the video could not be encoded: {lines[-1] if lines else 'no reason given'}")
    if is_gif:
        _as_gif(job["ffmpeg"], film, job["video"], fps)


def _as_gif(ffmpeg: str, film: str, path: str, fps: float) -> None:
    """Turn a film into a GIF: one palette for all of it, and of each picture only what changed.  In two passes, for one would
    hold the whole film in memory.
    """
    palette = f"{film}.png"
    quiet = [ffmpeg, *["-hide_banner", "-loglevel", "error", "-y", "-i"], film]
    used = "[0:v][1:v]paletteuse=dither=none:diff_mode=rectangle"
    for command in (
        [*quiet, "-vf", "palettegen=stats_mode=full", palette],
        [*quiet, "-i", palette, "-lavfi", used, "-r", str(fps), "-loop", "0", "-f", "gif", path],
    ):
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
        if done.returncode != 0:
            lines = done.stderr.decode(errors="replace").strip().splitlines()
            raise RenderError(f"the GIF could not be encoded: {lines[-1] if lines else 'no reason given'}")


def _encoder_command(ffmpeg: str, size: tuple[int, int], fps: float, path: str) -> list[str]:
    """Return the encoder's command: raw RGB on stdin to H.264, in BT.709 of limited range and tagged so."""
    taken = f"-f rawvideo -pix_fmt rgb24 -s {size[0]}x{size[1]} -framerate {fps} -i -"
    tags = "setparams=range=tv:colorspace=bt709:color_primaries=bt709:color_trc=bt709"
    colours = f"scale=in_range=pc:out_range=tv:out_color_matrix=bt709,format=yuv420p,{tags}"
    given = f"-an -c:v libx264 -preset veryfast -crf 20 -vf {colours} -movflags +faststart"
    given += f" -metadata comment={SOFTWARE} -f mp4"
    return [ffmpeg, *f"-hide_banner -loglevel error -y {taken} {given}".split(), path]


def _paint_tips(model: Any, names: tuple[str, ...]) -> None:
    """Give each fingertip that is seen its finger's colour."""
    visible = {model.geom(k).name: k for k in range(model.ngeom)}
    for finger, name in enumerate(names):
        geom = visible.get(f"{name}/tip_visual")
        if geom is not None:
            model.geom_matid[geom] = -1
            model.geom_rgba[geom] = [*as_rgb(get_finger_color(finger)), 1.0]


def join_tips(model: Any, names: tuple[str, ...]) -> None:
    """Let each finger's stem be seen to reach the flat side of its fingertip.

    What collides is the tip's whole sphere, on which the stem ends; of the tip only the front half is seen, and it would float.
    """
    known = {model.geom(k).name: k for k in range(model.ngeom)}
    for name in names:
        stem, tip = known.get(f"{name}/stem"), known.get(f"{name}/tip")
        if stem is None or tip is None or model.geom_bodyid[stem] != model.geom_bodyid[tip]:
            continue
        end = model.geom_pos[tip].copy()
        along = end - model.geom_pos[stem]
        along /= np.linalg.norm(along)
        start = model.geom_pos[stem] - model.geom_size[stem, 1] * along
        model.geom_pos[stem] = 0.5 * (start + end)
        model.geom_size[stem, 1] = 0.5 * np.linalg.norm(end - start)


def _fill_poses(qpos: Array) -> Array:
    """Return ``qpos`` (T, nq) with every sample that is no number replaced by the last good one before it."""
    is_good = np.isfinite(qpos).all(axis=1)
    if not is_good.any():
        raise RenderError("the trace has no sample to show: a run of at least one finite pose is needed")
    latest = np.maximum.accumulate(np.where(is_good, np.arange(len(qpos)), -1))
    filled: Array = qpos[np.where(latest < 0, int(np.argmax(is_good)), latest)]
    return filled


def _find_nearest(times: Array, time: float) -> int:
    k = int(np.clip(np.searchsorted(times, time), 1, max(len(times) - 1, 1)))
    return k - 1 if len(times) == 1 or time - times[k - 1] <= times[k] - time else k


def _say(**message: object) -> None:
    print(json.dumps(message), flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
