"""Random attitudes of bodies: questions that ask no planner, statics of two contacts, a false refusal that is contradicted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.contact.friction import SoftFinger
from dexplan.grasp.pairs import measure_chord_lean
from dexplan.grasp.wrench import compute_wrench
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.spatial import rotate_about
from dexplan.witness.bodies import Attempt, Question, ask_brute_force, draw_questions, list_ways
from dexplan.witness.body_rows import record, record_verdict, summarise
from dexplan.witness.grasp_grid import Statics, build_grid, get_pair_limits, spread_sites
from dexplan.witness.pair_judge import PairJudge
from dexplan.witness.pair_search import Outcome, PairSearch, find_axes
from dexplan.witness.several_contacts import measure_grasp_spare
from dexplan.witness.two_contacts import PairLimits, PairTorques, build_frames_into, is_closed, measure_spare


@pytest.fixture(scope="module")
def egg() -> Problem:
    return load_problem("egg")


@pytest.fixture(scope="module")
def question(egg: Problem) -> Question:
    """A start of the egg's, and an attitude 20 degrees from there about a slanting axis."""
    (drawn,) = draw_questions(egg, 1, 0)
    return replace(drawn, R_WO=rotate_about(np.array([0.6, 0.0, 0.8]), np.radians(20.0)))


def test_questions_come_from_their_seed_alone_and_ask_no_planner(
    egg: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_args: object, **_kwargs: object) -> None:
        raise AssertionError("the planner was asked")

    monkeypatch.setattr(pipeline, "plan", refuse)
    monkeypatch.setattr(Admissibility, "__init__", refuse)
    one, again = list(draw_questions(egg, 2, 2)), list(draw_questions(egg, 1, 3))
    assert [q.key for q in one] == ["egg_2", "egg_3"]
    assert np.array_equal(one[1].R_WO, again[0].R_WO)
    assert one[1].as_problem() == again[0].as_problem()
    assert not np.array_equal(one[0].R_WO, one[1].R_WO)
    assert sum(d is not None for d in one[0].start) == 2
    assert ask_brute_force(replace(one[0], R_WO=np.eye(3)), looks=50, sites=20).is_reachable


def test_two_contacts_bear_what_friction_floor_and_ceiling_leave() -> None:
    limits = PairLimits(SoftFinger(0.5, 0.002), 4.0, 12.0)
    arms = np.array([[[0.03, 0.0, 0.0], [-0.03, 0.0, 0.0]]])
    frames = build_frames_into(arms[0] / 0.03)[None]

    def spare(weight: float, torques: PairTorques | None = None) -> float:
        return float(measure_spare(arms, frames, np.array([0, 0, weight, 0, 0, 0.0]), limits, torques)[0])

    # Each bears half the weight by friction; the normal force between floor, friction's need and the ceiling is free.
    assert 0.0 <= spare(2.0) <= 4.0
    assert spare(11.9) >= 0.0
    assert spare(12.1) < 0.0
    # A weight beside the line between both asks for torsion, 2 mm times the normal force of both at most.
    for lever, holds in ((0.009, True), (0.013, False)):
        beside = np.array([0.0, 0.0, 4.0, 0.0, 0.0, 0.0])
        beside[3] = 4.0 * lever
        assert (float(measure_spare(arms, frames, beside, limits)[0]) >= 0.0) is holds
    # A joint that bears the normal force over 10 cm: 4 N and more ask for 0.4 N m.
    maps = np.zeros((1, 2, 1, 4))
    maps[..., 2] = 0.1
    for most, holds in ((0.45, True), (0.38, False)):
        torques = PairTorques(maps, np.zeros((1, 2, 1)), np.full((2, 1), most))
        assert (spare(2.0, torques) >= 0.0) is holds


def test_a_third_contact_has_to_be_pressed_and_the_others_bear_that() -> None:
    """Two opposite contacts hold; a third beside them pushes with its least normal force, which takes friction."""
    angles = np.radians([0.0, 180.0, 90.0])
    out = np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=1)
    arms, frames = 0.03 * out, build_frames_into(out)
    wrench = np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0])

    def spare(count: int, floor: float, sliding: float = 0.5) -> float:
        torques = PairTorques(np.zeros((1, count, 1, 4)), np.zeros((1, count, 1)), np.ones((count, 1)))
        limits = PairLimits(SoftFinger(sliding, 0.002), floor, 12.0)
        return measure_grasp_spare(arms[:count], frames[:count], wrench, limits, torques)

    both = PairLimits(SoftFinger(0.5, 0.002), 4.0, 12.0)
    assert spare(2, 4.0) == pytest.approx(
        float(measure_spare(arms[None, :2], frames[None, :2], wrench, both)[0]), abs=0.05
    )
    # The third pushes sideways with its floor at least: friction of the two others bears that, half each.
    assert spare(3, 4.0) > 0.0
    assert spare(3, 4.0, sliding=0.15) < 0.0
    assert spare(3, 0.1, sliding=0.15) > 0.0


