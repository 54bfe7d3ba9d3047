"""The pairs of a robot's pieces that can touch, if its file does not give them, and its default posture.

The default posture is near zero, within limits, and free of self-contact. Many descriptions overlap at zero: hands and
thighs, fingers, or wrists and forearms whose hulls are larger than the parts. The joints move as little as possible to
separate the pairs; the few pairs that still overlap are not tested.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, cross
from wholebody.figures.description import ExcludedPair, limits_of, zero_within_limits
from wholebody.figures.state import State, root_freedoms
from wholebody.geometry.large_models import add_pairs, pairs_of
from wholebody.geometry.proximity import Contacts, PairTable, Proximity

UNLIMITED = np.pi
"""Range in both directions for sampling joints without limits: radians, or metres for prismatic joints."""


def choose_pairs(model: pin.Model, geometry: pin.GeometryModel, samples: int) -> tuple[ExcludedPair, ...]:
    """Set the pairs of the geometry to those that can touch; return the pairs left out, with the reason."""
    # Pairs of one joint, of neighbours, and of nested shells, which nearly always overlap, are left out.
    geometry.removeAllCollisionPairs()
    joint = np.array([piece.parentJoint for piece in geometry.geometryObjects], dtype=np.intp)
    above = carriers_above(model, joint)
    first, second = np.triu_indices(geometry.ngeoms, 1)
    a, b = joint[first], joint[second]
    together, neighbours = a == b, (above[a] == b) | (above[b] == a)
    tested = np.flatnonzero(~together & ~neighbours)
    names = [piece.name for piece in geometry.geometryObjects]
    excluded = [
        ExcludedPair(names[first[k]], names[second[k]], "on one joint" if together[k] else "neighbours")
        for k in np.flatnonzero(together | neighbours)
    ]
    add_pairs(geometry, np.column_stack([first[tested], second[tested]]))
    postures = random_postures(model, samples, seed=0)
    touching = _seldom_free(model, geometry, postures)
    for number, seldom in touching.items():
        reason = "touch or overlap in every sampled posture"
        if seldom:
            reason = f"touch or overlap in all but {seldom} of {samples} sampled postures"
        pair = geometry.collisionPairs[number]
        excluded.append(ExcludedPair(names[pair.first], names[pair.second], reason))
    drop_pairs(geometry, touching, "")
    return tuple(excluded)


def drop_pairs(geometry: pin.GeometryModel, numbers: Iterable[int], reason: str) -> list[ExcludedPair]:
    """Remove pairs, given by their indices among the collision pairs, and return them with a reason."""
    gone = sorted(set(numbers))
    if not gone:
        return []
    pairs, names = pairs_of(geometry), [piece.name for piece in geometry.geometryObjects]
    geometry.removeAllCollisionPairs()
    add_pairs(geometry, np.delete(pairs, gone, axis=0))
    return [ExcludedPair(names[first], names[second], reason) for first, second in pairs[gone].tolist()]


def drop_rigid_pairs(geometry: pin.GeometryModel) -> list[ExcludedPair]:
    """Remove pairs of pieces on one joint, which never move against each other; return them."""
    joint = [piece.parentJoint for piece in geometry.geometryObjects]
    together = [k for k, pair in enumerate(geometry.collisionPairs) if joint[pair.first] == joint[pair.second]]
    return drop_pairs(geometry, together, "locked together")


def random_postures(model: pin.Model, count: int, seed: int) -> Array:
    """Postures (count, nq) within the limits, the root at the origin."""
    rng = np.random.default_rng(seed)
    neutral = pin.neutral(model)
    postures = np.tile(neutral, (count, 1))
    for joint in list(model.joints)[1:]:
        if joint.nq == joint.nv == 1:
            low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
            low = low if np.isfinite(low) else min(-UNLIMITED, high)
            high = high if np.isfinite(high) else max(UNLIMITED, low)
            postures[:, joint.idx_q] = rng.uniform(low, high, count)
        elif (joint.nq, joint.nv) == (2, 1):
            angle = rng.uniform(-UNLIMITED, UNLIMITED, count)
            postures[:, joint.idx_q], postures[:, joint.idx_q + 1] = np.cos(angle), np.sin(angle)
    return postures


def carriers_above(model: pin.Model, joint: Indices) -> Indices:
    """For every joint the nearest one towards the root that carries a piece; -1 if there is none."""
    carries = np.zeros(model.njoints, dtype=bool)
    carries[joint] = True
    above = np.full(model.njoints, -1, dtype=np.intp)
    for k in range(1, model.njoints):
        parent = int(model.parents[k])
        above[k] = parent if carries[parent] else above[parent]
    return above


def _seldom_free(model: pin.Model, geometry: pin.GeometryModel, postures: Array) -> dict[int, int]:
    """Pairs that touch in all but a share of 0.02 of these postures -> number of postures without contact."""
    if not len(geometry.collisionPairs) or not len(postures):
        return {}
    data, results = model.createData(), pin.GeometryData(geometry)
    for request in results.collisionRequests:
        # metres: pieces nearer than this touch. The phalanges of some hands are never farther apart.
        request.security_margin = 2e-4
    free = dict.fromkeys(range(len(geometry.collisionPairs)), 0)
    most = int(0.02 * len(postures))  # pairs that are free in so few are left out, as nested shells
    for q in postures:
        pin.updateGeometryPlacements(model, data, geometry, results, q)
        for k in [k for k in free if not pin.computeCollision(geometry, results, k)]:
            free[k] += 1
            if free[k] > most:
                del free[k]
        if not free:
            break
    return free


APART = 1e-3  # least distance of two pieces in the posture, metres

LONGEST_STEP = 0.25  # largest change of a joint in one correction, radians or metres


UNPARTED = "overlap at zero, and no posture was found that parts them"


class RestPosture(NamedTuple):
    """The default posture of a robot."""

    q: Array  # (nq,) posture within the limits without self-contact
    zero: Array  # (nq,) all joints at zero, or at the nearest value within the limits
    excluded: tuple[ExcludedPair, ...]  # pairs that could not be separated; they are removed from the geometry
    parted: tuple[tuple[str, str], ...]  # pairs of pieces that overlap at `zero` and not at `q`, by name


def rest_posture(model: pin.Model, geometry: pin.GeometryModel) -> RestPosture:
    """Find a posture near zero that is free of self-contact; pairs that cannot be separated are removed."""
    zero = zero_within_limits(model)
    if not len(geometry.collisionPairs) or model.nv == 0:
        return RestPosture(zero, zero.copy(), (), ())
    search = _Parting(model, geometry, zero)
    begun = search.contacts(zero, 0.0)
    if not len(begun.number) and not len(search.contacts(zero, APART).number):
        return RestPosture(zero, zero.copy(), (), ())
    best = search.away_from(zero)
    # Random starts, half-way from zero, if zero itself does not lead to a free posture.
    for other in random_postures(model, 8, seed=1):
        if not len(best.left):
            break
        best = min(best, search.away_from(pin.interpolate(model, zero, other, 0.5)), key=_badness)
    left = best.left
    q = search.pulled_back(best.q, frozenset(left))
    names = [piece.name for piece in geometry.geometryObjects]
    at_zero = set(begun.number.tolist()) - set(left)
    pairs = search.proximity.table.pairs
    parted = tuple((names[pairs[k, 0]], names[pairs[k, 1]]) for k in sorted(at_zero))
    return RestPosture(q, zero, tuple(drop_pairs(geometry, left, UNPARTED)), parted)


class _Try(NamedTuple):
    """Result from one start: the posture, the pairs that still overlap, and the sum of their distances."""

    q: Array
    left: tuple[int, ...]
    depth: float


def _badness(found: _Try) -> tuple[int, float]:
    return len(found.left), -found.depth


class _Parting:
    """Moves a posture out of its own overlaps by damped least squares over the joints that are not at a limit."""

    def __init__(self, model: pin.Model, geometry: pin.GeometryModel, zero: Array) -> None:
        self.model, self.zero = model, zero
        self.proximity, self.state = Proximity(PairTable(model, geometry)), State(model)
        self.limits = limits_of(model)
        self.movable = ~root_freedoms(model)

    def contacts(self, q: Array, within: float) -> Contacts:
        return self.proximity.query(self.state.update(q).data, within)

    def away_from(self, q: Array) -> _Try:
        """Correct until nothing is nearer than `APART`; otherwise return the posture with the fewest overlaps."""
        best: _Try | None = None
        since = 0
        for _ in range(60):  # corrections from one start; ordinary overlaps take three to ten
            near = self.contacts(q, APART)
            left = tuple(np.sort(near.number[near.distance <= 0.0]).tolist())
            found = _Try(q, left, float(np.minimum(near.distance, 0.0).sum()))
            if best is None or _badness(found) < _badness(best) or not len(near.number):
                best, since = found, 0
            since += 1
            # Corrections without fewer overlaps or less depth after which the attempt from a start ends.
            if not len(near.number) or since > 12:
                break
            q = self._corrected(q, near)
        assert best is not None
        return best

    def pulled_back(self, q: Array, left: frozenset[int]) -> Array:
        """Move every joint back towards zero while the posture stays free, ignoring the pairs that are left out."""
        way = np.asarray(pin.difference(self.model, self.zero, q))
        for place in np.argsort(-np.abs(way), kind="stable").tolist():
            if not abs(way[place]) > 1e-9:
                break  # nor do the others move, which are moved less
            for share in (1.0, 0.5, 0.25):
                trial = way.copy()
                trial[place] *= 1.0 - share
                q = np.asarray(pin.integrate(self.model, self.zero, trial))
                if left.issuperset(self.contacts(q, 0.5 * APART).number.tolist()):
                    way = trial
                    break
        return np.asarray(pin.integrate(self.model, self.zero, way))

    def _corrected(self, q: Array, near: Contacts) -> Array:
        joint = self.proximity.table.joint
        lever = cross(near.point_a, near.normal)
        rows = self.state.rows(np.hstack([near.normal, lever]), joint[near.pair[:, 1]], joint[near.pair[:, 0]])
        wanted = 1.5 * APART - near.distance
        free = self.movable.copy()
        lower, upper = self.limits.room(q, self.model.nv)
        step = np.zeros(self.model.nv)
        for _ in range(self.model.nv):
            part = rows[:, free]
            short = wanted - rows[:, ~free] @ step[~free]
            # 1e-4 m² on the diagonal; larger: shorter steps along singular directions
            step[free] = part.T @ np.linalg.solve(part @ part.T + 1e-4 * np.eye(len(part)), short)
            beyond = free & ((step < lower - 1e-12) | (step > upper + 1e-12))
            if not beyond.any():
                break
            step[beyond] = np.clip(step[beyond], lower[beyond], upper[beyond])
            free &= ~beyond
        longest = float(np.abs(step).max(initial=0.0))
        if longest > LONGEST_STEP:
            step *= LONGEST_STEP / longest
        return np.asarray(pin.integrate(self.model, q, step))
