"""A solution: the answer of a method, with the assessment of its posture and the trace of its iterations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from wholebody.assessment.posture import Assessment
from wholebody.base.arrays import Array, brief
from wholebody.base.charts import Shown, new_chart

Status = Literal["solved", "unreachable", "infeasible", "stalled"]


@dataclass(frozen=True, repr=False)
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

    __repr__ = brief


@dataclass(frozen=True, repr=False)
class Solution(Shown):
    """The answer of a method.

    Attributes:
        q: (nq,) the posture, within limits, never NaN.
        status: "solved", "unreachable", "infeasible" or "stalled"; see the guide.
        seconds: wall time of the call without compiling, which a `time_limit` does not count either.
        iterations: iterations of the method.
        assessment: the independent judgement of q.
        trace: one entry for each iteration that judged a step, in order. An iteration that ends a descent judges none,
            so there may be fewer entries than iterations.
        method: name of the method and of its solver.
        message: one sentence that explains the status.
        programs: number of quadratic programs that each solver closed, such as {"active set": 7, "semismooth newton":
            1}. There, "active set" is the hot start, "semismooth newton" closed what did not settle, and "not exact"
            are programs that none closed. Empty for methods without programs. Iterations of qp whose entry of the
            trace is called "seed" have none: each is a descent by damped least squares.

    Examples:
        >>> solution.status, solution.q.shape == standing.shape, solution.trace[-1].goal_error < 1e-3
        ('solved', True, True)
    """

    q: Array
    status: Status
    seconds: float
    iterations: int
    assessment: Assessment
    trace: tuple[TraceEntry, ...]
    method: str
    message: str
    programs: Mapping[str, int] = field(default_factory=dict)

    @property
    def solved(self) -> bool:
        """Whether the status is "solved"."""
        return self.status == "solved"

    def plot(self) -> Any:
        """Draw the trace, a matplotlib figure: goal error and violation, and the measures, of each entry."""
        chart, axes = new_chart(1, 2, (8.0, 2.8))
        missed, cost = axes[0]
        numbers = range(1, len(self.trace) + 1)
        # a search jumps from descent to descent; lines would hide where each of them leads
        look = {"marker": "."} if len(self.trace) <= 60 else {"marker": ".", "markersize": 2, "linestyle": "none"}
        for name, word in (("goal_error", "goal error"), ("violation", "violation")):
            values = [max(getattr(entry, name), 1e-9) for entry in self.trace]  # for a zero on a logarithmic axis
            missed.semilogy(numbers, values, label=word, **look)
        cost.plot(numbers, [entry.measure for entry in self.trace], color="C2", label="measures", **look)
        missed.set_ylabel("largest error [m, rad]")
        cost.set_ylabel("measures, weighted sum")
        for axis in axes[0]:
            axis.set_xlabel("iteration")
            axis.xaxis.get_major_locator().set_params(integer=True)
        chart.legend(
            *missed.get_legend_handles_labels(), loc="outside upper left", fontsize="small", ncols=2, markerscale=2
        )
        return chart

    def __repr__(self) -> str:
        return (
            f"Solution: {self.status} by {self.method} in {1e3 * self.seconds:.1f} ms, {self.iterations} iterations\n"
            f"  {self.assessment}\n"
            f"  {self.message}"
        )
