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
from wholebody.methods.qp.rows import Chain, Goals
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


def plain_chain(model: pin.Model, limits: Limits) -> Chain | None:
    """A model as a chain; None where a joint does not turn about an axis or slide along one, or follows another."""
    joints = list(model.joints)[1:]  # the first is the world
    if not joints or not all(map(_is_plain, joints)) or extended_columns(model) is not None:
        return None
    size = model.nv
    subspaces = np.array([np.asarray(joint.createData().S).ravel() for joint in joints], dtype=float)
    lower, upper = np.full(size, -np.inf), np.full(size, np.inf)
    lower[limits.idx_v], upper[limits.idx_v] = limits.lower, limits.upper
    placed = np.zeros((size + 1, 4, 3))
    placed[0, :3] = np.eye(3)
    return Chain(
        parents=np.array(list(model.parents)[1:], dtype=np.intp),
        places=np.array([[*M.rotation.T, M.translation] for M in list(model.jointPlacements)[1:]], dtype=float),
        turns=subspaces[:, 3:].copy(),
        slides=subspaces[:, :3].copy(),
        lower=lower,
        upper=upper,
        joints=placed,
        columns=np.empty((size, 6)),
        free=np.empty(size, dtype=bool),
    )


def reach(chain: Chain, plan: TermPlan, start: Array, tolerance: float, most: int) -> tuple[Array, Array, Array]:
    """Descend from a posture (nq,) within limits.

    Args:
        chain: what moves; its room is used.
        plan: of goals that `takes` accepts.
        start: (nq,).
        tolerance: norm of all errors at which they are met, metres and radians.
        most: steps.

    Returns:
        The answer (nq,); norm of the errors at each posture and longest entry of the step to it, (postures, 2); and
        derivatives (rows, nq) of the errors where the last step began.
    """
    q, trace, rows = start.copy(), np.empty((min(most, STEPS) + 1, 2)), np.empty((plan.goal_rows, len(start)))
    first, count, width, first_integer, _, integers = plan.layout[RESIDUAL].tolist()
    goals = Goals(
        plan.floats[first : first + count * width].reshape(count, width),
        plan.integers[first_integer : first_integer + count * integers].reshape(count, integers),
        plan.support,
    )
    seen: int = compiled_kernel().reach(chain, goals, tolerance, DAMPING**2, rows, q, trace)
    return q, trace[:seen], rows


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
    with built.pool(plain_chain, lambda: plain_chain(built.model, problem.scene.figure.limits)).borrow() as chain:
        if chain is None:
            return None
        lineariser = problem.lineariser(workspace)
        if not takes(lineariser.plan):
            return None
        q, seen, _ = reach(chain, lineariser.plan, problem.scene.figure.clamp(problem.start), tolerance, most)
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
    chain = Chain(
        joint, np.zeros((1, 4, 3)), axis, axis, one, one, np.zeros((2, 4, 3)), np.zeros((1, 6)), np.zeros(1, dtype=bool)
    )
    goals = Goals(np.zeros((0, 36)), np.zeros((0, 7), dtype=np.int64), np.zeros((2, 1), dtype=np.int8))
    unobstructed_kernel.reach(chain, goals, 0.0, 0.0, np.zeros((0, 1)), one.copy(), np.zeros((1, 2)))
    return unobstructed_kernel
