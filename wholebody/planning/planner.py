"""`wb.plan`: a motion from a posture to another one, or to goals, free of collision and within limits of speed.

ends -> straight motion, else steps along things, else two trees -> shortcuts -> smoothing and timing -> judge
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import assess, violations
from wholebody.base import checks
from wholebody.base.arrays import Array, brief
from wholebody.base.compiled import compile_all, compile_seconds
from wholebody.base.errors import InputError, millimetres
from wholebody.figures.model_check import joint_of
from wholebody.geometry.continuous.sweep import Sweep
from wholebody.methods.control import BUDGET, ctrl_c_ends_all, within_budget
from wholebody.methods.simplification import still_dofs
from wholebody.motion.clip import Clip
from wholebody.planning.ends import answers
from wholebody.planning.sampling import Sampler, holds
from wholebody.planning.search import Search
from wholebody.planning.smoothing import length, refined, resampled, smooth
from wholebody.planning.tightening import tighten
from wholebody.planning.timing import Pace, Timing, least_time, used
from wholebody.planning.tracked_motions import LocalPlanner, TrackedMotions
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.solution import Solution
from wholebody.tasks.base import Bound, Constraint, Goal, Measure
from wholebody.tasks.bounds import Freeze, StepLimit

KEPT = 1e-4  # m, rad: by which limits, constraints and clearances may be missed in a frame
PASSED = 5e-4  # m: overlap between two frames that counts
TOGETHER = 16  # frames that are judged at once: more = cheaper each, later at the end
OVER = 1.001  # of the limits of velocity and acceleration: the last slowing may end a little above them
NEEDED = (  # modules whose loops are compiled or read before the clock starts: the first time takes longer than a plan
    "wholebody.terms.linearisation",
    "wholebody.methods.qp.active_set",
    "wholebody.methods.qp.step_program",
    "wholebody.methods.qp.subproblem",
    "wholebody.methods.qp.plain_chain",
    "wholebody.geometry.proximity",
    "wholebody.geometry.contact_rows",
    "wholebody.geometry.continuous.kept_apart",
    "wholebody.geometry.continuous.moved_pairs",
    "wholebody.geometry.continuous.swept_depth",
    "wholebody.planning.projection_kernel",
)


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
        seconds: of the processor that its thread took, without compiling.

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
    goal: Array | str | Goal | Solution | Sequence[Array | str | Solution] | Iterable[Goal],
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
        goal: (nq,) posture at which it ends, the name of one, several such as those of `wb.solutions`, at one
            of which it ends, or goals that its end meets.
        constraints: what holds throughout, such as `wb.Hold("left_foot")`, as in a `wb.Problem`.
        clearance: least distance of every pair, metres; pairs that are nearer at an end may be as near on the way.
        pace: limits of velocity and acceleration, and the time step; None for `wb.planning.Pace()`.
        seed: of the random postures.
        time_limit: seconds of the processor that the caller's thread may take, but for compiling, the judgement too; at
            least 0.1. Free roots and planar joints are sampled within a metre of the line between the ends.

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
    with ctrl_c_ends_all(), within_budget(max(limit, 0.1)):  # s: the straight motion of an arm takes less
        problem = Problem(scene, start, goals=goals, constraints=constraints, clearance=clearance)
        if any(isinstance(bound, StepLimit) for bound in problem.bounds):
            raise InputError("plan: a StepLimit bounds no plan; give pace=wb.planning.Pace(velocity=1.0)")
        _check_end(problem, problem.start, "the start")
        sampler = Sampler(problem, rng)
        ends = answers(problem, sampler) if goals else iter([(q, "") for q in _postures(problem, goal)])
        judge = _Judge(problem, pace)
        found = None
        with problem.borrow() as workspace:
            tracked = not holds(problem) and bool(problem.bounds or scene.figure.followers)
            slides = TrackedMotions(problem, workspace)
            local: LocalPlanner = slides if tracked else slides.geodesics
            search = Search(problem, judge.in_time, (local, slides), ends, (sampler, rng))
            while found is None or not (found.solved or BUDGET.over):
                path, message = search.shortest()
                if path is None:
                    break
                found = _smoothed(judge, local, path)
                if found.solved and local is slides:
                    found = _tighter(judge, slides, path, found)
    if found is None:
        found = Plan(Clip(scene.figure, problem.start[None], pace.dt, "plan"), False, message)
    return replace(found, message=message if found.solved else found.message, seconds=_computed() - began)


def _computed() -> float:
    """Processor's time of this thread without compiling, seconds."""
    return time.thread_time() - compile_seconds("thread_time")


