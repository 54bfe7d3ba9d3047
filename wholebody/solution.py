"""A solution: the answer of a method, with the assessment of its posture and the trace of its iterations."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from wholebody.arrays import Array
from wholebody.assessment import Assessment

Status = Literal["solved", "unreachable", "infeasible", "stalled"]


@dataclass(frozen=True)
class TraceEntry:
    """One line of a solution's trace.

    Attributes:
        goal_error: largest remaining goal error, metres or radians.
        violation: largest violation of a limit, constraint or clearance, metres or radians.
        measure: weighted sum of the measures.
        step: largest entry of the displacement of this iteration, radians or metres.
        note: the event of this iteration: "", "restart", "continuation", ...
    """

    goal_error: float
    violation: float
    measure: float
    step: float
    note: str = ""


@dataclass(frozen=True)
class Solution:
    """The answer of a method.

    Attributes:
        q: (nq,) the posture, within limits, never NaN.
        status: "solved", "unreachable", "infeasible" or "stalled"; see the guide.
        seconds: wall time of the call.
        iterations: iterations of the method.
        assessment: the independent judgement of q.
        trace: one entry an iteration.
        method: name of the method and of its solver.
        message: one sentence that explains the status.
    """

    q: Array
    status: Status
    seconds: float
    iterations: int
    assessment: Assessment
    trace: tuple[TraceEntry, ...] = field(repr=False)
    method: str
    message: str

    @property
    def solved(self) -> bool:
        """Whether the status is "solved"."""
        return self.status == "solved"
