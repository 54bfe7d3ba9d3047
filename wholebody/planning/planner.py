"""`wb.plan`: a motion from a posture to another one, or to goals, free of collision and within limits of speed.

ends -> straight motion, else steps along things, else two trees -> shortcuts -> smoothing and timing -> judge
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import assess
from wholebody.base import checks
from wholebody.base.arrays import Array, brief
from wholebody.base.compiled import compile_all, compile_seconds
from wholebody.base.errors import InputError
from wholebody.base.runner import processor_time
from wholebody.geometry.continuous.sweep import Sweep
from wholebody.methods.control import BUDGET, within_budget
from wholebody.methods.simplification import still_dofs
from wholebody.motion.clip import Clip
from wholebody.planning.ends import End, answers, nearer
from wholebody.planning.local_planner import LocalPlanner, TrackedMotions
from wholebody.planning.rrt_connect import GEODESICS, RRTConnect
from wholebody.planning.sampling import Sampler, holds
from wholebody.planning.smoothing import length, resampled, shortcut, smooth, tighten
from wholebody.planning.timing import Pace, Timing
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks.base import Bound, Constraint, Goal

KEPT = 1e-4  # m, rad: by which limits, constraints and clearances may be missed in a frame
PASSED = 5e-4  # m: overlap between two frames that counts
OVER = 1.001  # of the limits of velocity and acceleration: the last slowing may end a little above them
SEARCHED = 0.75  # of the time limit: for the first path; the rest is for shortcuts, smoothing and the judgement
AGAIN = 0.45  # of the time limit: for shorter paths; more = shorter, later
STEPPED = 2  # samples of trees that look for a shorter path, of which one is stepped towards; more = shorter paths
STRAIGHT = 2  # sweeps of a tightened path of a body towards the straight motion
LONG = 2.0  # of the straight motion to the nearest end: a path that is longer is worth the time until LATER
LATER = (0.65, 0.55)  # of the time limit: as AGAIN, for long paths of arms, and of bodies, whose polishing takes longer
POLISHED = 0.65  # of the time limit: the shortest path is drawn tight again until then
TIGHT = 0.97  # of its length before it was drawn tight: where it is longer, it stays as it is
NEEDED = (  # modules whose loops are compiled or read before the clock starts: the first time takes longer than a plan
    "wholebody.terms.linearisation",
    "wholebody.methods.qp.active_set",
    "wholebody.methods.qp.step_program",
    "wholebody.methods.qp.subproblem",
    "wholebody.methods.qp.plain_chain",
    "wholebody.geometry.proximity",
    "wholebody.geometry.contact_rows",
    "wholebody.geometry.continuous.moved_pairs",
    "wholebody.geometry.continuous.swept_depth",
)
LEAST = 0.1  # s: a time limit below it counts as it; the straight motion of an arm takes less


@dataclass(frozen=True, repr=False)
class Plan:
    """A planned motion and its figures.

    Attributes:
        clip: the motion, from the start to the goal; the start alone where none was found.
        solved: whether the clip leads to the goal, keeps limits, constraints and clearances in every frame, and passes
            through nothing between frames, as judged from its postures alone.
        message: how it was found, or why there is none.
        length: of the motion, radians and metres.
        violation: largest by which a frame misses limits, constraints and clearances, metres and radians.
        velocity: largest of any joint, in parts of its limit.
        acceleration: the same.
        seconds: of the processor, without compiling.

    Examples:
        >>> found = wb.plan(scene, standing, human.with_joints(standing, {"left_elbow_flexion": 1.0}))
        >>> found.solved, len(found.clip) > 1
        (True, True)
    """

    clip: Clip = field(repr=False)
    solved: bool
    message: str
    length: float = 0.0
    violation: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0
    seconds: float = 0.0

    __repr__ = brief


def plan(
    scene: Scene,
    start: Array | str | None,
    goal: Array | str | Goal | Iterable[Goal],
    *,
    constraints: Iterable[Constraint | Bound] = (),
    clearance: float = 0.0,
    pace: Pace | None = None,
    seed: int = 0,
    time_limit: float = 10.0,
) -> Plan:
    """Plan a motion of a figure among things that stand still.

    The straight motion is tried first, then steps along things from the end to the start. Then two trees of motions
    grow towards each other (RRT-Connect, Kuffner and LaValle 2000). The path is shortened and smoothed, and timed as
    fast as `pace` lets it (TOPP-RA, Pham and Pham 2018).

    Args:
        scene: the figure among things.
        start: (nq,) posture at which the motion begins, the name of one, or None for the figure's first posture.
        goal: (nq,) posture at which it ends, the name of one, or goals that its end meets.
        constraints: what holds throughout, such as `wb.Hold("left_foot")`, as in a `wb.Problem`.
        clearance: least distance of every pair, metres; pairs that are nearer at an end may be as near on the way.
        pace: limits of velocity and acceleration, and the time step; None for `wb.planning.Pace()`.
        seed: of the random postures.
        time_limit: seconds of the processor that all but compiling may take, the judgement too; at least 0.1. Free
            roots are sampled within a metre of the line between the ends.

    Raises:
        InputError: the start or the goal overlaps something, or misses a limit or a constraint, or an argument is not
            of its kind.
        UnknownNameError: a name that the figure does not have.

    Examples:
        >>> hand = wb.load("hand")
        >>> wb.plan(wb.Scene(hand), "open", "grip").solved
        True
    """
    checks.instance(scene, Scene, "plan: scene", "make one with wb.Scene(figure)")
    pace = Pace() if pace is None else checks.instance(pace, Pace, "plan: pace", "give wb.planning.Pace(velocity=1.0)")
    limit = checks.number(time_limit, "plan: time_limit", 0.0, np.inf, "s")
    rng = np.random.default_rng(checks.whole(seed, "plan: seed", 0, 2**63 - 1))
    goals = _goals(goal)
    compile_all(NEEDED)
    began = _computed()
    with within_budget(max(limit, LEAST)):
        problem = Problem(scene, start, goals=goals, constraints=constraints, clearance=clearance)
        _check_end(problem, problem.start, "start")
        sampler = Sampler(problem, rng)
        ends = answers(problem, sampler) if goals else iter([(_posture(problem, goal), "")])
        judge = _Judge(problem, pace)
        found = None
        with problem.borrow() as workspace:
            tracked = holds(problem) or bool(problem.bounds or scene.figure.followers)
            slides = TrackedMotions(problem, workspace)
            local: LocalPlanner = slides if tracked else slides.geodesics
            search = _Search(judge, (local, slides), ends, (sampler, rng))
            while found is None or not (found.solved or BUDGET.over):
                path, message = search.shortest()
                if path is None:
                    break
                found = _smoothed(judge, local, path)
    if found is None:
        found = Plan(Clip(scene.figure, problem.start[None], pace.dt, "plan"), False, message)
    return replace(found, message=message if found.solved else found.message, seconds=_computed() - began)


def _computed() -> float:
    """Processor's time of this process without compiling, seconds."""
    return processor_time() - compile_seconds()


