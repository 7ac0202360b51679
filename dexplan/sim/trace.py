"""What happened: the recorded columns of one run, together with the text of the model they were recorded on.

A trace is data, not a claim: everything that counts is computed again from ``model_xml``, ``initial_state``
and ``ctrl``.
"""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dexplan.brief import show
from dexplan.errors import RunFolderError
from dexplan.notebook import as_html_table
from dexplan.sim.contact_table import build_contact_table

FORMAT = 1
"""The trace format this package reads and writes."""
LARGEST = 1 << 34
"""A file that unpacks to more bytes is no trace; twenty minutes are half a gigabyte."""
LARGEST_VALUE = 1e10
"""MuJoCo takes a larger number in a state or a control for a simulation that blew up (mjMAXVAL)."""
MOST_STEPS = 10_000
"""No control rate is slower than this many physics steps."""
_MODEL = "model_xml"
_META = "meta_json"
_EPOCH = (1980, 1, 1, 0, 0, 0)
"""Every zip entry carries this date, so that equal traces are equal files."""


@dataclass(frozen=True, eq=False)
class Trace:
    """A run of T samples at the control rate, of F fingers.

    ``columns`` maps names to read-only arrays, T along the first axis except for ``initial_state``
    (mjSTATE_INTEGRATION at sample 0) and ``physics_steps_per_sample`` ().  Sample t is recorded before the
    steps that ``ctrl[t]`` drives.  Frames: ``_O`` object, contact frames with columns t1, t2, n and n into
    the object, forces on the object; SI units; missing is NaN. ``meta`` is JSON data.
    """

    model_xml: str
    columns: Mapping[str, NDArray[Any]]
    meta: Mapping[str, Any]
    contradictions: tuple[str, ...] = ()
    """What the run folder that it was read from says against it, for the judge; no part of the file or of equality."""

    def __post_init__(self) -> None:
        columns = {}
        for name in sorted(self.columns):
            array = np.array(self.columns[name], order="C")
            if array.dtype.hasobject:
                raise TypeError(f"column {name!r} holds Python objects; give numbers, booleans or text")
            if name in (_MODEL, _META):
                raise ValueError(f"column name {name!r} is taken by the file format")
            array.setflags(write=False)
            columns[name] = array
        object.__setattr__(self, "columns", MappingProxyType(columns))
        # A round trip through JSON now, so that what is in memory equals what a file would give back.
        object.__setattr__(self, "meta", MappingProxyType(json.loads(json.dumps(dict(self.meta)))))

    def __repr__(self) -> str:
        seconds = float(self["time"][-1]) if self.sample_count else 0.0
        facts = {"problem": self.meta.get("problem"), "samples": self.sample_count, "seconds": seconds}
        facts |= {"columns": len(self.columns), "failure": self.meta.get("failure")}
        return show("Trace", facts.items())

    def __str__(self) -> str:
        """Return one line about the run, and one per column."""
        lines = [repr(self)]
        for name, array in self.columns.items():
            lines.append(f"  {name:<24} {array.dtype!s:<8} {array.shape}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Return the trace as notebooks show it: a row per column."""
        rows = [(name, array.dtype, array.shape) for name, array in self.columns.items()]
        return as_html_table(("column", "type", "shape"), rows, caption=repr(self))

    def contacts(self) -> dict[str, NDArray[Any]]:
        """Return the contacts as a table: columns (N,) by name, a row per sample and touching finger, in the order of time.

        ``pandas.DataFrame(trace.contacts())`` takes it as it is.  Units stand in the names; frames and meanings are told
        column by column in :data:`dexplan.sim.contact_table.COLUMNS` and ``docs/replay.md``.  Columns that the trace does not
        have are left out.  Raises KeyError for a trace that does not say who touches.
        """
        return build_contact_table(self.model_xml, self.columns)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return the column ``name``; KeyError where the trace has none."""
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __eq__(self, other: object) -> bool:
        """Return whether text, meta and every column are the same bit for bit (NaN equals NaN)."""
        if not isinstance(other, Trace):
            return NotImplemented
        return (
            self.model_xml == other.model_xml
            and self.meta == other.meta
            and self.columns.keys() == other.columns.keys()
            and all(_is_same(array, other[name]) for name, array in self.columns.items())
        )

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to make the trace again, so that worker processes can hand it on, or an error that carries it."""
        return Trace, (self.model_xml, dict(self.columns), dict(self.meta), self.contradictions)

    @property
    def sample_count(self) -> int:
        """Number of samples T."""
        return len(self.columns["time"]) if "time" in self.columns else 0

    def save(self, path: str | Path) -> Path:
        """Write one .npz without pickles, whole or not at all; the same trace gives the same bytes.  Returns
        the path.
        """
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        meta = json.dumps({"format": FORMAT, "meta": dict(self.meta)}, sort_keys=True)
        entries: dict[str, NDArray[Any]] = {
            _MODEL: _as_bytes(self.model_xml),
            _META: _as_bytes(meta),
            **self.columns,
        }
        temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
        try:
            with zipfile.ZipFile(temporary, "w") as archive:
                for name in sorted(entries):
                    buffer = io.BytesIO()
                    np.lib.format.write_array(buffer, entries[name], version=(1, 0), allow_pickle=False)
                    info = zipfile.ZipInfo(f"{name}.npy", date_time=_EPOCH)
                    info.compress_type = zipfile.ZIP_DEFLATED
                    archive.writestr(info, buffer.getvalue(), compresslevel=6)
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
        return path

    @classmethod
    def load(cls, path: str | Path) -> Trace:
        """Read a trace that :meth:`save` wrote; equal to it.  Raises RunFolderError where the file is not
        one.
        """
        path = Path(path)
        accepted = "a trace.npz as `dexplan run` writes it is needed"
        if not path.is_file():
            raise RunFolderError(str(path), "there is no such file", accepted)
        try:
            with zipfile.ZipFile(path) as archive:
                size = sum(entry.file_size for entry in archive.infolist())
            if size > LARGEST:
                raise RunFolderError(
                    str(path), f"it unpacks to {size} bytes", f"at most {LARGEST} bytes are read"
                )
            with np.load(path, allow_pickle=False) as archive:
                entries = {name: archive[name] for name in archive.files}
        except RunFolderError:
            raise
        except Exception as error:
            # A damaged archive can raise anything from zipfile, zlib, numpy and struct; all of it means the
            # same to a caller.
            raise RunFolderError(str(path), f"it cannot be read as .npz ({error})", accepted) from error
        missing = [name for name in (_MODEL, _META) if name not in entries]
        if missing:
            raise RunFolderError(str(path), f"it lacks {', '.join(missing)}", accepted)
        try:
            model_xml = entries.pop(_MODEL).tobytes().decode()
            header = json.loads(entries.pop(_META).tobytes().decode())
            version, meta = header["format"], header["meta"]
        except (UnicodeDecodeError, ValueError, KeyError, TypeError) as error:
            raise RunFolderError(
                str(path), f"its model or meta text is damaged ({error})", accepted
            ) from error
        if version != FORMAT:
            raise RunFolderError(
                str(path), f"it has trace format {version!r:.40}", f"format {FORMAT} is read here"
            )
        if not isinstance(meta, dict):
            raise RunFolderError(str(path), f"its meta data are {meta!r:.40}", accepted)
        trace = cls(model_xml, entries, meta)
        check_columns(trace, str(path))
        return trace


@dataclass(frozen=True)
class _Column:
    """What a column has to be: a letter per axis (equal letters, equal lengths; digits as they are), and kinds of numpy types."""

    axes: str
    kinds: str = "fiu"


_COLUMNS = {
    "time": _Column("T"),
    "qpos": _Column("TQ"),
    "qvel": _Column("TV"),
    "ctrl": _Column("TU"),
    "initial_state": _Column("S"),
    "physics_steps_per_sample": _Column("", "iu"),
    "object_pose_reference": _Column("T7"),
    "action_index": _Column("T", "iu"),
    "phase_index": _Column("T", "iu"),
    "contact_active": _Column("TF", "b"),
    "contact_point_O": _Column("TF3"),
    "contact_rotation_O": _Column("TF33"),
    "contact_force": _Column("TF4"),
    "contact_force_reference": _Column("TF4"),
    "contact_slip_velocity": _Column("TF3"),
    "tip_contact_angle": _Column("TF"),
    "qp_status": _Column("T", "iu"),
    "qp_wrench_residual": _Column("T"),
    "tip_tracking_error": _Column("T"),
    "ik_at_limit": _Column("T", "biu"),
    "xfrc_applied": _Column("TB6"),
}
"""The columns of the format; a trace may have more, and may leave out all that are not replayed."""
_REPLAYED = ("initial_state", "ctrl", "physics_steps_per_sample")
"""What a run is stepped from: without these there is nothing to judge."""


def check_replayable(trace: Trace, source: str = "trace.npz") -> None:
    """Raise RunFolderError where ``trace`` cannot be stepped again."""
    for name in _REPLAYED:
        if name not in trace:
            raise RunFolderError(source, f"it lacks {name}", "a trace that can be replayed is needed")
    check_columns(trace, source)
    if len(trace["ctrl"]) == 0:
        raise RunFolderError(source, "it has no samples", "a run of at least one sample is needed")


def check_columns(trace: Trace, source: str = "trace.npz") -> None:
    """Raise RunFolderError, which names ``source``, where a column of the format is not of its type, shape or range."""
    lengths: dict[str, tuple[int, str]] = {}
    for name, column in _COLUMNS.items():
        if name not in trace:
            continue
        array = trace[name]
        if array.dtype.kind not in column.kinds:
            needed = " or ".join(_KINDS[kind] for kind in column.kinds)
            raise RunFolderError(source, f"{name} is of type {array.dtype}", f"{needed} are needed")
        if array.ndim != len(column.axes):
            raise RunFolderError(
                source, f"{name} has shape {array.shape}", f"{len(column.axes)} axes are needed"
            )
        for axis, length in zip(column.axes, array.shape, strict=True):
            wanted, whose = lengths.setdefault(
                axis, (int(axis), "the format") if axis.isdecimal() else (length, name)
            )
            if length != wanted:
                raise RunFolderError(
                    source,
                    f"{name} has shape {array.shape}",
                    f"{wanted} as in {whose} is needed, not {length}",
                )
    _check_values(trace, source)


_KINDS = {
    "f": "floating-point numbers",
    "i": "whole numbers",
    "u": "whole numbers, 0 or more",
    "b": "booleans",
}


def _check_values(trace: Trace, source: str) -> None:
    """Refuse what cannot be stepped.  A run that diverged ends with a sample that is no number; before it all are."""
    if "physics_steps_per_sample" in trace:
        steps = int(trace["physics_steps_per_sample"])
        if not 1 <= steps <= MOST_STEPS:
            needed = f"a whole number from 1 to {MOST_STEPS} is needed"
            raise RunFolderError(source, f"physics_steps_per_sample is {steps}", needed)
    for name, samples in (("initial_state", slice(None)), ("ctrl", slice(-1)), ("time", slice(None))):
        if name in trace and not (np.abs(trace[name][samples]) <= LARGEST_VALUE).all():
            needed = f"numbers up to {LARGEST_VALUE:g} are needed"
            raise RunFolderError(source, f"{name} holds values that cannot be simulated", needed)
    if "object_pose_reference" in trace:
        # What is no number is judged; what is a number but no pose would stop the judge.
        poses = trace["object_pose_reference"]
        poses = poses[np.isfinite(poses).all(axis=1)]
        is_turn = np.abs(np.square(poses[:, 3:].clip(-2.0, 2.0)).sum(axis=1) - 1.0) < 0.1
        if not (is_turn.all() and (np.abs(poses) <= LARGEST_VALUE).all()):
            needed = "metres and unit quaternions are needed"
            raise RunFolderError(source, "object_pose_reference holds what is no pose", needed)
    if "time" in trace and not (np.diff(trace["time"]) > 0.0).all():
        raise RunFolderError(source, "time does not always grow", "samples in the order of time are needed")


def _as_bytes(text: str) -> NDArray[np.uint8]:
    """Return ``text`` in UTF-8 as a byte array (N,)."""
    return np.frombuffer(text.encode(), dtype=np.uint8)


def _is_same(a: NDArray[Any], b: NDArray[Any]) -> bool:
    """Return whether two arrays have the same type, shape and bits."""
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
