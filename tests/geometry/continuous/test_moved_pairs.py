"""Which pairs moved by more than lay between them: compiled loops and array code, and points that were followed."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.reference import moved_pairs as reference
from wholebody.geometry.continuous.kept_apart import kept_apart
from wholebody.geometry.continuous.moved_pairs import QueryResult, compiled_kernel, far_moved

WITHIN = 0.05


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    """Return a human on the floor with a few things near it."""
    made = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    made.add(wb.Box((0.6, 1.2, 0.001)), name="plate", at=(0.4, 0.0, 0.9))
    return made.add(wb.Sphere(0.03), name="ball", at=(0.3, 0.2, 1.1))


def placed(scene, q):
    with scene.borrow() as workspace:
        return QueryResult(workspace.near(q, WITHIN), WITHIN)


def ways(scene, rng, count):
    """Return postures before and after steps from a thousandth of a radian to a whole one."""
    figure = scene.figure
    for _ in range(count):
        step = 10.0 ** rng.uniform(-3.0, 0.0)
        q0 = figure.clamp(
            pin.integrate(figure.model, figure.posture("standing"), rng.normal(size=figure.model.nv) * 0.3)
        )
        yield q0, figure.clamp(pin.integrate(figure.model, q0, step * rng.normal(size=figure.model.nv)))


def test_compiled_loops_find_the_pairs_that_array_code_finds(scene):
    found, kinds = 0, len(compiled_kernel().far_moved.signatures)
    for q0, q1 in ways(scene, np.random.default_rng(3), 60):
        before, after = placed(scene, q0), placed(scene, q1)
        mine = far_moved(scene.pair_table, before, after)
        assert np.array_equal(mine, reference.far_moved(scene.pair_table, before, after))
        found += len(mine)
    assert found > 20
    assert len(compiled_kernel().far_moved.signatures) == kinds  # nothing was compiled in the middle


def test_a_pair_that_is_left_out_had_more_room_than_its_points_moved(scene):
    """Corners of the pieces, followed in the world and seen from the other piece; distances from Pinocchio's loop."""
    table = scene.pair_table
    points = [swept.points for swept in table.swept]
    left_out = 0
    for q0, q1 in ways(scene, np.random.default_rng(5), 10):
        before, after = placed(scene, q0), placed(scene, q1)
        doubted = set(far_moved(table, before, after).tolist())
        room = table.widths + distances(scene, q0) + distances(scene, q1)
        for number, (first, second) in enumerate(table.pairs):
            if number in doubted or not len(points[first]) or not len(points[second]):
                continue
            ends = before.placements, after.placements
            in_the_world = farthest(points[first], ends, first) + farthest(points[second], ends, second)
            seen = min(farthest(points[second], ends, second, first), farthest(points[first], ends, first, second))
            assert min(in_the_world, seen) <= room[number] + 1e-9
            left_out += 1
    assert left_out > 1000


def farthest(points, ends, piece, carrier=None):
    """Return the longest way of a piece's points from one end to the other, in the axes of a carrier."""
    seen = []
    for placements in ends:
        at = points @ placements[piece, :3] + placements[piece, 3]
        seen.append(at if carrier is None else (at - placements[carrier, 3]) @ placements[carrier, :3].T)
    return np.linalg.norm(seen[1] - seen[0], axis=1).max()


def distances(scene, q):
    data, results = scene.model.createData(), pin.GeometryData(scene.geometry)
    pin.computeDistances(scene.model, data, scene.geometry, results, q)
    return np.maximum([result.min_distance for result in results.distanceResults], 0.0)


def test_pairs_are_kept_apart_by_the_chord_of_what_one_sees_of_the_other(free_bodies):
    """A box goes along with another one and turns about its own middle: a corner moves by 2 sin(angle / 2) times r."""
    figure = free_bodies(wb.Box((0.2, 0.2, 0.2)), wb.Box((0.3, 0.4, 0.5)))
    table, angle, shift = wb.Scene(figure).built.table, 0.7, np.array((0.3, -0.2, 0.5))
    before = np.tile(np.eye(4)[:, :3], (2, 1, 1))
    before[1, 3] = (2.0, 0.0, 0.0)
    after = before.copy()
    after[:, 3] += shift
    after[1, :3] = pin.exp3(angle * np.array((0.0, 0.0, 1.0))).T
    chord = 2.0 * np.sin(0.5 * angle) * 0.5 * np.linalg.norm((0.3, 0.4, 0.5))
    endless, none, apart = np.array([9.0]), np.zeros((1, 2)), np.array([2.0])  # no face has the other one so far away
    assert kept_apart(table, before, after, (np.array([1.001 * chord]), endless, none, apart))
    assert not kept_apart(table, before, after, (np.array([0.999 * chord]), endless, none, apart))
    assert not kept_apart(table, before, after, (np.array([1.001 * chord]), endless, none + 0.01 * chord, apart))
    assert kept_apart(table, before, after, (np.array([0.5 * chord]), np.array([0.4 * chord]), none + 9.0, apart))


@pytest.mark.parametrize("turned", [False, True])
def test_pairs_are_kept_apart_by_a_face_that_one_moves_along(free_bodies, turned):
    """A capsule goes a metre along the top of a box, 0.02 m above it; one that is turned is lower at one end."""
    first, second = wb.Box((2.0, 2.0, 0.2)), wb.Capsule(0.03, 0.4)
    angle = 0.04 * turned
    for bodies in ((first, second), (second, first)):
        table = wb.Scene(free_bodies(*bodies)).built.table
        capsule = bodies.index(second)
        before = np.tile(np.eye(4)[:, :3], (2, 1, 1))
        before[:, :3] = pin.utils.rotate("y", 0.3).T
        before[capsule, :3] = pin.utils.rotate("y", 0.3 + 0.5 * np.pi).T  # it lies
        after = before.copy()
        after[capsule, :3] = pin.utils.rotate("y", 0.3 + 0.5 * np.pi + angle).T
        before[capsule, 3] = np.array((-0.5, 0.1, 0.15)) @ before[1 - capsule, :3]
        after[capsule, 3] = np.array((0.5, 0.1, 0.15)) @ after[1 - capsule, :3]
        left, far = 0.02 - 0.2 * np.sin(angle), np.ones(1)
        for bent in (0.0, 0.01):
            twice = np.full((1, 2), 2.0 * bent)
            for least, kept in ((left - bent - 1e-6, True), (left - bent + 1e-6, False)):
                assert kept_apart(table, before, after, (0.1 * far, far, twice, least * far)) == kept
