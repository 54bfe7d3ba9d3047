"""Attraction to the tracked posture: parts of the figure move towards it in short steps, or joint by joint.

Displaced joints are attracted back in every frame, as far as contact allows (the coach and trainee of
Boulic and others 1997).
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.methods.ccd.overlap_resolution.resolver import OverlapResolver
from wholebody.scene.scene import Scene

LEAST_GAIN = 1e-7  # rad^2: a part that gets nearer to the tracked posture by less than this stays where it is
BLOCKED = 0.4  # a part that gains less than this share of the gain without contact is blocked (2 is all of it)
ARRIVED = 1e-12  # rad^2: a part nearer than this has arrived
LEAST_REACH = 1e-9  # m: of joints that move no point of the figure, such as the last of a link without shape


class Attraction:
    """Moves the chains of one figure, and the remaining joints (the root and trunk) as one more part.

    Attributes:
        parts: degrees of freedom (k,) of each part, and for each the greatest distance of a point of the part, (k,).
        step_length: largest motion of a part's tip in one step, m.
        free: whether the wanted posture overlaps nothing: then a part may move away from it for a while.
        limit: of the work in the resolver's counts; beyond it joints are not tried one by one.
    """

    def __init__(self, scene: Scene, resolver: OverlapResolver) -> None:
        """Find the degrees of freedom of each chain."""
        self._model, self._resolver = scene.model, resolver
        self.step_length, self.limit, self.free = 0.0, 0, False
        self.parts: list[tuple[NDArray[np.intp], Array]] = []
        rest = np.ones(scene.model.nv, dtype=bool)
        for chain in resolver.chains.values():
            joints = [scene.model.joints[joint] for joint in chain.limbs.joints]
            dofs = np.array([joint.idx_v for joint in joints], dtype=np.intp)
            fresh = rest[dofs]
            rest[dofs] = False
            reach = np.maximum(chain.reach, LEAST_REACH)  # steps are divided by it
            self.parts.append((dofs[fresh], reach[fresh]))
        size = max([float(reach.max(initial=0.5)) for _, reach in self.parts], default=0.5)
        others = np.flatnonzero(rest)
        reach = np.full(len(others), 2.0 * size)
        if scene.figure.root == "free":
            reach[others < 3] = 1.0
        self.parts.append((others, reach))

    def step(self, q: Array, wanted: Array, settled: list[bool]) -> tuple[Array, Array] | None:
        """Move every part that is not settled a step towards the wanted posture; None if no part can move.

        Returns:
            The new posture, (nq,), and the share of its motion that each part made, (parts,).
        """
        way = np.asarray(pin.difference(self._model, q, wanted))
        shares = np.zeros(len(self.parts))
        for k, (dofs, reach) in enumerate(self.parts):
            part = way[dofs]
            length = float(np.abs(part) @ reach)
            if not settled[k] and float(part @ part) >= ARRIVED:
                shares[k] = min(1.0, self.step_length / length)
            way[dofs] = part * shares[k]
        if not shares.any():
            return None
        return np.asarray(pin.integrate(self._model, q, way)), shares

    def keep_gains(self, q: Array, trial: Array, wanted: Array, shares: Array, settled: list[bool]) -> Array:
        """Undo changes that brought a part no nearer to the wanted posture; move joints of blocked parts one by one.

        If overlap resolution undoes the attraction, single joints may still be free: a shoulder can move the whole arm
        back, although the wrist cannot straighten yet. A part for which this gains nothing either is settled.
        """
        before = np.asarray(pin.difference(self._model, q, wanted))
        after = np.asarray(pin.difference(self._model, trial, wanted))
        back = np.zeros(self._model.nv, dtype=bool)
        slow = []
        for k, (dofs, _) in enumerate(self.parts):
            old, new = float(before[dofs] @ before[dofs]), float(after[dofs] @ after[dofs])
            if shares[k] and old - new < LEAST_GAIN and not self.free:
                back[dofs] = True
            if shares[k] and old - new < BLOCKED * shares[k] * old:
                slow.append(k)
        if back.any():
            way = np.asarray(pin.difference(self._model, trial, q))
            kept = np.asarray(pin.integrate(self._model, trial, np.where(back, way, 0.0)))
            if not self._resolver.query(kept):
                trial = kept
        for k in slow:
            trial, gained = self._attract_joints(trial, wanted, k)
            settled[k] = not gained
        if len(slow) or back.any():
            self._resolver.query(trial)
        return trial

    def _attract_joints(self, q: Array, wanted: Array, part: int) -> tuple[Array, bool]:
        """Move one joint after the other, from the root outwards, if its motion is free; returns whether any moved."""
        gained = False
        chains = list(self._resolver.chains.values())
        held = {self._model.joints[joint].idx_v for joint in (chains[part].translated if part < len(chains) else ())}
        for dof, reach in zip(*self.parts[part], strict=True):
            if dof in held:  # it would turn a link that was moved out by translation
                continue
            way = float(pin.difference(self._model, q, wanted)[dof])
            if way * way < LEAST_GAIN or self._resolver.counts.work > self.limit:
                continue
            step = np.zeros(self._model.nv)
            step[dof] = min(max(way, -self.step_length / reach), self.step_length / reach)
            trial = np.asarray(pin.integrate(self._model, q, step))
            if not self._resolver.query(trial):
                q, gained = trial, True
        return q, gained
