"""What came of one method on one problem at one budget."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from wholebody.bench.suite.adapters.base import Budget

DEFAULT: Budget = (1e-4, None)
"""The budget at which all cases are solved: a tenth of a millimetre and of a milliradian, iterations as they come."""

COARSE, FINE = 1e-3, 1e-4  # m, rad: to which an answer is called a success
FLOOR = 1e-9  # m, rad: errors below this are not told apart

ANSWERED, REFUSED, FAILED, OVERTIME = "answered", "refused", "failed", "overtime"
"""Outcomes: a posture; the method said that it cannot take the problem; an exception or a posture that is none; the
process was ended because it took too long."""


@dataclass(frozen=True)
class Record:
    """One solve. Errors are infinite where there is no answer.

    Attributes:
        tolerance, budget: of this solve; a budget of 0 iterations is the method's own, one of -1 is `FEASIBILITY_ONLY`.
        status: what the method claims; empty without an answer.
        said: its message, its refusal or the exception.
        seconds, cpu_seconds: of the call without the judgement in it; of a frame, median, where goals move.
        tool_seconds: of `seconds`, within calls of the tool behind an adapter; 0 for methods of our own, and where
            goals move.
        setup_seconds: to build a model of its own from the problem; 0 for one that needs none.
        iterations: as the method counts them; of a frame, mean, where goals move.
        programs: what closed its quadratic programs, and how many; empty for methods without, and where goals move.
        goal_error, goal_angle: left, as judged [m], [rad]; 95 % of the frames where goals move.
        penetration, clearance_violation, limit_violation, constraint_violation: as judged [m, rad]; the worst frame.
        measure, optimality: as judged; of the last frame.
        best: measure of the witness, which is as good as any method need be.
        frames: answered with moving goals; 0 for a case that is solved once.
        frame_p95: seconds of a frame, 95 %.
        jerk: root mean square of the joints' third differences [rad/s^3].
        turns: sign changes of the velocity of the least gap, a second.
    """

    set: str
    number: int
    method: str
    tolerance: float
    budget: int
    outcome: str
    status: str = ""
    said: str = ""
    seconds: float = inf
    cpu_seconds: float = inf
    setup_seconds: float = 0.0
    tool_seconds: float = 0.0
    iterations: float = 0.0
    programs: str = ""
    goal_error: float = inf
    goal_angle: float = inf
    penetration: float = inf
    clearance_violation: float = inf
    limit_violation: float = inf
    constraint_violation: float = inf
    measure: float = inf
    optimality: float = inf
    best: float = inf
    frames: int = 0
    frame_p95: float = 0.0
    jerk: float = 0.0
    turns: float = 0.0

    @property
    def level(self) -> Budget:
        """Tolerance, and iterations or None, as adapters take them."""
        return self.tolerance, self.budget or None

    @property
    def answered(self) -> bool:
        """Whether there is a posture."""
        return self.outcome == ANSWERED

    @property
    def missed(self) -> float:
        """Largest goal error [m or rad]."""
        return max(self.goal_error, self.goal_angle)

    @property
    def broken(self) -> float:
        """Worst of all that must hold [m or rad]: contacts, clearances, limits, constraints."""
        return max(self.penetration, self.clearance_violation, self.limit_violation, self.constraint_violation)

    @property
    def worst(self) -> float:
        """The one figure of accuracy: the worst of goals and of all that must hold [m or rad]; infinite without one."""
        return max(self.missed, self.broken, FLOOR)

    def success(self, tolerance: float) -> bool:
        """Whether goals are met and everything held to a tolerance."""
        return self.answered and self.worst <= tolerance

    @property
    def false_claim(self) -> bool:
        """Whether the method calls solved what is judged to be off by more than it was asked for, and than 1 mm."""
        return self.status == "solved" and self.worst > max(COARSE, 1.05 * self.tolerance)


def frame_cap(cap: float, frames: float) -> float:
    """Seconds that a frame may take on the average, where a solve may take `cap` seconds and there are so many.

    At least 0.1: nobody drags with slower frames.
    """
    return max(cap / frames, 0.1)
