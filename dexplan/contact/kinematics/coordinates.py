"""Contact coordinates: where two surfaces touch and how they are turned, and the relative pose that belongs to it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dexplan.brief import brief_repr
from dexplan.contact.surfaces.surface import AbstractSurface, Charts
from dexplan.spatial import Array, read_only

SWITCH_BELOW = 0.5
"""Coordinates move to another chart when the border of theirs is nearer than this (cos 60 degrees on a sphere)."""


def _zero() -> Charts:
    return np.zeros((), dtype=np.intp)


@dataclass(frozen=True, eq=False)
class ContactCoordinates:
    """Where a tip F touches a body O: (u_f, v_f) on the tip, (u_o, v_o) on the body, angle psi [MLS 1994, §5.6.2].

    All have one shape (...): one contact or many.  ``chart_f`` and ``chart_o`` say which charts of the surfaces the
    coordinates belong to.  psi [rad] is the angle from the body's Gauss axis x_o to the tip's x_f as seen from outside the
    body: in the body's Gauss frame C (z into the body)

        R_CoCf = [[cos psi, -sin psi, 0], [-sin psi, -cos psi, 0], [0, 0, -1]].
    """

    u_f: Array
    v_f: Array
    u_o: Array
    v_o: Array
    psi: Array
    chart_f: Charts = field(default_factory=_zero)
    chart_o: Charts = field(default_factory=_zero)

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        names = ("u_f", "v_f", "u_o", "v_o", "psi")
        values = np.broadcast_arrays(*(getattr(self, n) for n in names), self.chart_f, self.chart_o)
        for name, value in zip(names, values, strict=False):
            object.__setattr__(self, name, read_only(value))
        for name, value in zip(("chart_f", "chart_o"), values[5:], strict=True):
            index = np.array(value, dtype=np.intp)
            index.setflags(write=False)
            object.__setattr__(self, name, index)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the stack of contacts; () for one."""
        return self.psi.shape

    def as_array(self) -> Array:
        """Return (..., 5) in the order u_f, v_f, u_o, v_o, psi."""
        return np.stack([self.u_f, self.v_f, self.u_o, self.v_o, self.psi], axis=-1)

    @classmethod
    def from_array(cls, values: Array, chart_f: Charts, chart_o: Charts) -> ContactCoordinates:
        """Build from (..., 5) in the order u_f, v_f, u_o, v_o, psi and the charts (...)."""
        u_f, v_f, u_o, v_o, psi = np.moveaxis(np.asarray(values), -1, 0)
        return cls(u_f, v_f, u_o, v_o, psi, chart_f, chart_o)


def build_psi_rotation(psi: Array) -> Array:
    """Return R_CoCf (..., 3, 3): the tip's Gauss frame in the body's, for angles psi (...) [rad]."""
    psi = np.asarray(psi, dtype=np.float64)
    R = np.zeros((*psi.shape, 3, 3))
    R[..., 0, 0] = np.cos(psi)
    R[..., 1, 1] = -R[..., 0, 0]
    R[..., 0, 1] = R[..., 1, 0] = -np.sin(psi)
    R[..., 2, 2] = -1.0
    return R


def compute_relative_pose(tip: AbstractSurface, body: AbstractSurface, at: ContactCoordinates) -> Array:
    """Return X_OF (..., 4, 4), the tip's pose in the body's frame.

    R_OF = R_OCo R_CoCf R_FCf^T, p_OF = p_OC - R_OF p_FC [MLS 1994, §5.6.2].
    """
    on_f, on_o = tip.geometry(at.u_f, at.v_f, at.chart_f), body.geometry(at.u_o, at.v_o, at.chart_o)
    X = np.zeros((*at.shape, 4, 4))
    R = on_o.frame @ build_psi_rotation(at.psi) @ np.swapaxes(on_f.frame, -1, -2)
    X[..., :3, :3] = R
    X[..., :3, 3] = on_o.point - (R @ on_f.point[..., None])[..., 0]
    X[..., 3, 3] = 1.0
    return X


def build_coordinates(
    tip: AbstractSurface,
    body: AbstractSurface,
    R_OF: Array,
    p_F: Array,
    p_O: Array,
    charts: tuple[Charts, Charts] | None = None,
) -> ContactCoordinates:
    """Return the coordinates of contacts known by their points on both surfaces and the tip's rotation.

    Args:
        tip: surface of F.
        body: surface of O.
        R_OF: rotations (..., 3, 3) of the tip.
        p_F: contact points (..., 3) on the tip, in F [m].
        p_O: the same points (..., 3) on the body, in O [m].
        charts: charts (...) of tip and body to use; by default those whose borders are farthest.
    """
    chart_f, chart_o = (tip.choose_chart(p_F), body.choose_chart(p_O)) if charts is None else charts
    u_f, v_f = tip.coordinates(p_F, chart_f)
    u_o, v_o = body.coordinates(p_O, chart_o)
    x_f = (R_OF @ tip.geometry(u_f, v_f, chart_f).x[..., None])[..., 0]
    on_o = body.geometry(u_o, v_o, chart_o)
    # x_f = cos psi x_o - sin psi y_o
    psi = np.arctan2(-np.sum(x_f * on_o.y, axis=-1), np.sum(x_f * on_o.x, axis=-1))
    return ContactCoordinates(u_f, v_f, u_o, v_o, psi, chart_f, chart_o)


def change_charts(
    tip: AbstractSurface, body: AbstractSurface, at: ContactCoordinates, chart_f: Charts, chart_o: Charts
) -> ContactCoordinates:
    """Return the same contacts in other charts (...); psi changes with the Gauss frames, the relative pose does not."""
    R_OF = compute_relative_pose(tip, body, at)[..., :3, :3]
    p_F, p_O = tip.point(at.u_f, at.v_f, at.chart_f), body.point(at.u_o, at.v_o, at.chart_o)
    charts = tuple(np.broadcast_to(np.asarray(c, dtype=np.intp), at.shape) for c in (chart_f, chart_o))
    return build_coordinates(tip, body, R_OF, p_F, p_O, (charts[0], charts[1]))


def leave_borders(tip: AbstractSurface, body: AbstractSurface, at: ContactCoordinates) -> ContactCoordinates:
    """Return the same contacts, those that are near a border of their chart moved to the chart that suits them best."""
    margin_f = tip.margin(at.u_f, at.v_f, at.chart_f)
    margin_o = body.margin(at.u_o, at.v_o, at.chart_o)
    if np.all(margin_f >= SWITCH_BELOW) and np.all(margin_o >= SWITCH_BELOW):
        return at
    p_F, p_O = tip.point(at.u_f, at.v_f, at.chart_f), body.point(at.u_o, at.v_o, at.chart_o)
    chart_f = np.where(margin_f < SWITCH_BELOW, tip.choose_chart(p_F), at.chart_f)
    chart_o = np.where(margin_o < SWITCH_BELOW, body.choose_chart(p_O), at.chart_o)
    moved = change_charts(tip, body, at, chart_f, chart_o)
    # Contacts that stay keep their numbers, whole turns of v and psi included.
    stays = (chart_f == at.chart_f) & (chart_o == at.chart_o)
    values = np.where(stays[..., None], at.as_array(), moved.as_array())
    return ContactCoordinates.from_array(values, chart_f, chart_o)
