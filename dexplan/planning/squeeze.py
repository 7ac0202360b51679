"""How hard the fingers squeeze: as hard as ever, less where a light object would be entered too deep, or not at all."""

from __future__ import annotations

from dataclasses import dataclass

from dexplan.contact.friction import SoftFinger
from dexplan.spatial import GRAVITY

NORMAL_FORCE = 5.5
"""Normal force that a loaded contact aims at [N]; the force QP raises it where the load asks for more."""
FLOOR_SHARE, CEILING = 4.0 / 5.5, 12.0
"""Least normal force of a loaded contact over the one it aims at, and the greatest one [N]."""
FLOOR_OF_CEILING = 0.45
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
LEAST = 0.9
"""Least squeeze [N] with which fingers are exchanged.  A finger that takes over load bears up to 0.07 N less than it is told
(measured at 1.6 g, whatever the squeeze): a tenth of a second after it has landed, when it has half of its load, that is what the
judge leaves between the believed cone and 0.9 of the true one from this squeeze on (0.74 N: 0.94 of the cone used)."""
CONE_SHARE = 0.7
"""Share of the believed friction that load and touch-down may use of the least squeeze."""


@dataclass(frozen=True)
class Squeeze:
    """Normal forces [N]: what a loaded contact aims at, the least and the greatest; ``refusal`` says why there is none."""

    normal: float
    floor: float
    ceiling: float
    refusal: str = ""


def choose_squeeze(mass: float, friction: SoftFinger, bearable: float, greatest: float) -> Squeeze:
    """Return how hard an object of ``mass`` [kg] is squeezed.

    Args:
        friction: the believed one.
        bearable: normal force [N] under which tips are predicted to stand :data:`DEPTH` deep in the object at rest.
        greatest: the same for :data:`DEPTH_CEILING`.
    """
    normal = min(NORMAL_FORCE, bearable)
    landing = TOUCH_DOWN + TOUCH_DOWN_PER_MASS * mass
    needed = max(LEAST, (mass * GRAVITY + landing) / (2.0 * CONE_SHARE * friction.sliding))
    refusal = ""
    if normal < min(needed, NORMAL_FORCE):
        refusal = (
            f"an object of {1e3 * mass:.3g} g is too light for this hand: squeezed with more than {normal:.2g} N its contacts "
            f"are deeper than {1e6 * DEPTH:.0f} um in the simulator, and to carry it while another finger touches down takes "
            f"{needed:.2g} N; use a heavier object (object.mass_kg) or more friction (friction.sliding)"
        )
    ceiling = max(normal, min(CEILING, greatest))
    return Squeeze(normal, min(FLOOR_SHARE * normal, FLOOR_OF_CEILING * ceiling), ceiling, refusal)
