"""What stands around the views: words, the gait as a strip with a cursor, a gauge of friction per finger, a dial, a legend."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dexplan.viz.layout import Box
from dexplan.viz.marks import GHOST_COLOR
from dexplan.viz.palette import INK, get_finger_color, get_share_color
from dexplan.viz.pattern import BAND_INK
from dexplan.viz.sketch import Sketch, measure_text
from dexplan.viz.story import Chapter
from dexplan.viz.timeline import GaitRow, Span

GROUND, PANEL, PALE, QUIET = "#1C1E24", "#23262E", "#F2F3F5", "#9AA1AD"
"""Of the header, of the panels below, of texts, and of texts that matter less."""
BIG, SMALL, TINY = 23.0, 15.5, 12.5
"""Sizes of texts in a picture of 1280 x 720 [pixels]."""
LEAST_TEXT = 9.0
LEAD = "#F2C14E"
EDGES = "#" + "".join(f"{part:02X}" for part in BAND_INK)
CLOCK_ROOM = "99.9 s of 999 s, 2 x"
"""No time takes more room."""
SLIDES = 1.0
"""The share of friction at which a contact slides; gauges end a little behind it."""
GAUGE_END = 1.1
LIGHT = 0.9
"""From this share on a finger that moves and presses little is said to touch lightly."""
LIGHT_FORCE = 0.5
"""It presses less than this share of what the firmest finger does."""


def draw_header(sketch: Sketch, box: Box, scale: float, count: str, headline: str, why: str) -> None:
    """Write the number of the action, what is being done, and why; room for the time stays on the right."""
    sketch.draw_box(box.left, box.top, box.width, box.height, GROUND)
    big, small = _measure_header(scale)
    margin = 0.7 * small
    first = box.top + _place_first(box, scale)
    x = box.left + margin
    if count:
        x += sketch.draw_text(x, first, count, big, LEAD, is_bold=True) + margin
    room = box.left + box.width - measure_text(CLOCK_ROOM, small) - 2.0 * margin - x
    size = _shrink(headline, big, room, True)
    line = sketch.fold_text(headline, size, room, 1, True)[0]
    sketch.draw_text(x, first, line, size, "white", is_bold=True)
    if _has_two_lines(box, scale) and why:
        room = box.width - 2.0 * margin
        size = _shrink(why, small, room, False)
        line = sketch.fold_text(why, size, room)[0]
        sketch.draw_text(box.left + margin, box.top + 0.76 * box.height, line, size, PALE)


def draw_clock(sketch: Sketch, box: Box, scale: float, clock: str) -> None:
    """Write the time into the room that the header leaves for it."""
    _, small = _measure_header(scale)
    x = box.left + box.width - 0.7 * small
    sketch.draw_text(x, box.top + _place_first(box, scale), clock, small, QUIET, "right")


def _measure_header(scale: float) -> tuple[float, float]:
    """Return the sizes of the header's two lines."""
    return max(LEAST_TEXT + 2.0, BIG * scale), max(LEAST_TEXT, SMALL * scale)


def _has_two_lines(box: Box, scale: float) -> bool:
    big, small = _measure_header(scale)
    return box.height >= 1.4 * small + big


def _place_first(box: Box, scale: float) -> float:
    """Return how far below the header's edge its first line stands."""
    return (0.34 if _has_two_lines(box, scale) else 0.5) * box.height


def _shrink(text: str, size: float, room: float, is_bold: bool) -> float:
    """Return the largest size of a few at which a text fits; the smallest where it fits at none."""
    sizes = [size, 0.88 * size, 0.76 * size]
    return next((s for s in sizes if measure_text(text, s, is_bold) <= room), sizes[-1])


