"""A change reaches the code that it is about, is taken back, and is counted."""

from __future__ import annotations

import pytest

import wholebody as wb
from tests.audits import ablation
from tests.audits.ablation import Constant, report
from wholebody.bench.rows import Row
from wholebody.bench.suite.problem_sets.registry import SETS
from wholebody.methods import contradictions, starts
from wholebody.methods.qp import settings, sqp


@pytest.fixture(scope="module")
def given():
    return [SETS["robot_arm"].make(number, 5).problem for number in range(2)]


def test_constants_are_those_of_the_method_and_of_what_methods_share() -> None:
    found, _ = ablation.constants("qp")
    by_name = {(each.module, each.name): each.value for each in found}
    assert by_name["wholebody.methods.starts", "SPREADS"] == starts.SPREADS
    assert "wholebody.methods.qp.solvers.osqp_solver" in {each.module for each in found}  # folders within too
    assert all(not each.module.startswith("wholebody.methods.newton") for each in found)


def test_constants_that_loops_were_compiled_with_are_left_out() -> None:
    found, compiled = ablation.constants("ccd")
    assert "wholebody.methods.ccd.sweep" in compiled
    assert all(each.module not in compiled for each in found)


def test_only_problems_that_the_method_takes_are_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ablation, "SETS", {name: SETS[name] for name in ("balance", "robot_arm")})
    monkeypatch.setattr(ablation, "NAMED", {})
    solver = wb.methods.CCD()
    asked = ablation.problems(1, "ccd")
    assert len(ablation.problems(1, "qp")) > len(asked) > 0
    assert all(solver.accepts(problem) is None for problem in asked)


def test_whole_numbers_stay_whole_and_at_least_one() -> None:
    assert Constant("m", "N", 4).times(0.1) == 1
    assert Constant("m", "N", 4).times(10.0) == 40
    assert Constant("m", "N", (1.0, 2.0)).times(0.5) == (0.5, 1.0)
    halved = Constant("m", "N", (3, 50)).times(0.5)
    assert halved == (2, 25)
    assert all(isinstance(each, int) for each in halved)


def test_a_constant_is_changed_wherever_it_was_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    constant = Constant("wholebody.methods.contradictions", "NEAREST", contradictions.NEAREST)
    places = ablation.places(constant)
    assert len(places) > 1
    with ablation.replaced(places, 7.0):
        assert all(getattr(owner, name) == 7.0 for owner, name in places)
    assert all(getattr(owner, name) == constant.value for owner, name in places)


def test_a_field_of_a_record_is_changed_in_every_module_that_reads_it() -> None:
    constant = Constant("wholebody.methods.qp.settings", "DESCENT.first_radius", settings.DESCENT.first_radius)
    assert constant in ablation.constants("qp")[0]
    before = sqp.DESCENT
    with ablation.changed(constant, 7.0):
        assert sqp.DESCENT.first_radius == settings.DESCENT.first_radius == 7.0
        assert sqp.DESCENT.largest_radius == before.largest_radius
    assert sqp.DESCENT is settings.DESCENT is before


def test_what_is_switched_off_is_counted_and_switched_on_again(given, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ablation, "constants", lambda method: ([], []))

    class Nothing:
        value = 1

    told: list[str] = []
    whole, rows = ablation.ablation("qp", given, {"nothing": (Nothing, "value", 2)}, told.append)
    assert Nothing.value == 1
    (row,) = rows
    assert (row.case, row.tool) == ("nothing", "off")
    assert [row[name] for name in ("answers that differ", "solved", "iterations", "left m, rad")] == [0, 0, 0, 0.0]
    assert 0.1 < row["time"] < 10.0
    assert len(told) == 1
    text = report("qp", len(given), whole, [row, Row("x.Y", "halved", row.figures)], ["a.kernel"], {})
    assert "changed no answer: x.Y" in text
    assert "a.kernel" in text


def test_every_mechanism_that_is_switched_off_is_there() -> None:
    for owner, attribute, _ in ablation.mechanisms("qp").values():
        assert getattr(owner, attribute, None) is not None