def test_closure_is_that_of_nguyen_on_random_pairs() -> None:
    rng = np.random.default_rng(0)
    points, normals = rng.normal(size=(2, 4000, 2, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    ours, theirs = is_closed(points, normals, 0.9), measure_chord_lean(points, normals) < 0.9
    assert np.array_equal(ours, theirs)
    assert 0 < ours.sum() < 1000


def test_pairs_that_the_planner_bears_hold_here_too(egg: Problem) -> None:
    """The planner's forces keep an inscribed pyramid, these the cones themselves: what it accepts is accepted here."""
    hand = pipeline.build_hand(egg, pipeline.build_scene(egg))
    X = hand.object.X_WO_home
    grid = build_grid(spread_sites(hand.object.body, 30))
    ours = PairJudge(hand, X[None], grid)
    theirs, seen = Admissibility(hand), set[bool]()
    for a, b in np.argwhere(ours.tables.at(0)[0, 1]):
        contacts = ((0, int(a)), (1, int(b)))
        q = ours.place(0, contacts)
        bears = theirs.compute_margins(q, X, (0, 1)).is_admissible
        seen.add(bears)
        if bears:
            assert ours.measure_spare(0, contacts) >= 0.0
    assert True in seen
    statics = Statics(hand, grid.sites).find_holding(X[:3, :3])
    assert np.array_equal(statics, statics.T)


def test_ways_end_where_they_are_to(egg: Problem) -> None:
    hand = pipeline.build_hand(egg, pipeline.build_scene(egg))
    R = rotate_about(np.array([0.48, 0.6, 0.64]), 2.0)
    ways = list_ways(hand.object.X_WO_home, R, hand.p_WF_home)
    assert len(ways) == 10
    for way in ways:
        assert np.allclose(way[-1][:3, :3], R, atol=1e-9)
        steps = np.einsum("kij,kil->kjl", way[:-1, :3, :3], way[1:, :3, :3])
        assert np.degrees(np.arccos((np.trace(steps, axis1=1, axis2=2) - 1.0) / 2.0)).max() < 7.5 + 1e-6
    assert [len(find_axes(way)) for way in ways[:3]] == [1, 1, 2]


def test_fingers_reach_faces_beside_them() -> None:
    """Brute force found this gait where the planner tried only sites that face a finger's home."""
    (drawn,) = draw_questions(load_problem("cube_turn"), 1, 21)
    assert pipeline.plan(drawn.as_problem()).is_solved


def test_a_false_refusal_is_found_to_be_one(question: Question) -> None:
    solved = pipeline.plan(question.as_problem())
    assert solved.is_solved
    verdict = ask_brute_force(question, looks=300, sites=30)
    assert verdict.outcomes == (Outcome.FOUND,)
    false = Attempt(question, replace(solved, status="no_gait"), 0.5)
    plans, verdicts = [record(false)], [record_verdict(question, verdict)]
    told = summarise(plans, verdicts, [])
    assert told["refusals_contradicted"] == [question.key]
    assert told["agreement"] == 0.0
    plans[0] = record(replace(false, plan=solved))
    told = summarise(plans, verdicts, [])
    assert (told["agreement"], told["planned"], told["of_these_found"]) == (1.0, 1, 1)


def test_where_nothing_holds_at_the_end_brute_force_finds_nothing(egg: Problem) -> None:
    hand = pipeline.build_hand(egg, pipeline.build_scene(egg))
    way = np.tile(hand.object.X_WO_home, (3, 1, 1))
    way[2, 1, 3] += 0.3
    grid = build_grid(spread_sites(hand.object.body, 20))
    assert PairSearch(hand, way, grid, ((0, 0), (1, 0))).run(50) is Outcome.NOTHING_AT_END


@pytest.mark.parametrize("name", ["egg", "cube_turn", "mesh_turn"])
def test_sites_are_about_as_many_as_asked_for(name: str) -> None:
    problem = load_problem(name)
    body = pipeline.build_scene(problem).object.body
    assert 60 <= len(spread_sites(body, 90)) <= 90


def test_wrench_and_limits_are_the_hands(egg: Problem) -> None:
    hand = pipeline.build_hand(egg, pipeline.build_scene(egg))
    limits = get_pair_limits(hand)
    assert limits.friction.sliding == pytest.approx(0.98 * hand.friction.sliding)
    assert compute_wrench(hand.object.mass_properties, np.eye(3))[2] == pytest.approx(0.151 * 9.81)
