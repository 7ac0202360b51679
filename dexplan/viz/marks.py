"""Marks on the things of a picture: where the object was touched and will be, its goal, friction cones with the forces in them.

Trails, goals and the ghost of the goal's attitude stand in the world and are hidden by what is in front of them.  Cones, forces
and the fingers' numbers are drawn over it, since they lie inside the object.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dexplan.sim.trace import Trace
from dexplan.spatial import Array
from dexplan.viz.facts import Episode, Facts
from dexplan.viz.palette import INK, as_rgb, get_finger_color, get_share_color
from dexplan.viz.pattern import trace_arrow
from dexplan.viz.sketch import Sketch, find_hull
from dexplan.viz.stage import Projection, Stage
from dexplan.viz.story import Story

FORCE_LENGTH = 0.0045
"""Length of a force arrow, and height of a cone [m/N]."""
LEAST_FORCE = 0.05
"""No cone is drawn for less [N]."""
GOAL_RADIUS = 0.006
"""Of the knob on the object where a finger has to touch in the end [m]."""
GOAL_SHADE = 0.5
"""A goal is marked in its finger's colour, darkened to this share, as in the paper's figure 5."""
DOT_RADIUS, TRAIL_WIDTH = 0.0016, 3.0
"""Of a contact on the object [m], and of a trail [pixels]."""
LEAST_TRAIL = 0.0005
"""A contact that has wandered less [m] leaves a dot alone."""
RAISED = 0.0004
"""Trails lie so far above the surface [m]."""
TARGET_RADIUS = 0.007
"""Of the ring where a free finger is going to touch [m]."""
GHOST_COLOR, GHOST_RAISED, GHOST_WIDTH = "#4F6BAE", 0.0035, 5.0
"""Of the ghost of the goal's attitude: its colour, how far it floats above the object [m], its width [pixels]."""
RING = np.linspace(0.0, 2.0 * np.pi, 25)
BADGE = 11.0
"""Radius of a finger's number [pixels]; of a finger that moves it has a ring."""


def add_trails(stage: Stage, facts: Facts, bodies: tuple[int, ...], time: float) -> None:
    """Add where the object has been touched until ``time`` [s], and where its tips touched in this touch or the last."""
    X_WO = stage.find_object()
    latest: dict[int, Episode] = {}
    for episode in facts.episodes:
        if episode.start > time:
            continue
        latest[episode.finger] = episode
        points = episode.point_O[: max(1, np.searchsorted(episode.times, time, side="right"))]
        lifted = points if stage.body is None else points + RAISED * stage.body.normal_at(points)
        lifted_W = lifted @ X_WO[:3, :3].T + X_WO[:3, 3]
        color = get_finger_color(episode.finger)
        stage.add_ball(lifted_W[0], DOT_RADIUS, color)
        if np.linalg.norm(points - points[0], axis=1).max() > LEAST_TRAIL:
            stage.add_line(_thin(lifted_W), TRAIL_WIDTH, color)
    for finger, episode in latest.items():
        X_WB = stage.find_body(bodies[finger])
        points = episode.point_B[: max(1, np.searchsorted(episode.times, time, side="right"))]
        points_W = points @ X_WB[:3, :3].T + X_WB[:3, 3]
        stage.add_ball(points_W[0], DOT_RADIUS, INK)
        if np.linalg.norm(points - points[0], axis=1).max() > LEAST_TRAIL:
            stage.add_line(_thin(points_W), TRAIL_WIDTH, INK)


def add_goals(stage: Stage, story: Story, pose_first: Array) -> None:
    """Add a dark knob on the object for every goal contact, and the ghost of the object's arrow at the goal's attitude."""
    X_WO = stage.find_object()
    for finger, point in enumerate(story.goal_points):
        if point is not None:
            shade = as_rgb(get_finger_color(finger)) * GOAL_SHADE
            color = "#" + "".join(f"{round(255 * x):02X}" for x in shade)
            stage.add_ball(X_WO[:3, :3] @ point + X_WO[:3, 3], GOAL_RADIUS, color)
    if story.X_WO_goal is None or not _is_moved(story, pose_first):
        return
    R, p = story.X_WO_goal[:3, :3], story.X_WO_goal[:3, 3]
    for line in () if stage.body is None else trace_arrow(stage.body, GHOST_RAISED):
        stage.add_line(line @ R.T + p, GHOST_WIDTH, GHOST_COLOR)


