"""The process that draws.  ``video.py`` starts it with MUJOCO_GL set, and a JSON file tells it its job.

It answers in JSON lines on stdout: ``{"event": "ready"}`` once a renderer runs, ``{"event": "no_renderer",
"fact": ..}`` where none starts, ``{"event": "refused", "kind": .., "message": ..}`` for a job that cannot be done, and
``{"event": "progress", "share": ..}`` meanwhile.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from dexplan.errors import DexplanError
from dexplan.plans.plan import Plan
from dexplan.sim.trace import Trace
from dexplan.viz.canvas import SOFTWARE
from dexplan.viz.encoder import Encoding, encode
from dexplan.viz.film import FilmOptions, count_pictures

try:
    import mujoco

    from dexplan.viz.painter import Painter

    _no_mujoco: str | None = None
except Exception as error:
    # MuJoCo loads its GL platform while it is imported, and reports a missing one in many ways.
    _no_mujoco = f"{type(error).__name__}: {error}"


def main(job_path: str) -> int:
    """Do the job; return the exit code."""
    job = json.loads(Path(job_path).read_text(encoding="utf-8"))
    if _no_mujoco is not None:
        _say(event="no_renderer", fact=_no_mujoco)
        return 1
    options = FilmOptions(**{**job["options"], **{k: tuple(job["options"][k]) for k in ("size", "cameras")}})
    try:
        window = mujoco.GLContext(*options.size)
        window.make_current()
        # The first call that needs the GL functions themselves.
        mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 100).free()
    except Exception as error:
        _say(event="no_renderer", fact=f"{type(error).__name__}: {error}")
        return 1
    _say(event="ready")
    try:
        _work(job, options)
    except DexplanError as error:
        _say(event="refused", kind=type(error).__name__, message=str(error))
        return 1
    finally:
        window.free()
    return 0


def _work(job: Mapping[str, Any], options: FilmOptions) -> None:
    trace = Trace.load(job["trace"])
    plan = None if job["plan"] is None else Plan.load(job["plan"])
    with Painter(trace, plan, options) as painter:
        if job["film"] is not None:
            encode(_draw_film(painter, trace, options), options, Encoding(**job["film"]))
            return
        from matplotlib.image import imsave

        for k, still in enumerate(job["stills"]):
            picture = painter.draw(still["time"])[..., :3]
            imsave(still["path"], picture, format="png", metadata={"Software": SOFTWARE})
            _say(event="progress", share=(k + 1) / len(job["stills"]))


def _draw_film(painter: Painter, trace: Trace, options: FilmOptions) -> Iterator[NDArray[Any]]:
    """Yield the pictures of the run, in order."""
    start, count = float(trace["time"][0]), count_pictures(trace, options)
    for k in range(count):
        yield painter.draw(start + k * options.speed / options.fps)
        _say(event="progress", share=(k + 1) / count)


def _say(**message: object) -> None:
    print(json.dumps(message), flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
