"""The contacts of a run as a table: one row per sample and touching finger, columns of equal length, as data frames take them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[Any]
OBJECT, CONTACT, TIP = "object", "contact", "fingertip"
"""Frames: the contact frame has axes t1, t2 and n, with n into the object."""


@dataclass(frozen=True)
class ContactColumn:
    """One column of the table: its name, unit and frame, and what it is.

    It is read from the column ``source`` of the trace, at ``place`` of what that holds for one finger in one sample, times
    ``scale``.
    """

    name: str
    unit: str
    frame: str
    meaning: str
    source: str
    place: tuple[int, ...] = ()
    scale: float = 1.0

    def read(self, rows: Cells) -> Cells:
        """Return the column (N,) from the rows (N, ...) of its source."""
        cells = rows
        for index in self.place:
            cells = cells[:, index]
        return cells if self.scale == 1.0 else self.scale * cells


def _list_columns() -> Iterator[ContactColumn]:
    for k, axis in enumerate("xyz"):
        yield ContactColumn(f"{axis}_O_m", "m", OBJECT, f"point of contact, {axis}", "contact_point_O", (k,))
    for j, name in enumerate(("t1", "t2", "n")):
        words = "normal into the object" if name == "n" else f"tangent {name}"
        for k, axis in enumerate("xyz"):
            yield ContactColumn(
                f"{name}_{axis}_O", "–", OBJECT, f"{words}, {axis}", "contact_rotation_O", (k, j)
            )
    parts = (("f_t1", "N", "force along t1"), ("f_t2", "N", "force along t2"), ("f_n", "N", "normal force"))
    for middle, who, source in (
        ("", "measured", "contact_force"),
        ("_planned", "asked for by the force program", "contact_force_reference"),
    ):
        for k, (name, unit, words) in enumerate((*parts, ("tau_n", "N m", "torque about n"))):
            column = f"{name}{middle}_{unit.replace(' ', '_')}"
            yield ContactColumn(column, unit, CONTACT, f"{words} on the object, {who}", source, (k,))
    for k, (name, unit, words) in enumerate(
        (
            ("slip_t1_m_s", "m/s", "sliding along t1"),
            ("slip_t2_m_s", "m/s", "sliding along t2"),
            ("spin_rad_s", "rad/s", "spin about n"),
        )
    ):
        yield ContactColumn(
            name, unit, CONTACT, f"{words}, tip against object", "contact_slip_velocity", (k,)
        )
    words = "angle between the tip's pole and the contact on the tip"
    yield ContactColumn("tip_angle_deg", "deg", TIP, words, "tip_contact_angle", (), float(np.degrees(1.0)))


KEYS: Mapping[str, str] = {
    "time_s": "time of the sample [s]",
    "sample": "index of the sample in the trace, from 0",
    "action": "number of the plan's action, from 1",
    "finger": "the finger's name",
}
"""The columns that come first, and say of what a row is."""
COLUMNS = tuple(_list_columns())
"""The columns after these."""


def build_contact_table(model_xml: str, columns: Mapping[str, Cells]) -> dict[str, Cells]:
    """Return the table, columns (N,) by name: a row for each sample and finger that touches, in the order of time.

    ``columns`` are those of a trace; what they do not have is left out.  Raises KeyError where they do not say who touches.
    """
    samples, fingers = np.nonzero(columns["contact_active"])
    table: dict[str, Cells] = {}
    if "time" in columns:
        table["time_s"] = columns["time"][samples]
    table["sample"] = samples
    if "action_index" in columns:
        table["action"] = columns["action_index"][samples] + 1
    table["finger"] = np.array(read_finger_names(model_xml), dtype=np.str_)[fingers]
    for column in COLUMNS:
        if column.source in columns:
            table[column.name] = column.read(columns[column.source][samples, fingers])
    return table


def read_finger_names(model_xml: str) -> tuple[str, ...]:
    """Return the fingers' names in the order of a trace's columns, read off its model's tips."""
    names = (geom.get("name", "") for geom in ElementTree.fromstring(model_xml).iter("geom"))
    return tuple(name.removesuffix("/tip") for name in names if name.endswith("/tip"))


def describe_columns() -> str:
    """Return all columns as a Markdown table."""
    lines = ["| column | unit | frame | what |", "| --- | --- | --- | --- |"]
    lines += [f"| `{name}` |  |  | {meaning} |" for name, meaning in KEYS.items()]
    lines += [f"| `{c.name}` | {c.unit} | {c.frame} | {c.meaning} |" for c in COLUMNS]
    return "\n".join(lines) + "\n"
