"""Removal of overlap from frame to frame: the posture shown is as near to the tracked one as contact allows.

Each frame goes from the last posture without overlap towards the tracked one, in steps short enough that what they
overlap is shallow, and every step is pushed out again by the loop of `remover`. So the joints are drawn to the tracked
ones in every frame, also at rest (the coach and trainee of Boulic and others 1997), limbs slide along what stops them,
and the global penetration is asked only where it is a good estimate. A step that cannot be pushed out is shortened by
interpolation with the last posture without overlap (algorithm 1, step 4, of Schmidl and Lin).
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.errors import InputError
from wholebody.methods.ccd.passing import jump
from wholebody.methods.ccd.remover import Remover, Tally
from wholebody.scene import Scene

Array = NDArray[np.float64]

STEP = 0.03  # m: farthest that a chain's tip is drawn at once; half of a forearm's width
SMALL_STEP = 0.006  # m: where steps of that length lead around a bulge that the straight way cuts
STEPS = 8  # most steps of one frame
ENOUGH = 55  # looks and goals after which a frame makes no further step, and the next one goes on: some 4 ms
LEAST = 15  # looks and goals for small steps, where larger ones led nowhere straight
TOO_MANY = 20  # looks and goals beyond these after which no chain has another turn
HALVINGS = 7  # of an interpolation: a step of 3 cm to a quarter of a millimetre
LEAST_GAIN = 1e-7  # rad^2: a chain that gets no nearer than this to the tracked posture stays where it is
HELD_UP = 0.4  # a part that gains less than this share of what drawing alone would have is held up (2 is all of it)
SHAKES = (0.02, 0.05, 0.1, 0.2)  # rad: of a posture that things came upon and that no joint's best value frees
APART = 0.02  # m: how far a tip moves between two looks at the straight way from one shown posture to the next
MOST_LOOKS = 5
DIP = 4e-4  # m: how deep it may go in there
ARRIVED = 1e-12  # rad^2: a chain this near is there


@dataclass(frozen=True)
class OverlapResult:
    """A posture without overlap, and what it took.

    Attributes:
        q: (nq,) the posture to show.
        iterations: goals that cyclic coordinate descent was given.
        joints: joints that took part.
        pairs: different pairs of pieces that overlapped on the way.
        contact_seconds: time of contact queries.
        ik_seconds: time of cyclic coordinate descent.
        fell_back: interpolation with the last posture without overlap was needed.
        deepest: deepest overlap left, metres.
        swept: the straight way from the posture shown before was swept and goes into nothing.
    """

    q: Array
    iterations: int
    joints: int
    pairs: int
    contact_seconds: float
    ik_seconds: float
    fell_back: bool
    deepest: float
    swept: bool


def remove_overlap(
    scene: Scene, q_free: Array, q_wanted: Array, rng: np.random.Generator, *, steps: int = STEPS
) -> OverlapResult:
    """The posture nearest to the wanted one that this frame can reach without overlap.

    Args:
        scene: figure and things. What was prepared for it is kept from call to call.
        q_free: (nq,) the last posture without overlap: the one shown before.
        q_wanted: (nq,) the tracked posture. It may be in anything; limits and cones are kept for it.
        rng: of the order of the chains; the same seed gives the same answer.
        steps: most steps of 3 cm that the frame may take; what is left waits for the next frame.

    Returns:
        The posture, within limits and reach cones and never NaN. Where things moved onto `q_free`, that is removed
        first; `deepest` says what could not be.

    Raises:
        InputError: a posture of the wrong shape, or a value that is not finite.
    """
    checked = [_posture(scene, q, what) for q, what in ((q_free, "q_free"), (q_wanted, "q_wanted"))]
    if scene not in _FRAMES or _FRAMES[scene].revision != scene.revision:
        _FRAMES[scene] = Frames(scene)
    return _FRAMES[scene].remove(checked[0], checked[1], rng, steps)


class Frames:
    """Removal of overlap from frame to frame in one scene."""

    def __init__(self, scene: Scene, remover: Remover | None = None) -> None:
        """Prepare the chains, and which degrees of freedom are of which."""
        self.revision = scene.revision
        self._model, self._figure, self._proximity = scene.model, scene.figure, scene.proximity
        self._remover = Remover(scene, exact=False) if remover is None else remover
        self._sweeper = scene.sweeper
        self._parts: list[tuple[NDArray[np.intp], Array]] = []
        rest = np.ones(scene.model.nv, dtype=bool)
        for chain in self._remover.chains.values():
            joints = [scene.model.joints[joint] for joint in chain.limbs.joints]
            dofs = np.array([joint.idx_v for joint in joints], dtype=np.intp)
            fresh = rest[dofs]
            rest[dofs] = False
            self._parts.append((dofs[fresh], np.array(chain.reach)[fresh]))
        size = max([float(reach.max(initial=0.5)) for _, reach in self._parts], default=0.5)
        others = np.flatnonzero(rest)
        reach = np.full(len(others), 2.0 * size)
        if scene.figure.root == "free":
            reach[others < 3] = 1.0
        self._parts.append((others, reach))

    def remove(self, q_free: Array, q_wanted: Array, rng: np.random.Generator, steps: int = STEPS) -> OverlapResult:
        """See `remove_overlap`."""
        remover = self._remover
        remover.tally = Tally()
        wanted = remover.into_cones(self._figure.clamp(q_wanted))
        self._fell_back = self._swept = False
        q, overlaps = remover.separate(q_free, rng, TOO_MANY)
        pushed = remover.tally.iterations > 0
        for size in SHAKES if overlaps else ():
            shaken, still = remover.separate(self._shaken(q_free, size, rng), rng, remover.tally.work + TOO_MANY)
            if not still:
                q, overlaps = shaken, still
                break
        if overlaps:
            return self._result(q if remover.look(wanted) else wanted)
        before = self._proximity.placements.copy()
        if not remover.look(wanted) and not self._jumps(before, q, wanted) and self._clear(q, wanted):
            self._swept &= not pushed
            return self._result(wanted)
        self._limit = remover.tally.work + ENOUGH
        for self._step in (STEP, SMALL_STEP):
            self._limit = max(self._limit, remover.tally.work + LEAST)
            shown = self._straight(self._approach(q, wanted, before, rng, steps))
            if shown is not None:
                self._swept &= not pushed
                return self._result(shown)
        self._swept = False
        return self._result(q)

    def _approach(self, q: Array, wanted: Array, before: Array, rng: np.random.Generator, steps: int) -> list[Array]:
        """From a free posture towards the wanted one, step by step: the postures on the way."""
        remover = self._remover
        settled = [False] * len(self._parts)
        way = [q]
        for _ in range(steps):
            if remover.tally.work > self._limit:
                break
            drawn = self._draw(q, wanted, settled)
            if drawn is None:
                break
            trial, overlaps = remover.separate(drawn[0], rng, self._limit + TOO_MANY)
            if overlaps:
                trial = self._interpolate(q, trial)
            if self._jumps(before, q, trial):
                trial = self._interpolate(q, self._hit)
            q = self._keep_gains(q, trial, wanted, drawn[1], settled)
            way.append(q)
            before = self._proximity.placements.copy()
        return way

    def _straight(self, way: list[Array]) -> Array | None:
        """The last posture of the way to which the first can go straight, as it will be shown, without dipping in."""
        return next((q for q in way[:0:-1] if self._clear(way[0], q)), None)

    def _clear(self, q0: Array, q1: Array) -> bool:
        """Whether the straight way between two shown postures does not dip in; looks are cheap, the sweep is sure."""
        way = np.abs(np.asarray(pin.difference(self._model, q0, q1)))
        length = max(float(way[dofs] @ reach) for dofs, reach in self._parts)
        looks = min(int(length / APART), MOST_LOOKS)
        for k in range(looks):
            self._remover.look(np.asarray(pin.interpolate(self._model, q0, q1, (k + 1) / (looks + 1))))
            if self._remover.deepest > DIP:
                return False
        self._swept = self._sweeper.first_contact(q0, q1, None, 2.0 * DIP) is None
        return self._swept

    def _shaken(self, q: Array, size: float, rng: np.random.Generator) -> Array:
        """Copy of a posture q (nq,) with its joints moved at random: a straight arm pushed along itself must bend."""
        step = size * rng.normal(size=self._model.nv)
        step[self._parts[-1][0]] = 0.0
        return self._remover.into_cones(self._figure.clamp(np.asarray(pin.integrate(self._model, q, step))))

    def _draw(self, q: Array, wanted: Array, settled: list[bool]) -> tuple[Array, Array] | None:
        """Draw every part that is not settled a step towards the wanted posture; None where none is left to draw.

        Returns:
            The posture drawn, (nq,), and the share of its way that each part was drawn, (parts,).
        """
        way = np.asarray(pin.difference(self._model, q, wanted))
        shares = np.zeros(len(self._parts))
        for k, (dofs, reach) in enumerate(self._parts):
            part = way[dofs]
            length = float(np.abs(part) @ reach)
            if not settled[k] and float(part @ part) >= ARRIVED:
                shares[k] = min(1.0, self._step / length)
            way[dofs] = part * shares[k]
        if not shares.any():
            return None
        return np.asarray(pin.integrate(self._model, q, way)), shares

    def _keep_gains(self, q: Array, trial: Array, wanted: Array, shares: Array, settled: list[bool]) -> Array:
        """Undo what brought a part no nearer to the wanted posture, and draw joints one by one where a part is held up.

        Where pushing undoes what drawing did, single joints may still be free: a shoulder that draws the whole arm
        back, although the wrist cannot straighten yet. A part for which this gains nothing either is settled.
        """
        before = np.asarray(pin.difference(self._model, q, wanted))
        after = np.asarray(pin.difference(self._model, trial, wanted))
        back = np.zeros(self._model.nv, dtype=bool)
        slow = []
        for k, (dofs, _) in enumerate(self._parts):
            old, new = float(before[dofs] @ before[dofs]), float(after[dofs] @ after[dofs])
            if shares[k] and old - new < LEAST_GAIN:
                back[dofs] = True
            if shares[k] and old - new < HELD_UP * shares[k] * old:
                slow.append(k)
        if back.any():
            way = np.asarray(pin.difference(self._model, trial, q))
            kept = np.asarray(pin.integrate(self._model, trial, np.where(back, way, 0.0)))
            if not self._remover.look(kept):
                trial = kept
        for k in slow:
            trial, gained = self._draw_joints(trial, wanted, k)
            settled[k] = not gained
        if len(slow) or back.any():
            self._remover.look(trial)
        return trial

    def _draw_joints(self, q: Array, wanted: Array, part: int) -> tuple[Array, bool]:
        """Draw one joint after the other, from the root outwards, where that is free; whether any moved."""
        gained = False
        for dof, reach in zip(*self._parts[part], strict=True):
            way = float(pin.difference(self._model, q, wanted)[dof])
            if way * way < LEAST_GAIN or self._remover.tally.work > self._limit + TOO_MANY:
                continue
            step = np.zeros(self._model.nv)
            step[dof] = min(max(way, -self._step / reach), self._step / reach)
            trial = np.asarray(pin.integrate(self._model, q, step))
            if not self._remover.look(trial):
                q, gained = trial, True
        return q, gained

    def _interpolate(self, free: Array, q: Array) -> Array:
        """The last free posture on the way from a free one, by halving."""
        self._fell_back = True
        inside, outside = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = 0.5 * (inside + outside)
            if self._remover.look(np.asarray(pin.interpolate(self._model, free, q, middle))):
                outside = middle
            else:
                inside = middle
        result = np.asarray(pin.interpolate(self._model, free, q, inside))
        self._remover.look(result)
        return result

    def _jumps(self, before: Array, q0: Array, q1: Array) -> bool:
        """Whether the motion passes through something; `_hit` is then where it meets it first."""
        remover = self._remover
        hit = jump(remover.scene, before, self._proximity.placements, q0, q1, ~remover.overlapping)
        if hit is not None:
            self._hit = hit.q
        return hit is not None

    def _result(self, q: Array) -> OverlapResult:
        tally = self._remover.tally
        self._remover.look(q)
        return OverlapResult(
            q=q,
            iterations=tally.iterations,
            joints=len(tally.joints),
            pairs=len(tally.pairs),
            contact_seconds=tally.contact_seconds,
            ik_seconds=tally.ik_seconds,
            fell_back=self._fell_back,
            deepest=self._remover.deepest,
            swept=self._swept,
        )


def _posture(scene: Scene, q: Array, what: str) -> Array:
    posture = np.asarray(q, dtype=float)
    if posture.shape != (scene.model.nq,) or not np.isfinite(posture).all():
        raise InputError(f"{what} is ({scene.model.nq},) finite numbers; got shape {posture.shape}")
    return np.asarray(pin.normalize(scene.model, posture))


_FRAMES: WeakKeyDictionary[Scene, Frames] = WeakKeyDictionary()
