"""One step of tracking: goals that move from call to call are followed by one quadratic program a step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import flag, posture
from wholebody.base.compiled import with_loops
from wholebody.base.errors import TermError
from wholebody.base.pool import OneAtATime
from wholebody.figures.state import root_freedoms
from wholebody.geometry.continuous.passing_through import SHORT, is_free
from wholebody.methods.base import TOLERANCE, FrameStep, Method, SolvingTracker, begun, goal_error, nearest_to
from wholebody.methods.control import BUDGET, budget_for_sweep
from wholebody.methods.qp.settings import ESCAPE, TRACKING
from wholebody.methods.qp.solvers.base import QPSolver, WorkingSet
from wholebody.methods.qp.step_program import QPStep, StepProgram
from wholebody.methods.qp.turning import predicted_distances, unseen_by_rows
from wholebody.problem import Problem
from wholebody.scene.moving_obstacles import MOST_SHARES, FrameMotion
from wholebody.solution import Solution
from wholebody.tasks.bounds import StepLimit, allowed, at_speeds, clipped
from wholebody.terms.linearisation import PackedLinearisation


class QPTracker(SolvingTracker):
    """Follows the goals of one problem, step by step.

    No step moves any piece farther than half the distance within which pairs were looked at, so nothing is jumped over,
    however thin, at any dt. Goals, other terms and clearances of the problem may be replaced between steps, and things
    may be moved. The steps of a new tracker depend on nothing that was solved before.

    A tracker remembers the step before, so it is for one figure and one thread at a time.
    """

    unswept = np.inf  # no step passes through anything, and a frame of several is swept where it is long
    leaves_overlap = True

    def __init__(self, problem: Problem, solver: QPSolver, dt: float, method: Method) -> None:
        """Set up for steps of `dt` seconds, whose programs a solver gets, and whole solves by a method.

        Raises:
            InputError: dt is not a positive finite number.
        """
        super().__init__(method, problem, dt)
        compiled_kernel()
        self._working_set, self._query_distance = WorkingSet(solver), TRACKING.least_within
        self._alone = OneAtATime("tracker")
        self._distance = np.full(len(self.workspace.table.pairs), np.inf)  # room of `_nearer`
        self._left: Array | None = None
        self._checked, self._revision = False, problem.scene.revision
        self._set_up()

    def step(self, q: Array, measures: bool = True) -> QPStep:
        """One step from q, shape (nq,); a posture out of limits is brought back first.

        Things that move (`Scene.move` with `over`) are followed by as many programs as their speed needs; what
        they could not be kept apart from is named in the answer.

        Without `measures` it is the least step that meets the goals, which corrects what a step with them left: it
        ends as near to the goals as its own curvature lets it, and does not go on to improve the measures.

        Raises:
            InputError: q is no posture, objects came to or left the scene, or another thread is within a step of this
                tracker.
            TermError: a term of one's own is not finite at q, or answers no numbers of its shape.
        """
        measures = flag(measures, "measures")
        with self._alone:
            if self.problem.scene.revision != self._revision:
                self.problem.check_fresh()
            if not self._checked or type(q) is not np.ndarray:  # a step takes as long as ten such checks
                q, self._checked = begun(self.problem, q), True
            self.workspace.refresh()
            self._renew()
            motion = self.workspace.next_frame(q)
            try:
                return self._step(q, measures) if motion is None else self._among_moving(q, measures, motion)
            except TermError as error:
                raise self.problem.placed(error) from None

    def frame(self, q: Array, tolerance: float | None = None) -> FrameStep:
        """One frame of a motion: programs until the goals are met as a frame should, or another brings little.

        Args:
            q: (nq,) posture of the frame before.
            tolerance: of the goals, metres and radians, and of holds where it is less than 1e-4, the
                default.

        Raises:
            InputError: as for `step`.
        """
        enough = TRACKING.of_a_frame if tolerance is None else TOLERANCE(tolerance, "tolerance")
        exact = enough < TRACKING.of_a_frame
        # a bound on speeds holds for a whole frame
        most = 1 if any(isinstance(bound, StepLimit) for bound in self.problem.bounds) else TRACKING.programs[exact]
        last, error, largest = self.step(q), np.inf, np.inf
        if last.path:
            return FrameStep(last.q, len(last.path) - 1, last.collisions, last.path)
        for spent in range(1, most):
            before, error = error, goal_error(self.problem, self.workspace, last.q)
            longest, largest = largest, float(np.abs(last.displacement).max(initial=0.0))
            # what is held is missed by the square of a step, and each runs ahead of that as the one before was curved
            curved = exact and max(longest, largest) ** 2 > enough
            met = error <= enough or error > TRACKING.worth * before
            if (met and not curved) or BUDGET.over:
                return FrameStep(last.q, spent)
            here, last = last.q, self.step(last.q, measures=False)
            if not is_free(self.workspace, q, last.q, SHORT, budget_for_sweep()):
                return FrameStep(here, spent + 1)
        return FrameStep(last.q, most)

    def nearest(self, q: Array) -> Solution:
        """The same with measures that count from q, and are minimised: they say what is near."""
        settings: Any = self._method
        minimising: Method = replace(settings, measures=True)
        return minimising.solve(nearest_to(self.problem, q))

    def _among_moving(self, q: Array, measures: bool, motion: FrameMotion) -> QPStep:
        """A step with things that move or are still in the figure: they advance by shares, and the figure yields."""
        # If the frame's budget ends first, things move the rest of their way while the figure stays.
        workspace, model = self.workspace, self.workspace.model
        q = posture(q, model.nq)
        most = at_speeds(self.problem.bounds, workspace.state.update(q), self.dt)
        path, steps, before, depth = [(0.0, q)], list[QPStep](), np.inf, 0.0
        while not steps or not BUDGET.over:
            share, here = path[-1]
            if share < 1.0:
                workspace.place(motion.placements(share))
                following = motion.next_share(share, workspace.near(here, self._query_distance), self._query_distance)
                workspace.place(motion.placements(following))
            else:
                following, depth = share, workspace.deepest(here)
                if depth <= TRACKING.out or depth > TRACKING.worth * before or len(steps) > MOST_SHARES:
                    break
                before = depth
            self._left = None if most is None else most - pin.difference(model, q, here)
            self._program.take((following - share) * self.dt)
            steps.append(self._step(here, measures and following > share))
            path.append((following, clipped(model, q, steps[-1].q, most)))
        self._left = None
        if path[-1][0] < 1.0:
            path.append((1.0, path[-1][1]))
            workspace.place(motion.placements(1.0))
        if depth > TRACKING.out and not motion.still:
            free = free_end(model, q, TRACKING.out, self._projection_rows)
            if free is not None and self._lineariser.undefined(free) is None:
                path = [(0.0, q), (1.0, free)]
        self._program.take(self.dt)
        collisions = motion.collisions(path)
        workspace.keep(motion, collisions)
        return with_values(_together(model, path, steps, self.dt), collisions=collisions)

    def _projection_rows(self, q: Array) -> ProjectionRows:
        """What stands around a posture (nq,), with all things where they are."""
        at = self._unbraked(self._lineariser.packed(q, ESCAPE.within))
        rows, room = self._program.bounded(at)
        gaps = at.gap - np.minimum(at.clearance, ESCAPE.gap)
        return ProjectionRows(
            -float(at.contacts.distance.min(initial=0.0)), np.concatenate([at.jacobian[len(at.value) :], rows]),
            np.concatenate([gaps, room]), at.box,
        )  # fmt: skip

    def _unbraked(self, at: PackedLinearisation) -> PackedLinearisation:
        """The same, with joints that need not brake: to evade a body they move up to their limits."""
        at.box[:] = allowed(self.problem.bounds, self.problem.scene.figure.limits, self.workspace.state, self.dt)
        return at

    def _linearised(self, q: Array) -> PackedLinearisation:
        at = self._lineariser.packed(q, self._query_distance)
        if self._left is not None:
            self._unbraked(at)
            np.clip(at.box, np.minimum(self._left[0], 0.0), np.maximum(self._left[1], 0.0), out=at.box)
        return at

    def _step(self, q: Array, measures: bool) -> QPStep:
        program = self._program
        at = self._linearised(q)
        answer = program.solve(at, measures)
        if self._brakes and self._left is None and answer.missed > TRACKING.braked:
            answer = program.solve(self._unbraked(at), measures)  # constraints come before soft stops
        motion = answer.motion
        if motion > 0.5 * self._query_distance and answer.worst > TRACKING.unseen:
            # something came in fast: to get out of its way, one must look as far as one has to go
            self._query_distance = min(TRACKING.headroom * motion, TRACKING.largest_within)
            at = self._linearised(q)
            answer = program.solve(at, measures)
            motion = answer.motion
        share = min(1.0, 0.5 * self._query_distance / max(motion, 1e-12))
        displacement, following = answer.x.copy() if share == 1.0 else share * answer.x, None
        curved = share * motion * (share * answer.turn + TRACKING.off)  # roughly, and rather too much
        if curved > TRACKING.inside and answer.spare < 0.5 * TRACKING.spare * curved:
            bent = 0.0
            if curved > min(max(answer.asked, TRACKING.inside), TRACKING.unseen):  # see `unseen_by_rows`
                bent = program.turning.linearisation_error(at, program.rows, displacement)
            if bent > 0.0:
                displacement, share, following = self._corrected(at, displacement, share, bent > TRACKING.midway)
        self._query_distance = min(max(TRACKING.least_within, TRACKING.headroom * motion), TRACKING.largest_within)
        if following is None:
            following = pin.integrate(self.workspace.model, q, displacement)
            program.ended(following, displacement, share == 1.0)
        else:
            program.ended(following, displacement, False)
        note = ""
        undefined = self._lineariser.undefined(following)
        if undefined is not None:
            note = f"the step was cut: {self.problem.placed(undefined)}"
            displacement, share, following = self._cut(at.q, displacement, share)
            program.ended(following, displacement, False)
        return QPStep(
            following, displacement, displacement / self.dt, len(at.contacts.distance), len(at.gap), answer.exact,
            answer.iterations, answer.by, self._working_set.solver.counted(), share, note=note,
        )  # fmt: skip

    def _cut(self, q: Array, displacement: Array, share: float) -> tuple[Array, float, Array]:
        """The part of a step from q (nq,) that ends where all terms of one's own are finite; none if there is none."""
        for _ in range(TRACKING.cuts):
            displacement, share = 0.5 * displacement, 0.5 * share
            following = np.asarray(pin.integrate(self.workspace.model, q, displacement))
            if self._lineariser.undefined(following) is None:
                return displacement, share, following
        return 0.0 * displacement, 0.0, q.copy()

    def _corrected(
        self, at: PackedLinearisation, displacement: Array, share: float, midway: bool
    ) -> tuple[Array, float, Array]:
        """Displacement (nv,), its share, and posture (nq,) of a step that turns far, looked at where it ends."""
        contacts, asked = at.contacts, at.clearance[: len(at.contacts.distance)]
        began, unseen = np.minimum(contacts.distance, asked), unseen_by_rows(asked)
        rows, groups = self._program.rows, None
        for _ in range(0 if BUDGET.over else TRACKING.corrections):
            short, q = self._shortfall(
                at, displacement, np.maximum(began, predicted_distances(rows, asked, displacement)), began, midway
            )
            if not (short > unseen).any():
                return displacement, share, q
            groups = np.zeros(rows.contacts) if groups is None else groups
            groups[rows.contacts - len(short) :] += short
            program = self._program.program
            again = self._working_set.solve(with_values(program, least=program.least + groups[rows.contact]), rows.key)
            self.workspace.placements(at.q)  # where motion begins
            motion, _ = self._program.turning.motion(at, again.x)
            share = min(1.0, 0.5 * self._query_distance / max(motion, 1e-12))
            displacement = share * again.x
        for _ in range(TRACKING.cuts):
            short, q = self._shortfall(at, displacement, began, began, midway)
            if not (short > unseen).any():
                return displacement, share, q
            displacement, share = 0.5 * displacement, 0.5 * share
        return 0.0 * displacement, 0.0, at.q.copy()

    def _shortfall(
        self, at: PackedLinearisation, displacement: Array, kept: Array, began: Array, midway: bool
    ) -> tuple[Array, Array]:
        """By how much contacts (k,) are nearer after a displacement (nv,) than they should be, and the posture."""
        # Half way it should keep less of these and what it began with; what is missing there counts twice.
        model, short = self.workspace.model, np.zeros(len(kept))
        if midway:
            half = pin.integrate(model, at.q, 0.5 * displacement)
            short = 2.0 * self._nearer(at, half, np.minimum(kept, began))
        q = pin.integrate(model, at.q, displacement)
        return np.maximum(short, self._nearer(at, q, kept)), q

    def _nearer(self, at: PackedLinearisation, q: Array, kept: Array) -> Array:
        """By how much each contact (k,) is nearer at a posture (nq,) than the distances (k,) it should keep."""
        near = self.workspace.near(q, float(np.maximum.reduce(at.clearance, initial=0.0)) + TRACKING.unseen)
        after = self._distance
        after[near.number] = near.distance
        short: Array = np.maximum(kept - after[at.contacts.number], 0.0)
        after[near.number] = np.inf
        return short

    def _set_up(self) -> None:
        """Take the problem's terms as they are now."""
        self._lineariser = self.problem.lineariser(self.workspace, self.dt)
        self._brakes = any(type(bound) is StepLimit for bound in self.problem.bounds)
        self._lay_out()

    def _lay_out(self) -> None:
        """Make the program of the terms that the lineariser has."""
        self._program = StepProgram(self.problem, self.workspace, self._working_set, self.dt)
        self._goals, self._constraints = self._of_goals(), self._of_constraints()
        self._working_set.reset()

    def _renew(self) -> None:
        """Take what was replaced of the problem since the last step; where targets moved only, keep what is set up."""
        problem, own = self.problem, self._lineariser
        if problem.bounds is not own.bounds or problem.measures is not own.measures:
            problem.check_fresh()
            self._set_up()
            return
        moved, held = problem.goals is not own.goals, problem.constraints is not own.constraints
        if own.take(problem.goals, problem.clearances, problem.constraints):
            problem.check_fresh()
        kept = not held or (self._of_constraints() == self._constraints and self._program.hold(problem.constraints))
        if not kept or (moved and self._of_goals() != self._goals):
            self._lay_out()

    def _of_goals(self) -> list[tuple[type, float, int]]:
        """What programs are set up from: kind, weight and number of rows of each goal."""
        goals, rows = self._lineariser.goals, self._lineariser.plan.rows
        return [(type(goal), goal.weight, count) for goal, count in zip(goals, rows, strict=False)]

    def _of_constraints(self) -> list[tuple[type, bytes, bytes, int]]:
        """And kind, bounds and number of rows of each constraint."""
        terms, rows = self._lineariser.constraints, self._lineariser.plan.rows[len(self._lineariser.goals) :]
        bounds = [(np.asarray(term.lower).tobytes(), np.asarray(term.upper).tobytes()) for term in terms]
        return [(type(term), *each, count) for term, each, count in zip(terms, bounds, rows, strict=True)]


