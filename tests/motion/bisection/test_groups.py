"""Collision groups by brute force on random marks."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from wholebody.motion.bisection.groups import collision_groups

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


def test_groups_whose_buffers_meet_are_one() -> None:
    bad = np.zeros(30, dtype=bool)
    bad[[5, 6, 9, 10]] = True
    assert len(collision_groups(bad, 0, 29)) == 2
    (group,) = collision_groups(bad, 0, 29, 0.5)
    assert (group.first, group.middle, group.last) == (4, 6, 11)


def test_there_is_no_group_between_neighbours() -> None:
    assert collision_groups(np.ones(5, dtype=bool), 2, 3, 1.0, 9) == []
