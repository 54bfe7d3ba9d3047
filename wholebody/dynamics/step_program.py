"""The contacts and joints of one step: what is the same however long it becomes, and the program of its impulses."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask, with_values
from wholebody.base.compiled import with_loops
from wholebody.dynamics import (
    energy_kernel,
    impact_kernel,
    motion_kernel,
    passing,
    pieces,
    rows_kernel,
    solve_kernel,
)
from wholebody.dynamics.bodies_state import BodiesState, Joints
from wholebody.dynamics.impact_kernel import SLOW
from wholebody.dynamics.motion_kernel import Bodies
from wholebody.dynamics.pieces import ContactPoints, SweptPoints
from wholebody.dynamics.rows_kernel import JointPoints, Rows
from wholebody.dynamics.solve_kernel import Laws, Limits

SKIN = 5e-5  # m: gap at which bodies rest: coal's distances stay positive, its normals right to 0.02 rad
TOUCH = 1e-5  # m: a gap larger than `SKIN` by this still touches


class Impulses(NamedTuple):
    """Impulses of a program, from which the next one starts."""

    pair: Indices  # (k,) pair of each point
    local: Array  # (k, 3) the point in the first body's axes
    impulse: Array  # (k, 3) on the second body, in the world, N s
    joint: Array  # (j, 3) of the joint points, likewise
    time: float  # of the step, seconds

    @staticmethod
    def nothing(joints: int) -> Impulses:
        """Zero, for a number of joint points."""
        return Impulses(np.zeros(0, dtype=np.intp), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((joints, 3)), 1.0)

    def over(self, time: float) -> Impulses:
        """The same forces during another time."""
        share = time / self.time
        return with_values(self, impulse=share * self.impulse, joint=share * self.joint, time=time)


class StepProgram:
    """The contact points of a step and their program.

    Attributes:
        points: the contact points.
        speed: (m,) rate of each gap before the step, m/s.
        hits: (m,) time to the impact of each point; infinite where there is none.
        impulse: (m + j, 3) what `solve` found, along the axes of each point, N s; those of joints are at the end.
        residuals: Signorini's and Coulomb's, m/s.
    """

    def __init__(
        self,
        state: BodiesState,
        points: ContactPoints,
        gravity: Array,
        joints: Joints,
        yielding: Mask,
        ahead: Array | None = None,
    ) -> None:
        """Begin a step.

        Args:
            state: of the bodies.
            points: the contact points.
            gravity: (3,) m/s2.
            joints: between the bodies.
            yielding: (n,) bodies whose motion is given and that the program takes to have their masses.
            ahead: (n, 6) what weight adds during the step to bodies that pushes gave its opposite: without it they
                would seem to rise, and to meet what lies on them.
        """
        self.state, self.points, self.gravity, self.joints = state, points, gravity, joints
        self._ahead = np.zeros_like(state.bodies.twist) if ahead is None else ahead
        self._yielding = yielding
        pieces = state.pieces
        self._restitution, self._friction = pieces.restitution[points.pair], pieces.friction[points.pair]
        self._touching = points.gap <= SKIN + TOUCH
        self._rows = self._point_rows(state.bodies.moving | yielding)
        self.impulse = np.zeros((len(points.gap) + len(joints), 3))
        self.residuals = (0.0, 0.0)
        self._jammed = np.zeros(len(points.gap), dtype=bool)
        self._local = state.local(points.bodies[:, 0], points.point)
        self.read_velocities(state.bodies.moving)

    def read_velocities(self, falling: Mask) -> None:
        """Read the present velocities: approaches and times of impact; `falling` (n,) are bodies that nothing bears."""
        bodies, normal = self.points.bodies, self.points.normal
        self.speed = self._rates(self.state.bodies.twist + self._ahead)[: len(normal), 0]
        fall = (self.state.bodies.moving & falling).astype(float)
        self._pull = (fall[bodies[:, 1]] - fall[bodies[:, 0]]) * (normal @ self.gravity)
        self.hits = impact_times(self.points.gap - SKIN, self.speed, self._pull)
        self.hits[(self.speed > -SLOW) | self._touching] = np.inf

    def _rates(self, twist: Array) -> Array:
        """Relative velocities (m + j, 3) along the axes of the points."""
        found = np.empty((len(self._rows.bodies), 3))
        rows_kernel.rates(self._rows.bodies, self._rows.jacobian, twist, found)
        return found

    def _point_rows(self, movable: Mask) -> Rows:
        """The rows of all points; `movable` (n,) are the bodies that they move."""
        state, points, joints = self.state, self.points, self.joints
        rows = Rows.room(np.concatenate([points.bodies, joints.points.bodies]), len(joints), movable)
        rows_kernel.contact_rows(points, state.bodies, rows)
        if len(joints):
            rows_kernel.joint_rows(joints.points, state.bodies, rows)
        return rows

    def _limits(self, tolerance: float) -> Limits:
        """At most 1,000 sweeps of an island, and 20,000 visits of points: more are more exact and slower."""
        return Limits(tolerance, min(1000, 20_000 // max(len(self._rows.bodies), 1) + 1))

    def add_points(self, points: ContactPoints, time: float) -> None:
        """Add contact points at the end of a step of this time, with gaps that lead there with its velocities."""
        late = StepProgram(self.state, points, self.gravity, self.joints, self._yielding)
        late.read_velocities(~self.pushed())
        gap = points.gap - time * late.speed + 0.5 * late._pull * time**2
        count, own, rows = len(self.points.gap), late._rows, self._rows
        self._local = np.concatenate([self._local, late._local])
        self._restitution = np.concatenate([self._restitution, late._restitution])
        self._friction = np.concatenate([self._friction, late._friction])
        self._jammed = np.zeros(count + len(gap), dtype=bool)
        self._touching = np.concatenate([self._touching, gap <= SKIN + TOUCH])
        joined = (np.concatenate(both) for both in zip(self.points, with_values(points, gap=gap), strict=True))
        self.points = ContactPoints(*joined)

        def inserted(before: Any, new: Any) -> Any:
            return np.concatenate([before[:count], new[: len(gap)], before[count:]])

        self._rows = Rows(
            inserted(rows.bodies, own.bodies), inserted(rows.axes, own.axes),
            inserted(rows.jacobian, own.jacobian), inserted(rows.response, own.response),
            inserted(rows.mobility, own.mobility), rows.effective_mass, rows.movable,
        )  # fmt: skip
        # what bears a body is known to the next points that join the step
        self.impulse = inserted(self.impulse, np.zeros((len(gap), 3)))

    def resolve_impacts(self) -> tuple[Array, bool]:
        """Resolve the impacts of points that touch: events as in `impact_kernel.resolve`, and whether none is left."""
        twist = self.state.bodies.twist + self._ahead
        if not (self._touching & (self._rates(twist)[: len(self.speed), 0] < -SLOW)).any():
            return np.zeros((0, 5)), True
        state, points = self.state, self.points
        weighed = state.bodies.given & np.isfinite(state.pieces.mass)
        rows = self._point_rows(state.bodies.moving | weighed) if weighed.any() else self._rows
        events = np.zeros((1000, 5))
        laws = Laws(self._friction, np.zeros(len(points.gap)), np.zeros((len(self.joints), 3)))
        count, ended = impact_kernel.resolve(
            np.flatnonzero(self._touching), points.pair, rows, self._restitution, laws, state.bodies.jointed, twist,
            events,
        )  # fmt: skip
        state.bodies.twist[state.bodies.moving] = (twist - self._ahead)[state.bodies.moving]
        return events[:count], ended

    def solve(self, time: float, together: bool, old: Impulses, hold: Array) -> None:
        """Change the velocities to those at the end of a step of `time` [s], which adds no energy."""
        # `together`: impacts bounce by it; `old` impulses; `hold` (j, 3): velocity of B's joint points by A's
        state, points = self.state, self.points
        twist, moving = state.bodies.twist, state.bodies.moving
        began = twist.copy()
        # what is held has all of its fall at once: it does not rise in a step that ends early
        held = self._ahead[:, :3]
        fall = np.where((held != 0.0).any(axis=1, keepdims=True), held, time * self.gravity)
        state.velocity[moving] += fall[moving]
        target = np.where(points.gap > SKIN, (SKIN - points.gap) / time, 0.0)
        ends = self.hits <= time * (1.0 + 1e-9)
        start = old.over(time)
        if together:
            bouncing = ends | (self._touching & (self.speed < -SLOW))
            if bouncing.any():
                before = twist.copy()
                self._solve(np.where(bouncing, -self._restitution * self.speed, target), start, hold)
                # the work of the impulses is that along the mean of the velocities before and after
                rates = self._rates(0.5 * (before + twist))
                rates[len(target) :] -= 0.5 * hold  # what closes joints is no work
                if float((rates * self.impulse).sum()) <= 0.0:
                    self._restrain(began, fall, target)
                    return
                twist[:] = before
        else:  # bodies that nothing bears move with the mean of both velocities, and rounding is to bear none
            target = np.where(ends, target + 0.5 * np.minimum(self._pull, 0.0) * time - 1e-9, target)
        self._solve(target, start, hold)
        self._restrain(began, fall, target)

    def _restrain(self, began: Array, fall: Array, target: Array) -> None:
        """Take away what the tolerance of the program added to the energy; arguments as of `energy_kernel.restrain`."""
        bodies, points = self.state.bodies, self._rows.bodies
        off = np.abs(self._rates(bodies.twist)[: len(target), 0] - target) > 1.2e-4  # m/s: a program is solved to 1e-4
        energy_kernel.restrain(points, self.impulse, off, bodies, self._rows.movable, began, fall, self._jammed)

    def work(self) -> Array:
        """Work that bodies whose motion is given did at each point (m + j,) by the impulses of the program, joules."""
        bodies = self.state.bodies
        if not bodies.given.any():
            return np.zeros(len(self.impulse))
        moved = np.where(bodies.given[:, None], bodies.twist, 0.0)
        return -np.asarray((self._rates(moved) * self.impulse).sum(axis=1))

    def settle(self, before: tuple[Array, Array, Array], work: Array) -> None:
        """Scale velocities after a step of this work (m + j,), so that joints and what is moved add no energy."""
        bodies, points = self.state.bodies, self.points
        if len(self.joints) or bodies.given[points.bodies[self._bearing()]].any():
            rows = self._rows
            energy_kernel.settle(
                rows.bodies, self.impulse, work, len(points.gap), bodies, rows.movable, before, np.array(self.gravity)
            )

    def _solve(self, target: Array, start: Impulses, hold: Array) -> None:
        old, new = (start.pair, start.local, start.impulse), (self.points.pair, self._local)
        twist, moving = self.state.bodies.twist, self.state.bodies.moving
        given = twist[~moving]
        self.impulse[len(target) :] = start.joint
        self.residuals = solve_kernel.solve_from(
            old, new, self._rows, Laws(self._friction, target, hold), twist, self.impulse,
            self._limits(1e-4),  # m/s: 0.4 um of displacement in a step
        )  # fmt: skip
        twist[~moving] = given

    def world_impulse(self) -> Array:
        """Impulses (m, 3) of the contacts on the second bodies, along the world's axes, N s."""
        return np.asarray(np.einsum("cr,crk->ck", self.impulse[: len(self.points.gap)], self._rows.axes))

    def pushed(self) -> Mask:
        """Bodies (n,) on which a contact acts."""
        found: Mask = np.zeros(len(self.state.bodies.moving), dtype=bool)
        found[self.points.bodies[self._bearing()]] = True
        return found

    def remembered(self, time: float) -> Impulses:
        """The start of the next program, without impulses of pushed bodies and of what yields, which would grow."""
        grow = self._jammed | self._yielding[self.points.bodies].any(axis=1)
        kept, count = np.flatnonzero(self._bearing() & ~grow), len(self.points.gap)
        return Impulses(
            self.points.pair[kept], self._local[kept], self.world_impulse()[kept], self.impulse[count:].copy(), time
        )

    def _bearing(self) -> Mask:
        """Contact points (m,) that bear something."""
        return np.asarray(self.impulse[: len(self.points.gap), 0] > 0.0)

    def separation(self, gap: float) -> Array:
        """Least displacements (n, 6) of all bodies, metres and radians, that part every point by a gap."""
        points = self.points
        way, impulse = np.zeros_like(self.state.bodies.twist), np.zeros_like(self.impulse)
        laws = Laws(np.zeros(len(points.gap)), gap - points.gap, -self.joints.gaps(self.state))
        solve_kernel.solve_islands(self._rows, laws, way, impulse, self._limits(0.01 * gap))
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


