"""Measure, write and say: the phase diagram and the lifted fingers as files and as text."""

from __future__ import annotations

import argparse
import itertools
import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from dexplan.pool import answer_in_order
from dexplan.witness import lifted
from dexplan.witness.diagram import Boundary, describe_settings, measure_diagram
from dexplan.witness.lifted import LiftedFinger, draw, lift
from dexplan.witness.outcome import Kind
from dexplan.witness.picture import count_cases, draw_diagram, draw_lifted

GRASPS, COARSE_GRASPS = 200, 12


def main(arguments: Sequence[str] | None = None, description: str | None = None) -> int:
    """Measure the phase diagram and the lifted fingers; return 0 where all demands are met, else 1."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--coarse", action="store_true", help="three frictions, a few marks, twelve lifted fingers"
    )
    parser.add_argument("--out", type=Path, default=Path("runs") / "phase_diagram", help="where the files go")
    parser.add_argument(
        "--grasps", type=int, help=f"lifted fingers (default: {GRASPS}, coarse {COARSE_GRASPS})"
    )
    parser.add_argument("--seed", type=int, default=0, help="the first seed of the lifted fingers")
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args(arguments)
    diagram = measure_diagram(asked.coarse, asked.workers, _bar("phase diagram"))
    _write_json(asked.out / "phase_diagram.json", diagram.as_json())
    draw_diagram(diagram, asked.out / "phase_diagram.png")
    print(tabulate(diagram.boundaries))
    tried = [point for point in diagram.grid if point.agrees is not None]
    print(
        f"{len(tried) - len(diagram.misses)} of {len(tried)} points of the picture do what the sign of their load margin says; "
        f"{len(diagram.grid) - len(tried)} are beyond the servos' torques or the joints' ranges"
    )
    for point in diagram.misses:
        seen = point.outcome.kind if point.outcome else "nothing"
        print(
            f"  {point.experiment} at mu {point.mu:g}, {point.x:.4g}: margin {point.margin:+.4f}, seen {seen}"
        )
    print(f"{diagram.settings['run_time_s']:.0f} s\n")
    begin = time.perf_counter()
    count = asked.grasps or (COARSE_GRASPS if asked.coarse else GRASPS)
    cases = list(_bar("lifted fingers")(lift_many(count, asked.workers, asked.seed), count))
    spent = time.perf_counter() - begin
    _write_json(asked.out / "lifted_fingers.json", describe_cases(cases, spent))
    draw_lifted(cases, asked.out / "lifted_fingers.png")
    print(tabulate_cases(cases))
    print(f"{spent:.0f} s\n{asked.out}")
    is_met = all(b.is_within for b in diagram.boundaries) and all(c.agrees for c in cases if c.is_clear)
    return 0 if is_met else 1


def lift_many(count: int, workers: int = 2, first_seed: int = 0) -> Iterator[LiftedFinger]:
    """Yield ``count`` lifted fingers: those of the first seeds whose grasps are admissible, in order."""
    found = 0
    for case in answer_in_order(_lift_seed, itertools.count(first_seed), workers):
        if found == count:
            return
        if case is not None:
            found += 1
            yield case


def _lift_seed(seed: int) -> LiftedFinger | None:
    return lift(draw(seed))


def tabulate(boundaries: Iterable[Boundary]) -> str:
    """Return one line per boundary."""
    lines = [
        f"{'experiment':<11}{'mu':>5}{'closed form':>13}{'load aware':>12}{'simulated':>11}{'difference':>12}{'demand':>9}"
        f"{'step':>11}{'torque':>8}  gives way"
    ]
    for b in boundaries:
        number = lambda x: "-" if x is None else f"{x:.4g}" if abs(x) < 1.0 else f"{x:.3f}"  # noqa: E731
        lines.append(
            f"{b.experiment:<11}{b.mu:>5g}{number(b.closed_form):>13}{number(b.load_aware):>12}{number(b.simulated):>11}"
            f"{number(b.difference):>12}{number(b.demand):>9}{number(b.resolution):>11}{number(b.torque_share):>8}"
            f"  {b.gives_way or b.note} [{b.unit}]{'' if b.is_within else '  NOT WITHIN'}"
        )
    return "\n".join(lines)


def tabulate_cases(cases: Sequence[LiftedFinger]) -> str:
    """Return the confusion table of lifted fingers, and every case that is not clear or not as predicted."""
    table = count_cases(cases)
    kinds = (Kind.HOLD, Kind.SPIN, Kind.SLIP, Kind.DROP)
    lines = [f"{'predicted':<12}" + "".join(f"{kind:>14}" for kind in kinds) + "   (clear + near zero)"]
    for predicted in (Kind.HOLD, Kind.SPIN, Kind.DROP):
        cells = (f"{table[predicted, k, True]} + {table[predicted, k, False]}" for k in kinds)
        lines.append(f"{predicted:<12}" + "".join(f"{cell:>14}" for cell in cells))
    clear = [c for c in cases if c.is_clear]
    lines.append(
        f"{sum(c.agrees for c in clear)} of {len(clear)} agree where margins are clear of zero "
        f"(by {lifted.BAND:g}, the force balance of a spin by {lifted.SPIN_BAND:g}), "
        f"{sum(c.agrees for c in cases)} of {len(cases)} in all"
    )
    lines += [
        f"  seed {c.seed}: margin {c.margin_pair:+.4f}, with free torsion {c.margin_pivot:+.4f}: predicted {c.predicted}, "
        f"seen {c.outcome.kind}{'' if c.agrees else '  NOT AS PREDICTED'}"
        for c in cases
        if not (c.is_clear and c.agrees)
    ]
    return "\n".join(lines)


def describe_cases(cases: Sequence[LiftedFinger], spent: float) -> dict[str, Any]:
    """Return lifted fingers as plain data, ``format`` 1; the cases that predict nothing or fail stand in a list of their own."""
    table = count_cases(cases)
    return {
        "format": 1,
        "settings": {
            **describe_settings(),
            "preload_N": lifted.PRELOAD,
            "sliding": lifted.SLIDING,
            "torsional_over_sliding_m": lifted.PATCH,
            "band": lifted.BAND,
            "spin_band": lifted.SPIN_BAND,
            "least_margin_of_three": lifted.LEAST_MARGIN,
            "run_time_s": round(spent, 1),
        },
        "confusion": [
            {"predicted": p, "observed": o, "is_clear": clear, "count": n}
            for (p, o, clear), n in sorted(table.items())
        ],
        "unclear_or_wrong": [c.seed for c in cases if not (c.is_clear and c.agrees)],
        "cases": [c.as_json() for c in cases],
    }


def _bar(title: str) -> Callable[[Iterable[Any], int], Iterable[Any]]:
    """Return a wrapper that shows a progress bar on stderr where that is a terminal."""
    return lambda jobs, count: tqdm(
        jobs, total=count, desc=title, file=sys.stderr, disable=not sys.stderr.isatty(), leave=False
    )


def _write_json(path: Path, values: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
