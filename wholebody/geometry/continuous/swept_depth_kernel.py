"""Lower bounds of distances at a posture and during a motion, as compiled loops: see `swept_depth`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.base.compiled import compiled
from wholebody.geometry.continuous.motion_bounds import Speeds
from wholebody.geometry.proximity_kernel import bound_by_boxes, outer_gap
from wholebody.geometry.records import Parts, PieceArrays


@compiled()
def screen(
    place: Array, pieces: PieceArrays, speed: Array, before: Array, after: Array, extent: Array, index: Indices
) -> int:
    """Bound the distances after a motion from below, and list the pairs that may overlap at its end or on its way.

    Args:
        place: (n, 4, 3) where the pieces are after the motion; see `Contacts.placements`.
        pieces: see `PieceArrays`.
        speed: (p,) by how much a pair can have come nearer during the motion, metres.
        before: (p,) lower bounds of the distances before it.
        after: (p,) room for those after it: from the motion, from spheres and from boxes along the world's axes.
        extent: (n, 3) room for the sizes of the boxes.
        index: (p,) room for the pairs of the answer.

    Returns:
        How many pairs there are.
    """
    bound_by_boxes(place, pieces.half, extent)
    pairs, reach = pieces.pairs, pieces.reach
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


@compiled()
def lower_bounds(
    parts: Parts, places: Array, pieces: PieceArrays, speeds: Speeds, share: float, accuracy: float, bound: Array
) -> None:
    """Bound the distances of pairs from below, over a part of a motion.

    A distance changes by at most `speed` over the whole motion. And it is at least the height of one piece above a
    plane that moves with the other one and supports it. The height of a point, as a function of time, is above its
    chord by at most its acceleration times the squared time over eight.

    Args:
        parts: the pairs, each with the part of the motion that is looked at.
        places: (m, n, 4, 3) where the pieces are at some times.
        pieces: see `PieceArrays`.
        speeds: of the whole motion.
        share: length of each part, of the whole motion.
        accuracy: metres to which the distances are known.
        bound: (k,) room for the answer.
    """
    sags = np.empty(2)
    for k in range(len(parts.number)):
        first, second = pieces.pairs[parts.number[k], 0], pieces.pairs[parts.number[k], 1]
        ends = places[parts.first[k]], places[parts.last[k]]
        known = parts.rows0[k], parts.rows1[k]
        gap = max(known[0][0], known[1][0])
        best = 0.5 * (known[0][0] + known[1][0] - parts.speed[k] * share) - accuracy
        sags[:] = -1.0
        for side in range(4):
            if best >= parts.wanted[k]:
                break
            carrier, other = (first, second) if side % 2 == 0 else (second, first)
            if np.isinf(pieces.reach[other]):
                continue
            end = side // 2
            height = _height_of_planes(carrier, other, known[end], side % 2 == 0, ends[end], ends, pieces)
            if height == -np.inf:
                continue
            if sags[side % 2] < 0.0:
                sags[side % 2] = share * share / 8.0 * _curvature(other, carrier, gap, pieces, speeds)
            best = max(best, height - sags[side % 2] - accuracy)
        bound[k] = best


@compiled(inner=True)
def _height_of_planes(
    carrier: int, other: int, row: Array, outward: bool, place: Array, ends: tuple[Array, Array], pieces: PieceArrays
) -> float:
    """Least height of a piece, at both ends of a part, above planes that move with the carrier and support it.

    Args:
        carrier: the piece with the planes.
        other: the piece above them.
        row: (4,) distance and normal of the pair, at the end from which the planes are taken.
        outward: whether the normal points away from the carrier.
        place: (n, 4, 3) where the pieces are at that end.
        ends: the same at both ends.
        pieces: see `PieceArrays`.

    Returns:
        The height above the plane across the normal or above the face that is nearest to it, whichever is greater; -inf
        if the normal is none.
    """
    normal, square, best = np.empty(3), 0.0, -np.inf
    for j in range(3):
        normal[j] = 0.0
        for i in range(3):
            normal[j] += (1.0 if outward else -1.0) * place[carrier, j, i] * row[1 + i]
        square += normal[j] ** 2
    if not 0.98 < square < 1.02:
        return best
    if np.isfinite(pieces.reach[carrier]):
        for j in range(3):
            normal[j] /= np.sqrt(square)
        height = _support(carrier, normal[0], normal[1], normal[2], pieces)
        best = min(
            _above(carrier, other, normal, height, ends[0], pieces),
            _above(carrier, other, normal, height, ends[1], pieces),
        )
    faces, face, most = pieces.faces, -1, -np.inf
    for f in range(pieces.first_face[carrier], pieces.first_face[carrier + 1]):
        along = faces[f, 0] * normal[0] + faces[f, 1] * normal[1] + faces[f, 2] * normal[2]
        if along > most:
            face, most = f, along
    if face >= 0 and pieces.radius[carrier] == 0.0:
        for i in range(3):
            normal[i] = faces[face, i]
        lower = min(
            _above(carrier, other, normal, faces[face, 3], ends[0], pieces),
            _above(carrier, other, normal, faces[face, 3], ends[1], pieces),
        )
        best = max(best, lower)
    return best


@compiled(inner=True)
def _curvature(first: int, second: int, gap: float, pieces: PieceArrays, speeds: Speeds) -> float:
    """Bound of the acceleration of the first piece's points relative to the second; `MotionBounds.curvature`."""
    a, b = pieces.joint[first], pieces.joint[second]
    turn, speed, carries = speeds.turn, speeds.speed, speeds.carries
    turns, travel = 0.0, 0.0
    for j in range(len(turn)):
        if carries[a, j] != carries[b, j]:
            turns += turn[j]
            travel += speed[first, j] if carries[a, j] else speed[second, j]
    across = max(gap, 0.0) + travel + 2.0 * pieces.reach[first]
    total = 0.0
    for j in range(len(turn)):
        if carries[a, j] and not carries[b, j]:
            total += speed[first, j] * (2.0 * turns - turn[j])
        elif carries[b, j] and not carries[a, j]:
            total += (speed[second, j] + turn[j] * across) * (2.0 * turns - turn[j])
    return total


@compiled(inner=True)
def _support(piece: int, x: float, y: float, z: float, pieces: PieceArrays) -> float:
    """Height of a piece above its origin along a direction (x, y, z) in its own axes."""
    begin, end = pieces.first_point[piece], pieces.first_point[piece + 1]
    if begin == end:
        a, b, c = pieces.radii[piece, 0], pieces.radii[piece, 1], pieces.radii[piece, 2]
        return float(np.sqrt((a * x) ** 2 + (b * y) ** 2 + (c * z) ** 2))
    points, most = pieces.points, -np.inf
    for k in range(begin, end):
        most = max(most, points[k, 0] * x + points[k, 1] * y + points[k, 2] * z)
    return float(most + pieces.radius[piece])


@compiled(inner=True)
def _above(carrier: int, other: int, normal: Array, height: float, place: Array, pieces: PieceArrays) -> float:
    """Least height of a piece above a plane of another one: `normal` and `height` in the axes of the carrier."""
    between = x = y = z = 0.0
    for i in range(3):
        world = place[carrier, 0, i] * normal[0] + place[carrier, 1, i] * normal[1] + place[carrier, 2, i] * normal[2]
        between += world * (place[other, 3, i] - place[carrier, 3, i])
        x -= place[other, 0, i] * world
        y -= place[other, 1, i] * world
        z -= place[other, 2, i] * world
    return between - height - _support(other, x, y, z, pieces)
