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

from dexplan.errors import RunFolderError

FORMAT = 1
"""The trace format this package reads and writes."""
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
            with np.load(path, allow_pickle=False) as archive:
                entries = {name: archive[name] for name in archive.files}
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
            raise RunFolderError(str(path), f"it has trace format {version}", f"format {FORMAT} is read here")
        return cls(model_xml, entries, meta)


def _as_bytes(text: str) -> NDArray[np.uint8]:
    """Return ``text`` in UTF-8 as a byte array (N,)."""
    return np.frombuffer(text.encode(), dtype=np.uint8)


def _is_same(a: NDArray[Any], b: NDArray[Any]) -> bool:
    """Return whether two arrays have the same type, shape and bits."""
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
