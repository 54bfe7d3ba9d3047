"""Figures of verdicts in words: cells of tables, and what was left out."""

from __future__ import annotations

from collections import Counter
from math import isfinite

from wholebody.bench.report import formatted, spanned, words
from wholebody.bench.suite.published.judging import ANSWERED, REFUSED, UNANSWERED, SetScore, Verdict
from wholebody.bench.suite.published.rebuilt import Score

TURN = 6.3  # rad, m: a joint that is more than a turn out of its limits was hardly meant
CRITERIA = {
    "goal_error": "goals (m)", "goal_angle": "goals (rad)", "overlap": "overlap", "clearance": "clearance",
    "limits": "joint limits", "holds": "holds and balance",
}  # fmt: skip

COLUMNS = (
    "problems", "seed", "asked", "refused", "unanswered", "solved %", "to 1e-4 %", "worst error", "overlap mm",
    "effort above best %", "median ms", "mean ms",
)  # fmt: skip


def cells(row: SetScore) -> tuple[str, ...]:
    """A row of a table, each figure with its interval of 95 %."""
    return (
        words(row.set),
        row.seed,
        str(row.problems),
        str(row.refused or ""),
        str(row.unanswered or ""),
        spanned(row.share, ".0f", 100.0),
        spanned(row.share_fine, ".0f", 100.0),
        spanned(row.worst, ".0e"),
        formatted(1e3 * row.overlap, ".2g"),
        spanned(row.effort_above, ".2g", 100.0),
        spanned(row.seconds, ".3g", 1e3),
        spanned(row.mean_seconds, ".3g", 1e3),
    )


def left_out(verdict: Verdict) -> list[str]:
    """Sentences on refusals, on problems without an answer, and on why answers are none."""
    said = []
    reasons: dict[str, list[str]] = {}
    for one in verdict.judged:
        if one.outcome == REFUSED:
            reasons.setdefault(one.said, []).append(one.problem)
    for reason, problems in reasons.items():
        said.append(f"Refused {len(problems)}, {problems[0]} first: {reason}")
    silent = [one.problem for one in verdict.judged if one.outcome == UNANSWERED]
    if silent:
        said.append(f"Without an answer, and so not solved: {len(silent)}, {silent[0]} first.")
    failed = Counter(_worst(one.score) for one in verdict.judged if one.outcome == ANSWERED and not one.solved)
    if failed:
        listed = ", ".join(f"{name} {count}" for name, count in failed.most_common())
        said.append(f"Answered and not solved: {failed.total()}; what is worst of each: {listed}.")
    far = [one for one in verdict.judged if one.outcome == ANSWERED and one.score.limits > TURN]
    if far:
        how = f"{len(far)}, {far[0].problem} first, by {far[0].score.limits:.3g}"
        said.append(f"Far out of the joint limits: {how}; a posture is in radians and metres, in the body's order.")
    timed = [row for row in verdict.sets if isfinite(row.seconds.value)]
    if timed:
        said.append("The mean time is the shifted geometric mean; a problem that is not solved counts 10 s.")
    return said


def _worst(score: Score) -> str:
    """What an answer misses most, in words."""
    return CRITERIA[max(CRITERIA, key=lambda name: float(getattr(score, name)))]
