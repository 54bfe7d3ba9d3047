"""Assemblies: bodies and joints that URDF cannot describe, such as closed chains, rings, stars and loose parts."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array
from wholebody.base.checks import choice, flag, known, number, shown, whole
from wholebody.base.errors import InputError
from wholebody.base.pool import OneAtATime
from wholebody.geometry.continuous.passing_through import SHORT, is_free
from wholebody.geometry.placement import PlacementLike
from wholebody.methods.inputs import ITERATIONS, TOLERANCE
from wholebody.methods.newton.assembly_goals import AssemblyGoal, to_target
from wholebody.methods.newton.assembly_joints import AssemblyJoints
from wholebody.methods.newton.assembly_solution import AssemblySolution, solved
from wholebody.methods.newton.assembly_system import AssemblySystem
from wholebody.methods.newton.batches import Batch, Key
from wholebody.methods.newton.contacts import LEAVE
from wholebody.methods.newton.equations import EquationSet, unit_lengths
from wholebody.methods.newton.feasibility import FRAME_ITERATIONS, satisfy
from wholebody.methods.newton.inequalities import KINDS, Kind
from wholebody.methods.newton.kkt import kkt_algebra
from wholebody.methods.newton.linear_algebra.choice import NAMES
from wholebody.methods.newton.linear_algebra.quasi_definite import QuasiDefinite
from wholebody.methods.newton.system import Patterns, System
from wholebody.scene.moving_obstacles import Collision, FrameMotion
from wholebody.tasks.inputs import point

if TYPE_CHECKING:
    from typing_extensions import Self

FINEST = 1e-12  # m, rad: least tolerance; below it only rounding remains
FRAME_TOLERANCE = 1e-4  # m, rad: of the goals in the frames of a drag
HARD_TOLERANCE = 1e-6  # m, rad: of joints and contacts there


@dataclass
class _Prepared:
    """What solves share while bodies, things and joints stay.

    Attributes:
        algebra: name of the factorisation that was asked for.
        revision: of the assembly.
        active: all equations; what was analysed serves while their pattern stays.
    """

    algebra: str
    revision: int
    active: AssemblySystem
    _nearest: tuple[System, QuasiDefinite] | None = None

    def nearest(self) -> QuasiDefinite:
        """The analysed factorisation for the nearest place."""
        if self._nearest is None or self._nearest[0] is not self.active.system:
            self._nearest = self.active.system, kkt_algebra(self.active.system)
        return self._nearest[1]


class AssemblyStep(NamedTuple):
    """Answer of one frame of a drag.

    Attributes:
        goal_error: largest distance [m] or angle [rad] of a goal from its target, as `Assembly.goal_error` says it.
        joint_error: largest distance [m] or angle [rad] by which a joint, a constraint or a contact is open.
        iterations: Newton iterations.
        systems: linear systems solved.
        taken: whether the bodies moved there.
        collisions: what things that move passed through, or are inside of; empty if nothing.
        path: shares of the frame, from 0 to 1, and the postures (nq,) there, if things moved; otherwise empty.
    """

    goal_error: float
    joint_error: float
    iterations: int
    systems: int
    taken: bool
    collisions: tuple[Collision, ...] = ()
    path: tuple[tuple[float, Array], ...] = ()


class Assembly(AssemblyJoints):
    """Rigid bodies, joints between them and with the world, and goals; solved in full coordinates.

    Joints are given at the bodies' present placements: `at` and `axis` in the world. If the two sides do not fit
    yet, `at_first` and `at_second` give the position in either body's frame instead. Bodies need not be connected.

    Bodies with shapes touch, and do not penetrate, each other and the things around; not tested are bodies that a joint
    connects or that fixed joints make one, and pairs that `ignore` names. Whole figures may be bodies too.

    A solve moves the bodies, so an assembly serves one thread at a time. It can be pickled; a copy is independent.

    Attributes:
        clearance: least distance of every tested pair, metres.
        structures: number of patterns that were laid out and analysed.
    """

    def __init__(self, *, clearance: float = 0.0) -> None:
        """Make an assembly with the world alone.

        Args:
            clearance: least distance of shapes, metres.

        Raises:
            InputError: the clearance is negative or more than half a metre.
        """
        super().__init__(clearance)
        self._goals: list[AssemblyGoal] = []
        self._prepared: _Prepared | None = None
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

    def __copy__(self) -> Assembly:
        return copy.deepcopy(self)

    # ---- goals

    def point_goal(self, body: str, target: ArrayLike, *, place: ArrayLike = (0.0, 0.0, 0.0)) -> Self:
        """Move a point of a body, (3,) in its frame, to a position in the world (3,), if possible; metres.

        Raises:
            UnknownNameError: there is no such body.
            InputError: target or place are no positions.
        """
        what = f"the goal of {shown(body)}"
        index, local = self._moved(body, what)
        offset = local * pin.SE3(np.eye(3), point(place, f"{what}: place"))
        self._goals.append(AssemblyGoal(what, index, offset, to_target(target, False, what), whole=False))
        return self

    def frame_goal(self, body: str, target: PlacementLike) -> Self:
        """Move a body to a placement in the world, if possible.

        Raises:
            UnknownNameError: there is no such body.
            InputError: the target is no placement.
        """
        what = f"the goal of {shown(body)}"
        index, local = self._moved(body, what)
        self._goals.append(AssemblyGoal(what, index, local, to_target(target, True, what), whole=True))
        return self

    @property
    def goals(self) -> tuple[AssemblyGoal, ...]:
        """The goals, in the order in which they were given."""
        return tuple(self._goals)

    def retarget(self, goal: int, target: Any) -> Self:
        """Move a goal to another position, or placement for a goal of `frame_goal`; nothing is analysed anew.

        Args:
            goal: its index, in the order in which goals were given.
            target: as for `point_goal` and `frame_goal`.

        Raises:
            InputError: there is no such goal, or the target is not one.
        """
        index = self.goal_index(goal)
        self._goals[index] = self._goals[index].moved(target)
        return self

    def goal_index(self, goal: int) -> int:
        """The index of a goal.

        Raises:
            InputError: there is none.
        """
        if not self._goals:
            raise InputError("the assembly has no goals; give it one by point_goal or frame_goal")
        return whole(goal, "the number of the goal", 0, len(self._goals) - 1)

    def goal_error(self, goal: int) -> float:
        """Error of a goal at the present placements: the larger of metres and radians.

        Raises:
            InputError: there is no such goal.
        """
        one = self._goals[self.goal_index(goal)]
        error = one.error(self._placed(one.index))
        return max(float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:])))

    def interpolate_goal(self, goal: int, share: float, target: Any) -> Self:
        """Move a goal to a share (0 to 1) of the way from where its body is now to a target.

        Raises:
            InputError: there is no such goal, the target does not fit it, or the share is not within 0 and 1.
        """
        one = self._goals[self.goal_index(goal)].moved(target)
        self._goals[goal] = one.between(self._placed(one.index), number(share, "share", 0.0, 1.0))
        return self

    def drop_goals(self) -> Self:
        """Take all goals out.

        Where others of the same bodies come in their place, what earlier solves laid out and analysed serves again.
        """
        self._goals = []
        return self

    # ---- solving

    @property
    def structures(self) -> int:
        """Number of patterns that were laid out and analysed."""
        return self._analysed + (self._prepared.active.patterns.structures if self._prepared is not None else 0)

    def system(self) -> System:
        """The equations as they stand, without contacts."""
        return System(len(self._places), [*self._held(), *self._goal_batches()], self._weight())

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

        No step jumps over a shape, and none of the states on the way is deeper in a shape than a centimetre; a shape
        that a body is inside of at the start is left. The solution's `penetration` is judged by all pairs.

        Args:
            tolerance: metres and radians, from 1e-12.
            iterations: most Newton iterations.
            algebra: "auto", "normal", "llt", "kkt", "schur", "dense" or "svd".
            inequalities: "slack" or "barrier".
            nearest: find the placements nearest to those before (eq. 1), which many least steps miss by a
                little; without inequalities, shapes and figures only.

        Raises:
            InputError: there are no bodies, a setting is out of range, or another thread solves this assembly.
            UnknownNameError: no such linear algebra.
        """
        tolerance = number(tolerance, "tolerance", FINEST, TOLERANCE.high)
        iterations = int(ITERATIONS(iterations, "iterations"))
        known(algebra, NAMES, "linear algebra")
        choice(inequalities, KINDS, "inequalities")
        nearest = flag(nearest, "nearest")
        with self._alone:
            prepared = self._ready(algebra)
            active = prepared.active
            start = active.begin(self.variables(), self._goal_batches())
            if nearest and (active.contacts is not None or active.system.inequality.any()):
                raise InputError("nearest is for assemblies without limits, one-sided planes and shapes; leave it out")
            x, solution = solved(
                self.bodies, active, start,
                tolerance=tolerance, iterations=iterations, kind=inequalities,
                nearest=prepared.nearest() if nearest else None, scene=self._solid_scene(), to_scene=self._to_scene,
            )  # fmt: skip
            self._places = list(x.reshape(-1, 7))
            return solution

    def prepare(self) -> Self:
        """Lay the equations out now rather than in the first solve; things are seen to move from here."""
        with self._alone:
            self._ready(None)
        return self

    def step(self, tolerance: float = FRAME_TOLERANCE) -> AssemblyStep:
        """One frame of a drag: the least motion towards the present goals, in a few iterations.

        The bodies keep their new placements. A frame whose iterations were not enough for joints and contacts, or whose
        motion passes through something, leaves the bodies where they were.

        Args:
            tolerance: of the goals, metres and radians.

        Raises:
            InputError: there are no bodies, the tolerance is out of range, or another thread solves this assembly.
        """
        tolerance = number(tolerance, "tolerance", FINEST, TOLERANCE.high)
        with self._alone:
            active = self._ready(None).active
            start = active.begin(self.variables(), self._goal_batches())
            motion = None if active.contacts is None else active.workspace.next_frame(self.q)
            if motion is None:
                return self._newton_frame(active, start, tolerance)
            return self._among_moving(active, start, tolerance, motion)

    def _newton_frame(self, active: AssemblySystem, start: Array, tolerance: float) -> AssemblyStep:
        """A few Newton steps from the variables `start` (7 n,) of a system that begun there."""
        before, _ = active.system.largest_errors(active.system.residual(start))
        found = satisfy(
            active, start, tolerance=HARD_TOLERANCE, goal_tolerance=tolerance, iterations=FRAME_ITERATIONS,
            early_exit=True, leave_saddles=True,
        )  # fmt: skip
        holds = found.hard <= max(10.0 * HARD_TOLERANCE, before)
        taken = holds and (active.contacts is None or self._is_free(active, start, found.x))
        if taken:
            self._places = list(found.x.reshape(-1, 7))
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
            share = motion.next_share(share, workspace.near(q, LEAVE), LEAVE)
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

    def _is_free(self, active: AssemblySystem, before: Array, after: Array) -> bool:
        """Whether the motion of a frame passes through nothing."""
        return is_free(active.workspace, self._to_scene(before), self._to_scene(after), SHORT)

    def _ready(self, algebra: str | None) -> _Prepared:
        """The equations as they stand; None for the factorisation of the last solve."""
        found = self._prepared
        name = algebra or (found.algebra if found is not None else "auto")
        if found is None or (found.algebra, found.revision) != (name, self.revision):
            held, count, weight = self._held(), len(self._places), self._weight()
            active = AssemblySystem(
                held, list(self._figures.values()), self._solid_scene(), self._to_scene, self.clearance,
                Patterns(count, weight, name),
            )  # fmt: skip
            self._analysed = self.structures
            found = self._prepared = _Prepared(name, self.revision, active)
        return found

    def _solid_scene(self) -> Any:
        """The scene; None if nothing has a shape."""
        return self.scene if self.has_shapes else None

    def _goal_batches(self) -> list[tuple[Batch, Key]]:
        equations = EquationSet()
        for goal in self._goals:
            goal.enter(equations)
        return equations.batches(len(self._places))

    def _held(self) -> list[tuple[Batch, Key]]:
        """What must hold, in batches."""
        if not self._places:
            raise InputError("the assembly has no bodies; add some with body(...)")
        count = len(self._places)
        held = [unit_lengths(list(self._names)), *self._holding.batches(count)]
        for figure in self._figures.values():
            held += figure.batches(count)
        return held

    def _weight(self) -> Array:
        """(7 n,) of each variable in the least motion."""
        return np.concatenate(self._sizes)
