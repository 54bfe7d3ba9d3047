"""What a body's surface is: patches that bones move (linear blend skinning); and the garments that it is made of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array
from wholebody.figures.description import Articulated
from wholebody.figures.surface.fields import Field

DOWN = np.array((0.0, 0.0, -1.0))  # along a limb, in its axes


class Turn(NamedTuple):
    """How much a half bone turns of what its segment turns against the parent, by swing and twist (Grassia 1998)."""

    share: float = 0.5  # of the turn
    # With a direction (3,) of the limb in the parent's axes, the limb's z axis swings from there by the shortest way,
    # and of the twist about it there is a share too.
    twist: float = 1.0
    aside: tuple[float, float, float] | None = None


class Bone(NamedTuple):
    """What moves vertices."""

    segment: str  # the segment that it moves with; of a half, the segment that it turns half as much as
    parent: str | None  # of a half, the segment against which the turn is halved; None of others
    # the segment to move with, rigidly, in a figure that lacks `segment`; None where there is always one
    instead: str | None
    bind: Array  # (4, 4) placement in the world in the binding posture
    rest: Array  # (4, 4) placement relative to `instead` in such a figure
    # of a half, metres along its own axes by which it slides where `segment` is at a right angle to `parent`
    slide: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: Turn = Turn()  # of a half


def halfway(first: Array, second: Array, bone: Bone) -> Array:
    """Placement (4, 4) of a half bone between two; its origin is the second's + `slide` (3,) (1 - cosine of z axes)."""
    found = np.array(second)
    found[:3, :3] = first[:3, :3] @ turned(first[:3, :3].T @ second[:3, :3], bone.turn)
    found[:3, 3] += (1.0 - first[:3, 2] @ second[:3, 2]) * (found[:3, :3] @ np.asarray(bone.slide))
    return found


def turned(whole: Array, turn: Turn) -> Array:
    """How much (3, 3) a half bone turns of what its segment turns against the parent (3, 3)."""
    if turn.aside is not None:
        aside = np.array(turn.aside)
        swing = _shortest(aside, whole @ DOWN) @ _shortest(DOWN, aside)
        whole = swing @ pin.exp3(turn.twist * pin.log3(swing.T @ whole))
    return np.asarray(pin.exp3(turn.share * pin.log3(whole)))


def _shortest(start: Array, end: Array) -> Array:
    """The shortest turn (3, 3) from one unit vector (3,) to another."""
    return np.asarray(pin.Quaternion.FromTwoVectors(start, end).matrix())


class Patch(NamedTuple):
    """A part of the surface, of which most is moved by the bones of a segment."""

    # name, segment and color: such as "shirt:left_upper_arm", which is unique; its segment; red, green, blue
    name: str
    segment: str
    color: tuple[float, float, float]
    # vertices and normals: (n, 3) metres, in the world of the binding posture, and outward unit vectors
    vertices: Array
    normals: Array
    # bones and weights: (n, 4) indices of bones, and their influences, which add up to 1
    bones: NDArray[np.uint8]
    weights: Array
    faces: NDArray[np.int64]  # (m, 3) indices of vertices, wound outwards
    coarse: NDArray[np.int64]  # (k, 3) the same of fewer and larger triangles, for shadows and small pictures


class Surface(NamedTuple):
    """The surface of a body in its binding posture: what moves it, and patches that share the vertices of borders."""

    bones: tuple[Bone, ...]
    patches: tuple[Patch, ...]

    def attached(self, figure: Articulated, at: Array) -> list[tuple[str, Array]]:
        """The joint that carries each bone, and the bone in it (4, 4), in a figure whose world is `at` (4, 4)."""
        found = []
        for bone in self.bones:
            segment, extra = bone.segment, np.eye(4)
            if segment not in figure.segments and bone.instead is not None:
                segment, extra = bone.instead, bone.rest
            frame = figure.model.frames[figure.frame_id(segment)]
            offset = np.asarray(frame.placement.homogeneous) @ extra
            found.append((str(figure.model.names[frame.parentJoint]), offset if frame.parentJoint else at @ offset))
        return found

    @property
    def halves(self) -> list[tuple[int, int, int]]:
        """Bones that turn half way between two others, and are at the origin of the second: numbers of the three."""
        whole = {bone.segment: number for number, bone in enumerate(self.bones) if bone.parent is None}
        return [
            (number, whole[bone.parent], whole[bone.segment])
            for number, bone in enumerate(self.bones)
            if bone.parent is not None
        ]


class Claim(NamedTuple):
    """The region of a bone: its influence on a point is exp(-distance / softness)."""

    bone: str  # name of a segment, or "<segment>/half", which turns by half of what the segment turns
    field: Field  # distance from the region
    # metres over which the influence fades by e: a larger value bends joints over a longer stretch
    softness: float = 0.014


class Garment(NamedTuple):
    """A part of one colour, before it is made."""

    # name and color: such as "shirt", and red, green, blue
    name: str
    color: tuple[float, float, float]
    field: Field  # its solid in the world of the body's binding posture
    # low and high: (3,) corners of a box around it
    low: Array
    high: Array
    cell: float  # size of the grid's cells, metres
    claims: Sequence[Claim]  # regions of the bones that move it
    cuts: Sequence[Field] = ()  # half spaces that end it at sharp edges: hem, collar, cuffs


def bounds(points: Sequence[Array], margin: float) -> tuple[Array, Array]:
    """Return the corners of the box around points (3,), `margin` metres larger on every side."""
    every = np.array(points)
    return every.min(axis=0) - margin, every.max(axis=0) + margin
