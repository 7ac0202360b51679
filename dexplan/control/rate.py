"""How often the controller has to be asked, and how fast fingers may then go, for a command is held for a whole tick."""

from __future__ import annotations

from dexplan.control.options import RATE

TWIST = 3.0e-3
"""Torque [N m] about the contact normal that may twist a tip at the beginning and at the end of a tick of 4 physics steps.

A position servo holds its command for a tick.  While a joint turns it is pulled ahead after each new command and has run past it
when the next one comes: the torque of the servo goes up and down by gain x joint speed x half a tick, around a mean that is the
one planned.  Read step by step (94 g, tips of 7 and 25 mm, 20 deg/s): 1.6 mN m up and down, mean off by 0.07 mN m.  It does not
depend on gains of the feedback, relaxation or feedforward, and falls to a third with ticks of half the length.  Largest seen in
seven random problems: 2.1 mN m; the rest is reserve, no more than what 2.5 mm of torsional friction, a safety of 1.3 and 5.5 N
have to spare (3.2 mN m), for such problems pass with 250 ticks per second."""
TWIST_SPEED = 0.35
"""The speed of the object [rad/s] with which it was read, 20 deg/s."""
SLOWEST = 0.02
"""No turn of the object is slowed down to less than this [rad/s]: without reserve in friction no speed leaves room."""
STEPS = 4
"""Physics steps in the ticks that ``TWIST`` was measured with; a tick of one step has no up and down."""
RATES = (RATE, 500.0, 1000.0)
"""Ticks per second to choose from."""
JOINT_STEP = 0.024
"""How far a joint of a free finger may turn in a tick [rad].

Pulled ahead by half of that (see ``TWIST``), a servo of 40 N m/rad gives 0.48 N m, a third of what it can; gravity and the way's
acceleration need the rest.  At 125 Hz and 6 rad/s, twice as far, servos gave 0.93 to 1.0 of their torque; 0.8 is allowed."""


def limit_joint_speed(speed: float, rate: float) -> float:
    """Return how fast joints of a free finger may turn [rad/s], ``speed`` at most, with ``rate`` ticks per second."""
    return min(speed, JOINT_STEP * rate)


def limit_object_speed(speed: float, rate: float, room: float, timestep: float) -> float:
    """Return how fast the object may turn [rad/s], ``speed`` at most: so that commands held for a tick twist tips by ``room``.

    Matters where a rate is given that is lower than :func:`choose_rate` would choose.  Arguments as there.
    """
    twist = _compute_twist(rate, timestep)
    return speed if twist <= room + 1e-9 else min(speed, max(SLOWEST, TWIST_SPEED * room / twist))


def choose_rate(room: float, timestep: float) -> float:
    """Return the least of ``RATES`` at which commands held for a tick twist tips by at most ``room`` [N m], else the greatest.

    Args:
        room: what the true torsional friction bears beyond what forces are planned with, at the squeeze aimed at [N m].
        timestep: of the physics [s].
    """
    for rate in RATES:
        if _compute_twist(rate, timestep) <= room + 1e-9:
            return rate
    return RATES[-1]


def _compute_twist(rate: float, timestep: float) -> float:
    """Return the torque [N m] by which a command that is held for a tick may twist a tip at :data:`TWIST_SPEED`."""
    steps = 1.0 / (rate * timestep)
    return TWIST * max(0.0, steps - 1.0) / (STEPS - 1.0)
