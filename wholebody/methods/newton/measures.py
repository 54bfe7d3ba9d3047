"""The measures as rows whose squares are minimised, and the descent of the measures: docs/theory/newton.md."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import UndefinedTermError
from wholebody.figures.self_pairs import random_postures
from wholebody.figures.state import State
from wholebody.methods.acceleration import Anderson
from wholebody.methods.newton.batches import OBJECTIVE, PLACE, TURN, Angle, Batch
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.iteration import Iteration
from wholebody.methods.newton.linear_algebra import SingularSystemError
from wholebody.methods.newton.own_rows import TangentRows, quadratic_model, square_rows
from wholebody.methods.newton.settings import REFINEMENT
from wholebody.methods.newton.system import ActiveSystem
from wholebody.problem import Problem
from wholebody.tasks import Discomfort, Displacement, Effort, Rhythm, RotationEffort
from wholebody.tasks.base import Measure
from wholebody.tasks.checks import defined

MINIMISED = (Effort, RotationEffort, Displacement, Discomfort, Rhythm)
"""Measures that are minimised over the revolute joints, and over a root that they count."""


class RootMotion(Batch):
    """Displacement of a free root from a posture, in its own axes there, less a target; linear in the body.

    Three rows are R_a' (r - r_a), three are 2 vec(conj(e_a) e). At r = r_a and e = e_a their derivative is that of
    Pinocchio's tangent displacement.
    """

    size = 6
    pattern = np.zeros((6, 7), dtype=bool)
    pattern[:3, PLACE] = pattern[3:, TURN] = True

    def __init__(self, body: int, label: str) -> None:
        """Take the number of the root's body; `anchor` says from where it moves."""
        super().__init__(np.array([[body]]), [label])
        self._place, self._target, self._slope = np.zeros(3), np.zeros(6), np.zeros((6, 7))

    def anchor(self, root: Array, target: Array) -> None:
        """Count from the root's placement (7,), position and quaternion x, y, z, w, towards a displacement (6,)."""
        a, b, c, w = root[3:].tolist()
        self._place, self._target = root[:3].copy(), target
        self._slope[:3, PLACE] = pin.Quaternion(root[3:]).toRotationMatrix().T
        self._slope[3:, TURN] = 2.0 * np.array(((w, c, -b, -a), (-c, w, a, -b), (b, -a, w, -c)))

    def residual(self, x: Array) -> Array:  # noqa: D102
        body = x[self.bodies[0, 0]]
        turned = self._slope[3:, TURN] @ body[TURN]
        moved = self._slope[:3, PLACE] @ (body[PLACE] - self._place)
        result: Array = np.concatenate([moved, turned])[None] - self._target
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        result: Array = self._slope[None].copy()
        return result


class Objective:
    """Rows whose squares model measures: one for each revolute joint, and six for each root or body that counts."""

    def __init__(
        self,
        state: State,
        q: Array,
        figures: Iterable[tuple[FigureBodies, int, int]],
        free: Sequence[tuple[int, int, int]],
        measures: Iterable[Measure] = (),
    ) -> None:
        """Take resolved measures; figures and free bodies come with their first places in q (nq,) and the tangent."""
        self._state, self.minimised = state, list(measures)
        self._curved = self.minimised  # those that have no rows of their own
        self.squares: list[TangentRows] = []
        self._angles: list[tuple[FigureBodies, slice, Angle, Indices]] = []
        for bodies, at, v in figures:
            part = slice(at, at + bodies.model.nq)
            rows, tangent = bodies.distance(q[part])
            self._angles.append((bodies, part, rows, v + tangent))
        self._free = [(RootMotion(body, "the measures"), at, v) for body, at, v in free]
        self._tangent = np.concatenate([*(each[3] for each in self._angles), *(np.arange(v, v + 6) for *_, v in free)])
        self.stiffness = np.full(len(self._tangent), REFINEMENT.stiffness * REFINEMENT.least_stiffness)

    def batches(self) -> list[Batch]:
        """All rows, in the order of their factors."""
        found: list[Batch] = [*(rows for _, _, rows, _ in self._angles), *(motion for motion, _, _ in self._free)]
        for batch in (*found, *self.squares):
            batch.role = OBJECTIVE
        return [*found, *self.squares]

    def value(self, q: Array) -> float:
        """The minimised measures, with their weights, at the posture q (nq,)."""
        state = self._state.update(q)
        return float(sum(term.weight * term.value(state) for term in self.minimised))

    def renew(self, q: Array) -> None:
        """Model the measures at the posture q (nq,)."""
        state = self._state.update(q)
        gradient, curvature = quadratic_model(self._curved, state)
        half = np.maximum(0.5 * curvature, REFINEMENT.least_stiffness)
        self._aim(q, -0.5 * gradient / half)
        self.stiffness = REFINEMENT.stiffness * half[self._tangent]

    @property
    def factors(self) -> Array:
        """(rows,) the present factors on the squares of all rows."""
        return np.append(self.stiffness, np.full(sum(rows.size for rows in self.squares), REFINEMENT.stiffness))

    def _aim(self, q: Array, way: Array) -> None:
        """Count from the posture q (nq,), towards displacements (nv,)."""
        for bodies, part, rows, tangent in self._angles:
            rows.bound = bodies.angles_at(q[part]) + way[tangent]
        for motion, at, v in self._free:
            motion.anchor(q[at : at + 7], way[v : v + 6])


