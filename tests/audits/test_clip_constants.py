"""Constants of the methods of `wb.avoid`: which are changed, and that each is taken back."""

from __future__ import annotations

from tests.audits import clip_constants as ablated
from wholebody.bench.rows import Row


def test_a_change_of_any_figure_or_of_the_programs_matters() -> None:
    nothing = dict.fromkeys(("free", "deepest mm", "deviation rad", "jerk", "feet slide mm", "programs"), 0)
    assert not ablated.matters(Row("x.Y", "halved", nothing))
    assert ablated.matters(Row("x.Y", "halved", nothing | {"programs": 1}))


def test_the_modules_whose_constants_are_changed_have_some() -> None:
    for module in ablated.USED:
        assert ablated.numbers_of(module), module
