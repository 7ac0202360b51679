"""How hard the fingers squeeze: as hard as asked, less where a light object would be entered too deep, or not at all."""

from __future__ import annotations

import math
from dataclasses import dataclass

from dexplan.contact.friction import SoftFinger
from dexplan.plans.forces import NormalForces
from dexplan.plans.refusal import Cure, Refusal, RefusalKind
from dexplan.spatial import GRAVITY

USUAL = NormalForces()
"""The normal forces of a problem that asks for none."""
MEASURED_AT = 5.5
"""Normal force [N] with which ``friction.safety`` was found to cover what execution adds (see :data:`FOLLOWING_FORCE`)."""
FLOOR_OF_CEILING = 0.48
"""The least normal force is at most this share of the greatest one: while fingers are exchanged one contact bears what two others
on its far side press, and has to stay below its greatest force while they stay above their least.  Binds for light objects only,
whose greatest force lies a quarter above the one aimed at (4.3 g: no forces existed for three contacts without it)."""
DEPTH, DEPTH_CEILING = 100e-6, 125e-6
"""How deep [m] a tip may be predicted to stand in the object under the force it aims at, and under the greatest one.

The simulator's contacts overshoot what is predicted at rest by up to 12 % (2.7 g, while another finger lands), and 150 um are the
judge's limit: 125 um leave a fifth."""
TOUCH_DOWN, TOUCH_DOWN_PER_MASS = 0.30, 20.0
"""Force [N] with which a landing tip hits the object, and what an object's own mass adds to that [N/kg].

Measured step by step over the six landings of a gait, at ``Timing.touch_speed`` (10 mm/s): 0.29 to 0.36 N at 2.7 g, 1.0 to 1.6 N
at 60 g.  The contact takes the landing speed away within its time constant, from the object and from the fingers behind it.  With
more squeeze the force that the finger is told to bear next, a quarter of the squeeze, hides this (0.5 N for 2.7 g at 1.2 N).  The
two contacts that hold take it sideways: for 2.7 g all slid with 0.3 N (7 um), one of six with 0.6 N (2 um), none with 1.2 N."""
LEAST = 1.1
"""Least squeeze [N] with which fingers are exchanged: with 0.74 and 1.06 N (1.6 and 2.3 g) landing fingers used 0.94 and 0.99 of
the true cone, for what :data:`FOLLOWING_FORCE` says."""
FOLLOWING_FORCE = 0.25
"""Friction that following errors take from a contact, as a normal force [N].  A finger that takes over load bears up to 0.09 N
less than it is told and is twisted by up to 1 mN m that nobody planned, whatever the squeeze (measured at 1.6, 2.3 and 2.7 g).
At 5.5 N ``friction.safety`` covers that where torsional friction is 2.5 mm; with less squeeze, less friction is believed.
Measured while the controller followed within 150 ms; within 20 ms, as now, errors are a third, so this
and what follows refuse more than they need to."""
FOLLOWING_TORQUE, LEFT_FOR_TORSION = 1.2e-3, 0.8
"""Torque [N m] by which two holding tips twist against one another while they carry the object, for their joints lag by unlike
angles, and the share of the believed torsional friction that it may use.

Measured at 3.8 g, 0.27 sliding and 0.8 mm torsional friction, with ticks of 4 ms: 1.2 mN m, nearly all that the contacts bore.
Shorter ticks (``choose_rate``) leave less; how much less this rule could ask for was not measured again."""
CONE_SHARE = 0.7
"""Share of the believed friction that load and touch-down may use of the least squeeze."""


@dataclass(frozen=True)
class Squeeze:
    """Normal forces [N]: what a loaded contact aims at, the least and the greatest; ``refusal`` says why there is none."""

    normal: float
    floor: float
    ceiling: float
    refusal: Refusal | None = None

    @property
    def friction_share(self) -> float:
        """Share of the believed friction that planner and controller may count on; 1 from :data:`MEASURED_AT` on."""
        return min(1.0, 1.0 - FOLLOWING_FORCE * (1.0 / max(self.normal, LEAST) - 1.0 / MEASURED_AT))


def choose_squeeze(
    mass: float, friction: SoftFinger, bearable: float, greatest: float, asked: NormalForces = USUAL
) -> Squeeze:
    """Return how hard an object of ``mass`` [kg] is squeezed: as asked, less where the tips would stand too deep in it.

    More than the usual target is asked for by somebody who means it, and is refused where it is too deep; the usual one, or less,
    is lowered.  How little is asked for is the asker's business: less squeeze, less friction is believed.

    Args:
        friction: the believed one.
        bearable: normal force [N] under which tips are predicted to stand :data:`DEPTH` deep in the object at rest.
        greatest: the same for :data:`DEPTH_CEILING`.
        asked: what the problem asks for.
    """
    normal = min(asked.target, bearable)
    landing = TOUCH_DOWN + TOUCH_DOWN_PER_MASS * mass
    needed = max(
        LEAST,
        (mass * GRAVITY + landing) / (2.0 * CONE_SHARE * friction.sliding),
        FOLLOWING_TORQUE / (LEFT_FOR_TORSION * friction.torsional),
    )
    refusal = None
    if normal < min(needed, asked.target, USUAL.target):
        words = (
            f"an object of {1e3 * mass:.3g} g is too light for this hand: squeezed with more than {normal:.3g} N its contacts "
            f"are deeper than {1e6 * DEPTH:.0f} um in the simulator, and to carry it, and to exchange fingers, takes "
            f"{needed:.3g} N"
        )
        cure = Cure(
            "use a heavier object (object.mass_kg) or more friction (friction.sliding, friction.torsional_m)"
        )
        refusal = Refusal(RefusalKind.TOO_LIGHT, (), normal, needed, cure, words=words)
    elif normal < asked.target and asked.target > USUAL.target:
        words = (
            f"an object of {1e3 * mass:.3g} g is too light for the {asked.target:.3g} N that are asked for: squeezed with more "
            f"than {normal:.3g} N its contacts are deeper than {1e6 * DEPTH:.0f} um in the simulator"
        )
        least = math.floor(1e2 * normal) / 1e2
        cure = Cure(
            f"ask for at most {least:g} N (forces.normal_N), or use a heavier object (object.mass_kg)"
        )
        refusal = Refusal(RefusalKind.TOO_LIGHT, (), normal, asked.target, cure, words=words)
    ceiling = max(normal, min(asked.ceiling, greatest))
    floor = asked.floor if normal == asked.target else asked.floor / asked.target * normal
    if ceiling < asked.ceiling:
        floor = min(floor, FLOOR_OF_CEILING * ceiling)
    return Squeeze(normal, floor, ceiling, refusal)
