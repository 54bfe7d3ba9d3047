"""`wb.plan`: a motion from a posture to another one, or to goals, free of collision and within limits of speed.

ends -> straight motion, else steps along things, else two trees -> shortcuts -> smoothing and timing -> judge
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import assess
from wholebody.base import checks
from wholebody.base.arrays import Array, brief
from wholebody.base.errors import InputError
from wholebody.base.runner import processor_time
from wholebody.geometry.continuous.sweep import Sweep
from wholebody.methods.conclusion import meets
from wholebody.methods.control import BUDGET, within_budget
from wholebody.methods.qp.method import QP
from wholebody.methods.simplification.reach import still_dofs
from wholebody.motion.clip import Clip
from wholebody.planning.local_planner import LocalPlanner, TrackedMotions
from wholebody.planning.rrt_connect import RRTConnect
from wholebody.planning.sampling import Sampler, holds
from wholebody.planning.smoothing import SPACING, length, resampled, shortcut, smooth
from wholebody.planning.timing import Pace, Timing
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks.base import Bound, Constraint, Goal

KEPT = 1e-4  # m, rad: by which limits, constraints and clearances may be missed in a frame
PASSED = 5e-4  # m: overlap between two frames that counts
OVER = 1.001  # of the limits of velocity and acceleration: the last slowing may end a little above them
ENDS = 8  # postures that meet goals; more = ends that are reached more easily, for a solve each
NEARER = 0.95  # of the length of the best motion: what others are shorter than
SEARCHED = 0.75  # of the time limit: for searches; the rest is for shortcuts, as long motions take longer to judge


@dataclass(frozen=True, repr=False)
class Plan:
    """A planned motion and what it is worth.

    Attributes:
        clip: the motion, from the start to the goal; the start alone where none was found.
        solved: whether the clip leads to the goal, keeps limits, constraints and clearances in every frame, and passes
            through nothing between frames, as judged from its postures alone.
        message: how it was found, or why there is none.
        length: of the motion, radians and metres.
        violation: largest by which a frame misses limits, constraints and clearances, metres and radians.
        velocity: largest of any joint, in parts of its limit.
        acceleration: the same.
        seconds: of the processor.

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
        time_limit: seconds of the processor after which solves, searches, shortcuts and smoothing end; what was found
            by then is judged, and straight motions are tried whatever it is. Free roots are looked for within a metre
            of the way between the ends.

    Raises:
        InputError: the start or the goal overlaps something, or misses a limit or a constraint, or an argument is not
            of its kind.
        UnknownNameError: a name that the figure does not have.

    Examples:
        >>> hand = wb.load("hand")
        >>> wb.plan(wb.Scene(hand), "open", "grip").solved
        True
    """
    began = processor_time()
    checks.instance(scene, Scene, "plan: scene", "make one with wb.Scene(figure)")
    pace = Pace() if pace is None else checks.instance(pace, Pace, "plan: pace", "give wb.planning.Pace(velocity=1.0)")
    limit = checks.number(time_limit, "plan: time_limit", 0.0, np.inf, "s")
    rng = np.random.default_rng(checks.whole(seed, "plan: seed", 0, 2**63 - 1))
    goals = _goals(goal)
    problem = Problem(scene, start, goals=goals, constraints=constraints, clearance=clearance)
    _check_end(problem, problem.start, "start")
    sampler = Sampler(problem, rng)
    ends = _answers(problem, sampler) if goals else iter([_End(_posture(problem, goal))])
    found = None
    with problem.borrow() as workspace:
        tracked = bool(problem.constraints or problem.bounds or scene.figure.followers)
        slides = TrackedMotions(problem, workspace)
        local: LocalPlanner = slides if tracked else slides.geodesics
        search = _Search(problem, (local, slides), ends, (sampler, rng))
        with within_budget(max(limit, 1e-9)):  # what is compiled or built at the first plan is no part of it
            path, message = search.shortest()
            while path is not None:
                found = _smoothed(problem, local, path, pace)
                if found.solved or BUDGET.over:
                    break
                path, _ = search.shortest()
    if found is None:
        found = Plan(Clip(scene.figure, problem.start[None], pace.dt, "plan"), False, message)
    return replace(found, message=message if found.solved else found.message, seconds=processor_time() - began)


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


class _End(NamedTuple):
    """A posture (nq,) at which a motion may end; None where goals were not met, and why."""

    q: Array | None
    why: str = ""


def _answers(problem: Problem, sampler: Sampler) -> Iterator[_End]:
    """Ends that meet the goals: that of the least measures, then those near random postures."""
    bare = problem.with_start(problem.start)
    bare.measures = ()  # these lead most starts to one end
    for number in range(ENDS):
        if number == 0:
            solution = QP().solve(problem)
        else:
            solution = QP(restarts=0, budget=0).solve(bare.with_start(sampler.near(problem.start, number / (ENDS - 1))))
        # Half of the ends are on any side of whole turns: things can block the nearest.
        near = problem.start if number < ENDS // 2 else sampler.anywhere()
        end = sampler.turns.nearest(solution.q, near) if solution.solved else None
        # a goal or a constraint on joint values may be met on one side of a whole turn alone
        if end is not None and not np.array_equal(end, solution.q) and not meets(assess(problem, end), QP().tolerance):
            end = solution.q
        yield _End(end, solution.message)


class _Search:
    """The search for paths from the start of a problem to its ends."""

    def __init__(
        self,
        problem: Problem,
        planners: tuple[LocalPlanner, TrackedMotions],
        ends: Iterator[_End],
        random: tuple[Sampler, np.random.Generator],
    ) -> None:
        self._problem, self._ends, self._begun = problem, ends, False
        self._local, self._slides = planners
        self._sampler, self._rng = random
        self._reached: list[Array] = []
        self._said = ""
        free_root = bool(problem.scene.figure.roots) and not holds(problem)
        self._spreads = (0.0,) * free_root + (0.1, 0.3, 1.0)
        self._slides.admit(problem.start)
        self._straight = False

    def shortest(self) -> tuple[list[Array] | None, str]:
        """The shortest of some paths, with shortcuts, and how it was found; or None and why there is none."""
        model, best, most, samples, runs = self._problem.scene.model, None, np.inf, 0, 0
        enough = self._local.samples
        while not runs or (runs < self._local.searches and samples < enough and BUDGET.spent < SEARCHED):
            path, trees = self._path(NEARER * most, np.inf if not runs else enough - samples)
            runs, samples = runs + 1, samples + trees.samples * (runs > 0)
            if path is None:
                break
            if self._straight:
                return path, "the straight motion"
            path = shortcut(model, path, self._local, self._rng)
            if (found := length(model, path)) < most:
                best, most = path, found
        if best is not None:
            return best, f"the shortest of {runs} searches"
        if not self._reached and BUDGET.spent < SEARCHED:
            return None, f"no posture meets the goals: {self._said}"
        return None, "no motion was found within the time limit"

    def _path(self, most: float, samples: float) -> tuple[list[Array] | None, RRTConnect]:
        """A path from the start to an end by new trees, which stay empty where it is straight.

        The trees grow towards at most so many samples, through which a path can be shorter than `most`, radians and
        metres (as in anytime RRTs, Ferguson and Stentz 2006).
        """
        start, model, rounds = self._problem.start, self._problem.scene.model, 0
        self._straight = False
        trees = RRTConnect(self._local, model, start)
        ends = [q for q in self._reached if self._apart(start, q) < most]
        for reached in ends:
            trees.add_end(reached)
        while rounds < samples and (BUDGET.spent < SEARCHED or not self._begun):
            self._begun = True
            if rounds % self._local.rounds == 0 or not ends:
                end = next(self._ends, None)
                if end is None and not ends:
                    break
                if end is not None and end.q is None:
                    self._said = self._said or end.why
                    continue
                if end is not None and end.q is not None:
                    self._slides.admit(end.q)
                    self._reached.append(end.q)
                    if self._apart(start, end.q) < most:
                        ends.append(end.q)
                        if led := self._led(end.q):
                            return led, trees
                        trees.add_end(end.q)
                if not ends:
                    continue
            rounds += 1
            near = ends[self._rng.integers(len(ends))]
            middle = np.asarray(pin.interpolate(model, start, near, self._rng.uniform()))
            sample = self._sampler.near(middle, self._spreads[self._rng.integers(len(self._spreads))])
            if most < np.inf and self._apart(start, sample) + min(self._apart(sample, q) for q in ends) > most:
                continue
            path = trees.grow(sample)
            if path is not None:
                return path, trees
        return None, trees

    def _led(self, end: Array) -> list[Array]:
        """Postures from the start to an end (nq,) without trees, if any: straight, or along things from the end back.

        Most narrow places are around ends, and steps towards the start lead out of them.
        """
        start = self._problem.start
        with within_budget(np.inf):  # it is tried whatever the limit
            way, self._straight = self._local.towards(start, end)
        if self._straight:
            return [start, *way[:-1], end]
        way, met = self._slides.towards(end, start)
        return [start, *way[-2::-1], end] if met else []

    def _apart(self, q: Array, other: Array) -> float:
        return float(np.linalg.norm(pin.difference(self._problem.scene.model, q, other)))


def _smoothed(problem: Problem, local: LocalPlanner, path: list[Array], pace: Pace) -> Plan:
    """The motion along a smooth path beside a free one; along the free one itself where that one fails."""
    figure = problem.scene.figure
    even = resampled(figure.model, path, int(np.clip(length(figure.model, path) / SPACING, 20, 1000)))
    found = None if BUDGET.over else _judged(problem, smooth(figure.model, even, local), pace)
    return found if found is not None and found.solved else _judged(problem, local.settled(even)[0], pace)


def _between(problem: Problem, end: Array) -> Problem:
    """The problem with clearances of pairs that are nearer at an end (nq,) as they are there."""
    result, least = problem.with_start(problem.start), np.array(problem.clearances)
    with problem.borrow() as workspace:
        near = workspace.near(end, problem.clearance + KEPT)
    least[near.number] = np.minimum(least[near.number], np.maximum(near.distance, 0.0))
    result.clearances = least
    return result


def _judged(problem: Problem, path: Array, pace: Pace) -> Plan:
    """The motion along a path (m, nq) as fast as it may be, and what it is worth, from its postures alone."""
    scene = problem.scene
    q, use = Timing(scene.figure, path, pace).within()
    asked, worst = _between(problem, q[-1]), _moved(problem, q)
    for frame in q:  # as far as the first that misses something
        if worst <= KEPT:
            one = assess(asked, frame)
            worst = max(worst, one.limit_violation, one.constraint_violation, one.clearance_violation)
    faults = [
        f"a frame misses what must hold by {worst:.3g} m or rad" if not worst <= KEPT else "",
        f"velocities reach {use.velocity:.3g} of their limits" if not use.velocity <= OVER else "",
        f"accelerations reach {use.acceleration:.3g} of their limit" if not use.acceleration <= OVER else "",
    ]
    if not any(faults):
        motions, sweep = enumerate(pairwise(q), 1), Sweep(scene.model, scene.geometry)
        passed = next((k for k, motion in motions if sweep.first_contact(*motion, tolerance=PASSED) is not None), 0)
        faults.append(f"something is passed through before frame {passed}" if passed else "")
    said = "; ".join(fault for fault in faults if fault)
    return Plan(Clip(scene.figure, q, pace.dt, "plan"), not said, said, length(scene.model, list(q)), worst, *use)
