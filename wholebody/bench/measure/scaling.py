"""`wholebody bench scaling`: time of a step and of a solve against joints, pieces and things."""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

import wholebody as wb
from wholebody.base.errors import WholebodyError
from wholebody.bench import plot_style
from wholebody.bench.measure import newton_shapes
from wholebody.bench.measure.chains import TIP, chain, task
from wholebody.bench.report import render
from wholebody.methods.simplification.simplify import simplify
from wholebody.tracking.drag import Drag

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
        series, size: what grows ("joints", "pieces" of each segment, or "things" around), and how many there are.
        method: its name; "qp, simplified" solves what `wb.simplify` leaves.
        joints, pieces, pairs: of the scene.
        build_ms: to build the scene's geometry; nan where nothing is built.
        problem_ms: to state the problem; where simplified, to simplify it.
        solve_ms, judge_ms: a solve without its judgement, and the judgement, least of the repeats, by the clock.
        step_ms: a frame of a drag, median; nan for methods without a step of their own.
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
        build_ms, made = cpu_ms(partial(newton_shapes.pulled_chain, size))
        solves = [cpu_ms(made.solve) for _ in range(repeats)]
        answer = solves[-1][1]
        yield ScalingRow(
            "joints", size, ASSEMBLY, size, 0, 0, build_ms, np.nan, min(ms for ms, _ in solves), np.nan, np.nan,
            answer.iterations, answer.status,
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
        times.append(cpu_ms(partial(drag.to, place))[0])
    return float(np.median(times[1:]))


NAMES = {"joints": "joints", "pieces": "pieces of each segment", "things": "things around"}
STYLES = {
    "qp": ("#0072b2", "o", "-"),
    SIMPLIFIED: ("#0072b2", "o", "--"),
    "newton": ("#e69f00", "^", "-"),
    ASSEMBLY: ("#e69f00", "^", "--"),
    "ccd": ("#000000", "X", "-"),
    "placo": ("#d55e00", "P", "-"),
}
"""Colour, marker and line of each method: the colours of the other charts."""


def chart(rows: Sequence[ScalingRow], path: Path) -> tuple[Path, Path]:
    """Above a solve, below a step, a judgement and the building of the geometry; a column for what grows."""
    series = [name for name in SERIES if any(row.series == name for row in rows)]
    drawn, axes = plot_style.figure(2, len(series), (4.3 * len(series), 7.4))
    for column, name in enumerate(series):
        mine = [row for row in rows if row.series == name]
        above, below = axes[0][column], axes[1][column]
        for method, (color, marker, line) in STYLES.items():
            shown = [row for row in mine if row.method == method]
            stepped = [row for row in shown if not math.isnan(row.step_ms)]
            style = {"color": color, "marker": marker, "markersize": 5, "linewidth": 1.5}
            style["fillstyle"] = "none" if line == "--" else "full"
            if shown:
                above.plot([row.size for row in shown], [row.solve_ms for row in shown], line, label=method, **style)
            if stepped:
                sizes, times = [row.size for row in stepped], [row.step_ms for row in stepped]
                below.plot(sizes, times, line, label=f"a step, {method}", **style)
        whole = [row for row in mine if row.method == "qp"]
        for label, color, values in (
            ("the judgement", "#009e73", [row.judge_ms for row in whole]),
            ("building the geometry", "#888888", [row.build_ms for row in whole]),
        ):
            below.plot([row.size for row in whole], values, ":", color=color, marker=".", linewidth=1.5, label=label)
        for axis in (above, below):
            axis.set(xscale="log", yscale="log")
            plot_style.plain_log(axis)
        above.set_title(f"more {NAMES[name]}", loc="left")
        below.set_xlabel(NAMES[name])
        if column == 0:
            above.set_ylabel("a solve, without its judgement [ms]")
            below.set_ylabel("time [ms]")
    for row in (0, 1):
        handles: dict[str, object] = {}
        for axis in axes[row]:
            handles.update(dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True)))
        axes[row][0].legend(handles.values(), handles.keys(), frameon=False, fontsize=8, loc="upper left")
        low = min(axis.get_ylim()[0] for axis in axes[row])
        high = max(axis.get_ylim()[1] for axis in axes[row])
        for axis in axes[row]:
            axis.set_ylim(low, high * (6.0 if axis is axes[row][0] and len(axes[row]) == 1 else 3.0))
    return plot_style.save(drawn, path)


def report(rows: Sequence[ScalingRow], left_out: Sequence[str], facts: Mapping[str, str]) -> str:
    """Exponents, then the times at every size; `left_out` are sentences on methods that were not asked at some size."""
    methods = [name for name in STYLES if any(row.method == name for row in rows)]
    keys = dict.fromkeys((row.series, row.size) for row in rows)
    sizes = [{"series": series, "size": size, "rows": _by_method(rows, methods, series, size)} for series, size in keys]
    return render(
        "scaling.md", exponents=_exponents(rows), sizes=sizes, methods=methods, simplified=SIMPLIFIED, names=NAMES,
        joints=JOINTS, things=THINGS, left_out=left_out, facts=facts,
    )  # fmt: skip


def _by_method(rows: Sequence[ScalingRow], methods: Sequence[str], series: str, size: int) -> dict[str, Any]:
    """The rows of one size; None for a method that was not asked."""
    found = {row.method: row for row in rows if (row.series, row.size) == (series, size)}
    return {name: found.get(name) for name in (*methods, "qp", SIMPLIFIED)}


def _exponents(rows: Sequence[ScalingRow]) -> list[dict[str, Any]]:
    """For each series and method: the sizes that were fitted, and the exponents; NaN where a time is not known."""
    table = []
    for series, method in dict.fromkeys((row.series, row.method) for row in rows):
        mine = [row for row in rows if (row.series, row.method) == (series, method)]
        sizes = [row.size for row in mine]
        times = [
            [row.solve_ms for row in mine],
            [row.solve_ms / max(row.iterations, 1) for row in mine],
            [row.step_ms for row in mine],
            [row.judge_ms for row in mine],
            [row.problem_ms for row in mine],
            [row.build_ms if method == "qp" else math.nan for row in mine],
        ]
        slopes, begins = [], sizes[0]
        for values in times:
            known = len(values) > 1 and not any(math.isnan(value) for value in values)
            slope, first = exponent(sizes, values) if known else (math.nan, begins)
            begins = int(first)
            slopes.append(slope)
        table.append({"series": series, "method": method, "begins": begins, "ends": sizes[-1], "slopes": slopes})
    return table
