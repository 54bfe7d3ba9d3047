"""The fastest timing: against the closed form of one joint, and the limits by differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import make_interp_spline
from scipy.optimize import linprog

import wholebody as wb
from wholebody.motion.trajectory.retiming import passed
from wholebody.planning.smoothing import places
from wholebody.planning.timing import Pace, Timing, least_time, squared_rates, used


@pytest.mark.parametrize("length", [0.1, 2.0])
def test_one_joint_takes_the_time_of_a_trapezium(length: float, planar_arm: Callable[..., wb.Figure]) -> None:
    """It accelerates, goes at full speed if there is room, and brakes."""
    figure, pace = planar_arm((1.0,)), Pace(velocity=1.5, acceleration=4.0, dt=1e-3)
    path = np.linspace(0.0, length, 300)[:, None]
    q = Timing(figure, path, pace).within()
    expected = length / 1.5 + 1.5 / 4.0 if length > 1.5**2 / 4.0 else 2.0 * np.sqrt(length / 4.0)
    assert (len(q) - 1) * 1e-3 == pytest.approx(expected, rel=0.03)
    assert max(used(figure, q, pace)) <= 1.001
    assert (q[0], q[-1]) == (0.0, length)


def test_no_motion_is_sooner_than_joints_rest_where_they_turn_back(planar_arm: Callable[..., wb.Figure]) -> None:
    """One goes 2 rad there and 1 back at full speed, the other one 0.2 rad, which is too short for that."""
    figure, pace = planar_arm((0.5, 0.5)), Pace(velocity=1.5, acceleration=4.0)
    path = [np.array(each) for each in ((0.0, 0.0), (1.2, 0.1), (2.0, 0.1), (2.0, 0.2), (1.0, 0.2))]
    assert least_time(figure, path, pace) == pytest.approx(3.0 / 1.5 + 2.0 * 1.5 / 4.0)
    assert least_time(figure, [np.array((0.0, each)) for each in (0.0, 0.2)], pace) == pytest.approx(
        2.0 * np.sqrt(0.2 / 4.0)
    )
    assert least_time(figure, [path[0], path[0]], pace) == 0.0


def test_rates_are_the_largest_that_a_linear_program_finds() -> None:
    """The sum of b is largest where b keeps all rows, as all of them grow together (Verscheure and others 2009)."""
    rng = np.random.default_rng(0)
    count, knots = 30, np.linspace(0.0, 1.0, 30)
    waves = np.array([np.sin((1.0 + k) * 2.0 * knots + k) for k in range(3)]).T
    first, second = (np.gradient(waves, axis=0), np.gradient(np.gradient(waves, axis=0), axis=0))
    speed, push = rng.uniform(1.0, 2.0, 3), rng.uniform(5.0, 9.0, 3)
    b = squared_rates(first, second, speed, push)
    rows, ends = [], []
    for k in range(count - 1):
        for joint in range(3):
            row = np.zeros(count)
            row[k + 1], row[k] = 0.5 * first[k, joint], second[k, joint] - 0.5 * first[k, joint]
            rows += [row, -row]
            ends += [push[joint], push[joint]]
    most = np.minimum((speed / np.abs(first)).min(axis=1) ** 2, (push / np.abs(second)).min(axis=1))
    most[[0, -1]] = 0.0
    best = linprog(-np.ones(count), np.array(rows), np.array(ends), bounds=[(0.0, end) for end in most])
    np.testing.assert_allclose(b, best.x, rtol=1e-6, atol=1e-6)


def test_a_turn_between_two_postures_does_not_slow_all_of_a_motion(planar_arm: Callable[..., wb.Figure]) -> None:
    """A joint turns back near the start; limits at 64 places between two postures bound how soon the end is reached."""
    arm, pace = planar_arm((0.5, 0.4)), Pace(velocity=3.0, acceleration=8.0)
    path = np.array([np.linspace(0.0, 2.0, 41), np.zeros(41)]).T
    path[2, 1] = 0.05
    knots, finest = np.arange(41), np.linspace(0.0, 40.0, 40 * 64 + 1)
    spline = make_interp_spline(knots, path, k=3)
    limits = np.full(2, 3.0), np.full(2, 8.0)
    soonest = passed(squared_rates(spline(finest, 1) / 64.0, spline(finest, 2) / 64.0**2, *limits), pace.dt)[0]
    q = Timing(arm, path, pace).within()
    assert max(used(arm, q, pace)) <= 1.001
    assert len(q) <= 1.2 * len(soonest)


def test_what_a_correction_displaces_is_not_slowed_on_and_on(planar_arm: Callable[..., wb.Figure]) -> None:
    """A frame that is displaced by 0.1 rad is as fast however slow the others are."""
    arm, path = planar_arm((0.5, 0.4)), np.linspace(0.0, 1.0, 20)[:, None] * np.ones(2)
    calls = []

    def displaced(q: np.ndarray) -> np.ndarray:
        calls.append(q)
        return q + 0.1 * (len(calls) % 7 == 3)

    assert len(Timing(arm, path, Pace()).within(displaced)) < 100


def test_frames_of_a_path_with_a_corner_keep_the_limits(planar_arm: Callable[..., wb.Figure]) -> None:
    """One joint stops where the other begins."""
    arm, path = planar_arm((0.5, 0.4)), np.zeros((41, 2))
    path[:21, 0], path[21:, 0], path[20:, 1] = np.linspace(0.0, 1.0, 21), 1.0, np.linspace(0.0, 1.0, 21)
    pace = Pace(velocity=3.0, acceleration=8.0)
    q = Timing(arm, path, pace).within()
    assert max(used(arm, q, pace)) <= 1.001
    speed = np.diff(q, axis=0) / pace.dt
    assert np.abs(speed).max() <= 3.0 * 1.001
    assert np.abs(np.diff(speed, axis=0)).max() / pace.dt <= 8.0 * 1.001


def test_what_turns_freely_goes_on_beyond_half_a_turn() -> None:
    model = pin.Model()
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.addJoint(root, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    axis, path = np.array((0.6, 0.0, 0.8)), []
    for angle in np.linspace(0.0, 4.5, 60):
        turn = pin.Quaternion(pin.exp3(angle * axis)).coeffs()
        path.append(np.concatenate([(0.1 * angle, -0.2, 0.3), turn, pin.Quaternion(pin.exp3(-angle * axis)).coeffs()]))
    found = places(model, path)
    assert np.abs(np.diff(found, axis=0)).max() < 0.25  # no jump: each step turns by 0.08 rad
    assert np.linalg.norm(found[-1, 3:6]) == pytest.approx(4.5)
    assert found[-1, 6:] == pytest.approx(-4.5 * axis)
    for q, place in zip(path, found, strict=True):
        assert np.abs(pin.difference(model, pin.integrate(model, path[0], place), q)).max() < 1e-9
