"""What became of each contact: stuck, creeping, rolling, bouncing, slipping, spinning, lost; and what made it so.

Coulomb slip happens at the border of the friction cone and friction is what is missing; creep happens inside the cone, comes
from MuJoCo's soft constraints, and no friction cures it.  The two are told apart by the measured utilisation of the
contact's own cone, never by speed.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from dexplan.spatial import Array
from dexplan.testing.episodes import Episode, find_episodes
from dexplan.testing.measurement import Measurement
from dexplan.testing.trembling import find_border, is_trembling


class Kind(StrEnum):
    """What can be said of a contact episode, from harmless to grave: a verdict is the gravest that applies."""

    STUCK = "stuck"
    CREEPING = "creeping"
    ROLLING = "rolling"
    BOUNCING = "bouncing"
    TORSIONAL_SLIP = "torsional slip"
    COULOMB_SLIP = "Coulomb slip"
    LOST = "lost"
    # What goes with a verdict and is none itself.
    OVERLOADED = "overloaded"
    PENETRATING = "penetrating"
    UNSOLVED = "solver stopped early"


GRAVITY_OF_KINDS = tuple(Kind)[: tuple(Kind).index(Kind.LOST) + 1]


@dataclass(frozen=True)
class VerdictOptions:
    """From where on something counts.  Raising a number makes the judgement more lenient, except ``gap_s``."""

    gap_s: float = 0.05
    """A contact that is missing for no longer goes on: a sliding one hops, and that is one touch."""
    slip_mm: float = 0.1
    """Path at the border of the cone: dexplan's own runs show 0.10 to 0.14 mm of it at touch and lift alone."""
    slip_s: float = 0.02
    """Time at the border below which it is trembling, unless the path of that time alone is ``slip_mm``: a box on pyramidal
    cones goes from corner to corner in a few milliseconds."""
    spin_deg: float = 1.0
    """Turning at the border of the cone, or where nothing resists turning: a tenth of a millimetre at 6 mm."""
    creep_um_s: float = 1.0
    """Drift inside the cone: what dexplan lets a contact at rest do."""
    creep_deg_s: float = 0.05
    """Turning inside the cone: 1 um/s at the rim of a patch of about a millimetre."""
    roll_deg: float = 1.0
    bounces: int = 3
    """Short losses in one episode."""
    settle_s: float = 0.1
    """Creep is read only when a contact is as old as this: a touch needs that long to come to rest."""
    window_s: float = 0.1
    """Creep is the net motion over this time, so that trembling in place is none."""
    penetration_um: float = 1000.0
    """No reason but experience: MuJoCo's default contact is 1600 um deep under 2 N on 50 g, and looks it."""
    saturated_s: float = 0.01
    """Time for which an actuator gives all it can before that is said: shorter peaks come with every touch."""
    newton_share: float = 0.01
    """Share of the object's weight by which contact forces may miss Newton's law."""


@dataclass(frozen=True)
class Finding:
    """One thing that was seen: from when on, how much, in which unit, and what it would have been by theory (NaN: none)."""

    kind: Kind
    start_s: float
    amount: float
    unit: str
    predicted: float = float("nan")
    note: str = ""

    def __str__(self) -> str:
        told = f"{self.kind} from {self.start_s:.3f} s: {self.amount:.3g} {self.unit}"
        if np.isfinite(self.predicted):
            told += f" (predicted {self.predicted:.3g})"
        return f"{told}; {self.note}" if self.note else told


