"""The contacts and joints of one step: what is the same however long it becomes, and the program of its impulses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.records import with_values
from wholebody.dynamics import contact_kernel, energy_kernel, impact_kernel, solve_kernel
from wholebody.dynamics.bodies_state import BodiesState
from wholebody.dynamics.contact_points import ContactPoints
from wholebody.dynamics.joints import JointRows, Joints

SKIN = 5e-5  # m: gap at which bodies rest: coal's distances stay positive, its normals right to 0.02 rad
TOUCH = 1e-5  # m: a gap larger than SKIN by this still touches
SLOW = 0.02  # m/s: slower approaches are no impacts; 20 um of fall
TOLERANCE = 1e-4  # m/s: of the program of a step; 0.4 um of its way
UNSOLVED = 1.2e-4  # m/s: of points that push against what is moved; their impulses are not started from again
MOST, VISITS = 1000, 20_000  # sweeps of it, and points times sweeps: more is exacter and slower
SAME_POINT = 0.01  # m: contact points nearer than this, in the body, are the same from step to step
MOST_EVENTS = 1000  # at one stop
RELAXED = 1e-9  # m/s: by which a step that ends with an impact may overshoot


class Impulses(NamedTuple):
    """Impulses of a program, from which the next one starts.

    Attributes:
        pair: (k,) pair of each point.
        local: (k, 3) the point in the first body's axes.
        impulse: (k, 3) on the second body, in the world, N s.
        joint: (j, 3) of the joint points, likewise.
        time: of the step, seconds.
    """

    pair: Indices
    local: Array
    impulse: Array
    joint: Array
    time: float

    @staticmethod
    def nothing(joints: int) -> Impulses:
        """Zero, for a number of joint points."""
        return Impulses(np.zeros(0, dtype=np.intp), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((joints, 3)), 1.0)

    def over(self, time: float) -> Impulses:
        """The same forces during another time."""
        share = time / self.time
        return with_values(self, impulse=share * self.impulse, joint=share * self.joint, time=time)


class _PointRows(NamedTuple):
    """What the loops need of all points, those of joints at the end; see `contact_kernel` and `solve_kernel`."""

    bodies: Indices
    axes: Array
    jacobian: Array
    response: Array
    mobility: Array
    effective_mass: Array


class StepProgram:
    """The contact points of a step and their program.

    Attributes:
        points: the contact points.
        speed: (m,) rate of each gap before the step, m/s.
        hits: (m,) time to the impact of each point; infinite where there is none.
        impulse: (m + j, 3) what `solve` found, along the axes of each point, N s; those of joints are at the end.
        residuals: Signorini's and Coulomb's, m/s.
    """

    def __init__(self, state: BodiesState, points: ContactPoints, gravity: Array, joints: Joints) -> None:
        """Compute the rows of the points."""
        self.state, self.points, self.gravity, self.joints = state, points, gravity, joints
        pieces = state.pieces
        self._restitution, self._friction = pieces.restitution[points.pair], pieces.friction[points.pair]
        self._touching = points.gap <= SKIN + TOUCH
        self._until = np.full(len(points.gap), np.inf)  # s: for which each gap has to last, at most
        self._rows = self._point_rows(state.moving)
        self.impulse = np.zeros((len(points.gap) + len(joints), 3))
        self.residuals = (0.0, 0.0)
        self._jammed = np.zeros(len(points.gap), dtype=bool)
        self._local = state.local(points.bodies[:, 0], points.point)
        self.read_velocities(state.moving)

    def read_velocities(self, falling: Mask) -> None:
        """Read the present velocities: approaches and times of impact; `falling` (n,) are bodies that nothing bears."""
        bodies, normal = self.points.bodies, self.points.normal
        self.speed = self._rates(self.state.twist)[: len(normal), 0]
        fall = (self.state.moving & falling).astype(float)
        self._pull = (fall[bodies[:, 1]] - fall[bodies[:, 0]]) * (normal @ self.gravity)
        self.hits = impact_times(self.points.gap - SKIN, self.speed, self._pull)
        self.hits[(self.speed > -SLOW) | self._touching] = np.inf

    def _rates(self, twist: Array) -> Array:
        """Relative velocities (m + j, 3) along the axes of the points."""
        found = np.empty((len(self._rows.bodies), 3))
        contact_kernel.rates(self._rows.bodies, self._rows.jacobian, twist, found)
        return found

    def _point_rows(self, movable: Mask) -> _PointRows:
        state, points, joints = self.state, self.points, self.joints
        count, whole = len(points.gap), len(points.gap) + len(joints)
        bodies = np.concatenate([points.bodies, joints.bodies]) if len(joints) else points.bodies
        rows = _PointRows(
            bodies, np.empty((count, 3, 3)), np.empty((whole, 3, 2, 6)), np.empty((whole, 3, 2, 6)),
            np.empty((whole, 2)), np.empty((len(joints), 3, 3)),
        )  # fmt: skip
        contact_kernel.write_rows(
            points.bodies, points.normal, points.point, state.position, np.where(movable, 1.0 / state.pieces.mass, 0.0),
            state.inverse_inertia(movable), rows.axes, rows.jacobian, rows.response, rows.mobility,
        )  # fmt: skip
        if len(joints):
            own = (rows.jacobian[count:], rows.response[count:], rows.mobility[count:], rows.effective_mass)
            joints.write_rows(state, movable, JointRows(*own))
        return rows

    def add_points(self, points: ContactPoints, time: float, share: float = 1.0) -> None:
        """Add contact points as they are after a share of a step, which led to overlap that no point foresaw.

        Their gaps become those that lead there with the velocities after the step, of this time; they have to last for
        the share of it only.
        """
        late = StepProgram(self.state, points, self.gravity, self.joints)
        late.read_velocities(~self.pushed())
        until = share * time
        gap = points.gap - until * late.speed + 0.5 * late._pull * until**2
        count, own, rows = len(self.points.gap), late._rows, self._rows
        self._local = np.concatenate([self._local, late._local])
        self._restitution = np.concatenate([self._restitution, late._restitution])
        self._friction = np.concatenate([self._friction, late._friction])
        self._jammed = np.zeros(count + len(gap), dtype=bool)
        self._touching = np.concatenate([self._touching, gap <= SKIN + TOUCH])
        self._until = np.concatenate([self._until, np.full(len(gap), until)])
        joined = (np.concatenate(both) for both in zip(self.points, with_values(points, gap=gap), strict=True))
        self.points = ContactPoints(*joined)
        bodies, jacobian, response, mobility = (
            np.concatenate([one[:count], other[: len(gap)], one[count:]])
            for one, other in (
                (rows.bodies, own.bodies), (rows.jacobian, own.jacobian), (rows.response, own.response),
                (rows.mobility, own.mobility),
            )
        )  # fmt: skip
        axes = np.concatenate([rows.axes, own.axes])
        self._rows = _PointRows(bodies.astype(np.intp), axes, jacobian, response, mobility, rows.effective_mass)
        # what bears a body is known to the next points that join the step
        self.impulse = np.concatenate([self.impulse[:count], np.zeros((len(gap), 3)), self.impulse[count:]])

    def resolve_impacts(self) -> tuple[Array, bool]:
        """Resolve the impacts of points that touch: events as in `impact_kernel.resolve`, and whether none is left.

        A body whose motion is given takes part with its mass, and keeps its motion afterwards.
        """
        if not (self._touching & (self.speed < -SLOW)).any():
            return np.zeros((0, 5)), True
        state, points = self.state, self.points
        weighed = state.given & np.isfinite(state.pieces.mass)
        rows = self._point_rows(state.moving | weighed) if weighed.any() else self._rows
        twist, events = state.twist.copy(), np.zeros((MOST_EVENTS, 5))
        count, ended = impact_kernel.resolve(
            np.flatnonzero(self._touching), points.pair, rows.bodies, rows.axes, rows.jacobian, rows.response,
            rows.mobility, self._restitution, self._friction, rows.effective_mass, self.joints.jointed, twist, SLOW,
            MOST_EVENTS, np.zeros_like(self.impulse), events,
        )  # fmt: skip
        state.twist[state.moving] = twist[state.moving]
        return events[:count], ended

    def solve(self, time: float, together: bool, old: Impulses, hold: Array) -> None:
        """Change the velocities to those at the end of a step of this time, which adds no energy.

        Args:
            time: seconds.
            together: whether impacts during the step bounce by this program; else the step ends with the first.
            old: impulses of the step before.
            hold: (j, 3) velocity of the joint points of B seen from those of A, m/s.
        """
        state, points = self.state, self.points
        began = state.twist.copy()
        state.velocity[state.moving] += time * self.gravity
        target = np.where(points.gap > SKIN, (SKIN - points.gap) / np.minimum(time, self._until), 0.0)
        ends = self.hits <= time * (1.0 + 1e-9)
        start = old.over(time)
        if together:
            bouncing = ends | (self._touching & (self.speed < -SLOW))
            if bouncing.any():
                before = state.twist.copy()
                self._solve(np.where(bouncing, -self._restitution * self.speed, target), start, hold)
                # the work of the impulses is that along the mean of the velocities before and after
                rates = self._rates(0.5 * (before + state.twist))
                rates[len(target) :] -= 0.5 * hold  # what closes joints is no work
                if float((rates * self.impulse).sum()) <= 0.0:
                    self._restrain(began, time, target)
                    return
                state.twist[:] = before
        else:  # bodies that nothing bears move with the mean of both velocities
            target = np.where(ends, target + 0.5 * np.minimum(self._pull, 0.0) * time - RELAXED, target)
        self._solve(target, start, hold)
        self._restrain(began, time, target)

    def _restrain(self, began: Array, time: float, target: Array) -> None:
        """Take away what the tolerance of the program added to the energy; `began` (n, 6) are the velocities before."""
        state = self.state
        energy_kernel.restrain(
            self._rows.bodies, self.impulse, self._rates(state.twist), target, UNSOLVED, state.moving, state.given,
            self.joints.jointed, state.pieces.mass, state.pieces.inertia, state.position, state.rotation, began,
            state.twist, time * self.gravity, self._jammed,
        )  # fmt: skip

    def work(self) -> Array:
        """Work that bodies whose motion is given did at each point (m + j,) by the impulses of the program, joules."""
        given = self.state.given
        if not given.any():
            return np.zeros(len(self.impulse))
        moved = np.where(given[:, None], self.state.twist, 0.0)
        return -np.asarray((self._rates(moved) * self.impulse).sum(axis=1))

    def settle(self, before: tuple[Array, Array, Array], work: Array) -> None:
        """Scale velocities after the step, so that joints and what is moved add no energy.

        Args:
            before: positions, rotations and velocities at its start.
            work: (m + j,) as from `work`, before joints changed the velocities.
        """
        state, given = self.state, self.state.given
        if len(self.joints) or given[self.points.bodies[self._bearing()]].any():
            energy_kernel.settle(
                self._rows.bodies, self.impulse, work, len(self.points.gap), state.moving, given,
                self.joints.jointed, state.pieces.mass, state.pieces.inertia, state.position, state.rotation,
                state.twist, *before, np.array(self.gravity),
            )  # fmt: skip

    def _solve(self, target: Array, start: Impulses, hold: Array) -> None:
        state, points, rows, count = self.state, self.points, self._rows, len(self.points.gap)
        self.impulse[:] = 0.0
        if len(start.pair):
            head = np.full(len(state.pieces.table.pairs), -1, dtype=np.intp)
            contact_kernel.start_from(
                start.pair, start.local, start.impulse, head, points.pair, self._local, rows.axes, SAME_POINT,
                self.impulse,
            )  # fmt: skip
        self.impulse[count:] = start.joint
        contact_kernel.apply(rows.bodies, rows.response, state.twist, self.impulse)
        solve_kernel.solve_islands(
            rows.bodies, rows.jacobian, rows.response, rows.mobility, self._friction, target, rows.effective_mass, hold,
            state.twist, self.impulse, TOLERANCE, VISITS, MOST,
        )  # fmt: skip
        self.residuals = solve_kernel.residuals(
            rows.bodies, rows.jacobian, rows.mobility, self._friction, target, hold, state.twist, self.impulse
        )

    def world_impulse(self) -> Array:
        """Impulses (m, 3) of the contacts on the second bodies, along the world's axes, N s."""
        return np.asarray(np.einsum("cr,crk->ck", self.impulse[: len(self.points.gap)], self._rows.axes))

    def pushed(self) -> Mask:
        """Bodies (n,) on which a contact acts."""
        found: Mask = np.zeros(len(self.state.moving), dtype=bool)
        found[self.points.bodies[self._bearing()]] = True
        return found

    def remembered(self, time: float) -> Impulses:
        """What the next program starts from.

        Bodies between two that are pushed together have no solution: started from the last one, it would grow for ever.
        """
        kept, count = np.flatnonzero(self._bearing() & ~self._jammed), len(self.points.gap)
        return Impulses(
            self.points.pair[kept], self._local[kept], self.world_impulse()[kept], self.impulse[count:].copy(), time
        )

    def _bearing(self) -> Mask:
        """Contact points (m,) that bear something."""
        found: Mask = self.impulse[: len(self.points.gap), 0] > 0.0
        return found

    def separation(self, gap: float) -> Array:
        """Least displacements (n, 6) of all bodies, metres and radians, that part every point by a gap."""
        points, rows = self.points, self._rows
        way = np.zeros_like(self.state.twist)
        solve_kernel.solve_islands(
            rows.bodies, rows.jacobian, rows.response, rows.mobility, np.zeros(len(points.gap)), gap - points.gap,
            rows.effective_mass, -self.joints.gaps(self.state), way, np.zeros_like(self.impulse), 0.01 * gap,
            VISITS, MOST,
        )  # fmt: skip
        return way


def impact_times(gap: Array, speed: Array, pull: Array) -> Array:
    """First time at which gap + speed t + pull t^2 / 2 is zero, for gaps above zero; infinite if there is none."""
    root = speed**2 - 2.0 * pull * gap
    found = np.full(len(gap), np.inf)
    # the root in the form that does not cancel for an approach, speed < 0
    below = np.sqrt(np.maximum(root, 0.0)) - speed
    real = (root >= 0.0) & (below > 0.0) & (gap > 0.0)
    found[real] = 2.0 * gap[real] / below[real]
    return found
