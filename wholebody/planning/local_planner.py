"""Local planners: motions from one posture towards another that are free of collision throughout.

Without constraints a motion is a geodesic. It advances by as much as no pair can lose its distance (conservative
advancement, Mirtich 1996). Where something is held, steps of it are projected (`projected_motions`). With other
constraints a motion consists of steps of the QP tracker, which slide along what is in the way (`tracked_motions`).
"""

from __future__ import annotations

from itertools import pairwise
from typing import ClassVar, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.base.errors import InputError
from wholebody.geometry.continuous.kept_apart import kept_apart
from wholebody.geometry.continuous.motion_bounds import largest_approach, pair_kinds
from wholebody.methods.control import BUDGET
from wholebody.planning.contact_values import joined_contacts
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.terms.linearisation import ConstraintValues

MARGIN = 2e-3  # m: distance that motions keep beyond the clearance, where their ends do; larger = fewer queries
NOISE = 1e-5  # m: by which distances of one posture differ from query to query
MISSED = 5e-5  # m, rad: by which motions may miss clearances and constraints; a frame may by twice as much
BENT = 4e-4  # m: by which what is near at one end alone may come nearer between two postures; sweeps count 0.5 mm
INSIDE = 5e-3  # rad, m: by which postures are within the bounds of constraints, where ends are; motions are curved


class Seen(NamedTuple):
    """What is seen at a posture that keeps the distances."""

    room: Array  # (pairs,) by how much distances exceed the least that motions keep, metres
    placed: Array  # (n, 4, 3) where the pieces are


class Kept(NamedTuple):
    """What is kept at a posture."""

    sides: Array  # (2, c) of the values of constraints
    room: Array  # (pairs,) beyond the least distances that motions keep, metres


