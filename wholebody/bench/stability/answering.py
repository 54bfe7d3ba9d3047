"""Asks a method a hard question, and writes down what it answers; nothing is judged here."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wholebody.arrays import Array
from wholebody.bench.adapters.base import Adapter
from wholebody.bench.stability.case import HardCase, Nonsense, Posed, Stream
from wholebody.errors import WholebodyError
from wholebody.methods.drag import Drag

ASKED = 1e-5  # m, rad: tolerance that methods are asked for; they are judged by the case's own


@dataclass(frozen=True)
class Answer:
    """What a method did with one case.

    Attributes:
        postures: (k, nq) its answer, or one posture a frame; empty where it gave none.
        status: what it says of its answer; "" for streams, which say only what is left.
        left: (k,) what it says is left to the goal, metres or radians; NaN where it does not say.
        refusal: what it says where it refuses.
        failure: an exception that is no WholebodyError, or how the process ended.
        taken: nonsense that it took without a word.
        seconds: wall time.
        message: its own sentence.
    """

    postures: Array
    status: str = ""
    left: tuple[float, ...] = ()
    refusal: str = ""
    failure: str = ""
    taken: tuple[str, ...] = ()
    seconds: float = 0.0
    message: str = ""


NOTHING = np.zeros((0, 0))


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
    method = adapter.make(ASKED, question.iterations)
    if question.adjust is not None:
        method = question.adjust(method)
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
