"""Contacts whose first descent ends where the measures are no minimum cost no more than a goal at the place found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
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


@pytest.mark.parametrize(("sex", "percentile"), [("male", 60.0), ("female", 52.5)])
def test_a_lift_from_the_floor_is_no_saddle(sex: str, percentile: float) -> None:
    """A squat as in a mirror is stationary: from beside it descents lead to a lunge of three quarters of its effort."""
    scene = wb.Scene(wb.load("human", sex=sex, percentile=percentile)).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.3, 0.4, 0.3)), name="crate", at=(0.45, 0.0, 0.16))
    grasps = [wb.Grasp("left", "crate"), wb.Grasp("right", "crate")]
    measures = [wb.Effort(), wb.tasks.Rhythm(style="free")]
    problem = wb.Problem(scene, goals=grasps, constraints=[wb.Stand("floor")], measures=measures)
    solution = wb.solve(problem)
    assert solution.status == "solved"
    rng = np.random.default_rng(0)
    starts = [pin.integrate(scene.model, solution.q, rng.normal(0.0, 0.01, scene.model.nv)) for _ in range(4)]
    ends = [end for end in wb.methods.QP().minima(problem, starts) if end.status == "solved"]
    assert ends
    assert solution.assessment.measure < 1.01 * min(end.assessment.measure for end in ends)
