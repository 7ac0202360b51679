"""The convention page: frames, orders and the few spatial operations everything else uses.

Frames: ``W`` world, ``O`` object, ``F`` fingertip, ``C`` contact.  ``X_AB`` is the pose of frame B in frame A, so
``X_AC = X_AB @ X_BC``; ``R_AB`` its rotation, ``p_AB`` its translation expressed in A.

Orders: twist ``(v, w)``, wrench ``(f, tau)``, quaternion ``(w, x, y, z)``.  A pose is a (4, 4) matrix inside the code and a
7-vector ``(x, y, z, qw, qx, qy, qz)`` in files.  SI units; a unit suffix (``_mm``, ``_deg``) where data leave the process.

The contact frame has its z axis **into** the object; ``n_O`` names the **outward** surface normal in object axes.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

GRAVITY = 9.81
"""Magnitude of gravity [m/s^2], along -z of the world."""
VERTICAL = np.array([0.0, 0.0, 1.0])
"""The unit world axis (3,) that points up."""


def read_only(values: ArrayLike) -> Array:
    """Return a float64 copy of ``values`` that cannot be written; an array that never can be is its own copy."""
    if type(values) is np.ndarray and values.dtype == np.float64:
        flags = values.flags
        if flags.owndata and not flags.writeable:
            return values
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def lock_arrays(self: object) -> None:
    """Replace every array of a frozen dataclass that can be written by a copy that cannot; in tuples and dicts of arrays, too.

    Use: ``__post_init__`` of the class calls it.  Who makes many values of one stack locks the stack first: its rows are
    taken as they are.
    """
    held = vars(self)
    for name, value in held.items():
        if isinstance(value, np.ndarray):
            if value.flags.writeable:
                held[name] = _lock(value)
        elif isinstance(value, tuple):
            if any(isinstance(item, np.ndarray) for item in value):
                held[name] = tuple(_lock(item) for item in value)
        elif isinstance(value, dict) and any(isinstance(item, np.ndarray) for item in value.values()):
            held[name] = {key: _lock(item) for key, item in value.items()}


def _lock(value: object) -> object:
    """Return a copy of an array that cannot be written; anything else, and an array that is locked already, as it is."""
    if not isinstance(value, np.ndarray) or not value.flags.writeable:
        return value
    array = value.copy()
    array.setflags(write=False)
    return array


def hat(w: Array) -> Array:
    """Return the skew-symmetric matrices (..., 3, 3) with ``hat(w) @ x == cross(w, x)`` for w (..., 3)."""
    w = np.asarray(w, dtype=np.float64)
    out = np.zeros((*w.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2] = -w[..., 2], w[..., 1]
    out[..., 1, 0], out[..., 1, 2] = w[..., 2], -w[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -w[..., 1], w[..., 0]
    return out


def adjoint(X_AB: Array) -> Array:
    """Return the (6, 6) matrix that maps a twist (v, w) of frame B expressed in B to frame A: ``V_A = Ad V_B``.

    Its transpose maps a wrench (f, tau) about A's origin, in A, to one about B's origin, in B [MLS 1994, eq. 2.58].
    """
    R, p = X_AB[:3, :3], X_AB[:3, 3]
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = R
    out[:3, 3:] = hat(p) @ R
    return out


def make_pose(R: ArrayLike | None = None, p: ArrayLike | None = None) -> Array:
    """Return the (4, 4) pose with rotation ``R`` (3, 3) and translation ``p`` (3,) [m]; identity and zero by default."""
    X = np.eye(4)
    if R is not None:
        X[:3, :3] = R
    if p is not None:
        X[:3, 3] = p
    return X


def invert_pose(X_AB: Array) -> Array:
    """Return X_BA for poses (..., 4, 4)."""
    R_BA = np.swapaxes(X_AB[..., :3, :3], -1, -2)
    X_BA = np.zeros_like(X_AB)
    X_BA[..., :3, :3] = R_BA
    X_BA[..., :3, 3] = -(R_BA @ X_AB[..., :3, 3, None])[..., 0]
    X_BA[..., 3, 3] = 1.0
    return X_BA


def as_pose(pose7: ArrayLike) -> Array:
    """Return the (..., 4, 4) matrices of poses (..., 7) = (x, y, z, qw, qx, qy, qz)."""
    pose7 = np.asarray(pose7, dtype=np.float64)
    X = np.zeros((*pose7.shape[:-1], 4, 4))
    X[..., :3, :3] = Rotation.from_quat(pose7[..., 3:], scalar_first=True).as_matrix()
    X[..., :3, 3] = pose7[..., :3]
    X[..., 3, 3] = 1.0
    return X


def as_pose7(X: Array) -> Array:
    """Return poses (..., 4, 4) as (..., 7) = (x, y, z, qw, qx, qy, qz) with qw >= 0."""
    quat = Rotation.from_matrix(X[..., :3, :3]).as_quat(canonical=True, scalar_first=True)
    return np.concatenate([X[..., :3, 3], quat], axis=-1)


def rotate_about(axis: ArrayLike, angle: ArrayLike) -> Array:
    """Return the rotation matrices (..., 3, 3) about the unit ``axis`` (3,) by ``angle`` (...) [rad]."""
    rotvec = np.asarray(angle, dtype=np.float64)[..., None] * np.asarray(axis, dtype=np.float64)
    R: Array = Rotation.from_rotvec(rotvec).as_matrix()
    return R


def rotation_vector(R: Array) -> Array:
    """Return the rotation vector (3,) [rad] of one rotation matrix (3, 3) that turns by less than half a turn.

    A tenth of the cost of a scipy object.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R.tolist()
    x, y, z = zy - yz, xz - zx, yx - xy
    sine = 0.5 * math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, 0.5 * (xx + yy + zz - 1.0))
    scale = 0.5 * angle / sine if sine > 1e-9 else 0.5
    return np.array([scale * x, scale * y, scale * z])


