"""Many files of answers beside each other, as a comparison of methods: the same figures, intervals and advice."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from pathlib import Path

from wholebody.base.errors import InputError
from wholebody.base.files import is_folder
from wholebody.bench.suite.compare.report import groups, overview, write_summary
from wholebody.bench.suite.compare.results import ANSWERED, FAILED, REFUSED, Record, Results
from wholebody.bench.suite.compare.summary import advice, reference, standings, summaries
from wholebody.bench.suite.published import judging
from wholebody.bench.suite.published.answers import read_answers
from wholebody.bench.suite.published.judging import Judged, Verdict, cells, judge, left_out
from wholebody.bench.suite.published.rebuilt import read_index
from wholebody.bench.tables import page, render, write_text

PAGE = "leaderboard.html"


def judge_folder(folder: Path, problems: Path) -> list[Verdict]:
    """Judge every file of answers in a folder; InputError for no answers, or two files of one method."""
    if not is_folder(folder):
        raise InputError(f"{folder}: there is no such folder; give one with files of answers")
    paths = [path for path in sorted(folder.glob("*.json")) if not path.name.endswith(".verdict.json")]
    if not paths:
        raise InputError(f"{folder}: has no files of answers; put some there, each NAME.json")
    verdicts = [judge(read_answers(path, problems), problems) for path in paths]
    names: dict[str, Path] = {}
    for path, verdict in zip(paths, verdicts, strict=True):
        name = verdict.answers.method
        if name in names:
            raise InputError(f"{path} and {names[name]} both have the method {name!r}; name one of them otherwise")
        names[name] = path
    return verdicts


def results(verdicts: Sequence[Verdict]) -> Results:
    """The answers as records of a comparison; a set from another seed is another set."""
    records = [_record(verdict.answers.method, one) for verdict in verdicts for one in verdict.judged]
    sets = dict.fromkeys(f"{row.set}, {row.seed}" for verdict in verdicts for row in verdict.sets)
    return Results(records, list(sets), [verdict.answers.method for verdict in verdicts])


def _record(method: str, one: Judged) -> Record:
    outcome = {judging.ANSWERED: ANSWERED, judging.REFUSED: REFUSED}.get(one.outcome, FAILED)
    score, name, number = one.score, *one.problem.split("/")
    return Record(
        f"{name}, {one.seed}", int(number), method, 1e-4, 0, outcome, said=one.said, seconds=one.seconds,
        cpu_seconds=one.seconds, goal_error=score.goal_error, goal_angle=score.goal_angle, penetration=score.overlap,
        clearance_violation=score.clearance, limit_violation=score.limits, constraint_violation=score.holds,
        measure=score.effort, best=one.best, frames=one.frames,
    )  # fmt: skip


def publish(verdicts: Sequence[Verdict], problems: Path, out: Path) -> list[str]:
    """Write the page and its charts into a folder; return what follows, in sentences."""
    found, index = results(verdicts), read_index(problems)
    rows = summaries(found, cap=judging.TIMEOUT)
    charts = {}
    for number, methods in enumerate(groups(found.adapters), start=1):
        name = f"leaderboard-{number}"
        titles = {family: family.replace("_", " ") for family in found.sets}
        charts[name], _ = overview(rows, titles, methods, out / "charts" / name)
    said = advice(found, rows)
    text = render(
        "leaderboard.md", verdicts=verdicts, index=index, sets=found.sets, advice=said,
        ranked=standings(found, rows), reference=reference(found), cells=cells, left_out=left_out,
        charts=list(charts), units={verdict.answers.method: _in_kernels(verdict) for verdict in verdicts},
    )  # fmt: skip
    write_text(out / "leaderboard.md", text + "\n")
    write_summary(rows, {"problems": f"{index['version']}, {index['fingerprint']}"}, out)
    write_text(out / PAGE, page("Leaderboard", text, charts) + "\n")
    return said


def _in_kernels(verdict: Verdict) -> float:
    """Median time in units of the reference kernel of the machine; NaN where either is not known."""
    seconds = sorted(one.seconds for one in verdict.judged if isfinite(one.seconds))
    return seconds[len(seconds) // 2] / verdict.answers.kernel_seconds if seconds else float("nan")