def draw_strip(sketch: Sketch, box: Box, scale: float, rows: Sequence[GaitRow], spans: Sequence[Span]) -> Box:
    """Draw who touched when, and the numbers of the actions; return the part in which time runs from left to right."""
    sketch.draw_box(box.left, box.top, box.width, box.height, PANEL)
    small = max(LEAST_TEXT, TINY * scale)
    margin = 0.8 * small
    names = [row.finger.replace("_", " ") for row in rows]
    label = max((measure_text(n, small) for n in names), default=0.0) + 3.4 * small
    head, foot = 2.0 * small, 1.9 * small
    inner = Box(
        round(box.left + label),
        round(box.top + head),
        round(box.width - label - margin),
        round(box.height - head - foot),
    )
    if not spans:
        return inner
    first, last = spans[0].start, max(spans[-1].end, spans[0].start + 1e-6)
    unit = inner.width / (last - first)
    sketch.draw_text(box.left + margin, box.top + 0.55 * head, "action", small, QUIET)
    free = -np.inf
    for k, span in enumerate(spans):
        x = inner.left + (span.start - first) * unit
        width = (span.end - span.start) * unit
        if k % 2 == 0:
            sketch.draw_box(x, inner.top, width, inner.height, "#343945")
        text = str(span.action_index + 1)
        half = 0.5 * measure_text(text, small)
        middle = x + 0.5 * width
        if middle - half > free:
            sketch.draw_text(middle, box.top + 0.55 * head, text, small, PALE, "center")
            free = middle + half + 0.35 * small
    tall = inner.height / max(len(rows), 1)
    for k, (row, name) in enumerate(zip(rows, names, strict=True)):
        y = inner.top + (k + 0.5) * tall
        sketch.draw_disc((box.left + margin + 0.6 * small, y), 0.62 * small, get_finger_color(k), "#FFFFFF")
        sketch.draw_text(box.left + margin + 1.8 * small, y, name, small, PALE)
        for start, end in row.holding:
            sketch.draw_box(
                inner.left + (start - first) * unit,
                y - 0.3 * tall,
                max(1.0, (end - start) * unit),
                0.6 * tall,
                get_finger_color(k),
            )
    y = box.top + box.height - 0.5 * foot
    sketch.draw_text(inner.left, y, f"{first:.0f} s", small, QUIET)
    sketch.draw_text(inner.left + inner.width, y, f"{last:.0f} s", small, QUIET, "right")
    sketch.draw_text(
        inner.left + 0.5 * inner.width, y, "bars: the finger touches the object", small, QUIET, "center"
    )
    return inner


def draw_cursor(sketch: Sketch, inner: Box, share: float) -> None:
    """Draw the present on a strip; what is still to come is dimmed."""
    x = inner.left + share * inner.width
    sketch.draw_box(x, inner.top, inner.left + inner.width - x, inner.height, PANEL, alpha=0.55)
    sketch.draw_line([(x, inner.top - 4), (x, inner.top + inner.height + 4)], "#FFFFFF", 2.0)
    sketch.draw_polygon([(x - 5, inner.top - 8), (x + 5, inner.top - 8), (x, inner.top - 1)], "#FFFFFF")


def draw_gauge_ground(sketch: Sketch, box: Box, scale: float, count: int) -> Box:
    """Draw what of the gauges stays the same; return the part in which bars grow, a row per finger."""
    sketch.draw_box(box.left, box.top, box.width, box.height, PANEL)
    sketch.draw_box(box.left, box.top + 8, 1, box.height - 16, "#3E4350")
    small = max(LEAST_TEXT, TINY * scale)
    head, foot = 2.0 * small, 1.9 * small
    left, right = 3.0 * small, 12.0 * small
    inner = Box(
        round(box.left + left),
        round(box.top + head),
        round(box.width - left - right),
        round(box.height - head - foot),
    )
    sketch.draw_text(inner.left, box.top + 0.55 * head, "friction used by each finger", small, PALE)
    tall = inner.height / max(count, 1)
    for k in range(count):
        y = inner.top + (k + 0.5) * tall
        sketch.draw_disc((box.left + 1.5 * small, y), 0.62 * small, get_finger_color(k), "#FFFFFF")
        sketch.draw_text(box.left + 1.5 * small, y, str(k + 1), 0.9 * small, "white", "center", is_bold=True)
        sketch.draw_box(inner.left, y - 0.24 * tall, inner.width, 0.48 * tall, "#3A3F4A")
    slides = inner.left + inner.width * SLIDES / GAUGE_END
    sketch.draw_line([(slides, inner.top), (slides, inner.top + inner.height)], "#FFFFFF", 1.5)
    y = box.top + box.height - 0.5 * foot
    sketch.draw_text(inner.left, y, "0", small, QUIET)
    sketch.draw_text(slides, y, "100 %: it slides", small, PALE, "center")
    return inner


