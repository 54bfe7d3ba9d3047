"""Exact face normals and the ends of contact patches, as compiled loops: see `contact_rows`."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled

ContactArrays: TypeAlias = tuple[Indices, Array, Array, Array, Array, Indices, Array]
"""A `Contacts` as a plain tuple, which numba reads at no cost; a named one takes it 2 us a call."""

ShapeArrays: TypeAlias = tuple[Array, Indices, Array, Indices, Array, Array]
"""`points`, `first_point`, `faces`, `first_face`, `radius` and `axis` of the pair table."""

TableArrays: TypeAlias = tuple[Mask, Indices, Array, Array, Indices, Array, Indices, Array, Array]
"""Whether both pieces of a pair have more than one swept point (pairs,), and the joint of each piece (n,); lever
distance, band, inset, shortest lever, cosine of the same normal, room for it, setback and most ends; the arrays of the
shapes."""

RowArrays: TypeAlias = tuple[Array, Array, Indices, Indices]
"""Room for the wrench (m, 6), gap (m,), contact (m,) and both joints (m, 2) of each row."""


@compiled(inner=True)
def _snap_normals(wide: Indices, contacts: ContactArrays, shapes: ShapeArrays, near: float, accuracy: float) -> None:
    """Put the exact normal of a face where coal's is that normal but for rounding; normals are changed in place."""
    pair, distance, normal, _, _, _, placement = contacts
    points, first_point, faces, first_face, radius, _ = shapes
    direction, turned = np.empty(3), np.empty(3)
    for c in wide:
        found = False
        for side in range(2):
            own, other = pair[c, side], pair[c, 1 - side]
            if found or radius[own] > 0.0 or first_point[other] == first_point[other + 1]:
                continue
            sign = 1.0 if side == 0 else -1.0
            _to_frame(placement[own], normal[c], sign, turned)
            for f in range(first_face[own], first_face[own + 1]):
                if faces[f, 0] * turned[0] + faces[f, 1] * turned[1] + faces[f, 2] * turned[2] < near:
                    continue
                base = faces[f, 3]
                for k in range(3):
                    direction[k] = (
                        faces[f, 0] * placement[own, 0, k]
                        + faces[f, 1] * placement[own, 1, k]
                        + faces[f, 2] * placement[own, 2, k]
                    )
                    base += direction[k] * (placement[own, 3, k] - placement[other, 3, k])
                _to_frame(placement[other], direction, 1.0, turned)
                least = np.inf
                for p in range(first_point[other], first_point[other + 1]):
                    height = points[p, 0] * turned[0] + points[p, 1] * turned[1] + points[p, 2] * turned[2]
                    least = min(least, height)
                if least - base - radius[other] >= distance[c] - accuracy:
                    for k in range(3):
                        normal[c, k] = sign * direction[k]
                    found = True
                    break
                _to_frame(placement[own], normal[c], sign, turned)


@compiled(inner=True)
def _to_frame(placement: Array, vector: Array, sign: float, turned: Array) -> None:
    """Write a vector (3,) of the world, times a sign, in the axes of a piece."""
    for i in range(3):
        turned[i] = sign * (placement[i, 0] * vector[0] + placement[i, 1] * vector[1] + placement[i, 2] * vector[2])


@compiled(inner=True)
def _patch_ends(
    wide: Indices, contacts: ContactArrays, shapes: ShapeArrays, lengths: Array, most_ends: int
) -> tuple[Indices, Array, Array]:
    """Ends of the patches of the contacts `wide`, at most `most_ends` each: contact (m,), point (m, 3) and gap (m,)."""
    pair, distance, normal, point_a, point_b, _, placement = contacts
    points, first_point, faces, first_face, radius, axis = shapes
    most, most_points = _room(wide, pair, first_point)
    contact = np.empty(most, dtype=np.intp)
    place = np.empty((most, 3))
    gap = np.empty(most)
    drop, share, sag = np.empty(most_points), np.empty(most_points), np.empty(most_points)
    lever, along = np.empty((3, most_points)), np.empty((3, most_points))
    outward = np.empty(3)
    filled = 0
    for c in wide:
        first_begun = filled
        for side in range(2):
            own, other = pair[c, side], pair[c, 1 - side]
            for k in range(3):
                outward[k] = normal[c, k] if side == 0 else -normal[c, k]
            witness, facing = (point_a[c], point_b[c]) if side == 0 else (point_b[c], point_a[c])
            own_points = points[first_point[own] : first_point[own + 1]]
            count = _in_band(own_points, placement[own], witness, outward, (radius[own], lengths[1]), (drop, lever))
            surface = (placement[other], faces[first_face[other] : first_face[other + 1]], radius[other], axis[other])
            whole = _over_surface(surface, facing, outward, (lengths[2], lengths[5]), count, (lever, along, share, sag))
            begun = filled
            for e in range(count):
                long = np.sqrt(lever[0, e] * lever[0, e] + lever[1, e] * lever[1, e] + lever[2, e] * lever[2, e])
                if long * share[e] > lengths[3]:
                    contact[filled] = c
                    for k in range(3):
                        place[filled, k] = witness[k] + share[e] * lever[k, e]
                    gap[filled] = distance[c] + share[e] * drop[e] + sag[e]
                    filled += 1
            if whole and count > 0:  # this side is the patch: the other side's points add nothing
                for row in range(filled - begun):
                    for k in range(3):
                        place[first_begun + row, k] = place[begun + row, k]
                    gap[first_begun + row] = gap[begun + row]
                filled = first_begun + filled - begun
                break
        if filled - first_begun > most_ends:
            _farthest_first(
                place[first_begun:filled], gap[first_begun:filled], point_a[c], distance[c], lengths[6], most_ends
            )  # fmt: skip
            filled = first_begun + most_ends
    return contact[:filled], place[:filled], gap[:filled]