def _goals(goal: Any) -> tuple[Goal, ...]:
    """The goals, where these are given; none for a posture."""
    if isinstance(goal, Goal):
        return (goal,)
    if isinstance(goal, (str, np.ndarray)) or not isinstance(goal, Iterable):
        return ()
    listed = tuple(goal)
    if not listed:
        raise InputError("plan: goal is empty; give goals or a posture")
    return listed if any(isinstance(one, Goal) for one in listed) else ()


def _posture(problem: Problem, goal: Any) -> Array:
    figure = problem.scene.figure
    q = figure.posture(goal) if isinstance(goal, str) else checks.posture(goal, figure.model.nq, "plan: goal")
    _check_end(problem, q, "goal")
    return np.array(q, dtype=float)


def _check_end(problem: Problem, q: Array, what: str) -> None:
    judged = assess(problem, q)
    found = {"things": judged.penetration, "limits": judged.limit_violation, "constraints": judged.constraint_violation}
    found["what is frozen at the start"] = _moved(problem, q[None])
    for name, by in found.items():
        if not by <= KEPT:
            raise InputError(f"plan: the {what} is {by:.3g} m or rad beyond {name}; give a posture of wb.solve")


def _moved(problem: Problem, q: Array) -> float:
    """By how much postures (n, nq) move what is frozen, radians and metres."""
    still, model = still_dofs(problem), problem.scene.model
    if not still:
        return 0.0
    return float(np.max([np.abs(pin.difference(model, problem.start, each)[still]).max() for each in q]))


