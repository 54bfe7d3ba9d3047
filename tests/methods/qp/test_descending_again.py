"""Contacts whose first descent ends where the measures are no minimum cost no more than a goal at the place found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wholebody.bench.attack.terms import contact


CASES = {
    "feet on a step": 787,
    "left tip on a rod": 1989,
    "right tip on a rod": 2192,
    "thin rod": 2411,
    "hand along an edge": 104,
    "thumb on a box": 2280,
}


@pytest.mark.parametrize("case", CASES.values(), ids=list(CASES))
def test_the_effort_is_that_of_the_place_and_no_direction_lowers_it(case: int, tmp_path: Path) -> None:
    verdict = contact(np.random.default_rng([3, case]), tmp_path)
    assert verdict.outcome == "right", verdict
    assert float(verdict.words.partition("optimality ")[2].partition(";")[0]) < 1e-2
