"""The foreign scenes whose contacts are kept as baselines: one inside its border each, and one outside of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from border_scenes import TIPS, Scene, draw, draw_pyramidal, gripper, pinch, push, slope, spin
from foreign_scenes import pinch as round_pinch
from foreign_scenes import pinch_controls

from dexplan.testing.baseline import Baseline
from dexplan.testing.quantities import describe_run

SCENES: Mapping[str, Callable[[], Scene]] = {
    "slope_holds": lambda: slope(draw(11), 0.8, is_ball=False),
    "slope_slides": lambda: slope(draw(11), 1.2, is_ball=False),
    "ball_rolls": lambda: slope(draw(12), 0.8, is_ball=True),
    "shear_holds": lambda: pinch(draw(12), 0.8, "shear"),
    "torsion_holds": lambda: pinch(draw(13), 0.8, "torsion"),
    "torsion_slips": lambda: pinch(draw(13), 1.2, "torsion"),
    "spin_slides": lambda: spin(draw(14), 0.8),
    "push_holds": lambda: push(draw(14), 0.8),
    "push_on_pyramids": lambda: push(draw_pyramidal(14), 0.8),
    "gripper_holds": lambda: gripper(draw(11), 0.8, body="box"),
    "gripper_drops": lambda: gripper(draw(11), 1.2, body="box"),
    "mesh_holds": lambda: gripper(draw(12), 0.8, body="mesh"),
    "rider_holds": lambda: gripper(draw(13), 1.0, body="box", rider=0.8),
    "pyramidal_defaults": lambda: Scene(
        round_pinch(option='impratio="1"', solref="0.02 1", condim=3),
        pinch_controls(600, load=0.6),
        "thing",
        TIPS,
    ),
}


def describe_scene(name: str) -> Baseline:
    """Return what a baseline keeps of a scene."""
    return describe_run(name, SCENES[name]().measure())
