"""Seeds of published problems, and how hard a problem is from them, by what favours no method that is compared.

The start is the near seed; a random posture is the far one, without overlap if it is found. Two things tell how hard a
problem is: how far the witness is from the start, and whether a plain Gauss-Newton descent solves the problem. The
descent closes goals and holds within the joint limits with the shortest step in every turn, and knows nothing of
contacts and balance.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array, Indices
from wholebody.bench.suite.problem_sets.case import Case
from wholebody.bench.suite.problem_sets.fitting import Held, fitted, held


def far_seed(case: Case, rng: np.random.Generator) -> Array:
    """A random posture (nq,) from which solving is hard.

    Joints that carry what is held in the world stay as they are at the start; all others are drawn uniformly within
    their limits, and two frames that hold each other are brought together again by Newton's method. The first draw in
    which nothing overlaps is taken, else the one that overlaps least.
    """
    problem = case.problem
    free, closing = _free(problem), [term for term in held(problem) if _is_relative(term)]
    best, least = np.array(problem.start), np.inf
    for _ in range(60):
        q = _drawn(problem, free, rng)
        if closing:
            closed = fitted(problem.scene.figure, q, closing, free)
            if closed is None:
                continue
            q = closed
        depth = wb.assess(problem, q).penetration
        if depth < least:
            best, least = q, depth
        if depth <= 0.0:
            break
    return best


def _is_relative(term: wb.Goal) -> bool:
    return isinstance(term, Held) and term.hold.relative_to is not None


def _free(problem: wb.Problem) -> Indices:
    """Places in the tangent of the joints with limits that carry nothing that is held in the world."""
    model = problem.scene.model
    carrying: set[int] = set()
    for term in problem.constraints:
        if isinstance(term, wb.Hold) and term.relative_to is None:
            carrying |= set(_supports(model, model.frames[problem.scene.figure.frame_id(term.frame)].parentJoint))
    legs = carrying - {0, 1}  # without the root
    beyond = {joint for joint in range(1, model.njoints) if legs & set(_supports(model, joint))}
    limits = problem.scene.figure.limits
    kept = {model.joints[joint].idx_v for joint in carrying | beyond if joint > 0}
    return np.array([place for place in limits.idx_v.tolist() if place not in kept], dtype=np.intp)


def _supports(model: pin.Model, joint: int) -> Sequence[int]:
    return [int(above) for above in model.supports[joint]]


def _drawn(problem: wb.Problem, free: Indices, rng: np.random.Generator) -> Array:
    limits = problem.scene.figure.limits
    chosen = np.isin(limits.idx_v, free)
    q = np.array(problem.start)
    q[limits.idx_q[chosen]] = rng.uniform(limits.lower[chosen], limits.upper[chosen])
    return q


def away(case: Case) -> Array:
    """Way (n,) of all joints but a free root from the start to the end of its path [rad, m], or to the witness."""
    figure = case.problem.scene.figure
    end = case.path[-1] if len(case.path) else case.witness
    found = pin.difference(figure.model, case.problem.start, end)
    return np.asarray(found[6:] if figure.root == "free" else found)


def descended(case: Case, seed: Array) -> Array | None:
    """The posture (nq,) in which the descent from a seed (nq,) ends; None where goals and holds are not closed.

    A case whose goals move is asked for those of its first frame.
    """
    problem = case.problem
    figure = problem.scene.figure
    goals = problem.goals
    if case.frames:
        goals = tuple(goal.resolve(problem.scene, problem.start) for goal in case.frames[0])
    return fitted(figure, figure.clamp(seed), [*goals, *held(problem)], np.arange(figure.model.nv))