class FigureObjective(Objective):
    """The rows of a problem: measures that are minimised, among them sums of squares; `reported` names the others."""

    def __init__(self, problem: Problem, bodies: FigureBodies, state: State) -> None:
        counted = [root for root in bodies.roots if _counts_root(problem, state, root[2])]
        super().__init__(state, problem.start, [(bodies, 0, 0)], counted)
        self._curved, self.reported, self._follows = list[Measure](), list[str](), True
        self.minimised, others = split_measures(problem, state)
        self.reported += [type(term).__name__ for term in others]
        for term in self.minimised:
            rows = square_rows(bodies, term, type(term).__name__)
            self._curved += [term] if rows is None else []
            self.squares += [] if rows is None else [rows]

    def anchor(self, q: Array) -> None:
        """Use displacements from q (nq,), the last state of a drag, with the measures' second derivatives."""
        super().renew(q)
        self._aim(q, np.zeros(len(q)))
        for rows in self.squares:
            rows.count_from(q)
        self._follows = False

    def follow(self) -> None:
        """Model the measures anew at every posture."""
        for rows in self.squares:
            rows.count_from(None)
        self._follows = True

    def renew(self, q: Array) -> None:
        """Model the measures at the posture q (nq,), unless an anchor is set."""
        if self._follows:
            super().renew(q)


def _counts_root(problem: Problem, state: State, first: int) -> bool:
    """Whether the measures that are always minimised count the motion of the free root with these freedoms."""
    curved = [
        term.weight * term.curvature(state.update(problem.start))
        for term in problem.measures
        if type(term) in MINIMISED
    ]
    return bool(curved) and float(np.min(np.sum(curved, axis=0)[first : first + 6])) > 0.0


def split_measures(problem: Problem, state: State) -> tuple[list[Measure], list[Measure]]:
    """The measures that are minimised, and those that are only reported; the state is moved."""
    # in a tenth of the time of the equations, which every solve would build twice
    model, roots = problem.scene.model, problem.scene.figure.roots.values()
    free = [int(model.joints[joint].idx_v) for joint in roots]
    counted = [range(first, first + 6) for first in free if _counts_root(problem, state, first)]
    plain = [kind for kind in list(model.joints)[1:] if kind.nq == kind.nv == 1]  # the first is the world
    turning = [kind.idx_v for kind in plain if kind.shortname().startswith("JointModelR")]
    tangent = np.array([*turning, *chain.from_iterable(counted)], dtype=np.intp)
    found: tuple[list[Measure], list[Measure]] = [], []
    for term in problem.measures:
        found[not (isinstance(term, MINIMISED) or _depends_on(term, tangent, problem.start, state))].append(term)
    return found


