"""Neighbouring cases give each other starts: the lower of two families of postures spreads, what is left is named."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.studies.neighbours import JUMP, TRIES, Family, lower, name_changes
from wholebody.studies.records import SolveRecord
from wholebody.studies.solving import Case, most_turned, solve_from

TILTS = np.linspace(-0.3, 0.3, 20)
GRID = np.linspace(-2.0, 2.0, 40001)


def well(x: Any, tilt: float) -> Any:
    """Two valleys near -1 and 1: the left one is the lower where the tilt is positive."""
    return (x * x - 1.0) ** 2 + tilt * x + 2.0


def descended(x: float, tilt: float) -> dict[str, Any]:
    """The valley that a start leads to."""
    for _ in range(400):
        x -= 0.05 * (4.0 * x * (x * x - 1.0) + tilt)
    return {"outcome": "solved", "q": np.array([x]), "measure": well(x, tilt)}


def family(starts: list[float], own: float, asked: Counter[int]) -> Family:
    """Cases of the valleys that given starts lead to; counts the solves of each."""
    order = [Case(SolveRecord(str(k)), lambda: None, place=(k,)) for k in range(len(TILTS))]  # type: ignore[arg-type, return-value]
    done = {k: SolveRecord(str(k), **descended(start, TILTS[k])) for k, start in enumerate(starts)}

    def compute(function: Callable[..., Any], work: Any) -> dict[Any, Any]:
        if function is most_turned:
            return {key: ("hinge", float(np.abs(a - b).max())) for key, (_, a, b) in work.items()}
        assert function is solve_from
        asked.update(k for k, _ in work.values())
        return {key: descended(own if q is None else float(q[0]), TILTS[k]) for key, (k, q) in work.items()}

    return Family(order, done, compute, lambda k, record: bool(done.update({k: record})))


@pytest.mark.parametrize("turned_at", [3, 10, 16])
@pytest.mark.parametrize("own", [-0.5, 0.5])
def test_each_posture_is_of_the_lower_family_wherever_the_first_jump_was(turned_at: int, own: float) -> None:
    asked: Counter[int] = Counter()
    given = family([1.0 if k < turned_at else -1.0 for k in range(len(TILTS))], own, asked)
    assert not lower(given)
    for k, tilt in enumerate(TILTS):
        lowest = GRID[well(GRID, tilt).argmin()]
        assert given.done[k].q == pytest.approx(lowest, abs=2e-3)
    assert max(asked.values()) <= TRIES
    assert not name_changes(given)
    changed = {k: record.change for k, record in given.done.items() if record.change}
    assert [*changed] == [int((TILTS < 0.0).sum())]
    assert next(iter(changed.values())).startswith("hinge by 1")


def test_a_case_solved_from_its_own_start_leads_out_of_a_higher_family_that_does_not_jump() -> None:
    asked: Counter[int] = Counter()
    given = family([1.0] * len(TILTS), -0.5, asked)
    assert not lower(given, [15])
    for k, tilt in enumerate(TILTS):
        assert given.done[k].q == pytest.approx(GRID[well(GRID, tilt).argmin()], abs=2e-3)
    assert max(asked.values()) <= TRIES


def test_where_answers_of_neighbours_are_of_no_use_own_starts_lead_to_the_lower_family() -> None:
    """Solves from the answers of others all fail, so that a jump moves by own starts alone."""
    asked: Counter[int] = Counter()
    given = family([1.0 if k < 15 else -1.0 for k in range(len(TILTS))], -0.5, asked)

    def alone(function: Callable[..., Any], work: Any) -> dict[Any, Any]:
        found = given.compute(function, work)
        return {key: answer for key, answer in found.items() if work[key][1] is None}

    assert not lower(given._replace(compute=alone))
    for k, tilt in enumerate(TILTS):
        assert given.done[k].q == pytest.approx(GRID[well(GRID, tilt).argmin()], abs=2e-3)
    assert max(asked.values()) <= TRIES


def test_a_posture_that_changes_continuously_costs_no_more_solves() -> None:
    asked: Counter[int] = Counter()
    given = family([1.0] * len(TILTS), 0.5, asked)
    before = dict(given.done)
    assert not lower(given)
    assert not name_changes(given)
    assert given.done == before
    assert not asked


def test_the_joint_that_turns_most_is_named_and_what_shifts_is_not() -> None:
    figure = wb.load("human")
    scene = wb.Scene(figure)
    one = figure.neutral
    other = one.copy()
    other[:3] += 1.0  # the root shifts
    knee = figure.joints.index("right_knee_flexion")
    other[len(other) - len(figure.joints) + knee] += 2.0 * JUMP
    ((name, angle),) = most_turned([(lambda: wb.Problem(scene), one, other)], wb.methods.QP())
    assert name == "right_knee_flexion"
    assert angle == pytest.approx(2.0 * JUMP)


def test_the_order_in_which_solves_end_does_not_matter() -> None:
    starts = [1.0 if k < 8 else -1.0 for k in range(len(TILTS))]
    one, other = (family(starts, 0.5, Counter()) for _ in range(2))
    lower(one)
    lower(other._replace(compute=lambda *given: dict(reversed(other.compute(*given).items()))))
    assert [record.q for record in one.done.values()] == [record.q for record in other.done.values()]
