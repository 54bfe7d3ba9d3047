"""How hard a published problem is, measured by what favours no method that is compared.

Two figures: how far the witness is from the start, and whether a plain Gauss-Newton descent solves the problem. The
descent begins at one seed, closes goals and holds within the joint limits with the shortest step in every turn, and
knows nothing of contacts and balance; the judge says whether what it ends in is a solution.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.bench.problem_sets.case import Case
from wholebody.bench.problem_sets.fitting import fitted
from wholebody.bench.published.bodies import BodyFiles
from wholebody.bench.published.rebuilt import SOLVED, Rebuilt
from wholebody.bench.published.seeds import held


def difficulty(case: Case, body: BodyFiles, rebuilt: Rebuilt, far: Array) -> dict[str, Any]:
    """The figures of one case, as they stand in `difficulty.json`.

    A case whose goals move is described by its first frame, and by how far it goes from there.
    """
    figure = case.problem.scene.figure
    end = case.path[-1] if case.frames else case.witness
    away = pin.difference(figure.model, case.problem.start, end)
    away = away[6:] if figure.root == "free" else away
    return {
        "witness_distance": float(np.linalg.norm(away)),
        "witness_largest": float(np.abs(away).max(initial=0.0)),
        "gauss_newton": {
            "near": _solves(case, body, rebuilt, case.problem.start),
            "far": _solves(case, body, rebuilt, far),
        },
    }


def _solves(case: Case, body: BodyFiles, rebuilt: Rebuilt, seed: Array) -> bool:
    problem = case.problem
    figure = problem.scene.figure
    goals = problem.goals
    if case.frames:
        goals = tuple(goal.resolve(problem.scene, problem.start) for goal in case.frames[0])
    found = fitted(figure, figure.clamp(seed), [*goals, *held(problem)], np.arange(figure.model.nv))
    return found is not None and bool(rebuilt.score(np.array(body.posture(found))).worst <= SOLVED)
