"""Descents of one problem, and the best of their ends."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, zip_longest

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, with_values
from wholebody.base.errors import InputError
from wholebody.figures.mirroring import mirrored
from wholebody.methods.control import Control
from wholebody.methods.qp.closest import Closest
from wholebody.methods.qp.feasibility import Feasibility
from wholebody.methods.qp.iterates import LocalSolution, Run, better, broken, held, moving
from wholebody.methods.qp.settings import SEARCH, Settings
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.sqp import SQP
from wholebody.methods.qp.start_postures import at_its_place
from wholebody.methods.qp.subproblem import Subproblem
from wholebody.methods.starts import Multistart, alike, restarts, throughout
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.solution import TraceEntry
from wholebody.tasks.checks import is_a
from wholebody.tasks.defaults import UPRIGHT
from wholebody.tasks.sit import Sit
from wholebody.terms.linearisation import Lineariser


class Search(Multistart[LocalSolution]):
    """What descents of one problem share."""

    def __init__(
        self, problem: Problem, workspace: Workspace, solver: QPSolver, settings: Settings, control: Control
    ) -> None:
        super().__init__(control)
        self.problem, self.solver, self.settings = problem, solver, settings
        self.subproblem = Subproblem(problem, workspace.state)
        self.lineariser = problem.lineariser(workspace)
        self.trace: list[TraceEntry] = []
        self._shared = Run(self.subproblem, self.lineariser, solver, self.trace, control)
        self.spent = 0  # iterations
        self.how = "directly"
        self._first: int | None = None  # programs of the first attempt, once it is made
        self._start = problem.scene.figure.clamp(problem.start)
        self._near: LocalSolution | None = None  # of all ends, also through things, the nearest to the goals
        self._rest: float | None = None  # m: residual at which others came to rest through things
        self._resting: tuple[Array, ...] = ()  # where other descents through things rest as near (nq,)
        self._missed = 0.0  # goals' residual with which a search ends, metres

    @property
    def _left(self) -> int:
        """Programs that attempts after the first may still solve."""
        return self.settings.budget - (0 if self._first is None else len(self.trace) - self._first)

    def _at_most(self, programs: int) -> int:
        """The smaller of this number of programs and that of one descent."""
        return min(programs, self.settings.iterations)

    def count(self, other: Search) -> None:
        """Count what another search did for this one."""
        self.spent += other.spent
        self.trace += other.trace

    def directly(self, start: Array) -> LocalSolution:
        """A descent; without measures by whole steps as long as these gain much."""
        return self._ran(self._descent(self.settings.iterations, None, "", full_step=not self.settings.measures), start)

    def feasibility_first(self, start: Array) -> LocalSolution | None:
        """Find a feasible posture without measures, and descend from there; None where the goals are out of reach."""
        local = self._through_things(start, "feasibility")
        if local is None or local.violation.worst > self.settings.tolerance or not self.settings.measures:
            return local
        self.accept(local, "by feasibility first")
        return self._descend(local.q)

    def _through_things(self, start: Array, note: str) -> LocalSolution | None:
        """Feasibility with pairs relaxed by a depth, then with the true clearances; None where out of reach."""
        most, relaxed = self._at_most(SEARCH.probe_programs), self.lineariser.relaxed(SEARCH.start_depth)
        through = self._ran(self._feasibility(relaxed, most, note), start)
        if through.violation.worst > SEARCH.reached * self.settings.tolerance:
            return None
        return self._ran(self._feasibility(self.lineariser, most, note), through.q)

    def _probe(self, start: Array, depth: float) -> LocalSolution:
        """Test by few programs whether the goals can be met from a start, pieces inside each other by a depth [m]."""
        most = max(min(self._left, SEARCH.probe_programs), 1)
        lineariser = self.lineariser if depth == 0.0 else self.lineariser.relaxed(depth)
        return self._ran(self._feasibility(lineariser, most, "probe"), start)

    def _descend(
        self, start: Array, note: str = "", *, measures: bool = True, most: int | None = None, full_step: bool = False
    ) -> LocalSolution:
        """Descend from a start; restore constraints that are violated at its end."""
        iterations = self.settings.iterations if most is None else min(most, self.settings.iterations)
        local = self._ran(self._descent(iterations, None, note, measures=measures, full_step=full_step), start)
        if (most is None or local.iterations < most) and not held(local, self.settings.tolerance):
            stayed = self._stay(local)
            local = stayed if better(stayed, local, self.settings) else local
        return local

    def _stay(self, local: LocalSolution) -> LocalSolution:
        """Descend with the goals' errors to stay as they are: constraints are restored, then the measures improve."""
        nearest = self.lineariser.at(local.q, 0.0).goal_error
        most = self._at_most(SEARCH.staying) if held(local, self.settings.tolerance) else self.settings.iterations
        stayed = self._ran(self._descent(most, nearest, "nearest"), local.q)
        left = float(np.linalg.norm(self.lineariser.at(stayed.q, 0.0).goal_error))
        violation = with_values(stayed.violation, goal=left, left=left)
        return with_values(stayed, violation=violation, converged=local.converged)

    def _descent(
        self, iterations: int, offset: Array | None, note: str, *, measures: bool = True, full_step: bool = False,
        tolerance: float | None = None,
    ) -> SQP:  # fmt: skip
        tolerance, measures = tolerance or self.settings.tolerance, measures and self.settings.measures
        return SQP(self._shared, tolerance, iterations, note, offset, measures, full_step)

    def _feasibility(self, lineariser: Lineariser, most: int, note: str) -> Feasibility:
        shared = with_values(self._shared, lineariser=lineariser)
        return Feasibility(shared, self.settings.tolerance, most, note, figure=self.problem.scene.figure)

    def _to_the_place(self) -> bool:
        """Descend to the place of contacts that are met, which does not bend, and from there; whether that is lower."""
        there = at_its_place(self.problem, self.lineariser.state.update(self.best.q))
        terms = *self.problem.goals, *self.problem.constraints
        # who sits or squats began there: from the start descents end in poorer postures
        named = self.how == "from a squat" or any(isinstance(each, Sit) for each in terms)
        if there is None or named or self.control.over:
            return False
        tolerance, before = self.settings.tolerance, self.best.measure
        search = Search(there, self.lineariser.workspace, self.solver, self.settings, self.control)
        local = search.directly(self._start)
        if local.violation.worst > tolerance:
            local = search.feasibility_first(self._start) or local
        self.count(search)
        if local.violation.worst <= tolerance and local.measure < SEARCH.lower * before:
            self.accept(self._descend(local.q))
        return self.best.measure < SEARCH.moved * before

    def _to_the_left(self) -> None:
        """Take the mirror image of an answer whose right leg is bent more, where it is as good, from a straight start.

        Of lunges to either side, which are as good, descents end in one or the other: people much alike end alike.
        """
        figure, q, tolerance = self.problem.scene.figure, self.best.q, self.settings.tolerance
        legs = [figure.dofs(side) for side in ("left_leg", "right_leg") if side in figure.groups]
        bent = [np.linalg.norm(pin.difference(figure.model, figure.neutral, q)[leg]) for leg in legs]
        if figure.root != "free" or len(bent) < 2 or bent[1] - bent[0] < 0.1:  # rad: less is no lunge
            return
        if self.best.violation.worst > tolerance or not self.settings.measures or self.control.over:
            return
        try:
            start, there = mirrored(figure, np.array([self._start, q]), pin.XYZQUATToSE3(self._start[:7]))
        except InputError:  # a figure that is not symmetric
            return
        turned = pin.difference(figure.model, self._start, start)  # a quaternion of either sign is the same turn
        if np.abs(turned).max() > 1e-3 or self._left_at(there) > 1e-3:  # m, rad
            return
        local = self._descend(there)
        if local.violation.worst <= tolerance and local.measure <= self.best.measure / SEARCH.lower:
            self._best = local

    def _aside(self, q: Array, share: float) -> Array:
        """Beside a posture (nq,): left legs are bent more than right ones; what has no legs is moved at random.

        Lunges to either side are as good: who is much like another is to end as that one does.
        """
        figure, far = self.problem.scene.figure, share * SEARCH.aside
        move = np.zeros(figure.model.nv)
        for side, sign in (("left_leg", 1.0), ("right_leg", -1.0)):
            move[figure.dofs([body + side for body in figure.bodies if body + side in figure.groups])] = sign * far
        if not move.any():
            move = np.random.default_rng(self.settings.seed).normal(0.0, far, len(move))
        return figure.clamp(np.asarray(pin.integrate(figure.model, q, move)))

    def _closest(self) -> Closest:
        return Closest(self._shared, self.settings.tolerance, self._at_most(SEARCH.coming_near), problem=self.problem)

    def _few(self) -> bool:
        """Whether few degrees of freedom move the goals."""
        return moving(self._shared, self.best.q) < SEARCH.few

    def _seeded(self, count: int, around: Array) -> Iterator[Array]:
        """Random postures (nq,) around one; throughout the limits where few degrees of freedom move the goals."""
        rng = np.random.default_rng(self.settings.seed)
        draw = throughout if self._few() else restarts
        return self.lineariser.defined(draw(self.problem, self.lineariser.state, around, rng, count))

    def _pass_things(self, count: int) -> None:
        """Find the closest posture from where descents through things rest, and `count` others, until three end alike.

        From each of them other ways lead past things.
        """
        if (near := self._near) is None:
            return
        ends = list[LocalSolution]()
        for q in chain.from_iterable(
            zip_longest((near.q, *self._resting), self._seeded(count, self._start) if count else ())
        ):
            missed = self.best.violation
            rest = near.violation.total if self._rest is None else self._rest
            met = missed.worst <= self.settings.tolerance or missed.total <= SEARCH.agree * rest
            if met or alike([end.violation.total for end in ends]):
                return
            if q is not None:
                ends.append(self._ran(self._closest(), self._probe(q, 0.0).q))
                self.accept(ends[-1])

    def _nearer(self, postures: Iterable[Array]) -> tuple[list[Array], float]:
        """Of postures (nq,) one about the nearest to goals and holds, and the share that it misses of the start's."""
        if not (others := [*self.lineariser.defined(postures)]):
            return [], 1.0
        known = [self.problem.scene.figure.clamp(self.problem.start), *others]
        missed = [self._left_at(q) for q in known]
        if (least := min(missed)) == missed[0]:
            return [], 1.0
        # m, rad: of those as near as this the first, which is turned least
        return [next(q for q, far in zip(others, missed[1:], strict=True) if far < least + 0.3)], least / missed[0]

    def _left_at(self, q: Array) -> float:
        """How far goals and holds, but for soles, are from being met at a posture (nq,) [m and rad]."""
        state, squares = self.lineariser.state.update(q), [0.0, 0.0]
        for goal in self.problem.goals:
            squares[0] += float(np.sum(np.square(goal.error(state))))
        for one in self.problem.constraints:
            if not is_a(one, UPRIGHT) and np.any(equal := one.lower == one.upper):
                squares[1] += float(np.sum(np.square(np.where(equal, one.value(state) - one.lower, 0.0))))
        return float(np.sum(np.sqrt(squares)))

    def _ran(self, stage: SQP | Feasibility | Closest, start: Array) -> LocalSolution:
        """The end of a stage from a posture (nq,), whose iterations count."""
        self.spent += (local := stage.run(start)).iterations
        if self._near is None or local.violation.total < self._near.violation.total:
            self._near = local
        return local

    def better(self, one: LocalSolution, other: LocalSolution) -> bool:
        """See `Multistart.better`."""
        return better(one, other, self.settings)

    def enough(self) -> bool:
        """See `Multistart.enough`."""
        return self._left < 0

    def solves(self, end: LocalSolution, share: float = 1.0) -> bool:
        """Whether a search is over at this end, with the constraints and goals missed by `share` tolerances at most."""
        enough = share * self.settings.tolerance
        return broken(end) <= enough and end.violation.left <= self._missed + enough
