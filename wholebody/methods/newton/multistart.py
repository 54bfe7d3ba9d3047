"""The search for one problem, bounded by counts: from the start, from bent limbs, and from other postures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import numpy as np

from wholebody.assessment.posture import Assessment, assess
from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import known
from wholebody.base.fields import Checked
from wholebody.methods.base import Iterations, Restarts, Seed, TimeLimit, Tolerance
from wholebody.methods.conclusion import Ending, assessed_tolerance, meets
from wholebody.methods.contradictions import Contradiction, contradictions, least_left
from wholebody.methods.newton.feasibility import FeasibilityResult, satisfy
from wholebody.methods.newton.inequalities import Kind
from wholebody.methods.newton.linear_algebra import NAMES
from wholebody.methods.newton.measures import refine
from wholebody.methods.newton.settings import STARTS
from wholebody.methods.newton.terms import FigureSystem
from wholebody.methods.simplification import beyond_reach
from wholebody.methods.starts import Minima, off_limits, restarts
from wholebody.solution import TraceEntry
from wholebody.tasks.frame import Frame
from wholebody.tasks.point import Point


@dataclass(frozen=True)
class Settings(Checked):
    """The settings of a search; see `Newton`."""

    tolerance: Tolerance = 1e-5
    iterations: Iterations = 200
    algebra: str = "auto"
    inequalities: Kind = "slack"
    restarts: Restarts = 6
    seed: Seed = 0
    time_limit: TimeLimit = None

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        known(self.algebra, NAMES, "linear algebra")

    @property
    def assessed_tolerance(self) -> float:
        """Error below which an assessment counts as good."""
        return assessed_tolerance(self.tolerance)


class SearchResult(NamedTuple):
    """The result from one start: the posture (nq,), its assessment, how the iteration ended, and the start in words."""

    q: Array
    judgement: Assessment
    reached: FeasibilityResult
    how: str


class Search:
    """The search for one problem, which keeps the best result."""

    def __init__(self, active_system: FigureSystem, settings: Settings) -> None:
        self.active_system, self.settings = active_system, settings
        self.iterations = 0
        self.residuals: list[float] = []
        self.contradictions: tuple[Contradiction, ...] = ()

    def from_here(self, q: Array) -> SearchResult:
        """The result from a posture (nq,) alone."""
        return self._go(q, "", self.settings.iterations)

    def everywhere(self, q: Array) -> SearchResult:
        """The best result of all starts; if it solves the problem, its measures are minimised."""
        self.contradictions = contradictions(self.active_system.problem, self.active_system.workspace)
        hopeless = least_left(self.contradictions) is None
        best = self._go(q, "", STARTS.trial) if hopeless else self.from_here(q)
        if not self._solves(best) and not hopeless:
            best = self._from_other_starts(q, best, STARTS.beyond if self._beyond_reach() else None)
        if self.active_system.control.over:
            return best
        if not best.judgement.holds(self.settings.assessed_tolerance) and not hopeless:
            best = self._least_violation(best, q)
        if self._solves(best) and self.active_system.objective.minimised:
            best = self._refined(best)
        return best

    def _beyond_reach(self) -> bool:
        """Whether a goal is out of reach for certain, so that no other start can solve the problem."""
        problem = self.active_system.problem
        for goal in problem.goals:
            if isinstance(goal, Point):
                offset, at = goal.resolved_offset, goal.resolved_target
            elif isinstance(goal, Frame):
                offset, at = np.zeros(3), goal.residual.placement.translation
            else:
                continue
            if beyond_reach(problem, goal.frame, offset, at[None])[0] > self.settings.assessed_tolerance:
                return True
        return False

    def _from_other_starts(self, q: Array, best: SearchResult, count: int | None) -> SearchResult:
        """The best result of other starts, at most `count`, and the best so far; each start has a trial first."""
        minima, control, most = Minima(), self.active_system.control, self.iterations + STARTS.iterations
        for start, how in islice(self._starts(q), count):
            if minima.complete:
                break
            found = self._go(start, how, min(STARTS.trial, self.settings.iterations))
            if self._better(found, best) and not found.reached.stationary and not self._solves(found):
                found = self._go(found.q, how, self.settings.iterations)
            least = max(_broken(found), self.settings.assessed_tolerance) + _missed(found)
            minima.add(least, found.reached.stationary)
            best = found if self._better(found, best) else best
            if self._solves(best):
                self.contradictions = ()
            if self._solves(best) or self.iterations > most or control.over or control.spent > STARTS.time_share:
                break
        return best

    def ending(self, found: SearchResult) -> Ending:
        """A result as the end of the search."""
        reported = ", ".join(self.active_system.objective.reported)
        return Ending(
            found.q,
            found.reached.stationary,
            self.iterations,
            tuple(TraceEntry(error, 0.0, 0.0, 0.0) for error in self.residuals),
            f"in {self.iterations} iterations{found.how}",
            remark=f"; {reported} is reported, not minimised" if reported else "",
            contradictions=self.contradictions,
            judgement=found.judgement,
            method=f"newton/{self.active_system.algebra.name}",
        )

    def _starts(self, q: Array) -> Iterator[tuple[Array, str]]:
        problem = self.active_system.problem
        start = off_limits(problem, self.active_system.workspace.state, q)
        if start is not None and self.active_system.defined(start):
            yield start, " from a start with bent joints"
        rng = np.random.default_rng(self.settings.seed)
        for start in restarts(problem, self.active_system.workspace.state, q, rng, self.settings.restarts):
            if self.active_system.defined(start):
                yield start, " from another start"

    def _go(self, q: Array, how: str, iterations: int, system: FigureSystem | None = None) -> SearchResult:
        """The result from a posture (nq,), by the search's own equations or by others of the same problem."""
        active_system, settings = self.active_system if system is None else system, self.settings
        reached = satisfy(
            active_system,
            active_system.variables(q),
            tolerance=STARTS.sharper * settings.tolerance,
            iterations=iterations,
            kind=settings.inequalities,
        )
        self.iterations += reached.iterations
        self.residuals += reached.residuals
        return self._judged(reached, how, active_system)

    def _refined(self, found: SearchResult) -> SearchResult:
        """The same with lower measures, if possible."""
        x, spent, _ = refine(self.active_system, found.reached.x, self.settings.tolerance)
        self.iterations += spent
        lower = self._judged(with_values(found.reached, x=x), found.how, self.active_system)
        return lower if self._solves(lower) and self._better(lower, found) else found

    def _least_violation(self, best: SearchResult, q: Array) -> SearchResult:
        """The posture with the least violation of the constraints, if it violates them less than the best so far."""
        whole = self.active_system
        elastic = FigureSystem(whole.problem, whole.workspace, whole.algebra_name, yielding=True)
        elastic.control = whole.control
        found = self._go(q, best.how, self.settings.iterations, elastic)
        stationary = best.reached.stationary or found.reached.stationary
        found = with_values(found, reached=with_values(found.reached, stationary=stationary))
        return found if self._better(found, best) else best

    def _judged(self, reached: FeasibilityResult, how: str, system: FigureSystem) -> SearchResult:
        q = system.posture(reached.x)
        return SearchResult(q, assess(system.problem, q), reached, how)

    def _solves(self, found: SearchResult) -> bool:
        return meets(found.judgement, self.settings.tolerance)

    def _better(self, one: SearchResult, other: SearchResult) -> bool:
        """Whether one result is better: in the violation, then in the goal errors, then in the measures."""
        enough = self.settings.assessed_tolerance
        for left, right in ((_broken(one), _broken(other)), (_missed(one), _missed(other))):
            left, right = max(left, enough), max(right, enough)
            if abs(left - right) > max(enough, STARTS.alike * min(left, right)):
                return left < right
        return one.judgement.measure < other.judgement.measure


def _broken(found: SearchResult) -> float:
    judged = found.judgement
    return max(judged.limit_violation, judged.constraint_violation, judged.clearance_violation, judged.penetration)


def _missed(found: SearchResult) -> float:
    return float(np.linalg.norm(found.judgement.goal_errors))