def _goals(goal: Any) -> tuple[Goal, ...]:
    """The goals, where these are given; none for a posture."""
    if isinstance(goal, Goal):
        return (goal,)
    measures = [one for one in (goal if isinstance(goal, (list, tuple)) else [goal]) if isinstance(one, Measure)]
    if measures:
        raise InputError(
            f"plan: goal has {checks.a(type(measures[0]))}, and a plan takes no measures; give a posture of wb.solve"
        )
    if isinstance(goal, (str, np.ndarray)) or not isinstance(goal, Iterable):
        return ()
    listed = tuple(goal)
    if not listed:
        raise InputError("plan: goal is empty; give goals or a posture")
    return listed if any(isinstance(one, Goal) for one in listed) else ()


def _postures(problem: Problem, goal: Any) -> list[Array]:
    """The postures (nq,) at which the motion may end, the nearest to the start first."""
    figure, model, found = problem.scene.figure, problem.scene.model, list[Array]()
    listed = isinstance(goal, Sequence) or (isinstance(goal, np.ndarray) and goal.ndim > 0)
    first = goal[0] if listed and len(goal) and not isinstance(goal, str) else 0.0
    several = isinstance(first, (Sequence, np.ndarray, Solution))
    for k, one in enumerate(goal if several else [goal]):
        q = one.q if isinstance(one, Solution) else figure.posture(one) if isinstance(one, str) else one
        what = f"goal[{k}]" if several else "the goal"
        found.append(np.array(checks.posture(q, figure.model.nq, f"plan: {what}"), dtype=float))
        _check_end(problem, found[-1], what)
    return sorted(found, key=lambda q: float(np.linalg.norm(pin.difference(model, problem.start, q))))


def _check_end(problem: Problem, q: Array, what: str) -> None:
    judged, scene = assess(problem, q), problem.scene
    if not judged.limit_violation <= KEPT:
        limits = scene.figure.limits
        here = q[limits.idx_q]
        most = int(np.argmax(np.maximum(limits.lower - here, here - limits.upper)))
        joint = scene.model.names[joint_of(scene.model, int(limits.idx_v[most]))]
        raise InputError(
            f"plan: at {what} {joint} is {here[most]:.4g}, beyond its limits {limits.lower[most]:.4g} and "
            f"{limits.upper[most]:.4g}; give figure.clamp(q) for the nearest posture within limits"
        )
    if not judged.penetration <= KEPT:
        deepest = [scene.piece_owner[piece] for piece in scene.contacts(q, 0.0).pair[:1].ravel().tolist()]
        who, depth = " and ".join(deepest) or "things", millimetres(judged.penetration)
        raise InputError(f"plan: at {what} {who} overlap by {depth}; give a posture of wb.solve")
    if not judged.constraint_violation <= KEPT:
        state = scene.state(q)
        values = [(term, term.value(state)) for term in problem.constraints]
        misses = [np.maximum(term.lower - value, value - term.upper).max(initial=0.0) for term, value in values]
        worst = int(np.argmax(misses))
        raise InputError(
            f"plan: {what} misses {values[worst][0]!r} by {misses[worst]:.3g} m or rad; give a posture of wb.solve"
        )
    if not (by := _moved(problem, q[None])) <= KEPT:
        raise InputError(f"plan: {what} is {by:.3g} m or rad beyond what is frozen at the start")


def _moved(problem: Problem, q: Array) -> float:
    """By how much postures (n, nq) move what is frozen, radians and metres."""
    still, model = still_dofs(problem), problem.scene.model
    if not still:
        return 0.0
    return float(np.max([np.abs(pin.difference(model, problem.start, each)[still]).max() for each in q]))


def _smoothed(judge: _Judge, local: LocalPlanner, path: list[Array]) -> Plan:
    """The motion along a smooth path beside a free one; along the free one itself where that one fails.

    That has corners, so where a curve through it fails too, the motion rests at each of them.
    """
    model = judge.problem.scene.model
    count = int(np.clip(length(model, path) / local.spacing, 20, 1000))
    left = BUDGET.left
    # a motion that is not smoothed to its end lasts so much longer that there is no time to judge it
    with judge.in_time(path, least=0.45):
        even, _ = local.settled(refined(model, path, count))
        smoothed = smooth(model, even, local)
    found = judge.judged([smoothed], local)
    judge.took = left - BUDGET.left
    if not (found.solved or BUDGET.over):
        found = judge.judged([even], local)
        if not (found.solved or BUDGET.over):
            # 12 postures of each straight part; more: sooner at the end, dearer
            parts = [local.settled(resampled(model, pair, 12))[0] for pair in pairwise(path)]
            found = judge.judged(parts, local)
    return found


