"""The objective against its formula, and the steps of programs with bounds on speed."""

from __future__ import annotations

import numpy as np
import pytest

from wholebody.motion.trajectory.deviations import Objective
from wholebody.motion.trajectory.interior_point import minimise
from wholebody.motion.trajectory.nodes import Node, Rows
from wholebody.motion.trajectory.program import Limits, Step, lay_out

TIME, DT = 0.1, 0.05


@pytest.mark.parametrize("seams", [(True, True), (False, True), (True, False), (False, False)])
def test_the_objective_is_its_formula(seams: tuple[bool, bool]) -> None:
    random = np.random.default_rng(0)
    x, weights, ends = random.normal(size=(7, 3)), np.array([1.0, 2.0, 0.5]), random.normal(size=(4, 3))
    padded = np.vstack([*([ends[:2]] if seams[0] else []), x, *([ends[2:]] if seams[1] else [])])
    acceleration = np.diff(padded, n=2, axis=0) / DT**2
    expected = 0.5 * (weights * (x**2).sum(axis=0)).sum()
    expected += 0.5 * TIME**4 * (weights * (acceleration**2).sum(axis=0)).sum()
    assert Objective(7, weights, TIME, DT, seams, ends).value(x) == pytest.approx(expected, rel=1e-12)


def brought_back(
    x: np.ndarray, slowest: float, fastest: float, radius: float, least: np.ndarray | None = None
) -> np.ndarray:
    """Deviations (n, 1) after the step of a program that has limits of the changes, and of deviations, and no more."""
    frames, wide = len(x), np.full((len(x), 1), np.inf)
    bounds = np.full((frames - 1, 1), slowest), np.full((frames - 1, 1), fastest)
    none = np.zeros((0, 1))
    rows = [Rows(Node(k), np.zeros(0), (none,), np.zeros(0, dtype=np.intp), np.zeros(0), none) for k in range(frames)]
    none_kept = [np.zeros(0, dtype=bool)] * frames
    one = np.zeros(1, dtype=np.intp)
    step = Step(x, rows, one, radius, 1.0, [np.zeros(0)] * frames, none_kept, one)
    limits = Limits(-wide if least is None else least, wide, *bounds)
    layout = lay_out(Objective(frames, np.ones(1), 0.0, DT, (False, False)), limits, step)
    return layout.deviations(minimise(layout.program, 1e-8, 1e-10).z, x)


def test_a_speed_that_little_exceeds_is_brought_back_by_one_short_step() -> None:
    x = np.array([[0.5], [0.5], [0.504], [0.504]])  # far from the original, 3 mrad too fast once
    after = brought_back(x, -0.01, 0.001, 0.009)
    assert np.diff(after, axis=0).max() <= 0.001 + 1e-6
    assert np.abs(after - x).max() <= 0.009 + 1e-6


def test_a_speed_that_much_exceeds_is_brought_back_by_as_much_as_a_step_can() -> None:
    x = np.array([[0.0], [0.2], [0.4], [0.6]])
    after = brought_back(x, -1.0, 0.1, 0.05)  # 0.3 rad too fast in all; a step may shift frames by 0.05 rad
    assert np.diff(after, axis=0).max() <= 0.2 - 0.1 / 6.0 + 1e-6


def test_a_speed_whose_bound_is_zero_is_kept_to_from_a_little_before_it() -> None:
    """As the first frame comes back, the second one must not be left behind."""
    x, least = np.array([[0.21], [0.2], [0.2]]), np.array([[-1.0], [0.2], [-1.0]])
    after = brought_back(x, -0.5, 0.0, 0.2, least)
    assert np.diff(after, axis=0).max() <= 1e-6
