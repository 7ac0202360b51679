"""Can the hand carry this state?  Margins that shrink as the state gets worse, and a reason where it is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dexplan.contact.friction import SoftFinger
from dexplan.grasp.closed_forms.pair import required_pair_preload
from dexplan.planning.admissible.admissibility import Admissibility, Margins, worst
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.refusal import RefusalKind
from dexplan.spatial import Array, build_frame, direction_from_angles, make_pose

MIDDLE_DEG = 60.0
"""Half way between fingers 1 and 2: pairs are laid symmetrically about it."""


def hold(hand: HandModel, apart_deg: float) -> Array:
    """Return postures (F, J): fingers 1 and 2 on the equator, so far apart, finger 3 at home."""
    q = hand.q_home.copy()
    for f, azimuth in enumerate((MIDDLE_DEG - 0.5 * apart_deg, MIDDLE_DEG + 0.5 * apart_deg)):
        n = direction_from_angles(azimuth, 0.0)
        X = make_pose(build_frame(-n))
        point = hand.object.surface.radial(n) + hand.fingers[f].tip_radius * n
        X[:3, 3] = hand.object.X_WO_home[:3, 3] + point
        solved, reached = hand.workspaces[f].solve(X[None])
        assert reached[0]
        q[f] = solved[0]
        q[f, -1] = 0.0
    return q


def measure(hand: HandModel, apart_deg: float, axis_W: Array | None = None) -> Margins:
    """Return the margins of that pair."""
    return Admissibility(hand).compute_margins(
        hold(hand, apart_deg), hand.object.X_WO_home, (0, 1), axis_W=axis_W
    )


def relaxed(hand: HandModel) -> HandModel:
    """Return the hand with joints that are no matter and the whole cone to use: only the contacts decide."""
    return replace(hand, limits=replace(hand.limits, torque_share=1e3, cone_share=1.0))


def test_load_margin_shrinks_with_the_pair_angle_down_to_refusal(hand: HandModel) -> None:
    rows = [measure(relaxed(hand), apart) for apart in np.arange(178.0, 126.0, -4.0)]
    load = np.array([row.load for row in rows])
    carried = np.isfinite(load)
    assert carried[0]
    assert not carried[-1]
    assert not (np.diff(carried.astype(int)) > 0).any()  # once refused, refused for good
    assert (np.diff(load[carried]) <= 1e-4).all()
    assert all(0.0 <= value < 1.0 for value in load[carried])
    for row, fine in zip(rows, carried, strict=True):
        assert row.is_admissible == fine
        assert fine or "friction" in str(row.refusal)


def test_acceleration_costs_load(hand: HandModel) -> None:
    still, turning = measure(hand, 150.0), measure(hand, 150.0, np.array([0.0, 0.0, 1.0]))
    assert turning.load < still.load + 1e-6
    assert turning.is_admissible


@pytest.mark.parametrize(("mass", "sliding"), [(0.06, 0.42), (0.06, 0.3), (0.25, 0.42), (0.5, 0.6)])
def test_load_agrees_with_the_closed_form_of_a_pair(hand: HandModel, mass: float, sliding: float) -> None:
    """Ceiling 12 N and full use of the cone; in between lies only what the inscribed polytope keeps back."""
    friction = SoftFinger(sliding, hand.friction.torsional)
    heavy = relaxed(replace(hand, friction=friction, object=hand.object.weighing(mass)))
    radius = float(np.linalg.norm(hand.object.surface.radial(np.array([1.0, 0.0, 0.0]))))
    outcomes = set()
    for apart in np.arange(178.0, 126.0, -3.0):
        phi = float(np.radians(apart))
        least = required_pair_preload(sliding, friction.torsional, mass, radius, phi)
        surely = required_pair_preload(
            sliding, friction.torsional, mass, radius, phi, friction.facet_inradius
        )
        solved = bool(np.isfinite(measure(heavy, apart).load))
        if surely <= heavy.limits.normal_ceiling:
            assert solved, f"{apart} deg needs {surely:.2f} N at most"
        elif least > heavy.limits.normal_ceiling:
            assert not solved, f"{apart} deg needs {least:.2f} N at least"
        else:
            continue
        outcomes.add(solved)
    assert outcomes == {True, False}


def test_refusals_say_what_is_wrong(hand: HandModel) -> None:
    good = hold(hand, 150.0)
    X_WO = hand.object.X_WO_home
    check = Admissibility(hand)
    fine = check.compute_margins(good, X_WO, (0, 1))
    assert fine.is_admissible
    assert fine.refusal is None

    spun = good.copy()
    spun[0, -1] = hand.fingers[0].chain.upper[-1] - np.radians(2.0)  # the tip's own roll: the contact stays
    refusal = check.compute_margins(spun, X_WO, (0, 1)).refusal
    assert refusal is not None
    assert str(refusal) == "a joint of finger_1 comes within 2.0 deg of its limit"
    assert (refusal.kind, refusal.needed) == (RefusalKind.JOINT_LIMIT, hand.limits.joint_margin)

    stretched = good.copy()
    stretched[0, 4] = 0.0  # both rolls of the wrist in one line
    refusal = check.compute_margins(stretched, X_WO, (0, 1)).refusal
    assert refusal is not None
    assert (refusal.kind, refusal.subject) == (RefusalKind.SINGULAR, ("finger_1",))

    crowded = hold(hand, 20.0)
    refusal = check.compute_margins(crowded, X_WO, (0, 1)).refusal
    assert refusal is not None
    assert (refusal.kind, refusal.subject) == (RefusalKind.NEAR_FINGER, ("finger_1/tip", "finger_2/tip"))
    assert refusal.measured is not None
    assert str(refusal) == f"finger_1/tip and finger_2/tip come within {1e3 * refusal.measured:.1f} mm"

    slippery = Admissibility(replace(hand, friction=SoftFinger(0.1, hand.friction.torsional)))
    row = slippery.compute_margins(good, X_WO, (0, 1))
    assert row.refusal is not None
    assert row.refusal.kind is RefusalKind.LOAD
    assert str(row.refusal) == "the contacts cannot carry the load (friction)"
    assert row.load == -np.inf


def test_finger_in_the_way_is_named(hand: HandModel) -> None:
    """A tip on the ball is a contact for a finger that holds or lands, an obstacle otherwise."""
    q = hold(hand, 150.0)
    check, X_WO = Admissibility(hand), hand.object.X_WO_home
    assert not check.compute_margins(q, X_WO, (0,)).is_admissible
    refusal = check.compute_margins(q, X_WO, (0,)).refusal
    assert refusal is not None
    assert "finger_2/tip" in refusal.subject
    assert refusal.kind is RefusalKind.NEAR_OBJECT
    landing = check.compute_margins(q, X_WO, (0,), landing=(1,))
    assert landing.refusal is None or landing.refusal.kind is RefusalKind.LOAD


def test_worst_of_a_motion_takes_the_worst_of_each(hand: HandModel) -> None:
    rows = [measure(hand, apart) for apart in (170.0, 150.0)]
    merged = worst(rows)
    for key, pick in (("load", min), ("joint_deg", min), ("clearance_mm", min), ("torque_share", max)):
        assert merged[key] == pick(row.as_dict()[key] for row in rows)
    assert worst([]) == {}


def test_answers_do_not_depend_on_what_was_asked_before(hand: HandModel) -> None:
    """The force solvers are kept warm from state to state."""
    warm, X_WO = Admissibility(hand), hand.object.X_WO_home
    for apart in (170.0, 130.0, 150.0, 128.0, 142.0):
        row, fresh = warm.compute_margins(hold(hand, apart), X_WO, (0, 1)), measure(hand, apart)
        assert row.is_admissible == fresh.is_admissible
        assert row.load == pytest.approx(fresh.load, abs=2e-3)
