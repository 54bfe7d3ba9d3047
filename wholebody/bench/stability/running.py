"""Runs cases by methods, each cell in a process of its own: what hangs or crashes costs one cell and a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from wholebody.bench.adapters.base import Adapter
from wholebody.bench.stability.answering import NOTHING, Answer, ask
from wholebody.bench.stability.case import HardCase
from wholebody.bench.stability.judging import Judged, judge
from wholebody.compiled import compile_all
from wholebody.runner import Child, EndedError, Job, allow, run_jobs, tell

CAP = 20.0  # s: a method that has not answered by then, or has not made its next frame, hangs
JUDGING = 120.0  # s: a judgement of many frames, all pairs of each


@dataclass(frozen=True)
class Cell:
    """One method's answer to one case, and what it measures."""

    case: HardCase
    method: str
    answer: Answer
    judged: Judged


def run(cases: Sequence[HardCase], adapters: Sequence[Adapter], jobs: int = 1, cap: float = CAP) -> Iterator[Cell]:
    """Every case by every method, as they end.

    Args:
        cases: what is asked.
        adapters: who is asked.
        jobs: processes at a time.
        cap: seconds for an answer, or for a frame of one.
    """
    _warm()
    left = (Job((case, adapter.name), _cell, (case, adapter, cap), cap) for case in cases for adapter in adapters)
    for outcome in run_jobs(lambda: next(left, None), [Child(forked=True) for _ in range(jobs)]):
        case, method = outcome.job.name
        answer = outcome.notes[0] if outcome.notes else Answer(NOTHING)
        if outcome.error is not None:
            failure = "its answer cannot be judged" if outcome.notes else _failure(outcome.error, cap)
            answer = Answer(NOTHING, failure=failure)
        yield Cell(case, method, answer, outcome.answer or Judged())


def _warm() -> None:
    """Import and compile in this process what most cells need, so that no cell is timed with it."""
    from wholebody.bench.stability.streams import ThinPlate
    from wholebody.methods.qp.method import QP

    compile_all()
    question = ThinPlate().question()
    judged = QP().solve(question.problem)
    question.problem.scene.sweep(question.problem.start, judged.q)


def _cell(case: HardCase, adapter: Adapter, cap: float) -> Judged:
    """Ask, send the answer, then judge it: the clock for the method stops with the answer."""
    answer = ask(case, adapter, lambda: allow(cap))
    allow(JUDGING)
    tell(answer)
    return judge(case, answer)


def _failure(error: EndedError, cap: float) -> str:
    if error.overtime:
        return f"hangs: no answer in {cap:g} s"
    return f"crashes: {error.how}" if error.code < 0 else f"ends its process with code {error.code}"
