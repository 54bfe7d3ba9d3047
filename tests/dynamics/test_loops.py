"""The compiled loops of the engine against clear versions of them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.reference import contact_program as clear
from wholebody.dynamics import (
    contact_kernel,
    energy_kernel,
    impact_kernel,
    joint_kernel,
    motion_kernel,
    passing_kernel,
    solve_kernel,
)


class Heap:
    """Bodies with random masses and contact points, one that does not move, and joints."""

    def __init__(self, seed: int, contacts: int = 7, joints: int = 3) -> None:
        rng = np.random.default_rng(seed)
        count = 5
        self.position = rng.normal(size=(count, 3))
        self.rotation = np.array([pin.exp3(rng.normal(size=3)) for _ in range(count)])
        self.mass = np.append(0.0, rng.uniform(0.3, 2.0, count - 1))  # inverses
        local = np.array([np.diag(rng.uniform(0.5, 2.0, 3)) for _ in range(count)])
        local[0] = 0.0
        self.inertia = np.array([r @ i @ r.T for r, i in zip(self.rotation, local, strict=True)])
        pairs = np.array([rng.choice(count, 2, replace=False) for _ in range(contacts)], dtype=np.intp)
        normal = rng.normal(size=(contacts, 3))
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        point = rng.normal(size=(contacts, 3))
        held = np.array([(1, 1), (1, 2), (3, 4)], dtype=np.intp)[:joints]
        self.world = np.array([True, False, False])[:joints]
        self.anchor = rng.normal(size=(joints, 2, 3))
        self.bodies = np.concatenate([pairs, held])
        m = contacts + joints
        self.axes, self.gram = np.empty((contacts, 3, 3)), np.empty((joints, 3, 3))
        self.jacobian, self.answer, self.mobility = np.empty((m, 3, 2, 6)), np.empty((m, 3, 2, 6)), np.empty((m, 2))
        contact_kernel.write_rows(
            pairs, normal, point, self.position, self.mass, self.inertia, self.axes, self.jacobian, self.answer,
            self.mobility,
        )  # fmt: skip
        lever, self.off = np.empty((joints, 2, 3)), np.empty((joints, 3))
        joint_kernel.place(held, self.anchor, self.world, self.position, self.rotation, lever, self.off)
        joint_kernel.write_rows(
            held, self.world, lever, self.mass, self.inertia, self.jacobian[contacts:], self.answer[contacts:],
            self.mobility[contacts:], self.gram,
        )  # fmt: skip
        self.twist = rng.normal(size=(count, 6)) * (self.mass > 0.0)[:, None]
        self.friction = rng.uniform(0.0, 1.0, contacts)
        self.target, self.hold = 0.1 * rng.normal(size=contacts), 0.1 * rng.normal(size=(joints, 3))
        blocks = [
            clear.rows_of_contact(n, self.position[a], self.position[b], at)
            for (a, b), n, at in zip(pairs, normal, point, strict=True)
        ]
        levers = [
            [None if fixed and side == 0 else self.rotation[body] @ anchors[side] for side, body in enumerate(both)]
            for both, anchors, fixed in zip(held, self.anchor, self.world, strict=True)
        ]
        self.clear_axes = [axes for _, axes in blocks]
        self.clear_rows = np.array([rows for rows, _ in blocks] + [clear.rows_of_joint(*both) for both in levers])
        self.points = [
            [
                self.anchor[k, s] if self.world[k] and s == 0 else self.position[b] + levers[k][s]
                for s, b in enumerate(x)
            ]
            for k, x in enumerate(held)
        ]
        self.inverse = np.zeros((6 * count, 6 * count))
        for b in range(count):
            self.inverse[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = self.mass[b] * np.eye(3)
            self.inverse[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = self.inertia[b]


@pytest.mark.parametrize("seed", range(2))
def test_rows_are_those_of_the_definition(seed: int) -> None:
    heap = Heap(seed)
    # tangents are any two; the rows of the definition are taken along those of the loop
    for c, (axes, own) in enumerate(zip(heap.axes, heap.clear_axes, strict=True)):
        assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
        assert axes[0] == pytest.approx(own[0])
        turned = np.einsum("ij,jsk->isk", axes @ own.T, heap.clear_rows[c])
        assert heap.jacobian[c] == pytest.approx(turned, abs=1e-12)
    contacts = len(heap.axes)
    assert heap.jacobian[contacts:] == pytest.approx(heap.clear_rows[contacts:], abs=1e-12)
    matrix = clear.whole(heap.bodies, heap.jacobian, 5)
    answer = heap.inverse @ matrix.T
    laid = clear.whole(heap.bodies, heap.answer, 5)
    assert laid == pytest.approx(answer.T, abs=1e-12)
    for number, held in enumerate(heap.gram):
        rows = slice(3 * (contacts + number), 3 * (contacts + number) + 3)
        assert held @ matrix[rows] @ answer[:, rows] == pytest.approx(np.eye(3), abs=1e-9)
        low, high = heap.points[number]
        assert heap.off[number] == pytest.approx(high - low, abs=1e-12)


def test_two_sweeps_are_those_of_the_clear_version() -> None:
    """Of 100 random heaps: impulses, velocities and the number of sweeps."""
    for seed in range(100):
        assert_same_way(Heap(seed), 10**6, 2)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("visits", "most"), [(10**6, 40), (60, 10**6), (10**6, 10**6)])
def test_the_program_goes_the_same_way_as_the_clear_version(seed: int, visits: int, most: int) -> None:
    assert_same_way(Heap(seed), visits, most)


def assert_same_way(heap: Heap, visits: int, most: int) -> None:
    m, contacts = len(heap.bodies), len(heap.axes)
    twist, impulse = heap.twist.copy(), np.zeros((m, 3))
    took = solve_kernel.solve(
        np.arange(m), heap.bodies, heap.jacobian, heap.answer, heap.mobility, heap.friction, heap.target, heap.gram,
        heap.hold, twist, impulse, 1e-6, visits, most,
    )  # fmt: skip
    matrix = clear.whole(heap.bodies, heap.jacobian, 5)
    expected, velocity, sweeps = clear.solve(
        matrix, heap.inverse, heap.friction, heap.target, heap.hold, heap.twist.ravel(), np.zeros((m, 3)), 1e-6,
        visits, most,
    )  # fmt: skip
    assert took == sweeps
    assert np.abs(impulse - expected).max() < 1e-8
    assert np.abs(twist.ravel() - velocity).max() < 1e-8
    signorini, coulomb = solve_kernel.residuals(
        heap.bodies, heap.jacobian, heap.mobility, heap.friction, heap.target, heap.hold, twist, impulse
    )
    if most == visits:
        assert max(signorini, coulomb) < 1e-4
    rates = (matrix @ twist.ravel()).reshape(-1, 3)
    assert signorini >= np.abs(rates[contacts:] - heap.hold).max() - 1e-12


def test_islands_do_not_reach_through_fixed_bodies() -> None:
    bodies = np.array([(1, 2), (4, 3), (0, 1), (0, 3), (5, 4), (2, 6)])
    root, movable = np.empty(7, dtype=np.intp), np.array([False] + 6 * [True])
    contact_kernel.join(np.arange(5), bodies, movable, root)  # the last point bears nothing
    assert root.tolist() == [0, 1, 1, 3, 3, 3, 6]


@pytest.mark.parametrize("seed", range(3))
def test_islands_solved_apart_solve_the_whole_program(seed: int) -> None:
    heaps = [Heap(seed), Heap(seed + 50, joints=0), Heap(seed + 100)]  # nothing joins one to another
    parts = [len(heap.axes) for heap in heaps]
    number = 5 * np.arange(3)

    def of(name: str, joints: bool = True) -> np.ndarray:
        """Arrays of all heaps: contacts first, then joints."""
        whole = [getattr(heap, name) + (number[k] if name == "bodies" else 0) for k, heap in enumerate(heaps)]
        ends = [part[count:] for part, count in zip(whole, parts, strict=True)] if joints else []
        starts = [part[:count] for part, count in zip(whole, parts, strict=True)]
        return np.concatenate([*starts, *ends]).astype(np.intp if name == "bodies" else float)

    bodies, jacobian, mobility = of("bodies"), of("jacobian"), of("mobility")
    friction, target = of("friction", False), of("target", False)
    gram, hold = (np.concatenate([getattr(heap, name) for heap in heaps]) for name in ("gram", "hold"))
    twist, impulse = np.concatenate([heap.twist for heap in heaps]), np.zeros((len(bodies), 3))
    solve_kernel.solve_islands(
        bodies, jacobian, of("answer"), mobility, friction, target, gram, hold, twist, impulse, 1e-6, 10**6, 10**6
    )
    signorini, coulomb = solve_kernel.residuals(bodies, jacobian, mobility, friction, target, hold, twist, impulse)
    assert max(signorini, coulomb) < 1e-4
    start = np.concatenate([heap.twist for heap in heaps])
    moved = np.einsum("crsk,cr->csk", of("answer"), impulse)
    np.add.at(start, bodies, moved)  # the velocities are those that the impulses give
    assert twist == pytest.approx(start, abs=1e-9)
    for k, heap in enumerate(heaps):  # each alone has the same answer
        alone, own = heap.twist.copy(), np.zeros((len(heap.bodies), 3))
        solve_kernel.solve(
            np.arange(len(own)), heap.bodies, heap.jacobian, heap.answer, heap.mobility, heap.friction, heap.target,
            heap.gram, heap.hold, alone, own, 1e-6, 10**6, 10**6,
        )  # fmt: skip
        assert twist[5 * k : 5 * k + 5] == pytest.approx(alone, abs=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_a_single_impact_is_that_of_the_clear_version(seed: int) -> None:
    rng = np.random.default_rng(seed)
    heap = Heap(seed, contacts=1, joints=0)
    a, b = heap.bodies[0]
    if 0 in (a, b):
        heap.mass[0], heap.inertia[0] = 1.0, np.eye(3)
    point, normal = rng.normal(size=3), rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    laid = np.empty((1, 3, 3)), np.empty((1, 3, 2, 6)), np.empty((1, 3, 2, 6)), np.empty((1, 2))
    contact_kernel.write_rows(
        heap.bodies, normal[None], point[None], heap.position, heap.mass, heap.inertia, *laid
    )  # fmt: skip
    twist = rng.normal(size=(5, 6))
    levers = [point - heap.position[k] for k in (a, b)]
    expected = clear.single_impact(
        [twist[a], twist[b]], [1.0 / heap.mass[a], 1.0 / heap.mass[b]],
        [np.linalg.inv(heap.inertia[a]), np.linalg.inv(heap.inertia[b])], levers, normal, 0.6, 0.4,
    )  # fmt: skip
    approach = normal @ (
        twist[b, :3] + np.cross(twist[b, 3:], levers[1]) - twist[a, :3] - np.cross(twist[a, 3:], levers[0])
    )
    events, none = np.zeros((5, 5)), np.zeros(0, dtype=np.intp)
    count, ended = impact_kernel.resolve(
        np.arange(1), np.zeros(1, dtype=np.intp), heap.bodies, *laid, np.array([0.6]), np.array([0.4]),
        np.zeros((0, 3, 3)), np.zeros(5, dtype=bool), twist, 0.01, 5, np.zeros((1, 3)), events,
    )  # fmt: skip
    assert ended
    assert len(none) == 0
    assert count == int(approach < -0.01)
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
    one = np.array([0.05]), np.zeros((1, 3)), np.zeros((1, 4))
    for sign in (1.0, -1.0):
        found = passing_kernel.highest(
            0, placement, direction, sign, points, np.zeros(1, dtype=np.intp), np.full(1, 9, dtype=np.intp), *one
        )
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
    moving, none = np.array([True, True, True, False]), np.zeros(4, dtype=bool)
    began, kept = energy(before, 0.0), twist.copy()
    assert energy(twist, 1.0) > began + 1e-3
    bears, jammed = np.tile([1.0, 0.0, 0.0], (len(pairs), 1)), np.zeros(len(pairs), dtype=bool)
    energy_kernel.restrain(
        pairs, bears, np.zeros_like(bears), np.zeros(len(pairs)), 1.0, moving, none, none, mass, inertia, position,
        rotation, before, twist, fall, jammed,
    )  # fmt: skip
    assert energy(twist, 1.0) == pytest.approx(began, abs=1e-12)
    assert (twist[2:] == kept[2:]).all()
    if fixed:
        share = twist[0, 0] / kept[0, 0]
        assert twist[:2] == pytest.approx(share * kept[:2], abs=1e-12)
    else:
        assert momentum(twist) == pytest.approx(momentum(before), abs=1e-12)
