"""How time is shared among methods: nobody is starved, what is left over is used, and the total is kept."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wholebody.bench.suite.compare.results import Chunk
from wholebody.bench.suite.compare.run import FIRST, Plan, Settings, share_out

COSTS = st.lists(st.tuples(st.floats(1e-3, 5.0), st.floats(1e-3, 30.0)), min_size=1, max_size=8)


@given(costs=COSTS, total=st.floats(0.1, 2000.0))
def test_the_total_is_kept_and_everyone_gets_a_case(costs: list[tuple[float, float]], total: float) -> None:
    one, sweep = np.array(costs).T
    most, swept = np.full(len(one), 200.0), np.full(len(one), 40.0)
    cases, sweeps = share_out(one, sweep, most, swept, total)
    assert (cases >= 1).all()
    assert (cases <= 200).all()
    assert (sweeps <= 40).all()
    assert one @ cases + sweep @ sweeps <= max(total, one.sum()) + 1e-6
    if one @ most + sweep @ swept <= total:
        assert (cases == 200).all()
        assert (sweeps == 40).all()


def test_what_a_fast_method_leaves_over_goes_to_a_slow_one() -> None:
    one, sweep = np.array([0.01, 1.0]), np.array([0.1, 10.0])
    most, swept = np.array([200.0, 200.0]), np.array([40.0, 40.0])
    cases, sweeps = share_out(one, sweep, most, swept, 106.0)  # the fast one needs 6 s, the slow one has 100 s
    assert (cases[0], sweeps[0]) == (200, 40)
    assert cases[1] * 1.0 + sweeps[1] * 10.0 == pytest.approx(100.0, abs=11.0)
    assert sweeps[1] == 5  # half of the share


def test_costs_that_are_not_known_yet_bound_nothing() -> None:
    cases, sweeps = share_out(np.zeros(2), np.zeros(2), np.full(2, 20.0), np.full(2, 6.0), 1.0)
    assert (cases == 20).all()
    assert (sweeps == 6).all()


def test_one_slow_start_does_not_end_a_set_but_slow_building_does(fakes: ModuleType) -> None:
    plan = Plan(Settings((fakes.SET,), (fakes.adapter("solves"),), 100, 0, minutes=1.0), jobs=1)
    plan.note(Chunk("arm", 0, (), building=50.0))
    assert plan.cases("arm") == 100
    for number in range(1, FIRST + 2):
        plan.note(Chunk("arm", number, (), building=0.01))
    assert plan.cases("arm") == 100
    slow = Plan(Settings((fakes.SET,), (fakes.adapter("solves"),), 100, 0, minutes=1.0), jobs=1)
    for number in range(FIRST):
        slow.note(Chunk("arm", number, (), building=2.0))
    assert slow.cases("arm") == 9  # of sixty seconds 30 % for building


def test_a_slow_first_case_does_not_end_a_run_of_one_set(fakes: ModuleType) -> None:
    plan = Plan(Settings((fakes.SET,), (fakes.adapter("solves"),), 600, 0, minutes=1.0), jobs=1)
    plan.note(Chunk("arm", 0, (), {"solves": 0.01}, building=50.0))
    assert plan.allowed()["arm", "solves"].cases == 600


def test_a_set_whose_goals_move_has_as_many_cases_as_another(fakes: ModuleType) -> None:
    """And the first ones are the same whatever the number: each is made from a seed and a number of its own."""
    asked = Settings((fakes.SET, fakes.MOVING), (fakes.adapter("solves"),), 200, 40, minutes=100.0)
    assert [asked.asked(family) for family in asked.sets] == [(200, 40), (200, 10)]
    plan = Plan(asked, jobs=1)
    for number in range(FIRST):
        for family in asked.sets:
            plan.note(Chunk(family.name, number, (), {"solves": 0.01}, building=0.01))
    assert {key: each.cases for key, each in plan.allowed().items()} == {
        ("arm", "solves"): 200,
        ("moving", "solves"): 200,
    }


def test_the_case_for_which_everything_was_compiled_does_not_end_the_run(fakes: ModuleType) -> None:
    plan = Plan(Settings((fakes.SET, fakes.MOVING), (fakes.adapter("solves"),), 20, 0, minutes=1.0), jobs=1)
    plan.note(Chunk("arm", 0, (), {"solves": 0.01}, building=50.0))
    for number in range(FIRST):
        plan.note(Chunk("moving", number, (), {"solves": 0.01}, building=0.01))
    assert plan.allowed()["arm", "solves"].cases == 20
