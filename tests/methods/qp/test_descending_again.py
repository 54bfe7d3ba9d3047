"""Contacts whose first descent ends where the measures are no minimum cost no more than a goal at the place found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wholebody.bench.attack.terms import contact


@pytest.mark.parametrize("case", [787, 1989, 2192], ids=["feet on a step", "left tip on a rod", "right tip on a rod"])
def test_the_effort_is_that_of_the_place(case: int, tmp_path: Path) -> None:
    verdict = contact(np.random.default_rng([3, case]), tmp_path)
    assert verdict.outcome == "right", verdict
