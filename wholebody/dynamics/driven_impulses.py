"""Impulses of a driven figure on things that move by themselves: equations 7 to 10 of Schmidl and Lin.

Overlap removal stops a hand at the surface of a thing that is in its way, and what the spring between tracker and hand
still wants there becomes an impulse. The hand's side of equation 9 is the joint's mass and inertia, with what it
carries; friction is capped where sliding ends.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.dynamics.rigid_bodies import RigidBodies
from wholebody.figures.state import State
from wholebody.geometry.proximity import Contacts, PairTable
from wholebody.scene.matter.materials import Surface

TOUCH = 1.5e-3  # m: nearer pieces touch; a figure stops short of things by less
ROUNDS = 10  # of impulses over all contacts: with several contacts one undoes a part of another
SLOW = 0.05  # m/s: slower approaches do not bounce, so that what is held lies still
LEAST = 1e-6  # m/s: slower approaches are none


class PushedContacts:
    """The contacts of one frame in which the figure touches things that move by themselves."""

    def __init__(
        self, engine: RigidBodies, state: State, table: PairTable, near: Contacts, bodies: Mapping[int, str]
    ) -> None:
        """Gather them.

        Args:
            engine: with the things.
            state: of the figure where it was stopped.
            table: pieces and pairs of the scene.
            near: pairs nearer than `TOUCH` there.
            bodies: piece to the thing it is part of, of things that move by themselves.
        """
        self._engine, self._state = engine, state
        self.rows: list[tuple[int, str, int, Array, Array]] = []
        """Joint, thing, piece of the figure or what it carries, point (3,), normal (3,) towards the thing."""
        for (first, second), normal, a, b in zip(
            near.pair.tolist(), near.normal, near.point_a, near.point_b, strict=True
        ):
            for own, other, out in ((first, second, normal), (second, first, -normal)):
                if other in bodies and table.joint[own] > 0:
                    self.rows.append((int(table.joint[own]), bodies[other], own, 0.5 * (a + b), out))

    def push(self, velocity: Array, surfaces: Mapping[tuple[int, str], Surface]) -> dict[str, Array]:
        """Give the things the impulses of a figure that wants to move.

        Args:
            velocity: (nv,) of the figure.
            surfaces: piece and thing to restitution and friction.

        Returns:
            Thing to its impulse (3,), N s.
        """
        engine, state = self._engine, self._state
        twists = (state.support * state.spread(velocity)) @ state.columns
        hands = [twists[joint, :3] + pin.skew(twists[joint, 3:]) @ point for joint, _, _, point, _ in self.rows]
        mobilities = [
            engine.mobility(thing, point) + self._mobility(joint, point) for joint, thing, _, point, _ in self.rows
        ]
        given: dict[str, Array] = {}
        for _ in range(ROUNDS):
            moved = False
            for (_, thing, piece, point, normal), hand, mobility in zip(self.rows, hands, mobilities, strict=True):
                relative = engine.velocity_at(thing, point) - hand
                impulse = contact_impulse(relative, normal, mobility, surfaces[piece, thing])
                if impulse is not None:
                    engine.push(thing, impulse, point)
                    given[thing] = given.get(thing, np.zeros(3)) + impulse
                    moved = True
            if not moved:
                break
        return given

    def _mobility(self, joint: int, point: Array) -> Array:
        """Change of velocity (3, 3) of a point of a joint's own mass by an impulse there; zero without mass."""
        inertia, place = self._state.model.inertias[joint], self._state.data.oMi[joint]
        if not (inertia.mass > 0.0 and np.linalg.eigvalsh(inertia.inertia).min() > 0.0):
            return np.zeros((3, 3))
        arm = pin.skew(point - place.act(inertia.lever))
        turned = place.rotation @ np.linalg.inv(inertia.inertia) @ place.rotation.T
        return np.asarray(np.eye(3) / inertia.mass - arm @ turned @ arm)


def contact_impulse(relative: Array, normal: Array, mobility: Array, surface: Surface) -> Array | None:
    """Impulse (3,) on body B of a contact, N s: equation 9, with friction of equation 10; None if they do not approach.

    Args:
        relative: (3,) velocity of B's point relative to A's.
        normal: (3,) from A to B.
        mobility: (3, 3) change of that velocity by an impulse on B, and its opposite on A.
        surface: restitution and friction.
    """
    approach = -float(normal @ relative)
    if approach <= LEAST:
        return None
    bounce = surface.restitution if approach > SLOW else 0.0
    size = (1.0 + bounce) * approach / float(normal @ mobility @ normal)
    impulse = size * normal
    sliding = relative + mobility @ impulse
    sliding = sliding - (normal @ sliding) * normal
    speed = float(np.linalg.norm(sliding))
    if speed > LEAST:
        along = sliding / speed
        impulse = impulse - min(surface.friction * size, speed / float(along @ mobility @ along)) * along
    return np.asarray(impulse)
