"""`python -m tests.audits newton`, as short as it can be."""

from __future__ import annotations

import numpy as np

from tests.audits import newton
from wholebody.bench.rows import Row

SIZE = ("variables", "non-zeros")


def test_the_shapes_are_assembled() -> None:
    for name, make in newton.SHAPES.items():
        made = make(7)
        assert len(made.bodies) == 7
        system = made.system()
        assert np.abs(system.residual(made.variables())).max() < 1e-12, name


def test_the_papers_size_is_met() -> None:
    row = newton.paper_row(1)
    assert abs(row["variables"] - 212) <= 5
    assert abs(row["non-zeros"] - 1455) <= 60
    assert row["systems"] == 3


def test_a_move_of_a_drag_is_of_the_papers_size() -> None:
    row = newton.drag_of_assembly_row(5)
    assert [row[name] for name in SIZE] == [newton.paper_row(1)[name] for name in SIZE]
    assert 1.0 <= row["systems"] <= 4.0


def test_exponents_are_slopes() -> None:
    rows = [Row("ring", "kkt", {"bodies": n, "µs": 3.0 * n**1.1}) for n in (10, 100, 300, 1000)]
    assert np.isclose(newton.exponent(rows, "ring", "kkt"), 1.1)
