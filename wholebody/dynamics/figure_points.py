"""The points of one instant at which a figure, and the things that touch it, can touch, and its joint limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array, cross
from wholebody.dynamics.pieces import surface_of
from wholebody.dynamics.rigid_bodies import RigidBodies
from wholebody.scene.scene import Scene

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

    def add_owners(
        self, scene: Scene, engine: RigidBodies | None, moved: Moved, owners: Sequence[tuple[str, str]], place: Array,
        directions: Array, time: float,
    ) -> None:  # fmt: skip
        """Add what the things at the first points are.

        Args:
            scene: has the surfaces.
            engine: has the bodies.
            moved: things to their placements before and after the step.
            owners: (k,) both that touch, by name.
            place: (k, 3) points.
            directions: (k, 3, 6) rows that take a twist at the origin to velocities along the axes of each point.
            time: of the step, seconds.
        """
        surfaces = {both: surface_of(scene, *both) for both in set(owners)}
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