@dataclass(frozen=True)
class Verdict:
    """The verdict on one contact episode: its gravest kind, and everything that was found, gravest first.

    ``utilisation_max`` is read once the touch has settled; ``normal_force_mean`` [N].
    """

    on: str
    by: str
    start_s: float
    end_s: float
    kind: Kind
    findings: tuple[Finding, ...]
    utilisation_max: float
    normal_force_mean: float

    def __str__(self) -> str:
        told = f"{self.by} on {self.on}, {self.start_s:.3f} to {self.end_s:.3f} s: {self.kind}"
        in_time = sorted(self.findings, key=lambda finding: finding.start_s)
        return "\n".join([told, *(f"    {finding}" for finding in in_time)])

    def find(self, kind: Kind) -> Finding | None:
        """Return the finding of ``kind``, None without one."""
        return next((finding for finding in self.findings if finding.kind == kind), None)


@dataclass(frozen=True)
class Judgement:
    """The verdicts on a run's contact episodes, in order of their start, and what concerns the run as a whole."""

    verdicts: tuple[Verdict, ...]
    findings: tuple[Finding, ...]

    def __str__(self) -> str:
        return "\n".join([*map(str, self.verdicts), *map(str, self.findings)])

    def of(self, by: str, on: str | None = None) -> tuple[Verdict, ...]:
        """Return the verdicts on the contacts of a party, in order."""
        return tuple(v for v in self.verdicts if v.by == by and on in (None, v.on))


def judge_contacts(measured: Measurement, options: VerdictOptions | None = None) -> Judgement:
    """Return what became of every contact episode of a run."""
    options = VerdictOptions() if options is None else options
    verdicts = [_judge(measured, episode, options) for episode in find_episodes(measured, options.gap_s)]
    unsolved = _find_unsolved(measured, options)
    return Judgement(tuple(verdicts), () if unsolved is None else (unsolved,))


def _judge(measured: Measurement, episode: Episode, options: VerdictOptions) -> Verdict:
    pairs, rows = episode.pairs, episode.rows
    found = [
        _find_lost(episode),
        *_find_slip(measured, episode, options),
        _find_bouncing(episode, options),
        _find_rolling(measured, episode, options),
        _find_creep(measured, episode, options),
        _find_overload(measured, episode, options),
        _find_penetration(measured, episode, options),
    ]
    findings = tuple(finding for finding in found if finding is not None)
    graver = [f.kind for f in findings if f.kind in GRAVITY_OF_KINDS]
    kind = max(graver, key=GRAVITY_OF_KINDS.index, default=Kind.STUCK)
    used, age = pairs.utilisation[rows], measured.time[pairs.sample[rows]] - episode.start_s
    # Every touch is at its border for a moment; where there is more than the touch, that is what is told.
    used = used[age >= options.settle_s] if (age >= options.settle_s).any() else used
    return Verdict(
        on=measured.parties.names[episode.on],
        by=measured.parties.names[episode.by],
        start_s=episode.start_s,
        end_s=episode.end_s,
        kind=kind,
        findings=findings,
        utilisation_max=float(np.nanmax(used)) if np.isfinite(used).any() else float("nan"),
        normal_force_mean=float(np.average(pairs.normal_force[rows], weights=episode.duration)),
    )


def _find_lost(episode: Episode) -> Finding | None:
    if not episode.is_lost:
        return None
    return Finding(
        Kind.LOST, episode.end_s, episode.end_s - episode.start_s, "s", note="after so long a touch"
    )


