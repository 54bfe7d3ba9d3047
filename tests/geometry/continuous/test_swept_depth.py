"""Depths at postures and in between: against coal on all pairs of finely divided motions, and through thin plates."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.geometry.continuous.swept_depth import COARSE, SHARP, Depths, SweptDepth

DEPTH = 1e-4


def along(scene: wb.Scene, q: Array) -> tuple[list[Depths], list[Depths], SweptDepth]:
    swept = SweptDepth(scene.pair_table, scene.geometry, DEPTH)
    frames, between = [swept.start(q[0])], []
    for posture in q[1:]:
        found, passing = swept.advance(posture)
        frames.append(found)
        between.append(passing)
    return frames, between, swept


def dense(depths: Depths, count: int) -> Array:
    found = np.zeros(count)
    found[depths.number] = depths.depth
    return found


def all_depths(scene: wb.Scene, q: Array) -> Array:
    """(n, pairs) depth of each pair by coal, pair by pair, without culling or guesses."""
    data, found = scene.model.createData(), []
    for posture in q:
        results = pin.GeometryData(scene.geometry)
        pin.computeDistances(scene.model, data, scene.geometry, results, posture)
        found.append([max(0.0, -result.min_distance) for result in results.distanceResults])
    return np.array(found)


def compare(scene: wb.Scene, q: Array, parts: int, slack: float = 3e-6) -> tuple[int, int]:
    """Compare with finely divided motions; how often a pair is deep in between, and how often no posture shows it."""
    frames, between, _ = along(scene, q)
    true = all_depths(scene, q)
    count, deeps, dips = true.shape[1], 0, 0
    for found, expected in zip(frames, true, strict=True):
        assert np.allclose(dense(found, count), expected, atol=slack)
    for k, passing in enumerate(between):
        fine = np.array([pin.interpolate(scene.model, q[k], q[k + 1], t) for t in np.linspace(0.0, 1.0, parts)])
        lowest, said = all_depths(scene, fine).max(axis=0), dense(passing, count)
        deep = lowest > DEPTH
        assert (said[deep] >= lowest[deep] - slack).all()  # nothing deep is missed
        most = np.maximum(lowest + slack, DEPTH) + np.maximum(SHARP * DEPTH, COARSE * said)
        # between two of the fine postures a pair may be deeper than at both: how much is told by more of them
        assert (said <= most + 0.02 * lowest + 2e-5).all()
        deeps += int(deep.sum())
        dips += int((deep & (np.maximum(true[k], true[k + 1]) < DEPTH)).sum())
    return deeps, dips


def test_a_person_who_swings_all_joints() -> None:
    figure = wb.load("human")
    scene = wb.Scene(figure)
    rng = np.random.default_rng(1)
    phase, size = rng.uniform(0.0, 6.0, figure.model.nv), rng.uniform(0.0, 0.9, figure.model.nv)
    size[:6] *= 0.3
    q = [
        figure.clamp(pin.integrate(figure.model, figure.posture("standing"), size * np.sin(phase + 0.13 * k)))
        for k in range(7)
    ]
    _, dips = compare(scene, np.array(q), 33)
    assert dips > 0


@pytest.mark.parametrize(
    ("shape", "other"),
    [
        (wb.Sphere(0.05), wb.Box((0.3, 0.2, 0.05))),
        (wb.Capsule(0.03, 0.2), wb.Capsule(0.02, 0.3)),
        (wb.Ellipsoid((0.05, 0.08, 0.03)), wb.Box((0.2, 0.2, 0.1))),
        (wb.Box((0.1, 0.2, 0.05)), wb.Box((0.3, 0.1, 0.1))),
        (wb.Hull(np.random.default_rng(5).normal(size=(20, 3)) * 0.08), wb.Capsule(0.03, 0.2)),
        (wb.Ellipsoid((0.05, 0.08, 0.03)), wb.Ellipsoid((0.1, 0.04, 0.06))),
    ],
    ids=lambda shape: type(shape).__name__,
)
def test_two_bodies_that_fly_about(free_bodies: Callable[..., Any], shape: wb.Shape, other: wb.Shape) -> None:
    figure = free_bodies(shape, other)
    scene = wb.Scene(figure)
    scene.add(wb.HalfSpace(), name="floor", at=(0.0, 0.0, -0.25))
    rng = np.random.default_rng(2)
    q = [pin.neutral(figure.model)]
    for _ in range(24):
        step = rng.normal(size=figure.model.nv) * np.tile([0.07, 0.07, 0.07, 0.4, 0.4, 0.4], 2)
        back = np.concatenate([-0.3 * q[-1][:3], np.zeros(3), -0.3 * q[-1][7:10], np.zeros(3)])
        turned = [pin.Quaternion(q[-1][3:7]).inverse() * back[:3], pin.Quaternion(q[-1][10:14]).inverse() * back[6:9]]
        step[:3] += turned[0]
        step[6:9] += turned[1]
        q.append(pin.integrate(figure.model, q[-1], step))
    deeps, _ = compare(scene, np.array(q), 65, slack=3e-5)
    assert deeps > 0


@pytest.mark.parametrize("thickness", [0.0004, 0.002, 0.02])
def test_a_ball_shot_through_a_plate_between_two_frames(free_bodies: Callable[..., Any], thickness: float) -> None:
    """The plate is far from the ball in both frames, and at no place that halving looks at first."""
    figure = free_bodies(wb.Sphere(0.02))
    scene = wb.Scene(figure)
    scene.add(wb.Box((thickness, 1.0, 1.0)), name="plate", at=(0.413, 0.0, 0.0))
    q = np.array([[x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] for x in (-3.0, 2.0, 2.5)])
    frames, between, _ = along(scene, q)
    assert [len(found.number) for found in frames] == [0, 0, 0]
    assert between[1].depth.max(initial=0.0) == 0.0
    # deepest with the centre in the plate: half of the plate and the ball's radius
    deepest = 0.5 * thickness + 0.02
    assert deepest - 1e-6 <= between[0].depth.max() <= deepest * (1.0 + COARSE) + SHARP * DEPTH


def test_an_arm_through_a_thin_plate(planar_arm: Callable[..., Any]) -> None:
    """The tip of a unit arm of radius 1 cm passes a small plate edge-on, deep for a thousandth of the way."""
    figure = planar_arm([1.0], radius=0.01)
    scene = wb.Scene(figure)
    at = 1.0 + 0.01 - 2e-4 + 0.05  # the plate's near edge is 0.2 mm inside the circle of the tip
    scene.add(wb.Box((0.1, 0.0004, 0.1)), name="plate", at=(at, 0.0, 0.0))
    _, between, _ = along(scene, np.array([[-1.2], [0.9]]))
    assert 2e-4 - 1e-6 <= between[0].depth.max(initial=0.0) <= 2.2e-4
    scene.move("plate", at=(at + 1.2e-4, 0.0, 0.0))  # now 0.08 mm: no dip that counts
    _, between, _ = along(scene, np.array([[-1.2], [0.9]]))
    assert between[0].depth.max(initial=0.0) <= DEPTH
    scene.move("plate", at=(at + 3e-4, 0.0, 0.0))
    _, between, _ = along(scene, np.array([[-1.2], [0.9]]))
    assert between[0].depth.max(initial=0.0) == 0.0


def test_a_held_sole_is_no_dip(free_bodies: Callable[..., Any]) -> None:
    """A box that slides on a floor that it touches is never said to be in it."""
    figure = free_bodies(wb.Box((0.3, 0.1, 0.05)))
    scene = wb.Scene(figure)
    scene.add(wb.HalfSpace(), name="floor")
    q = [[0.1 * k, 0.0, 0.025, *pin.Quaternion(pin.utils.rotate("z", 0.3 * k)).coeffs()] for k in range(6)]
    _, between, _ = along(scene, np.array(q))
    assert max(passing.depth.max(initial=0.0) for passing in between) <= 1e-6


def test_a_clip_asks_the_same_when_it_is_looked_at_again() -> None:
    figure = wb.load("hand")
    scene = wb.Scene(figure)
    rng = np.random.default_rng(4)
    q = [figure.clamp(pin.integrate(figure.model, figure.neutral, 0.3 * k * rng.normal(size=figure.model.nv)))
         for k in range(5)]  # fmt: skip
    swept = SweptDepth(scene.pair_table, scene.geometry, DEPTH)

    swept.start(q[0])
    assert swept.asked < 0.2 * len(scene.pair_table.pairs)  # only those whose bounds overlap

    def run() -> list[Any]:
        found = [swept.start(q[0])]
        return [*found, *(part for posture in q[1:] for part in swept.advance(posture))]

    first, second = run(), run()
    assert all(np.array_equal(a.depth, b.depth) for a, b in zip(first, second, strict=True))
