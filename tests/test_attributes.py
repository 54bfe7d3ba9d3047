"""Attributes of problems, scenes and figures that are set after they were made."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

import wholebody as wb


@pytest.fixture
def problem() -> wb.Problem:
    return wb.Problem(wb.Scene(wb.load("hand")), goals=[wb.Point("right_index_tip", (0.0, 0.0, 0.1))])


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("goals", [3], r"goals\[0\] is an int, not a Goal"),
        ("goals", 3, "goals is 3, not a list"),
        ("goals", [wb.Point("right_index_tip", (0.0, 0.0, 0.1))], "not resolved; give it to problem.retarget"),
        ("constraints", [wb.Hold("right_hand")], "not resolved; state another problem"),
        ("start", "sitting", "start"),
        ("clearances", "wide", "clearances is 'wide', not numbers"),
        ("clearance", 0.1, "clearance of a Problem cannot be set"),
        ("scene", None, "scene of a Problem cannot be set"),
    ],
)
def test_what_a_problem_cannot_be_is_refused_when_it_is_set(
    problem: wb.Problem, name: str, value: Any, sentence: str
) -> None:
    before = getattr(problem, name)
    with pytest.raises(wb.InputError, match=sentence):
        setattr(problem, name, value)
    assert getattr(problem, name) is before or name == "stated"


@pytest.mark.parametrize("name", ["figure", "pair_table"])
def test_attributes_of_a_scene_cannot_be_set(problem: wb.Problem, name: str) -> None:
    with pytest.raises(wb.InputError, match=f"^{name} of a Scene cannot be set"):
        setattr(problem.scene, name, 3)


@pytest.mark.parametrize("name", ["model", "limits"])
def test_attributes_of_a_figure_cannot_be_set(problem: wb.Problem, name: str) -> None:
    with pytest.raises(wb.InputError, match=f"^{name} of a Figure cannot be set"):
        setattr(problem.scene.figure, name, 3)


def test_copies_keep_their_values_and_their_refusal(problem: wb.Problem) -> None:
    for made in (copy.copy(problem), copy.deepcopy(problem), pickle.loads(pickle.dumps(problem))):
        assert np.array_equal(made.start, problem.start)
        assert len(made.goals) == 1
        with pytest.raises(wb.InputError):
            made.goals = [3]
        with pytest.raises(wb.InputError):
            made.scene.figure = None


def test_resolved_terms_of_another_problem_can_be_set(problem: wb.Problem) -> None:
    other = wb.Problem(problem.scene, goals=[wb.Point("right_index_tip", (0.0, 0.0, 0.2))], measures=[wb.Effort()])
    problem.goals, problem.measures = list(other.goals), other.measures
    assert problem.goals == other.goals
    assert isinstance(problem.goals, tuple)
