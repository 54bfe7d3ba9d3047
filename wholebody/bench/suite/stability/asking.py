"""Asks methods hard questions, each in a process of its own: what hangs or crashes costs one cell and a time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from wholebody.base.compiled import compile_all
from wholebody.base.errors import WholebodyError
from wholebody.base.runner import BY_THE_CLOCK, Child, EndedError, Job, allow_processor, run_jobs, tell
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.stability.case import NOTHING, Answer, HardCase, Nonsense, Posed, Stream
from wholebody.bench.suite.stability.judging import Judged, judge
from wholebody.tracking.drag import Drag

ASKED = 1e-5  # m, rad: tolerance that methods are asked for; they are judged by the case's own
CAP = 20.0  # s of the processor: a method that has not answered by then, or has not made its next frame, hangs
JUDGING = 120.0  # s of the processor: a judgement of many frames, all pairs of each


@dataclass(frozen=True)
class Cell:
    """One method's answer to one case, and what it measures."""

    case: HardCase
    method: str
    answer: Answer
    judged: Judged


def run(asked: Iterable[tuple[HardCase, Adapter]], jobs: int = 1, cap: float = CAP) -> Iterator[Cell]:
    """Cases, each by a method, as they end, in `jobs` processes.

    `cap` is seconds of the processor for an answer, or for a frame.
    """
    _warm()
    left = (Job((case, adapter.name), _cell, (case, adapter, cap), BY_THE_CLOCK * cap) for case, adapter in asked)
    for outcome in run_jobs(lambda: next(left, None), [Child(forked=True) for _ in range(jobs)]):
        case, method = outcome.job.name
        answer = outcome.notes[0] if outcome.notes else Answer(NOTHING)
        if outcome.error is not None:
            failure = "its answer cannot be judged" if outcome.notes else _failure(outcome.error, cap)
            answer = Answer(NOTHING, failure=failure)
        yield Cell(case, method, answer, outcome.answer or Judged())


def _warm() -> None:
    """Import and compile in this process what most cells need, so that no cell is timed with it."""
    from wholebody.bench.suite.stability.streams import thin_plate
    from wholebody.methods.qp.method import QP

    compile_all()
    question = thin_plate()
    judged = QP().solve(question.problem)
    question.problem.scene.sweep(question.problem.start, judged.q)


def _cell(case: HardCase, adapter: Adapter, cap: float) -> Judged:
    """Ask, send the answer, then judge it: the time of the method ends with the answer."""
    allow_processor(cap)
    answer = ask(case, adapter, lambda: allow_processor(cap))
    allow_processor(JUDGING)
    tell(answer)
    return judge(case, answer)


def _failure(error: EndedError, cap: float) -> str:
    if error.overtime:
        return f"hangs: no answer in {cap:g} s of the processor"
    return f"crashes: {error.how}" if error.code < 0 else f"ends its process with code {error.code}"


def ask(case: HardCase, adapter: Adapter, alive: Callable[[], None] = lambda: None) -> Answer:
    """Ask; exceptions of any kind become part of the answer. After each frame of a stream `alive` is called."""
    began = time.perf_counter()
    try:
        question = case.question()
        if isinstance(question, Nonsense):
            return _nonsense(question, adapter)
        began = time.perf_counter()
        return _posed(question, adapter) if isinstance(question, Posed) else _stream(question, adapter, alive)
    except WholebodyError as error:
        return Answer(NOTHING, refusal=str(error), seconds=time.perf_counter() - began)
    except Exception as error:  # whatever a method throws is what is looked for here
        return Answer(NOTHING, failure=_named(error), seconds=time.perf_counter() - began)


def _posed(question: Posed, adapter: Adapter) -> Answer:
    if question.hindered and adapter.hindered is not None:
        method = adapter.hindered(tolerance=ASKED)
    else:
        method = adapter.make(ASKED, 1 if question.hindered else question.iterations)
    solution = method.solve(question.problem)
    left = max(solution.assessment.goal_error, solution.assessment.goal_angle)
    return Answer(
        np.array(solution.q, dtype=float)[None], str(solution.status), (float(left),),
        seconds=solution.seconds, message=solution.message,
    )  # fmt: skip


def _stream(question: Stream, adapter: Adapter, alive: Callable[[], None]) -> Answer:
    drag = Drag(question.problem, adapter.make(ASKED, None), dt=question.dt)
    postures, left = [], []
    began = time.perf_counter()
    for frame in question.frames:
        for name, place in frame.moved.items():
            question.problem.scene.move(name, at=place)
        answer = drag.to(frame.target)
        postures.append(np.array(answer.q, dtype=float))
        left.append(float(answer.error))
        alive()
    return Answer(np.array(postures), left=tuple(left), seconds=time.perf_counter() - began)


def _nonsense(question: Nonsense, adapter: Adapter) -> Answer:
    began = time.perf_counter()
    refusals, taken = [], []
    for what, attempt in question.attempts.items():
        try:
            attempt(adapter)
            taken.append(what)
        except WholebodyError as error:
            refusals.append(str(error))
        except Exception as error:  # an error of another kind is no clear refusal
            return Answer(NOTHING, failure=f"{what}: {_named(error)}", seconds=time.perf_counter() - began)
    refusal = "" if taken else refusals[0]
    return Answer(NOTHING, refusal=refusal, taken=tuple(taken), seconds=time.perf_counter() - began)


def _named(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[0] if lines else ''}"[:160]
