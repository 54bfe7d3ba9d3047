"""A change reaches the code that it is about, is taken back, and is counted."""

from __future__ import annotations

import pytest

import wholebody as wb
from tests.audits import ablation
from tests.audits.ablation import Constant, report
from wholebody.bench.rows import Row
from wholebody.bench.suite.problem_sets.registry import SETS
from wholebody.methods import contradictions
from wholebody.methods.qp import settings, sqp


@pytest.fixture(scope="module")
def given():
    return [SETS["robot_arm"].make(number, 5).problem for number in range(2)]


def test_only_problems_that_the_method_takes_are_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ablation, "SETS", {name: SETS[name] for name in ("balance", "robot_arm")})
    monkeypatch.setattr(ablation, "NAMED", {})
    solver = wb.methods.CCD()
    asked = ablation.problems(1, "ccd")
    assert len(ablation.problems(1, "qp")) > len(asked) > 0
    assert all(solver.accepts(problem) is None for problem in asked)


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


def test_every_mechanism_is_where_the_list_says() -> None:
    given = ablation.mechanisms("qp")
    missing = [name for name, (owner, attribute, _) in given.items() if not hasattr(owner, attribute)]
    assert len(given) > 20
    assert not missing


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