def _tighter(judge: _Judge, slides: TrackedMotions, path: list[Array], found: Plan) -> Plan:
    """A motion along a path drawn tight, in the time that is left; the one that was found where it is no longer.

    Steps cost so much that a motion is found first, and made shorter afterwards.
    """
    model = judge.problem.scene.model
    # what is drawn tight takes no longer until it is judged; the last program ends late
    with within_budget(max(0.5 * BUDGET.left - judge.took, 1e-9)):
        tight = [] if BUDGET.over else tighten(model, path, slides, slides)
    if not tight or length(model, tight) > 0.98 * length(model, path):
        return found
    better = _smoothed(judge, slides, tight)
    return better if better.solved and better.length < found.length else found


class _Judge:
    """Judges motions from their postures alone."""

    def __init__(self, problem: Problem, pace: Pace) -> None:
        self.problem, self._pace = problem, pace
        self.took = 0.0  # s: that a path took from here to its judgement
        scene, spent = problem.scene, list[float]()
        self._sweep = Sweep(scene.model, scene.geometry, scene.pair_table)
        beside = np.asarray(pin.integrate(scene.model, problem.start, np.full(scene.model.nv, 1e-3)))
        for _ in range(3):  # the least, as a busy machine takes several times as long now and then
            began = _computed()
            violations(problem, np.array([problem.start] * 4))
            self._sweep.first_contact(problem.start, beside)
            spent.append(_computed() - began)
        self._frame = min(spent)  # s: of a frame that is near more things, and of the sweep to the next one

    def in_time(self, path: list[Array], share: float = 1.0, least: float = 0.2) -> AbstractContextManager[None]:
        """Inside it the budget ends early enough to judge a motion along postures (nq,), of half a second at least."""
        # smooth motions take twice as long as they have to
        seconds = 0.6 + 2.0 * least_time(self.problem.scene.figure, path, self._pace)
        left, judging = BUDGET.left, self._frame * seconds / self._pace.dt
        # shortcuts through a long path make it shorter, so that they have some time in any case
        return within_budget(share * max(left - judging, least * left, 1e-9))

    def judged(self, parts: Sequence[Array], local: LocalPlanner) -> Plan:
        """The motion along parts (m, nq) of a path as fast as the limits allow, each from rest to rest; its figures."""
        scene, pace = self.problem.scene, self._pace
        # the last posture of a part is the first of the next one: a step of rest, in which no acceleration adds up
        # what is frozen is judged by its place
        own = [bound for bound in self.problem.bounds if not isinstance(bound, Freeze)]
        q = np.concatenate([Timing(scene.figure, part, pace, own).within(local.corrected) for part in parts])
        use = used(scene.figure, q, pace, own)
        asked, worst = self._between(q[-1]), _moved(self.problem, q)
        for first in range(0, len(q), TOGETHER):  # as far as the first that misses something
            if not worst <= KEPT or BUDGET.over:
                break
            worst = max(worst, float(violations(asked, q[first : first + TOGETHER]).max()))
        faults = [
            f"a frame misses what must hold by {worst:.3g} m or rad" if not worst <= KEPT else "",
            f"velocities reach {use.velocity:.3g} of their limits" if not use.velocity <= OVER else "",
            f"accelerations reach {use.acceleration:.3g} of their limit" if not use.acceleration <= OVER else "",
            f"steps from frame to frame reach {use.step:.3g} of what a bound lets them" if not use.step <= OVER else "",
        ]
        late = BUDGET.over
        if not (late or any(faults)):
            sweep = self._sweep
            free = (not BUDGET.over and sweep.first_contact(*pair, tolerance=PASSED) is None for pair in pairwise(q))
            passed = next((k for k, kept in enumerate(free, 1) if not kept), 0)
            faults.append(f"something is passed through before frame {passed}" if passed else "")
            late = BUDGET.over
        if late:
            faults = ["the time limit ended the judgement of a motion"]
        said = "; ".join(fault for fault in faults if fault)
        return Plan(
            Clip(scene.figure, q, pace.dt, "plan"), not said, said, length(scene.model, list(q)), worst, *use[:2]
        )

    def _between(self, end: Array) -> Problem:
        """The problem with clearances of pairs that are nearer at an end (nq,) as they are there."""
        problem = self.problem
        result, least = problem.with_start(problem.start), np.array(problem.clearances)
        with problem.borrow() as workspace:
            near = workspace.near(end, problem.clearance + KEPT)
        least[near.number] = np.minimum(least[near.number], np.maximum(near.distance, 0.0))
        result.clearances = least
        return result
