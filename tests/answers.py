"""What every method's answer has to be, whatever its status."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

import wholebody as wb


def honest(
    problem: wb.Problem,
    solution: wb.Solution,
    tolerance: float = 1e-5,
    kept: Collection[str] = ("solved", "unreachable"),
) -> wb.Assessment:
    """Check that an answer is what its status says it is; return its assessment.

    Args:
        problem: that was solved.
        solution: the answer.
        tolerance: of the method, metres and radians.
        kept: statuses with which constraints and clearances hold.
    """
    assert np.isfinite(solution.q).all()
    assert problem.scene.figure.within_limits(solution.q)
    judged, slack = wb.assess(problem, solution.q), 1.1 * tolerance + 2e-6
    assert judged.met(slack) or solution.status != "solved"
    assert judged.holds(slack) or solution.status not in kept
    return judged
