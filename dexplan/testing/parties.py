"""Who touches whom: every geom of a scene belongs to one party, the object, a tip, or whatever else has a name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.errors import SceneError, UnknownNameError
from dexplan.spatial import lock_arrays

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Parties:
    """The parties of a scene: ``names`` (P,), the object first where one was named, then the tips, then the rest.

    ``of_geom`` (ngeom,) is the party of each geom.  ``object`` is 0 or, where no object was named, -1; ``tips`` are the
    indices of the tips.  ``object_body`` is the body at the root of the object, -1 without one.  ``is_watched`` (P,) says
    whose contacts are kept: the object's and the tips', everybody's where neither was named.
    """

    names: tuple[str, ...]
    of_geom: Indices
    object: int
    tips: tuple[int, ...]
    object_body: int
    is_watched: NDArray[np.bool_]

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def find_parties(model: mujoco.MjModel, tips: Sequence[str] | None, object_name: str | None) -> Parties:
    """Find the parties of ``model``.

    A name is that of a body or, where no body is called so, of a geom.  The object is its body with everything that hangs
    on it; a tip is the geoms of its body alone, or one geom.  Of what was not named each moving body is one party, and
    each geom of the world (floor, walls) another.  Raises UnknownNameError for names the model lacks, SceneError for one
    geom that would belong to two parties.
    """
    if isinstance(tips, str):
        raise SceneError(
            "tips", f"the text {tips!r} is no list", "accepted: a list of names of bodies or geoms"
        )
    of_geom = np.full(model.ngeom, -1, dtype=np.intp)
    names: list[str] = []
    object_body = -1
    if object_name is not None:
        geoms, object_body = _find_geoms(model, object_name, "object", with_children=True)
        _assign(model, of_geom, geoms, names, object_name)
    for tip in tips or ():
        geoms, _ = _find_geoms(model, tip, "tip", with_children=False)
        _assign(model, of_geom, geoms, names, tip)
    named = len(names)
    rest: dict[str, int] = {}
    for geom in np.flatnonzero(of_geom < 0):
        body = int(model.geom_bodyid[geom])
        # What is welded to the world does not move, and one wall is not the other.
        name = name_geom(model, geom) if model.body_weldid[body] == 0 else name_body(model, body)
        name = f"{name} (rest)" if name in names[:named] else name
        of_geom[geom] = rest.setdefault(name, named + len(rest))
    names += rest
    watched = np.arange(len(names)) < named if named else np.ones(len(names), dtype=bool)
    has_object = object_name is not None
    return Parties(
        names=tuple(names),
        of_geom=of_geom,
        object=0 if has_object else -1,
        tips=tuple(range(int(has_object), named)),
        object_body=object_body,
        is_watched=watched,
    )


def name_geom(model: mujoco.MjModel, geom: int | np.integer) -> str:
    """Return the name of a geom; one without a name is counted within its body: ``palm#2``."""
    name = model.geom(int(geom)).name
    if name:
        return str(name)
    body = int(model.geom_bodyid[geom])
    return f"{name_body(model, body)}#{int(geom) - int(model.body_geomadr[body])}"


def name_body(model: mujoco.MjModel, body: int) -> str:
    """Return the name of a body, ``body#7`` where it has none."""
    return str(model.body(int(body)).name) or f"body#{int(body)}"


def list_descendants(model: mujoco.MjModel, body: int) -> list[int]:
    """Return ``body`` and every body that hangs on it, in MuJoCo's order: parents stand before their children."""
    found = {body}
    for other in range(body + 1, model.nbody):
        if int(model.body_parentid[other]) in found:
            found.add(other)
    return sorted(found)


def find_drives(model: mujoco.MjModel, parties: Parties) -> NDArray[np.bool_]:
    """Return which actuators (nu, P) can move which party: they act on a joint between the world and one of its bodies."""
    joints = np.zeros((len(parties.names), model.njnt), dtype=bool)
    for geom in range(model.ngeom):
        joints[parties.of_geom[geom]] |= _list_joints_above(model, int(model.geom_bodyid[geom]))
    out = np.zeros((model.nu, len(parties.names)), dtype=bool)
    for a in range(model.nu):
        kind, target = int(model.actuator_trntype[a]), int(model.actuator_trnid[a, 0])
        acts_on = np.zeros(model.njnt, dtype=bool)
        if kind in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)):
            acts_on[target] = True
        elif kind == int(mujoco.mjtTrn.mjTRN_TENDON):
            first = int(model.tendon_adr[target])
            wraps = slice(first, first + int(model.tendon_num[target]))
            is_joint = model.wrap_type[wraps] == int(mujoco.mjtWrap.mjWRAP_JOINT)
            is_site = model.wrap_type[wraps] == int(mujoco.mjtWrap.mjWRAP_SITE)
            acts_on[model.wrap_objid[wraps][is_joint]] = True
            for site in model.wrap_objid[wraps][is_site]:
                acts_on |= _list_joints_above(model, int(model.site_bodyid[site]))
        elif kind == int(mujoco.mjtTrn.mjTRN_BODY):
            acts_on |= _list_joints_above(model, target)
        else:
            acts_on |= _list_joints_above(model, int(model.site_bodyid[target]))
        out[a] = (joints & acts_on).any(axis=1)
    return out


def _list_joints_above(model: mujoco.MjModel, body: int) -> NDArray[np.bool_]:
    """Return which joints (njnt,) stand between ``body`` and the world."""
    out = np.zeros(model.njnt, dtype=bool)
    while body > 0:
        first = int(model.body_jntadr[body])
        out[first : first + int(model.body_jntnum[body])] = model.body_jntnum[body] > 0
        body = int(model.body_parentid[body])
    return out


def _find_geoms(model: mujoco.MjModel, name: str, role: str, *, with_children: bool) -> tuple[Indices, int]:
    """Return the geoms that a name stands for, and their body."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, str(name))
    if body == 0:
        raise SceneError(
            role, f"{name!r} is the world itself", "accepted: the name of another body, or of a geom"
        )
    if body > 0:
        bodies = list_descendants(model, body) if with_children else [body]
        geoms = np.flatnonzero(np.isin(model.geom_bodyid, bodies))
        if len(geoms) == 0:
            raise SceneError(role, f"the body {name!r} has no geom", "accepted: a body with geoms, or a geom")
        return geoms, body
    geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, str(name))
    if geom < 0:
        known = [model.body(b).name for b in range(1, model.nbody)] + [
            model.geom(g).name for g in range(model.ngeom)
        ]
        raise UnknownNameError(f"{role} (a body or a geom)", str(name), {k for k in known if k})
    return np.array([geom]), int(model.geom_bodyid[geom])


def _assign(model: mujoco.MjModel, of_geom: Indices, geoms: Indices, names: list[str], name: str) -> None:
    """Give ``geoms`` to a new party ``name``."""
    taken = geoms[of_geom[geoms] >= 0]
    if len(taken):
        fact = f"{name!r} and {names[of_geom[taken[0]]]!r} share the geom {name_geom(model, taken[0])!r}"
        raise SceneError("tips and object", fact, "accepted: names that have no geom in common")
    of_geom[geoms] = len(names)
    names.append(name)
