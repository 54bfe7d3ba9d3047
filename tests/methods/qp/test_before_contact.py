"""Contacts from starts on the wrong side of things: a driver whose feet begin under the pedals."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.suite.problem_sets.registry import problem_set


def pitched(degrees: float) -> tuple[float, float, float, float]:
    half = np.radians(degrees) / 2.0
    return 0.0, float(np.sin(half)), 0.0, float(np.cos(half))


def driver(sex: str, percentile: float) -> wb.Problem:
    """The seat of docs/how-to/driver.md."""
    scene = wb.Scene(wb.load("human", sex=sex, percentile=percentile))
    scene.add(wb.Box((0.50, 0.52, 0.08)), name="seat", at=(-0.30, 0.0, 0.26))
    scene.add(wb.Box((0.08, 0.52, 0.60)), name="backrest", at=(-0.60, 0.0, 0.60, *pitched(-12.0)))
    scene.add(wb.Box((0.35, 0.60, 0.02)), name="pedals", at=(0.45, 0.0, 0.13, *pitched(-25.0)))
    scene.add(wb.Torus(0.18, 0.015), name="wheel", at=(0.15, 0.0, 0.72, *pitched(-65.0)))
    hands = [wb.Grasp(side, "wheel", kind="power") for side in ("left", "right")]
    gaze = wb.Axis("gaze", (1, 0, 0), direction=(1, 0, -0.1), weight=0.1)
    goals = [wb.Sit(on="seat", back="backrest"), *hands, gaze]
    return wb.Problem(scene, "sitting", goals=goals, constraints=[wb.Stand(on="pedals", balance=False)])


@pytest.mark.parametrize(("sex", "percentile"), [("male", 80), ("female", 5)])
def test_a_driver_sits_in_the_seat_of_the_guide(sex: str, percentile: float) -> None:
    solution = wb.solve(driver(sex, percentile), wb.QP(measures=False, time_limit=30.0))
    assert solution.solved, solution


def test_feet_get_onto_a_board_that_they_begin_under() -> None:
    scene = wb.Scene(wb.load("human")).add(wb.Box((0.8, 0.8, 0.02)), name="board", at=(0.0, 0.0, 0.29))
    problem = wb.Problem(scene, "standing", constraints=[wb.Stand("board")])
    solution = wb.solve(problem, wb.QP(measures=False, time_limit=30.0))
    assert solution.solved, solution
    assert scene.figure.placement(solution.q, "left_sole").translation[2] == pytest.approx(0.30, abs=1e-3)


@pytest.mark.parametrize("number", [15, 25])
def test_toes_come_to_rest_at_the_edge_of_a_pedal(number: int) -> None:
    """At an edge the distance has a kink, at which the last tenth of a millimetre was not gone."""
    solution = wb.solve(problem_set("drivers").make(number, 0).problem, wb.QP(measures=False, time_limit=30.0))
    assert solution.solved, solution


@pytest.mark.parametrize("number", [8, 13])
def test_contacts_are_met_from_an_end_in_front_of_all_faces(number: int) -> None:
    """The first descents end 0.2 m away, or in front of the faces, whence feasibility alone stalls at 1 cm."""
    solution = wb.solve(problem_set("drivers").make(number, 0).problem, wb.QP(measures=False, time_limit=30.0))
    assert solution.solved, solution
