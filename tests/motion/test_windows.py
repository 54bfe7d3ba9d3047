"""Windows around marked frames."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from wholebody.motion.windows import Window, long_runs, runs, windows


def marked(count: int, *frames: int) -> np.ndarray:
    wrong = np.zeros(count, dtype=bool)
    wrong[list(frames)] = True
    return wrong


def test_runs_are_maximal() -> None:
    assert runs(marked(8, 0, 1, 4, 7)) == [Window(0, 2), Window(4, 5), Window(7, 8)]
    assert runs(marked(5)) == []


@given(st.lists(st.booleans(), min_size=2, max_size=60))
def test_runs_have_every_mark_and_do_not_meet(marks: list[bool]) -> None:
    found = runs(np.array(marks))
    assert [frame for run in found for frame in range(run.first, run.end)] == np.flatnonzero(marks).tolist()
    assert all(b.first > a.end for a, b in pairwise(found))


def test_windows_that_meet_are_one() -> None:
    assert windows(marked(30, 5, 10, 25), 2) == [Window(3, 13), Window(23, 28)]
    assert windows(marked(10, 0, 9), 3) == [Window(0, 4), Window(6, 10)]


def test_short_runs_are_left_out() -> None:
    assert long_runs(marked(8, 0, 1, 4, 6, 7), 2).tolist() == marked(8, 0, 1, 6, 7).tolist()
    assert long_runs(marked(3, 1), 0).tolist() == marked(3, 1).tolist()
