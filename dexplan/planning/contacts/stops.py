"""What ends the motion that a contact is carried through, as a value: "finger 1 came to .."."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class StopKind(StrEnum):
    """What kind of end; its text is the end in words, ``{who}`` for what it is about."""

    WORKSPACE = "the end of its workspace"
    JOINT = "the limit of {who}"
    LAST_JOINT = "the limit of its last joint"
    SINGULAR = "a singular posture"
    BRANCH = "another branch of its postures"
    POLE = "its tip's pole, {who} deg off"
    NEAR = "{who} too near"
    WHOLE_TURN = "a whole turn"
    SHIFT_END = "the end of the shift"
    LEG_END = "the end of this leg"
    GOAL = "the goal"
    ONE_PAIR = "only one pair of fingers moves the object"
    SHORTER = "a shorter motion leaves the better next grasp"


@dataclass(frozen=True, slots=True)
class Stop:
    """One end: ``who`` names the joint or the bodies that it is about, where it is about some."""

    kind: StopKind
    who: str = ""

    def __str__(self) -> str:
        return self.kind.value.format(who=self.who)


WORKSPACE_END, SINGULAR, LAST_JOINT = (
    Stop(StopKind.WORKSPACE),
    Stop(StopKind.SINGULAR),
    Stop(StopKind.LAST_JOINT),
)
"""What stops a finger where no posture reaches, where one is singular, and where its last joint comes to its limit."""