def _together(model: pin.Model, path: Sequence[tuple[float, Array]], steps: Sequence[QPStep], dt: float) -> QPStep:
    """One step of several that follow each other along a path."""
    displacement = np.asarray(pin.difference(model, path[0][1], path[-1][1]))
    return with_values(
        steps[-1], q=path[-1][1], displacement=displacement, velocity=displacement / dt, path=tuple(path),
        exact=all(step.exact for step in steps), note=next((step.note for step in steps if step.note), ""),
        iterations=sum(step.iterations for step in steps), share=min(step.share for step in steps),
        programs=dict(sum((Counter(step.programs) for step in steps), Counter[str]())),
    )  # fmt: skip


class ProjectionRows(NamedTuple):
    """What a posture is projected out of: rows of near contacts and of constraints."""

    depth: float  # greatest of any pair, metres
    rows: Array  # (k, nv) rates of what must not become negative
    room: Array  # (k,) how much that is, metres and radians
    box: Array  # (2, nv) displacements that bounds allow


def free_end(model: pin.Model, q: Array, out: float, rows_at: Callable[[Array], ProjectionRows]) -> Array | None:
    """A posture (nq,) that is free to a depth `out` [m], whatever passes; None if a frame's budget finds none.

    For the end of a frame in which a thing came faster than the figure can move. From the posture before and from
    random ones within the bounds, near pairs are projected out of each other one after the other (Kaczmarz, 1937). A
    program would leave all of them violated where not all can be parted to first order.
    """
    project, box = compiled_kernel().project, rows_at(q).box.copy()
    for start in _starts(model, box):
        gone, least, weak = start, np.inf, 0
        for _ in range(ESCAPE.rounds):
            if BUDGET.over:
                return None
            here = np.asarray(pin.integrate(model, q, gone))
            at = rows_at(here)
            if at.depth <= out:
                return here
            weak += at.depth > ESCAPE.worth * least
            if weak == ESCAPE.weak:
                break
            least = min(least, at.depth)
            gone = gone.copy()
            project(at.rows, at.room, box[0], box[1], gone)
    return None


def _starts(model: pin.Model, box: Array) -> Iterator[Array]:
    """Displacements (nv,) to begin at, all within a box (2, nv)."""
    yield np.zeros(model.nv)
    low, high = np.clip(box, -ESCAPE.farthest, ESCAPE.farthest)
    rng, joints = np.random.default_rng(0), ~root_freedoms(model)
    for _ in range(ESCAPE.random):
        begun = rng.uniform(low, high)
        begun[joints] *= rng.uniform()
        yield begun


@with_loops("wholebody.base.dense_kernel")
def compiled_kernel(dense_kernel: Any) -> None:
    """The projection, compiled or read back."""
    dense_kernel.project(np.zeros((0, 1)), np.zeros(0), np.zeros(1), np.zeros(1), np.zeros(1))
