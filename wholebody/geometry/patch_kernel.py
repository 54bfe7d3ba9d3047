"""Exact face normals and the ends of contact patches, as compiled loops: see `contact_rows`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.arrays import Array, Indices
from wholebody.compiled import compiled


@compiled()
def snap_normals(
    wide: Indices,
    pair: Indices,
    distance: Array,
    normal: Array,
    placement: Array,
    points: Array,
    point_start: Indices,
    point_count: Indices,
    faces: Array,
    face_start: Indices,
    face_count: Indices,
    radius: Array,
    near: float,
    accuracy: float,
) -> None:
    """Put the exact normal of a face where coal's is that normal but for rounding; `normal` is changed in place."""
    direction = np.empty(3)
    for c in wide:
        found = False
        for side in range(2):
            own, other = pair[c, side], pair[c, 1 - side]
            if found or radius[own] > 0.0 or point_count[other] == 0:
                continue
            sign = 1.0 if side == 0 else -1.0
            for f in range(face_start[own], face_start[own] + face_count[own]):
                for k in range(3):
                    direction[k] = (
                        faces[f, 0] * placement[own, 0, k]
                        + faces[f, 1] * placement[own, 1, k]
                        + faces[f, 2] * placement[own, 2, k]
                    )
                along = direction[0] * normal[c, 0] + direction[1] * normal[c, 1] + direction[2] * normal[c, 2]
                if sign * along < near:
                    continue
                base = (
                    faces[f, 3]
                    + direction[0] * placement[own, 3, 0]
                    + direction[1] * placement[own, 3, 1]
                    + direction[2] * placement[own, 3, 2]
                )
                least = np.inf
                for number in range(point_start[other], point_start[other] + point_count[other]):
                    height = -base
                    for k in range(3):
                        place = placement[other, 3, k]
                        for i in range(3):
                            place += points[number, i] * placement[other, i, k]
                        height += direction[k] * place
                    least = min(least, height)
                if least - radius[other] >= distance[c] - accuracy:
                    for k in range(3):
                        normal[c, k] = sign * direction[k]
                    found = True
                    break


@compiled()
def patch_ends(
    wide: Indices,
    pair: Indices,
    distance: Array,
    normal: Array,
    point_a: Array,
    point_b: Array,
    placement: Array,
    points: Array,
    point_start: Indices,
    point_count: Indices,
    faces: Array,
    face_start: Indices,
    face_count: Indices,
    radius: Array,
    axis: Array,
    is_capsule: NDArray[np.bool_],
    band: float,
    inset: float,
    shortest: float,
    most_ends: int,
) -> tuple[Indices, Array, Array]:
    """Ends of the patches of the contacts `wide`, at most `most_ends` each; arguments as in `ContactRowBuilder`.

    Returns:
        Contact (m,), point (m, 3) and gap (m,) of each row.
    """
    most = 0
    for c in wide:
        most += point_count[pair[c, 0]] + point_count[pair[c, 1]]
    contact = np.empty(most, dtype=np.intp)
    place = np.empty((most, 3))
    gap = np.empty(most)
    filled = 0
    base, along, lever = np.empty(3), np.empty(3), np.empty(3)
    for c in wide:
        first_begun, first_whole = filled, False
        for side in range(2):
            own, other = pair[c, side], pair[c, 1 - side]
            sign = 1.0 if side == 0 else -1.0
            witness = point_a[c] if side == 0 else point_b[c]
            facing = point_b[c] if side == 0 else point_a[c]
            begun = filled
            whole = True
            seen = False
            half_width = np.sqrt(2.0 * radius[other] * inset)
            for i in range(3):
                base[i] = 0.0
                for k in range(3):
                    base[i] += placement[other, i, k] * (
                        facing[k] + inset * sign * normal[c, k] - placement[other, 3, k]
                    )
            for number in range(point_start[own], point_start[own] + point_count[own]):
                height = 0.0
                for k in range(3):
                    lever[k] = placement[own, 3, k] - witness[k]
                    for i in range(3):
                        lever[k] += points[number, i] * placement[own, i, k]
                    height += lever[k] * sign * normal[c, k]
                drop = -height - radius[own]
                if drop >= band:
                    continue
                seen = True
                drop = max(drop, 0.0)
                length = 0.0
                for k in range(3):
                    lever[k] -= height * sign * normal[c, k]
                    length += lever[k] * lever[k]
                length = np.sqrt(length)
                for i in range(3):
                    along[i] = 0.0
                    for k in range(3):
                        along[i] += placement[other, i, k] * lever[k]
                reach = 1.0
                for f in range(face_start[other], face_start[other] + face_count[other]):
                    climb = faces[f, 0] * along[0] + faces[f, 1] * along[1] + faces[f, 2] * along[2]
                    if climb > 1e-12:
                        room = faces[f, 3] - (faces[f, 0] * base[0] + faces[f, 1] * base[1] + faces[f, 2] * base[2])
                        reach = min(reach, max(room, 0.0) / climb)
                sag = 0.0
                if is_capsule[other]:
                    down0, down1, down2 = 0.0, 0.0, 0.0
                    for k in range(3):
                        down0 += placement[other, 0, k] * sign * normal[c, k]
                        down1 += placement[other, 1, k] * sign * normal[c, k]
                        down2 += placement[other, 2, k] * sign * normal[c, k]
                    across0 = axis[other, 1] * down2 - axis[other, 2] * down1
                    across1 = axis[other, 2] * down0 - axis[other, 0] * down2
                    across2 = axis[other, 0] * down1 - axis[other, 1] * down0
                    norm = max(np.sqrt(across0 * across0 + across1 * across1 + across2 * across2), 1e-9)
                    offset = abs(across0 * along[0] + across1 * along[1] + across2 * along[2]) / norm
                    if offset > half_width:
                        reach = min(reach, half_width / max(offset, 1e-12))
                    sag = (reach * offset) ** 2 / (2.0 * radius[other])
                if reach < 1.0:
                    whole = False
                if length * reach > shortest:
                    contact[filled] = c
                    for k in range(3):
                        place[filled, k] = witness[k] + reach * lever[k]
                    gap[filled] = distance[c] + reach * drop + sag
                    filled += 1
            if side == 0:
                first_whole = whole and seen
                if first_whole:
                    break  # this side is the patch: the other side's points add nothing
            elif whole and seen:
                count = filled - begun
                for row in range(count):
                    contact[first_begun + row] = contact[begun + row]
                    place[first_begun + row] = place[begun + row]
                    gap[first_begun + row] = gap[begun + row]
                filled = first_begun + count
        if filled - first_begun > most_ends:
            _farthest_first(place[first_begun:filled], gap[first_begun:filled], point_a[c], most_ends)
            filled = first_begun + most_ends
    return contact[:filled], place[:filled], gap[:filled]


