"""What a process does not load that does not need it: a renderer, or a library of plots."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

HEAVY = {"matplotlib", "OpenGL", "glfw", "imageio_ffmpeg", "viser", "dexplan.viz.video", "dexplan.viz.figure"}
"""MuJoCo itself loads OpenGL wherever MUJOCO_GL does not say "off", as our command line does."""
RUN = """
import dexplan as dx
problem = dx.load_problem("hold_two", {"seed": 0})
plan = dx.plan(problem)
trace = dx.rollout(problem, plan)
assert dx.validate(problem, plan, trace).verdict == "pass"
"""


@pytest.mark.parametrize("code", ["import dexplan", RUN], ids=["import", "plan, run and judge"])
def test_neither_renderer_nor_plots_are_loaded(code: str) -> None:
    tell = f"import json, sys\n{code}\nprint(json.dumps(sorted(sys.modules)))"
    environment = os.environ | {"MUJOCO_GL": "off"}
    done = subprocess.run(
        [sys.executable, "-c", tell], check=True, capture_output=True, text=True, env=environment
    )
    assert not HEAVY & set(json.loads(done.stdout))
