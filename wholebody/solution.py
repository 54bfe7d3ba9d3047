"""A solution: what a method answers, with the judgement of its posture and the way there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from wholebody.arrays import Array
from wholebody.assessment import Assessment

Status = Literal["solved", "unreachable", "infeasible", "stalled"]


@dataclass(frozen=True)
class TraceEntry:
    """One line of a solution's trace.

    Attributes:
        goal_error: largest goal error left, metres or radians.
        violation: largest violation of anything that must hold, metres or radians.
        measure: weighted sum of the measures.
        step: largest entry of the displacement that led here, radians or metres.
        note: what happened: "", "restart", "continuation", ...
    """

    goal_error: float
    violation: float
    measure: float
    step: float
    note: str = ""


@dataclass(frozen=True)
class Solution:
    """What a method answers.

    Attributes:
        q: (nq,) the posture, within limits, never NaN.
        status: "solved", "unreachable", "infeasible" or "stalled"; see the guide.
        seconds: wall time of the call.
        iterations: iterations of the method.
        assessment: the independent judgement of q.
        trace: one entry an iteration.
        method: name of the method and of what it used.
        message: one sentence for a reader.
        programs: how many quadratic programs each closed, such as {"osqp": 1, "active set": 7}: the QP solver by its
            name, the hot start as "active set", "semismooth newton" where neither did, and "not exact" where none did.
            Empty for methods without programs.
    """

    q: Array
    status: Status
    seconds: float
    iterations: int
    assessment: Assessment
    trace: tuple[TraceEntry, ...] = field(repr=False)
    method: str
    message: str
    programs: Mapping[str, int] = field(default_factory=dict)

    @property
    def solved(self) -> bool:
        """Whether the status is "solved"."""
        return self.status == "solved"
