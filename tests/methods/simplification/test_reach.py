"""Balls hold their pieces, and pairs left out never come near: by brute force at random postures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.figure import Figure
from wholebody.figures.self_pairs import random_postures
from wholebody.methods.simplification import Balls, Reach, simplify

POSTURES = 4_000


def tree(seed: int) -> pin.Model:
    """A random tree of joints of all kinds, with limits of all widths."""
    rng = np.random.default_rng(seed)
    model = pin.Model()
    kinds = [pin.JointModelRX, pin.JointModelRevoluteUnaligned, pin.JointModelPY, pin.JointModelRUBZ]
    for k in range(7):
        kind = kinds[rng.integers(len(kinds))]
        axis = rng.normal(size=3)
        joint = kind(axis / np.linalg.norm(axis)) if kind is pin.JointModelRevoluteUnaligned else kind()
        if k == 3:
            joint = pin.JointModelSpherical()
        model.addJoint(int(rng.integers(max(0, k - 2), k + 1)), joint, pin.SE3.Random(), f"joint {k}")
    for joint in list(model.joints)[1:]:
        if joint.nq == 1:
            low, width = rng.uniform(-2.0, 1.0), rng.uniform(0.0, 5.0)
            model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q] = low, low + width
    return model


def postures(model: pin.Model, count: int, rng: np.random.Generator) -> np.ndarray:
    found = random_postures(model, count, int(rng.integers(1000)))
    for joint in list(model.joints)[1:]:
        if joint.nq == 4:
            turns = rng.normal(size=(count, 4))
            found[:, joint.idx_q : joint.idx_q + 4] = turns / np.linalg.norm(turns, axis=1)[:, None]
    return found


@pytest.mark.parametrize("seed", range(2))
def test_a_ball_holds_its_piece_in_every_posture_seen_from_every_joint(seed: int) -> None:
    pin.seed(seed)
    rng = np.random.default_rng(seed)
    model = tree(seed)
    count = model.njoints - 1
    joint = np.arange(1, model.njoints)
    center, radius = rng.normal(size=(count, 3)), rng.uniform(0.0, 0.2, count)
    all_of_them = postures(model, 400, rng)
    start = all_of_them[0]
    frozen = [model.joints[2].idx_v] if model.joints[2].nv == 1 else []
    for dof in frozen:
        first = model.joints[2]
        all_of_them[:, first.idx_q : first.idx_q + first.nq] = start[first.idx_q : first.idx_q + first.nq]
        assert dof == first.idx_v
    reach = Reach(model, start, Balls(center, radius, np.arange(count)), joint, frozen)
    views = {seat: reach.seen_from(seat) for seat in range(model.njoints)}
    data = model.createData()
    for q in all_of_them:
        pin.forwardKinematics(model, data, q)
        for seat, balls in views.items():
            for k in range(len(balls.piece)):
                piece = int(balls.piece[k])
                there = data.oMi[seat].actInv(data.oMi[int(joint[piece])]).act(center[piece])
                assert np.linalg.norm(there - balls.center[k]) + radius[piece] <= balls.radius[k] + 1e-9


def test_a_hinge_alone_has_the_ball_of_its_arc() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "hinge")
    model.lowerPositionLimit[:], model.upperPositionLimit[:] = 0.0, np.pi / 2
    resting = Balls(np.array([[2.0, 0.0, 1.0]]), np.array([0.1]), np.array([0]))
    seen = Reach(model, np.zeros(1), resting, np.array([1]), ()).seen_from(0)
    np.testing.assert_allclose(seen.center, [[1.0, 1.0, 1.0]], atol=1e-12)
    np.testing.assert_allclose(seen.radius, 0.1 + np.sqrt(2.0))


def least_distances(scene: wb.Scene, numbers: np.ndarray, all_of_them: np.ndarray) -> np.ndarray:
    """Least distance of each of these pairs over many postures, by coal without any culling."""
    geometry = pin.GeometryModel(scene.geometry)
    chosen = [geometry.collisionPairs[int(k)] for k in numbers]
    chosen = [pin.CollisionPair(pair.first, pair.second) for pair in chosen]
    geometry.removeAllCollisionPairs()
    for pair in chosen:
        geometry.addCollisionPair(pair)
    data, results = scene.model.createData(), pin.GeometryData(geometry)
    least = np.full(len(chosen), np.inf)
    for q in all_of_them:
        pin.updateGeometryPlacements(scene.model, data, geometry, results, q)
        pin.computeDistances(geometry, results)
        least = np.minimum(least, [result.min_distance for result in results.distanceResults])
    return least


def left_out(problem: wb.Problem) -> np.ndarray:
    """Numbers of the pairs that are left out because they cannot come near."""
    small = simplify(problem).problem.scene
    names, kept = problem.scene.piece_names, set()
    for a, b in small.pair_table.pairs:
        kept.add((small.piece_names[a], small.piece_names[b]))
    every = [(names[a], names[b]) for a, b in problem.scene.pair_table.pairs]
    return np.flatnonzero([pair not in kept for pair in every])


def test_pairs_left_out_of_an_arms_scene_never_come_near(arm: Figure, cluttered: Callable[..., wb.Scene]) -> None:
    scene = cluttered(arm, seed=4, count=40, within=1.3)
    problem = wb.Problem(scene, goals=[wb.Point(arm.segments[-1], (0.3, 0.1, 0.4))], clearance=0.01)
    numbers = left_out(problem)
    assert 0.2 < len(numbers) / len(scene.pair_table.pairs) < 1.0
    least = least_distances(scene, numbers[:: max(1, len(numbers) // 25)], random_postures(arm.model, POSTURES, 1))
    assert least.min() > problem.clearance


def test_pairs_left_out_of_a_standing_persons_scene_never_come_near(
    human: Figure, cluttered: Callable[..., wb.Scene]
) -> None:
    scene = cluttered(human, seed=5, count=8, within=2.5)
    scene.add(wb.HalfSpace(offset=-0.3), name="floor")
    problem = wb.Problem(
        scene,
        goals=[wb.Point("right_index_tip", (0.5, -0.2, 1.0))],
        constraints=[wb.Hold("left_foot")],
        clearance=0.01,
    )
    numbers = left_out(problem)
    names = scene.piece_owner
    pairs = [frozenset(names[k] for k in scene.pair_table.pairs[number]) for number in numbers]
    assert frozenset(("left_foot", "floor")) in pairs  # held above it
    assert len(numbers) > 30
    all_of_them = random_postures(human.model, POSTURES, 2)
    data, frame = human.model.createData(), human.frame_id("left_foot")
    pin.framesForwardKinematics(human.model, data, problem.start)
    kept = pin.SE3(data.oMf[frame])
    for q in all_of_them:  # the root goes where the foot is held
        pin.framesForwardKinematics(human.model, data, q)
        q[:7] = pin.SE3ToXYZQUAT(kept * data.oMf[frame].inverse() * pin.XYZQUATToSE3(q[:7]))
    least = least_distances(scene, numbers[:: max(1, len(numbers) // 25)], all_of_them)
    assert least.min() > problem.clearance


def test_a_pair_that_can_meet_stays(arm: Figure, cluttered: Callable[..., wb.Scene]) -> None:
    """Everything that any of many random postures brings near is still tested."""
    scene = cluttered(arm, seed=6, count=10, within=0.8)
    problem = wb.Problem(scene, goals=[wb.Point(arm.segments[-1], (0.3, 0.1, 0.4))], clearance=0.02)
    gone = set(left_out(problem).tolist())
    for q in random_postures(arm.model, 500, 3):
        assert not gone & set(scene.contacts(q, within=0.02).number.tolist())