@with_loops("wholebody.dynamics.motion_kernel")
def compiled_kernel(_: Any) -> None:
    """The loops of motion; those of all other modules named above are compiled or read back with them."""
    one, unit, mask, twist = np.zeros((1, 3)), np.eye(3)[None].copy(), np.ones(1, dtype=bool), np.zeros((1, 6))
    none, pairs, some, no_mask = _integers(0), _integers(0, 2), np.zeros(0), np.zeros(0, dtype=bool)
    vectors, placed = np.zeros((0, 3)), np.zeros((1, 4, 3))
    bodies = Bodies(np.ones(1), unit, unit, one, unit.copy(), twist, mask, mask, mask)
    motion_kernel.drift(bodies, mask, np.zeros(3), 1.0)
    motion_kernel.displace(bodies, twist)
    motion_kernel.kinetic(bodies, mask)
    motion_kernel.travel(bodies, np.zeros(1), np.zeros(3), 1.0)
    motion_kernel.place_pieces(one, unit, one, _integers(1), placed, placed.copy())
    pieces.needed(none, 0, vectors, vectors, some, 0.0)
    rows, joints = Rows.room(pairs, 0, mask), JointPoints(pairs, np.zeros((0, 2, 3)), no_mask)
    rows_kernel.contact_rows(ContactPoints(none, pairs, vectors, vectors, some), bodies, rows)
    rows_kernel.joint_rows(joints, bodies, rows)
    rows_kernel.joint_gaps(joints, bodies, vectors)
    rows_kernel.rates(pairs, rows.jacobian, twist, vectors)
    laws = Laws(some, some, vectors)
    solve_kernel.solve(none, rows, laws, twist, vectors, Limits(1.0, 1))
    solve_kernel.solve_islands(rows, laws, twist, vectors, Limits(1.0, 1))
    solve_kernel.residuals(rows, laws, twist, vectors)
    solve_kernel.join(none, pairs, mask, _integers(1))
    solve_kernel.solve_from((none, vectors, vectors), (none, vectors), rows, laws, twist, vectors, Limits(1.0, 1))
    energy_kernel.restrain(pairs, vectors, no_mask, bodies, mask, twist, one, no_mask)
    energy_kernel.settle(pairs, vectors, some, 0, bodies, mask, (one, unit, twist), np.zeros(3))
    impact_kernel.resolve(none, none, rows, some, laws, mask, twist, np.zeros((1, 5)))
    swept = SweptPoints(vectors, none, none, some, vectors, np.zeros((0, 4)))
    way = passing.Way(pairs, none, np.zeros((2, 0)), np.zeros((2, 0, 3)), np.zeros((2, 0, 4, 3)), one, some, some, 0.0)
    passing.doubtful(way, swept, no_mask)


def _integers(*shape: int) -> Indices:
    return np.zeros(shape, dtype=np.intp)
