"""What holds in every frame of a clip: constraints resolved at each original posture, and bounds on the deviations.

A term that refers to the start refers to the original posture of its own frame: `Hold("left_hand",
relative_to="right_hand")` keeps the grip that each frame has. A grip that overlaps itself is kept beside.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import a, listed
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.motion.clip import between
from wholebody.motion.grips import grip_shifts
from wholebody.motion.measures import MotionBounds
from wholebody.motion.resting_hands import RestingHands, resting_hands
from wholebody.motion.stance import StanceFeet, held_feet, shifts, standing
from wholebody.scene.scene import Scene
from wholebody.tasks import Hold
from wholebody.tasks.base import Bound, Constraint, Goal
from wholebody.tasks.checks import check_rows

HeldTerm = Constraint | Goal
Given = Constraint | Goal | Bound | StanceFeet | RestingHands | MotionBounds


class Miss(NamedTuple):
    """By how much something that is held is missed, metres or radians, and what: "Hold('left_palm')", or ""."""

    by: float
    name: str


class FrameBounds(NamedTuple):
    """Bounds of a frame, radians and metres; infinite for none."""

    # lower and upper: (nv,) least and greatest deviation from the original posture
    lower: Array
    upper: Array
    # slowest and fastest: (nv,) least and greatest motion to the next frame
    slowest: Array
    fastest: Array


@dataclass(frozen=True, eq=False)
class FrameTerms:
    """What holds in the frames of one clip."""

    scene: Scene  # figure and things
    q: Array  # (n, nq) original postures
    dt: float  # seconds from frame to frame
    # the terms as they were given, without `StanceFeet`, `RestingHands` and `MotionBounds`
    given: tuple[Constraint | Goal | Bound, ...]
    stands: tuple[tuple[str, ...], ...]  # for each frame, frames of the feet that stand there and are held
    # for each frame, by how much each of them is held beside where it was (3,), metres
    shifts: tuple[tuple[Array, ...], ...]
    # for the numbers of given terms that hold a frame at another one, in each frame the shift of the grip (n, 3) beside
    # where it was, metres, in the axes of the other one; without those that are not shifted
    grips: Mapping[int, Array] = field(default_factory=dict)
    hands: tuple[tuple[Hold, ...], ...] = ()  # for each frame, what holds the hands that rest there; () for none in any
    sunk: str = ""  # which hands rest too deep inside of what to be held; or ""
    largest: Array | None = None  # (n,) largest deviation of each frame, radians and metres; inf for any
    _held: dict[int, tuple[HeldTerm, ...]] = field(default_factory=dict, init=False, repr=False)
    _feet: dict[int, tuple[Hold, ...]] = field(default_factory=dict, init=False, repr=False)
    _bounds: dict[int, FrameBounds] = field(default_factory=dict, init=False, repr=False)
    _state: State = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_state", State(self.scene.model))

    def held(self, frame: int) -> tuple[HeldTerm, ...]:
        """Constraints and goals of a frame, resolved at its original posture."""
        if frame not in self._held:
            terms: list[HeldTerm] = [term for term in self.asked(frame) if not isinstance(term, Bound)]
            resolved = [term.resolve(self.scene, self.q[frame]) for term in (*terms, *self.feet(frame))]
            self._held[frame] = tuple(resolved)
        return self._held[frame]

    def asked(self, frame: int) -> tuple[Constraint | Goal | Bound, ...]:
        """The given terms of a frame, with grips where they are kept."""
        terms = list(self.given)
        for number, shift in self.grips.items():
            grip = terms[number]
            if isinstance(grip, Hold) and shift[frame].any():
                at = grip.resolve(self.scene, self.q[frame]).kept_at
                terms[number] = replace(grip, at=pin.SE3(at.rotation, at.translation + shift[frame]))
        return tuple(terms)

    @property
    def beside(self) -> float:
        """The largest shift of a grip, metres."""
        return max((float(np.linalg.norm(shift, axis=1).max()) for shift in self.grips.values()), default=0.0)

    def feet(self, frame: int) -> tuple[Hold, ...]:
        """What holds the feet that stand in a frame, where each of them is held, and the hands that rest."""
        if frame not in self._feet:
            hands = self.hands[frame] if self.hands else ()
            found = [replace(hand, at=hand.resolve(self.scene, self.q[frame]).kept_at) for hand in hands]
            figure = self.scene.figure
            state = self._state.update(self.q[frame]) if self.stands[frame] else self._state
            for foot in held_feet(figure, self.stands[frame]):
                at = state.frame(figure.frame_id(foot.frame))
                shift = self.shifts[frame][self.stands[frame].index(foot.frame)]
                found.append(replace(foot, at=pin.SE3(at.rotation, at.translation + shift)))
            self._feet[frame] = tuple(found)
        return self._feet[frame]

    def shift(self, frame: int, joint: int) -> Array:
        """(3,) by how much what stands on a joint, or on those after it, is held beside where it was, metres."""
        model = self.scene.model
        for name, shift in zip(self.stands[frame], self.shifts[frame], strict=True):
            if joint in model.supports[model.frames[self.scene.figure.frame_id(name)].parentJoint]:
                return shift
        return np.zeros(3)

    def bounds(self, frame: int) -> FrameBounds:
        """Bounds of the deviation of a frame, and of its change to the next one."""
        if frame not in self._bounds:
            nv = self.scene.model.nv
            most = np.inf if self.largest is None else self.largest[frame]
            low, high, slow, fast = (np.full(nv, value) for value in (-most, most, -np.inf, np.inf))
            for term in self.given:
                if isinstance(term, Bound):
                    bound, state = term.resolve(self.scene, self.q[frame]), self._state.update(self.q[frame])
                    least, most = bound.bounds(state, None)
                    low, high = np.maximum(low, least), np.minimum(high, most)
                    slower, faster = bound.bounds(state, self.dt)
                    slow = np.maximum(slow, np.where(np.isfinite(least), -np.inf, slower))
                    fast = np.minimum(fast, np.where(np.isfinite(most), np.inf, faster))
            self._bounds[frame] = FrameBounds(low, high, slow, fast)
        return self._bounds[frame]

    def within(self, frame: int, q: Array) -> Array:
        """A copy (nq,) of a posture of a frame, within its bounds and the joint limits; frozen joints are exact."""
        model, original, bounds = self.scene.model, self.q[frame], self.bounds(frame)
        q = np.array(q)
        if np.isfinite(bounds.lower).any() or np.isfinite(bounds.upper).any():
            away = pin.difference(model, original, q)
            if ((away < bounds.lower) | (away > bounds.upper)).any():
                q = np.array(pin.integrate(model, original, np.clip(away, bounds.lower, bounds.upper)))
            still = (bounds.lower == 0.0) & (bounds.upper == 0.0)
            for joint in model.joints[1:] if still.any() else ():
                if still[joint.idx_v : joint.idx_v + joint.nv].all():
                    values = slice(joint.idx_q, joint.idx_q + joint.nq)
                    q[values] = original[values]
        return self.scene.figure.clamp(q)

    def kept(self, frame: int) -> bool:
        """Whether the posture of a frame is to stay as it is."""
        return self.largest is not None and self.largest[frame] == 0.0

    def step_bounds(self, frame: int) -> tuple[Array, Array]:
        """Least and greatest motion (nv,) from a frame to the next one that speed limits allow; see `bounds`."""
        limit, bounds = np.array(self.scene.model.velocityLimit, dtype=float).reshape(-1), self.bounds(frame)
        fastest = np.where(limit > 0.0, np.minimum(limit, 1e9) * self.dt, np.inf)
        return np.maximum(bounds.slowest, -fastest), np.minimum(bounds.fastest, fastest)

    def at(self, times: Array) -> FrameTerms:
        """The same of postures at other times (m,) of the clip, seconds, ascending, as far apart as before."""
        places = np.asarray(times) / self.dt
        nearest = np.clip(np.rint(places).astype(int), 0, len(self.q) - 1)
        stands, shifts = (tuple(each[frame] for frame in nearest) for each in (self.stands, self.shifts))
        frames = np.arange(len(self.q))
        grips = {
            number: np.stack([np.interp(places, frames, axis) for axis in shift.T], axis=1)
            for number, shift in self.grips.items()
        }
        hands = tuple(self.hands[frame] for frame in nearest) if self.hands else ()
        q = between(self.scene.model, self.q, places)
        largest = None if self.largest is None else self.largest[nearest]
        return replace(self, q=q, stands=stands, shifts=shifts, grips=grips, hands=hands, largest=largest)

    def missed(self, frame: int, state: State) -> float:
        """By how much the state, of the posture of a frame, misses what is held there, metres and radians."""
        return max((_miss(term, state) for term in self.held(frame)), default=0.0)

    def worst(self, frame: int, state: State) -> Miss:
        """What the state, of the posture of a frame, misses most of all that is held there, frozen joints included."""
        found = [Miss(_miss(term, state), _label(term)) for term in self.held(frame)]
        terms = [term for term in self.given if isinstance(term, Bound)]
        if terms:
            away = np.asarray(pin.difference(self.scene.model, self.q[frame], state.q))
            original = self._state.update(self.q[frame])
            for term in terms:
                low, high = term.resolve(self.scene, self.q[frame]).bounds(original, None)
                past = np.maximum(low - away, away - high)
                found.append(Miss(float(past.max(initial=0.0)), _label(term)))
        return max(found, key=lambda each: each.by, default=Miss(0.0, ""))

    def past_speed(self, frame: int, q: Array, following: Array) -> float:
        """By what share the motion from a posture (nq,) of a frame to the following one is faster than was given."""
        _, _, slow, fast = self.bounds(frame)
        step = np.asarray(pin.difference(self.scene.model, q, following))
        past, most = np.maximum(slow - step, step - fast), np.where(step < 0.0, -slow, fast)
        over = past > 1e-6  # rad, m in a time step: more than rounding
        return float((past[over] / np.maximum(most[over], 1e-6)).max(initial=0.0))

    @property
    def holds(self) -> bool:
        """Whether something is held."""
        return any(not isinstance(term, Bound) for term in self.given) or any(map(bool, (*self.stands, *self.hands)))


def frame_terms(scene: Scene, q: Array, dt: float, constraints: Iterable[Given], clearance: float = 0.0) -> FrameTerms:
    """Check what is to hold in frames q (n, nq), and find the feet that stand; grips too near are held beside."""
    given: list[Any] = listed(constraints, "avoid: constraints", "[wb.Freeze('root')]")
    feet: list[list[str]] = [[] for _ in q]
    largest: Array | None = None
    rest = RestingHands([])
    for number, term in enumerate(given):
        if isinstance(term, StanceFeet):
            for foot, stand in standing(scene.figure, q, dt, term).items():
                for frame in np.flatnonzero(stand):
                    feet[frame].append(foot)
        elif isinstance(term, RestingHands):
            rest = term
        elif isinstance(term, MotionBounds):
            largest = term.largest
        elif isinstance(term, (Constraint, Goal)):
            resolved = term.resolve(scene, q[0])
            ask = resolved.error if isinstance(resolved, Goal) else resolved.value
            check_rows(f"avoid: constraints[{number}]", resolved, ask, State(scene.model).update(q[0]))
        elif isinstance(term, Bound):
            term.resolve(scene, q[0])
        else:
            raise InputError(
                f"avoid: constraints[{number}] is {a(type(term))}, not a constraint; see wholebody.tasks, or give "
                "wb.motion.StanceFeet()"
            )
    plain = tuple(term for term in given if not isinstance(term, (StanceFeet, RestingHands, MotionBounds)))
    stands = tuple(map(tuple, feet))
    found = {
        number: grip_shifts(scene, q, dt, term, clearance)
        for number, term in enumerate(plain)
        if isinstance(term, Hold) and term.at is None and term.relative_to is not None
    }
    grips = {number: shift for number, shift in found.items() if shift.any()}
    # a hand that a given term holds is left to it
    held = [scene.frame_id(term.frame) for term in plain if isinstance(term, Hold)]
    taken = {scene.model.frames[number].parentJoint for number in held}
    joints = {name: scene.model.frames[scene.frame_id(name)].parentJoint for name in rest.names(scene)}
    hands, sunk = resting_hands(scene, q, dt, [name for name, joint in joints.items() if joint not in taken])
    beside = shifts(scene.figure, q, stands)
    return FrameTerms(scene, q, dt, plain, stands, beside, grips, tuple(hands), sunk, largest)


def _miss(term: HeldTerm, state: State) -> float:
    """By how much a state misses a term, metres and radians."""
    if isinstance(term, Goal):
        return float(np.abs(term.error(state)).max(initial=0.0))
    value = np.atleast_1d(term.value(state))
    return float(np.maximum(term.lower - value, value - term.upper).max(initial=0.0))


def _label(term: HeldTerm | Bound) -> str:
    """A short name of a term: its class and its frame or joints."""
    frame = getattr(term, "frame", None)
    return f"{type(term).__name__}({frame!r})" if isinstance(frame, str) else repr(term)
