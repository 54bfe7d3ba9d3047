"""How hard a problem is, by what favours no method that is compared.

Two things tell: how far the witness is from the start, and whether a plain Gauss-Newton descent from one start solves
the problem. The descent closes goals and holds within the joint limits with the shortest step in every turn, and knows
nothing of contacts and balance.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.bench.suite.problem_sets.case import Case
from wholebody.bench.suite.problem_sets.fitting import fitted, held


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
