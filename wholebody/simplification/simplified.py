"""A problem with no more in it than it needs, and the way back to the whole figure."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from wholebody.assessment import assess
from wholebody.problem import Array, Problem
from wholebody.simplification.lifting import Embedding
from wholebody.solution import Solution

HOLDS = 1e-4  # m, rad: to this limits, constraints and clearances of the whole problem must hold for "solved"


@dataclass(frozen=True)
class LeftOut:
    """What a simplified problem does without, and what that can change at most.

    Attributes:
        locked: joints that stay as at the start although nothing froze them.
        frozen: joints that a bound kept in place already; leaving them out changes nothing.
        helpers: inequalities that a locked joint could have helped to keep. An answer in which none of them is at its
            bound has lost nothing to the locking but `excess`.
        excess: the measures of the locked joints alone are this much above their least value, so an answer's measure
            is at most so much higher where no helper and no pair of a locked joint is at its bound.
        pairs: number of pairs left out. None can come nearer than its clearance in any posture within the limits (and
            with the frames held that the problem holds); exact.
        rigid: number of pairs left out because no joint between the two takes part.
        things: names of things without any pair that is left; they are not in the smaller scene.
        pieces: name of each piece with fewer corners -> how far it reaches out of the piece it holds, metres.
        counts: what -> (in the whole problem, in the simplified one), for the report.
    """

    locked: tuple[str, ...]
    frozen: tuple[str, ...]
    helpers: tuple[str, ...]
    excess: float
    pairs: int
    rigid: int
    things: tuple[str, ...]
    pieces: dict[str, float]
    counts: dict[str, tuple[int, int]]

    @property
    def growth(self) -> float:
        """How far the coarsest piece reaches out of the one it holds, metres."""
        return max(self.pieces.values(), default=0.0)

    @property
    def exact(self) -> bool:
        """Whether nothing is changed at all: no joint locked that could matter, no piece coarser."""
        return not self.locked and not self.pieces

    def __str__(self) -> str:
        """One line for each kind of thing left out, with its bound."""
        lines = [f"{name}: {after} of {before}" for name, (before, after) in self.counts.items()]
        lines.append(
            f"{self.pairs} pairs cannot come nearer than their clearance, {self.rigid} do not move to each other: exact"
        )
        if self.things:
            lines.append(f"{len(self.things)} things cannot be reached: exact")
        if self.frozen:
            lines.append(f"{len(self.frozen)} joints are frozen by the problem: exact")
        if self.locked:
            helped = f"; could have helped {', '.join(self.helpers)}" if self.helpers else ""
            lines.append(
                f"{len(self.locked)} joints stay as they start, and move no goal: measure at most {self.excess:.3g} "
                f"higher by their own share{helped}"
            )
        if self.pieces:
            lines.append(f"{len(self.pieces)} pieces have fewer corners: at most {1e3 * self.growth:.2f} mm larger")
        return "\n".join(lines)


@dataclass(frozen=True)
class Simplified:
    """A smaller problem whose answers are answers of the whole one.

    Attributes:
        problem: what to solve. It is about things as they stood when it was made: simplify anew when they move.
        whole: the problem it was made from.
        left_out: what was left out, with bounds.
    """

    problem: Problem
    whole: Problem
    left_out: LeftOut
    _embedding: Embedding = field(repr=False)

    def posture(self, q: Array) -> Array:
        """Posture of the whole figure, (nq,), of one of the smaller figure.

        Args:
            q: (small nq,).
        """
        return self._embedding.lift(np.asarray(q, dtype=float))

    def restored(self, solution: Solution) -> Solution:
        """The same answer for the whole problem: its posture, judged by the whole problem's assessment.

        Args:
            solution: a method's answer to `problem`.
        """
        q = self.posture(solution.q)
        judged = assess(self.whole, q)
        status, message = solution.status, solution.message
        if status == "solved" and not judged.holds(HOLDS):
            status, message = "infeasible", "what was left out does matter here; solve the whole problem from this one"
        return replace(solution, q=q, status=status, assessment=judged, message=message)
