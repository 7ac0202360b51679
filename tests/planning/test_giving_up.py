"""A search that stopped with something left to try says so, and names nothing that it has not shown to be short."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.search.options import SearchOptions
from dexplan.planning.tasks import dextrous_manipulation as dextrous
from dexplan.planning.tasks import grasp_adjustment as adjustment
from dexplan.planning.tasks import passes
from dexplan.planning.tasks.dextrous_manipulation import Order, plan_dextrous_manipulation
from dexplan.planning.tasks.ends import BUDGETS, Ends, choose_beginnings
from dexplan.planning.tasks.grasp_adjustment import plan_grasp_adjustment
from dexplan.planning.tasks.grasp_task import GraspTask
from dexplan.planning.tasks.object_manipulation import plan_rotation
from dexplan.planning.tasks.passes import PASSES, Outcome, Stop
from dexplan.planning.tasks.reorient import Turns
from dexplan.planning.tasks.stages import Stages
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.problems.problem import compute_contact_directions
from dexplan.problems.read import load_problem
from dexplan.spatial import VERTICAL, Array
from dexplan.witness.adjustments import draw_questions

USUAL = passes.USUAL_BUDGET


class Asked:
    """A random goal grasp, its hand, and where the fingers start."""

    def __init__(self, seed: int) -> None:
        question = next(draw_questions(load_problem("fig5_dextrous"), 1, seed))
        problem = question.as_problem("grasp_adjustment")
        assert not isinstance(problem.start.contacts_deg, str)
        self.hand: HandModel = pipeline.build_hand(problem, pipeline.build_scene(problem))
        self.X_WO = self.hand.object.X_WO_home
        self.R_WO = question.R_WO
        self.start: tuple[Array | None, ...] = tuple(compute_contact_directions(problem.start.contacts_deg))
        self.goal: tuple[Array | None, ...] = tuple(question.contacts)

    def pose(self) -> GraspTask:
        return GraspTask(self.hand, self.X_WO, self.start, self.goal, SearchOptions(USUAL))

    def adjust(self, budget: int = USUAL, *, keep_object: bool = False) -> Plan:
        return plan_grasp_adjustment(
            self.hand, self.X_WO, self.start, self.goal, SearchOptions(budget), keep_object=keep_object
        )


@pytest.fixture(scope="module")
def hard() -> Asked:
    """Return a goal grasp to whose first attitude no short gait comes."""
    return Asked(9009)


def check_gave_up(plan: Plan) -> None:
    assert plan.status == "budget_exhausted"
    assert f"gave up after {int(plan.statistics['nodes'])} nodes" in plan.reason
    assert "there may be a way" in plan.reason
    for physics in ("friction", "lighter", "nearer to opposite"):
        assert physics not in plan.reason


def test_other_attitudes_are_tried_before_one_gets_all_the_work(hard: Asked) -> None:
    """The first attitude's gaits used to take all of it, and what was left undone was called a lack of friction."""
    plan = hard.adjust()
    assert plan.is_solved, plan.reason


@pytest.mark.parametrize("work", [1])
def test_adjustments_that_are_given_up(hard: Asked, monkeypatch: pytest.MonkeyPatch, work: int) -> None:
    monkeypatch.setattr(adjustment, "WORK", work)
    plan = hard.adjust()
    check_gave_up(plan)
    assert f"a gait.node_budget above {USUAL} lets it go on" in plan.reason
    assert "attitudes in which the goal contacts lie within reach" in plan.reason


@pytest.mark.parametrize("order", ["object_first", "grasp_first", "simultaneous"])
def test_orders_that_are_given_up(hard: Asked, monkeypatch: pytest.MonkeyPatch, order: Order) -> None:
    monkeypatch.setattr(dextrous, "WORK", 0)
    goal = RotationGoal.from_attitude(hard.X_WO, hard.R_WO)
    plan = plan_dextrous_manipulation(
        hard.hand, goal, hard.start, hard.goal, SearchOptions(USUAL), order=order
    )
    if plan.status != "goal_grasp_inadmissible":
        check_gave_up(plan)


def test_a_larger_budget_does_go_on(hard: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is promised as a cure is one: the limits on work grow with gait.node_budget."""
    monkeypatch.setattr(adjustment, "WORK", 30)
    first = hard.adjust()
    check_gave_up(first)
    second = hard.adjust(4 * USUAL)
    assert second.statistics["nodes"] > first.statistics["nodes"]
    if not second.is_solved:
        assert f"above {4 * USUAL} lets it go on" in second.reason


def test_every_way_is_begun_before_any_gets_more(hard: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, int]] = []
    ways = [RotationGoal(hard.X_WO, VERTICAL, angle) for angle in (0.5, 1.0, 1.5)]
    motions = [adjustment.ObjectMotion(w.X_WO_start, w.axis_W, w.angle, np.zeros(3)) for w in ways]

    def run(self: Stages, way: passes.GraspWay, allowance: passes.Allowance) -> Outcome:
        assert allowance.part is not None
        asked.append((motions.index(way.before), PASSES.index(allowance.part)))
        self.work += 1
        return Outcome(why=Refusal(RefusalKind.WORK_USED_UP), stop=Stop.GAIT, gave_up=True)

    monkeypatch.setattr(Stages, "run", run)
    stages = Stages(hard.pose())
    done = stages.run_all([passes.GraspWay(m, adjustment.rest_at(hard.X_WO)) for m in motions], PASSES, 900)
    assert done.gave_up
    assert not done.ran_out
    numbers = [number for _, number in asked]
    assert numbers == sorted(numbers)
    assert {way for way, number in asked if number == 0} == {0, 1, 2}


def test_attitudes_between_those_of_the_grid_are_found() -> None:
    """The load presses these contacts together in one attitude in two hundred: steps of ten degrees miss them all."""
    asked = Asked(9054)
    task = asked.pose()
    turn = next(Turns(task).choose(), None)
    assert turn is not None
    X_WO = adjustment.ObjectMotion(asked.X_WO, turn.axis_W, turn.angle, np.zeros(3)).X_WO_end
    contacts, missing = task.land_goal(X_WO)
    assert not missing
    assert task.refuse_goal(X_WO, contacts) is None


def test_ends_go_on_where_they_stopped(hard: Asked) -> None:
    hold = plan_rotation(hard.hand, RotationGoal(hard.X_WO, VERTICAL, 0.0), hard.start, USUAL)
    beginnings = choose_beginnings(hard.hand, hold, hard.start, Admissibility(hard.hand))
    goal = RotationGoal.from_attitude(hard.X_WO, hard.R_WO)
    ends = Ends(hard.hand, goal, beginnings, hold.start_contacts, SearchOptions(USUAL))
    assert ends.get(0, 500, depth=0) is None or ends.opened <= BUDGETS[0]
    opened = ends.opened
    assert opened <= BUDGETS[0]
    if not ends.found:
        assert not ends.is_over
        ends.get(0, 100, depth=1)
        assert ends.opened > opened