def draw_gauges(
    sketch: Sketch,
    inner: Box,
    scale: float,
    shares: Sequence[float],
    normals: Sequence[float],
    movers: Sequence[int],
) -> None:
    """Draw the bars: share of friction used by each finger, and how hard it presses; what one that does not touch is doing."""
    small = max(LEAST_TEXT, TINY * scale)
    tall = inner.height / max(len(shares), 1)
    for k, (share, normal) in enumerate(zip(shares, normals, strict=True)):
        y = inner.top + (k + 0.5) * tall
        x = inner.left + inner.width + 0.6 * small
        if not np.isfinite(share):
            sketch.draw_text(x, y, "is moving" if k in movers else "free", small, QUIET)
            continue
        width = inner.width * min(float(share), GAUGE_END) / GAUGE_END
        # A finger that lands or leaves holds nothing yet, or no longer: it is at its limit and no alarm.
        is_light = k in movers and share > LIGHT and normal < LIGHT_FORCE * np.nanmax(normals)
        color = QUIET if is_light else get_share_color(float(share))
        sketch.draw_box(inner.left, y - 0.24 * tall, width, 0.48 * tall, color)
        sketch.draw_text(x + 2.9 * small, y, f"{100.0 * share:.0f} %", small, PALE, "right", is_bold=True)
        words = "light touch" if is_light else f"presses {normal:.1f} N"
        sketch.draw_text(x + 3.6 * small, y, words, small, QUIET)


def draw_dial(sketch: Sketch, box: Box, scale: float, turned: float, goal: float) -> None:
    """Draw how far the object has turned [rad] on a ring in the upper right corner of a box, and how far it has to."""
    radius = 40.0 * scale
    small = max(LEAST_TEXT, 1.1 * TINY * scale)
    center = (box.left + box.width - radius - 2.0 * small, box.top + radius + 1.2 * small)
    way = -1.0 if goal >= 0.0 else 1.0
    sketch.draw_disc(center, radius + 9.0 * scale, "#FFFFFF")
    sketch.draw_arc(center, radius, (0.0, 2.0 * np.pi), "#D3D7DE", 9.0 * scale)
    whole = 2.0 * np.pi
    done = turned * np.sign(goal)
    if done > 0.002:
        sketch.draw_arc(center, radius, (0.0, way * min(done, whole)), "#182646", 9.0 * scale)
    if done > whole:
        # The next time round in a lighter colour.
        sketch.draw_arc(center, radius, (0.0, way * ((done - whole) % whole)), GHOST_COLOR, 9.0 * scale)
    at = way * abs(goal)
    rim = np.array([np.sin(at), -np.cos(at)])
    sketch.draw_line(
        [center + (radius - 8.0 * scale) * rim, center + (radius + 8.0 * scale) * rim], "#D55E00", 3.5 * scale
    )
    text = f"{round(np.degrees(done)) + 0}°"
    sketch.draw_text(center[0], center[1] - 0.35 * small, text, 1.5 * small, INK, "center", is_bold=True)
    sketch.draw_text(
        center[0], center[1] + 1.05 * small, f"of {abs(np.degrees(goal)):.0f}°", small, INK, "center"
    )


