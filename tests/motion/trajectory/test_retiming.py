"""Timing: integrals of the rate, a bounded least-squares solver, and clips whose joints are too fast."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import lsq_linear

import wholebody as wb
from wholebody.figures.figure import Figure
from wholebody.motion.trajectory.retiming import SPREAD, slowed, speed_bounds, timing

DT = 1 / 30


def test_times_are_the_integral_of_the_rate() -> None:
    random = np.random.default_rng(0)
    b = np.clip(1.0 - random.uniform(0.0, 0.8, 12), 0.2, 1.0)
    new = timing(b, DT)
    assert new is not None
    s = DT * np.arange(12)
    frames = len(new.times)
    took = solve_ivp(
        lambda t, place: np.sqrt(np.interp(place, s, b)), (0.0, 2.0), [0.0], rtol=1e-9, atol=1e-12, max_step=1e-3,
        events=lambda t, place: place[0] - s[-1], dense_output=True,
    )  # fmt: skip
    duration = float(took.t_events[0][0])
    assert (frames - 2) * DT < duration <= (frames - 1) * DT + 1e-9
    expected = took.sol(np.linspace(0.0, duration, frames))[0]
    np.testing.assert_allclose(new.times, expected, atol=1e-6)
    rates = np.diff(new.times) / DT
    assert 1.0 / rates.min() <= new.largest


def test_a_clip_that_is_slow_enough_keeps_its_timing() -> None:
    assert timing(np.ones(9), DT) is None
    assert timing(np.ones(1), DT) is None
    np.testing.assert_array_equal(slowed(np.full(9, 4.0), DT, 2.0), np.ones(9))


@pytest.mark.parametrize("stretch", [1.5, 4.0])
def test_the_rate_is_the_nearest_that_the_bounds_allow(stretch: float) -> None:
    most = np.full(40, np.inf)
    most[12:16], most[30] = 0.3, 0.6
    differences = np.diff(np.eye(40), n=2, axis=0) * (SPREAD / DT) ** 2
    low = np.clip(1.0 - most, 0.0, 1.0 - stretch**-2)
    stacked = np.vstack([np.eye(40), differences])
    expected = lsq_linear(stacked, np.zeros(len(stacked)), (low, np.full(40, 1.0 - stretch**-2 + 1e-9)), tol=1e-12).x
    found = slowed(most, DT, stretch)
    np.testing.assert_allclose(1.0 - found, expected, atol=1e-3)
    assert (found <= np.maximum(most, stretch**-2) + 1e-12).all()


def test_bounds_of_speeds_are_those_of_the_fastest_joint() -> None:
    steps = np.array([[0.1, -0.2], [0.0, 0.0], [0.1, 0.1]])
    found = speed_bounds(steps, np.array([-0.1, -0.1]), np.array([0.2, 0.05]))
    np.testing.assert_allclose(found, [0.25, 0.25, 0.25, 0.25])
    np.testing.assert_allclose(speed_bounds(steps[1:2], -np.ones(2), np.ones(2)), [np.inf, np.inf])


def swung(planar_arm: Callable[..., Figure], frames: int = 60) -> wb.Clip:
    """The first joint goes 2.4 rad to and fro, fastest a quarter on its way."""
    s = np.linspace(0.0, 1.0, frames)
    q = np.stack([1.2 * np.sin(np.pi * s) ** 2, 0.4 * s], axis=1)
    return wb.Clip(planar_arm((0.5, 0.5), radius=0.02), q, DT, "swung")


def test_a_clip_is_slowed_where_joints_are_too_fast(planar_arm: Callable[..., Figure]) -> None:
    clip = swung(planar_arm)
    fastest = float(np.abs(np.diff(clip.q, axis=0)).max()) / DT
    limit = 0.7 * fastest
    found = wb.avoid(clip, method=wb.motion.Trajectory(stretch=2.0), constraints=[wb.tasks.StepLimit(limit)])
    report, times = found.report, found.report.times
    assert found.clip.dt == clip.dt
    assert report.solved, report.message
    assert "slowed from" in report.message
    assert np.abs(np.diff(found.clip.q, axis=0)).max() <= limit * DT + 1e-9
    assert (np.diff(times) > 0.0).all()
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(clip.duration)
    stretches = DT / np.diff(times)
    assert stretches.min() >= 1.0 - 1e-9
    assert 1.3 < stretches.max() <= report.stretch <= 2.0
    np.testing.assert_allclose(found.clip.q, [clip.at(min(t, clip.duration)) for t in times], atol=1e-9)
    assert np.abs(np.diff(stretches)).max() < 0.1  # smoothly
    assert report.duration == pytest.approx(found.clip.duration)
    assert report.duration > clip.duration + 0.1


def test_the_bound_on_slowing_holds_where_it_is_not_enough(planar_arm: Callable[..., Figure]) -> None:
    clip = swung(planar_arm)
    found = wb.avoid(clip, method=wb.motion.Trajectory(stretch=1.2), constraints=[wb.tasks.StepLimit(0.5)])
    assert found.report.stretch <= 1.2
    assert not found.report.solved
    assert "a speed that was given is exceeded by" in found.report.message
    assert (DT / np.diff(found.report.times)).max() <= 1.2
    assert found.clip.duration <= 1.2 * clip.duration + 1e-9
    same = wb.avoid(clip, constraints=[wb.tasks.StepLimit(0.5)])
    assert same.report.stretch == 1.0
    np.testing.assert_array_equal(same.clip.q, clip.q)
    np.testing.assert_array_equal(same.report.times, clip.times)


def test_what_is_freed_and_slowed_is_free_and_slow(planar_arm: Callable[..., Figure]) -> None:
    clip = swung(planar_arm, 30)
    scene = wb.Scene(clip.figure)
    scene.add(wb.Sphere(0.1), name="ball", at=(0.45, 0.95, 0.0))
    free = wb.avoid(clip, scene)
    assert free.report.before.colliding
    limit = 0.6 * float(np.abs(np.diff(free.clip.q, axis=0)).max()) / DT
    found = wb.avoid(clip, scene, method=wb.motion.Trajectory(stretch=3.0), constraints=[wb.tasks.StepLimit(limit)])
    assert found.report.solved, found.report.message
    assert found.report.stretch > 1.1
    assert np.abs(np.diff(found.clip.q, axis=0)).max() <= limit * DT + 1e-6


def test_a_small_step_can_be_twice_as_fast_as_was_asked(planar_arm: Callable[..., Figure]) -> None:
    """0.2 rad/s at 120 Hz is 1.7 mrad a frame."""
    clip = wb.Clip(planar_arm((0.5, 0.5)), 0.2 * np.outer(np.arange(20) / 120.0, (1.0, 0.0)), 1 / 120)
    found = wb.avoid(clip, method="trajectory", constraints=[wb.tasks.StepLimit(0.1)])
    assert not found.report.solved
    assert "a speed that was given is exceeded by 100.0% of it" in found.report.message
    assert wb.avoid(clip, method="trajectory", constraints=[wb.tasks.StepLimit(0.2)]).report.solved


@pytest.mark.parametrize("stretch", [0.5, float("nan"), "2", 1e9])
def test_a_wrong_stretch_is_refused(stretch: object) -> None:
    with pytest.raises(wb.InputError, match="stretch"):
        wb.motion.Trajectory(stretch=stretch)  # type: ignore[arg-type]
