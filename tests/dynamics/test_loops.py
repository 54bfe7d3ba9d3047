"""The compiled loops of the engine against clear versions of them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.reference import contact_program as clear
from wholebody.base.arrays import with_values
from wholebody.dynamics import energy_kernel, impact_kernel, motion_kernel, passing, rows_kernel, solve_kernel
from wholebody.dynamics.motion_kernel import Bodies
from wholebody.dynamics.pieces import ContactPoints, SweptPoints
from wholebody.dynamics.rows_kernel import JointPoints, Rows
from wholebody.dynamics.solve_kernel import Laws, Limits


def bodies_of(mass: np.ndarray, inertia: np.ndarray, position: np.ndarray, rotation: np.ndarray) -> Bodies:
    """Bodies that stand, the first ones with mass free."""
    free, none = np.isfinite(mass), np.zeros(len(mass), dtype=bool)
    inverse = np.linalg.inv(inertia)
    return Bodies(mass, inertia, inverse, position, rotation, np.zeros((len(mass), 6)), free, none, none)


class Heap:
    """Bodies with random masses and contact points, one that does not move, and joints."""

    def __init__(self, seed: int, contacts: int = 7, joints: int = 3) -> None:
        rng = np.random.default_rng(seed)
        count = 5
        position = rng.normal(size=(count, 3))
        rotation = np.array([pin.exp3(rng.normal(size=3)) for _ in range(count)])
        mass = np.append(np.inf, 1.0 / rng.uniform(0.3, 2.0, count - 1))
        inertia = np.array([np.diag(1.0 / rng.uniform(0.5, 2.0, 3)) for _ in range(count)])
        self.bodies = bodies_of(mass, inertia, position, rotation)
        pairs = np.array([rng.choice(count, 2, replace=False) for _ in range(contacts)], dtype=np.intp)
        normal = rng.normal(size=(contacts, 3))
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        point = rng.normal(size=(contacts, 3))
        held = np.array([(1, 1), (1, 2), (3, 4)], dtype=np.intp)[:joints]
        world = np.array([True, False, False])[:joints]
        anchor = rng.normal(size=(joints, 2, 3))
        joined = JointPoints(held, anchor, world)
        none = np.zeros(contacts)
        self.rows = Rows.room(np.concatenate([pairs, held]), joints, self.bodies.moving)
        rows_kernel.contact_rows(
            ContactPoints(none.astype(np.intp), pairs, normal, point, none), self.bodies, self.rows
        )
        rows_kernel.joint_rows(joined, self.bodies, self.rows)
        self.off = np.empty((joints, 3))
        rows_kernel.joint_gaps(joined, self.bodies, self.off)
        self.twist = rng.normal(size=(count, 6)) * self.bodies.moving[:, None]
        friction, target = rng.uniform(0.0, 1.0, contacts), 0.1 * rng.normal(size=contacts)
        self.laws = Laws(friction, target, 0.1 * rng.normal(size=(joints, 3)))
        blocks = [
            clear.rows_of_contact(n, position[a], position[b], at)
            for (a, b), n, at in zip(pairs, normal, point, strict=True)
        ]
        levers = [
            [None if fixed and side == 0 else rotation[body] @ anchors[side] for side, body in enumerate(both)]
            for both, anchors, fixed in zip(held, anchor, world, strict=True)
        ]
        self.clear_axes = [axes for _, axes in blocks]
        self.clear_rows = np.array([rows for rows, _ in blocks] + [clear.rows_of_joint(*both) for both in levers])
        self.points = [
            [anchor[k, s] if world[k] and s == 0 else position[b] + levers[k][s] for s, b in enumerate(x)]
            for k, x in enumerate(held)
        ]
        self.inverse = np.zeros((6 * count, 6 * count))
        for b in range(1, count):
            self.inverse[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = np.eye(3) / mass[b]
            self.inverse[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = (
                rotation[b] @ np.linalg.inv(inertia[b]) @ rotation[b].T
            )


def blocks(rows: np.ndarray) -> np.ndarray:
    """Rows (m, 3, 12) as (m, 3, 2, 6)."""
    return rows.reshape(len(rows), 3, 2, 6)


@pytest.mark.parametrize("seed", range(2))
def test_rows_are_those_of_the_definition(seed: int) -> None:
    heap = Heap(seed)
    # tangents are any two; the rows of the definition are taken along those of the loop
    for c, (axes, own) in enumerate(zip(heap.rows.axes, heap.clear_axes, strict=True)):
        assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
        assert axes[0] == pytest.approx(own[0])
        turned = np.einsum("ij,jsk->isk", axes @ own.T, heap.clear_rows[c])
        assert blocks(heap.rows.jacobian)[c] == pytest.approx(turned, abs=1e-12)
    contacts = len(heap.rows.axes)
    assert blocks(heap.rows.jacobian)[contacts:] == pytest.approx(heap.clear_rows[contacts:], abs=1e-12)
    matrix = clear.whole(heap.rows.bodies, blocks(heap.rows.jacobian), 5)
    answer = heap.inverse @ matrix.T
    laid = clear.whole(heap.rows.bodies, blocks(heap.rows.response), 5)
    assert laid == pytest.approx(answer.T, abs=1e-12)
    for number, held in enumerate(heap.rows.effective_mass):
        rows = slice(3 * (contacts + number), 3 * (contacts + number) + 3)
        assert held @ matrix[rows] @ answer[:, rows] == pytest.approx(np.eye(3), abs=1e-9)
        low, high = heap.points[number]
        assert heap.off[number] == pytest.approx(high - low, abs=1e-12)


def test_two_sweeps_are_those_of_the_clear_version() -> None:
    """Of 100 random heaps: impulses, velocities and the number of sweeps."""
    for seed in range(100):
        assert_same_way(Heap(seed), 2)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("most", [40, 10**6])
def test_the_program_goes_the_same_way_as_the_clear_version(seed: int, most: int) -> None:
    assert_same_way(Heap(seed), most)


def assert_same_way(heap: Heap, most: int) -> None:
    m, contacts = len(heap.rows.bodies), len(heap.rows.axes)
    twist, impulse = heap.twist.copy(), np.zeros((m, 3))
    took = solve_kernel.solve(np.arange(m), heap.rows, heap.laws, twist, impulse, Limits(1e-6, most))
    matrix = clear.whole(heap.rows.bodies, blocks(heap.rows.jacobian), 5)
    expected, velocity, sweeps = clear.solve(
        matrix, heap.inverse, heap.laws, heap.twist.ravel(), np.zeros((m, 3)), 1e-6, most
    )
    assert took == sweeps
    assert np.abs(impulse - expected).max() < 1e-8
    assert np.abs(twist.ravel() - velocity).max() < 1e-8
    signorini, coulomb = solve_kernel.residuals(heap.rows, heap.laws, twist, impulse)
    if most == 10**6:
        assert max(signorini, coulomb) < 1e-4
    rates = (matrix @ twist.ravel()).reshape(-1, 3)
    assert signorini >= np.abs(rates[contacts:] - heap.laws.hold).max() - 1e-12


def test_islands_do_not_reach_through_fixed_bodies() -> None:
    bodies = np.array([(1, 2), (4, 3), (0, 1), (0, 3), (5, 4), (2, 6)])
    root, movable = np.empty(7, dtype=np.intp), np.array([False] + 6 * [True])
    solve_kernel.join(np.arange(5), bodies, movable, root)  # the last point bears nothing
    assert root.tolist() == [0, 1, 1, 3, 3, 3, 6]


@pytest.mark.parametrize("seed", range(3))
def test_islands_solved_apart_solve_the_whole_program(seed: int) -> None:
    heaps = [Heap(seed), Heap(seed + 50, joints=0), Heap(seed + 100)]  # nothing joins one to another
    parts = [len(heap.rows.axes) for heap in heaps]

    def joined(*arrays: np.ndarray) -> np.ndarray:
        """Arrays of all heaps: contacts first, then joints."""
        starts = [part[:count] for part, count in zip(arrays, parts, strict=True)]
        return np.concatenate([*starts, *(part[count:] for part, count in zip(arrays, parts, strict=True))])

    rows = Rows(
        joined(*(heap.rows.bodies + 5 * k for k, heap in enumerate(heaps))),
        *(joined(*(getattr(heap.rows, name) for heap in heaps)) for name in Rows._fields[1:5]),
        *(np.concatenate([getattr(heap.rows, name) for heap in heaps]) for name in Rows._fields[5:]),
    )
    laws = Laws(*(np.concatenate([getattr(heap.laws, name) for heap in heaps]) for name in Laws._fields))
    twist, impulse = np.concatenate([heap.twist for heap in heaps]), np.zeros((len(rows.bodies), 3))
    solve_kernel.solve_islands(rows, laws, twist, impulse, Limits(1e-6, 10**6))
    assert max(solve_kernel.residuals(rows, laws, twist, impulse)) < 1e-4
    start = np.concatenate([heap.twist for heap in heaps])
    moved = np.einsum("crsk,cr->csk", blocks(rows.response), impulse)
    np.add.at(start, rows.bodies, moved)  # the velocities are those that the impulses give
    assert twist == pytest.approx(start, abs=1e-9)
    for k, heap in enumerate(heaps):  # each alone has the same answer
        alone, own = heap.twist.copy(), np.zeros((len(heap.rows.bodies), 3))
        solve_kernel.solve(np.arange(len(own)), heap.rows, heap.laws, alone, own, Limits(1e-6, 10**6))
        assert twist[5 * k : 5 * k + 5] == pytest.approx(alone, abs=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_a_single_impact_is_that_of_the_clear_version(seed: int) -> None:
    rng = np.random.default_rng(seed)
    heap = Heap(seed, contacts=1, joints=0)
    pairs, position = heap.rows.bodies, heap.bodies.position
    a, b = pairs[0]
    heap.bodies.mass[0], heap.bodies.moving[0] = 1.0, True
    point, normal = rng.normal(size=3), rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    none, one = np.zeros(1, dtype=np.intp), np.zeros(1)
    rows_kernel.contact_rows(ContactPoints(none, pairs, normal[None], point[None], one), heap.bodies, heap.rows)
    twist = rng.normal(size=(5, 6))
    levers = [point - position[k] for k in (a, b)]
    turned = [heap.bodies.rotation[k] @ heap.bodies.inertia[k] @ heap.bodies.rotation[k].T for k in (a, b)]
    expected = clear.single_impact(
        [twist[a], twist[b]], [heap.bodies.mass[k] for k in (a, b)], turned, levers, normal, 0.6, 0.4
    )
    approach = normal @ (
        twist[b, :3] + np.cross(twist[b, 3:], levers[1]) - twist[a, :3] - np.cross(twist[a, 3:], levers[0])
    )
    events = np.zeros((5, 5))
    laws = Laws(np.array([0.4]), one, np.zeros((0, 3)))
    count, ended = impact_kernel.resolve(
        np.arange(1), none, heap.rows, np.array([0.6]), laws, heap.bodies.jointed, twist, events
    )
    assert ended
    assert count == int(approach < -0.02)
    if count:
        assert events[0, 1] == pytest.approx(-approach)
        assert events[0, 2:] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("seed", range(2))
def test_a_free_body_turns_as_fine_steps_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rotation, spin = pin.exp3(rng.normal(size=3)), 5.0 * rng.normal(size=3)
    inertia = np.diag(rng.uniform(0.5, 2.0, 3))
    expected = clear.turned_freely(rotation.copy(), inertia, spin.copy(), 0.01, 200)
    motion_kernel.turn_freely(rotation, inertia, np.linalg.inv(inertia), spin, 0.01)
    assert rotation == pytest.approx(expected[0], abs=2e-5)  # order 2
    assert spin == pytest.approx(expected[1], abs=2e-4)


@pytest.mark.parametrize("seed", range(2))
def test_the_height_of_a_piece_is_that_of_its_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, turned, at = rng.normal(size=(9, 3)), pin.exp3(rng.normal(size=3)), rng.normal(size=3)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    placement = np.array([[*turned.T, at]])
    first, nine = np.zeros(1, dtype=np.intp), np.full(1, 9, dtype=np.intp)
    swept = SweptPoints(points, first, nine, np.array([0.05]), np.zeros((1, 3)), np.zeros((1, 4)))
    for sign in (1.0, -1.0):
        found = passing.highest(0, placement, direction, sign, swept)
        heights = sign * (points @ turned.T + at) @ direction
        assert found == pytest.approx(heights.max() + 0.05, abs=1e-12)


@pytest.mark.parametrize("fixed", [False, True])
def test_what_an_island_gained_is_taken_and_its_momentum_stays(fixed: bool) -> None:
    """Two bodies that touch, alone or on something fixed, and a third that nothing touches."""
    rng = np.random.default_rng(5)
    mass, spread = rng.uniform(0.5, 2.0, 4), rng.normal(size=(4, 3, 3))
    inertia = 0.1 * (spread @ spread.transpose(0, 2, 1)) + 0.05 * np.eye(3)
    rotation, position = np.stack([pin.exp3(turn) for turn in rng.normal(size=(4, 3))]), rng.normal(size=(4, 3))
    before, fall = rng.normal(size=(4, 6)), np.array([0.0, 0.0, -0.04]) if fixed else np.zeros(3)
    twist = 1.1 * before
    if not fixed:  # the program changes velocities by impulses of one body on the other
        twist = before.copy()
        push, at = 3.0 * rng.normal(size=3), rng.normal(size=3)
        for body, sign in ((0, 1.0), (1, -1.0)):
            turned = rotation[body] @ np.linalg.inv(inertia[body]) @ rotation[body].T
            twist[body, :3] += sign * push / mass[body]
            twist[body, 3:] += sign * turned @ np.cross(at - position[body], push)

    def energy(of: np.ndarray, lifted: float) -> float:
        world = rotation @ inertia @ rotation.transpose(0, 2, 1)
        kinetic = 0.5 * (mass * (of[:, :3] ** 2).sum(axis=1) + np.einsum("bi,bij,bj->b", of[:, 3:], world, of[:, 3:]))
        return float((kinetic - lifted * mass * (of[:, :3] @ fall))[:2].sum())

    def momentum(of: np.ndarray) -> np.ndarray:
        world = rotation @ inertia @ rotation.transpose(0, 2, 1)
        linear = mass[:, None] * of[:, :3]
        about = np.cross(position, linear) + np.einsum("bij,bj->bi", world, of[:, 3:])
        return np.concatenate([linear[:2].sum(axis=0), about[:2].sum(axis=0)])

    pairs = np.array([(0, 1), (3, 0)] if fixed else [(0, 1)])
    bodies = with_values(
        bodies_of(mass, inertia, position, rotation), twist=twist, moving=np.array([True, True, True, False])
    )
    began, kept = energy(before, 0.0), twist.copy()
    assert energy(twist, 1.0) > began + 1e-3
    bears = np.tile([1.0, 0.0, 0.0], (len(pairs), 1))
    none = np.zeros(len(pairs), dtype=bool)
    added = np.tile(fall, (4, 1))
    energy_kernel.restrain(pairs, bears, none, bodies, bodies.moving, before, added, none.copy())
    assert energy(twist, 1.0) == pytest.approx(began, abs=1e-12)
    assert (twist[2:] == kept[2:]).all()
    if fixed:
        share = twist[0, 0] / kept[0, 0]
        assert twist[:2] == pytest.approx(share * kept[:2], abs=1e-12)
    else:
        assert momentum(twist) == pytest.approx(momentum(before), abs=1e-12)
