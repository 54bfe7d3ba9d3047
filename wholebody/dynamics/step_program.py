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
TOLERANCE = 1e-4  # m/s: of the program of a step; 0.4 um of its way
FEWEST, MOST, VISITS = 50, 1000, 40_000  # sweeps of it, and points times sweeps: more is exacter and slower
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


class _Laid(NamedTuple):
    """What the loops need of all points; see `contact_kernel`."""

    axes: Array
    jacobian: Array
    answer: Array
    mobility: Array


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
        self._touching = points.gap <= SKIN + TOUCH
        self._laid = self._lay(state.moving)
        self.impulse = np.zeros((len(points.gap), 3))
        self.residuals = (0.0, 0.0)
        self._local = state.local(points.bodies[:, 0], points.point)
        self.look(state.moving)

    def look(self, falling: Mask) -> None:
        """Read the present velocities: approaches and times of impact; `falling` (n,) are bodies that nothing bears."""
        bodies, normal = self.points.bodies, self.points.normal
        self.speed = self._rates(self.state.twist)[:, 0]
        fall = (self.state.moving & falling).astype(float)
        self._pull = (fall[bodies[:, 1]] - fall[bodies[:, 0]]) * (normal @ self.gravity)
        self.hits = times(self.points.gap - SKIN, self.speed, self._pull)
        self.hits[(self.speed > -SLOW) | self._touching] = np.inf

    def _rates(self, twist: Array) -> Array:
        """Relative velocities (m, 3) along the axes of the points."""
        found = np.empty((len(self.points.gap), 3))
        contact_kernel.rates(self.points.bodies, self._laid.jacobian, twist, found)
        return found

    def _lay(self, movable: Mask) -> _Laid:
        state, points, count = self.state, self.points, len(self.points.gap)
        laid = _Laid(
            np.empty((count, 3, 3)), np.empty((count, 3, 2, 6)), np.empty((count, 3, 2, 6)), np.empty((count, 2))
        )
        contact_kernel.lay(
            points.bodies, points.normal, points.point, state.position, np.where(movable, 1.0 / state.pieces.mass, 0.0),
            state.inverse_inertia(movable), *laid,
        )  # fmt: skip
        return laid

    def resolve_impacts(self) -> tuple[Array, bool]:
        """Resolve the impacts of points that touch: events as in `impact_kernel.resolve`, and whether none is left.

        A body whose motion is given takes part with its mass, and keeps its motion afterwards.
        """
        if not (self._touching & (self.speed < -SLOW)).any():
            return np.zeros((0, 5)), True
        state, points = self.state, self.points
        weighed = state.given & np.isfinite(state.pieces.mass)
        laid = self._lay(state.moving | weighed) if weighed.any() else self._laid
        twist, events = state.twist.copy(), np.zeros((MOST_EVENTS, 5))
        count, ended = impact_kernel.resolve(
            np.flatnonzero(self._touching), points.pair, points.bodies, *laid, self._restitution, self._friction, twist,
            SLOW, MOST_EVENTS, np.zeros((len(points.gap), 3)), events,
        )  # fmt: skip
        state.twist[state.moving] = twist[state.moving]
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
        start = old._replace(impulse=old.impulse * (time / old.time))
        if together:
            bouncing = ends | (self._touching & (self.speed < -SLOW))
            if bouncing.any():
                before = state.twist.copy()
                self._solve(np.where(bouncing, -self._restitution * self.speed, target), start)
                # the work of the impulses is that along the mean of the velocities before and after
                if float((self._rates(0.5 * (before + state.twist)) * self.impulse).sum()) <= 0.0:
                    return
                state.twist[:] = before
        else:  # bodies that nothing bears move with the mean of both velocities
            target = np.where(ends, target + 0.5 * np.minimum(self._pull, 0.0) * time - RELAXED, target)
        self._solve(target, start)

    def _solve(self, target: Array, start: Impulses) -> None:
        state, points = self.state, self.points
        axes, jacobian, answer, mobility = self._laid
        self.impulse[:] = 0.0
        if len(start.pair):
            head = np.full(len(state.pieces.table.pairs), -1, dtype=np.intp)
            contact_kernel.start_from(*start[:3], head, points.pair, self._local, axes, SAME_POINT, self.impulse)
            contact_kernel.apply(points.bodies, answer, state.twist, self.impulse)
        contact_kernel.solve(
            np.arange(len(points.gap)), points.bodies, jacobian, answer, mobility, self._friction, target, state.twist,
            self.impulse, TOLERANCE, sweeps(len(points.gap)),
        )  # fmt: skip
        self.residuals = contact_kernel.residuals(
            points.bodies, jacobian, mobility, self._friction, target, state.twist, self.impulse
        )

    def world_impulse(self) -> Array:
        """Impulses (m, 3) on the second bodies, along the world's axes, N s."""
        return np.asarray(np.einsum("cr,crk->ck", self.impulse, self._laid.axes))

    def pushed(self) -> Mask:
        """Bodies (n,) on which a contact acts."""
        found: Mask = np.zeros(len(self.state.moving), dtype=bool)
        found[self.points.bodies[self.impulse[:, 0] > 0.0]] = True
        return found

    def remembered(self, time: float) -> Impulses:
        """What the next program starts from."""
        kept = np.flatnonzero(self.impulse[:, 0] > 0.0)
        return Impulses(self.points.pair[kept], self._local[kept], self.world_impulse()[kept], time)

    def parting(self, gap: float) -> Array:
        """Least displacements (n, 6) of all bodies, metres and radians, that part every point by a gap."""
        points, count = self.points, len(self.points.gap)
        _, jacobian, answer, mobility = self._laid
        way = np.zeros_like(self.state.twist)
        contact_kernel.solve(
            np.arange(count), points.bodies, jacobian, answer, mobility, np.zeros(count), gap - points.gap, way,
            np.zeros((count, 3)), 0.01 * gap, sweeps(count),
        )  # fmt: skip
        return way


def sweeps(count: int) -> int:
    """Most sweeps for a number of points."""
    return min(max(VISITS // max(count, 1), FEWEST), MOST)


def times(gap: Array, speed: Array, pull: Array) -> Array:
    """First time at which gap + speed t + pull t^2 / 2 is zero, for gaps above zero; infinite if there is none."""
    root = speed**2 - 2.0 * pull * gap
    found = np.full(len(gap), np.inf)
    # the root in the form that does not cancel for an approach, speed < 0
    below = np.sqrt(np.maximum(root, 0.0)) - speed
    real = (root >= 0.0) & (below > 0.0) & (gap > 0.0)
    found[real] = 2.0 * gap[real] / below[real]
    return found
