"""The points of one instant at which a figure, and the things that touch it, can touch, and its joint limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Indices, cross
from wholebody.dynamics.rigid_bodies import RigidBodies
from wholebody.scene.matter.body import Surface

Moved = Mapping[str, tuple[pin.SE3, pin.SE3]]


class Points(NamedTuple):
    """Points at which a figure is touched, and its joint limits, as m points of which only the normal counts."""

    figure: Array  # (3 m, nv) velocities of the second body relative to the first along n, t1, t2, by those of joints
    things: Array  # (3 m, 6 b) the same by the twists of the bodies that move by themselves
    given: Array  # (3 m,) the same by what is moved, m/s
    gap: Array  # (m,) metres, radians
    friction: Array  # (m,)
    restitution: Array  # (m,)
    pushes: list[tuple[str, int, Array, Array]]  # name of such a body, its point's number, place (3,), axes (3, 3)
    bodies: list[str]  # (b,)
    driven: NDArray[np.bool_]  # (m,) points of what moves

    @staticmethod
    def room(count: int, freedoms: int, bodies: list[str]) -> Points:
        """Points of which nothing is known yet, near bodies that move by themselves."""
        rows, one = 3 * count, np.zeros(count)
        return Points(
            np.zeros((rows, freedoms)), np.zeros((rows, 6 * len(bodies))), np.zeros(rows), one, one.copy(), one.copy(),
            [], bodies, np.zeros(count, dtype=bool),
        )  # fmt: skip

    def add_owners(
        self,
        surfaces: Mapping[tuple[str, str], Surface],
        engine: RigidBodies | None,
        moved: Moved,
        owners: Sequence[tuple[str, str]],
        place: Array,
        directions: Array,
        time: float,
    ) -> None:
        """Add what the things at the first points are.

        Args:
            surfaces: what happens where both touch.
            engine: has the bodies.
            moved: things to their placements before and after the step.
            owners: (k,) both that touch, by name.
            place: (k, 3) points.
            directions: (k, 3, 6) rows that take a twist at the origin to velocities along the axes of each point.
            time: of the step, seconds.
        """
        places = {name: 6 * b for b, name in enumerate(self.bodies)}
        for c, both in enumerate(owners):
            self.restitution[c], self.friction[c] = surfaces[both]
            for owner, sign in zip(both, (-1.0, 1.0), strict=True):
                if owner not in places and owner not in moved:
                    continue
                here, axes, self.driven[c] = slice(3 * c, 3 * c + 3), directions[c, :, :3], True
                if owner in places and engine is not None:
                    b = places[owner]
                    lever = place[c] - engine.centre(owner)
                    self.things[here, b : b + 6] += sign * np.hstack([axes, axes @ pin.skew(lever).T])
                    self.pushes.append((owner, c, place[c], sign * axes))
                if owner in moved:
                    before, after = moved[owner]
                    self.given[here] += sign * directions[c] @ pin.log6(after * before.inverse()).vector / time


def axes_of(normal: Array) -> Array:
    """(m, 3, 3) normals (m, 3) and two tangents of each, one a row."""
    first = cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([normal, first, cross(normal, first)], axis=1)


def near_limits(
    model: pin.Model, limited: Indices, q: Array, velocity: Array, time: float
) -> list[tuple[int, float, float]]:
    """Freedoms that can come to a limit within a time, the sign of motion away from it, and how far it is.

    Args:
        model: has the limits.
        limited: (k, 2) places of freedoms in q and in the velocity.
        q: (nq,) posture.
        velocity: (nv,).
        time: seconds.
    """
    at, freedom = limited.T
    gaps = q[at] - model.lowerPositionLimit[at], model.upperPositionLimit[at] - q[at]
    near = [gap < 0.02 + 1.5 * time * np.abs(velocity[freedom]) for gap in gaps]  # rad, m
    return [(freedom[k], sign, gaps[s][k]) for s, sign in enumerate((1.0, -1.0)) for k in np.flatnonzero(near[s])]
