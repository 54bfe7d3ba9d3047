"""All the ways that are tried for one problem: a descent, bent limbs, goals approached in stages, other starts."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import NamedTuple

import numpy as np

from wholebody.methods.qp.descent import Descent, Local
from wholebody.methods.qp.quadratic_program import Array
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.subproblem import Subproblem
from wholebody.methods.starts import bent, restarts
from wholebody.problem import Iterate, Problem

ALIKE = 1e-5  # share of a goal's error by which two descents may differ and count as equally near
STAGES = (0.25, 0.5, 0.75)  # of the way to the goals, when the straight attempt ends in a local minimum


class Settings(NamedTuple):
    """What a search is bounded by; see `QP`."""

    tolerance: float
    iterations: int
    budget: int
    restarts: int
    seed: int


class Search:
    """Descent, continuation and restarts for one problem, remembering the best posture."""

    def __init__(self, problem: Problem, solver: QPSolver, settings: Settings) -> None:
        """Set up for a problem; `run` does it all."""
        self.problem, self.solver, self.settings = problem, solver, settings
        self.subproblem = Subproblem(problem)
        self.lineariser = problem.lineariser()
        self.trace: list[Iterate] = []
        self.spent = 0
        self._left = settings.budget  # programs that the ways after the first may still solve
        self.how = "directly"
        self._best: Local | None = None

    @property
    def best(self) -> Local:
        """The best posture so far."""
        assert self._best is not None
        return self._best

    def run(self) -> Local:
        """Try one way after the other until the goals are met; the best that was found."""
        self._try_ways()
        self._settle()
        return self.best

    def _try_ways(self) -> None:
        start = self.problem.scene.figure.clamp(self.problem.start)
        if self._accept(self._descend(start), "directly"):
            return
        ways = chain(self._bent(start), self._staged(start), self._restarted(start))
        for local, how in ways:
            if self._accept(local, how) or self._left <= 0:
                return

    def _bent(self, start: Array) -> Iterator[tuple[Local, str]]:
        """Straight limbs hide what bending them would do: the same descent with joints moved off their limits."""
        q = bent(self.problem, start)
        if q is not None:
            yield self._try(q, "bent"), "from a start with bent joints"

    def _staged(self, start: Array) -> Iterator[tuple[Local, str]]:
        """Goals approached through intermediate ones: the errors at the start, shrinking to nothing."""
        if not self.problem.goals:
            return
        whole, q = self._goal_errors(start), start
        for share in STAGES:
            q = self._try(q, "stage", (1.0 - share) * whole).q
        yield self._try(q, "stage"), "in stages"

    def _restarted(self, start: Array) -> Iterator[tuple[Local, str]]:
        """Seeded postures to begin from."""
        rng = np.random.default_rng(self.settings.seed)
        for q in restarts(self.problem, start, rng, self.settings.restarts):
            yield self._try(q, "restart"), "from another start"

    def _settle(self) -> None:
        """Where the goals are not reached, come as near as goes, then improve the measures from there."""
        if self.best.violation.left <= self.settings.tolerance:
            return
        nearest = self._descend(self.best.q, note="nearest", measures=False)
        self._accept(nearest, self.how)
        # it began at the best and came to rest: nothing nearer is near that
        best = self.best._replace(converged=self.best.converged or nearest.converged)
        self._best = best
        if best.violation.left > self.settings.tolerance and self.problem.measures:
            local = self._stay(best)
            if (
                _held(local, self.settings.tolerance)
                and local.violation.left <= best.violation.left + self.settings.tolerance
            ):
                self._best = local

    def _stay(self, local: Local) -> Local:
        """Descend with the goals' errors to stay as they are: what must hold is mended, then the measures improve."""
        nearest = self._goal_errors(local.q)
        stayed = self._descent(self.settings.iterations, nearest, "nearest").run(local.q)
        self.spent += stayed.iterations
        left = float(np.linalg.norm(self._goal_errors(stayed.q)))
        violation = stayed.violation._replace(goal=left, left=left)
        return stayed._replace(violation=violation, converged=local.converged)

    def _goal_errors(self, q: Array) -> Array:
        state = self.lineariser.state.update(q)
        return np.concatenate([np.zeros(0), *(np.atleast_1d(goal.error(state)) for goal in self.problem.goals)])

    def _try(self, start: Array, note: str, offset: Array | None = None) -> Local:
        """Descend with what is left of the budget."""
        before = self.spent
        local = self._descend(start, offset, note, most=max(self._left, 1))
        self._left -= self.spent - before
        return local

    def _descend(
        self,
        start: Array,
        offset: Array | None = None,
        note: str = "",
        *,
        measures: bool = True,
        most: int | None = None,
    ) -> Local:
        """Descend from a start; where that ends with something that must hold not holding, mend it."""
        iterations = self.settings.iterations if most is None else min(most, self.settings.iterations)
        local = self._descent(iterations, offset, note, measures=measures).run(start)
        self.spent += local.iterations
        if not _held(local, self.settings.tolerance) and offset is None and (most is None or local.iterations < most):
            stayed = self._stay(local)
            local = stayed if _better(stayed, local, self.settings.tolerance) else local
        return local

    def _descent(self, iterations: int, offset: Array | None, note: str, *, measures: bool = True) -> Descent:
        return Descent(
            self.subproblem, self.lineariser, self.solver, self.settings.tolerance, iterations, offset, self.trace,
            note, measures,
        )  # fmt: skip

    def _accept(self, local: Local, how: str) -> bool:
        """Keep the better one; whether what is asked holds now."""
        if self._best is None or _better(local, self._best, self.settings.tolerance):
            self._best, self.how = local, how
        return self.best.violation.worst <= self.settings.tolerance


def _held(local: Local, tolerance: float) -> bool:
    return _broken(local) <= tolerance


def _better(one: Local, other: Local, tolerance: float) -> bool:
    """Whether one descent ended better: in what must hold, then in the goals, then in the measures."""
    for left, right in ((_broken(one), _broken(other)), (one.violation.goal, other.violation.goal)):
        left, right = max(left, tolerance), max(right, tolerance)
        if abs(left - right) > max(tolerance, ALIKE * min(left, right)):
            return left < right
    return one.measure < other.measure


def _broken(local: Local) -> float:
    return max(local.violation.hold, local.violation.elastic)
