"""Any method from one start or from many: further starts by one rule and one time for all, so that they compare.

A start is the problem's own with its joints moved at random within the limits, free of overlap. The root, and all
joints between it and a frame that the problem holds in the world, stay, so that holds are met where the search begins.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.runner import processor_time
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.methods.base import Tracker
from wholebody.methods.control import Progress
from wholebody.methods.differential import NEGLIGIBLE
from wholebody.methods.starts import restarts
from wholebody.problem import Problem
from wholebody.solution import Solution

STARTS, ONE = "starts", "one_start"
"""Ends of the names of methods."""


class Restarted:
    """A method that restarts elsewhere if it ends without an answer, until a limit of processor seconds."""

    def __init__(self, method: Any, prepare: Callable[[Any, Problem], None], seconds: float = 1.5) -> None:
        """Take a method with one start, and what builds its model."""
        self.method, self.seconds, self._prepare = method, seconds, prepare
        self.tolerance: float = method.tolerance

    @property
    def name(self) -> str:
        """Name for tables."""
        return f"{self.method.name}/{STARTS}"

    def accepts(self, problem: Problem) -> str | None:
        """What the method says."""
        said: str | None = self.method.accepts(problem)
        return said

    def prepare(self, problem: Problem) -> None:
        """Build what the method needs, once for all starts."""
        self._prepare(self.method, problem)

    def solve(self, problem: Problem, progress: Progress | None = None) -> Solution:
        """The first answer that is solved, or the best one when the time is over."""
        began, worked = time.perf_counter(), processor_time()
        best: Solution = self.method.solve(problem, progress)
        tried, judging = 1, best.assessment.seconds
        further = starts(problem)
        while not best.solved and processor_time() - worked < self.seconds:
            start = next(further, None)
            if start is None:
                break
            found: Solution = self.method.solve(problem.with_start(start), progress)
            tried, judging = tried + 1, judging + found.assessment.seconds
            best = min(best, found, key=_rank)
        message = best.message if tried == 1 else f"{best.message}; {tried} starts"
        return replace(
            best,
            assessment=replace(best.assessment, seconds=judging),
            seconds=time.perf_counter() - began,
            method=self.name,
            message=message,
        )

    def tracker(self, problem: Problem, dt: float) -> Tracker:
        """The method's own: what follows goals starts where it is."""
        made: Tracker = self.method.tracker(problem, dt)
        return made


def restarted(adapter: Adapter) -> Adapter:
    """An method with further starts, from one with a single start."""
    family = adapter.name.removesuffix(f"/{ONE}")
    return replace(
        adapter,
        name=f"{family}/{STARTS}",
        make=lambda tolerance, iterations: Restarted(adapter.make(tolerance, iterations), adapter.prepare),
        loose=(),
        prepare=Restarted.prepare,
        setup=adapter.setup.replace("; one start,", "; from each start").removesuffix(".")
        + ". No other budgets than the default one. "
        + "Further starts within 1.5 s of processor time where there is no answer: joints moved at random "
        "within their limits, the root and what holds it excepted, free of overlap.",
    )


def starts(problem: Problem) -> Iterator[Array]:
    """Postures (nq,) to start at, without end where random ones are free of overlap; see the module."""
    figure, rng = problem.scene.figure, np.random.default_rng(0)
    moving = movable(problem)
    with problem.borrow() as workspace:
        deepest = workspace.deepest(problem.start) + 1e-4  # m: by which a start may overlap more than the problem's own
        failures = 0
        for drawn in restarts(problem, workspace.state, problem.start, rng, sys.maxsize):
            move = np.where(moving, pin.difference(figure.model, problem.start, drawn), 0.0)
            start: Array = figure.clamp(np.asarray(pin.integrate(figure.model, problem.start, move)))
            failures = 0 if workspace.deepest(start) <= deepest else failures + 1
            if not failures:
                yield start
            # of 40 random postures none is free of overlap: the next one is drawn
            elif failures == 40:
                return


def movable(problem: Problem) -> Array:
    """Which degrees of freedom (nv,) may start elsewhere: not the free root, nor joints that carry a held frame."""
    model, figure = problem.scene.model, problem.scene.figure
    found = np.ones(model.nv, dtype=bool)
    if figure.root == "free":
        found[:6] = False
    for term in problem.constraints:
        if isinstance(term, wb.Hold) and term.relative_to is None:
            joint = term.residual.place.joint
            while joint:
                at = model.joints[joint]
                found[at.idx_v : at.idx_v + at.nv] = False
                joint = model.parents[joint]
    return found


def _rank(solution: Solution) -> tuple[bool, float, float]:
    judged = solution.assessment
    broken = max(
        judged.penetration, judged.clearance_violation, judged.constraint_violation, judged.limit_violation, NEGLIGIBLE
    )
    return not solution.solved, broken, max(judged.goal_error, judged.goal_angle)