class _Search:
    """The search for paths from the start of a problem to its ends."""

    def __init__(
        self,
        judge: _Judge,
        planners: tuple[LocalPlanner, TrackedMotions],
        ends: Iterator[End],
        random: tuple[Sampler, np.random.Generator],
    ) -> None:
        self._judge, self._ends, self._begun = judge, ends, False
        problem = self._problem = judge.problem
        self._local, self._slides = planners
        self._sampler, self._rng = random
        self._reached: list[Array] = []
        self._said = ""
        free_root = bool(problem.scene.figure.roots) and not holds(problem)
        self._bodily = free_root and self._local is not self._slides
        self._spreads = (0.0,) * free_root + (0.1, 0.3, 1.0)
        self._slides.admit(problem.start)
        self._straight, self._until = False, AGAIN

    def shortest(self) -> tuple[list[Array] | None, str]:
        """The shortest of some paths, with shortcuts, and how it was found; or None and why there is none."""
        model, best, most, samples, runs = self._problem.scene.model, None, np.inf, 0, 0
        enough: float = self._local.samples
        while not runs or (runs < self._local.searches and samples < enough and BUDGET.spent < self._until):
            # other motions are shorter than this share of the best one
            path, trees = self._path(0.95 * most, np.inf if not runs else enough - samples)
            runs, samples = runs + 1, samples + trees.samples * (runs > 0)
            if path is None:
                break
            if self._straight:
                return path, "the straight motion"
            with self._judge.in_time(path):
                # limbs that move evenly cost as much as five other shortcuts
                path = shortcut(model, path, self._local, self._rng, self._local.partial)
                path = nearer(self._problem, path, self._local, self._sampler)
            if (found := length(model, path)) < most:
                best, most = path, found
                if not any(np.array_equal(path[-1], q) for q in self._reached):
                    self._reached.append(path[-1])
            straight = min(self._apart(self._problem.start, q) for q in self._reached)
            long = self._local is not self._slides and most > LONG * straight
            self._until, enough = (LATER[self._bodily], np.inf) if long else (AGAIN, self._local.samples)
        if best is not None:
            straight = STRAIGHT * self._bodily
            while self._local is not self._slides and BUDGET.spent < POLISHED:
                # most of the remaining time is for smoothing
                with self._judge.in_time(best), within_budget(max(0.3 * BUDGET.left, 1e-9)):
                    short = shortcut(model, best, self._local, self._rng, True) if self._bodily else best
                    tight = tighten(model, short, self._local, self._slides, straight)
                best = min(best, short, tight, key=lambda path: length(model, path))
                before, most = most, length(model, best)
                if most > TIGHT * before:
                    if not straight:
                        break
                    straight = 0
            return best, f"the shortest of {runs} searches"
        if not self._reached:
            late = "" if BUDGET.spent < SEARCHED else " was found in time that"
            return None, f"no posture{late} meets the goals: {self._said}"
        return None, "no motion was found within the time limit"

    def _path(self, most: float, samples: float) -> tuple[list[Array] | None, RRTConnect]:
        """A path from the start to an end by new trees, which stay empty where it is straight.

        The trees grow towards at most so many samples, through which a path can be shorter than `most`, radians and
        metres (as in anytime RRTs, Ferguson and Stentz 2006).
        """
        start, model, rounds = self._problem.start, self._problem.scene.model, 0
        self._straight = False
        sliding = self._problem.scene.figure.roots and self._local is not self._slides
        trees = RRTConnect(
            self._local, self._slides if sliding else None, model, start, 1 if most == np.inf else STEPPED
        )
        ends = [q for q in self._reached if self._apart(start, q) < most]
        for reached in ends:
            trees.add_end(reached)
        while rounds < samples and (BUDGET.spent < (SEARCHED if most == np.inf else self._until) or not self._begun):
            self._begun = True
            if rounds % self._local.rounds == 0 or not ends:
                q, why = next(self._ends, (None, ""))
                if q is None and not why and not ends:
                    break
                if q is None and why:
                    self._said = self._said or why
                    continue
                if q is not None:
                    self._slides.admit(q)
                    self._reached.append(q)
                    if self._apart(start, q) < most:
                        ends.append(q)
                        if led := self._led(q):
                            return led, trees
                        trees.add_end(q)
                if not ends:
                    continue
            rounds += 1
            near = ends[self._rng.integers(len(ends))]
            # Half of the samples are at an end: bodies leave narrow places as they are.
            share = float(np.clip(self._rng.uniform(-0.5, 1.5), 0.0, 1.0))
            middle = np.asarray(pin.interpolate(model, start, near, share))
            sample = self._sampler.near(middle, self._spread(trees.samples))
            if most < np.inf and self._apart(start, sample) + min(self._apart(sample, q) for q in ends) > most:
                continue
            path = trees.grow(sample)
            if path is not None:
                return path, trees
        return None, trees

    def _spread(self, samples: int) -> float:
        """Of the next of so many samples; bodies get through most narrow places sooner if the root alone turns."""
        if self._bodily and samples < GEODESICS:
            return max(0.0, self._rng.uniform(-0.1, 0.1))
        return self._spreads[self._rng.integers(len(self._spreads))]

    def _led(self, end: Array) -> list[Array]:
        """Postures from the start to an end (nq,) without trees, if any: straight, or along things from the end back.

        Most narrow places are around ends, and steps towards the start lead out of them.
        """
        start = self._problem.start
        way, self._straight = self._local.towards(start, end)
        if self._straight:
            return [start, *way[:-1], end]
        way, met = self._slides.towards(end, start)
        return [start, *way[-2::-1], end] if met else []

    def _apart(self, q: Array, other: Array) -> float:
        return float(np.linalg.norm(pin.difference(self._problem.scene.model, q, other)))


