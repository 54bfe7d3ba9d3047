"""Constants of the methods of `wb.avoid`: which are changed, and that each is taken back."""

from __future__ import annotations

import pytest

import wholebody as wb
from tests.audits import clip_constants as ablated
from wholebody.bench.rows import Row
from wholebody.motion import repair


def test_a_constant_is_halved_and_doubled_on_the_cases_of_its_methods(monkeypatch: pytest.MonkeyPatch) -> None:
    listed = ablated.numbers_of
    monkeypatch.setattr(ablated, "USED", {"repair": ("frames",), "bisection.prediction": ("bisection",)})
    monkeypatch.setattr(ablated, "numbers_of", lambda module: listed(module)[:1])
    told, settings = list[str](), repair.SETTINGS
    rows = ablated.ablation(wb.load("human"), told.append, [("squat", "nothing", "frames", 6)], tuple(ablated.USED))
    assert {row.case.rpartition(".")[0] for row in rows} == {"repair.SETTINGS"}
    assert {row.tool for row in rows} == {"halved", "doubled"}
    assert len(told) == len(rows)
    assert repair.SETTINGS is settings


def test_a_change_of_any_figure_or_of_the_programs_matters() -> None:
    nothing = dict.fromkeys(("free", "deepest mm", "deviation rad", "jerk", "feet slide mm", "programs"), 0)
    assert not ablated.matters(Row("x.Y", "halved", nothing))
    assert ablated.matters(Row("x.Y", "halved", nothing | {"programs": 1}))


def test_the_modules_whose_constants_are_changed_have_some() -> None:
    for module in ablated.USED:
        assert ablated.numbers_of(module), module
