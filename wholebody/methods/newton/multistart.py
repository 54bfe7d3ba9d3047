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
from wholebody.methods.contradictions import contradictions, least_left
from wholebody.methods.newton.feasibility import FeasibilityResult, satisfy
from wholebody.methods.newton.inequalities import Kind
from wholebody.methods.newton.linear_algebra import NAMES
from wholebody.methods.newton.measures import refine
from wholebody.methods.newton.settings import STARTS
from wholebody.methods.newton.terms import FigureSystem
from wholebody.methods.starts import Attempt, Multistart, off_limits, restarts
from wholebody.solution import TraceEntry


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
    """The result from one start: the posture (nq,), its assessment, and how the iteration ended."""

    q: Array
    judgement: Assessment
    reached: FeasibilityResult


class NewtonMultistart(Multistart[SearchResult]):
    """The search for one problem."""

    def __init__(self, active_system: FigureSystem, settings: Settings) -> None:
        super().__init__(active_system.control)
        self.active_system, self.settings = active_system, settings
        self.iterations, self._most = 0, np.inf  # after which no other start follows
        self.residuals: list[float] = []

    def from_here(self, q: Array) -> Ending:
        """The end of the search from a posture (nq,) alone."""
        self.accept(self._go(q, self.settings.iterations))
        return self._ending()

    def everywhere(self, q: Array) -> Ending:
        """The best result of all starts; if it solves the problem, its measures are minimised."""
        self.contradictions = contradictions(self.active_system.problem, self.active_system.workspace)
        least = least_left(self.contradictions)  # of a goal that is out of reach no other start solves the problem
        hopeless = least is None
        self.search(self._attempts(q, hopeless, STARTS.beyond if least else None))
        if not self.control.over:
            if not self.best.judgement.holds(self.settings.assessed_tolerance) and not hopeless:
                self.accept(self._least_violation(q))
            if self.solves(self.best) and self.active_system.objective.measures:
                self._refine()
        if self.solves(self.best):
            self.contradictions = ()  # by less than the tolerance
        return self._ending()

    def _attempts(self, q: Array, hopeless: bool, count: int | None) -> Iterator[Attempt[SearchResult]]:
        most = STARTS.trial if hopeless else self.settings.iterations
        yield Attempt([q], lambda start: self._go(start, most), "")
        if hopeless:
            return
        self._most = self.iterations + STARTS.iterations
        given = self.active_system.problem, self.active_system.workspace.state, q
        bent = off_limits(*given)
        others = restarts(*given, np.random.default_rng(self.settings.seed), self.settings.restarts)
        bents = [] if bent is None else [*filter(self.active_system.defined, [bent])]
        yield Attempt(bents, self._trial, " from a start with bent joints")
        left = None if count is None else count - len(bents)
        yield Attempt(islice(filter(self.active_system.defined, others), left), self._trial, " from another start")

    def _trial(self, start: Array) -> SearchResult:
        """The result from another start, which has to come nearer than the best so far in a few iterations."""
        found = self._go(start, min(STARTS.trial, self.settings.iterations))
        if self.better(found, self.best) and not found.reached.stationary and not self.solves(found):
            found = self._go(found.q, self.settings.iterations)
        return found

    def _ending(self) -> Ending:
        """The best result as the end of the search."""
        found = self.best
        return Ending(
            found.q,
            found.reached.stationary,
            self.iterations,
            tuple(TraceEntry(error, 0.0, 0.0, 0.0) for error in self.residuals),
            f"in {self.iterations} iterations{self.how}",
            contradictions=self.contradictions,
            judgement=found.judgement,
            method=f"newton/{self.active_system.algebra.name}",
        )

    def _go(self, q: Array, iterations: int, system: FigureSystem | None = None) -> SearchResult:
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
        return self._judged(reached, active_system)

    def _refine(self) -> None:
        """Take the same with lower measures, if possible."""
        reached = self.best.reached
        x, spent, _ = refine(self.active_system, reached.x, self.settings.tolerance)
        self.iterations += spent
        lower = self._judged(with_values(reached, x=x), self.active_system)
        if self.solves(lower):
            self.accept(lower)

    def _least_violation(self, q: Array) -> SearchResult:
        """The posture with the least violation of the constraints."""
        whole = self.active_system
        elastic = FigureSystem(whole.problem, whole.workspace, whole.algebra_name, yielding=True)
        elastic.control = whole.control
        found = self._go(q, self.settings.iterations, elastic)
        stationary = self.best.reached.stationary or found.reached.stationary
        return with_values(found, reached=with_values(found.reached, stationary=stationary))

    def _judged(self, reached: FeasibilityResult, system: FigureSystem) -> SearchResult:
        q = system.posture(reached.x)
        return SearchResult(q, assess(system.problem, q), reached)

    def solves(self, end: SearchResult) -> bool:
        """See `Multistart.solves`."""
        return meets(end.judgement, self.settings.tolerance)

    def enough(self) -> bool:
        """Whether the iterations or the time for other starts are spent."""
        return self.iterations > self._most or self.control.spent > STARTS.time_share

    def better(self, one: SearchResult, other: SearchResult) -> bool:
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
