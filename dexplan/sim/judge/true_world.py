"""What is true and what was believed: two problems that differ in nothing but the world's own parameters.

Planner and controller are told a problem; the world may have another friction, mass or size.  What happened is judged by what is
true, and what was planned for it by what was believed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from dexplan.errors import ProblemError

PHYSICAL: Mapping[str, tuple[str, ...]] = {
    "object": ("radius_m", "mass_kg", "shape", "com_m", "inertia_kg_m2"),
    "hand": ("tip_radii_m", "base_azimuths_deg", "joint_ranges_deg"),
    "friction": ("sliding", "torsional_m"),
}
"""Table of a problem -> its keys that say how the world is; ``obstacles`` do as a whole.

``friction.safety`` is none of them: it is how much less is believed, and nothing in the world.
"""
RIVALS = (("radius_m", "shape"), ("shape", "radius_m"), ("com_m", "mass_kg"), ("inertia_kg_m2", "mass_kg"))
"""A table of a world that says the second and not the first means that there is no first: a ball has no shape, a homogeneous body
no centre of mass of its own.
"""
NAMES = ("name", "summary", "seed")
"""What a world may be called otherwise: these change nothing that happens."""
META = "world_as_run"
"""Where a record's meta has the true world that it was made in, as the data of a problem; missing where that is the problem."""
_NOTHING: Mapping[str, Any] = {}


def join_world(problem: Mapping[str, Any], world: Mapping[str, Any] | None) -> Mapping[str, Any]:
    """Return ``problem`` as it is true: with the parameters of ``world``, the data of another problem (None: as believed).

    Raises ProblemError where ``world`` differs in what is no parameter of the world.
    """
    if world is None:
        return problem
    for key, then, now in _compare(problem, world):
        if not _is_physical(key):
            raise ProblemError(
                "world",
                key,
                f"{_spell(now)} is given where the problem has {_spell(then)}",
                f"a world may differ in {', '.join(_list_physical())}",
            )
    joined = dict(problem)
    for table, keys in PHYSICAL.items():
        given = world.get(table, _NOTHING)
        rivals = {one for one, other in RIVALS if one not in given and other in given}
        kept = {key: value for key, value in problem.get(table, _NOTHING).items() if key not in rivals}
        joined[table] = {**kept, **{key: given[key] for key in keys if key in given}}
    if "obstacles" in world:
        joined["obstacles"] = world["obstacles"]
    return joined


def find_untrue(problem: Mapping[str, Any], world: Mapping[str, Any] | None) -> dict[str, dict[str, Any]]:
    """Return each parameter in which ``world`` is not as ``problem`` believes: key -> ``believed`` and ``true``."""
    if world is None:
        return {}
    return {
        key: {"believed": believed, "true": true}
        for key, believed, true in _compare(problem, world)
        if _is_physical(key)
    }


def describe_untrue(untrue: Mapping[str, Mapping[str, Any]]) -> str:
    """Return what :func:`find_untrue` found in words."""
    return ", ".join(
        f"{key} {_spell(x['true'])} instead of {_spell(x['believed'])}" for key, x in untrue.items()
    )


def find_untold(
    problem: Mapping[str, Any], world: Mapping[str, Any] | None, recorded: Mapping[str, Any]
) -> tuple[str, ...]:
    """Return one sentence where the record's meta ``recorded`` says that it was made in another ``world`` than is judged by."""
    then = recorded.get(META)
    if not isinstance(then, Mapping) or not find_untrue(world or problem, then):
        return ()
    said = describe_untrue(find_untrue(problem, then))
    return (f"the run was made in a world with {said}, and is judged by another",)


def _is_physical(key: str) -> bool:
    return key in _list_physical()


def _list_physical() -> list[str]:
    return [*(f"{table}.{key}" for table, keys in PHYSICAL.items() for key in keys), "obstacles"]


class _Difference(NamedTuple):
    """A ``key`` with its value in one problem, and in the ``other``; None where there is none."""

    key: str
    one: Any
    other: Any


def _compare(a: Mapping[str, Any], b: Mapping[str, Any]) -> Iterator[_Difference]:
    """Yield whatever differs, tables key by key, names left out."""
    for table in dict.fromkeys([*a, *b]):
        if table in NAMES:
            continue
        one, other = a.get(table), b.get(table)
        if isinstance(one, Mapping) and isinstance(other, Mapping):
            for key in dict.fromkeys([*one, *other]):
                if one.get(key) != other.get(key):
                    yield _Difference(f"{table}.{key}", one.get(key), other.get(key))
        elif one != other:
            yield _Difference(table, one, other)


def _spell(value: object) -> str:
    return "nothing" if value is None else f"{value:.6g}" if isinstance(value, float) else f"{value!r:.60}"