def _depends_on(measure: Measure, tangent: Indices, start: Array, state: State) -> bool:
    """Whether a measure depends on these degrees of freedom alone, at the start and some other postures."""
    others = np.ones(state.model.nv, dtype=bool)
    others[tangent] = False
    postures = [start, *random_postures(state.model, 3, seed=1)] if others.any() else []
    states = defined(measure, (state.update(q) for q in postures))
    return not any(np.abs(measure.gradient(at)[others]).max() > 0.0 for at in states)


class Refined(NamedTuple):
    """Where a descent of measures ended.

    Attributes:
        x: (7 n,) the variables.
        iterations: how many Newton iterations it took.
        converged: whether no further round would lower the measures; False where the rounds ended first.
    """

    x: Array
    iterations: int
    converged: bool


def refine(
    active_system: ActiveSystem, x: Array, tolerance: float, rounds: int = REFINEMENT.rounds,
    anchor: Array | None = None,
) -> Refined:  # fmt: skip
    """Lower the measures from x (7 n,), where all equations hold.

    With an anchor (7 n,) the measure is the squared motion from there (eq. 1), whose second derivative a step has.
    """
    run = Iteration(active_system, x, REFINEMENT.finer * tolerance, REFINEMENT.finer * tolerance, "slack")
    run.iterate(REFINEMENT.back, goals=True, measures="keep")
    if not run.met:
        return Refined(x, 0, False)
    run.anchor = anchor
    descent = _Descent(run, tolerance)
    converged = any(not descent.lower() for _ in range(rounds))
    return Refined(descent.best, len(run.residuals) - 1, converged)


class _Descent:
    """A descent of measures along the equations; `best` (7 n,) is the state with the least."""

    def __init__(self, run: Iteration, tolerance: float) -> None:
        self._run, self._tolerance, self.best = run, tolerance, run.x
        self._least = self._measured()
        self._share, self._memory, self._system = 1.0, Anderson(), run.system
        self._motion = REFINEMENT.motion if run.anchor is None else 1.0
        self._step: Array | None = None  # of the model at the best state, once it is known

    def lower(self) -> bool:
        """Make one round; False where no further one would lower the measures."""
        run, fast = self._run, None
        if self._step is None:
            try:
                self._step = run.step(0.0, 1.0, 1.0, True, "lower", self._motion)
            except SingularSystemError:
                return False
            fast = self._memory.propose(self._step)
        way, share = (self._step, self._share) if fast is None else (fast, 1.0)
        length = share * run.length(way)
        trial = run.active_system.retract(run.x + length * way)
        if run.active_system.runs_into():
            run.begin(self.best)
            self._step = None
            self._memory.reset()
            return True
        trial, length, free = run.shorten(trial, way, length)
        free = free and run.advance(trial, length)
        if free:
            run.iterate(REFINEMENT.back, goals=True, measures="keep")
        value, rounding = self._measured(), 1e-13 * abs(self._least)
        change = self._least - value
        met = free and run.met
        if met and change > rounding:
            return self._keep(value, fast is None)
        self._memory.reset()
        run.begin(self.best)
        if run.system is not self._system:
            self._system, self._step = run.system, None
        if fast is not None:
            return True
        if self._share < REFINEMENT.shortest or (met and change > -rounding):
            return False
        self._share *= REFINEMENT.shorter
        return True

    def _keep(self, value: float, plain: bool) -> bool:
        """Take the state of the iteration, with the measures `value`; `plain` steps may become longer."""
        run = self._run
        self._memory.record(run.x - self.best)
        moved = float(np.abs(run.x - self.best).max())
        self.best, self._least, self._step = run.x, value, None
        if run.system is not self._system:  # other contacts: what was remembered is of other equations
            self._system = run.system
            self._memory.reset()
        if plain:
            self._share = min(1.0, REFINEMENT.longer * self._share)
        return moved >= self._tolerance

    def _measured(self) -> float:
        """The measures at the iteration's state; infinite where one of one's own is not finite there."""
        run, active = self._run, self._run.active_system
        if run.anchor is not None:
            return float(0.5 * (run.system.weight * (run.x - run.anchor)) @ (run.x - run.anchor))
        try:
            value: float = active.objective.value(active.posture(run.x))
            return value
        except UndefinedTermError as error:
            active.control.step_back(error)
            return np.inf
