"""The same problems with the person as spheres, capsules and hulls, whole and simplified, judged in the finest."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

import wholebody as wb
from wholebody.base.errors import WholebodyError
from wholebody.bench.measure.scaling import TIP, chain, task
from wholebody.bench.rows import Figure, Row, measured_ms
from wholebody.bench.suite.problem_sets.registry import SETS
from wholebody.methods.simplification import simplify
from wholebody.problem import Problem

SHOWN = "solved", "pairs", "a solve ms", "judgement ms", "inside", "worst deepest mm", "worst effort above %"
"""Figures of a level of modelling that the report shows."""

LEVELS = "all", "simplified"


def detail_rows(cases: int, seed: int, say: Callable[[str], None]) -> Iterator[Row]:
    """Solve every case with every model of the body; `say` takes a sentence where a model cannot be asked."""
    figures = {detail: wb.load("human", detail=detail) for detail in ("hulls", "capsules", "spheres")}
    for name in ("clutter", "balance"):
        for number in range(cases):
            given, models = SETS[name].make(number, seed).problem, {}
            for detail, figure in figures.items():
                try:
                    models[detail] = of_figure(figure, given)
                except WholebodyError as error:
                    say(f"{name}, {detail}: not asked; {error}")
            yield from levels(name, models)
    figure = chain(7, 1)
    for number in range(cases):
        scene, target = task(figure, 1000, seed + number)
        problem = wb.Problem(scene, goals=[wb.Point(TIP, target)], clearance=0.002)
        yield from levels("arm among 1000 things", {"own": problem})


def of_figure(figure: wb.Figure, given: Problem) -> Problem:
    """The same problem about the same person in another detail."""
    scene = wb.Scene(figure)
    for name, thing in given.scene.objects.items():
        scene.add(thing.shape, name=name, at=thing.placement)
    return Problem(
        scene, given.start, goals=given.goals, constraints=[*given.constraints, *given.bounds],
        measures=given.measures, clearance=given.clearance,
    )  # fmt: skip


def levels(case: str, models: dict[str, Problem]) -> Iterator[Row]:
    """All levels of all models of one case; the first model, whole, is what the others are held against."""
    judge, best = next(iter(models.values())), float("nan")
    for detail, given in models.items():
        for level in LEVELS:
            prepare, _, part = measured_ms(lambda: simplify(given))  # noqa: B023
            problem = given if level == "all" else part.problem
            wb.solve(problem)  # what a problem makes once is made
            answer, solved, judged = _timed(problem)
            truth = wb.assess(judge, answer.q)
            if np.isnan(best) and answer.solved:
                best = truth.measure
            yield Row(
                case,
                f"{detail}, {level}",
                {
                    "pairs": len(problem.scene.geometry.collisionPairs),
                    "status": answer.status,
                    "a solve ms": max(solved - judged, 0.0),
                    "judgement ms": judged,
                    "leaving out ms": prepare if level != "all" else 0.0,
                    "deepest mm": 1e3 * truth.penetration,
                    "clearance missed mm": 1e3 * truth.clearance_violation,
                    "goal missed mm": 1e3 * truth.goal_error,
                    "effort above %": 100.0 * (truth.measure / best - 1.0),
                },
            )


def _timed(problem: Problem) -> tuple[Any, float, float]:
    """A solution, and the processor's milliseconds of the solve with its judgement, and of the judgement alone."""
    solves = [measured_ms(lambda: wb.solve(problem)) for _ in range(2)]
    answer = solves[0][2]
    judged = min(measured_ms(lambda: wb.assess(problem, answer.q))[0] for _ in range(2))
    return answer, min(each[0] for each in solves), judged


def detail_summary(rows: Sequence[Row]) -> list[Row]:
    """A row for each case and model: medians of sizes and times; the worst errors of answers that it calls solved."""
    found = []
    for case, model in dict.fromkeys((row.case, row.tool) for row in rows):
        mine = [row for row in rows if (row.case, row.tool) == (case, model)]
        solved = [row for row in mine if row["status"] == "solved"]
        figures: dict[str, Figure] = {"solved": f"{len(solved)} of {len(mine)}"}
        for name in ("pairs", "a solve ms", "judgement ms", "leaving out ms"):
            figures[name] = float(np.median([row[name] for row in mine]))
        figures["inside"] = sum(row["deepest mm"] > 0.1 for row in solved)
        for name in ("deepest mm", "clearance missed mm", "goal missed mm", "effort above %"):
            figures[f"worst {name}"] = max((row[name] for row in solved), default=float("nan"))
        found.append(Row(case, model, figures))
    return found