class Geodesics:
    """Geodesics of Pinocchio, for figures that hold nothing."""

    searches: ClassVar[int] = 12  # how many paths are looked for, of which the shortest counts; more = shorter, later
    samples: ClassVar[int] = 600  # of trees that look for a shorter path after the first; more = shorter paths, later
    rounds: ClassVar[int] = 50  # samples of trees until they get another end
    tries: ClassVar[int] = 30  # shortcuts in a row that fail; more = shorter paths, later
    spacing: ClassVar[float] = 0.03  # rad, m: between postures that are smoothed; smaller = nearer to the path, dearer
    bent: ClassVar[float] = 0.0  # m: by which pairs that are near at an end may come nearer between two postures

    def __init__(self, problem: Problem, workspace: Workspace) -> None:
        self._workspace, self._model = workspace, workspace.model
        self._known: dict[tuple[bytes, bool], Seen | None] = {}
        self._clearance = problem.clearance
        self.partial = True  # whether one joint may move in another way than before, and all others as they did
        self._least = np.array(problem.clearances)
        self._asked = 0.02 + float(self._least.max(initial=0.0))  # m: of queries; larger: fewer and dearer ones
        pieces = workspace.geometry.geometryObjects
        centres = np.array([np.linalg.norm(piece.placement.translation) for piece in pieces])
        # of every kind of pairs by every freedom
        pairs, self._kind = pair_kinds(workspace.table)
        self._approach = np.asarray(largest_approach(workspace.table, centres, np.eye(self._model.nv), pairs))
        self.terms = terms = joined_contacts(problem.constraints, workspace)
        state = workspace.state.update(problem.start)
        self._values = ConstraintValues(terms, state)
        each = [np.broadcast_arrays(term.lower, term.upper, term.value(state))[:2] for term in terms]
        sides, inwards = np.hstack([np.zeros((2, 0)), *each]), np.array([[1.0], [-1.0]])
        room = np.full(len(self._least), MARGIN)
        # what a constraint lets touch is as near as that says, and between two postures as near as at an end
        brought = frozenset(pair for term in problem.constraints for pair in term.touching)
        touching = problem.scene.built.between(brought) if brought else np.zeros(len(room), dtype=bool)
        self._least[touching], room[touching] = -MISSED - self.bent, MISSED + self.bent - 2.0 * NOISE
        self._resting = ~touching  # near at all ends
        self._bends = np.where(touching, self.bent, 0.0)  # m: by how much nearer pairs may come
        self._kept = Kept(sides + INSIDE * inwards, room)
        self._followed = Kept(sides - MISSED * inwards, 0.5 * room)
        unbounded = np.flatnonzero(~np.isfinite(self._approach).all(axis=1))
        if len(unbounded):
            names = [workspace.owners[piece] for piece in pairs[unbounded[0]]]
            raise InputError(
                f"plan: how much a motion brings {names[0]} and {names[1]} together has no bound; attach a box in "
                "place of a half-space, and give limits to what slides"
            )
        # a radius that is larger by a metre makes way as what turns does
        wider = np.asarray(largest_approach(workspace.table, centres + 1.0, np.eye(self._model.nv), pairs))
        self._turning = np.where(wider - self._approach > 1e-9, wider - self._approach, 0.0)
        self._bending = np.where(self._turning > 0.0, 1.0, 2.0) * self._approach
        joints, supports = workspace.table.joint[pairs], [set(s) for s in self._model.supports]
        carried = [(a in supports[b], b in supports[a]) for a, b in joints.tolist()]
        # as a piece sees another one that it does not carry, twice as much
        self._views = np.where(np.array(carried).reshape(-1, 2), 0.25, 0.5)
        # a freedom counts as moving a point by 50 mm, a radian or metre, at least
        levers = np.maximum(self._approach.max(axis=0, initial=0.0), 0.05)
        # shares: (nv,) by which freedoms count in the distance of two postures, as far as they move a point
        self.shares = levers / levers.max()

    def admit(self, q: Array) -> None:
        """Let motions be as near to things as the posture q (nq,) is, which is an end of the whole motion."""
        self._known.clear()
        near = self._workspace.near(q, self._clearance + MARGIN + NOISE)
        number, distance = near.number, near.distance - NOISE
        required = np.minimum((self._least + self._kept.room)[number], distance)
        # nothing is nearer between two postures than at an end, but for what a frame may miss; what rests may be
        beside = np.ones(len(self._least), dtype=bool)
        beside[number] = False
        left = self._resting & beside & (self._bends > BENT)
        self._resting &= ~beside
        self._least[left] += self.bent - BENT
        self._kept.room[left] -= self.bent - BENT
        self._followed.room[left] = 0.5 * self._kept.room[left]
        self._bends[left], self._bends[self._resting] = BENT, self.bent
        passing = number[~self._resting[number]]
        self._bends[passing] = np.maximum(self._bends[passing], min(BENT, self.bent))
        self._least[number] = np.minimum(self._least[number], distance - MISSED - self._bends[number])
        self._kept.room[number] = required - self._least[number]
        self._followed.room[number] = 0.5 * self._kept.room[number]
        values = self._values.at(self._workspace.state)
        for kept in (self._kept, self._followed):
            kept.sides[0] = np.minimum(kept.sides[0], values - NOISE)
            kept.sides[1] = np.maximum(kept.sides[1], values + NOISE)

    @property
    def sides(self) -> Array:
        """(2, c) least and largest values of constraints at postures of paths."""
        return self._kept.sides

    def projected(self, q: Array) -> Array:
        """The posture (nq,) near q that meets what is held; q itself here, as nothing is."""
        return q

    def corrected(self, q: Array) -> Array:
        """A frame (nq,) of a motion, as near to what is held as it may be; q itself here, as nothing is."""
        return q

    def free(self, q: Array) -> bool:
        """Whether a posture (nq,) keeps the distances."""
        return self._seen(q) is not None

    def towards(self, q: Array, target: Array) -> tuple[list[Array], bool]:
        """Postures (nq,) of the motion from q towards a target (nq,), without q, and whether it gets there."""
        motion, postures = np.asarray(pin.difference(self._model, q, target)), list[Array]()
        parts, seen, here = self._parts(motion), None, q
        for part in range(1, parts + 1):
            there = target if part == parts else np.asarray(pin.integrate(self._model, q, part / parts * motion))
            ahead = self._seen(there)  # most motions end here, so q is looked at afterwards
            seen = self._seen(q) if ahead is not None and seen is None else seen
            if not self._joins(here, motion / parts, seen, ahead):
                return postures, False
            postures.append(there)
            here, seen = there, ahead
        return postures, True

    def joined(self, q: Array, target: Array, most: float) -> list[Array]:
        """Postures (nq,) of a motion from q to a target (nq,), without q, no longer than `most`; else none."""
        motion = np.asarray(pin.difference(self._model, q, target))
        if np.linalg.norm(motion) > most or not self._joins(q, motion, self._seen(q), self._seen(target)):
            return []
        parts = self._parts(motion)
        return [*(np.asarray(pin.integrate(self._model, q, k / parts * motion)) for k in range(1, parts)), target]

    def through(self, path: Array) -> list[Array]:
        """Postures of a path (n, nq) without the first, where all motions between are free and allowed; else none."""
        seen = self._seen(path[0])
        for q, there in pairwise(path):
            ahead = self._seen(there)
            if not self._joins(q, np.asarray(pin.difference(self._model, q, there)), seen, ahead):
                return []
            seen = ahead
        return list(path[1:])

    def settled(self, path: Array) -> tuple[Array, Mask]:
        """Postures (n, nq) near a path that keep constraints, and which motions between are blocked, or had no time."""
        blocked, seen = np.ones(len(path) - 1, dtype=bool), self._seen(path[0])
        for k, pair in enumerate(pairwise(path)):
            if BUDGET.over:
                break
            ahead = self._seen(pair[1])
            blocked[k] = not self._joins(pair[0], np.asarray(pin.difference(self._model, *pair)), seen, ahead)
            seen = ahead
        return path, blocked

    def met(self, q: Array) -> bool:
        """Whether a posture (nq,) meets constraints as postures of paths do."""
        return self._within(q, self._kept)

    def keeps(self, q: Array) -> bool:
        """Whether a posture (nq,) misses no constraint by more than steps may."""
        return self._within(q, self._followed)

    def _within(self, q: Array, kept: Kept) -> bool:
        """Whether values of constraints are between sides at a posture (nq,), where the state is afterwards."""
        values = self._values.at(self._workspace.state.update(q))
        return bool((values >= kept.sides[0]).all() and (values <= kept.sides[1]).all())

    def follows(self, q: Array, there: Array) -> bool:
        """Whether a step of a tracker from q to a posture (nq,) is free, and misses nothing on the way.

        It ends at the margin and at bounds, which it misses as both are curved, so half of the margin is enough.
        """
        motion, kept = np.asarray(pin.difference(self._model, q, there)), self._followed
        middle = self._seen(np.asarray(pin.integrate(self._model, q, 0.5 * motion)), kept)
        return middle is not None and self._joins(q, motion, self._seen(q, kept), self._seen(there, kept), kept)

    def _parts(self, motion: Array) -> int:
        return max(1, int(np.ceil(np.abs(motion).max(initial=0.0) / 0.2)))  # rad, m: length of a part of a motion

    def _seen(self, q: Array, kept: Kept | None = None) -> Seen | None:
        """What is seen at a posture (nq,); None where a pair is nearer than is required, or a constraint is missed."""
        kept = kept or self._kept
        key = q.tobytes(), kept is self._kept
        if key not in self._known:
            if len(self._known) >= 128:  # those of a path are looked at again and again
                self._known.clear()
            self._known[key] = self._looked(q, kept)
        return self._known[key]

    def _looked(self, q: Array, kept: Kept) -> Seen | None:
        if not self._within(q, kept):
            return None
        proximity, data = self._workspace.proximity, self._workspace.state.data
        room = proximity.least(data, self._asked) - self._least
        return Seen(room, proximity.distances.placed.copy()) if (room >= kept.room).all() else None

    def _joins(self, q: Array, motion: Array, seen: Seen | None, ahead: Seen | None, kept: Kept | None = None) -> bool:
        """Whether the motion by a tangent (nv,) from q (nq,) is free, by halves, the longest ones first.

        With c the chord of a pair's motion against each other and A a bound of its acceleration, the least room on the
        way is half of what both ends have together less c, and less A / 8. By all freedoms between the two, that turn
        by w and move a point by v, A <= sum(w) sum(v) where one piece carries the other and sees it, else twice that;
        what slides counts twice. sum(v) bounds the chord too.
        """
        if seen is None or ahead is None:
            return False
        most = np.abs(motion)
        bent = self._views * ((self._turning @ most) * (self._bending @ most))[:, None]
        asked = [(q, motion, seen, ahead, (self._approach @ most)[self._kind], bent[self._kind])]
        for here, whole, first, last, far, bent in asked:  # grows while it is read
            if kept_apart(
                self._workspace.table, first.placed, last.placed, (first.room + last.room, far, bent, self._least)
            ):
                continue
            half = 0.5 * whole
            middle = np.asarray(pin.integrate(self._model, here, half))
            between = self._seen(middle, kept)
            if between is None or len(asked) > 400:  # what slides along something would be halved on and on
                return False
            asked += [
                (here, half, first, between, 0.5 * far, 0.25 * bent),
                (middle, half, between, last, 0.5 * far, 0.25 * bent),
            ]
        return True
