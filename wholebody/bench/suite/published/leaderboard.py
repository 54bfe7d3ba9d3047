"""Many files of answers beside each other: every figure with its interval, and no winner inside the noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path

from numpy import nan_to_num

from wholebody.base.errors import InputError
from wholebody.base.files import is_folder
from wholebody.base.records import with_values
from wholebody.bench import plot_style
from wholebody.bench.plot_style import MOST, Style, method_style
from wholebody.bench.report import page, render, spanned, words
from wholebody.bench.statistics import ratio
from wholebody.bench.suite.published.answers import read_answers
from wholebody.bench.suite.published.judging import (
    ANSWERED,
    Judged,
    SetScore,
    Verdict,
    cells,
    judge,
    left_out,
    set_score,
)
from wholebody.bench.suite.published.rebuilt import EXACT, read_index
from wholebody.bench.tables import write_text

PAGE = "leaderboard.html"


@dataclass(frozen=True)
class Board:
    """One set from one seed: rows of the methods that take part, those that solve most first.

    `leading`: methods whose share is not below the greatest by more than chance, the greatest first.
    """

    set: str
    seed: str
    rows: tuple[tuple[str, SetScore], ...]
    leading: tuple[str, ...]


def judge_folder(folder: Path, problems: Path) -> list[Verdict]:
    """Judge every file of answers in a folder; the best effort known is the least of all exact answers.

    Raises InputError where there is no such folder, it has no answers, or two files have one method; FileFormatError
    for a malformed file.
    """
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
    return _with_common_best(verdicts)


def _with_common_best(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Efforts above the least of all: an answer may be better than what was known when the problems were exported."""
    least: dict[str, float] = {}
    for one in (one for verdict in verdicts for one in verdict.judged):
        if one.score.worst <= EXACT and isfinite(one.effort_above):
            least[one.problem] = min(least.get(one.problem, 0.0), one.effort_above)

    def shifted(one: Judged) -> Judged:
        best = 1.0 + least.get(one.problem, 0.0)
        return replace(one, effort_above=(1.0 + one.effort_above) / best - 1.0) if best > 0.0 else one

    found = []
    for verdict in verdicts:
        judged = tuple(shifted(one) for one in verdict.judged)
        rows = tuple(
            set_score(row.set, row.seed, [one for one in judged if (one.set, one.seed) == (row.set, row.seed)])
            for row in verdict.sets
        )
        found.append(replace(verdict, judged=judged, sets=rows))
    return found


def boards(verdicts: Sequence[Verdict], sets: Sequence[str]) -> list[Board]:
    """One board for every set and seed that somebody answered."""
    made = []
    for name in sets:
        for seed in ("near", "far"):
            rows = [(v.answers.method, row) for v in verdicts for row in v.sets if (row.set, row.seed) == (name, seed)]
            if rows:
                rows.sort(key=lambda entry: (-nan_to_num(entry[1].share.value, nan=-1.0), entry[1].mean_seconds.value))
                made.append(Board(name, seed, tuple(rows), _leading(rows)))
    return made


def _leading(rows: Sequence[tuple[str, SetScore]]) -> tuple[str, ...]:
    """Those whose interval reaches the lower end of the best one's, or higher; nobody where nothing is solved."""
    whole = [(name, row) for name, row in rows if not row.refused and row.share.cases]
    if not any(row.solved for _, row in whole):
        return ()
    low = max(row.share.low for _, row in whole)
    return tuple(name for name, row in whole if row.share.high >= low)


def sentences(board: Board, verdicts: Sequence[Verdict]) -> list[str]:
    """What follows from a board, in plain English."""
    if not board.leading:
        return ["Nobody took every problem and solved one."]
    first, *others = board.leading
    best = dict(board.rows)[first].share
    said = [f"**{first}** solves {spanned(best, '.0f', 100.0, ' %')}."]
    if others:
        said.append(f"{', '.join(others)} cannot be told apart from it by what they solve.")
    below = [name for name, row in board.rows if name not in board.leading and not row.refused]
    if below:
        said.append(f"{', '.join(below)} {'solves' if len(below) == 1 else 'solve'} fewer.")
    return said + _faster(board, verdicts)


def _faster(board: Board, verdicts: Sequence[Verdict]) -> list[str]:
    """The time of the others over that of the first, on the problems that both solve."""
    times = {
        verdict.answers.method: {
            (one.problem, 0): max(one.seconds, 1e-6)
            for one in verdict.judged
            if (one.set, one.seed) == (board.set, board.seed) and one.solved and isfinite(one.seconds)
        }
        for verdict in verdicts
    }
    first, said = board.leading[0], []
    for name in board.leading[1:]:
        found = ratio(times.get(name, {}), times.get(first, {}))
        if found.value == found.value:
            verb = "takes" if found.apart_from(1.0) else "cannot be told apart from it by its time; it takes"
            said.append(
                f"{name} {verb} {found.value:.2g} times [{found.low:.2g}, {found.high:.2g}] as long as {first} on the "
                f"{found.cases} problems that both solve."
            )
    return said


def publish(verdicts: Sequence[Verdict], problems: Path, out: Path) -> list[Board]:
    """Write the page and its charts into a folder; return the boards."""
    index = read_index(problems)
    found = boards(verdicts, list(index["sets"]))
    charts = _charts(verdicts, found, out)
    text = render(
        "leaderboard.md", boards=found, verdicts=verdicts, index=index, cells=cells, left_out=left_out,
        sentences=lambda board: sentences(board, verdicts), charts=list(charts),
        units={verdict.answers.method: _in_kernels(verdict) for verdict in verdicts},
    )  # fmt: skip
    write_text(out / "leaderboard.md", text + "\n")
    write_text(out / PAGE, page("Leaderboard", text, charts) + "\n")
    return found


def _in_kernels(verdict: Verdict) -> float:
    """Median time in units of the reference kernel of the machine; NaN where either is not told."""
    seconds = sorted(one.seconds for one in verdict.judged if one.outcome == ANSWERED and isfinite(one.seconds))
    return seconds[len(seconds) // 2] / verdict.answers.kernel_seconds if seconds else float("nan")


def _charts(verdicts: Sequence[Verdict], found: Sequence[Board], out: Path) -> dict[str, Path]:
    """One row a set and seed: shares and mean times with their intervals; at most six methods a chart."""
    names = [verdict.answers.method for verdict in verdicts]
    seen = styles(names)
    rows = {
        f"{words(board.set)}, {board.seed}": {
            name: (row.share.scaled(100.0), row.mean_seconds.scaled(1e3)) for name, row in board.rows
        }
        for board in found
    }
    drawn = {}
    for first in range(0, len(names), MOST):
        part = {name: seen[name] for name in names[first : first + MOST]}
        path = out / "charts" / f"leaderboard-{first // MOST + 1}"
        drawn[path.name] = plot_style.shares_and_times(rows, part, "one that is not solved counts 10 s", "", path)[0]
    return drawn


def styles(names: Sequence[str]) -> dict[str, Style]:
    """A style for each method, its own where no method before it has the colour."""
    found: dict[str, Style] = {}
    for name in names:
        style = method_style(name)
        taken = {other.color for other in found.values()}
        free = (other for other in plot_style.STYLE["others"]["all"] if other not in taken)
        found[name] = style if style.color not in taken else with_values(style, color=next(free, style.color))
    return found


def summary(found: Sequence[Board]) -> Mapping[str, str]:
    """Who leads each set, for the command line."""
    return {f"{words(board.set)}, {board.seed}": ", ".join(board.leading) or "nobody" for board in found}
