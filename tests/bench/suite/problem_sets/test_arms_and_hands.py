"""Arms among furniture and hands that take things: witnesses hold, and numbers change what is reached into or taken."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.bench.suite.problem_sets import robots
from wholebody.bench.suite.problem_sets.registry import problem_set


@pytest.mark.parametrize("number", [0, 9, 18, 27, 36, 45, 54, 63])
def test_the_witness_of_an_arm_is_clear_and_there(number: int) -> None:
    """All eight arms, all four surroundings, with an orientation and without."""
    case = problem_set("arms_among_things").make(number, 1)
    judged, begins = (wb.assess(case.problem, q) for q in (case.witness, case.problem.start))
    assert judged.met(1e-9)
    assert judged.holds(1e-9)
    assert judged.least_distance > 0.002
    assert begins.holds(1e-9)
    assert not begins.met(0.01)
    assert isinstance(case.problem.goals[0], wb.Frame) == (number >= 32)
    assert number or np.array_equal(case.witness, problem_set("arms_among_things").make(number, 1).witness)


@pytest.mark.parametrize("number", range(8))
def test_a_free_arm_begins_apart_from_where_its_tool_goes(number: int) -> None:
    case = problem_set("free_arms").make(number, 1)
    judged, begins = (wb.assess(case.problem, q) for q in (case.witness, case.problem.start))
    assert judged.met(1e-9) and judged.holds(1e-9) and begins.holds(1e-9)  # noqa: PT018
    assert not begins.met(0.01)
    assert not case.problem.scene.objects


def test_arms_have_the_lengths_that_their_makers_give() -> None:
    """Places of the tool at zero, in metres, as forward kinematics by Denavit and Hartenberg's parameters has them."""
    known = {
        "ur5": (0.425 + 0.39225, 0.10915 + 0.0823, 0.089159 - 0.09465),
        "ur10": (0.612 + 0.5723, 0.163941 + 0.0922, 0.1273 - 0.1157),
        "panda": (0.088, 0.0, 0.333 + 0.316 + 0.384 - 0.107),
        "iiwa7": (0.0, 0.0, 0.34 + 0.4 + 0.4 + 0.126),
        "gen3": (0.0, -0.0118 - 0.0128 - 0.0004, 0.2848 + 0.4208 + 0.3143 + 0.1674),
    }
    for name, place in known.items():
        figure, _ = robots.known_arm(name)
        zero = pin.neutral(figure.model)
        assert figure.placement(zero, "tool").translation == pytest.approx(place, abs=1e-3), name


def test_the_witness_of_a_hand_has_taken_the_thing() -> None:
    case = problem_set("hands").make(6, 0)
    judged = wb.assess(case.problem, case.witness)
    assert judged.met(1e-6)
    assert judged.holds(1e-6)
    (thing,) = (name for name in case.problem.scene.objects if name != "floor")
    scene, owners = case.problem.scene, case.problem.scene.piece_owner
    near = scene.contacts(case.witness, within=1e-5)
    touching = {owners[a] if owners[b] == thing else owners[b] for a, b in near.pair if thing in (owners[a], owners[b])}
    assert any("thumb" in name for name in touching)
    assert any("index" in name for name in touching)
    assert not wb.assess(case.problem, case.problem.start).met(0.01)
