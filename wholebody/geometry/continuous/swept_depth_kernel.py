"""Lower bounds of distances at a posture and during a motion, as compiled loops: see `sweep` and `swept_depth`."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.geometry.proximity_kernel import bound_by_boxes, outer_gap


@compiled()
def screen(
    place: Array, table: tuple[Indices, Array, Array], speed: Array, before: Array, after: Array, extent: Array,
    index: Indices,
) -> int:  # fmt: skip
    """Bound the distances after a motion from below, and list the pairs that may overlap at its end or on its way.

    `place` (n, 4, 3): the pieces after it. `speed` (p,): by how much a pair can have come nearer, metres. `before` and
    `after` (p,): bounds before it, and room for those after it, from the motion, spheres and boxes of sizes `extent`
    (n, 3); `index` (p,) has room for the answer, whose length is returned.
    """
    pairs, reach, half = table
    bound_by_boxes(place, half, extent)
    count = 0
    for p in range(len(pairs)):
        least = before[p] - speed[p]
        if before[p] + least - speed[p] < 0.0:
            least = max(least, outer_gap(place, reach, extent, pairs[p, 0], pairs[p, 1]))
            if before[p] + least - speed[p] < 0.0:
                index[count] = p
                count += 1
        after[p] = least
    return count


class Shapes(NamedTuple):
    """The n pieces and p pairs of a geometry model."""

    pairs: Indices  # (p, 2) the pieces of each pair
    joint: Indices  # (n,) joint of each piece
    reach: Array  # (n,) radius of each piece about its origin; infinite for a half-space
    points: Array  # (m, 3) swept points of all pieces, those of piece i from `first_point[i]`
    first_point: Indices  # (n + 1,)
    radius: Array  # (n,) about these points
    radii: Array  # (n, 3) of ellipsoids; 0 for other pieces
    faces: Array  # (f, 4) outward planes of all pieces, those of piece i from `first_face[i]`
    first_face: Indices  # (n + 1,)


class Speeds(NamedTuple):
    """`turn`, `speed` and `carries` of `MotionBounds`, for one motion."""

    turn: Array
    speed: Array
    carries: Mask


class Parts(NamedTuple):
    """Pairs, each during a part of a motion."""

    number: Indices  # (k,) places of the pairs
    first: Indices  # (k,) the time, of `places`, at which the part begins
    last: Indices  # (k,) the time at which it ends
    rows0: Array  # (k, 4) distance and normal, from the first piece to the second, at the beginning
    rows1: Array  # (k, 4) the same at the end
    speed: Array  # (k,) by how much a pair can come nearer during the whole motion
    wanted: Array  # (k,) a bound that is sufficient


@compiled()
def lower_bounds(
    parts: Parts, places: Array, shapes: Shapes, motion: Speeds, share: float, accuracy: float, bound: Array
) -> None:
    """Bound the distances of pairs from below, over a part of a motion, into `bound` (k,).

    A distance changes by at most `speed` over the whole motion. And it is at least the height of one piece above a
    plane that moves with the other one and supports it. The height of a point, as a function of time, is above its
    chord by at most its acceleration times the squared time over eight. `places` (m, n, 4, 3) are those of the pieces
    at some times, `share` is the length of each part of the motion, `accuracy` that of the distances, metres.
    """
    # a record is taken apart once: in a loop each array that is read from it would be counted again
    asked, first_place, last_place, rows0, rows1, speed, wanted = parts
    pairs, joint, reach, points, first_point, radius, radii, faces, first_face = shapes
    outline, limits = (points, first_point, radius, radii), (motion.turn, motion.speed, motion.carries)
    normal, sags = np.empty(3), np.empty(2)
    for k in range(len(asked)):
        first, second = pairs[asked[k], 0], pairs[asked[k], 1]
        place0, place1 = places[first_place[k]], places[last_place[k]]
        best = 0.5 * (rows0[k, 0] + rows1[k, 0] - speed[k] * share) - accuracy
        sags[:] = -1.0
        for side in range(4):
            if best >= wanted[k]:
                break
            carrier, other = (first, second) if side % 2 == 0 else (second, first)
            if np.isinf(reach[other]):
                continue
            row, place = (rows0, place0) if side < 2 else (rows1, place1)
            sign = 1.0 if side % 2 == 0 else -1.0
            square = 0.0
            for j in range(3):
                normal[j] = 0.0
                for i in range(3):
                    normal[j] += sign * place[carrier, j, i] * row[k, 1 + i]
                square += normal[j] ** 2
            if not 0.98 < square < 1.02:
                continue
            if sags[side % 2] < 0.0:
                gap = max(rows0[k, 0], rows1[k, 0])
                bend = _curvature(other, carrier, gap, joint, limits, reach)
                sags[side % 2] = share * share / 8.0 * bend
            sag = sags[side % 2]
            if reach[carrier] < np.inf:
                for j in range(3):
                    normal[j] /= np.sqrt(square)
                height = _support(carrier, normal[0], normal[1], normal[2], outline)
                at0 = _above(carrier, other, normal, height, place0, outline)
                at1 = _above(carrier, other, normal, height, place1, outline)
                best = max(best, min(at0, at1) - sag - accuracy)
            face = _nearest_face(normal, faces, first_face[carrier], first_face[carrier + 1])
            if face >= 0 and radius[carrier] == 0.0:
                for i in range(3):
                    normal[i] = faces[face, i]
                at0 = _above(carrier, other, normal, faces[face, 3], place0, outline)
                at1 = _above(carrier, other, normal, faces[face, 3], place1, outline)
                best = max(best, min(at0, at1) - sag - accuracy)
        bound[k] = best


class Sliding(NamedTuple):
    """Pairs at a posture of a motion, each to be kept above a distance."""

    number: Indices  # (k,) places of the pairs
    rows: Array  # (k, 4) distance and normal, from the first piece to the second
    level: Array  # (k,) the distance
    place: Array  # (n, 4, 3) where the pieces are
    twist: Array  # (njoints, 6) velocity of each joint's body, linear at the world's origin, then angular, per duration


@compiled()
def keep_apart(sliding: Sliding, shapes: Shapes, motion: Speeds, safe: Array) -> None:
    """Raise the shares `safe` (k,) of a motion in which pairs stay apart, from heights above planes to second order."""
    # planes across coal's normal and across the nearest face's, which coal's is up to 1e-4 rad off where faces touch
    asked, rows, level, place, _ = sliding
    pairs, joint, reach, points, first_point, radius, radii, faces, first_face = shapes
    outline, limits = (points, first_point, radius, radii), (motion.turn, motion.speed, motion.carries)
    normal, local = np.empty(3), np.empty(3)
    for k in range(len(asked)):
        if not rows[k, 1] * rows[k, 1] + rows[k, 2] * rows[k, 2] + rows[k, 3] * rows[k, 3] > 0.25:
            continue
        for side in range(2):
            other, carrier = pairs[asked[k], side], pairs[asked[k], 1 - side]
            if first_point[other] == first_point[other + 1]:
                continue
            bend = _curvature(other, carrier, rows[k, 0], joint, limits, reach)
            for j in range(3):
                local[j] = 0.0
                for i in range(3):
                    normal[i] = rows[k, 1 + i] if side else -rows[k, 1 + i]
                    local[j] += place[carrier, j, i] * normal[i]
            if reach[carrier] < np.inf:
                height = _support(carrier, local[0], local[1], local[2], outline)
                safe[k] = max(safe[k], _stays_above(other, carrier, normal, height, bend, level[k], sliding, shapes))
            face = _nearest_face(local, faces, first_face[carrier], first_face[carrier + 1])
            if face >= 0:
                height = faces[face, 3]
                if reach[carrier] < np.inf:  # coplanar triangles of a hull are one face, to 1e-7
                    height = _support(carrier, faces[face, 0], faces[face, 1], faces[face, 2], outline)
                for i in range(3):
                    normal[i] = 0.0
                    for j in range(3):
                        normal[i] += place[carrier, j, i] * faces[face, j]
                safe[k] = max(safe[k], _stays_above(other, carrier, normal, height, bend, level[k], sliding, shapes))


@compiled(inner=True)
def _stays_above(
    other: int, carrier: int, normal: Array, height: float, bend: float, level: float, sliding: Sliding, shapes: Shapes
) -> float:  # fmt: skip
    """Share of a motion for which a piece's points stay `level` above a plane at a height above a carrier's origin."""
    place, twist = sliding.place, sliding.twist
    a, b, points = shapes.joint[other], shapes.joint[carrier], shapes.points
    ground = height + shapes.radius[other] + level
    for i in range(3):
        ground += normal[i] * place[carrier, 3, i]
    turn = (twist[a, 3] - twist[b, 3], twist[a, 4] - twist[b, 4], twist[a, 5] - twist[b, 5])
    least = np.inf
    for p in range(shapes.first_point[other], shapes.first_point[other + 1]):
        u, v, w = points[p, 0], points[p, 1], points[p, 2]
        x = place[other, 3, 0] + place[other, 0, 0] * u + place[other, 1, 0] * v + place[other, 2, 0] * w
        y = place[other, 3, 1] + place[other, 0, 1] * u + place[other, 1, 1] * v + place[other, 2, 1] * w
        z = place[other, 3, 2] + place[other, 0, 2] * u + place[other, 1, 2] * v + place[other, 2, 2] * w
        room = normal[0] * x + normal[1] * y + normal[2] * z - ground
        if not room > 0.0:
            return 0.0
        rate = normal[0] * (twist[a, 0] - twist[b, 0] + turn[1] * z - turn[2] * y)
        rate += normal[1] * (twist[a, 1] - twist[b, 1] + turn[2] * x - turn[0] * z)
        rate += normal[2] * (twist[a, 2] - twist[b, 2] + turn[0] * y - turn[1] * x)
        if bend > 0.0:
            least = min(least, (rate + np.sqrt(rate * rate + 2.0 * bend * room)) / bend)
        elif rate < 0.0:
            least = min(least, room / -rate)
    return least


@compiled(inner=True)
def _nearest_face(direction: Array, faces: Array, begin: int, end: int) -> int:
    """The face, of those from `begin` to `end`, whose normal is nearest to a direction (3,); -1 for none."""
    face, most = -1, -np.inf
    for f in range(begin, end):
        along = faces[f, 0] * direction[0] + faces[f, 1] * direction[1] + faces[f, 2] * direction[2]
        if along > most:
            face, most = f, along
    return face


@compiled(inner=True)
def _curvature(
    first: int, second: int, gap: float, joint: Indices, motion: tuple[Array, Array, Mask], reach: Array
) -> float:
    """Bound of the acceleration of the first piece's points relative to the second, metres per squared duration.

    With the joints between the two pieces taken as a product of exponentials, the second derivative of the point is a
    sum over pairs of joints: each velocity counts twice for every joint nearer to the second piece, and once by its
    own. A joint under the second piece is as far from the first one's points as from the second's, the gap, and what is
    across the first, which is of finite reach.
    """
    turn, speeds, carries = motion
    a, b = joint[first], joint[second]
    turns, travel = 0.0, 0.0
    for j in range(len(turn)):
        if carries[a, j] != carries[b, j]:
            turns += turn[j]
            travel += speeds[first, j] if carries[a, j] else speeds[second, j]
    across = max(gap, 0.0) + travel + 2.0 * reach[first]
    total = 0.0
    for j in range(len(turn)):
        if carries[a, j] and not carries[b, j]:
            total += speeds[first, j] * (2.0 * turns - turn[j])
        elif carries[b, j] and not carries[a, j]:
            total += (speeds[second, j] + turn[j] * across) * (2.0 * turns - turn[j])
    return total


Outline: TypeAlias = tuple[Array, Indices, Array, Array]  # `points`, `first_point`, `radius` and `radii` of `Shapes`


@compiled(inner=True)
def _support(piece: int, x: float, y: float, z: float, outline: Outline) -> float:
    """Height of a piece above its origin along a direction (x, y, z) in its own axes."""
    points, first_point, radius, radii = outline
    begin, end = first_point[piece], first_point[piece + 1]
    if begin == end:
        return float(np.sqrt((radii[piece, 0] * x) ** 2 + (radii[piece, 1] * y) ** 2 + (radii[piece, 2] * z) ** 2))
    most = -np.inf
    for k in range(begin, end):
        most = max(most, points[k, 0] * x + points[k, 1] * y + points[k, 2] * z)
    return float(most + radius[piece])


@compiled(inner=True)
def _above(carrier: int, other: int, normal: Array, height: float, place: Array, outline: Outline) -> float:
    """Least height of a piece above a plane of another one: `normal` and `height` in the axes of the carrier."""
    between = x = y = z = 0.0
    for i in range(3):
        world = place[carrier, 0, i] * normal[0] + place[carrier, 1, i] * normal[1] + place[carrier, 2, i] * normal[2]
        between += world * (place[other, 3, i] - place[carrier, 3, i])
        x -= place[other, 0, i] * world
        y -= place[other, 1, i] * world
        z -= place[other, 2, i] * world
    return between - height - _support(other, x, y, z, outline)
