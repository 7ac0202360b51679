"""The answer where no way to goal contacts was found: why, what was tried, and what would help."""

from __future__ import annotations

from dataclasses import replace

from dexplan.planning.tasks.goal_refusals import explain_separation, suggest_cure
from dexplan.planning.tasks.no import No
from dexplan.planning.tasks.passes import Outcome, explain_giving_up
from dexplan.planning.tasks.stages import Stages
from dexplan.plans.status import Status


def refuse_end(stages: Stages, status: Status, done: Outcome, after: str, tried: str = "") -> No:
    """Return the answer where ``done`` came to no goal.

    Args:
        stages: what was tried with.
        status: the kind of answer.
        done: why it came to no goal.
        after: what is added to the words.
        tried: what was tried, in words.
    """
    assert done.why is not None
    cure = None if done.gave_up else suggest_cure(done.why)
    return No(status, f"{_explain(stages, done, tried)}{after}", replace(done.why, cure=cure))


def _explain(stages: Stages, done: Outcome, tried: str) -> str:
    """Return why ``done`` came to no goal, what was ``tried``, and what would help.

    Where everything was tried from the start grasp, friction is what was short.  A search that gave up has shown nothing.
    """
    if done.gave_up:
        return explain_giving_up(done, stages.opened, tried, stages.task.options.node_budget)
    assert done.why is not None
    where = f" ({tried})" if tried else ""
    why, cure = f"{done.why}{where}", suggest_cure(done.why)
    if not stages.exhausted:
        return f"{why}; {cure}"
    return (
        f"{why}; every grasp that the start grasp leads to was tried, and {explain_separation(stages.task.hand)}; "
        f"raise the friction, lower friction.safety, choose another start grasp, or {cure}"
    )
