"""The attack: cases in processes that are started anew when a case brings them down, and the report of counts."""

from __future__ import annotations

import ctypes
import os
import resource
import sys
import time
import traceback
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np

from wholebody.base.errors import UnknownNameError, WholebodyError
from wholebody.base.files import Scratch
from wholebody.base.runner import ONE_THREAD, Child, Job, allow_processor, run_jobs
from wholebody.bench.attack import frames, inputs, solves, terms
from wholebody.bench.attack.judging import KINDS, Case, Verdict
from wholebody.bench.rows import Row, times
from wholebody.bench.rows import report as tables_of
from wholebody.bench.statistics import wilson
from wholebody.bench.tables import render, write_text

CASES = {
    "file": inputs.file,
    "solve": solves.case,
    "stream": frames.stream,
    "sweep": frames.sweep,
    "contact": terms.contact,
    "own-term": terms.own_term,
    "pairs": frames.pairs,
    "sleeper": frames.sleeper,
    "weights": frames.weights,
    "put": frames.put,
}


def attack(
    cases: Iterator[Case], jobs: int, going: Callable[[], bool], deadline: float = 60.0
) -> Iterator[tuple[Case, Verdict]]:
    """Run `jobs` cases at a time, while `going`; a case over the deadline [s of the processor] runs twice."""
    again: deque[Case] = deque()
    repeated: set[Case] = set()

    def next_job() -> Job | None:
        case = again.popleft() if again else next(cases, None) if going() else None
        # Half an hour for a first case: it compiles everything, on a machine that has other things to do.
        return None if case is None else Job(case, _attacked, (case, deadline), 1800.0)

    children = [Child(ONE_THREAD) for _ in range(jobs)]
    for outcome in run_jobs(next_job, children):
        case = outcome.job.name
        error = outcome.error
        if error is None:
            yield case, outcome.answer
        elif error.overtime and case not in repeated:  # a machine that stood still is no fault of the case
            repeated.add(case)
            again.append(case)
        elif error.overtime:
            said = f"hangs: the case had not ended after {deadline:g} s of the processor"
            yield case, Verdict("wrong", said, deadline)
        else:
            yield case, Verdict("wrong", f"the process died: {error.how}")
    for child in children:
        child.close()


def _attacked(case: Case, deadline: float) -> Verdict:
    _prepare()
    allow_processor(deadline)
    with Scratch() as folder:
        return run(case, folder)


def run(case: Case, folder: Path) -> Verdict:
    """Run a case in a folder; "wrong" for an error that is not the package's, or any text on standard output."""
    if case.kind not in CASES:
        raise UnknownNameError("kind of case", case.kind, KINDS)
    with _printed(folder) as lines:
        verdict = _outcome(case, folder)
    if lines and verdict.outcome != "wrong":
        return Verdict("wrong", f"prints {len(lines)} lines, the first {lines[0][:200]!r}", verdict.seconds)
    return verdict


def _outcome(case: Case, folder: Path) -> Verdict:
    began = time.process_time()
    try:
        return CASES[case.kind](case.rng(), folder)
    except WholebodyError as error:
        return Verdict("refused", str(error)[:300], time.process_time() - began)
    except Exception as error:
        return Verdict("wrong", _said(error), time.process_time() - began)


@contextmanager
def _printed(folder: Path) -> Iterator[list[str]]:
    """The lines that this process writes to standard output meanwhile, those of compiled libraries included."""
    lines: list[str] = []
    sys.stdout.flush()
    kept = os.dup(1)
    with (folder / ".printed").open("w+b") as file:
        os.dup2(file.fileno(), 1)
        try:
            yield lines
        finally:
            sys.stdout.flush()
            ctypes.CDLL(None).fflush(None)
            os.dup2(kept, 1)
            os.close(kept)
            file.seek(0)
            lines += file.read().decode("utf-8", "replace").splitlines()


def _said(error: Exception) -> str:
    """The error with the place in the package that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if f"{os.sep}wholebody{os.sep}" in frame.filename] or list(frames)
    words = str(error).strip().splitlines()
    place = f"{Path(ours[-1].filename).name}, {ours[-1].name}"
    return f"{type(error).__name__} in {place}: {words[0][:200] if words else ''}"


@cache
def _prepare() -> None:
    """Bound the memory of this process; compile and import what cases need, so that none is timed with it."""
    most = 4 << 30  # bytes: a file that asks for more is no reason to bring the machine down
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    import wholebody as wb
    from wholebody.methods import installed_methods

    scene = wb.Scene(wb.load("avatar")).add(wb.HalfSpace(), name="floor")
    problem = wb.Problem(scene, goals=[wb.Point(scene.figure.frames[0], (0.3, 0.0, 1.0))])
    for method in installed_methods():
        wb.solve(problem, method=method)
    scene.sweep(problem.start, scene.figure.neutral)


def for_seconds(seconds: float) -> Callable[[], bool]:
    """Return a function that says whether the time, which begins when it is asked first, has not run out."""
    ends: list[float] = []

    def going() -> bool:
        if not ends:
            ends.append(time.monotonic() + seconds)
        return time.monotonic() < ends[0]

    return going


def row(case: Case, verdict: Verdict) -> Row:
    """Return the row of a case; "seconds" are of the processor, of the call under attack."""
    words = " ".join(verdict.words.split()).encode("ascii", errors="backslashreplace").decode()
    figures = {"seed": case.seed, "number": case.number, "outcome": verdict.outcome, "status": verdict.status or "none"}
    return Row(case.name, case.kind, {**figures, "seconds": verdict.seconds, "words": words or "nothing"})


def is_slow(row: Row) -> bool:
    """Whether it is a solve that took longer than 5 s."""
    return row.tool == "solve" and bool(row["seconds"] > 5.0)


def report(rows: Sequence[Row], facts: dict[str, str]) -> str:
    """Return the counts as Markdown."""
    counts = []
    for kind in (name for name in KINDS if any(one.tool == name for one in rows)):
        found = Counter(one["outcome"] for one in rows if one.tool == kind)
        outcomes = {name: found[name] for name in ("right", "refused", "gave up", "wrong")}
        most = 100.0 * wilson(found["wrong"], found.total())[1]
        counts.append(Row(KINDS[kind], kind, {"cases": found.total(), **outcomes, "wrong at most %": most}))
    spans = []
    for status in ("solved", "unreachable", "infeasible", "stalled"):
        spent = np.array([1e3 * one["seconds"] for one in rows if one.tool == "solve" and one["status"] == status])
        if len(spent):
            figures = {"count": len(spent), **times(spent), "longest ms": float(spent.max())}
            spans.append(Row("solves that end", status, figures))
    seeds = ", ".join(map(str, sorted({one["seed"] for one in rows})))
    notes = [f"Solves that took more than 5 s: {sum(map(is_slow, rows))}.", f"Seed {seeds}."]
    return tables_of("What was attacked:", {"Cases": counts, "Times of solves": spans}, facts, notes)


def keep(case: Case, verdict: Verdict, folder: Path) -> None:
    """Write a failure: the script that repeats it, and what was found."""
    place = folder / case.name
    write_text(place / "repeat.py", render("repeat.py", case=case) + "\n")
    write_text(place / "found.txt", verdict.words + "\n")
