"""Collision groups by brute force on random marks; interpolation: ends are reproduced, lines are lines."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.motion.bisection.method import collision_groups, fill, key_frames, linear, quadratic

SEEDS = st.integers(0, 10_000)


@cache
def person() -> Figure:
    return wb.load("human")


def posture(rng: np.random.Generator) -> Array:
    """A posture a radian from standing at most, the free root turned and moved as well."""
    figure = person()
    return np.asarray(pin.integrate(figure.model, figure.neutral, rng.uniform(-1.0, 1.0, figure.model.nv)))


def apart(a: Array, b: Array) -> float:
    return float(np.abs(pin.difference(person().model, a, b)).max())


@given(SEEDS, st.integers(0, 30), st.integers(1, 20), st.integers(1, 20))
def test_the_parabola_goes_through_its_three_postures(seed: int, a: int, left: int, right: int) -> None:
    rng = np.random.default_rng(seed)
    qa, qm, qb = (posture(rng) for _ in range(3))
    m, b = a + left, a + left + right
    for frame, expected in ((a, qa), (m, qm), (b, qb)):
        assert apart(quadratic(person().model, a, m, b, qa, qm, qb, frame), expected) < 1e-9


@given(SEEDS, st.integers(1, 20))
def test_the_line_goes_through_its_ends_at_constant_speed(seed: int, frames: int) -> None:
    rng = np.random.default_rng(seed)
    qa, qb = posture(rng), posture(rng)
    model = person().model
    path = [linear(model, 3, 3 + frames, qa, qb, 3 + k) for k in range(frames + 1)]
    assert apart(path[0], qa) < 1e-9
    assert apart(path[-1], qb) < 1e-9
    steps = [pin.difference(model, p, q) for p, q in pairwise(path)]
    assert np.ptp(steps, axis=0).max() < 1e-9
    assert max(abs(np.linalg.norm(q[3:7]) - 1.0) for q in path) < 1e-9


@given(SEEDS)
def test_joints_on_a_parabola_are_reproduced(seed: int) -> None:
    """Joints without a curved space follow the polynomial through three values: numpy's."""
    rng = np.random.default_rng(seed)
    frames = np.array([2, 5, 11])
    q = np.tile(person().neutral, (3, 1))
    q[:, 7:] += rng.uniform(-0.5, 0.5, (3, q.shape[1] - 7))
    fitted = np.polyfit(frames, q[:, 7:], 2)
    for frame in range(2, 12):
        found = quadratic(person().model, 2, 5, 11, *q, frame)
        assert np.allclose(found[7:], np.polyval(fitted, frame), atol=1e-9)


@pytest.mark.parametrize("kind", ["linear", "quadratic"])
def test_a_group_of_one_or_two_frames_is_filled_without_a_division_by_zero(kind: str) -> None:
    """The fit of the thesis, between the first and the last frame of a group, divides by zero where it has two."""
    rng = np.random.default_rng(1)
    q = np.array([posture(rng) for _ in range(4)])
    kept = q.copy()
    fill(person().model, q, 0, 1, 3, kind)  # type: ignore[arg-type]
    assert np.array_equal(q[[0, 1, 3]], kept[[0, 1, 3]])
    assert np.isfinite(q).all()
    fill(person().model, q, 0, 1, 2, kind)  # type: ignore[arg-type]
    assert np.array_equal(q[:3], np.vstack([kept[:2], q[2]]))
    fill(person().model, q, 0, 0, 3, kind)  # type: ignore[arg-type]
    assert apart(q[1], pin.interpolate(person().model, kept[0], kept[3], 1 / 3)) < 1e-9


def test_key_frames_are_what_the_motion_can_be_interpolated_from() -> None:
    model = person().model
    q = np.tile(person().neutral, (41, 1))
    q[:, 20] += np.interp(np.arange(41), [0, 10, 30, 40], [0.0, 0.8, -0.8, 0.0])
    moving = np.ones(model.nv, dtype=bool)
    assert key_frames(model, q, moving, 0.05) == (0, 10, 30, 40)
    moving[19] = False
    assert key_frames(model, q, moving, 0.05) == (0, 40)
    assert key_frames(model, q[:1], moving, 0.05) == (0,)


MARKS = st.lists(st.booleans(), min_size=2, max_size=60)


@given(MARKS, st.integers(0, 59), st.integers(0, 59), st.floats(0.0, 3.0), st.integers(1, 12))
def test_groups_cover_the_marks_inside_and_stay_apart(
    marks: list[bool], low: int, high: int, share: float, least: int
) -> None:
    bad = np.array(marks)
    low, high = sorted((min(low, len(bad) - 1), min(high, len(bad) - 1)))
    found = collision_groups(bad, low, high, share, least)
    covered = {frame for group in found for frame in range(group.first, group.last + 1)}
    assert set(np.flatnonzero(bad).tolist()) & set(range(low + 1, high)) <= covered
    assert all(low < group.first <= group.middle <= group.last < high for group in found)
    assert all(bad[group.middle] for group in found)
    assert all(group.last - group.first + 1 >= min(least, high - low - 1) for group in found)
    # The frames beside a group, from which it is interpolated, are in no group.
    assert all(b.first - a.last > 1 for a, b in pairwise(found))
    assert not any(bad[group.first - 1] for group in found if group.first - 1 > low)
    assert not any(bad[group.last + 1] for group in found if group.last + 1 < high)


def test_a_group_is_widened_by_a_share_of_its_frames() -> None:
    bad = np.zeros(40, dtype=bool)
    bad[20:24] = True
    (group,) = collision_groups(bad, 0, 39, 0.5)
    assert (group.first, group.middle, group.last) == (18, 21, 25)
    (group,) = collision_groups(bad, 19, 39, 0.5)
    assert (group.first, group.last) == (20, 25)  # a key at 19 stays


def test_a_short_group_is_widened_to_the_least_where_there_is_room() -> None:
    bad = np.zeros(20, dtype=bool)
    bad[10] = True
    for low, high, frames in ((0, 19, (8, 12)), (9, 19, (10, 14)), (0, 11, (6, 10)), (8, 12, (9, 11))):
        (group,) = collision_groups(bad, low, high, 0.0, 5)
        assert (group.first, group.last) == frames


def test_groups_whose_buffers_meet_are_one() -> None:
    bad = np.zeros(30, dtype=bool)
    bad[[5, 6, 9, 10]] = True
    assert len(collision_groups(bad, 0, 29)) == 2
    (group,) = collision_groups(bad, 0, 29, 0.5)
    assert (group.first, group.middle, group.last) == (4, 6, 11)


def test_there_is_no_group_between_neighbours() -> None:
    assert collision_groups(np.ones(5, dtype=bool), 2, 3, 1.0, 9) == []
