"""The posture in which a robot begins: near zero, within its limits, and free of contact with itself.

Many descriptions overlap at zero: hands in thighs, fingers in each other, wrists in forearms whose hulls are larger
than the parts. Pairs are parted by moving the joints as little as possible; the few that nothing parts are not tested.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.figures.description import ExcludedPair, limits_of
from wholebody.figures.self_pairs import drop_pairs, random_postures
from wholebody.figures.state import State
from wholebody.geometry.proximity import Contacts, PairTable, Proximity

APART = 1e-3
"""Metres that the posture leaves between two pieces."""

STEPS = 60
"""Corrections from one start; ordinary overlaps take three to ten."""

LONGEST_STEP = 0.25
"""Largest change of a joint in one correction, radians or metres."""

DAMPING = 1e-4
"""Square metres added to the diagonal of the normal equations: larger = shorter steps along poor directions."""

PATIENCE = 12
"""Corrections without fewer overlaps or less depth after which a start is given up."""

TRIES = 8
"""Random postures to begin from, half-way from zero, where zero itself does not lead out."""

BACK = (1.0, 0.5, 0.25)
"""Shares of its way back to zero that a joint is moved by where the posture stays free."""

UNPARTED = "overlap at zero, and no posture was found that parts them"


class RestPosture(NamedTuple):
    """Where a robot begins.

    Attributes:
        q: (nq,) posture within the limits without self-contact.
        zero: (nq,) all joints at zero, or where that is outside the limits, at the nearest value.
        excluded: pairs that could not be parted; they are removed from the geometry.
        parted: pairs of pieces that overlap at `zero` and not at `q`, by name.
    """

    q: Array
    zero: Array
    excluded: tuple[ExcludedPair, ...]
    parted: tuple[tuple[str, str], ...]


def rest_posture(model: pin.Model, geometry: pin.GeometryModel, seed: int) -> RestPosture:
    """Find the posture near zero that is free of self-contact; pairs that cannot be parted leave the geometry.

    Args:
        model: Pinocchio's model.
        geometry: its pieces and the pairs that can touch.
        seed: of the postures to begin from where zero does not lead out.
    """
    limits = limits_of(model)
    zero = pin.neutral(model)
    zero[limits.idx_q] = np.clip(zero[limits.idx_q], limits.lower, limits.upper)
    if not len(geometry.collisionPairs) or model.nv == 0:
        return RestPosture(zero, zero.copy(), (), ())
    search = _Parting(model, geometry, zero)
    begun = search.contacts(zero, 0.0)
    if not len(begun.number) and not len(search.contacts(zero, APART).number):
        return RestPosture(zero, zero.copy(), (), ())
    best = search.away_from(zero)
    for other in random_postures(model, TRIES, seed + 1):
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
    """Where one start led: the posture, the pairs that still overlap there, and the sum of their distances."""

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
        self.movable = np.ones(model.nv, dtype=bool)
        if model.njoints > 1 and model.joints[1].nq == 7:
            self.movable[:6] = False

    def contacts(self, q: Array, within: float) -> Contacts:
        return self.proximity.query(self.state.update(q), within)

    def away_from(self, q: Array) -> _Try:
        """Correct until nothing is nearer than `APART`; else the posture with the fewest overlaps on the way."""
        best: _Try | None = None
        since = 0
        for _ in range(STEPS):
            near = self.contacts(q, APART)
            left = tuple(np.sort(near.number[near.distance <= 0.0]).tolist())
            found = _Try(q, left, float(np.minimum(near.distance, 0.0).sum()))
            if best is None or _badness(found) < _badness(best) or not len(near.number):
                best, since = found, 0
            since += 1
            if not len(near.number) or since > PATIENCE:
                break
            q = self._corrected(q, near)
        assert best is not None
        return best

    def pulled_back(self, q: Array, left: frozenset[int]) -> Array:
        """Move every joint back towards zero as far as the posture stays free, but for the pairs that are left out."""
        way = np.asarray(pin.difference(self.model, self.zero, q))
        for place in np.argsort(-np.abs(way), kind="stable").tolist():
            for share in BACK:
                trial = way.copy()
                trial[place] *= 1.0 - share
                if abs(way[place]) > 1e-9 and self._free(np.asarray(pin.integrate(self.model, self.zero, trial)), left):
                    way = trial
                    break
        return np.asarray(pin.integrate(self.model, self.zero, way))

    def _free(self, q: Array, left: frozenset[int]) -> bool:
        return left.issuperset(self.contacts(q, 0.5 * APART).number.tolist())

    def _corrected(self, q: Array, near: Contacts) -> Array:
        joint = self.proximity.table.joint
        lever = np.cross(near.point_a, near.normal)
        rows = self.state.rows(np.hstack([near.normal, lever]), joint[near.pair[:, 1]], joint[near.pair[:, 0]])
        wanted = 1.5 * APART - near.distance
        free = self.movable.copy()
        lower, upper = np.full(self.model.nv, -np.inf), np.full(self.model.nv, np.inf)
        lower[self.limits.idx_v] = self.limits.lower - q[self.limits.idx_q]
        upper[self.limits.idx_v] = self.limits.upper - q[self.limits.idx_q]
        step = np.zeros(self.model.nv)
        for _ in range(self.model.nv):
            part = rows[:, free]
            short = wanted - rows[:, ~free] @ step[~free]
            step[free] = part.T @ np.linalg.solve(part @ part.T + DAMPING * np.eye(len(part)), short)
            beyond = free & ((step < lower - 1e-12) | (step > upper + 1e-12))
            if not beyond.any():
                break
            step[beyond] = np.clip(step[beyond], lower[beyond], upper[beyond])
            free &= ~beyond
        longest = float(np.abs(step).max(initial=0.0))
        if longest > LONGEST_STEP:
            step *= LONGEST_STEP / longest
        return np.asarray(pin.integrate(self.model, q, step))
