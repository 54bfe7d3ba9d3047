"""Every factorisation against the dense one, on systems of every shape."""

from __future__ import annotations

import numpy as np
import pytest

from wholebody.methods.newton.linear_algebra import (
    Gram,
    LinearSystem,
    Pattern,
    dense_columns,
    linear_algebra,
)

SPARSE = ("auto", "normal", "kkt", "schur")


def _pattern(rng: np.random.Generator, height: int, width: int, hub: bool = False) -> Pattern:
    full = rng.random((height, width)) < 4.0 / width
    full[np.arange(height), np.arange(height)] = True
    if hub:
        full[:, -3:] = True
        full[-2:, :-3] = False  # rows that only the hub has
    rows, columns = np.nonzero(full)
    order = rng.permutation(len(rows))
    return Pattern(rows[order], columns[order], height, width)


def _system(rng: np.random.Generator, pattern: Pattern) -> LinearSystem:
    return LinearSystem(
        rng.normal(size=len(pattern.rows)),
        rng.uniform(0.5, 2.0, pattern.width),
        np.where(rng.random(pattern.height) < 0.3, rng.uniform(0.1, 1e3, pattern.height), 1e-10),
        rng.normal(size=pattern.width),
        rng.normal(size=pattern.height),
    )


def jacobian_of(pattern: Pattern, values: np.ndarray) -> np.ndarray:
    """The Jacobian as an array (height, width)."""
    result = np.zeros((pattern.height, pattern.width))
    np.add.at(result, (pattern.rows, pattern.columns), values)
    return result


def _dense(pattern: Pattern, system: LinearSystem) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and multipliers by LAPACK's LU factorisation of the whole KKT matrix."""
    jacobian = jacobian_of(pattern, system.values)
    matrix = np.block([[np.diag(system.weight), -jacobian.T], [-jacobian, -np.diag(system.damping)]])
    found = np.linalg.solve(matrix, np.concatenate([-system.gradient, system.residual]))
    return found[: pattern.width], found[pattern.width :]


@pytest.mark.parametrize("name", SPARSE)
@pytest.mark.parametrize("hub", [False, True])
def test_each_solves_what_the_dense_one_solves(name: str, hub: bool) -> None:
    rng = np.random.default_rng(1)
    pattern = _pattern(rng, 130 if hub else 40, 180 if hub else 60, hub)
    assert len(dense_columns(pattern)) == (3 if hub else 0)
    solver = linear_algebra(pattern, name)
    for _ in range(3):  # refilled, not rebuilt
        system = _system(rng, pattern)
        step, multiplier = solver.solve(system)
        wanted, its_multiplier = _dense(pattern, system)
        assert step == pytest.approx(wanted, abs=1e-6)
        assert multiplier == pytest.approx(its_multiplier, rel=1e-7, abs=1e-5)
    assert 0 < solver.fill < 200 * pattern.height


def test_compiled_products_are_those_of_dense_matrices() -> None:
    rng = np.random.default_rng(6)
    pattern = _pattern(rng, 40, 60)
    gram = Gram(pattern)
    for _ in range(2):  # refilled, not rebuilt
        system = _system(rng, pattern)
        gram.refill(system.values, system.weight, system.damping)
        jacobian = jacobian_of(pattern, system.values)
        wanted = np.tril(jacobian @ np.diag(1.0 / system.weight) @ jacobian.T + np.diag(system.damping))
        assert gram.matrix.toarray() == pytest.approx(wanted, rel=1e-12, abs=1e-12)


def test_a_hub_costs_less_when_its_columns_are_split_off() -> None:
    rng = np.random.default_rng(2)
    pattern = _pattern(rng, 400, 500, hub=True)
    split, filled = linear_algebra(pattern, "schur"), linear_algebra(pattern, "normal")
    system = _system(rng, pattern)
    split.solve(system)
    filled.solve(system)
    assert filled.fill == 400 * 401 // 2
    assert split.fill < 0.5 * filled.fill


def test_conflicting_rows_are_met_in_the_least_squares_sense() -> None:
    pattern = Pattern(np.array([0, 1]), np.array([0, 0]), 2, 1)
    system = LinearSystem(np.ones(2), np.ones(1), np.full(2, 1e-9), np.zeros(1), np.array((1.0, -2.0)))
    for name in SPARSE:
        step, _ = linear_algebra(pattern, name).solve(system)
        assert step == pytest.approx([0.5], abs=1e-6), name
