"""All the ways that are tried for one problem: a descent, feasibility first, other starts."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.records import with_values
from wholebody.methods.contradictions import NEAREST, Contradiction, contradictions, least_left
from wholebody.methods.control import Control
from wholebody.methods.qp.before_contact import before_contact
from wholebody.methods.qp.cancelling import posture_apart
from wholebody.methods.qp.comparison import better, held
from wholebody.methods.qp.curved_reach import CurvedReach
from wholebody.methods.qp.feasibility import Feasibility
from wholebody.methods.qp.iterates import LocalSolution
from wholebody.methods.qp.screening import SCREENED, Settings, least_measures
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.sqp import SQP
from wholebody.methods.qp.subproblem import Subproblem
from wholebody.methods.starts import Minima, hooked_hands, restarts, throughout
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.solution import TraceEntry
from wholebody.terms.linearisation import Lineariser

PROBE_PROGRAMS = 40  # most programs of a probe; more = surer on curved ways, fewer starts within the budget
RELAXATION_DEPTH = 0.15  # m: by which a relaxed probe may be inside of things; two limbs that cross need as much
NO_NEARER = 20  # probes in a row that came no nearer: the goals are out of reach
REACHED = 10.0  # tolerances: relaxed probes that end farther from the goals are given up
NEARER = 0.02  # share of what is left by which a probe is nearer
REACH_TRIALS = 10  # most descents without contacts that tell whether goals are out of reach
REACH_TRIAL_PROGRAMS = 60  # most programs of each
FAR = (1.0, 0.6)  # shares of the joints' ranges that their starts may be away by
HELD = 1e-2  # share of what is left of the goals by which constraints may be missed where such a descent ends
AGREEING = 3  # of them that have to come to rest equally near
FEW = 12  # degrees of freedom that move the goals; fewer: minima lie apart, starts are all over the limits, and cheap
AGREEING_FEW = 8  # the same for them
REACH_TRIALS_FEW = 16  # most descents for them
FEWEST_DESCENTS = 12  # fewest ends before their minima count as all; after 7, one that a fifth lead to may be unseen
AGREE = 1.1  # times the least violation up to which they count as equally near
COMING_NEAR = 40  # most programs from there to the nearest posture among things
PUSHED_OUT = 2  # of the nearest ends of such descents, how many are pushed out of things
STATIONARY = 0.01  # share of the error that they may still gain: they end where little more is foreseen
PUSHING_OUT = 6  # most programs of each
INSIDE_PROBES = 5  # seeded starts for goals inside of things, which only look for the nearest posture
STAYING = 40  # most programs that improve the measures at the nearest posture to goals that are not met
FOR_WAYS = 0.5  # share of the time limit that ways after the first may take: to come nearest takes its time too


class Search:
    """SQP, feasibility first and restarts for one problem, remembering the best posture."""

    def __init__(
        self, problem: Problem, workspace: Workspace, solver: QPSolver, settings: Settings, control: Control
    ) -> None:
        """Set up for a problem; `run` does it all."""
        self.problem, self.solver, self.settings, self.control = problem, solver, settings, control
        self.subproblem = Subproblem(problem, workspace.state)
        self.lineariser = problem.lineariser(workspace)
        self.trace: list[TraceEntry] = []
        self.spent = 0
        self._left = settings.budget  # programs that the ways after the first may still solve
        self._without_gain = 0  # probes in a row that came no nearer, without contacts or relaxed
        self.how = "directly"
        self.contradictions: tuple[Contradiction, ...] = ()
        self._least = 0.0  # what is known to be left of the goals at least, metres
        self._minima = Minima()  # where relaxed probes ended that were pushed out of things
        self._relaxed_minima = Minima()  # where the others ended
        self._nearest: list[LocalSolution] = []  # where probes without contacts ended
        self._through: list[Array] = []  # where one of them from another start reached the goals
        self._out_of_reach: bool | None = None
        self._best: LocalSolution | None = None

    @property
    def best(self) -> LocalSolution:
        """The best posture so far."""
        assert self._best is not None
        return self._best

    def run(self, begin: Array | None = None, other: Array | None = None) -> LocalSolution:
        """Try one way after the other until the goals are met, the first from `begin` (nq,); the best one found.

        Another start (nq,) that is given is descended from too.
        """
        self._try_ways(begin)
        if other is not None:
            self._accept(self._descend(other, full_step=True, early_exit=True), "directly")
        self._come_nearest()
        self._restart_for_measure()
        if self.best.violation.worst <= self.settings.tolerance:
            self.contradictions = ()  # by less than what is asked
        if self._out_of_reach:  # which is known, although a nearer posture may be near
            self._best = with_values(self.best, converged=True)
        return with_values(self.best, converged=False) if self.control.reason else self.best

    def _try_ways(self, begin: Array | None) -> None:
        start = self.problem.scene.figure.clamp(self.problem.start)
        first = self._descend(start if begin is None else begin, full_step=not self.settings.measures, early_exit=True)
        if self._accept(first, "directly") or self.control.over:
            return
        self.contradictions = contradictions(self.problem, self.lineariser.workspace)
        least = least_left(self.contradictions)
        if least is None:
            return
        contacts = self._from_before_contact()
        feasible = ((self._feasibility_first(q), "by feasibility first") for q in (start,))
        if any(self._accept(*found) for found in chain(contacts, feasible)):
            return
        hooked = [*self.lineariser.defined(hooked_hands(self.problem, self.lineariser.state, start))]
        ends = ((self._feasibility_first(q), "from hooked hands") for q in hooked)
        near = self.best.violation.left <= RELAXATION_DEPTH  # as far as limbs in the way keep goals off
        again = self._relaxed_probes(iter([start] if near else []))
        if any(self._accept(*found) for found in chain(self._relaxed_probes(iter(hooked)), ends, again)):
            return
        if self._known_out_of_reach(self.best.q):
            return
        self._least = least
        if self._proven():
            return
        self._leave_cancelling()
        rng = np.random.default_rng(self.settings.seed)
        count = min(self.settings.restarts, INSIDE_PROBES) if least else self.settings.restarts
        if few := self._moving() < FEW:
            self._minima, self._relaxed_minima = Minima(FEWEST_DESCENTS), Minima(FEWEST_DESCENTS)
        others = (throughout if few else restarts)(self.problem, self.lineariser.state, start, rng, count)
        for local, how in self._relaxed_probes(chain([] if near else [start], self._through, others)):
            if self._accept(local, how) or self._proven() or self._left <= 0 or self.control.spent > FOR_WAYS:
                return

    def _from_before_contact(self) -> Iterator[tuple[LocalSolution, str]]:
        """What is reached from where surfaces are in front of the faces that they are to meet."""
        for local in before_contact(
            self.problem, self.subproblem, self.lineariser, self.solver, self.settings.seed, self.trace, self.control
        ):
            self.spent += local.iterations
            yield self._descend(local.q, full_step=True), "from before contact"

    def _restart_for_measure(self) -> None:
        """Where all is met, look for a lower minimum of the measures, from other starts that are screened first."""
        count, tolerance = self.settings.restarts_for_measure, self.settings.tolerance
        if not (count and self.settings.measures and self.best.violation.worst <= tolerance):
            return
        start = self.problem.scene.figure.clamp(self.problem.start)
        rng = np.random.default_rng([self.settings.seed, count])
        starts = chain([start], restarts(self.problem, self.lineariser.state, start, rng, SCREENED * count - 1))
        most = self._at_most(PROBE_PROGRAMS)

        def probe(q: Array) -> LocalSolution:
            return self._feasibility(self.lineariser, most, "for measure").once(q)

        for local in least_measures(starts, probe, tolerance, self.control, count):
            self.spent += local.iterations
            self._accept(self._descend(local.q, note="for measure"), "from a start for the measures")

    def _feasibility_first(self, start: Array) -> LocalSolution:
        """A posture that fits, without regard to the measures; where there is one, they improve from there."""
        local = self._feasibility(self.lineariser, self.settings.iterations, "feasibility").run(start)
        self.spent += local.iterations
        if local.violation.worst > self.settings.tolerance or not self.settings.measures:
            return local
        self._accept(local, "by feasibility first")
        return self._descend(local.q)

    def _leave_cancelling(self) -> None:
        """Where contacts hold the best posture inside of something and cancel, come near from where it is left."""
        if held(self.best, self.settings.tolerance):
            return
        apart = posture_apart(self.problem, self.lineariser.workspace, self.best.q)
        for q in self.lineariser.defined([] if apart is None else [apart]):
            self._accept(self._probe(q, 0.0), "from where contacts that cancel are left")

    def _relaxed_probes(self, starts: Iterator[Array]) -> Iterator[tuple[LocalSolution, str]]:
        """Relaxed probes from the start and from seeded postures, and a descent from where one reaches the goals.

        A probe first goes through things, where limbs can change sides, and then is pushed out of them. Where many in
        a row, although nothing was in their way, came no nearer than the best posture, the goals are out of reach.
        """
        for q in self.lineariser.defined(starts):
            complete = self._minima.complete or self._relaxed_minima.complete
            if complete or self._without_gain >= NO_NEARER or self._left <= 0 or self.control.spent > FOR_WAYS:
                return
            relaxed = self._probe(q, RELAXATION_DEPTH)
            nearer = relaxed.violation.left < (1.0 - NEARER) * self.best.violation.left
            self._without_gain = 0 if nearer else self._without_gain + 1
            if relaxed.violation.worst > REACHED * self.settings.tolerance:
                self._relaxed_minima.add(relaxed.violation.total, relaxed.converged)
                continue
            probe = self._probe(relaxed.q, 0.0)
            if not held(probe, self.settings.tolerance) and not held(self.best, self.settings.tolerance):
                probe = self._probe(q, 0.0)  # nothing leads out from there; to be outside comes before the goals
            reached = probe.violation.worst <= self.settings.tolerance
            if not reached:
                self._minima.add(probe.violation.total, probe.converged)
            yield self._try(probe.q, "restart") if reached else probe, "from another start"

    def _probe(self, start: Array, depth: float) -> LocalSolution:
        """Look whether the goals can be met from a start, by few programs and without regard to the measures.

        Args:
            start: (nq,).
            depth: by which pieces may be inside of each other, metres.
        """
        most = max(min(self._left, PROBE_PROGRAMS), 1)
        lineariser = self.lineariser if depth == 0.0 else self.lineariser.relaxed(depth)
        local = self._feasibility(lineariser, most, "probe").once(start)
        self.spent += local.iterations
        self._left -= local.iterations
        return local

    def _feasibility(self, lineariser: Lineariser, most: int, note: str) -> Feasibility:
        return Feasibility(
            self.problem, self.subproblem, lineariser, self.solver, self.settings.tolerance, most, self.trace, note,
            self.control,
        )  # fmt: skip

    def _come_nearest(self) -> None:
        """Where the goals are not reached, come as near as goes, then improve the measures from there."""
        tolerance = self.settings.tolerance
        if self.control.over:
            return
        if self._out_of_reach:
            self._come_near()
        if not held(self.best, tolerance):
            self._accept(self._stay(self.best), self.how)
        if not self._out_of_reach and self.best.violation.worst > tolerance:
            self._near_best()
        if self.best.violation.left <= tolerance:
            return
        best = self.best
        if best.violation.left > tolerance and self.problem.measures and self.settings.measures:
            local = self._stay(best)
            if held(local, tolerance) and local.violation.left <= best.violation.left + tolerance:
                self._best = local

    def _proven(self) -> bool:
        """Whether the best posture is known to be as near to the goals as any."""
        near = self.best.violation.left <= NEAREST * self._least
        return near and bool(self._least) and held(self.best, self.settings.tolerance)

    def _known_out_of_reach(self, q: Array) -> bool:
        """Whether the goals are out of reach: from a posture (nq,) and other starts, even through everything.

        Where several descents without contacts, from postures all over the limits, come to rest at the same distance
        and none comes nearer, it is the nearest that limits and constraints allow. Local minima differ.
        """
        if self._out_of_reach is not None or not (self.problem.goals and self.problem.scene.model.nv):
            return bool(self._out_of_reach)
        tolerance, state, reach = self.settings.tolerance, self.lineariser.state, self._curved()
        start = self.problem.scene.figure.clamp(self.problem.start)
        rng = np.random.default_rng(self.settings.seed)
        self._out_of_reach = False
        if self._moving() < FEW:
            agreeing, others = AGREEING_FEW, throughout(self.problem, state, start, rng, REACH_TRIALS_FEW - 1)
        else:
            agreeing, others = AGREEING, restarts(self.problem, state, start, rng, REACH_TRIALS - 1, FAR)
        for begin in chain([q], self.lineariser.defined(others)):
            local = reach.through_everything(begin, REACHED * tolerance, self._at_most(REACH_TRIAL_PROGRAMS))
            self.spent += local.iterations
            if local.violation.worst <= REACHED * tolerance and begin is not q:
                self._through = [local.q]
            if local.violation.worst <= REACHED * tolerance or self.control.over:
                return False
            if local.violation.hold > HELD * local.violation.left:
                continue  # from there the constraints alone are too far
            self._nearest.append(local)
            self._nearest.sort(key=lambda local: local.violation.total)
            most = AGREE * self._nearest[0].violation.total + tolerance
            if sum(local.violation.total <= most for local in self._nearest) == agreeing:
                self._out_of_reach = True
                return True
        near = (1.0 - NEARER) * self.best.violation.left
        self._without_gain = sum(local.violation.left >= near for local in self._nearest)  # as relaxed probes count
        return False

    def _moving(self) -> int:
        """How many degrees of freedom move a goal at the best posture."""
        rows = self.subproblem.rows(self.lineariser.at(self.best.q, 0.0))
        return int(rows.soft[: rows.goals].any(axis=0).sum())

    def _near_best(self) -> None:
        """Come as near as goes from the best posture; where that comes to rest nothing nearer is near."""
        nearest = self._curved().among_things(self.best.q, self.settings.tolerance, self._at_most(COMING_NEAR))
        self.spent += nearest.iterations
        if not nearest.converged:
            self._accept(nearest, self.how)
            nearest = self._descend(self.best.q, note="nearest", measures=False)
        self._accept(nearest, self.how)
        self._best = with_values(self.best, converged=self.best.converged or nearest.converged)

    def _come_near(self) -> None:
        """Where the goals are out of reach, come as near as goes without passing through anything.

        Ends of descents without contacts are left out where the best posture is nearer than they are already: among
        things it goes no nearer from there.
        """
        self._approach(self.best.q)
        for local in self._nearest[:PUSHED_OUT]:
            nearer = (1.0 - STATIONARY) * local.violation.goal < self.best.violation.goal
            if not self.control.over and (nearer or not held(self.best, self.settings.tolerance)):
                self._approach(self._pushed_out(local.q))

    def _approach(self, begin: Array) -> None:
        """Come as near as goes from a posture (nq,); where what must hold does not hold then, restore it."""
        tolerance = self.settings.tolerance
        local = self._curved().among_things(begin, tolerance, self._at_most(COMING_NEAR))
        self.spent += local.iterations
        if not held(local, tolerance) and local.violation.total < self.best.violation.total:
            local = self._descend(local.q, note="nearest", measures=False, most=COMING_NEAR)
        self._accept(local, self.how)

    def _pushed_out(self, q: Array) -> Array:
        """Where leaving what a posture (nq,) is inside of ends, with the goals' errors to stay as they are."""
        local = self._descent(self._at_most(PUSHING_OUT), self._goal_errors(q), "nearest", measures=False).run(q)
        self.spent += local.iterations
        return local.q

    def _at_most(self, programs: int) -> int:
        """So many programs, or what one descent may have where that is less."""
        return min(programs, self.settings.iterations)

    def _curved(self) -> CurvedReach:
        return CurvedReach(self.problem, self.lineariser, self.solver, self.control)

    def _stay(self, local: LocalSolution) -> LocalSolution:
        """Descend with the goals' errors to stay as they are: what must hold is restored, then the measures improve."""
        nearest = self._goal_errors(local.q)
        most = self._at_most(STAYING) if held(local, self.settings.tolerance) else self.settings.iterations
        stayed = self._descent(most, nearest, "nearest").run(local.q)
        self.spent += stayed.iterations
        left = float(np.linalg.norm(self._goal_errors(stayed.q)))
        violation = with_values(stayed.violation, goal=left, left=left)
        return with_values(stayed, violation=violation, converged=local.converged)

    def _goal_errors(self, q: Array) -> Array:
        state = self.lineariser.state.update(q)
        return np.concatenate([np.zeros(0), *(np.atleast_1d(goal.error(state)) for goal in self.problem.goals)])

    def _try(self, start: Array, note: str, offset: Array | None = None) -> LocalSolution:
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
        full_step: bool = False,
        early_exit: bool = False,
    ) -> LocalSolution:
        """Descend from a start; where that ends with something that must hold not holding, restore it."""
        iterations = self.settings.iterations if most is None else min(most, self.settings.iterations)
        descent = self._descent(iterations, offset, note, measures=measures, full_step=full_step, early_exit=early_exit)
        local = descent.run(start)
        self.spent += local.iterations
        if early_exit:
            return local
        if not held(local, self.settings.tolerance) and offset is None and (most is None or local.iterations < most):
            stayed = self._stay(local)
            local = stayed if better(stayed, local, self.settings.tolerance) else local
        return local

    def _descent(
        self,
        iterations: int,
        offset: Array | None,
        note: str,
        *,
        measures: bool = True,
        early_exit: bool = False,
        full_step: bool = False,
    ) -> SQP:
        return SQP(
            self.subproblem, self.lineariser, self.solver, self.settings.tolerance, iterations, offset,
            self.trace, note, measures and self.settings.measures, early_exit, full_step, self.control,
        )  # fmt: skip

    def _accept(self, local: LocalSolution, how: str) -> bool:
        """Keep the better one; whether what is asked holds now."""
        if self._best is None or better(local, self._best, self.settings.tolerance):
            self._best, self.how = local, how
        return self.best.violation.worst <= self.settings.tolerance
