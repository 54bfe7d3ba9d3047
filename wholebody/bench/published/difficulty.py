"""How hard a published problem is, as its files say it; the judge of the files says what a descent has solved."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.arrays import Array
from wholebody.bench.problem_sets.case import Case
from wholebody.bench.problem_sets.difficulty import away, descended
from wholebody.bench.published.bodies import BodyFiles
from wholebody.bench.published.rebuilt import SOLVED, Rebuilt


def difficulty(case: Case, body: BodyFiles, rebuilt: Rebuilt, far: Array) -> dict[str, Any]:
    """The figures of one case, as they stand in `difficulty.json`.

    A case whose goals move is described by its first frame, and by how far it goes from there.
    """
    way = away(case)
    return {
        "witness_distance": float(np.linalg.norm(way)),
        "witness_largest": float(np.abs(way).max(initial=0.0)),
        "gauss_newton": {
            "near": _solves(case, body, rebuilt, case.problem.start),
            "far": _solves(case, body, rebuilt, far),
        },
    }


def _solves(case: Case, body: BodyFiles, rebuilt: Rebuilt, seed: Array) -> bool:
    found = descended(case, seed)
    return found is not None and bool(rebuilt.score(np.array(body.posture(found))).worst <= SOLVED)
