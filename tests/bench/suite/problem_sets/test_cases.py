"""Every set: its witnesses prove it possible, no start solves it, and a seed makes one problem."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from functools import cache
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.suite.problem_sets.case import Case
from wholebody.bench.suite.problem_sets.registry import SETS, problem_set

SPARE = 5e-4  # m
TOLD = ("clutter", "self_contact", "balance", "robot_arm")  # every way of drawing things, postures and figures


@cache
def made(name: str, number: int, seed: int = 0) -> Case:
    """A case, made once for all tests of this file, which only read it."""
    return problem_set(name).make(number, seed)


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("number", [0])
def test_the_witness_meets_the_goals_with_room_to_spare(name: str, number: int) -> None:
    case = made(name, number)
    judged = wb.assess(case.problem, case.witness)
    assert judged.met(1e-6)
    assert judged.holds(1e-6)
    assert least_room(case.problem, case.witness) > SPARE
    assert case.problem.scene.figure.within_limits(case.witness)
    assert (case.set, case.number) == (name, number)


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("number", [0])
def test_the_start_is_clean_and_no_answer(name: str, number: int) -> None:
    case = made(name, number)
    judged = wb.assess(case.problem, case.problem.start)
    assert judged.holds(1e-6)
    assert SETS[name].moving or (not judged.met(0.01) and case.frames == ())


@pytest.mark.parametrize("name", TOLD)
def test_numbers_and_seeds_make_different_problems(name: str) -> None:
    assert len({fingerprint(made(name, number, seed)) for number, seed in ((0, 0), (1, 0), (0, 1))}) == 3


def test_another_process_makes_the_same_problems() -> None:
    here = {name: fingerprint(made(name, 0, 1)) for name in TOLD}
    code = f"import sys; sys.path.insert(0, {str(__file__).rpartition('/')[0]!r}); import test_cases as t; t.tell(0, 1)"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert dict(line.split() for line in told.splitlines()) == here


def tell(number: int, seed: int) -> None:
    for name in TOLD:
        print(name, fingerprint(made(name, number, seed)))


def fingerprint(case: Case) -> str:
    """All numbers of a case, to the last bit."""
    problem = case.problem
    state = problem.scene.state(case.witness)
    parts = [
        problem.start,
        case.witness,
        problem.clearances,
        np.array([piece.name for piece in bodies(case)], dtype="S"),
    ]
    parts += [piece.placement.homogeneous for piece in bodies(case)]
    parts += [goal.error(state) for goals in (problem.goals, *case.frames) for goal in resolved(case, goals)]
    return hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)).hexdigest()


def least_room(problem: wb.Problem, q: np.ndarray) -> float:
    """By how much the nearest pair exceeds its clearance; soles and what else rests at the start left out."""
    near = problem.scene.contacts(q, within=0.1)
    asked = problem.clearances[near.number]
    return float((near.distance - asked)[asked == problem.clearance].min(initial=0.1))


def bodies(case: Case) -> list[Any]:
    return list(case.problem.scene.geometry.geometryObjects)


def resolved(case: Case, goals: tuple[wb.Goal, ...]) -> list[wb.Goal]:
    return [goal.resolve(case.problem.scene, case.problem.start) for goal in goals]
