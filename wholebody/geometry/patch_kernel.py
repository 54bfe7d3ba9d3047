"""Exact face normals and the ends of contact patches, as compiled loops: see `contact_rows`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.compiled import compiled
from wholebody.geometry.records import Contacts, PieceArrays, RowRoom, RowSettings


@compiled(inner=True)
def snap_normals(wide: Indices, contacts: Contacts, pieces: PieceArrays, near: float, accuracy: float) -> None:
    """Put the exact normal of a face where coal's is that normal but for rounding; it is changed in place.

    Args:
        wide: the contacts that are looked at.
        contacts: see `Contacts`.
        pieces: see `PieceArrays`.
        near: least cosine of the angle to a face's normal.
        accuracy: metres by which a face's normal may part the pieces by less than coal's does.
    """
    placement, normal, distance, pair = contacts.placements, contacts.normal, contacts.distance, contacts.pair
    points, first_point, radius = pieces.points, pieces.first_point, pieces.radius
    faces, first_face = pieces.faces, pieces.first_face
    direction, turned = np.empty(3), np.empty(3)
    for c in wide:
        found = False
        for side in range(2):
            own, other = pair[c, side], pair[c, 1 - side]
            first, last = first_point[other], first_point[other + 1]
            if found or radius[own] > 0.0 or first == last:
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
                for p in range(first, last):
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


class Band(NamedTuple):
    """The points of one piece that are near the separating plane of a contact; room for those of any piece.

    Attributes:
        lever: (3, n) from the witness point to each, along the plane, in the world's axes, metres.
        along: (3, n) the same in the other piece's axes.
        length: (n,) of the levers.
        drop: (n,) how much farther than the witness point from the plane.
        outside: (n,) the lever as a multiple of what is over the other piece, at least 1.
        vectors: (3, 3) room.
    """

    lever: Array
    along: Array
    length: Array
    drop: Array
    outside: Array
    vectors: Array


class Ends(NamedTuple):
    """Room for ends of patches: the contact (m,), the place (m, 3) and the gap (m,) of each."""

    contact: Indices
    place: Array
    gap: Array


@compiled(inner=True)
def patch_ends(wide: Indices, contacts: Contacts, pieces: PieceArrays, settings: RowSettings) -> tuple[Ends, int]:
    """Ends of the patches of the contacts `wide`, and how many there are; at most `settings.most_ends` of each."""
    pair, first_point, most, most_points = contacts.pair, pieces.first_point, 0, 0
    for c in wide:
        for side in range(2):
            piece = pair[c, side]
            count = first_point[piece + 1] - first_point[piece]
            most += count
            most_points = max(most_points, count)
    ends = Ends(np.empty(most, dtype=np.intp), np.empty((most, 3)), np.empty(most))
    band = Band(
        np.empty((3, most_points)), np.empty((3, most_points)), np.empty(most_points), np.empty(most_points),
        np.empty(most_points), np.empty((3, 3)),
    )  # fmt: skip
    filled = 0
    for c in wide:
        begun = filled
        filled, whole = _ends_of_side(c, 0, contacts, pieces, settings, band, ends, begun)
        if not whole:  # else this side is the patch: the other side's points add nothing
            first = filled
            filled, whole = _ends_of_side(c, 1, contacts, pieces, settings, band, ends, first)
            if whole:
                for row in range(filled - first):
                    ends.contact[begun + row] = ends.contact[first + row]
                    ends.gap[begun + row] = ends.gap[first + row]
                    for k in range(3):
                        ends.place[begun + row, k] = ends.place[first + row, k]
                filled = begun + filled - first
        if filled - begun > settings.most_ends:
            _farthest_first(
                ends.place[begun:filled], ends.gap[begun:filled], contacts.point_a[c], contacts.distance[c],
                settings.setback, settings.most_ends,
            )  # fmt: skip
            filled = begun + settings.most_ends
    return ends, filled


@compiled(inner=True)
def _ends_of_side(
    c: int, side: int, contacts: Contacts, pieces: PieceArrays, settings: RowSettings, band: Band, ends: Ends,
    filled: int,
) -> tuple[int, bool]:  # fmt: skip
    """Write the ends of a contact that are points of one of its pieces, after the `filled` first.

    Returns:
        How many are filled then, and whether there are points near the plane, all of them over the other piece.
    """
    own, other = contacts.pair[c, side], contacts.pair[c, 1 - side]
    sign = 1.0 if side == 0 else -1.0
    witness = contacts.point_a[c] if side == 0 else contacts.point_b[c]
    facing = contacts.point_b[c] if side == 0 else contacts.point_a[c]
    normal, place = contacts.normal[c], contacts.placements[other]
    count = _points_in_band(own, witness, normal, sign, contacts.placements[own], pieces, settings.band, band)
    if count == 0:
        return filled, False
    _turn_levers(place, count, band)
    shift, base, across = band.vectors[0], band.vectors[1], band.vectors[2]
    for k in range(3):
        shift[k] = facing[k] + settings.inset * sign * normal[k] - place[3, k]
    _to_frame(place, shift, 1.0, base)
    _measure_against_faces(other, base, count, pieces, band)
    axis = pieces.axis[other]
    capsule = axis[0] != 0.0 or axis[1] != 0.0 or axis[2] != 0.0
    if capsule:
        _to_frame(place, normal, sign, base)
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            across[k] = axis[i] * base[j] - axis[j] * base[i]
        norm = max(np.sqrt(across[0] * across[0] + across[1] * across[1] + across[2] * across[2]), 1e-9)
        for k in range(3):
            across[k] /= norm
    radius, distance, shortest = pieces.radius[other], contacts.distance[c], settings.shortest_lever
    half_width = np.sqrt(2.0 * radius * settings.inset)
    lever, along, length, drop, outside = band.lever, band.along, band.length, band.drop, band.outside
    end_contact, end_place, end_gap = ends.contact, ends.place, ends.gap
    whole = True
    for e in range(count):
        reach = 1.0 / outside[e]
        sag = 0.0
        if capsule:
            offset = abs(across[0] * along[0, e] + across[1] * along[1, e] + across[2] * along[2, e])
            if offset > half_width:
                reach = min(reach, half_width / max(offset, 1e-12))
            sag = (reach * offset) ** 2 / (2.0 * radius)
        whole = whole and reach >= 1.0
        if length[e] * reach > shortest:
            end_contact[filled] = c
            for k in range(3):
                end_place[filled, k] = witness[k] + reach * lever[k, e]
            end_gap[filled] = distance + reach * drop[e] + sag
            filled += 1
    return filled, whole


@compiled(inner=True)
def _points_in_band(
    own: int, witness: Array, normal: Array, sign: float, placement: Array, pieces: PieceArrays, width: float,
    band: Band,
) -> int:  # fmt: skip
    """Write levers, lengths and drops of a piece's points within `width` of the plane into `band`; how many."""
    points, radius, down = pieces.points, pieces.radius[own], band.vectors[0]
    lever, length, drop = band.lever, band.length, band.drop
    _to_frame(placement, normal, sign, down)
    above = 0.0
    for k in range(3):
        above += (placement[3, k] - witness[k]) * sign * normal[k]
    count = 0
    for number in range(pieces.first_point[own], pieces.first_point[own + 1]):
        height = above + points[number, 0] * down[0] + points[number, 1] * down[1] + points[number, 2] * down[2]
        if -height - radius >= width:
            continue
        drop[count] = max(-height - radius, 0.0)
        square = 0.0
        for k in range(3):
            step = placement[3, k] - witness[k] - height * sign * normal[k]
            for i in range(3):
                step += points[number, i] * placement[i, k]
            lever[k, count] = step
            square += step * step
        length[count] = np.sqrt(square)
        count += 1
    return count


