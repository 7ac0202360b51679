"""Whole pictures of a run: views, marks, and what stands around them, sample by sample."""

from __future__ import annotations

from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from dexplan.contact.bodies.names import name_body
from dexplan.plans.plan import Plan
from dexplan.sim.trace import Trace
from dexplan.spatial import Array
from dexplan.viz import marks, panels
from dexplan.viz.body import find_body
from dexplan.viz.dress import dress_model
from dexplan.viz.facts import compute_facts
from dexplan.viz.film import QUALITIES, FilmOptions
from dexplan.viz.layout import LEAST_LEGEND, Box, lay_out
from dexplan.viz.pattern import has_edges
from dexplan.viz.sketch import Sketch
from dexplan.viz.stage import Projection, Stage, View
from dexplan.viz.story import Story, tell_story
from dexplan.viz.timeline import build_action_spans, build_gait_rows, read_finger_names

BADGE_BEHIND = 0.034
"""A finger's number stands on its stem, so far behind the middle of its tip [m]."""


class Painter:
    """Draws pictures of one trace.  A GL context has to be current."""

    def __init__(self, trace: Trace, plan: Plan | None, options: FilmOptions) -> None:
        self._trace, self._options = trace, options
        self._names = read_finger_names(trace)
        self._story: Story = tell_story(plan, trace)
        self._model = dress_model(trace.model_xml, self._names)
        self._facts = compute_facts(trace, self._story, self._model, self._names)
        self._layout = lay_out(options)
        self._tips = [self._model.geom(f"{name}/tip") for name in self._names]
        self._sketch = Sketch(*options.size)
        self._sketch.pixels[:] = (62, 67, 80, 255)
        body = find_body(trace.model_xml)
        self._stage = Stage(self._model, body, options.size, self._layout.views, QUALITIES[options.quality])
        self._said: tuple[str, ...] = ()
        self._has_contacts = "contact_active" in trace and "action_index" in trace
        if options.is_told and self._has_contacts and self._layout.strip.height:
            self._draw_ground()

    def __enter__(self) -> Painter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stage.close()

    def draw(self, time: float) -> NDArray[np.uint8]:
        """Return the picture (H, W, 4) of the sample nearest to ``time`` [s]; the next one is drawn into the same array."""
        trace, facts, stage = self._trace, self._facts, self._stage
        sample = find_nearest(trace["time"], time)
        now = float(trace["time"][sample])
        stage.set_pose(facts.qpos[sample])
        bodies = tuple(int(tip.bodyid[0]) for tip in self._tips)
        marks.add_goals(stage, self._story, facts.pose[0])
        if self._has_contacts:
            marks.add_trails(stage, facts, bodies, now)
            marks.add_targets(stage, facts, trace["contact_active"][sample], now)
        projections = stage.draw_into(self._sketch.pixels)
        for view, projection in zip(self._layout.views, projections, strict=True):
            marks.draw_cones(self._sketch, projection, stage.find_object(), trace, sample, facts)
            self._draw_badges(view, projection, sample, bodies)
        if self._options.is_told:
            self._tell(sample, now)
        return self._sketch.pixels

    def _draw_badges(self, view: View, projection: Projection, sample: int, bodies: tuple[int, ...]) -> None:
        movers = self._story.find_chapter(self._find_action(sample)).movers
        scale = self._layout.scale
        for finger, (tip, body) in enumerate(zip(self._tips, bodies, strict=True)):
            X_WB = self._stage.find_body(body)
            back = tip.pos * (1.0 - BADGE_BEHIND / max(float(np.linalg.norm(tip.pos)), 1e-9))
            x, y = projection.project(X_WB[:3, :3] @ back + X_WB[:3, 3])
            edge = 2.0 * marks.BADGE * scale
            is_inside = view.left + edge < x < view.left + view.width - edge
            if is_inside and view.top + edge < y < view.top + view.height - edge:
                marks.draw_badge(self._sketch, np.array([x, y]), finger, finger in movers, scale)

    def _draw_ground(self) -> None:
        """Draw what of the footer stays the same all through the film."""
        layout, sketch = self._layout, self._sketch
        spans, rows = build_action_spans(self._trace), build_gait_rows(self._trace)
        self._time_box = panels.draw_strip(sketch, layout.strip, layout.scale, rows, spans)
        self._gauge_box = panels.draw_gauge_ground(sketch, layout.gauges, layout.scale, len(rows))
        self._footer = sketch.pixels[layout.strip.top :].copy()

    def _tell(self, sample: int, now: float) -> None:
        """Draw the words and panels around the views."""
        layout, sketch, story, facts = self._layout, self._sketch, self._story, self._facts
        action = self._find_action(sample)
        chapter = story.find_chapter(action)
        phase = int(self._trace["phase_index"][sample]) if "phase_index" in self._trace else 0
        times = self._trace["time"]
        headline = chapter.get_headline(phase)
        count = panels.count_actions(story.chapters, action)
        words = (count, headline, chapter.why)
        if words != self._said:
            panels.draw_header(sketch, layout.header, layout.scale, *words)
            self._said, self._header = words, sketch.pixels[: layout.header.height].copy()
        sketch.pixels[: layout.header.height] = self._header
        panels.draw_clock(sketch, layout.header, layout.scale, self._describe_time(now))
        if layout.strip.height and self._has_contacts:
            sketch.pixels[layout.strip.top :] = self._footer
            length = max(float(times[-1] - times[0]), 1e-9)
            panels.draw_cursor(sketch, self._time_box, (now - float(times[0])) / length)
            shares, normals = facts.share[sample], facts.normal[sample]
            panels.draw_gauges(sketch, self._gauge_box, layout.scale, shares, normals, chapter.movers)
        first, last = layout.views[0], layout.views[-1]
        if not layout.strip.height:
            return
        if abs(story.turn or 0.0) > np.radians(0.5):
            turned = float(facts.turned[sample])
            panels.draw_dial(sketch, as_box(last), layout.scale, turned, float(story.turn or 0.0))
        panels.draw_note(sketch, as_box(first), layout.scale, self._note_progress(sample))
        if layout.scale >= LEAST_LEGEND:
            panels.draw_legend(sketch, as_box(first), layout.scale, self._legend)

    @property
    def _legend(self) -> tuple[tuple[str, str], ...]:
        goals = sum(point is not None for point in self._story.goal_points)
        has_ghost = self._story.X_WO_goal is not None and abs(self._story.turn or 0.0) > np.radians(0.5)
        later = any(episode.start > self._trace["time"][0] for episode in self._facts.episodes)
        body = self._stage.body
        return panels.pick_legend(
            self._has_contacts, has_ghost, later, goals, name_body(body), has_edges(body)
        )

    def _note_progress(self, sample: int) -> list[str]:
        """Return what is said of the goal besides its turn."""
        story, facts, lines = self._story, self._facts, []
        if story.X_WO_goal is not None:
            wanted = float(np.linalg.norm(story.X_WO_goal[:3, 3] - facts.pose[0, :3]))
            if wanted > 1e-4:
                lines.append(f"shifted {1e3 * facts.shift[sample]:.1f} of {1e3 * wanted:.1f} mm")
        if any(point is not None for point in story.goal_points):
            reached, total = int(facts.is_at_goal[sample].sum()), len(story.goal_points)
            lines.append(f"goal contacts: {reached} of {total} fingers are there")
        return lines

    def _describe_time(self, now: float) -> str:
        speed = self._options.speed
        text = f"{now:.1f} s of {self._trace['time'][-1]:.0f} s"
        return text if speed == 1.0 else f"{text}, {speed:g} x"

    def _find_action(self, sample: int) -> int:
        return int(self._trace["action_index"][sample]) if "action_index" in self._trace else -1


def as_box(view: View) -> Box:
    """Return the part of the picture that a view takes."""
    return Box(view.left, view.top, view.width, view.height)


def find_nearest(times: Array, time: float) -> int:
    """Return the sample nearest to a time."""
    k = int(np.clip(np.searchsorted(times, time), 1, max(len(times) - 1, 1)))
    return k - 1 if len(times) == 1 or time - times[k - 1] <= times[k] - time else k
