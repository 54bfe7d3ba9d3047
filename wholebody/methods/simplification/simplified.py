"""A simplified problem, and the conversion of its answers to the whole figure."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from wholebody.assessment.posture import assess
from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.methods.simplification.embedding import Embedding
from wholebody.problem import Problem
from wholebody.solution import Solution


@dataclass(frozen=True)
class LeftOut:
    """The parts that a simplified problem omits, with bounds on the effect.

    Attributes:
        locked: joints that stay as at the start although no bound freezes them.
        frozen: joints that a bound keeps in place; leaving them out changes nothing.
        helpers: inequalities for which a locked joint could have helped. An answer in which none of them is at its
            bound loses at most `excess` by the locking.
        excess: the measures of the locked joints alone minus their least value. An answer's measure is at most this
            much higher if no helper and no pair of a locked joint is at its bound.
        pairs: number of pairs left out. None can come nearer than its clearance in any posture within the limits (and
            with the frames held that the problem holds); exact.
        rigid: number of pairs left out because no joint between the two is active.
        things: names of things without a remaining pair; they are not in the smaller scene.
        pieces: name of each piece with fewer corners -> how far it protrudes from the original piece, metres.
        counts: kind of part -> (number in the whole problem, number in the simplified one), for the report.
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
        """How far the coarsest piece protrudes from the original one, metres."""
        return max(self.pieces.values(), default=0.0)

    @property
    def exact(self) -> bool:
        """Whether the answers are unchanged: no active joint locked, no piece simplified."""
        return not self.locked and not self.pieces

    def __str__(self) -> str:
        """One line for each kind of part left out, with its bound."""
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
        problem: the smaller problem. It has the placements that things had when it was made: simplify anew when they
            move.
        whole: the original problem.
        left_out: the parts that were left out, with bounds.
    """

    problem: Problem
    whole: Problem
    left_out: LeftOut
    _embedding: Embedding = field(repr=False)

    def posture(self, q: Array) -> Array:
        """Posture of the whole figure, (nq,), of one of the smaller figure.

        Args:
            q: (small nq,).

        Raises:
            InputError: q has the wrong shape or a value that is not finite.
        """
        return self._embedding.embed(checks.posture(q, self.problem.scene.model.nq))

    def restored(self, solution: Solution) -> Solution:
        """The same answer for the whole problem: its posture, with the whole problem's assessment.

        Args:
            solution: a method's answer to `problem`.

        Raises:
            InputError: it is no solution.
        """
        checks.instance(solution, Solution, "restored: solution", "give what wb.solve(part.problem) returns")
        q = self.posture(solution.q)
        judged = assess(self.whole, q)
        status, message = solution.status, solution.message
        if status == "solved" and not judged.holds(1e-4):  # m, rad
            status, message = "infeasible", "what was left out does matter here; solve the whole problem from this one"
        return replace(solution, q=q, status=status, assessment=judged, message=message)
