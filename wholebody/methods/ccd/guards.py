"""Guards: limbs that left their reach cones or ranges of motion are brought back, or else stay at their last values.

Cones and ranges are the constraints `ReachCones` and `RangeOfMotion`, whose values are angles, positive inside. Where
some are violated, Newton's method looks for the least change of the joints that makes them hold: a limb is projected to
the nearest direction inside (Wilhelms and Van Gelder 2001).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.self_pairs import random_postures
from wholebody.figures.state import State
from wholebody.methods.ccd.limbs import Limbs
from wholebody.scene.scene import Scene
from wholebody.tasks.base import Constraint
from wholebody.tasks.range_of_motion import RangeOfMotion, ReachCones
from wholebody.terms.linearisation import ConstraintValues

INWARD = 1e-8  # rad: inside by which limbs are brought back; larger than rounding and what the last step leaves
ROUNDING = 1e-12  # rad
STEPS = 10  # most of Newton's; mostly three


class Kept(NamedTuple):
    """What descents keep."""

    fixed: frozenset[int] = frozenset()  # Pinocchio's indices of joints that must not move, not even to resolve overlap
    cones: tuple[str, ...] | None = None  # names of the reach cones; None for all of the figure's
    ranges: tuple[str, ...] = ()  # names of the ranges of motion


NOTHING_FIXED = Kept()


class Guard:
    """Keeps some limbs in the cones and ranges that their nodes can leave."""

    def __init__(self, scene: Scene, limbs: Limbs, kept: Kept) -> None:
        """Find these cones and ranges."""
        self._limbs, self._state = limbs, State(scene.model)
        self._dofs = np.array([scene.model.joints[joint].idx_v for joint in limbs.joints], dtype=np.intp)
        cones = scene.figure.cones if kept.cones is None else kept.cones
        terms = [*self._kept(scene, ReachCones, tuple(cones)), *self._kept(scene, RangeOfMotion, kept.ranges)]
        self._values = ConstraintValues(terms, self._state.update(scene.figure.neutral)) if terms else None
        self._q: Array = scene.figure.neutral
        self._last: Array | None = None

    def _kept(self, scene: Scene, kind: type[ReachCones | RangeOfMotion], names: tuple[str, ...]) -> list[Constraint]:
        """A constraint with those of some cones or ranges that the nodes can leave; none without any."""
        if not names:
            return []
        term, state = kind(names).resolve(scene, scene.figure.neutral), self._state
        slopes = [term.jacobian(state.update(q))[:, self._dofs] for q in random_postures(scene.model, 3, seed=1)]
        left = np.any(np.array(slopes), axis=(0, 2))
        mine = [name for name, own in zip(names, left, strict=True) if own]
        return [kind(mine).resolve(scene, scene.figure.neutral)] if mine else []

    def inside(self, q: Array) -> bool:
        """Whether all hold at a posture q (nq,); it need not be read."""
        return self._values is None or bool((self._values.at(self._state.update(q)) >= -ROUNDING).all())

    def read(self, q: Array) -> None:
        """Begin at the posture q (nq,), which the limbs have read."""
        self._q = q.copy()
        self._last = self._limbs.values.copy() if self.inside(q) else None

    def keep(self) -> None:
        """Bring the nodes back inside, if possible, and call `limbs.forward` where they moved."""
        if self._values is None or self._holds():
            return
        if not self._projected() and self._last is not None:
            self._retreat(self._last)
        self._limbs.forward()

    def _holds(self) -> bool:
        """Whether all hold at the present values, which are remembered then."""
        self._limbs.write(self._q)
        if not self.inside(self._q):
            return False
        self._last = self._limbs.values.copy()
        return True

    def _projected(self) -> bool:
        """Make what is violated hold by the least change of the nodes, each within its limits; whether all hold."""
        limbs, free = self._limbs, np.ones(len(self._dofs), dtype=bool)
        assert self._values is not None
        violated = np.zeros(len(self._values.at(self._state)), dtype=bool)
        for _ in range(STEPS):
            value, rows = self._values.at(self._state), self._values.rows(self._state)[:, self._dofs]
            violated |= value < -ROUNDING
            way = np.zeros(len(free))
            way[free] = np.linalg.lstsq(rows[violated][:, free], INWARD - value[violated], rcond=1e-6)[0]
            wanted = limbs.values + way
            limbs.values[:] = np.clip(wanted, limbs.lower, limbs.upper)
            free &= limbs.values == wanted  # what a limit stops is left to the others
            if self._holds():
                return True
        return False

    def _retreat(self, last: Array) -> None:
        """Move from the last values inside as far towards the present ones as all holds."""
        wanted = self._limbs.values.copy()
        inside, outside = 0.0, 1.0
        for _ in range(20):  # to a millionth of the motion
            middle = 0.5 * (inside + outside)
            self._limbs.values[:] = last + middle * (wanted - last)
            if self._holds():
                inside = middle
            else:
                outside = middle
        self._limbs.values[:] = last + inside * (wanted - last)
        self._holds()
