"""Frames of a clip by the tracker: each as near to its original posture as contacts and what is held let it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.methods.qp.method import QP
from wholebody.motion.dips import dip_depth
from wholebody.motion.faults import depth
from wholebody.motion.frame_terms import FrameTerms
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks import Posture
from wholebody.tasks.base import Bound, Constraint, Goal, filled

BACK = 1e-4  # rad, m: a posture this near to the original one is the original one
MOST = 3  # steps of one frame; more = nearer to the original where much is in the way, dearer frames
SHALLOW = 2e-3  # m: a deeper dip passes through something; others are arcs between postures in contact
STEP = 1e-3  # rad, m: a step no longer than this ends a frame


class Follower:
    """Follows the original motion frame by frame.

    Attributes:
        programs: how many quadratic programs were solved.
    """

    def __init__(self, terms: FrameTerms, clearance: float) -> None:
        """Set up on a scene.

        Args:
            terms: original postures, and what is held.
            clearance: least distance of every pair, metres.
        """
        self._terms, self._clearance, self.programs = terms, clearance, 0
        q = terms.scene.figure.clamp(terms.q[0])
        self._problem = Problem(terms.scene, q, goals=[Posture(terms.q[0])], measures=(), clearance=0.0)
        bounds = [term.resolve(terms.scene, q) for term in terms.given if isinstance(term, Bound)]
        still = [bound for bound in bounds if np.isfinite(bound.bounds(State(terms.scene.model), None)).any()]
        self._problem.bounds = tuple(still)
        self._goal = Posture(terms.q[0]).resolve(terms.scene, q)
        self._tracker = QP(restarts=0).tracker(self._problem, terms.dt)
        self._state = State(terms.scene.model)

    def _still(self, number: int) -> tuple[Array, Array]:
        """Least and greatest deviation (nv,) of a frame."""
        low, high, _, _ = self._terms.bounds(number, self._state)
        return low, high

    def frame(self, number: int, q: Array, more: float = 0.0, *, goal: Array | None = None) -> Array:
        """The posture of a frame, begun at a posture (nq,): steps until they are short.

        Args:
            number: of the frame.
            q: (nq,) where the steps begin.
            more: metres that are asked of every pair beyond the clearance.
            goal: (nq,) posture that is followed in place of the original one.
        """
        terms, problem = self._terms, self._problem
        if terms.kept(number):
            return np.array(terms.q[number])
        problem.clearances = np.full_like(problem.clearances, self._clearance + more)
        low, high = self._still(number)
        if (low > -np.inf).any() or (high < np.inf).any():  # what is frozen keeps to the original motion
            model = terms.scene.model
            away = np.asarray(pin.difference(model, terms.q[number], q))
            if ((away < low) | (away > high)).any():
                q = np.asarray(pin.integrate(model, terms.q[number], np.clip(away, low, high)))
        target = terms.q[number] if goal is None else goal
        near = filled(self._goal, target=target, resolved_target=target)
        held = terms.held(number)
        problem.goals = (near, *(term for term in held if isinstance(term, Goal)))
        problem.constraints = tuple(term for term in held if isinstance(term, Constraint))
        for _ in range(MOST):
            step = self._tracker.step(q)
            self.programs += 1
            q = step.q
            if np.abs(step.displacement).max(initial=0.0) <= STEP:
                break
        return q


def keep_back(
    follower: Follower,
    workspace: Workspace,
    q: Array,
    gap: int,
    most: int,
    first: int = 0,
    *,
    cancelled: Callable[[], bool] | None = None,
) -> bool:
    """Keep frames beside a gap on one side of what the motion in it passes, in place, as few as can be.

    Args:
        follower: of the clip.
        workspace: of this run alone.
        q: (n, nq) postures; those that change are replaced.
        gap: the frame before the motion that passes through something.
        most: how many frames may change.
        first: frame of the clip that the first posture belongs to.
        cancelled: asked before each frame; True ends it.

    Returns:
        Whether a way back to the other frames was found; if not, q stays as it is.
    """
    ways = {side: _beside(follower, workspace, q, gap, side, first) for side in (1, -1)}
    found = dict[int, list[Array]]((side, []) for side in ways)
    for _ in range(most):
        for side, way in list(ways.items()):  # in turn, so that the shorter way ends both
            if cancelled is not None and cancelled():
                return False
            posture = next(way, None)
            if posture is None:
                del ways[side]
                continue
            found[side].append(posture.q)
            if posture.joined:
                begin = gap + 1 if side > 0 else gap + 1 - len(found[side])
                q[begin : begin + len(found[side])] = found[side][::side]
                return True
    return False


class _Beside(NamedTuple):
    """A frame on the one side of what is passed.

    Attributes:
        q: (nq,) posture.
        joined: whether the motion to the next frame as it is passes nothing.
    """

    q: Array
    joined: bool


def _beside(follower: Follower, workspace: Workspace, q: Array, gap: int, side: int, first: int) -> Iterator[_Beside]:
    """Frames on the one side of what a motion between two frames passes, as far as they were on the other.

    They follow the original motion from one end of the gap, in contact with what is in the way, until the way from
    there to the next one of q passes nothing. For `side` 1 it is frames after the gap, for -1 frames before it.
    """
    here, frame = (q[gap], gap + 1) if side > 0 else (q[gap + 1], gap)
    while 0 <= frame < len(q):
        there = follower.frame(first + frame, here)
        if max(depth(workspace, there), dip_depth(workspace, here, there)) > SHALLOW:
            return
        here, frame = there, frame + side
        yield _Beside(here, not 0 <= frame < len(q) or dip_depth(workspace, here, q[frame]) <= SHALLOW)
