"""`wholebody bench detail`: what each level of modelling costs, and what it gets wrong in the finest model."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

import wholebody as wb
from wholebody.arrays import Array
from wholebody.bench.chains import TIP, chain, task
from wholebody.bench.problem_sets import balance, clutter
from wholebody.errors import WholebodyError
from wholebody.problem import Problem
from wholebody.simplification.simplify import GROWTH, Parts, leave_out

DETAILS = ("spheres", "capsules", "hulls")
FINEST = "hulls"
LEVELS: dict[str, Parts] = {
    "all": Parts(joints=False, pairs=False, growth=0.0),
    "joints that take part": Parts(joints=True, pairs=False, growth=0.0),
    "pairs in reach": Parts(joints=False, pairs=True, growth=0.0),
    "simplified": Parts(joints=True, pairs=True, growth=GROWTH),
}
ARM_THINGS = 1000
CLEARANCE = 0.002  # m
REPEATS = 2  # solves of which the faster counts
INSIDE = 1e-4  # m: deeper than this an answer is inside something


@dataclass(frozen=True)
class DetailRow:
    """One case by one model.

    Attributes:
        task: "clutter", "whole body" or "arm".
        case: its number.
        detail: "spheres", "capsules", "hulls", or "own" for a robot.
        level: what was left out.
        freedoms, pairs: of the model that was solved.
        status: of the answer, as its own model says.
        solve_ms: the solve without its judgement, the faster of two, by the clock [ms].
        judge_ms: the judgement, by the clock [ms].
        prepare_ms: to leave out what is left out [ms].
        penetration_mm: how deep the answer is inside something in the finest model [mm].
        lack_mm: by how much the worst pair misses its clearance there [mm].
        goal_error_mm: what is left to the goals [mm].
        effort: of the answer.
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
    lack_mm: float
    goal_error_mm: float
    effort: float
    above: float


def rows(cases: int, seed: int) -> Iterator[DetailRow | str]:
    """Measure every case with every model; a sentence where a model cannot be asked."""
    figures = {detail: wb.load("human", detail=detail) for detail in DETAILS}
    sets: dict[str, Callable[[int, int], Problem]] = {
        "clutter": lambda number, seed: clutter.make(number, seed).problem,
        "whole body": lambda number, seed: balance.make(number, seed).problem,
    }
    for name, make in sets.items():
        for number in range(cases):
            given, models = make(number, seed), {}
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
            answers = [wb.solve(problem) for _ in range(REPEATS)]
            answer = answers[0]
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
                solve_ms=1e3 * min(found.seconds - found.assessment.seconds for found in answers),
                judge_ms=1e3 * min(found.assessment.seconds for found in answers),
                prepare_ms=prepare_ms,
                penetration_mm=1e3 * truth.penetration,
                lack_mm=1e3 * truth.clearance_lack,
                goal_error_mm=1e3 * truth.goal_error,
                effort=truth.measure,
                above=truth.measure / best - 1.0 if answer.solved and np.isfinite(best) else float("nan"),
            )