@compiled(inner=True)
def _room(wide: Indices, pair: Indices, first_point: Indices) -> tuple[int, int]:
    """How many points the pieces of some contacts have in all, and the most of one piece."""
    most, most_points = 0, 0
    for c in wide:
        for side in range(2):
            points_of_one = first_point[pair[c, side] + 1] - first_point[pair[c, side]]
            most += points_of_one
            most_points = max(most_points, points_of_one)
    return most, most_points


@compiled(inner=True)
def _in_band(
    points: Array,
    placement: Array,
    witness: Array,
    outward: Array,
    size: tuple[float, float],
    found: tuple[Array, Array],
) -> int:
    """How many points of a piece lie in the band below the plane of contact, with depths (n,) and levers (3, n) [m]."""
    # `size`: radius and width of the band; a lever goes from the witness point to it, within the plane
    radius, band = size
    drop, lever = found
    down = np.empty(3)
    above = 0.0
    for k in range(3):
        above += (placement[3, k] - witness[k]) * outward[k]
    _to_frame(placement, outward, 1.0, down)
    count = 0
    for number in range(len(points)):
        height = above + points[number, 0] * down[0] + points[number, 1] * down[1] + points[number, 2] * down[2]
        if -height - radius >= band:
            continue
        drop[count] = max(-height - radius, 0.0)
        for k in range(3):
            step = placement[3, k] - witness[k] - height * outward[k]
            for i in range(3):
                step += points[number, i] * placement[i, k]
            lever[k, count] = step
        count += 1
    return count


@compiled(inner=True)
def _over_surface(
    surface: tuple[Array, Array, float, Array], facing: Array, outward: Array, depths: tuple[float, float], count: int,
    found: tuple[Array, Array, Array, Array],
) -> bool:  # fmt: skip
    """How far levers stay over the other piece, whose witness point is `facing`; whether all of them do to their ends.

    `surface`: placement, faces, radius and axis of that piece; `depths`: the inset, by which its surface may fall below
    the plane, and the accuracy. Of `found`, levers (3, n) are read; it writes them in the axes of the piece, the share
    (n,) of each that stays over it, and how far the surface falls there (n,).
    """
    placement, faces, radius, axis = surface
    inset, accuracy = depths
    lever, along, share, sag = found
    base, up, shift = np.empty(3), np.empty(3), np.empty(3)
    for k in range(3):
        shift[k] = facing[k] + inset * outward[k] - placement[3, k]
    _to_frame(placement, shift, 1.0, base)
    _to_frame(placement, outward, 1.0, up)
    longest = 0.0
    for i in range(3):
        for e in range(count):
            along[i, e] = placement[i, 0] * lever[0, e] + placement[i, 1] * lever[1, e] + placement[i, 2] * lever[2, e]
    for e in range(count):
        longest = max(longest, lever[0, e] * lever[0, e] + lever[1, e] * lever[1, e] + lever[2, e] * lever[2, e])
        share[e], sag[e] = 1.0, 0.0
    longest = np.sqrt(longest)
    for f in range(len(faces) if count else 0):
        x, y, z = faces[f, 0], faces[f, 1], faces[f, 2]
        room = faces[f, 3] - x * base[0] - y * base[1] - z * base[2]
        if room < longest:  # else no lever leads out of this face
            scale = 1.0 / max(room, 1e-12)
            for e in range(count):
                climb = scale * (x * along[0, e] + y * along[1, e] + z * along[2, e])
                if climb > share[e]:
                    share[e] = climb
        slope = -(x * up[0] + y * up[1] + z * up[2])
        if slope > 0.0 and room - inset * slope < accuracy:  # the witness point is on this face
            for e in range(count):
                sag[e] = max(sag[e], (x * along[0, e] + y * along[1, e] + z * along[2, e]) / slope)
    round_ = axis[0] != 0.0 or axis[1] != 0.0 or axis[2] != 0.0
    whole = True
    for e in range(count):
        share[e] = 1.0 / share[e]
        sag[e] = min(share[e] * sag[e], inset)
        if round_:
            share[e], sag[e] = _across_capsule(radius, axis, up, along[:, e], inset, share[e])
        whole = whole and share[e] >= 1.0
    return whole