def add_targets(stage: Stage, facts: Facts, active: NDArray[np.bool_], time: float) -> None:
    """Add a ring on the object where each finger that does not touch is going to touch next."""
    X_WO = stage.find_object()
    for finger in np.flatnonzero(~active).tolist():
        coming = next((e for e in facts.episodes if e.finger == finger and e.start > time), None)
        if coming is None:
            continue
        n = coming.normal_O
        u = np.cross(n, [0.0, 0.0, 1.0] if abs(n[2]) < 0.9 else [1.0, 0.0, 0.0])
        u /= np.linalg.norm(u)
        v = np.cross(n, u)
        ring = np.outer(np.cos(RING), u) + np.outer(np.sin(RING), v)
        points = coming.point_O[0] + RAISED * n + TARGET_RADIUS * ring
        stage.add_line(points @ X_WO[:3, :3].T + X_WO[:3, 3], TRAIL_WIDTH, get_finger_color(finger))


def draw_cones(
    sketch: Sketch, projection: Projection, X_WO: Array, trace: Trace, sample: int, facts: Facts
) -> None:
    """Draw the friction cone of every contact into the object, as high as its normal force, and the force that is in it.

    The colour tells the share of friction used; an arrow that meets the cone's edge would slide.
    """
    if "contact_force" not in trace or "contact_rotation_O" not in trace:
        return
    for finger in range(facts.share.shape[1]):
        force = trace["contact_force"][sample, finger]
        share = facts.share[sample, finger]
        if not (np.isfinite(force).all() and np.isfinite(share) and force[2] > LEAST_FORCE):
            continue
        R = X_WO[:3, :3] @ trace["contact_rotation_O"][sample, finger]
        apex = X_WO[:3, :3] @ trace["contact_point_O"][sample, finger] + X_WO[:3, 3]
        height = FORCE_LENGTH * force[2]
        rim = np.stack([np.cos(RING), np.sin(RING), np.zeros_like(RING)], axis=1) * facts.sliding
        rim[:, 2] = 1.0
        base = projection.project(apex + height * rim @ R.T)
        tail, head = projection.project(np.stack([apex, apex + FORCE_LENGTH * R @ force[:3]]))
        if not (np.isfinite(base).all() and np.isfinite(tail).all()):
            continue
        color = get_share_color(float(share))
        sketch.draw_polygon(find_hull(np.vstack([tail, base])), color, INK, 1.0, alpha=0.55)
        sketch.draw_line(base, INK, 0.8, alpha=0.7)
        draw_arrow(sketch, tail, head, color)


def draw_arrow(sketch: Sketch, tail: Array, head: Array, color: str) -> None:
    """Draw an arrow from ``tail`` to ``head`` (2,) in a colour, with a dark edge."""
    way = head - tail
    length = float(np.linalg.norm(way))
    if length < 3.0:
        sketch.draw_disc(head, 3.0, color, INK)
        return
    along = way / length
    across = np.array([-along[1], along[0]])
    tip = min(12.0, 0.6 * length)
    neck = head - tip * along
    outline = [tail + 2.2 * across, neck + 2.2 * across, neck + 6.0 * across, head]
    outline += [neck - 6.0 * across, neck - 2.2 * across, tail - 2.2 * across]
    sketch.draw_polygon(outline, color, INK, 1.2)


def draw_badge(sketch: Sketch, center: Array, finger: int, is_moving: bool, scale: float) -> None:
    """Draw a finger's number in its colour; one that moves has a dark ring around it."""
    radius = max(7.0, BADGE * scale)
    if is_moving:
        sketch.draw_disc(center, radius + 4.0, None, "#FFFFFF", 5.0)
        sketch.draw_disc(center, radius + 4.0, None, INK, 2.0)
    sketch.draw_disc(center, radius, get_finger_color(finger), "#FFFFFF", 1.5)
    sketch.draw_text(center[0], center[1], str(finger + 1), 1.25 * radius, "white", "center", is_bold=True)


def _is_moved(story: Story, pose_first: Array) -> bool:
    """Whether the goal asks for the object to be moved at all."""
    assert story.X_WO_goal is not None
    shift = float(np.linalg.norm(story.X_WO_goal[:3, 3] - pose_first[:3]))
    return bool(abs(story.turn or 0.0) > np.radians(0.5) or shift > 2e-4)


def _thin(points: Array, most: int = 24) -> Array:
    """Return at most ``most`` of the points of a line (N, 3), its ends among them."""
    if len(points) <= most:
        return points
    return points[np.linspace(0, len(points) - 1, most).round().astype(int)]
