"""What a plan may answer: solved, or which kind of no, each with what it means and what helps."""

from __future__ import annotations

from enum import StrEnum


class Status(StrEnum):
    """The answer of a plan.  Its value is what ``plan.json`` says, its ``meaning`` what that says to the reader and what helps.

    A status says which kind of answer it is; the plan's ``refusal`` says what it was that stood in the way.
    """

    meaning: str

    def __new__(cls, value: str, meaning: str = "") -> Status:
        """Return the member written ``value`` in ``plan.json``."""
        member = str.__new__(cls, value)
        member._value_ = value
        member.meaning = meaning
        return member

    SOLVED = "solved", "the actions reach the goal"
    LIMIT_REACHED = (
        "limit_reached",
        "with fixed contacts the actions go as far as the grasp can, which is not the goal: ask for less, or allow gaits",
    )
    BUDGET_EXHAUSTED = (
        "budget_exhausted",
        "the search stopped with something left to try, so there may be a plan: raise gait.node_budget",
    )
    # before anything moves
    OBJECT_TOO_LIGHT = (
        "object_too_light",
        "no squeeze both carries so light an object and enters it little enough: use a heavier object, or more friction",
    )
    BLOCKED = "blocked", "something is in the way before anything moves: move or shrink what the reason names"
    START_UNREACHABLE = (
        "start_unreachable",
        "a finger cannot hold its start contact: move the contact towards the finger, or leave the start to the planner",
    )
    START_NOT_ALLOWED = (
        "start_not_allowed",
        "a start contact lies outside object.allowed_regions: move it inside, or leave the start to the planner",
    )
    START_INADMISSIBLE = (
        "start_inadmissible",
        "the start contacts do not hold the object: move them nearer to opposite, or as the reason says",
    )
    NO_ADMISSIBLE_PAIR = (
        "no_admissible_pair",
        "no two of the start contacts hold alone, so that no finger can be lifted: move two of them apart, or raise the friction",
    )
    NO_FORCE_CLOSURE_PAIR = (
        "no_force_closure_pair",
        "no two fingers can hold the object where it starts: what may help stands in the reason",
    )
    # the goal
    GOAL_UNREACHABLE = (
        "goal_unreachable",
        "no two fingers can hold the object at its goal: shorten goal.translation_m, or as the reason says",
    )
    GOAL_NOT_ALLOWED = (
        "goal_not_allowed",
        "a goal contact lies outside object.allowed_regions: move it inside, or widen a region",
    )
    GOAL_CONTACTS_UNREACHABLE = (
        "goal_contacts_unreachable",
        "a finger cannot reach its goal contact: move the contact towards the finger, or choose another attitude",
    )
    GOAL_GRASP_INADMISSIBLE = (
        "goal_grasp_inadmissible",
        "the goal contacts cannot hold the object: change them as the reason says",
    )
    # everything was tried
    NO_GAIT = (
        "no_gait",
        "every route was tried to its end and none leads to the goal: what may help stands in the reason",
    )
    NO_ADJUSTMENT = (
        "no_adjustment",
        "every way into the goal grasp was tried to its end and none leads there: what may help stands in the reason",
    )
    NO_DEXTROUS_PLAN = (
        "no_dextrous_plan",
        "in this order everything was tried to its end: try another goal.order, or what the reason says",
    )

    @property
    def is_solved(self) -> bool:
        """Whether the plan reaches the goal."""
        return self is Status.SOLVED

    @property
    def is_about_start(self) -> bool:
        """Whether the start contacts are refused, wherever the object is to go."""
        return self in (Status.START_UNREACHABLE, Status.START_NOT_ALLOWED, Status.START_INADMISSIBLE)
