"""The score of a file of answers: every answer scored by the files alone, shares with intervals, and both in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any

from wholebody.base.files import finite
from wholebody.bench.statistics import Interval, median, share, shifted_geometric_mean
from wholebody.bench.suite.published.answers import SEEDS, Answer, Answers
from wholebody.bench.suite.published.rebuilt import (
    EXACT,
    SOLVED,
    VERSION,
    Rebuilt,
    Score,
    read_index,
    read_json,
    worst_of,
)
from wholebody.bench.tables import flat, formatted, spanned, words

TIMEOUT = 10.0  # s: that a failure counts with in a mean time
ANSWERED, REFUSED, UNANSWERED = "answered", "refused", "unanswered"
NONE = Score(inf, inf, inf, inf, inf, inf, inf)


@dataclass(frozen=True)
class Judged:
    """One problem from one seed, judged.

    `outcome` is answered, refused (as `said`) or unanswered; the score is infinite without an answer, and of the worst
    of the `frames` where goals move. `best`: least effort that is known; NaN where goals move.
    """

    problem: str
    seed: str
    outcome: str
    said: str
    score: Score
    seconds: float
    best: float
    frames: int = 0

    @property
    def solved(self) -> bool:
        """Whether goals are met and all that must hold is kept, to 1e-3."""
        return self.score.worst <= SOLVED

    @property
    def solved_fine(self) -> bool:
        """The same to 1e-4."""
        return self.score.worst <= 1e-4

    @property
    def effort_above(self) -> float:
        """Effort above the best known, as a share; NaN where it is not solved, or where goals move."""
        return self.score.effort / self.best - 1.0 if self.solved and self.best else nan


@dataclass(frozen=True)
class SetScore:
    """A method in one set from one seed.

    Shares leave out the refused problems, and the unanswered are not solved. `worst`: median of the worst error [m or
    rad]; `overlap`: deepest of all answers [m]; `mean_seconds`: of all problems, failures counting `TIMEOUT`. Times are
    NaN where none are known.
    """

    set: str
    seed: str
    problems: int
    refused: int
    unanswered: int
    solved: int
    share: Interval
    share_fine: Interval
    worst: Interval
    overlap: float
    effort_above: Interval
    seconds: Interval
    mean_seconds: Interval


@dataclass(frozen=True)
class Verdict:
    """All that is said of a file of answers: problems of all sets and seeds with an answer, and a row for each."""

    answers: Answers
    fingerprint: str
    per_set: int
    judged: tuple[Judged, ...]
    sets: tuple[SetScore, ...]


def judge(answers: Answers, folder: Path) -> Verdict:
    """Judge answers to an export; a missing answer to a problem of an attempted set counts as not solved."""
    index = read_index(folder)
    given = {(answer.problem, answer.seed): answer for answer in answers.answers}
    judged, rows = [], []
    for name, family in index["sets"].items():
        best = read_json(folder / "difficulty" / f"{name}.json", "difficulty")["best_known_effort"]
        for seed in SEEDS:
            if not any((problem, seed) in given for problem in family["problems"]):
                continue
            mine = [
                _judged(folder, problem, seed, given.get((problem, seed)), best[problem])
                for problem in family["problems"]
            ]
            judged += mine
            rows.append(set_score(name, seed, mine))
    return Verdict(answers, str(index["fingerprint"]), int(index["per_set"]), tuple(judged), tuple(rows))


def _judged(folder: Path, name: str, seed: str, answer: Answer | None, known: float | None) -> Judged:
    best = nan if known is None else known
    if answer is None or answer.postures is None:
        outcome, said = (UNANSWERED, "") if answer is None else (REFUSED, answer.refused)
        return Judged(name, seed, outcome, said, NONE, nan, best)
    problem = Rebuilt(folder, name)
    score = worst_of([problem.score(q, frame) for frame, q in enumerate(answer.postures)])
    frames = len(answer.postures) if problem.moving else 0
    return Judged(name, seed, ANSWERED, "", score, answer.seconds, best, frames)


def set_score(name: str, seed: str, mine: Sequence[Judged]) -> SetScore:
    """The figures of one set."""
    taken = [one for one in mine if one.outcome != REFUSED]
    answered = [one for one in mine if one.outcome == ANSWERED]
    timed = [one for one in answered if isfinite(one.seconds)]
    spent = [one.seconds if one.solved and isfinite(one.seconds) else TIMEOUT for one in taken] if timed else []
    return SetScore(
        set=name,
        seed=seed,
        problems=len(mine),
        refused=len(mine) - len(taken),
        unanswered=len(taken) - len(answered),
        solved=sum(one.solved for one in taken),
        share=share([one.solved for one in taken]),
        share_fine=share([one.solved_fine for one in taken]),
        worst=median([one.score.worst for one in taken]),
        overlap=max((one.score.overlap for one in answered), default=nan),
        effort_above=median([one.effort_above for one in answered if isfinite(one.effort_above)]),
        seconds=median([one.seconds for one in timed]),
        mean_seconds=shifted_geometric_mean(spent),
    )


def as_json(verdict: Verdict) -> dict[str, Any]:
    """A verdict as plain numbers, texts, lists and dictionaries; figures that are none are null."""
    answers = verdict.answers
    content = {
        "format": "wholebody verdict",
        "version": VERSION,
        "method": answers.method,
        "about": answers.about,
        "machine": answers.machine,
        "kernel_seconds": answers.kernel_seconds,
        "fingerprint": verdict.fingerprint,
        "per_set": verdict.per_set,
        "exact": EXACT,
        "solved_to": SOLVED,
        "timeout": TIMEOUT,
        "sets": [_row(row) for row in verdict.sets],
        "answers": [_answer(one) for one in verdict.judged],
    }
    plain: dict[str, Any] = finite(content)
    return plain


def _row(row: SetScore) -> dict[str, Any]:
    # In the file of a verdict they are low and high alone.
    return {
        name.removeprefix("share_") if name in ("share_low", "share_high") else name: value
        for name, value in flat(row).items()
    }


def _answer(one: Judged) -> dict[str, Any]:
    given = {name: getattr(one, name) for name in ("problem", "seed", "outcome", "said", "solved", "solved_fine")}
    figures = {"effort_above": one.effort_above, "seconds": one.seconds, **asdict(one.score), "worst": one.score.worst}
    return given | figures


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
    # A joint that is more than a turn out of its limits was hardly meant.
    far = [one for one in verdict.judged if one.outcome == ANSWERED and one.score.limits > 6.3]
    if far:
        how = f"{len(far)}, {far[0].problem} first, by {far[0].score.limits:.3g}"
        said.append(f"Far out of the joint limits: {how}; a posture is in radians and metres, in the body's order.")
    timed = [row for row in verdict.sets if isfinite(row.seconds.value)]
    if timed:
        said.append("The mean time is the shifted geometric mean; a problem that is not solved counts 10 s.")
    return said


def _worst(score: Score) -> str:
    """What an answer misses most, in words."""
    criteria = {
        "goal_error": "goals (m)", "goal_angle": "goals (rad)", "overlap": "overlap", "clearance": "clearance",
        "limits": "joint limits", "holds": "holds and balance",
    }  # fmt: skip
    return criteria[max(criteria, key=lambda name: float(getattr(score, name)))]
