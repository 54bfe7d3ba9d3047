"""What a figure touches in a scene, or on its own body, and how thick its parts are there."""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.motion.held_points import HeldPoint, part_corners
from wholebody.motion.posture_fit import CLEARANCE
from wholebody.motion.roles import figure_roles
from wholebody.motion.solids import Placed, least_distance
from wholebody.motion.thing_contacts import ThingContact, Things, thickness

NEXT = "shoulder", "elbow", "knee", "ankle", "toe"  # where another part of a body begins: thighs sit


class Touched:
    """What a figure touches, and with which side."""

    def __init__(self, figure: Figure, things: Things, contacts: Sequence[ThingContact]) -> None:
        self.things, self.contacts, self._figure = things, contacts, figure
        self._data, own = figure.model.createData(), figure_roles(figure)
        ends = [frame for role, frame in own.items() if role.split("_")[-1] in NEXT]
        self._ends = set[int]()  # joints at which another part of the body begins
        for at in (figure.model.frames[figure.frame_id(frame)] for frame in ends):
            far = np.linalg.norm(at.placement.translation) > 1e-6  # the end of what the joint before carries
            here = at.parentJoint
            self._ends |= set(np.flatnonzero(np.array(figure.model.parents) == here).tolist()) if far else {here}

    def at(self, contact: ThingContact, frame: int) -> pin.SE3:
        """Where a thing is in a frame; what is held in the axes of a part of the body stays in these."""
        return pin.SE3.Identity() if contact.base else self.things.at(contact.thing, frame)

    def held(self, contact: ThingContact, point: HeldPoint, q: Array) -> Array:
        """(3,) where a point is held in a thing's axes, off it by the thickness of its part on that side."""
        pin.forwardKinematics(self._figure.model, self._data, q)
        normal = self._data.oMi[contact.base].rotation @ self.at(contact, contact.first).rotation @ contact.normal
        pieces = [piece for piece in self._figure.geometry.geometryObjects if piece.parentJoint == point.joint]
        away = thickness(pieces, point.place, -self._data.oMi[point.joint].rotation.T @ normal)
        if not self._carried(point.joint):
            away = contact.away
        return contact.place + (CLEARANCE + away) * contact.normal

    def rise(self, point: HeldPoint, q: Array) -> float:
        """How high a point is above the lowest of what its joint carries at a posture (nq,), metres."""
        pin.forwardKinematics(self._figure.model, self._data, q)
        low = part_corners(self._figure, self._data, point.joint)[:, 2].min(initial=np.inf)
        here = float(self._data.oMi[point.joint].act(point.place)[2])
        return max(here - float(low), 0.0)

    def gap(self, contact: ThingContact, point: HeldPoint, frame: int, q: Array, alone: bool = False) -> float:
        """Signed distance of a point's part, with what its joint carries, to a thing at a posture (nq,), metres.

        `alone`: without further parts of the body, as are the hands of somebody who sits.
        """
        pin.forwardKinematics(self._figure.model, self._data, q)
        own = self._part(point.joint, point.place, contact.away, alone=alone)
        if not contact.base:
            return self.things.distance(contact.thing, frame, own)
        center = contact.place - contact.away * contact.normal
        other = self._part(contact.base, center, contact.away, most=int(contact.thing.endswith("hand")))
        return least_distance(own, other)

    def _part(self, joint: int, center: Array, radius: float, most: int = 100, alone: bool = False) -> list[Placed]:
        """What a joint carries; where that is nothing, a ball about a place (3,), and the limb before it."""
        if carried := self._carried(joint, most, alone):
            return carried
        ball = coal.Sphere(max(radius, 1e-6)), self._data.oMi[joint] * pin.SE3(np.eye(3), center)
        bearing = {piece.parentJoint for piece in self._figure.geometry.geometryObjects}
        limb = max(bearing & set(self._figure.model.supports[joint]), default=joint)
        return [ball, *self._carried(limb, 0)]

    def _carried(self, joint: int, most: int = 100, alone: bool = False) -> list[Placed]:
        """Pieces on a joint and beyond it, over `most` joints with pieces at most; `alone`: to the body's next part."""
        model, geometry = self._figure.model, self._figure.geometry.geometryObjects
        bearing = {piece.parentJoint for piece in geometry}
        return [
            (piece.geometry, self._data.oMi[piece.parentJoint] * piece.placement)
            for piece in geometry
            if joint in (line := list(model.supports[piece.parentJoint]))
            and len(bearing & (beyond := set(line[line.index(joint) + 1 :]))) <= most
            and not (alone and beyond & self._ends)
        ]
