"""Whether a step is worth going: judged by the violation and by the measures, inside a funnel that narrows."""

from __future__ import annotations

from typing import NamedTuple

from wholebody.methods.qp.settings import DESCENT


class StepAcceptance(NamedTuple):
    """How a step did.

    Attributes:
        accepted: whether it is taken.
        good: whether it brought about what was foreseen.
        poor: whether it brought much less.
        by: "measure" or "goal", by which it was judged; "rejected", or "rejected measure" where the measures led.
    """

    accepted: bool
    good: bool
    poor: bool
    by: str


class PredictedReduction(NamedTuple):
    """What a program foresees of its step: how much less violation, and how much less of the measures."""

    violation: float
    measure: float


class Funnel:
    """The violation that is allowed: a trust funnel (Gould and Toint 2010).

    While what is asked is far, a step must lessen the violation. Near, it must lessen the measures and stay inside the
    funnel, which each step of the first kind narrows.
    """

    def __init__(self, violation: float) -> None:
        """Begin wide enough for the violation at hand."""
        self.width = max(DESCENT.width, violation)

    def judge(
        self, before: tuple[float, float], after: tuple[float, float], predicted: PredictedReduction, measures: bool
    ) -> StepAcceptance:
        """Judge a step.

        Args:
            before: violation and measures before it; near the goals the Lagrangian stands for the measures.
            after: and after it.
            predicted: what was foreseen.
            measures: whether the measures count.
        """
        lead = measures and predicted.measure > DESCENT.switch * before[0] ** 2 and before[0] <= self.width
        saved = before[1] - after[1]
        if lead and after[0] <= self.width and saved >= DESCENT.worth * predicted.measure:
            return StepAcceptance(
                True,
                saved >= DESCENT.good * predicted.measure,
                saved < DESCENT.poor * predicted.measure,
                "measure",
            )
        gained = before[0] - after[0]
        if predicted.violation > 0.0 and gained >= DESCENT.worth * predicted.violation:
            return StepAcceptance(
                True,
                gained >= DESCENT.good * predicted.violation,
                gained < DESCENT.poor * predicted.violation,
                "goal",
            )
        return StepAcceptance(False, False, False, "rejected measure" if lead else "rejected")

    def narrow(self, before: float, after: float) -> None:
        """After a step that lessened the violation from `before` to `after`."""
        narrower = max(0.9 * self.width, after + 0.5 * (before - after))
        self.width = max(min(narrower, DESCENT.width), after)