@compiled(inner=True)
def _across_capsule(
    radius: float, axis: Array, up: Array, along: Array, inset: float, share: float
) -> tuple[float, float]:
    """The share of a lever that stays over a capsule, and how far its surface falls there; all in its axes."""
    across0 = axis[1] * up[2] - axis[2] * up[1]
    across1 = axis[2] * up[0] - axis[0] * up[2]
    across2 = axis[0] * up[1] - axis[1] * up[0]
    norm = max(np.sqrt(across0 * across0 + across1 * across1 + across2 * across2), 1e-9)
    offset = abs(across0 * along[0] + across1 * along[1] + across2 * along[2]) / norm
    half_width = np.sqrt(2.0 * radius * inset)
    if offset > half_width:
        share = min(share, half_width / max(offset, 1e-12))
    return share, (share * offset) ** 2 / (2.0 * radius)


@compiled(inner=True)
def _farthest_first(place: Array, gap: Array, witness: Array, distance: float, setback: float, count: int) -> None:
    """Move `count` places of a contact to the front, with their gaps: each the farthest from those before it.

    The first is the farthest from the witness point. A place whose gap is larger than the contact's `distance` by
    `setback` counts as half as far away: it takes a larger turn to touch. `place` (m, 3) and `gap` (m,) are changed in
    place.
    """
    total = len(gap)
    away, nearness = np.empty(total), np.empty(total)
    for row in range(total):
        nearness[row] = (setback / (setback + gap[row] - distance)) ** 2
        away[row] = 0.0
        for k in range(3):
            away[row] += nearness[row] * (place[row, k] - witness[k]) ** 2
    for chosen in range(count):
        best = chosen
        for row in range(chosen + 1, total):
            if away[row] > away[best]:
                best = row
        for k in range(3):
            place[chosen, k], place[best, k] = place[best, k], place[chosen, k]
        gap[chosen], gap[best] = gap[best], gap[chosen]
        away[chosen], away[best] = away[best], away[chosen]
        nearness[chosen], nearness[best] = nearness[best], nearness[chosen]
        for row in range(chosen + 1, total):
            square = 0.0
            for k in range(3):
                square += nearness[row] * (place[row, k] - place[chosen, k]) ** 2
            away[row] = square if chosen == 0 else min(away[row], square)


@compiled()
def contact_rows(contacts: ContactArrays, clearance: Array, table: TableArrays, room: RowArrays) -> int:
    """Write the rows of all contacts, of which distances (k,) are asked, metres; how many there are."""
    pair, distance, normal, point_a, _, number, _ = contacts
    extended, joint, lengths, points, first_point, faces, first_face, radius, axis = table
    shapes = points, first_point, faces, first_face, radius, axis
    wrench, gap, contact, joints = room
    count = len(distance)
    wide = np.empty(count, dtype=np.intp)
    found = 0
    for c in range(count):
        if extended[number[c]] and distance[c] < clearance[c] + lengths[0]:
            wide[found] = c
            found += 1
    wide = wide[:found]
    if found:
        _snap_normals(wide, contacts, shapes, lengths[4], lengths[5])
    for c in range(count):
        gap[c], contact[c] = distance[c], c
        joints[c, 0], joints[c, 1] = joint[pair[c, 0]], joint[pair[c, 1]]
        _wrench(normal[c], point_a[c], wrench[c])
    if not found:
        return count
    owner, place, open_by = _patch_ends(wide, contacts, shapes, lengths, int(lengths[7]))
    for e in range(len(owner)):
        c, row = owner[e], count + e
        gap[row], contact[row] = open_by[e], c
        joints[row, 0], joints[row, 1] = joints[c, 0], joints[c, 1]
        _wrench(normal[c], place[e], wrench[row])
    return count + len(owner)


@compiled(inner=True)
def _wrench(normal: Array, point: Array, wrench: Array) -> None:
    """[n, x cross n]."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        wrench[k] = normal[k]
        wrench[3 + k] = point[i] * normal[j] - point[j] * normal[i]
