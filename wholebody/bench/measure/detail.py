"""What each level of modelling costs, and what it gets wrong in the finest model."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import WholebodyError
from wholebody.bench import plot_style
from wholebody.bench.measure.chains import TIP, chain, task
from wholebody.bench.report import render
from wholebody.bench.suite.problem_sets.registry import SETS
from wholebody.methods.simplification.simplify import GROWTH, Parts, leave_out
from wholebody.problem import Problem

DETAILS = ("spheres", "capsules", "hulls")
FINEST = "hulls"
LEVELS: dict[str, Parts] = {
    "all": Parts(joints=False, pairs=False, growth=0.0),
    "active joints": Parts(joints=True, pairs=False, growth=0.0),
    "pairs in reach": Parts(joints=False, pairs=True, growth=0.0),
    "simplified": Parts(joints=True, pairs=True, growth=GROWTH),
}
ARM_THINGS = 1000
CLEARANCE = 0.002  # m
REPEATS = 2  # solves of which the faster counts
INSIDE = 1e-4  # m: deeper than this an answer is inside something


@dataclass(frozen=True)
class DetailRow:
    """One case by one model; what an answer gets wrong is judged in the finest model.

    Attributes:
        task: "clutter", "whole body" or "arm".
        detail: "spheres", "capsules", "hulls", or "own" for a robot.
        level: what was left out.
        freedoms, pairs: of the model that was solved.
        status: of the answer, as its own model says.
        solve_ms, judge_ms: processor's time of the solve without its judgement, and of that; the faster of two.
        prepare_ms: to leave out what is left out.
        clearance_violation_mm: by how much the worst pair misses its clearance.
        goal_error_mm: what is left to the goals.
        above: effort above the finest model's own answer, as a share of it; nan where that one was not solved.
    """

    task: str
    case: int
    detail: str
    level: str
    freedoms: int
    pairs: int
    status: str
    solve_ms: float
    judge_ms: float
    prepare_ms: float
    penetration_mm: float
    clearance_violation_mm: float
    goal_error_mm: float
    effort: float
    above: float


def rows(cases: int, seed: int) -> Iterator[DetailRow | str]:
    """Measure every case with every model; a sentence where a model cannot be asked."""
    figures = {detail: wb.load("human", detail=detail) for detail in DETAILS}
    for name, family in (("clutter", SETS["clutter"]), ("whole body", SETS["balance"])):
        for number in range(cases):
            given, models = family.make(number, seed).problem, {}
            for detail, figure in figures.items():
                try:
                    models[detail] = _with(figure, given)
                except WholebodyError as error:
                    yield f"{name}, {detail}: not asked; {error}"
            yield from _levels(name, number, models, FINEST)
    figure = chain(7, 1)
    for number in range(cases):
        scene, target = task(figure, ARM_THINGS, seed + number)
        problem = wb.Problem(scene, goals=[wb.Point(TIP, target)], clearance=CLEARANCE)
        yield from _levels("arm", number, {"own": problem}, "own")


def _with(figure: wb.Figure, given: Problem) -> Problem:
    """The same problem about the same person in another detail."""
    scene = wb.Scene(figure)
    for name, thing in given.scene.objects.items():
        scene.add(thing.shape, name=name, at=thing.placement)
    return Problem(
        scene,
        given.start,
        goals=given.goals,
        constraints=[*given.constraints, *given.bounds],
        measures=given.measures,
        clearance=given.clearance,
    )


def _levels(name: str, number: int, models: dict[str, Problem], finest: str) -> Iterator[DetailRow]:
    """All levels of all models of one case; the finest one, whole, comes first, as what the others are held against."""
    judge = models[finest]
    best = float("nan")
    for detail in (finest, *(other for other in models if other != finest)):
        for level, parts in LEVELS.items():
            began = time.process_time()
            part = leave_out(models[detail], parts)
            prepare_ms = 1e3 * (time.process_time() - began) if level != "all" else 0.0
            problem = models[detail] if level == "all" else part.problem
            wb.solve(problem)  # what a problem makes once is made
            (answer, *times), *others = (_timed(problem) for _ in range(REPEATS))
            solved, judged = (min(each) for each in zip(times, *(other[1:] for other in others), strict=True))
            q: Array = answer.q if level == "all" else part.posture(answer.q)
            truth = wb.assess(judge, q)
            if (detail, level) == (finest, "all") and answer.solved:
                best = truth.measure
            yield DetailRow(
                task=name,
                case=number,
                detail=detail,
                level=level,
                freedoms=problem.scene.model.nv,
                pairs=len(problem.scene.geometry.collisionPairs),
                status=answer.status,
                solve_ms=1e3 * max(solved - judged, 0.0),
                judge_ms=1e3 * judged,
                prepare_ms=prepare_ms,
                penetration_mm=1e3 * truth.penetration,
                clearance_violation_mm=1e3 * truth.clearance_violation,
                goal_error_mm=1e3 * truth.goal_error,
                effort=truth.measure,
                above=truth.measure / best - 1.0 if answer.solved and np.isfinite(best) else float("nan"),
            )


def _timed(problem: Problem) -> tuple[wb.Solution, float, float]:
    """A solution, and the processor's seconds of the solve with its judgement, and of the judgement."""
    began = time.process_time()
    answer = wb.solve(problem)
    solved = time.process_time() - began
    wb.assess(problem, answer.q)
    return answer, solved, time.process_time() - began - solved


