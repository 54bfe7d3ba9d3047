"""Random postures of a problem, near to one or all over the limits, towards which trees grow."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.figures.self_pairs import random_postures
from wholebody.methods.simplification import still_dofs
from wholebody.problem import Problem
from wholebody.tasks.checks import is_equality

ROOM = 1.0  # m: by which samples move a free root along each axis


def holds(problem: Problem) -> bool:
    """Whether a constraint is an equality, such as a `Hold`, so that most postures near by are not allowed."""
    return any(map(is_equality, problem.constraints))


class Sampler:
    """Draws postures of a problem; what is frozen stays."""

    def __init__(self, problem: Problem, rng: np.random.Generator) -> None:
        self._figure, self._rng, self._held = problem.scene.figure, rng, holds(problem)
        self._frozen = still_dofs(problem)
        self._roots = [joint for joint in self._figure.model.joints if joint.nq == 7]
        self._loose = [joint for joint in self._figure.model.joints if (joint.nq, joint.nv) == (4, 3)]  # carts, balls
        self._drawn: list[Array] = []
        model = self._figure.model
        hinges = (
            [] if self._figure.followers else [j for j in model.joints[1:] if j.shortname().startswith("JointModelR")]
        )
        places = np.array([joint.idx_q for joint in hinges if joint.nq == 1], dtype=np.intp)
        low, high = model.lowerPositionLimit[places], model.upperPositionLimit[places]
        wide = high - low >= 2.0 * np.pi
        self._turning, self._low, self._high = places[wide], low[wide], high[wide]

    def turned(self, q: Array, near: Array) -> Array:
        """The posture q (nq,) with whole turns of hinges, as near to another one as limits let it."""
        found, here, turn = np.array(q), q[self._turning], 2.0 * np.pi
        least, most = np.ceil((self._low - here) / turn), np.floor((self._high - here) / turn)
        turns = np.maximum(least, np.minimum(most, np.round((near[self._turning] - here) / turn)))
        found[self._turning] = here + turn * turns
        return found

    def anywhere(self) -> Array:
        """A random posture (nq,) within limits, whatever is held."""
        if not self._drawn:
            # postures that are drawn at once, which takes a hundredth of drawing each
            self._drawn = list(random_postures(self._figure.model, 256, int(self._rng.integers(2**31))))
        return self._drawn.pop()

    def limb(self, q: Array, dofs: Indices) -> Array:
        """A posture (nq,) of which most of some freedoms (k,) are a part of the way from q to a random one."""
        model, rng = self._figure.model, self._rng
        there = np.asarray(pin.difference(model, q, self.turned(self.anywhere(), q)))
        away, moved = np.zeros(model.nv), dofs[rng.uniform(size=len(dofs)) < 0.8]
        away[moved] = rng.uniform() * there[moved]
        away[self._frozen] = 0.0
        return np.asarray(pin.integrate(model, q, away))

    def near(self, q: Array, spread: float) -> Array:
        """A posture (nq,) whose joints are a fraction of the way from q to a random one; roots within `ROOM`."""
        # where nothing is held, a root is a random share of that away, and turns in half of the postures
        model, rng = self._figure.model, self._rng
        away = spread * np.asarray(pin.difference(model, q, self.turned(self.anywhere(), q)))
        for joint in self._roots:
            here = pin.XYZQUATToSE3(q[joint.idx_q : joint.idx_q + 7])
            turns = not self._held and rng.uniform() < 0.5
            axis = np.array((0.0, 0.0, 1.0)) if rng.uniform() < 0.5 else rng.normal(size=3)
            turn = pin.exp3(rng.uniform(-np.pi, np.pi) * axis / np.linalg.norm(axis)) if turns else np.eye(3)
            far = spread if self._held else 10.0 ** rng.uniform(-1.0, 0.0)
            moved = far * rng.uniform(-ROOM, ROOM, 3)
            there = pin.SE3(turn @ here.rotation, here.translation + moved)
            away[joint.idx_v : joint.idx_v + 6] = pin.log6(here.actInv(there)).vector
        for joint in self._loose:
            away[joint.idx_v : joint.idx_v + 3] = self._loosely(q, joint, spread)
        if self._held:  # a random share of the freedoms stays, so that not all of a body wanders on the way
            away[rng.uniform(size=model.nv) > rng.uniform()] = 0.0
        away[self._frozen] = 0.0
        return np.asarray(pin.integrate(model, q, away))

    def _loosely(self, q: Array, joint: Any, spread: float) -> Array:
        """A random motion (3,) of a planar joint, which is a root on a floor, or of a ball joint."""
        model, rng, there, at = self._figure.model, self._rng, q.copy(), joint.idx_q
        if joint.shortname() == "JointModelPlanar":
            turn = rng.uniform(-np.pi, np.pi) * (not self._held and rng.uniform() < 0.5)
            angle = turn + np.arctan2(q[at + 3], q[at + 2])
            far, spread = (spread if self._held else 10.0 ** rng.uniform(-1.0, 0.0)), 1.0
            there[at : at + 2] += far * rng.uniform(-ROOM, ROOM, 2)
            there[at + 2 : at + 4] = np.cos(angle), np.sin(angle)
        else:
            turned = rng.normal(size=4)
            there[at : at + 4] = turned / np.linalg.norm(turned)
        return np.asarray(spread * pin.difference(model, q, there)[joint.idx_v : joint.idx_v + 3])
