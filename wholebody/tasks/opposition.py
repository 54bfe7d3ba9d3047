"""Opposition: the surface of a thing is pressed from two sides, as a grasp needs to hold it.

The normal of a contact is the direction from a finger to the nearest point of the thing. Two contacts oppose where
their normals are antiparallel. By their angle from that a friction cone has to be wide: forces along the line between
two contacts hold a thing where both normals are within the friction angle of it (Nguyen 1988, "Constructing
force-closure grasps"). Of several fingers the mean of their normals counts.
"""

from __future__ import annotations

from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.records import with_values
from wholebody.figures.state import State
from wholebody.geometry.pieces import swept_points
from wholebody.tasks.axis import across
from wholebody.tasks.contact_parts import Gap
from wholebody.tasks.surfaces import Surface, between_pieces, nearest

STEP = 1e-4  # m, rad: half of the differences that the derivative of a normal is made of
SHORTEST = 1e-6  # length of a mean normal, and sine of an angle, below which they have no direction

AHEAD, BEHIND = ([pin.exp6(sign * STEP * axis) for axis in np.eye(6)] for sign in (1.0, -1.0))


class Opposing(NamedTuple):
    """The normals of one contact and of several others on a thing within an angle of opposite: one row [rad].

    The row is the angle beyond it, zero within it.

    Attributes:
        first: surface on one side, such as a thumb.
        others: surfaces on the other, such as fingers.
        thing: what is between them.
        smooth: the same with the edges of its boxes `rounded`, whose normals count.
        most: largest angle from opposite [rad].
        far: distance of the farthest contact from which the angle does not count; nearer, it counts more and more [m].
            Far away the normals say where the thing is, not how it is held.
    """

    first: Surface
    others: tuple[Surface, ...]
    thing: Surface
    smooth: Surface
    most: float
    far: float

    @property
    def in_radians(self) -> tuple[bool, ...]:
        """It is."""
        return (True,)

    def rows(self, state: State) -> tuple[Array, Array]:
        """The angle beyond, and wrenches on every finger."""
        surfaces, thing = (self.first, *self.others), self.thing
        distances = [nearest(surface, thing, state).distance for surface in surfaces]
        farthest = int(np.argmax(distances))
        share, fall = _share(distances[farthest], self.far)
        if share == 0.0:
            return np.zeros(1), np.zeros((1, state.model.nv))
        nears = [nearest(surface, self.smooth, state) for surface in surfaces]
        normals = np.array([near.normal for near in nears])
        total = normals[1:].sum(axis=0)
        length = max(float(np.linalg.norm(total)), SHORTEST)
        mean = total / length
        cosine = float(np.clip(-normals[0] @ mean, -1.0, 1.0))
        beyond = float(np.arccos(cosine)) - self.most
        if beyond <= 0.0:
            return np.zeros(1), np.zeros((1, state.model.nv))
        ahead = mean + cosine * normals[0]  # of the mean across the first normal: the angle grows along it
        sine = float(np.linalg.norm(ahead))
        toward = ahead / sine if sine > SHORTEST else perpendicular(normals[0])
        back = normals[0] + cosine * mean
        other = back / sine if sine > SHORTEST else perpendicular(mean)
        row = fall * beyond * Gap(surfaces[farthest], thing).rows(state)[1]
        for number, (surface, near) in enumerate(zip(surfaces, nears, strict=True)):
            force = share * (toward if number == 0 else other / length)
            wrench = _by_twist(surface, self.smooth, state, near.pieces) @ force
            row += state.rows(wrench[None], np.array([near.against]), np.array([near.joint]))
        return np.array([share * beyond]), row


def _share(distance: float, far: float) -> tuple[float, float]:
    """How much of the angle counts at the distance of the farthest contact [m], and the derivative; all at contact."""
    left = 1.0 - max(distance, 0.0) / far
    return (left * left, -2.0 * left / far * (distance > 0.0)) if left > 0.0 else (0.0, 0.0)


def perpendicular(direction: Array) -> Array:
    """A unit vector (3,) perpendicular to one."""
    return np.asarray(across(direction)[0])


def rounded(thing: Surface) -> Surface:
    """The surface with boxes smaller by the radius of their rounded edges; the normals on others stay."""
    shapes = []
    for shape in thing.shapes:
        if isinstance(shape, coal.Box):
            half = np.asarray(shape.halfSide)
            # share of a box's least half size by which its edges are rounded, so that normals turn on its faces
            half = half - 0.9 * half.min()
            shapes.append(coal.Box(*(2.0 * half)))
        else:
            shapes.append(shape)
    return with_values(thing, shapes=tuple(shapes), swept=tuple(swept_points(shape) for shape in shapes))


def _by_twist(surface: Surface, thing: Surface, state: State, pieces: tuple[int, int]) -> Array:
    """Derivative (6, 3) of the normal of two pieces by the twist of the first at the world's origin, by differences."""
    i, j = pieces
    place, other = surface.placed(i, state), thing.placed(j, state)
    found = np.empty((6, 3))
    for axis, (ahead, behind) in enumerate(zip(AHEAD, BEHIND, strict=True)):
        ends = [
            between_pieces(surface.shapes[i], moved * place, thing.shapes[j], other).normal for moved in (ahead, behind)
        ]
        found[axis] = (np.array(ends[0]) - np.array(ends[1])) / (2.0 * STEP)
    return found
