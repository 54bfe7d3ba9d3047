"""Contacts whose first descent ends where the measures are no minimum cost no more than a goal at the place found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.attack.terms import at_the_place, contact

CASES = {
    "left tip on a rod": 1989,
    "thin rod": 2411,
    "hand along an edge": 104,
}


@pytest.mark.parametrize("case", CASES.values(), ids=list(CASES))
def test_the_effort_is_that_of_the_place_and_no_direction_lowers_it(case: int, tmp_path: Path) -> None:
    verdict = contact(np.random.default_rng([3, case]), tmp_path)
    assert verdict.outcome == "right", verdict
    assert float(verdict.words.partition("optimality ")[2].partition(";")[0]) < 1e-2


def test_a_palm_on_a_table_costs_what_its_place_does() -> None:
    """The palm's frame lies within a flat face of the hand, which has to lie on the table."""
    scene = wb.Scene(wb.load("human")).add(wb.Box((0.67, 1.36, 0.03)), name="table", at=(0.76, -0.09, 0.9))
    problem = wb.Problem(scene, goals=[wb.Touch("right_palm", "table")])
    solution = wb.solve(problem)
    assert solution.status == "solved"
    assert solution.assessment.optimality < 1e-2
    other = wb.solve(at_the_place(problem, solution, ["right_palm"]))
    assert other.status != "solved" or solution.assessment.measure < 1.02 * other.assessment.measure + 1e-3
