"""The contacts of one step: what is the same however long the step becomes, and the program of its impulses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.arrays import Array, Indices, Mask
from wholebody.dynamics import contact_kernel, impact_kernel
from wholebody.dynamics.bodies_state import BodiesState
from wholebody.dynamics.contact_points import ContactPoints

SKIN = 5e-5  # m: gap at which bodies rest: coal's distances stay positive, its normals right to 0.02 rad
TOUCH = 1e-5  # m: a gap larger than SKIN by this still touches
SLOW = 0.02  # m/s: slower approaches are no impacts; 20 um of fall
TOLERANCE = 1e-5  # m/s: of the program of a step
SWEEPS = 200  # of it, at most
SAME_POINT = 0.01  # m: contact points nearer than this, in the body, are the same from step to step
MOST_EVENTS = 1000  # at one stop
RELAXED = 1e-9  # m/s: by which a step that ends with an impact may overshoot


class Impulses(NamedTuple):
    """Impulses of a program, from which the next one starts.

    Attributes:
        pair: (k,) pair of each point.
        local: (k, 3) the point in the first body's axes.
        impulse: (k, 3) on the second body, in the world, N s.
        time: of the step, seconds.
    """

    pair: Indices
    local: Array
    impulse: Array
    time: float


NOTHING = Impulses(np.zeros(0, dtype=np.intp), np.zeros((0, 3)), np.zeros((0, 3)), 1.0)


class StepProgram:
    """The contact points of a step and their program.

    Attributes:
        points: the contact points.
        speed: (m,) rate of each gap before the step, m/s.
        hits: (m,) time to the impact of each point; infinite where there is none.
        impulse: (m, 3) answer of `solve` along the axes of each point, N s.
        residuals: Signorini's and Coulomb's, m/s.
    """

    def __init__(self, state: BodiesState, points: ContactPoints, gravity: Array) -> None:
        """Lay out the points."""
        self.state, self.points, self.gravity = state, points, gravity
        pieces = state.pieces
        self._restitution, self._friction = pieces.restitution[points.pair], pieces.friction[points.pair]
        self.touching = points.gap <= SKIN + TOUCH
        self.inverse_mass = np.where(state.moving, 1.0 / pieces.mass, 0.0)
        self._laid = self._lay(self.inverse_mass, state.inverse_inertia(state.moving))
        self.impulse = np.zeros((len(points.gap), 3))
        self.residuals = (0.0, 0.0)
        self._local = state.local(points.first, points.point)
        self.look()

    def look(self, falling: Mask | None = None) -> None:
        """Read the present velocities: approaches and times of impact; `falling` (n,) are bodies that nothing bears."""
        state, points = self.state, self.points
        rates = state.relative(points.first, points.second, points.point)
        self.speed = (rates * points.normal).sum(axis=1)
        fall = (state.moving if falling is None else state.moving & falling)[:, None] * self.gravity
        self._pull = ((fall[points.second] - fall[points.first]) * points.normal).sum(axis=1)
        self.hits = times(points.gap - SKIN, self.speed, self._pull)
        self.hits[(self.speed > -SLOW) | self.touching] = np.inf

    def _lay(self, inverse_mass: Array, inverse_inertia: Array) -> tuple[Array, Array, Array, Array]:
        points, count = self.points, len(self.points.gap)
        laid = np.empty((count, 3, 3)), np.empty((count, 2, 3, 3)), np.empty((count, 2, 3, 3)), np.empty((count, 2))
        contact_kernel.frames(
            points.first, points.second, points.normal, points.point, self.state.position, inverse_mass,
            inverse_inertia, *laid,
        )  # fmt: skip
        return laid

    def resolve_impacts(self) -> tuple[Array, bool]:
        """Resolve the impacts of points that touch: events as in `impact_kernel.resolve`, and whether none is left.

        A body whose motion is given takes part with its mass, and keeps its motion afterwards.
        """
        if not (self.touching & (self.speed < -SLOW)).any():
            return np.zeros((0, 5)), True
        state, points = self.state, self.points
        weighed = state.moving | (state.given & np.isfinite(state.pieces.mass))
        inverse_mass = np.where(weighed, 1.0 / state.pieces.mass, 0.0)
        laid = self._lay(inverse_mass, state.inverse_inertia(weighed))
        velocity, spin, events = state.velocity.copy(), state.spin.copy(), np.zeros((MOST_EVENTS, 5))
        count, ended = impact_kernel.resolve(
            np.flatnonzero(self.touching), points.pair, points.first, points.second, *laid, self._restitution,
            self._friction, inverse_mass, velocity, spin, SLOW, MOST_EVENTS, np.zeros((len(points.gap), 3)), events,
        )  # fmt: skip
        state.velocity[state.moving], state.spin[state.moving] = velocity[state.moving], spin[state.moving]
        return events[:count], ended

    def solve(self, time: float, together: bool, old: Impulses) -> None:
        """Change the velocities to those at the end of a step of this time.

        Args:
            time: seconds.
            together: whether impacts during the step bounce by this program; else the step ends with the first.
            old: impulses of the step before.
        """
        state, points = self.state, self.points
        state.velocity[state.moving] += time * self.gravity
        target = np.where(points.gap > SKIN, (SKIN - points.gap) / time, 0.0)
        ends = self.hits <= time * (1.0 + 1e-9)
        if together:
            bouncing = ends | (self.touching & (self.speed < -SLOW))
            if bouncing.any():
                before = state.velocity.copy(), state.spin.copy()
                self._solve(np.where(bouncing, -self._restitution * self.speed, target), NOTHING)
                if self._lost(*before):
                    return
                state.velocity[:], state.spin[:] = before
        else:  # bodies that nothing bears move with the mean of both velocities
            target = np.where(ends, target + 0.5 * np.minimum(self._pull, 0.0) * time - RELAXED, target)
        self._solve(target, old._replace(impulse=old.impulse * (time / old.time)))

    def _solve(self, target: Array, old: Impulses) -> None:
        state, points = self.state, self.points
        axes, levers, answers, mobility = self._laid
        self.impulse[:] = 0.0
        if len(old.pair):
            head = np.full(len(state.pieces.table.pairs), -1, dtype=np.intp)
            contact_kernel.start_from(
                old.pair, old.local, old.impulse, head, points.pair, self._local, axes, SAME_POINT, self.impulse
            )
            contact_kernel.apply(
                points.first, points.second, axes, answers, self.inverse_mass, state.velocity, state.spin, self.impulse
            )
        contact_kernel.solve(
            np.arange(len(points.gap)), points.first, points.second, axes, levers, answers, mobility, self._friction,
            target, self.inverse_mass, state.velocity, state.spin, self.impulse, TOLERANCE, SWEEPS,
        )  # fmt: skip
        self.residuals = contact_kernel.residuals(
            points.first, points.second, axes, levers, mobility, self._friction, target, state.velocity, state.spin,
            self.impulse,
        )  # fmt: skip

    def _lost(self, velocity: Array, spin: Array) -> bool:
        """Whether the impulses since these velocities added no energy: their work is that along the mean velocity."""
        mean_v, mean_w = 0.5 * (velocity + self.state.velocity), 0.5 * (spin + self.state.spin)
        points = self.points
        rates = self.state.relative(points.first, points.second, points.point, mean_v, mean_w)
        return float((rates * self.world_impulse()).sum()) <= 0.0

    def world_impulse(self) -> Array:
        """Impulses (m, 3) on the second bodies, along the world's axes, N s."""
        return np.asarray(np.einsum("cr,crk->ck", self.impulse, self._laid[0]))

    def pushed(self) -> Mask:
        """Bodies (n,) on which a contact acts."""
        found: Mask = np.zeros(len(self.state.moving), dtype=bool)
        acting = self.impulse[:, 0] > 0.0
        found[self.points.first[acting]] = found[self.points.second[acting]] = True
        return found

    def remembered(self, time: float) -> Impulses:
        """What the next program starts from."""
        kept = np.flatnonzero(self.impulse[:, 0] > 0.0)
        return Impulses(self.points.pair[kept], self._local[kept], self.world_impulse()[kept], time)

    def parting(self, gap: float) -> tuple[Array, Array]:
        """Least displacements of all bodies, (n, 3) metres and (n, 3) radians, that part every point by a gap."""
        points = self.points
        axes, levers, answers, mobility = self._laid
        shift, turn = np.zeros_like(self.state.velocity), np.zeros_like(self.state.spin)
        contact_kernel.solve(
            np.arange(len(points.gap)), points.first, points.second, axes, levers, answers, mobility,
            np.zeros(len(points.gap)), gap - points.gap, self.inverse_mass, shift, turn, np.zeros((len(points.gap), 3)),
            0.01 * gap, SWEEPS,
        )  # fmt: skip
        return shift, turn


def times(gap: Array, speed: Array, pull: Array) -> Array:
    """First time at which gap + speed t + pull t^2 / 2 is zero, for gaps above zero; infinite if there is none."""
    root = speed**2 - 2.0 * pull * gap
    found = np.full(len(gap), np.inf)
    # the root in the form that does not cancel for an approach, speed < 0
    below = np.sqrt(np.maximum(root, 0.0)) - speed
    real = (root >= 0.0) & (below > 0.0) & (gap > 0.0)
    found[real] = 2.0 * gap[real] / below[real]
    return found