def build_frames(z: Array) -> Array:
    """Return the rotations (N, 3, 3) of :func:`build_frame` for vectors (N, 3) of any length; for a few at a time."""
    out = []
    for x0, y0, z0 in z.tolist():
        length = math.sqrt(x0 * x0 + y0 * y0 + z0 * z0)
        zx, zy, zz = x0 / length, y0 / length, z0 / length
        yx, yy, yz = -zz * zx, -zz * zy, 1.0 - zz * zz
        square = yx * yx + yy * yy + yz * yz
        if square < 1e-12:
            yx, yy, yz = 1.0 - zx * zx, -zx * zy, -zx * zz
            square = yx * yx + yy * yy + yz * yz
        length = math.sqrt(square)
        yx, yy, yz = yx / length, yy / length, yz / length
        out += [yy * zz - yz * zy, yx, zx, yz * zx - yx * zz, yy, zy, yx * zy - yy * zx, yz, zz]
    return np.array(out).reshape(-1, 3, 3)


def skew(w: Array) -> Array:
    """Return the (3, 3) matrix with ``skew(w) @ x == cross(w, x)`` for one vector; :func:`hat` for control ticks."""
    x, y, z = w.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def cross(a: Array, b: Array) -> Array:
    """Return the cross product of two vectors (3,), without numpy's overhead for stacks."""
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def cross_all(a: Array, b: Array) -> Array:
    """Return the cross products (..., 3) of stacks of vectors, to the bit those of numpy, in a third of its time."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = ay * bz - az * by
    out[..., 1] = az * bx - ax * bz
    out[..., 2] = ax * by - ay * bx
    return out


def build_frame(z: ArrayLike, near: ArrayLike = (0.0, 0.0, 1.0)) -> Array:
    """Return a rotation (3, 3) whose third column is the unit vector ``z`` and whose second is as near to ``near`` as can be.

    Where ``z`` is (anti)parallel to ``near`` the world x axis takes its place, so the frame is defined everywhere.
    """
    z = np.asarray(z, dtype=np.float64)
    y = near - z.dot(near) * z
    if y.dot(y) < 1e-12:
        y = np.array([1.0, 0.0, 0.0]) - z[0] * z
    y = y / math.sqrt(y.dot(y))
    return np.stack([cross(y, z), y, z], axis=-1)


def direction_from_angles(azimuth_deg: ArrayLike, elevation_deg: ArrayLike) -> Array:
    """Return the unit vectors (..., 3) at azimuth (about z, from x) and elevation (from the xy plane), both [deg]."""
    az, el = np.radians(azimuth_deg), np.radians(elevation_deg)
    return np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=-1)


def angles_from_direction(n: Array) -> tuple[Array, Array]:
    """Return (azimuth, elevation) [deg] of unit vectors (..., 3)."""
    return np.degrees(np.arctan2(n[..., 1], n[..., 0])), np.degrees(np.arcsin(np.clip(n[..., 2], -1.0, 1.0)))
