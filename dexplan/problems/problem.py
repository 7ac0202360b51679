"""What is asked: one frozen value per problem file (format 1), with every default written out.

A ``Problem`` that came from :func:`~dexplan.problems.read.load_problem` or :meth:`Problem.load` is a checked one; one that
was put together in Python is checked when it is saved and read again.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dexplan.brief import brief_repr
from dexplan.notebook import as_html_table
from dexplan.problems.object_section import AllowedRegion, ObjectSection, ShapeSection
from dexplan.problems.parse import parse_file
from dexplan.problems.sections import (
    FORMAT,
    ContactPoint,
    ContactSpec,
    ControlSection,
    ForcesSection,
    FrictionSection,
    FrozenMap,
    GaitSection,
    GoalSection,
    HandSection,
    MarginsSection,
    Obstacle,
    ProblemFields,
    Rotation,
    StartSection,
    Waypoint,
    WeightsSection,
    compute_contact_directions,
)
from dexplan.problems.words import describe_problem

__all__ = [
    "FORMAT",
    "AllowedRegion",
    "ContactPoint",
    "ContactSpec",
    "ControlSection",
    "ForcesSection",
    "FrictionSection",
    "FrozenMap",
    "GaitSection",
    "GoalSection",
    "HandSection",
    "MarginsSection",
    "ObjectSection",
    "Obstacle",
    "Problem",
    "Rotation",
    "ShapeSection",
    "StartSection",
    "Waypoint",
    "WeightsSection",
    "compute_contact_directions",
]


@dataclass(frozen=True)
class Problem(ProblemFields):
    """One manipulation problem: scene, overrides of it, start, goal, means, and the limits it is judged by.

    Its fields are those of :class:`~dexplan.problems.sections.ProblemFields`, one per table of the file.
    """

    __repr__ = brief_repr

    def _repr_html_(self) -> str:
        """Return the problem in words, as notebooks show it."""
        return as_html_table((), describe_problem(self))

    @classmethod
    def load(cls, path: str | Path) -> Problem:
        """Read and check a problem file; equal to the problem that was saved there."""
        return parse_file(Path(path), cls)
