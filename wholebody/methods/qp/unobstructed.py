"""Goals met as if nothing stood in the way, and what stands in the way looked at where that ends.

Of a robot of plain joints on a fixed base most goals are met by a few steps of damped least squares, and where these
end nothing is hit. The whole descent is one compiled loop, without programs, contacts or judgements on the way. The
steps are those of `DampedLeastSquares`: Sugihara's damping, and joints that stop at their limits. Where the end is
inside of something, nearer to it than the clearance, or not at the goals, all begins from the start as if this had not
been tried; so it does where that end would be the answer and the assessment refuses it.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.description import Limits
from wholebody.figures.state import extended_columns
from wholebody.methods.control import Control
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.solution import TraceEntry
from wholebody.terms.entries import BOX, RESIDUAL
from wholebody.terms.plan import TermPlan

STEPS = 60  # most; descents that reach their goals take 5 to 15
DAMPING = 1e-3  # m, rad: of the steps at the goals; less = errors vanish faster, steps near singular postures are wild


class Met(NamedTuple):
    """A posture that meets the goals with everything held.

    Attributes:
        q: (nq,) posture.
        trace: one entry a step.
    """

    q: Array
    trace: tuple[TraceEntry, ...]


class PlainChain:
    """A model of joints of one degree of freedom each, as arrays, with room for one descent.

    Attributes:
        plain: whether it is one: every joint turns about an axis or slides along one, and follows no other.
    """

    def __init__(self, model: pin.Model, limits: Limits) -> None:
        """Read the joints of a model."""
        joints = list(model.joints)[1:]  # the first is the world
        self.plain = bool(joints) and all(map(_is_plain, joints)) and extended_columns(model) is None
        if not self.plain:
            return
        size = model.nv
        subspaces = np.array([np.asarray(joint.createData().S).ravel() for joint in joints], dtype=float)
        self.parents = np.array(list(model.parents)[1:], dtype=np.intp)
        self.places = np.array([[*M.rotation.T, M.translation] for M in list(model.jointPlacements)[1:]], dtype=float)
        self.slides, self.turns = subspaces[:, :3].copy(), subspaces[:, 3:].copy()
        self.lower, self.upper = np.full(size, -np.inf), np.full(size, np.inf)
        self.lower[limits.idx_v], self.upper[limits.idx_v] = limits.lower, limits.upper
        self.joints = np.zeros((size + 1, 4, 3))
        self.joints[0, :3] = np.eye(3)
        self.columns, self.free = np.empty((size, 6)), np.empty(size, dtype=bool)
        self.trace = np.empty((STEPS + 1, 2))

    def reach(self, plan: TermPlan, start: Array, tolerance: float, most: int) -> tuple[Array, Array]:
        """Descend from a posture (nq,) within limits; the answer (nq,), and the trace as `reach` has it.

        Args:
            plan: of goals that `takes` accepts.
            start: (nq,).
            tolerance: norm of all errors at which they are met, metres and radians.
            most: steps.
        """
        q = start.copy()
        seen = self._descend(plan, q, tolerance, min(most, STEPS), np.empty((plan.goal_rows, len(q))))
        return q, self.trace[:seen]

    def _descend(self, plan: TermPlan, q: Array, tolerance: float, most: int, rows: Array) -> int:
        """Move q; `rows` (rows, nv) get the derivatives of the errors of goals where the last step began."""
        first, count, width, first_integer, _, integers = plan.layout[RESIDUAL].tolist()
        seen: int = compiled_kernel().reach(
            self.parents, self.places, self.turns, self.slides, plan.support,
            plan.floats[first : first + count * width].reshape(count, width),
            plan.integers[first_integer : first_integer + count * integers].reshape(count, integers),
            self.lower, self.upper, tolerance, DAMPING**2, most, self.joints, self.columns, rows, self.free, q,
            self.trace,
        )  # fmt: skip
        return seen


def unobstructed(problem: Problem, workspace: Workspace, tolerance: float, most: int, control: Control) -> Met | None:
    """A posture that meets the goals with everything held, found without regard to the measures.

    Args:
        problem: what is asked.
        workspace: of the run.
        tolerance: metres and radians.
        most: steps.
        control: is told of every step.

    Returns:
        None where the figure is no plain chain, terms other than goals of places and rotations are asked for, or the
        goals are not met with everything held.
    """
    built = problem.scene.built
    with built.pool(PlainChain, lambda: PlainChain(built.model, problem.scene.figure.limits)).borrow() as chain:
        if not chain.plain:
            return None
        lineariser = problem.lineariser(workspace)
        if not takes(lineariser.plan):
            return None
        q, seen = chain.reach(lineariser.plan, problem.scene.figure.clamp(problem.start), tolerance, most)
        entries = tuple(TraceEntry(left, 0.0, 0.0, step, "unobstructed") for left, step in seen[1:].tolist())
        left = float(seen[-1, 0])
    if not left <= tolerance:
        return None
    at = lineariser.at(q, 0.0)
    if (at.gap < at.clearance).any():
        return None
    for entry in entries:
        if control.over:
            break
        control.tell(entry)
    return Met(q, entries)


def takes(plan: TermPlan) -> bool:
    """Whether a plan has goals of places and rotations, measures, and nothing else."""
    if plan.others or plan.other_bounds or plan.value_rows or plan.layout[BOX, 1]:
        return False
    tables = [entry.table for entries in plan.goals for entry in entries or ()]
    return bool(tables) and all(table == RESIDUAL for table in tables)


def _is_plain(joint: pin.JointModel) -> bool:
    return bool(joint.nq == joint.nv == 1) and str(joint.shortname()).startswith(("JointModelR", "JointModelP"))


@lru_cache(maxsize=1)
def compiled_kernel() -> Any:
    """The module of compiled loops, compiled or read back: not in the middle of a solve."""
    from wholebody.methods.qp import unobstructed_kernel

    joint, one, axis = np.zeros(1, dtype=np.intp), np.zeros(1), np.zeros((1, 3))
    unobstructed_kernel.reach(
        joint, np.zeros((1, 4, 3)), axis, axis, np.zeros((2, 1), dtype=np.int8), np.zeros((0, 36)),
        np.zeros((0, 7), dtype=np.int64), one, one, 0.0, 0.0, 0, np.zeros((2, 4, 3)), np.zeros((1, 6)),
        np.zeros((0, 1)), np.zeros(1, dtype=bool), one.copy(), np.zeros((1, 2)),
    )  # fmt: skip
    return unobstructed_kernel
