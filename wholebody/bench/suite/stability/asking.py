"""Asks methods hard questions in child processes, and measures the answers on questions made anew."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import pinocchio as pin

from wholebody.assessment.motion import velocities
from wholebody.assessment.posture import Assessment, assess
from wholebody.base.arrays import Array
from wholebody.base.batches import run_batch
from wholebody.base.compiled import compile_all
from wholebody.base.errors import WholebodyError
from wholebody.base.runner import EndedError, Job, allow_processor, tell
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.stability.catalogue import NOTHING, Answer, HardCase, Nonsense, Posed, Stream, cases
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks import Point
from wholebody.tracking.drag import Drag

INSIDE = 1e-4  # m: deeper than this is inside


@dataclass(frozen=True)
class Judged:
    """What an answer measures, the worst of all frames where there are several [m, rad].

    `goal_error`: at the end; `speed_excess`: by how much the fastest joint is too fast, as a share; `passed`: what it
    went into between frames, in words, and `dip` how deep; `misreported`: largest difference between what it says is
    left and what is.
    """

    finite: bool = True
    goal_error: float = 0.0
    penetration: float = 0.0
    start_penetration: float = 0.0
    limit_violation: float = 0.0
    constraint_violation: float = 0.0
    speed_excess: float = 0.0
    passed: str = ""
    dip: float = 0.0
    misreported: float = 0.0


def judge(case: HardCase, answer: Answer) -> Judged:
    """Measure an answer; nothing where there is no posture."""
    question = case.question()
    if isinstance(question, Nonsense) or not len(answer.postures):
        return Judged()
    if not np.isfinite(answer.postures).all():
        return Judged(finite=False, goal_error=float("nan"))
    if isinstance(question, Posed):
        return _measured(question.problem, answer)
    return _followed(question, answer)


def _measured(problem: Problem, answer: Answer) -> Judged:
    found = assess(problem, answer.postures[0])
    left = _left(found)
    return Judged(
        goal_error=left,
        penetration=found.penetration,
        start_penetration=assess(problem, problem.scene.figure.clamp(problem.start)).penetration,
        limit_violation=found.limit_violation,
        constraint_violation=found.constraint_violation,
        misreported=abs(left - answer.left[0]),
    )


def _followed(question: Stream, answer: Answer) -> Judged:
    problem, scene = question.problem, question.problem.scene
    first = problem.goals[0]
    assert isinstance(first, Point)
    found: list[Assessment] = []
    passed, deepest_way, excess, misreported = "", 0.0, 0.0, 0.0
    before = scene.figure.clamp(problem.start)
    for number, (frame, q) in enumerate(zip(question.frames, answer.postures, strict=True)):
        for name, place in frame.moved.items():
            scene.move(name, at=place)
        # The straight way between two postures may go in deeper than its ends by 1 mm.
        depth, owners = depth_between(scene, before, q, 1e-3)
        if depth > deepest_way:
            passed, deepest_way = f"{owners}, frame {number}", depth
        problem.retarget([Point(first.frame, frame.target)])
        found.append(assess(problem, q))
        misreported = max(misreported, abs(_left(found[-1]) - answer.left[number]))
        speed = np.abs(velocities(scene.model, np.array([before, q]), question.dt)).max()
        excess = max(excess, float(speed / question.speed - 1.0))
        before = q
    return Judged(
        goal_error=_left(found[-1]),
        penetration=max(each.penetration for each in found),
        limit_violation=max(each.limit_violation for each in found),
        constraint_violation=max(each.constraint_violation for each in found),
        speed_excess=excess,
        passed=passed,
        dip=deepest_way,
        misreported=misreported,
    )


def _left(found: Assessment) -> float:
    return max(found.goal_error, found.goal_angle)


ASKED = 1e-5  # m, rad: tolerance that methods are asked for; they are judged by the case's own


@dataclass(frozen=True)
class Cell:
    """One method's answer to one case, and what it measures."""

    case: HardCase
    method: str
    answer: Answer
    judged: Judged


def run(asked: Iterable[tuple[HardCase, Adapter]], jobs: int = 1, cap: float = 20.0) -> Iterator[Cell]:
    """Cases as they end, each by a method, in `jobs` processes; over `cap` s of the processor a method hangs."""
    # Half an hour for the first case of a process, which may compile everything.
    left = (Job((case, adapter.name), _cell, (case, adapter, cap), 1800.0) for case, adapter in asked)
    for outcome in run_batch(left, jobs):
        case, method = outcome.job.name
        answer = outcome.notes[0] if outcome.notes else Answer(NOTHING)
        if outcome.error is not None:
            failure = "its answer cannot be judged" if outcome.notes else _failure(outcome.error, cap)
            answer = Answer(NOTHING, failure=failure)
        yield Cell(case, method, answer, outcome.answer or Judged())


@cache
def _warm() -> None:
    """Import and compile in this process what most cells need, so that no cell is timed with it."""
    from wholebody.methods.qp.method import QP

    compile_all()
    (question,) = (case.question() for case in cases(["thin-plate"]))
    assert isinstance(question, Stream)
    judged = QP().solve(question.problem)
    question.problem.scene.sweep(question.problem.start, judged.q)


def _cell(case: HardCase, adapter: Adapter, cap: float) -> Judged:
    """Ask, send the answer, then judge it: the time of the method ends with the answer."""
    _warm()
    allow_processor(cap)
    answer = ask(case, adapter, lambda: allow_processor(cap))
    allow_processor(120.0)  # s of the processor: a judgement of many frames, all pairs of each
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
    solution = adapter.make(ASKED, question.iterations).solve(question.problem)
    return Answer(
        np.array(solution.q, dtype=float)[None], str(solution.status), (float(_left(solution.assessment)),),
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


def depth_between(scene: Scene, before: Array, after: Array, depth: float) -> tuple[float, str]:
    """Depth [m] of the motion between two postures (nq,), if more than `depth`, and the names of the pair."""
    contact = scene.sweep(before, after, depth)
    if contact is None or not contact.certain:
        return 0.0, ""
    deepest = depth
    for share in np.linspace(0.0, 1.0, 41):
        found = scene.contacts(np.asarray(pin.interpolate(scene.model, before, after, float(share))), within=0.0)
        deepest = max(deepest, float(-found.distance.min(initial=0.0)))
    return deepest, " and ".join(scene.piece_owner[piece] for piece in contact.pair)
