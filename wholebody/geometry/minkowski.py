"""Overlap of two unions of convex pieces as a function of a translation of the first.

Piece i of A, moved by t, overlaps piece j of B while t is inside O_ij = B_j - A_i (Minkowski difference), a convex set.
A side of it is an outward unit normal n of O_ij with the offset h(n) = max over O_ij of n . x: every t with n . t >=
h(n) separates the pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.geometry.pieces import COAL_ACCURACY, SweptPoints, normal_across, swept_points

Placed: TypeAlias = tuple[Any, pin.SE3]  # a coal geometry and its placement in the world

OVERLAP = 2.0 * COAL_ACCURACY  # depth up to which a pair counts as touching, metres: twice coal's own tolerance


class _Body:
    """One piece: its swept points in the world, and its support function."""

    def __init__(self, placed: Placed) -> None:
        self.geometry, self.placement = placed
        self.swept: SweptPoints = swept_points(self.geometry)
        rotation, self.center = np.asarray(self.placement.rotation), np.asarray(self.placement.translation)
        self.points: Array = self.swept.points @ rotation.T + self.center
        self.axis: Array = rotation @ self.swept.axis
        self.plane: Array | None = None
        self.radii: Array | None = None
        if not len(self.points):
            if np.isinf(self.swept.reach):
                self.plane = rotation @ self.swept.faces[0, :3]
                self.offset = float(self.swept.faces[0, 3] + self.plane @ self.center)
            else:
                self.radii = rotation * np.asarray(self.geometry.radii)

    @property
    def out(self) -> Array | None:
        """(3,) along which this piece leaves others, if it is a half-space; None otherwise."""
        return None if self.plane is None else -self.plane

    def support(self, normals: Array) -> Array:
        """The greatest n . x over the piece for each row n: (k,)."""
        if self.plane is not None:
            return np.where(np.abs(normals - self.plane).max(axis=1) < 1e-12, self.offset, np.inf)
        if self.radii is not None:
            return np.asarray(normals @ self.center + np.linalg.norm(normals @ self.radii, axis=1))
        return np.asarray((normals @ self.points.T).max(axis=1) + self.swept.radius)


class Sides(NamedTuple):
    """Sides of O: normals (k, 3) out of it, and offsets (k,): n . t >= offset separates the pair."""

    normals: Array
    offsets: Array


class ObjectPair:
    """All pairs of pieces of two objects, with A moved by a translation."""

    def __init__(
        self, pieces_a: Sequence[Placed], pieces_b: Sequence[Placed], allowed: NDArray[np.bool_] | None = None
    ) -> None:
        """Read the pieces once; `allowed` (n, m) selects the pairs that count."""
        self.a, self.b = [_Body(p) for p in pieces_a], [_Body(p) for p in pieces_b]
        self._centers = np.array([x.center for x in self.a])[:, None] - np.array([x.center for x in self.b])
        self._reach = np.array([x.swept.reach for x in self.a])[:, None] + np.array([x.swept.reach for x in self.b])
        if allowed is not None:
            self._reach = np.where(allowed, self._reach, -np.inf)
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()
        self._at_a = [_transform(x.placement) for x in self.a]
        self._at_b = [_transform(x.placement) for x in self.b]

    def overlapping(self, translation: Array, tolerance: float) -> tuple[list[tuple[int, int]], Array, Array]:
        """Pairs deeper than `tolerance`: (i, j), depths (k,), and normals (k, 3) out of B into A."""
        near = np.argwhere(np.linalg.norm(self._centers + translation, axis=2) < self._reach)
        pairs: list[tuple[int, int]] = []
        depths, normals = [], []
        for i, j in near:
            depth, normal = self.measure(int(i), int(j), translation)
            if depth > tolerance:
                pairs.append((int(i), int(j)))
                depths.append(depth)
                normals.append(normal)
        return pairs, np.array(depths), np.array(normals).reshape(-1, 3)

    def measure(self, i: int, j: int, translation: Array) -> tuple[float, Array]:
        """Depth (negative: gap) of piece i of A, moved, in piece j of B, and the unit normal out of B into A."""
        a, b = self.a[i], self.b[j]
        self._at_a[i].setTranslation(a.center + translation)
        self._result.clear()
        distance = coal.distance(a.geometry, self._at_a[i], b.geometry, self._at_b[j], self._request, self._result)
        normal = -np.array(self._result.normal)
        if (
            not normal @ normal > 0.25
        ):  # swept points that coincide exactly (capsule axes, concentric spheres): coal has no normal
            normal = normal_across(a.axis, b.axis)
        return -float(distance), normal

    def between(self, translation: Array) -> Sides | None:
        """A plane between each pair that a shorter translation can make overlap; None if one overlaps."""
        reach = float(np.linalg.norm(translation))
        normals, offsets = [], []
        for i, j in np.argwhere(np.linalg.norm(self._centers, axis=2) - reach < self._reach):
            depth, normal = self.measure(int(i), int(j), translation)
            side = self.rows(int(i), int(j), normal[None])
            if not len(side.offsets):  # a half-space has one side, and coal's normal differs from it by rounding
                planes = [plane for plane in (self.b[j].plane, self.a[i].out) if plane is not None]
                side = self.rows(int(i), int(j), np.array(planes))
            slack = side.normals @ translation - side.offsets
            best = int(np.argmax(slack))
            if depth > OVERLAP or slack[best] < -OVERLAP:
                return None
            normals.append(side.normals[best])
            offsets.append(min(side.offsets[best], float(side.normals[best] @ translation)))
        return Sides(np.array(normals), np.array(offsets)) if normals else None

    def rows(self, i: int, j: int, normals: Array) -> Sides:
        """Sides of O_ij with these normals (k, 3); those in whose direction it is unbounded are left out."""
        offsets = self.b[j].support(normals) + self.a[i].support(-normals)
        finite = np.isfinite(offsets)
        return Sides(normals[finite], offsets[finite])

    def escapes(self) -> Array:
        """Translations (k, 3) that move the hull of A out of that of B, one for each of many directions."""
        planes = [plane for plane in (*(x.plane for x in self.b), *(x.out for x in self.a)) if plane is not None]
        normals = np.vstack([_net(), *[plane[None] for plane in planes]])
        ahead = np.max([x.support(normals) for x in self.b], axis=0)
        length = ahead + np.max([x.support(-normals) for x in self.a], axis=0)
        finite = np.isfinite(length)
        return np.asarray(normals[finite] * np.maximum(length[finite], 0.0)[:, None])


def _transform(placement: pin.SE3) -> Any:
    return coal.Transform3s(placement.rotation, placement.translation)


def _net() -> Array:
    """Unit vectors spread over the sphere: a Fibonacci spiral, its opposites and the axes."""
    count = 32
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    ring = np.sqrt(1.0 - z * z)
    spiral = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), z])
    return np.vstack([spiral, -spiral, np.eye(3), -np.eye(3)])
