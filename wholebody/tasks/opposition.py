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

from wholebody.arrays import Array
from wholebody.figures.state import State
from wholebody.records import with_values
from wholebody.tasks.surfaces import Surface, nearest

STEP = 1e-4  # m, rad: half of the differences that the derivative of a normal is made of
ROUND = 0.9  # share of a box's least half size by which its edges are rounded, so that normals turn on its faces
SHORTEST = 1e-6  # length of a mean normal, and sine of an angle, below which they have no direction


class Opposing(NamedTuple):
    """The normals of one contact and of several others on a thing within an angle of opposite: one row [rad].

    The row is the angle beyond it, zero within it.

    Attributes:
        first: surface on one side, such as a thumb.
        others: surfaces on the other, such as fingers.
        thing: what is between them.
        most: largest angle from opposite [rad].
    """

    first: Surface
    others: tuple[Surface, ...]
    thing: Surface
    most: float

    @property
    def in_radians(self) -> tuple[bool, ...]:
        """It is."""
        return (True,)

    def rows(self, state: State) -> tuple[Array, Array]:
        """The angle beyond, and wrenches on every finger."""
        surfaces, thing = (self.first, *self.others), rounded(self.thing)
        normals = np.array([nearest(surface, thing, state).normal for surface in surfaces])
        total = normals[1:].sum(axis=0)
        length = max(float(np.linalg.norm(total)), SHORTEST)
        mean = total / length
        cosine = float(np.clip(-normals[0] @ mean, -1.0, 1.0))
        value = float(np.arccos(cosine)) - self.most
        row = np.zeros((1, state.model.nv))
        if value <= 0.0:
            return np.zeros(1), row
        slope = 1.0 / max(float(np.sqrt(1.0 - cosine * cosine)), SHORTEST)  # of the angle by normals[0] @ mean
        on_first = slope * mean
        on_other = slope * (normals[0] - (normals[0] @ mean) * mean) / length
        for number, surface in enumerate(surfaces):
            force = on_first if number == 0 else on_other
            near = nearest(surface, thing, state)
            wrench = _by_twist(surface, thing, state, near.against) @ force
            joints = np.array([near.against]), np.array([near.joint])
            row += state.rows(wrench[None], *joints)
        return np.array([value]), row


def rounded(thing: Surface) -> Surface:
    """The surface with boxes smaller by the radius of their rounded edges; the normals on others stay."""
    shapes = []
    for shape in thing.shapes:
        if isinstance(shape, coal.Box):
            half = np.asarray(shape.halfSide)
            half = half - ROUND * half.min()
            shapes.append(coal.Box(*(2.0 * half)))
        else:
            shapes.append(shape)
    return with_values(thing, shapes=tuple(shapes))


def _by_twist(surface: Surface, thing: Surface, state: State, joint: int) -> Array:
    """Derivative (6, 3) of the normal by the velocity and rotation at the world's origin of a joint, by differences."""
    found = np.empty((6, 3))
    for axis in range(6):
        ends = []
        for sign in (1.0, -1.0):
            twist = np.zeros(6)
            twist[axis] = sign * STEP
            ends.append(nearest(surface.displaced(joint, pin.exp6(twist)), thing, state).normal)
        found[axis] = (ends[0] - ends[1]) / (2.0 * STEP)
    return found