def _find_slip(measured: Measurement, episode: Episode, options: VerdictOptions) -> list[Finding]:
    """Find slip and spin at the border of the cone; both at once are told by what dissipates more, then the other."""
    pairs, rows, dt = episode.pairs, episode.rows, episode.duration
    is_bare = ~np.isfinite(pairs.utilisation[rows])
    at_border = is_bare | find_border(measured, episode, _number_windows(measured, episode, options))
    # A single contact of condim 3 is not in the way of turning, wherever it is in its cone.
    is_free_to_turn = (pairs.dim[rows] < 4) & (pairs.count[rows] == 1)
    normal = pairs.normal_W[rows]
    slip, spin = np.linalg.norm(pairs.slip_W[rows], axis=1), np.abs(pairs.spin[rows])
    torque = np.abs(np.einsum("ni,ni->n", pairs.moment_W[rows], normal))
    pull = np.abs(np.einsum("ni,ni->n", pairs.force_W[rows], pairs.slip_W[rows]))
    at_border = _drop_short_runs(at_border, dt, slip * dt, options)
    path = np.where(at_border, slip * dt, 0.0)
    turn = np.where(at_border | is_free_to_turn, spin * dt, 0.0)
    work_slip, work_spin = float((pull * dt)[at_border].sum()), float((torque * spin * dt)[at_border].sum())
    time, found = measured.time[pairs.sample[rows]], []
    millimetres, degrees = 1e3 * float(path.sum()), float(np.degrees(turn.sum()))
    is_mostly_spin = work_spin > work_slip
    if millimetres > options.slip_mm and not (is_mostly_spin and work_slip < 0.1 * work_spin):
        note = "this contact has no friction" if is_bare.all() else ""
        start = _begin(time, 1e3 * path, options.slip_mm)
        found.append(Finding(Kind.COULOMB_SLIP, start, millimetres, "mm", note=note))
    is_unresisted = bool(is_free_to_turn.any()) and millimetres <= options.slip_mm
    if degrees > options.spin_deg and (is_unresisted or work_spin > 0.1 * work_slip):
        note = "nothing resists turning: one contact of condim 3" if is_free_to_turn.any() else ""
        start = _begin(time, np.degrees(turn), options.spin_deg)
        found.append(Finding(Kind.TORSIONAL_SLIP, start, degrees, "deg", note=note))
    # The verdict is the graver kind; where turning takes most of the work, slip is said but is not it.
    if is_mostly_spin and len(found) == 2:
        return [found[1]]
    return found


