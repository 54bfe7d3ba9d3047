"""Assemblies: bodies and joints that URDF cannot describe, such as closed chains, rings, stars and loose parts."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.assessment.all_pairs import all_pairs
from wholebody.base.arrays import Array
from wholebody.base.checks import choice, flag, instance, known, number, shown, some, whole
from wholebody.base.errors import InputError
from wholebody.base.pool import OneAtATime
from wholebody.geometry.continuous.passing_through import SHORT, is_free
from wholebody.geometry.placement import PlacementLike
from wholebody.methods.base import ITERATIONS, TOLERANCE
from wholebody.methods.control import budget_for_sweep
from wholebody.methods.newton.assembly_joints import AssemblyJoints
from wholebody.methods.newton.assembly_system import (
    AssemblyGoal,
    AssemblySolution,
    AssemblyStep,
    AssemblySystem,
    OfFigure,
    checked,
    explained,
    to_target,
)
from wholebody.methods.newton.assembly_system import Kind as GoalKind
from wholebody.methods.newton.batches import Batch, EquationSet, Unit
from wholebody.methods.newton.feasibility import satisfy
from wholebody.methods.newton.figure_bodies import Chart, DisplacementRows
from wholebody.methods.newton.inequalities import KINDS, Kind
from wholebody.methods.newton.linear_algebra import NAMES
from wholebody.methods.newton.measures import Objective, refine
from wholebody.methods.newton.settings import CONTACTS, FRAMES
from wholebody.methods.newton.system import System
from wholebody.scene.moving_obstacles import FrameMotion
from wholebody.scene.workspace import Workspace
from wholebody.tasks.answers import is_own
from wholebody.tasks.base import Measure
from wholebody.tasks.inputs import point

if TYPE_CHECKING:
    from typing_extensions import Self


Metric = Literal["rim", "variables"]
METRICS: tuple[Metric, ...] = ("rim", "variables")


class Assembly(AssemblyJoints):
    """Rigid bodies, joints between them and with the world, and goals; solved in full coordinates.

    Joints are given at the bodies' present placements: `at` and `axis` in the world. If the two sides do not fit
    yet, `at_first` and `at_second` give the position in either body's frame instead. Bodies need not be connected.

    Bodies with shapes touch, and do not penetrate, each other and the things around; not tested are bodies that a joint
    connects or that fixed joints make one, and pairs that `ignore` names. Whole figures may be bodies too.

    A solve moves the bodies, so an assembly serves one thread at a time. It can be pickled; a copy is independent. All
    methods raise an `UnknownNameError` for a name that nothing has, and an `InputError` for a value of another kind,
    shape or range, a name that is taken, and a body that is joined to itself.

    Examples:
        >>> swing = wb.Assembly().body("seat", (0.0, 0.0, -1.0))
        >>> swing = swing.revolute("world", "seat", at=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0))
        >>> swing.point_goal("seat", (1.0, 0.0, 0.0)).solve().status
        'solved'
    """

    def __init__(self, *, clearance: float = 0.0, metric: Metric = "rim") -> None:
        """Make an assembly with the world alone.

        Args:
            clearance: least distance of shapes, metres.
            metric: of the least motion: "rim" counts a rotation of a body as the motion of its rim, "variables" is eq.
                1 itself, the sum of the squared changes of all seven variables of each body.
        """
        super().__init__(clearance)
        self._metric = choice(metric, METRICS, "Assembly: metric")
        self._goals: list[AssemblyGoal] = []
        self._measures: list[Measure] = []
        self._prepared: AssemblySystem | None = None
        self._alone = OneAtATime("assembly")
        self._analysed = 0

    def __getstate__(self) -> dict[str, Any]:
        """Return the bodies, joints and goals, and the placements; data that a solve prepares are prepared anew."""
        left_out = ("_prepared", "_alone", "_scene", "_analysed")
        return {
            **{name: value for name, value in self.__dict__.items() if name not in left_out},
            "_analysed": self.structures,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._prepared, self._scene, self._alone = None, None, OneAtATime("assembly")

    def __repr__(self) -> str:
        return f"Assembly of {len(self.bodies)} bodies and {len(self._goals)} goals: {some(self.bodies) or 'none'}"

    def __copy__(self) -> Assembly:
        return copy.deepcopy(self)

    @property
    def metric(self) -> str:
        """What the least motion is measured by."""
        return self._metric

    # ---- goals

    def point_goal(self, body: str, target: ArrayLike, *, place: ArrayLike = (0.0, 0.0, 0.0)) -> Self:
        """Move a point of a body, (3,) in its frame, to a position in the world (3,), if possible; metres."""
        return self._goal(body, target, "point", place)

    def frame_goal(self, body: str, target: PlacementLike) -> Self:
        """Move a body to a placement in the world, if possible."""
        return self._goal(body, target, "frame")

    def orientation_goal(self, body: str, target: ArrayLike) -> Self:
        """Turn a body to an orientation, a quaternion (x, y, z, w) or a matrix (3, 3), if possible; it may move."""
        return self._goal(body, target, "orientation")

    def _goal(self, body: str, target: Any, kind: GoalKind, place: ArrayLike = (0.0, 0.0, 0.0)) -> Self:
        what = f"the goal of {shown(body)}"
        index, local = self._moved(body, what)
        offset = local * pin.SE3(np.eye(3), point(place, f"{what}: place"))
        self._goals.append(AssemblyGoal(what, index, offset, to_target(target, kind, what), kind))
        return self

    @property
    def goals(self) -> tuple[AssemblyGoal, ...]:
        """The goals, in the order in which they were given."""
        return tuple(self._goals)

    def retarget(self, goal: int, target: Any) -> Self:
        """Move a goal, by its index, to another position, placement or orientation; nothing is analysed anew."""
        index = self.goal_index(goal)
        self._goals[index] = self._goals[index].moved(target)
        return self

    def goal_index(self, goal: int) -> int:
        """The index of a goal, checked."""
        if not self._goals:
            raise InputError("the assembly has no goals; give it one by point_goal or frame_goal")
        return whole(goal, "the number of the goal", 0, len(self._goals) - 1)

    def goal_error(self, goal: int) -> float:
        """Error of a goal at the present placements: the larger of metres and radians."""
        one = self._goals[self.goal_index(goal)]
        error = one.error(self._placed(one.index))
        return max(float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:])))

    def interpolate_goal(self, goal: int, share: float, target: Any) -> Self:
        """Move a goal to a fraction (0 to 1) of the path from where its body is now to a target."""
        one = self._goals[self.goal_index(goal)].moved(target)
        self._goals[goal] = one.between(self._placed(one.index), number(share, "share", 0.0, 1.0))
        return self

    def drop_goals(self) -> Self:
        """Take all goals out; where others of the same bodies come, what earlier solves analysed serves again."""
        self._goals = []
        return self

    # ---- measures

    def minimise(self, measure: Measure, figure: str | None = None) -> Self:
        """Lower a measure, in solves and frames, as far as joints, goals and contacts let it.

        One of a class of your own is asked at states of the assembly's `scene`, where joint
        ``scene.model.getJointId("rod")`` carries the body "rod". Its gradient is compared with a finite difference.

        Args:
            measure: of a class of your own, or such as `wb.tasks.Discomfort()` of a figure.
            figure: whose joints a measure of this package is of; it may be left out where there is one figure.
        """
        own = is_own(instance(measure, Measure, "minimise: measure", "give an object of a subclass of wb.Measure"))
        if figure is None and len(self._figures) == 1 and not own:
            (figure,) = self._figures
        if figure is not None:
            measure = OfFigure(measure, self._figures[known(figure, self._figures, "figure", "minimise")])
        elif not own:
            known_ones = some(self._figures) or "there is none"
            raise InputError(
                f"minimise: {type(measure).__name__} is of a figure's joints; name the figure: {known_ones}"
            )
        self._measures.append(checked(measure, self.scene, self.q))
        return self._changed()

    def drop_measures(self) -> Self:
        """Minimise none of the measures any more."""
        self._measures = []
        return self._changed()

    # ---- solving

    @property
    def structures(self) -> int:
        """Number of patterns that were laid out and analysed."""
        return self._analysed + (0 if self._prepared is None else self._prepared.structures)

    def system(self) -> System:
        """The equations as they stand, without contacts."""
        return System([*self._held(), *self._goal_batches()], self._weight())

    def solve(
        self,
        *,
        tolerance: float = 1e-5,
        iterations: int = 200,
        algebra: str = "auto",
        inequalities: Kind = "slack",
        nearest: bool = False,
    ) -> AssemblySolution:
        """Move the bodies until joints and goals hold; each step is the least motion. They keep their new placements.

        Where they hold, the measures that `minimise` names are lowered.

        No step jumps over a shape, and none of the intermediate states is deeper in a shape than a centimetre; a shape
        that a body is inside of at the start is left. The solution's `penetration` is judged by all pairs.

        Args:
            tolerance: metres and radians, from 1e-12.
            iterations: most Newton iterations, and most rounds that lower measures or look for the nearest placements.
            algebra: "auto", "normal", "kkt" or "schur".
            inequalities: "slack" or "barrier".
            nearest: find the placements nearest to those before (eq. 1), which many least steps miss by a
                little; without figures and measures only.
        """
        tolerance = _tolerance(tolerance)
        iterations = int(ITERATIONS(iterations, "iterations"))
        known(algebra, NAMES, "linear algebra")
        choice(inequalities, KINDS, "inequalities")
        nearest = flag(nearest, "nearest")
        with self._alone:
            active = self._ready(algebra)
            start = active.begin(self.variables(), self._goal_batches())
            if nearest and (self._figures or self._measures):
                raise InputError("nearest is for assemblies without figures and measures; leave it out")
            found = satisfy(
                active, start, tolerance=tolerance, iterations=iterations, kind=inequalities, thorough=True,
            )  # fmt: skip
            x, remark = found.x, ""
            if nearest and found.met:
                x, _, converged = refine(active, x, tolerance, iterations, anchor=start)
                remark = "" if converged else "; the nearest placements were not reached: give more iterations"
            elif found.met and active.objective is not None:
                x, _, converged = refine(active, x, tolerance, iterations)
                remark = "" if converged else "; the measures were not lowered to a minimum: give more iterations"
            self._places = list(x.reshape(-1, 7))
            status, message = explained(active.system, x, found, tolerance)
            joint_error, goal_error = active.system.largest_errors(active.system.residual(x))
            path = active.path if np.array_equal(active.path[-1], x) else (*active.path, x)
            least = self._least_distance()
            return AssemblySolution(
                placements={name: self._placed(index) for index, name in enumerate(self.bodies)},
                status=status,
                goal_error=goal_error,
                joint_error=joint_error,
                residuals=found.residuals,
                systems=found.systems,
                algebra=active.algebra.name,
                penetration=max(0.0, -least),
                least_distance=least,
                path=np.array([self._to_scene(state) for state in path]),
                message=message + remark,
            )

    def prepare(self) -> Self:
        """Lay the equations out now rather than in the first solve; things are seen to move from here."""
        with self._alone:
            self._ready(None)
        return self

    @property
    def workspace(self) -> Workspace | None:
        """Distances and sweeps of the next steps; None where no shapes can touch."""
        active = self._ready(None)
        return None if active.contacts is None else active.workspace

    def step(self, tolerance: float = FRAMES.tolerance) -> AssemblyStep:
        """One frame of a drag: the least motion towards the present goals, in a few iterations.

        The bodies keep their new placements. A frame whose iterations were not enough for joints and contacts, or whose
        motion passes through something, leaves the bodies where they were.
        """
        tolerance = _tolerance(tolerance)
        with self._alone:
            active = self._ready(None)
            start = active.begin(self.variables(), self._goal_batches())
            motion = None if active.contacts is None else active.workspace.next_frame(self.q)
            if motion is None:
                return self._newton_frame(active, start, tolerance)
            return self._among_moving(active, start, tolerance, motion)

    def _newton_frame(self, active: AssemblySystem, start: Array, tolerance: float) -> AssemblyStep:
        """A few Newton steps from the variables `start` (7 n,) of a system that begun there."""
        before, _ = active.system.largest_errors(active.system.residual(start))
        found = satisfy(
            active, start, tolerance=FRAMES.hard_tolerance, goal_tolerance=tolerance, iterations=FRAMES.iterations,
            early_exit=True, thorough=True,
        )  # fmt: skip
        holds = found.hard <= max(10.0 * FRAMES.hard_tolerance, before)
        taken = holds
        x = active.lowered(found.x, FRAMES.hard_tolerance) if found.met else found.x
        if holds and active.contacts is not None:
            ends = self._to_scene(start), self._to_scene(x)
            taken = is_free(active.workspace, *ends, SHORT, budget_for_sweep())
        if taken:
            self._places = list(x.reshape(-1, 7))
        return AssemblyStep(found.goal, found.hard, found.iterations, found.systems, taken)

    def _among_moving(
        self, active: AssemblySystem, x: Array, tolerance: float, motion: FrameMotion
    ) -> AssemblyStep:  # fmt: skip
        """A frame in which things move: in shares, at the ends of which no thing is deep in a body."""
        workspace, path = active.workspace, [(0.0, self._to_scene(x))]
        steps: list[AssemblyStep] = []
        while path[-1][0] < 1.0:
            share, q = path[-1]
            workspace.place(motion.placements(share))
            share = motion.next_share(share, workspace.near(q, CONTACTS.leave), CONTACTS.leave)
            workspace.place(motion.placements(share))
            x = active.begin(self.variables(), self._goal_batches())
            steps.append(self._newton_frame(active, x, tolerance))
            path.append((share, self.q))
        collisions = motion.collisions(path)
        workspace.keep(motion, collisions)
        counts = [(step.iterations, step.systems) for step in steps]
        iterations, systems = (sum(column) for column in zip(*counts, strict=True))
        taken = any(step.taken for step in steps)
        return AssemblyStep(
            steps[-1].goal_error, steps[-1].joint_error, iterations, systems, taken, collisions, tuple(path)
        )  # fmt: skip

    def _ready(self, algebra: str | None) -> AssemblySystem:
        """The equations as they stand; None for the factorisation of the last solve."""
        found = self._prepared
        name = algebra or (found.algebra_name if found is not None else "auto")
        if found is None or (found.algebra_name, found.revision) != (name, self.revision):
            figures = list(self._figures.values())
            self._analysed, objective = self.structures, None
            if self._measures:
                scene = self.scene
                rows = DisplacementRows(scene.model, Chart(scene.model), lambda x: self._to_scene(x[:-1].ravel()))
                objective = Objective(
                    scene.state(self.q), rows, [measure.resolve(scene, self.q) for measure in self._measures]
                )
            found = AssemblySystem(
                self._held(), self._weight(), name, figures, self._to_scene, self.revision, objective
            )
            if self.has_shapes:
                found.among(self.scene, self.clearance)
            self._prepared = found
        return found

    def _weight(self) -> Array:
        """(7 n,) weight of each variable in the least motion."""
        weight = np.concatenate([np.zeros(0), *self._sizes])
        return np.ones_like(weight) if self._metric == "variables" else weight

    def _least_distance(self) -> float:
        """Of the tested pairs, metres; inf without shapes."""
        if not self.has_shapes:
            return np.inf
        with all_pairs(self.scene.built).borrow() as pairs:
            pairs.move(self.q)
            return pairs.least

    def _goal_batches(self) -> list[Batch]:
        equations = EquationSet()
        for goal in self._goals:
            goal.enter(equations)
        return equations.batches()

    def _held(self) -> list[Batch]:
        """What must hold, in batches."""
        if not self._places:
            raise InputError("the assembly has no bodies; add some with body(...)")
        held = [Unit(list(self._names)), *self._equations().batches()]
        return held + [batch for figure in self._figures.values() for batch in figure.batches]


def _tolerance(value: float) -> float:
    """A tolerance, metres and radians; below 1e-12 only rounding remains."""
    return number(value, "tolerance", 1e-12, TOLERANCE.high)