def draw_note(sketch: Sketch, box: Box, scale: float, lines: Sequence[str]) -> None:
    """Write lines on a white ground into the upper left corner of a box."""
    if not lines:
        return
    small = max(LEAST_TEXT, TINY * scale)
    width = max(measure_text(line, small) for line in lines) + 1.6 * small
    sketch.draw_box(
        box.left + 8, box.top + 8, width, (1.55 * len(lines) + 0.6) * small, "#FFFFFF", alpha=0.82
    )
    for k, line in enumerate(lines):
        sketch.draw_text(
            box.left + 8 + 0.8 * small, box.top + 8 + (1.55 * k + 1.05) * small, line, small, INK
        )


def draw_legend(sketch: Sketch, box: Box, scale: float, entries: Sequence[tuple[str, str]]) -> None:
    """Draw what the marks mean into the lower left corner of a box: pairs of a mark's kind and its words."""
    if not entries:
        return
    small = max(LEAST_TEXT, TINY * scale)
    line = 1.6 * small
    width = max(measure_text(words, small) for _, words in entries) + 4.2 * small
    top = box.top + box.height - 8 - (len(entries) * line + 0.6 * small)
    sketch.draw_box(box.left + 8, top, width, len(entries) * line + 0.6 * small, "#FFFFFF", alpha=0.82)
    for k, (kind, words) in enumerate(entries):
        y = top + 0.3 * small + (k + 0.5) * line
        _draw_symbol(sketch, kind, box.left + 8 + 1.8 * small, y, small)
        sketch.draw_text(box.left + 8 + 3.5 * small, y, words, small, INK)


def _draw_symbol(sketch: Sketch, kind: str, x: float, y: float, size: float) -> None:
    match kind:
        case "cone":
            color = get_share_color(0.5)
            corners = [(x - size, y), (x + 0.9 * size, y - 0.6 * size), (x + 0.9 * size, y + 0.6 * size)]
            sketch.draw_polygon(corners, color, INK, 1.0)
            sketch.draw_line([(x - size, y), (x + 0.8 * size, y - 0.15 * size)], INK, 2.0)
        case "ghost":
            sketch.draw_line([(x - size, y), (x + size, y)], GHOST_COLOR, 3.0)
            near, half = x + 0.4 * size, 0.45 * size
            sketch.draw_line([(near, y - half), (x + size, y), (near, y + half)], GHOST_COLOR, 3.0)
        case "target":
            sketch.draw_disc((x, y), 0.5 * size, None, get_finger_color(0), 2.0)
        case "goal":
            sketch.draw_disc((x, y), 0.5 * size, "#00395A")
        case "trail":
            sketch.draw_line([(x - 0.8 * size, y), (x + 0.6 * size, y)], get_finger_color(1), 3.0)
            sketch.draw_disc((x - 0.8 * size, y), 0.25 * size, get_finger_color(1))
        case "edges":
            sketch.draw_line([(x - size, y), (x + size, y)], EDGES, 2.0)
        case "moving":
            sketch.draw_disc((x, y), 0.62 * size, None, INK, 2.0)
            sketch.draw_disc((x, y), 0.38 * size, QUIET)


def pick_legend(
    has_cones: bool, has_ghost: bool, has_targets: bool, goals: int, thing: str, has_edges: bool = False
) -> tuple[tuple[str, str], ...]:
    """Return the entries of a legend for what a film shows; ``thing`` is what the object is called."""
    entries = [
        (has_cones, "cone", "cone: forces that friction holds; arrow: the force"),
        (has_ghost, "ghost", f"where the arrow on the {thing} has to end"),
        (goals > 0, "goal", "where a finger has to touch in the end"),
        (has_targets, "target", "where a free finger touches next"),
        (has_cones, "trail", f"where the {thing} has been touched"),
        (has_edges, "edges", "nearer to an edge no contact is made"),
        (has_targets, "moving", "this finger lands or leaves: it may slide, the others hold"),
    ]
    return tuple((kind, words) for is_there, kind, words in entries if is_there)


def count_actions(chapters: Sequence[Chapter], action: int) -> str:
    """Return ``6 of 24:``; nothing where there is no such action."""
    return f"{action + 1} of {len(chapters)}:" if 0 <= action < len(chapters) else ""
