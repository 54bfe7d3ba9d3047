"""`wholebody bench scaling`: time of a step and of a solve against joints, pieces and things."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

import wholebody as wb
from wholebody.bench import newton_shapes
from wholebody.bench.chains import TIP, chain, task
from wholebody.bench.newton_solves import PAPER_WAY, assembly_row
from wholebody.errors import WholebodyError
from wholebody.methods.drag import Drag
from wholebody.simplification.simplify import simplify

SERIES = ("joints", "pieces", "things")
SIZES: dict[str, tuple[int, ...]] = {
    "joints": (5, 10, 20, 50, 100, 200),
    "pieces": (1, 2, 4, 8, 16, 32),
    "things": (10, 30, 100, 300, 1000, 2000, 5000),
}
QUICK: dict[str, tuple[int, ...]] = {"joints": (5, 10, 20), "pieces": (1, 2, 4), "things": (10, 30, 100)}
ASSEMBLIES = (5, 10, 20, 50, 100, 200, 500)
JOINTS, SEGMENTS, THINGS = 12, 10, 10  # of the chain where something else grows; links with pieces; things
METHODS = ("qp", "newton", "ccd", "placo")
SIMPLIFIED = "qp, simplified"
ASSEMBLY = "newton, assembly"
STEPPED = ("qp", "newton")  # methods that have a step of their own in a drag
FRAMES = 12
CIRCLE = 0.02  # m: radius of what a drag follows; a frame moves a tenth of the way round
LONGEST = 1.0  # s: a method that takes longer for one solve is not asked at larger sizes
CLEARANCE = 0.002  # m

_R = TypeVar("_R")


@dataclass(frozen=True)
class ScalingRow:
    """One method at one size.

    Attributes:
        series: what grows: "joints", "pieces" of each segment, or "things" around.
        size: how many.
        method: its name; "qp, simplified" solves what `wb.simplify` leaves.
        joints, pieces, pairs: of the scene.
        build_ms: to build the scene's geometry [ms]; nan where nothing is built.
        problem_ms: to state the problem; where simplified, to simplify it [ms].
        solve_ms: a solve without its judgement, least of the repeats, by the clock [ms].
        judge_ms: the judgement of an answer, least, by the clock [ms].
        step_ms: a frame of a drag, median [ms]; nan for methods without a step of their own.
        iterations: of the solve.
        status: of the solve.
    """

    series: str
    size: int
    method: str
    joints: int
    pieces: int
    pairs: int
    build_ms: float
    problem_ms: float
    solve_ms: float
    judge_ms: float
    step_ms: float
    iterations: int
    status: str


def rows(
    sizes: dict[str, tuple[int, ...]], methods: Sequence[str], repeats: int, say: Callable[[str], None]
) -> Iterator[ScalingRow]:
    """Measure all methods at all sizes. `say` takes a line about each."""
    for series, grown in sizes.items():
        slow: set[str] = set()
        for size in grown:
            joints = size if series == "joints" else JOINTS
            pieces = size if series == "pieces" else 1
            things = size if series == "things" else THINGS
            figure = chain(joints, pieces, min(joints, SEGMENTS))
            scene, target = task(figure, things, seed=0)
            build_ms, _ = cpu_ms(lambda scene=scene: scene.geometry)  # type: ignore[misc]
            for method in (*methods, SIMPLIFIED):
                if method in slow:
                    continue
                try:
                    row = _row(series, size, method, scene, target, build_ms, repeats)
                except WholebodyError as error:
                    say(f"{series} {size}, {method}: left out, {error}")
                    slow.add(method)
                    continue
                if row.solve_ms > 1e3 * LONGEST:
                    slow.add(method)
                    say(f"{method}: more {series} than {size} left out, for a solve took {1e-3 * row.solve_ms:.1f} s")
                say(f"{series} {size}, {method}: {row.solve_ms:.1f} ms, a step {row.step_ms:.2f} ms, {row.status}")
                yield row
            del scene, figure
            gc.collect()


def assembly_rows(sizes: Sequence[int], repeats: int) -> Iterator[ScalingRow]:
    """Sparse Newton on chains of loose bodies: no model of joints, seven variables a body."""
    for size in sizes:
        build_ms, made = cpu_ms(lambda size=size: newton_shapes.chain(size))  # type: ignore[misc]
        last = f"b{size - 1}"
        tip = np.array((newton_shapes.LINK, 0.0, 0.0))
        made.point_goal(last, made.placement(last).act(tip) + np.array(PAPER_WAY), place=tip)
        found = assembly_row(f"chain of {size}", made, repeats)
        yield ScalingRow(
            "joints", size, ASSEMBLY, size, 0, 0, build_ms, np.nan, found.ms, np.nan, np.nan,
            round(found.iterations), "solved",
        )  # fmt: skip


def exponent(sizes: Sequence[float], times: Sequence[float]) -> tuple[float, float]:
    """Exponent of time ~ size**e over the upper range, and the size that range begins at.

    The line is fitted to the logarithms of the sizes from a tenth of the largest on, where what grows outweighs what
    does not; of three sizes at least.
    """
    size, duration = np.asarray(sizes, dtype=float), np.asarray(times, dtype=float)
    order = np.argsort(size)
    size, duration = size[order], duration[order]
    first = min(int(np.searchsorted(size, 0.0999 * size[-1])), max(0, len(size) - 3))
    if len(size) < 2:
        return float("nan"), float(size[0])
    return float(np.polyfit(np.log(size[first:]), np.log(duration[first:]), 1)[0]), float(size[first])


def cpu_ms(work: Callable[[], _R]) -> tuple[float, _R]:
    """The processor's time for a piece of work [ms], and what came of it."""
    began = time.process_time()
    result = work()
    return 1e3 * (time.process_time() - began), result


def _row(
    series: str, size: int, method: str, scene: wb.Scene, target: Any, build_ms: float, repeats: int
) -> ScalingRow:
    problem_ms, problem = cpu_ms(lambda: wb.Problem(scene, goals=[wb.Point(TIP, target)], clearance=CLEARANCE))
    asked, way = problem, method
    if method == SIMPLIFIED:
        problem_ms, part = cpu_ms(lambda: simplify(problem))
        asked, way = part.problem, "qp"
    wb.solve(asked, way)
    solves = [wb.solve(asked, way) for _ in range(repeats)]
    answer = solves[-1]
    return ScalingRow(
        series=series,
        size=size,
        method=method,
        joints=asked.scene.model.nv,
        pieces=asked.scene.geometry.ngeoms,
        pairs=len(asked.scene.geometry.collisionPairs),
        build_ms=build_ms,
        problem_ms=problem_ms,
        solve_ms=1e3 * min(found.seconds - found.assessment.seconds for found in solves),
        judge_ms=1e3 * min(found.assessment.seconds for found in solves),
        step_ms=_step_ms(asked, way) if way in STEPPED else float("nan"),
        iterations=answer.iterations,
        status=answer.status,
    )


def _step_ms(problem: wb.Problem, method: str) -> float:
    """Median time of a frame of a drag in a small circle about where the tip starts."""
    scene = problem.scene
    center = scene.state(problem.start).frame(scene.frame_id(TIP)).translation.copy()
    drag, times = Drag(problem, method), []
    for frame in range(FRAMES + 1):
        angle = 0.2 * np.pi * frame
        place = center + CIRCLE * np.array((0.0, np.sin(angle), 1.0 - np.cos(angle)))
        times.append(cpu_ms(lambda place=place: drag.to(place))[0])  # type: ignore[misc]
    return float(np.median(times[1:]))
