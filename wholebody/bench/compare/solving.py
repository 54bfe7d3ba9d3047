"""One solve of one case, timed, and judged by `assess` alone."""

from __future__ import annotations

import copy
import gc
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wholebody.assessment import Assessment, assess
from wholebody.bench.compare.record import ANSWERED, FAILED, REFUSED, Record
from wholebody.bench.entrants.base import Budget, Entrant, set_up
from wholebody.bench.problem_sets.case import Case, ProblemSet
from wholebody.compiled import compile_all
from wholebody.errors import WholebodyError
from wholebody.problem import Problem


@dataclass(frozen=True)
class Ready:
    """A case, built, with everything that belongs to the scene and to no method built too.

    Attributes:
        case: as the set made it.
        best: measure of the witness.
    """

    case: Case
    best: float


def ready(family: ProblemSet, number: int, seed: int) -> Ready:
    """Build a case; what is built at first use by whoever asks first is built here, in nobody's time."""
    compile_all()  # seconds at the first time on a machine, more than the quick comparison gives a solve
    case = family.make(number, seed)
    with case.problem.lend():  # room that the solves below use again
        pass
    assess(case.problem, case.problem.start)
    return Ready(case, assess(case.problem, case.witness).measure)


def solve(entrant: Entrant, level: Budget, made: Ready) -> Record:
    """Solve a case with a fresh method. Whatever the method does, this returns what came of it."""
    from wholebody.bench.compare.following import follow

    empty = blank(entrant, level, made.case.set, made.case.number)
    try:
        method = entrant.make(*level)
        moving = bool(made.case.frames)
        problem = copy.copy(made.case.problem) if moving else made.case.problem  # each moves the goals of its own copy
        began = time.perf_counter()
        set_up(method, problem)
        empty = replace(empty, setup_seconds=time.perf_counter() - began, best=made.best)
        gc.disable()
        if moving:
            return follow(method, problem, made.case, empty)
        return _once(method, problem, empty)
    except WholebodyError as error:
        return replace(empty, outcome=REFUSED, said=sentence(error))
    except Exception as error:  # a peer may raise anything; what it was is the result
        return replace(empty, outcome=FAILED, said=f"{type(error).__name__}: {sentence(error)}")
    finally:
        gc.enable()


def blank(entrant: Entrant, level: Budget, family: str, number: int) -> Record:
    """A record without an answer."""
    tolerance, iterations = level
    return Record(family, number, entrant.name, tolerance, iterations or 0, FAILED)


def sentence(error: BaseException) -> str:
    """What an error says, in one line."""
    return " ".join(str(error).split())[:300]


def _once(method: Any, problem: Problem, empty: Record) -> Record:
    worked, began = time.process_time(), time.perf_counter()
    solution = method.solve(problem)
    spent = time.perf_counter() - began - solution.assessment.seconds
    worked = time.process_time() - worked
    q = np.asarray(solution.q, dtype=float)
    if not np.isfinite(q).all():
        return replace(empty, said="the answer is not finite", seconds=spent, status=solution.status)
    judging = time.process_time()
    judgement = assess(problem, q)
    worked -= time.process_time() - judging  # the same judgement as the one within the call
    filled = replace(
        empty,
        outcome=ANSWERED,
        status=solution.status,
        said=" ".join(solution.message.split())[:300],
        seconds=max(spent, 0.0),
        cpu_seconds=max(worked, 0.0),
        iterations=float(solution.iterations),
    )
    return judged(filled, judgement)


def judged(record: Record, judgement: Assessment) -> Record:
    """The record with the figures of a judgement."""
    return replace(
        record,
        goal_error=judgement.goal_error,
        goal_angle=judgement.goal_angle,
        penetration=judgement.penetration,
        clearance_lack=judgement.clearance_lack,
        limit_violation=judgement.limit_violation,
        constraint_violation=judgement.constraint_violation,
        measure=judgement.measure,
        optimality=judgement.optimality,
    )
