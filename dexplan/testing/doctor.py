"""Why does it slip?  Run a foreign scene, say what became of its contacts, which setting bites, and what cures it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import mujoco

from dexplan.errors import SceneError
from dexplan.testing.bites import find_bites
from dexplan.testing.cures import Trial, propose_cures, try_cures
from dexplan.testing.forces import ForceReport, audit_forces, can_audit
from dexplan.testing.measurement import Measurement
from dexplan.testing.scene_file import Drive, find_object, load_drive, load_model
from dexplan.testing.scene_run import SceneRun
from dexplan.testing.stepping import measure_contacts
from dexplan.testing.verdict import Judgement, Kind, judge_contacts

HOLDS = {Kind.STUCK, Kind.CREEPING, Kind.ROLLING}
"""Verdicts under which a contact holds; creep and rolling are told, and are no failure."""
DIVERGED = {"badqpos", "badqvel", "badqacc", "badctrl"}
"""MuJoCo's warnings after which it starts the simulation anew, or leaves controls out."""
LONGEST_S = 3600.0
"""Seconds that a scene is run for at most, where no file has its controls: more is a slip of the hand."""


def load_run(run: SceneRun) -> tuple[mujoco.MjModel, Drive]:
    """Return the model of a run and how it is driven."""
    if not 0.0 < run.seconds < LONGEST_S:
        raise SceneError("seconds", f"{run.seconds:g}", f"accepted: more than 0, less than {LONGEST_S:g}")
    model = load_model(run.scene)
    return model, load_drive(model, run.ctrl, run.state, run.seconds)


def measure_run(run: SceneRun, model: mujoco.MjModel, drive: Drive) -> Measurement:
    """Return the contacts of ``model`` driven so.  Where nobody is named the only free body is the object."""
    name = find_object(model) if run.object is None and not run.tips else run.object
    with _quiet():
        return measure_contacts(
            model,
            drive.initial_state,
            drive.ctrl,
            tips=run.tips or None,
            object=name,
            steps_per_sample=drive.steps_per_sample,
        )


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep MuJoCo from printing its warnings: a run that diverges has one per step, and they are counted anyway."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


@dataclass(frozen=True)
class Diagnosis:
    """What the doctor says: the judgement, the settings that bite, and trials of cures (none where not asked for).

    ``forces``: whether any contact forces could hold the object, None where it is not free.
    """

    judged: Judgement
    bites: tuple[str, ...]
    proposals: tuple[str, ...]
    trials: tuple[Trial, ...]
    notes: tuple[str, ...]
    unstable: tuple[str, ...] = ()
    forces: ForceReport | None = None

    @property
    def is_well(self) -> bool:
        """Whether every contact holds and the forces obey Newton's law."""
        return (
            not self.unstable
            and not self.judged.findings
            and all(v.kind in HOLDS for v in self.judged.verdicts)
        )

    def __str__(self) -> str:
        lines = [*self.notes, str(self.judged) if self.judged.verdicts else "nothing touched"]
        lines += [] if self.forces is None else [str(self.forces)]
        lines += [f"bites: {sentence}" for sentence in self.bites]
        lines += [f"may help: {sentence}" for sentence in self.proposals]
        lines += [str(trial) for trial in self.trials]
        return "\n".join([line for line in lines if line] + [self.summary_line()])

    def summary_line(self) -> str:
        """Return the last line: whether the contacts hold, and if not, which does not and what cured it."""
        if self.is_well:
            return f"HOLDS {len(self.judged.verdicts)} contact episodes"
        if self.unstable:
            return f"FAIL {self.unstable[0]}"
        bad = [v for v in self.judged.verdicts if v.kind not in HOLDS]
        if not bad:
            return f"FAIL {self.judged.findings[0].kind}"
        cure = next((t.cure.text for t in self.trials if t.is_cured), None)
        told = f"FAIL {bad[0].by} on {bad[0].on}: {bad[0].kind}"
        return f"{told}; cured by {cure}" if cure else told


def diagnose(run: SceneRun, *, with_trials: bool) -> Diagnosis:
    """Run a scene and return what is wrong with its contacts; ``with_trials`` also runs it under each proposed cure."""
    model, drive = load_run(run)
    measured = measure_run(run, model, drive)
    judged = judge_contacts(measured)
    if with_trials:
        trials = tuple(try_cures(model, judged, measured, lambda changed: measure_run(run, changed, drive)))
        proposals: Sequence[str] = ()
    else:
        trials = ()
        found = [c for v in judged.verdicts for c in propose_cures(model, measured, v)]
        proposals = list(dict.fromkeys(f"{cure.text} ({cure.why})" for cure in found))
    warned = [f"MuJoCo warns: {name} ({count} times)" for name, count in measured.warnings.items()]
    return Diagnosis(
        judged=judged,
        bites=tuple(find_bites(model, measured, judged)),
        proposals=tuple(proposals),
        trials=trials,
        notes=(*measured.not_recorded, *warned),
        unstable=tuple(f"the simulation diverged ({name})" for name in measured.warnings if name in DIVERGED),
        forces=audit_forces(model, measured) if can_audit(model, measured) else None,
    )