@compiled()
def _farthest_first(place: Array, gap: Array, witness: Array, count: int) -> None:
    """Move `count` places of a contact to the front, with their gaps: each the farthest from those before it.

    The first is the farthest from the witness point. `place` (m, 3) and `gap` (m,) are changed in place.
    """
    total = len(gap)
    away = np.empty(total)
    for row in range(total):
        away[row] = 0.0
        for k in range(3):
            away[row] += (place[row, k] - witness[k]) ** 2
    for chosen in range(count):
        best = chosen
        for row in range(chosen + 1, total):
            if away[row] > away[best]:
                best = row
        for k in range(3):
            place[chosen, k], place[best, k] = place[best, k], place[chosen, k]
        gap[chosen], gap[best] = gap[best], gap[chosen]
        away[chosen], away[best] = away[best], away[chosen]
        for row in range(chosen + 1, total):
            square = 0.0
            for k in range(3):
                square += (place[row, k] - place[chosen, k]) ** 2
            away[row] = square if chosen == 0 else min(away[row], square)


@compiled()
def contact_rows(
    pair: Indices,
    distance: Array,
    normal: Array,
    point_a: Array,
    point_b: Array,
    number: Indices,
    placement: Array,
    clearance: Array,
    extended: NDArray[np.bool_],
    joint: Indices,
    points: Array,
    point_start: Indices,
    point_count: Indices,
    faces: Array,
    face_start: Indices,
    face_count: Indices,
    radius: Array,
    axis: Array,
    is_capsule: NDArray[np.bool_],
    lengths: Array,
    most_ends: int,
    wrench: Array,
    gap: Array,
    contact: Indices,
    joints: Indices,
) -> int:
    """Write the rows of all contacts, as `ContactRowBuilder.write` does; how many there are.

    `lengths` holds the lever distance, band, inset, shortest lever, cosine of the same normal and room for it; the
    other arguments are as in `ContactRowBuilder` and `Contacts`.
    """
    count = len(distance)
    wide = np.empty(count, dtype=np.intp)
    found = 0
    for c in range(count):
        if extended[number[c]] and distance[c] < clearance[c] + lengths[0]:
            wide[found] = c
            found += 1
    wide = wide[:found]
    if found:
        snap_normals(
            wide, pair, distance, normal, placement, points, point_start, point_count, faces, face_start, face_count,
            radius, lengths[4], lengths[5],
        )  # fmt: skip
    for c in range(count):
        gap[c], contact[c] = distance[c], c
        joints[c, 0], joints[c, 1] = joint[pair[c, 0]], joint[pair[c, 1]]
        _wrench(normal[c], point_a[c], wrench[c])
    if not found:
        return count
    owner, place, open_by = patch_ends(
        wide, pair, distance, normal, point_a, point_b, placement, points, point_start, point_count, faces, face_start,
        face_count, radius, axis, is_capsule, lengths[1], lengths[2], lengths[3], most_ends,
    )  # fmt: skip
    for e in range(len(owner)):
        c, row = owner[e], count + e
        gap[row], contact[row] = open_by[e], c
        joints[row, 0], joints[row, 1] = joints[c, 0], joints[c, 1]
        _wrench(normal[c], place[e], wrench[row])
    return count + len(owner)


@compiled()
def _wrench(normal: Array, point: Array, wrench: Array) -> None:
    """[n, x cross n]."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        wrench[k] = normal[k]
        wrench[3 + k] = point[i] * normal[j] - point[j] * normal[i]
