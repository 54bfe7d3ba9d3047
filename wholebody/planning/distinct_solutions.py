"""`solutions`: the distinct answers of one problem, by their measure, and whether there seem to be more."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice
from typing import overload

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.batches import reporter
from wholebody.methods.base import TIME_LIMIT, check_problem
from wholebody.methods.contradictions import contradictions
from wholebody.methods.control import BUDGET, ctrl_c_ends_all, within_budget
from wholebody.methods.qp.chain import closed_form_postures
from wholebody.methods.qp.method import QP
from wholebody.methods.starts import throughout
from wholebody.problem import Problem
from wholebody.solution import Solution

UNCHANGED = 40  # starts in a row that change none of what is returned: by Laplace's rule the next does 1 time in 42
LONGEST = 60.0  # s of the processor without a time limit: answers of several figures multiply, and so do descents


@dataclass(frozen=True)
class Solutions(Sequence[Solution]):
    """Answers of one problem, each at least `apart` from all others in some joint; that of the least measure first.

    Attributes:
        answers: solved, as many as were asked for at most.
        found: how many distinct answers there were, those that were not asked for too.
        descents: how many descents ended in a posture that solves the problem.
        starts: how many were made.
        complete: whether all answers count as found, by the rule of `all_found`: an estimate, no proof;
            of an arm of six joints with a closed form, whether all of its branches were descended from. True without a
            start where the problem is proven to have no answer, as beyond an arm's length. Else never where
            neighbours of an answer meet the goals, as those of redundant arms and of people do, and only after 40
            descents.
        ended: why no other start was made, in words.

    Examples:
        >>> found = wb.solutions(problem, most=2, starts=4)
        >>> len(found.answers) <= 2
        True
    """

    answers: tuple[Solution, ...] = field(repr=False)
    found: int
    descents: int
    starts: int
    complete: bool
    ended: str = ""

    def __len__(self) -> int:
        """Return the number of answers."""
        return len(self.answers)

    @overload
    def __getitem__(self, index: int) -> Solution: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Solution, ...]: ...
    def __getitem__(self, index: int | slice) -> Solution | tuple[Solution, ...]:
        """Return an answer, or some of them."""
        return self.answers[index]

    def __str__(self) -> str:
        more = (
            "the search seems complete" if self.complete else "there may be more" + f": {self.ended}" * bool(self.ended)
        )
        lines = [f"{self.found} distinct answers of {self.descents} descents from {self.starts} starts; {more}"]
        lines += [f"  {number}: measure {answer.assessment.measure:.4g}" for number, answer in enumerate(self.answers)]
        return "\n".join(lines)


def solutions(
    problem: Problem,
    most: int = 8,
    apart: float = 0.2,
    *,
    starts: int = 300,
    seed: int = 0,
    time_limit: float | None = None,
    progress: Callable[[int, int], object] | bool | None = None,
) -> Solutions:
    """Return distinct answers of a problem: local minima of its measures that meet its goals and keep what must hold.

    Descents begin at the branches of the closed form of an arm that has one, of seven joints where these take the least
    effort, and of several arms at their combinations. If these are not all, they also begin at the problem's start and
    at random postures (a Latin hypercube). Measures count from the problem's start. The search ends where all answers
    count as found, where 40 starts in a row changed none that is returned, or after as many starts or seconds.

    Args:
        problem: as for `wb.solve`.
        most: how many answers are returned, those of the least measure.
        apart: least difference of two answers in some degree of freedom, radians or metres, whole turns of hinges left
            out; of two that are nearer the one of the lesser measure is kept.
        starts: most descents.
        seed: of the random postures.
        time_limit: seconds after which it ends, the last descent too; the first always begins; infinite for no limit.
            Where None, it ends after a minute of processor time.
        progress: called after each descent with the number of descents and the most there will be; the search ends if
            it returns True. True prints a line.

    Raises:
        InputError: a value of the wrong kind or out of range, or the scene changed after the problem was stated.

    Examples:
        >>> best = wb.solutions(problem, most=2, starts=4).answers[0]
    """
    check_problem(problem, "solutions: problem")
    most = checks.whole(most, "solutions: most", 1, 10_000)
    starts = checks.whole(starts, "solutions: starts", 1, 100_000)
    apart = checks.number(apart, "solutions: apart", 1e-6, 100.0, "rad or m")
    seed = checks.whole(seed, "solutions: seed", 0, 2**32 - 1)
    told = reporter(progress, "solutions: progress")
    ends = np.inf if time_limit is None else time.perf_counter() + TIME_LIMIT(time_limit, "solutions: time_limit")
    with problem.borrow() as workspace:
        if contradictions(problem, workspace):
            return Solutions((), 0, 0, 0, True, "it is proven that there is none")
    known, least = _Known(problem.scene.model, apart), np.zeros(0)
    begun = descents = unchanged = 0
    (branches, every), complete = closed_form_postures(problem, starts), False
    every = every and len(branches) > 0 and _stand_alone(problem, branches)
    total = len(branches) if every else starts
    ended = f"{total} start{'s were' if total != 1 else ' was'} made"
    with ctrl_c_ends_all(), within_budget(LONGEST if time_limit is None else np.inf):
        for start in islice(chain(branches, () if every else _starts(problem, starts, seed)), total):
            if begun and (BUDGET.over or ends <= time.perf_counter()):  # the first begins however long it took so far
                ended = f"the time limit of {LONGEST if time_limit is None else time_limit:g} s ended it"
                break
            answer = next(_method(time_limit, ends).minima(problem, [start]))
            begun += 1
            if answer.solved:
                descents += 1
                if known.near(answer.q) is None:
                    answer = _settled(problem, known, answer, time_limit, ends)
                known.add(answer)
            before, least = least, known.measures[:most]
            same = len(before) == len(least) and np.allclose(before, least, rtol=1e-3)
            unchanged = unchanged + 1 if same else 0
            complete = begun == len(branches) if every else all_found(len(known.answers), descents)
            stopped = told is not None and told(begun, total) is True
            if stopped or complete or (unchanged == UNCHANGED and not every):
                last = f"the last {unchanged} starts " + ("changed none of these" if len(least) else "led to none")
                ended = "progress ended it" if stopped else "other starts lead to no others" if complete else last
                break
    found = known.answers
    if complete and not _stand_alone(problem, [answer.q for answer in found]):
        complete, ended = False, "neighbours of these meet the goals too"
    return Solutions(tuple(found[:most]), len(found), descents, begun, complete, ended)


def all_found(found: int, descents: int) -> bool:
    """Whether so many different answers count as all there are, after so many descents from random starts.

    With w answers of n descents the number to expect is w (n - 1) / (n - w - 2) under a uniform prior; if that is
    nearer to w than to w + 1, and n at least 40, all count as found (C. G. E. Boender, A. H. G. Rinnooy Kan, "Bayesian
    stopping rules for multistart global optimization methods", Mathematical Programming 37, 1987).
    """
    # After 12 descents minima at limits, which few starts lead to, were missed.
    enough = descents >= max(40, found + 3)
    return enough and found * (descents - 1) <= (found + 0.5) * (descents - found - 2)


class _Known:
    """Answers that are apart, the one of the least measure first."""

    def __init__(self, model: pin.Model, apart: float) -> None:
        kinds = [joint for joint in model.joints[1:] if joint.nv == 1 and joint.shortname().startswith("JointModelR")]
        self._hinges = [joint.idx_v for joint in kinds]
        self._model, self._apart = model, apart
        self.answers: list[Solution] = []

    @property
    def measures(self) -> Array:
        """Those of the answers, ascending."""
        return np.array([answer.assessment.measure for answer in self.answers])

    def difference(self, one: Array, other: Array) -> float:
        """Greatest difference of two postures (nq,) in a degree of freedom; a whole turn of a hinge is none."""
        away = np.asarray(pin.difference(self._model, one, other))
        away[self._hinges] -= 2.0 * np.pi * np.round(away[self._hinges] / (2.0 * np.pi))
        return float(np.abs(away).max(initial=0.0))

    def near(self, q: Array) -> Solution | None:
        """The first answer that is not apart from a posture (nq,); None where all are."""
        return next((one for one in self.answers if self.difference(one.q, q) < self._apart), None)

    def add(self, answer: Solution) -> None:
        """Add an answer, unless one of no greater measure is near; of greater ones those that are near go."""
        nearest = self.near(answer.q)
        if nearest is not None and nearest.assessment.measure <= answer.assessment.measure:
            return
        kept = [one for one in self.answers if self.difference(one.q, answer.q) >= self._apart]
        self.answers = sorted([*kept, answer], key=lambda one: one.assessment.measure)


def _method(time_limit: float | None, ends: float) -> QP:
    """The method of a descent that ends when the search does."""
    return QP(time_limit=None if time_limit is None else max(ends - time.perf_counter(), 1e-9))


def _settled(problem: Problem, known: _Known, answer: Solution, time_limit: float | None, ends: float) -> Solution:
    """The end of descents from an answer and from their ends in turn, until one stays where it begins."""
    for _ in range(10):  # of arms of seven joints more than three are rare
        after = next(_method(time_limit, ends).minima(problem, [answer.q]))
        if not after.solved or known.difference(after.q, answer.q) < 0.01:  # rad, m
            break
        answer = after
    return answer


def _stand_alone(problem: Problem, postures: Iterable[Array]) -> bool:
    """Whether the goals fix every joint at these postures (nq,): other answers that meet them are apart."""
    with problem.borrow() as workspace:
        lineariser = problem.lineariser(workspace)
        goals = [lineariser.at(q, 0.0).goal_jacobian for q in postures]
    least = 1e-3  # m or rad per rad: singular value of goals that no neighbour meets
    return all(len(rows) >= rows.shape[1] and np.linalg.svd(rows, compute_uv=False)[-1] >= least for rows in goals)


def _starts(problem: Problem, count: int, seed: int) -> Iterator[Array]:
    state, rng = problem.scene.state(problem.start), np.random.default_rng(seed)
    others = throughout(problem, state, problem.start, rng, count - 1) if count > 1 else iter(())
    return chain([problem.scene.figure.clamp(problem.start)], others)
