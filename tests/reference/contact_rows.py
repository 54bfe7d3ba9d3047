"""Exact face normals and the ends of contact patches in array code: what the compiled loops of contact rows must do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Indices
from wholebody.geometry import contact_rows as module
from wholebody.geometry.contact_rows import ContactRowBuilder, ContactRows
from wholebody.geometry.proximity import Contacts, PairTable


class ReferenceRowBuilder(ContactRowBuilder):
    """The builder of rows with array code in place of its loops."""

    def __init__(self, table: PairTable) -> None:
        super().__init__(table)
        self._points, self._point_start, self._point_count = table.points, table.first_point, np.diff(table.first_point)
        self._faces, self._face_start, self._face_count = table.faces, table.first_face, np.diff(table.first_face)
        self._radius, self._axis, self._is_capsule = table.radius, table.axis, table.axis.any(axis=1)

    def rows(self, contacts: Contacts, clearance: Array | float = 0.0) -> ContactRows:
        k = len(contacts.distance)
        joint = self.table.joint
        wide = np.flatnonzero(self.arrays[0][contacts.number] & (contacts.distance < clearance + module.LEVER_DISTANCE))
        if len(wide):
            self._snap(contacts, wide)
        wrench = _wrenches(contacts.normal, contacts.point_a)
        first, second = joint[contacts.pair[:, 0]], joint[contacts.pair[:, 1]]
        index = np.arange(k)
        if not len(wide):
            return ContactRows(contacts.distance, wrench, index, first, second)
        contact, point, gap = self._patch_ends(contacts, wide)
        return ContactRows(
            np.concatenate([contacts.distance, gap]),
            np.vstack([wrench, _wrenches(contacts.normal[contact], point)]),
            np.concatenate([index, contact]),
            np.concatenate([first, first[contact]]),
            np.concatenate([second, second[contact]]),
        )

    def _snap(self, contacts: Contacts, wide: Indices) -> None:
        placement = contacts.placements
        for side, sign in ((0, 1.0), (1, -1.0)):
            own, other = contacts.pair[wide, side], contacts.pair[wide, 1 - side]
            flat = np.flatnonzero((self._radius[own] == 0.0) & (self._point_count[other] > 0))
            entry, face = _expand(self._face_start, self._face_count, own[flat])
            contact = wide[flat[entry]]
            direction = np.einsum("ij,ijk->ik", self._faces[face, :3], placement[own[flat[entry]], :3])
            along = sign * np.einsum("ij,ij->i", direction, contacts.normal[contact])
            for row in np.flatnonzero(along >= module.SAME_NORMAL):
                c, piece = contact[row], contacts.pair[contact[row], 1 - side]
                points = self._points[self._point_start[piece] :][: self._point_count[piece]]
                heights = (
                    points @ placement[piece, :3] + placement[piece, 3] - placement[own[flat[entry[row]]], 3]
                ) @ (direction[row])
                apart = heights.min() - self._faces[face[row], 3] - self._radius[piece]
                if apart >= contacts.distance[c] - module.NORMAL_ROOM:
                    contacts.normal[c] = sign * direction[row]

    def _patch_ends(self, contacts: Contacts, wide: Indices) -> tuple[Indices, Array, Array]:
        """Ends of the contact patches: contact, point (m, 3) and gap of each."""
        count = len(wide)
        normal = contacts.normal[wide]
        # two sides a contact: a piece, the other one, the direction from it to the other, the witness points
        own = np.concatenate([contacts.pair[wide, 0], contacts.pair[wide, 1]])
        other = np.concatenate([own[count:], own[:count]])
        towards = np.concatenate([normal, -normal])
        witness = np.concatenate([contacts.point_a[wide], contacts.point_b[wide]])
        facing = np.concatenate([witness[count:], witness[:count]])
        distance = np.concatenate([contacts.distance[wide]] * 2)

        placement = contacts.placements
        side, local = _expand(self._point_start, self._point_count, own)
        placed = placement[own[side]]
        lever = np.einsum("ij,ijk->ik", self._points[local], placed[:, :3]) + placed[:, 3] - witness[side]
        height = np.einsum("ij,ij->i", lever, towards[side])
        drop = -height - self._radius[own[side]]  # how far the point stands behind the witness point, >= 0
        near = np.flatnonzero(drop < module.BAND)
        side, drop = side[near], np.maximum(drop[near], 0.0)
        lever = lever[near] - height[near, None] * towards[side]
        reach, sag = self._over_other(placement, other[side], facing[side], towards[side], lever)

        # a side whose points all lie over the other piece is the patch: the other side's points add nothing
        over = np.ones(2 * count, dtype=bool)
        np.logical_and.at(over, side, reach >= 1.0)
        has = np.zeros(2 * count, dtype=bool)
        has[side] = True
        whole: NDArray[np.bool_] = over & has
        partner = np.concatenate([whole[count:], whole[:count]])
        partner[:count] &= ~whole[:count]  # both whole: keep the first side
        length = np.sqrt(np.einsum("ij,ij->i", lever, lever)) * reach
        keep = np.flatnonzero((length > module.SHORTEST_LEVER) & ~partner[side])
        side, reach = side[keep], reach[keep]
        gap = distance[side] + reach * drop[keep] + sag[keep]
        point = witness[side] + reach[:, None] * lever[keep]
        contact = wide[side % count]
        order = np.argsort(contact, kind="stable")
        groups = np.split(order, np.flatnonzero(np.diff(contact[order])) + 1)
        kept = [
            _farthest_first(group, point, gap - distance[side], contacts.point_a[contact[group[:1]]])
            for group in groups
        ]
        order = np.concatenate(kept)
        return contact[order], point[order], gap[order]

    def _over_other(
        self, placements: Array, other: Indices, facing: Array, towards: Array, lever: Array
    ) -> tuple[Array, Array]:
        """How far along each lever the other piece is still below: share of the lever in [0, 1], and its sag there."""
        placement = placements[other]
        rotation = placement[:, :3]
        base = np.einsum("ijk,ik->ij", rotation, facing + module.INSET * towards - placement[:, 3])
        along = np.einsum("ijk,ik->ij", rotation, lever)
        reach = np.ones(len(other))
        sag = np.zeros(len(other))

        row, face = _expand(self._face_start, self._face_count, other)
        if len(row):
            plane = self._faces[face]
            climb = np.einsum("ij,ij->i", plane[:, :3], along[row])
            room = plane[:, 3] - np.einsum("ij,ij->i", plane[:, :3], base[row])
            rising = climb > 1e-12
            limit = np.where(rising, np.maximum(room, 0.0) / np.where(rising, climb, 1.0), 1.0)
            np.minimum.at(reach, row, limit)
            slope = -np.einsum("ij,ij->i", plane[:, :3], np.einsum("ijk,ik->ij", rotation, towards)[row])
            here = (slope > 0.0) & (room - module.INSET * slope < module.NORMAL_ROOM)  # faces of the witness point
            below = np.where(here, reach[row] * climb / np.where(here, slope, 1.0), 0.0)
            np.maximum.at(sag, row, np.minimum(below, module.INSET))

        capsule: Indices = np.flatnonzero(self._is_capsule[other])
        if len(capsule):
            axis = self._axis[other[capsule]]
            down = np.einsum("ijk,ik->ij", rotation[capsule], towards[capsule])
            across = np.cross(axis, down)
            norm = np.sqrt(np.einsum("ij,ij->i", across, across))
            radius = self._radius[other[capsule]]
            offset = np.abs(np.einsum("ij,ij->i", across, along[capsule])) / np.maximum(norm, 1e-9)
            width = np.sqrt(2.0 * radius * module.INSET)
            limit = np.where(offset > width, width / np.maximum(offset, 1e-12), 1.0)
            reach[capsule] = np.minimum(reach[capsule], limit)
            sag[capsule] = (reach[capsule] * offset) ** 2 / (2.0 * radius)
        return reach, sag


def _farthest_first(group: Indices, point: Array, beyond: Array, witness: Array) -> Indices:
    """Which MOST_ENDS rows of one contact to keep: the farthest from the witness point, then from those before.

    One that is SETBACK beyond the contact's distance counts as half as far away.
    """
    if len(group) <= module.MOST_ENDS:
        return group
    nearness = (module.SETBACK / (module.SETBACK + beyond[group])) ** 2
    away = nearness * ((point[group] - witness) ** 2).sum(axis=1)
    chosen = [int(np.argmax(away))]
    away = np.full(len(group), np.inf)
    while len(chosen) < module.MOST_ENDS:
        away = np.minimum(away, nearness * ((point[group] - point[group[chosen[-1]]]) ** 2).sum(axis=1))
        chosen.append(int(np.argmax(away)))
    return group[chosen]


def _expand(start: Indices, count: Indices, item: Indices) -> tuple[Indices, Indices]:
    """Flat table look-up: for each entry of `item` all its rows; (which entry, which row)."""
    counts = count[item]
    entry = np.repeat(np.arange(len(item)), counts)
    offset = np.arange(len(entry)) - np.repeat(np.cumsum(counts) - counts, counts)
    return entry, start[item][entry] + offset


def _wrenches(normal: Array, point: Array) -> Array:
    return np.hstack([normal, np.cross(point, normal)])