def _smoothed(judge: _Judge, local: LocalPlanner, path: list[Array]) -> Plan:
    """The motion along a smooth path beside a free one; along the free one itself where that one fails."""
    model = judge.problem.scene.model
    count = int(np.clip(length(model, path) / local.spacing, 20, 1000))
    with judge.in_time(path):
        even, _ = local.settled(resampled(model, path, count))
        paths = smooth(model, even, local), even
    plans = map(judge.judged, paths)
    found = next(plans)
    return found if found.solved or BUDGET.over else next(plans)


class _Judge:
    """Judges motions from their postures alone."""

    def __init__(self, problem: Problem, pace: Pace) -> None:
        self.problem, self._pace = problem, pace
        spent = []
        for _ in range(3):  # the least, as a busy machine takes several times as long now and then
            began = _computed()
            assess(problem, problem.start)
            spent.append(_computed() - began)
        self._frame = 3.0 * min(spent)  # s: each is also swept from the one before

    def in_time(self, path: list[Array]) -> AbstractContextManager[None]:
        """Inside it the budget ends early enough to judge a motion along postures (nq,), of half a second at least."""
        figure = self.problem.scene.figure
        steps = np.array([pin.difference(figure.model, *pair) for pair in pairwise(path)]).reshape(-1, figure.model.nv)
        fastest = float((np.abs(steps) / self._pace.fastest(figure)).max(axis=1).sum())
        return within_budget(max(BUDGET.left - self._frame * (0.6 + 2.0 * fastest) / self._pace.dt, 1e-9))

    def judged(self, path: Array) -> Plan:
        """The motion along a path (m, nq) as fast as the limits allow, and its figures."""
        scene, pace = self.problem.scene, self._pace
        q, use = Timing(scene.figure, path, pace).within()
        asked, worst = self._between(q[-1]), _moved(self.problem, q)
        for frame in q:  # as far as the first that misses something
            if not worst <= KEPT or BUDGET.over:
                break
            one = assess(asked, frame)
            worst = max(worst, one.limit_violation, one.constraint_violation, one.clearance_violation)
        faults = [
            f"a frame misses what must hold by {worst:.3g} m or rad" if not worst <= KEPT else "",
            f"velocities reach {use.velocity:.3g} of their limits" if not use.velocity <= OVER else "",
            f"accelerations reach {use.acceleration:.3g} of their limit" if not use.acceleration <= OVER else "",
        ]
        if not any(faults):
            sweep = Sweep(scene.model, scene.geometry)
            free = (not BUDGET.over and sweep.first_contact(*pair, tolerance=PASSED) is None for pair in pairwise(q))
            passed = next((k for k, kept in enumerate(free, 1) if not kept), 0)
            faults.append(f"something is passed through before frame {passed}" if passed else "")
        if BUDGET.over:
            faults = ["the time limit ended the judgement of a motion"]
        said = "; ".join(fault for fault in faults if fault)
        return Plan(Clip(scene.figure, q, pace.dt, "plan"), not said, said, length(scene.model, list(q)), worst, *use)

    def _between(self, end: Array) -> Problem:
        """The problem with clearances of pairs that are nearer at an end (nq,) as they are there."""
        problem = self.problem
        result, least = problem.with_start(problem.start), np.array(problem.clearances)
        with problem.borrow() as workspace:
            near = workspace.near(end, problem.clearance + KEPT)
        least[near.number] = np.minimum(least[near.number], np.maximum(near.distance, 0.0))
        result.clearances = least
        return result