COLORS = {"spheres": "#d55e00", "capsules": "#0072b2", "hulls": "#009e73", "own": "#444444"}
MARKERS = dict(zip(LEVELS, ("o", "^", "s", "*"), strict=True))
TITLES = {
    "clutter": "a fingertip among 20 things",
    "whole body": "low and far reaches in balance",
    "arm": f"an arm among {ARM_THINGS} things",
}


class Summary(NamedTuple):
    """One model over all cases of a task; times are medians, the rest is named."""

    task: str
    detail: str
    level: str
    cases: int
    solved: int
    freedoms: int
    pairs: int
    solve_ms: float
    judge_ms: float
    prepare_ms: float
    inside: int
    worst_penetration_mm: float
    worst_clearance_violation_mm: float
    worst_goal_error_mm: float
    above: float
    worst_above: float


def summaries(rows: Sequence[DetailRow]) -> list[Summary]:
    """One for each task, detail and level; errors are those of answers that their own model calls solved."""
    found = []
    for name, kind, level in dict.fromkeys((row.task, row.detail, row.level) for row in rows):
        mine = [row for row in rows if (row.task, row.detail, row.level) == (name, kind, level)]
        solved = [row for row in mine if row.status == "solved"]
        above = [row.above for row in solved if np.isfinite(row.above)] or [float("nan")]
        sizes: dict[str, Any] = {each: int(_median(mine, each)) for each in ("freedoms", "pairs")}
        times: dict[str, Any] = {each: _median(mine, each) for each in ("solve_ms", "judge_ms", "prepare_ms")}
        worst: dict[str, Any] = {
            f"worst_{each}": max((getattr(row, each) for row in solved), default=0.0)
            for each in ("penetration_mm", "clearance_violation_mm", "goal_error_mm")
        }
        inside = sum(row.penetration_mm > 1e3 * INSIDE for row in solved)
        found.append(
            Summary(
                name, kind, level, len(mine), len(solved), **sizes, **times, **worst, inside=inside,
                above=float(np.median(above)), worst_above=max(above),
            )
        )  # fmt: skip
    return found


def _median(rows: Sequence[DetailRow], name: str) -> float:
    return float(np.median([getattr(row, name) for row in rows]))


def chart(rows: Sequence[DetailRow], path: Path) -> tuple[Path, Path]:
    """Time of a solve with its judgement against the deepest overlap, and against the effort above the finest."""
    found = summaries(rows)
    tasks = list(dict.fromkeys(one.task for one in found))
    drawn, axes = plot_style.figure(2, len(tasks), (4.3 * len(tasks), 7.2))
    for column, name in enumerate(tasks):
        above, below = axes[0][column], axes[1][column]
        for one in (one for one in found if one.task == name):
            style = {
                "color": COLORS[one.detail], "marker": MARKERS[one.level], "linestyle": "none", "alpha": 0.85,
                "markersize": 12 if one.level == "simplified" else 8,
            }  # fmt: skip
            time = one.solve_ms + one.judge_ms
            above.plot([time], [one.worst_penetration_mm], **style)
            below.plot([time], [100.0 * one.worst_above], **style)
        above.axhspan(1e3 * INSIDE, 1e3, color="#f4dddd", zorder=0)
        above.set_yscale("symlog", linthresh=1e-2)
        above.set_ylim(-2e-3, 1e2)
        below.set_yscale("symlog", linthresh=1.0)
        worst = [100.0 * one.worst_above for one in found if one.task == name and np.isfinite(one.worst_above)]
        below.set_ylim(min(-1.0, 2.0 * min(worst, default=0.0)), max(2.0, 2.0 * max(worst, default=0.0)))
        times = [one.solve_ms + one.judge_ms for one in found if one.task == name]
        for axis in (above, below):
            axis.set(xscale="log", xlim=(0.7 * min(times), 1.4 * max(times)))
            plot_style.plain_log(axis)
        below.axhline(0.0, color="#666666", linewidth=0.8)
        above.set_title(TITLES[name], loc="left")
        below.set_xlabel("a solve with its judgement, median [ms]")
    axes[0][0].set_ylabel("deepest overlap in the finest model [mm]")
    axes[1][0].set_ylabel("effort above the finest model's, worst case [%]")
    _legends(axes[0][-1], [one.detail for one in found])
    return plot_style.save(drawn, path)


def report(rows: Sequence[DetailRow], refused: Sequence[str], facts: Mapping[str, str]) -> str:
    """Table of all models of all tasks."""
    return render(
        "detail.md", rows=summaries(rows), refused=dict.fromkeys(refused), facts=facts, finest=FINEST, inside=INSIDE,
        growth=GROWTH, simplify="wb.simplify",
    )  # fmt: skip


def _legends(axis: Any, details: Sequence[str]) -> None:
    """Colours for details, markers for levels."""
    from matplotlib.lines import Line2D

    marks = [
        Line2D([], [], color=COLORS[name], marker="o", linestyle="none", label=name) for name in dict.fromkeys(details)
    ]
    marks += [
        Line2D([], [], color="#666666", marker=marker, linestyle="none", label=level, fillstyle="none")
        for level, marker in MARKERS.items()
    ]
    axis.legend(handles=marks, frameon=False, fontsize=8, loc="upper right")