def _number_windows(measured: Measurement, episode: Episode, options: VerdictOptions) -> NDArray[np.intp]:
    """Return the number of the window (K,) that each row of an episode is in."""
    time = measured.time[episode.pairs.sample[episode.rows]]
    return ((time - time[0]) // options.window_s).astype(np.intp)


def _drop_short_runs(
    at_border: NDArray[np.bool_], dt: Array, path: Array, options: VerdictOptions
) -> NDArray[np.bool_]:
    """Return ``at_border`` without those runs that are over soon and lead nowhere: trembling is no slip."""
    edge = np.flatnonzero(np.diff(at_border.astype(np.int8), prepend=0, append=0))
    out = at_border.copy()
    for start, stop in zip(edge[::2], edge[1::2], strict=True):
        run = slice(start, stop)
        if dt[run].sum() < options.slip_s and 1e3 * path[run].sum() <= options.slip_mm:
            out[run] = False
    return out


def _begin(time: Array, path: Array, allowed: float) -> float:
    """Return when ``path``, added up, first exceeds what is allowed."""
    return float(time[int(np.argmax(np.cumsum(path) > allowed))])


def _find_bouncing(episode: Episode, options: VerdictOptions) -> Finding | None:
    if episode.gaps < options.bounces:
        return None
    return Finding(Kind.BOUNCING, episode.start_s, float(episode.gaps), "short losses")


def _find_rolling(measured: Measurement, episode: Episode, options: VerdictOptions) -> Finding | None:
    pairs, rows = episode.pairs, episode.rows
    dt, time = episode.duration, measured.time[pairs.sample[rows]]
    window = _number_windows(measured, episode, options)
    everything = np.ones(len(rows), dtype=bool)
    rolled = np.degrees(_average_windows(pairs.roll_W[rows], dt, window, everything) * dt.sum())
    if rolled <= options.roll_deg:
        return None
    turn = np.degrees(np.linalg.norm(pairs.roll_W[rows], axis=1) * dt)
    return Finding(Kind.ROLLING, _begin(time, turn, options.roll_deg), float(rolled), "deg")


def _find_creep(measured: Measurement, episode: Episode, options: VerdictOptions) -> Finding | None:
    """Find drift inside the cone, and what MuJoCo's softness predicts of it."""
    pairs, rows, dt = episode.pairs, episode.rows, episode.duration
    time = measured.time[pairs.sample[rows]]
    window = _number_windows(measured, episode, options)
    is_inside = np.isfinite(pairs.utilisation[rows]) & ~find_border(measured, episode, window)
    counts = (time >= episode.start_s + options.settle_s) & is_inside
    if not counts.any():
        return None
    rate = _average_windows(pairs.slip_W[rows], dt, window, counts)
    turn = _average_windows(pairs.spin[rows][:, None], dt, window, counts)
    bound = "an upper bound, for noslip is on" if measured.physics.noslip_iterations else ""
    begin = float(time[counts][0])
    if 1e6 * rate > options.creep_um_s:
        drift = pairs.net_creep_W if is_trembling(measured, episode, counts) else pairs.creep_W
        predicted = 1e6 * _average_windows(drift[rows], dt, window, counts)
        return Finding(Kind.CREEPING, begin, 1e6 * rate, "um/s", predicted, bound)
    if np.degrees(turn) > options.creep_deg_s and (pairs.dim[rows] >= 4).all():
        predicted = _average_windows(pairs.creep_spin[rows][:, None], dt, window, counts)
        return Finding(
            Kind.CREEPING, begin, float(np.degrees(turn)), "deg/s", float(np.degrees(predicted)), bound
        )
    return None


def _average_windows(rate: Array, dt: Array, window: NDArray[np.intp], counts: NDArray[np.bool_]) -> float:
    """Return the mean over windows of the length of the net motion (K, d) in each, per time that counts."""
    weight = np.where(counts, dt, 0.0)
    size = int(window.max()) + 1
    spent = np.bincount(window, weight, minlength=size)
    moved = np.stack([np.bincount(window, weight * column, minlength=size) for column in rate.T], axis=1)
    return float(np.linalg.norm(moved, axis=1).sum() / spent.sum())


def _find_overload(measured: Measurement, episode: Episode, options: VerdictOptions) -> Finding | None:
    """Find an actuator of either party that was at its end while they touched."""
    drives = measured.drives[:, episode.on] | measured.drives[:, episode.by]
    samples = episode.pairs.sample[episode.rows]
    at_end = measured.saturated[samples] & drives
    spent = (at_end * episode.duration[:, None]).sum(axis=0)
    if not len(spent) or spent.max() <= options.saturated_s:
        return None
    worst = int(np.argmax(spent))
    start = float(measured.time[samples[int(np.argmax(at_end[:, worst]))]])
    return Finding(Kind.OVERLOADED, start, float(spent[worst]), "s", note=measured.actuators[worst])


def _find_penetration(measured: Measurement, episode: Episode, options: VerdictOptions) -> Finding | None:
    depth = 1e6 * episode.pairs.penetration[episode.rows]
    deepest = int(np.argmax(depth))
    if depth[deepest] <= options.penetration_um:
        return None
    when = float(measured.time[episode.pairs.sample[episode.rows[deepest]]])
    return Finding(Kind.PENETRATING, when, float(depth[deepest]), "um")


def _find_unsolved(measured: Measurement, options: VerdictOptions) -> Finding | None:
    """Find contact forces that miss Newton's law by more than a share of the object's weight, in one sample of a hundred."""
    residual, weight = measured.newton_residual, measured.physics.object_weight
    known = np.isfinite(residual)
    if not known.any() or not np.isfinite(weight):
        return None
    is_off = known & (residual > options.newton_share * weight)
    if is_off.sum() <= 0.01 * known.sum():
        return None
    worst = float(residual[is_off].max())
    start = float(measured.time[int(np.argmax(is_off))])
    return Finding(
        Kind.UNSOLVED, start, worst, "N off Newton's law", note="raise iterations or lower tolerance"
    )