@compiled(inner=True)
def _turn_levers(placement: Array, count: int, band: Band) -> None:
    """Write the levers in the axes of the other piece."""
    lever, along = band.lever, band.along
    for i in range(3):
        for e in range(count):
            along[i, e] = placement[i, 0] * lever[0, e] + placement[i, 1] * lever[1, e] + placement[i, 2] * lever[2, e]


@compiled(inner=True)
def _measure_against_faces(other: int, base: Array, count: int, pieces: PieceArrays, band: Band) -> None:
    """Write how far the levers, from the point `base` of the other piece, lead out of its faces."""
    faces, along, length, outside, longest = pieces.faces, band.along, band.length, band.outside, 0.0
    for e in range(count):
        outside[e] = 1.0
        longest = max(longest, length[e])
    for f in range(pieces.first_face[other], pieces.first_face[other + 1]):
        x, y, z = faces[f, 0], faces[f, 1], faces[f, 2]
        room = faces[f, 3] - x * base[0] - y * base[1] - z * base[2]
        if room < longest:  # else no lever leads out of this face
            share = 1.0 / max(room, 1e-12)
            for e in range(count):
                climb = share * (x * along[0, e] + y * along[1, e] + z * along[2, e])
                if climb > outside[e]:
                    outside[e] = climb


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
def contact_rows(
    contacts: Contacts, clearance: Array, extended: Mask, pieces: PieceArrays, settings: RowSettings, rows: RowRoom
) -> int:
    """Write the rows of all contacts, as `ContactRowBuilder.write` does; how many there are.

    Args:
        contacts: the near pairs.
        clearance: (k,) distance asked of each, metres.
        extended: (p,) whether a pair has more than its witness row.
        pieces: see `PieceArrays`.
        settings: see `RowSettings`.
        rows: room for the rows.
    """
    pair, distance, normal, point_a = contacts.pair, contacts.distance, contacts.normal, contacts.point_a
    number, joint = contacts.number, pieces.joint
    wrench, gap, contact, joints = rows.wrench, rows.gap, rows.contact, rows.joints
    count = len(distance)
    wide = np.empty(count, dtype=np.intp)
    found = 0
    for c in range(count):
        if extended[number[c]] and distance[c] < clearance[c] + settings.lever_distance:
            wide[found] = c
            found += 1
    wide = wide[:found]
    if found:
        snap_normals(wide, contacts, pieces, settings.same_normal, settings.normal_room)
    for c in range(count):
        gap[c], contact[c] = distance[c], c
        joints[c, 0], joints[c, 1] = joint[pair[c, 0]], joint[pair[c, 1]]
        _wrench(normal[c], point_a[c], wrench[c])
    if not found:
        return count
    ends, more = patch_ends(wide, contacts, pieces, settings)
    owner, place, open_by = ends.contact, ends.place, ends.gap
    for e in range(more):
        c, row = owner[e], count + e
        gap[row], contact[row] = open_by[e], c
        joints[row, 0], joints[row, 1] = joints[c, 0], joints[c, 1]
        _wrench(normal[c], place[e], wrench[row])
    return count + more


@compiled(inner=True)
def _wrench(normal: Array, point: Array, wrench: Array) -> None:
    """[n, x cross n]."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        wrench[k] = normal[k]
        wrench[3 + k] = point[i] * normal[j] - point[j] * normal[i]
