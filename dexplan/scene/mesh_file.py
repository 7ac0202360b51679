"""Mesh files, OBJ and binary STL, read by MuJoCo, and what is wrong with a mesh that should be a body."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.errors import DexplanError
from dexplan.spatial import Array, lock_arrays

SUFFIXES = (".obj", ".stl")
SAME_PLACE = 1e-6
"""Corners nearer to one another than this share of the mesh's size are one."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of a surface: ``vertices`` (V, 3) in the file's unit and axes, corners that stand in one place once, and
    ``faces`` (T, 3), their numbers.
    """

    vertices: Array
    faces: NDArray[np.intp]

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    @property
    def size(self) -> float:
        """The longest of the three extents, in the file's unit."""
        return float(np.ptp(self.vertices, axis=0).max())

    def count_open_edges(self) -> int:
        """Return how many edges do not belong to exactly two triangles: none where the mesh encloses a volume."""
        edges = np.sort(self.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        return int(np.count_nonzero(np.unique(edges, axis=0, return_counts=True)[1] != 2))

    def compute_volume(self) -> float:
        """Return the enclosed volume, in the file's unit cubed; of a mesh whose triangles all face inward as well."""
        a, b, c = np.moveaxis((self.vertices - self.vertices.mean(axis=0))[self.faces], 1, 0)
        return abs(float(np.einsum("ti,ti->", a, np.cross(b, c)))) / 6.0


def read_mesh(path: Path) -> Mesh:
    """Return the mesh in an OBJ or binary STL file.

    Raises DexplanError, with what is wrong, for a file that is missing or no such mesh.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise DexplanError(f"it ends in {path.suffix!r}; {' and '.join(SUFFIXES)} are accepted")
    try:
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise DexplanError(
            f"it cannot be read ({reason}); a mesh file beside the problem file is accepted"
        ) from None
    if suffix == ".stl" and content[:5] == b"solid" and b"facet" in content[:400]:
        raise DexplanError("it is an STL file in text; a binary STL or an OBJ is accepted")
    # A shell needs no volume, and a geom that collides with nothing no hull: what is wrong is found here, in words.
    xml = (
        f'<mujoco><asset><mesh name="mesh" file="mesh{suffix}" inertia="shell"/></asset>'
        '<worldbody><geom type="mesh" mesh="mesh" contype="0" conaffinity="0"/></worldbody></mujoco>'
    )
    try:
        model = mujoco.MjModel.from_xml_string(xml, assets={f"mesh{suffix}": content})
    except ValueError as error:
        told = " ".join(str(error).removeprefix("Error:").split("\n")[0].split())
        raise DexplanError(
            f"MuJoCo reads no mesh from it ({told[:100]}); triangles that enclose a volume are accepted"
        ) from None
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, model.mesh_quat[0])
    vertices = model.mesh_vert.astype(np.float64) @ R.reshape(3, 3).T + model.mesh_pos[0]
    step = SAME_PLACE * max(float(np.ptp(vertices, axis=0).max()), 1e-12)
    _, first, of = np.unique(np.round(vertices / step), axis=0, return_index=True, return_inverse=True)
    faces = of.reshape(-1)[model.mesh_face]
    is_face = np.array([len(set(face)) == 3 for face in faces.tolist()], dtype=bool)
    return Mesh(vertices[first], faces[is_face].astype(np.intp))
