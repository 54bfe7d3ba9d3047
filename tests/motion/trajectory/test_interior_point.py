"""Programs of trajectories by the package's own solver, against dense solvers and the conditions of optimality."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest
import qpsolvers
import scipy.sparse as sp

from wholebody.motion.trajectory import interior_point
from wholebody.motion.trajectory.banded_kernel import add_rows
from wholebody.motion.trajectory.deviations import Objective
from wholebody.motion.trajectory.interior_point import Answer, BandedQP

FRAMES, DOFS = 10, 3
PRICE = 1e3


def minimise(*given: Any) -> Answer:
    """The answer of a program, its fields one after the other."""
    return interior_point.minimise(BandedQP(*given))


def minimise_well(*given: Any) -> Answer:
    """The same, nearer to the optimum."""
    return interior_point.minimise(BandedQP(*given), 1e-8, 1e-11)


def program(seed: int, fixed: bool = True, contradicting: bool = False) -> BandedQP:
    """A program as trajectories have them: rows of one frame and of two, with slacks of their own and shared ones.

    The first two rows of a frame share a slack, the third has its own, and two bounds of changes have none.
    """
    random = np.random.default_rng(seed)
    n = FRAMES * (DOFS + 2)
    place = np.arange(FRAMES)[:, None] * (DOFS + 2) + np.arange(DOFS)
    P, c, G, lower, upper = np.zeros((n, n)), np.zeros(n), [], [], []
    bands = Objective(FRAMES, np.ones(DOFS), 0.1, 1.0 / 30.0, (True, True)).bands
    for dof in range(DOFS):
        P[np.ix_(place[:, dof], place[:, dof])] += bands
    for frame in range(FRAMES):
        shared, own = place[frame, -1] + 1, place[frame, -1] + 2
        P[shared, shared] = P[own, own] = 1e-2 * PRICE
        c[shared] = c[own] = PRICE
        for slack in (shared, shared, own):
            row = np.zeros(n)
            row[place[frame]] = random.normal(size=DOFS)
            if frame + 1 < FRAMES and slack == own:
                row[place[frame + 1]] = random.normal(size=DOFS)
            row[slack] = 1.0
            G.append(row)
            lower.append(random.normal(0.02, 0.05))
            upper.append(np.inf)
        if contradicting:
            again = -G[-1]
            again[own] = 1.0
            G.append(again)
            lower.append(0.1 - lower[-1])
            upper.append(np.inf)
        if frame + 1 < FRAMES:
            row = np.zeros(n)
            row[place[frame + 1, 0]], row[place[frame, 0]] = 1.0, -1.0
            G.append(row)
            lower.append(-0.03)
            upper.append(0.02)
    least, most = np.zeros(n), np.full(n, np.inf)
    least[place], most[place] = -0.25, 0.25
    if fixed:
        least[place[0]] = most[place[0]] = 0.0
    return BandedQP(
        sp.csc_matrix(P), c, sp.csc_matrix(np.array(G)), np.array(lower), np.array(upper), least, most, np.zeros(n)
    )


def dense(asked: BandedQP) -> np.ndarray:
    """The answer of an exact solver."""
    G, above = asked.G.toarray(), np.isfinite(asked.upper)
    found = qpsolvers.solve_qp(
        asked.P.toarray(), asked.c, np.vstack([-G, G[above]]), np.concatenate([-asked.lower, asked.upper[above]]),
        lb=asked.least, ub=np.minimum(asked.most, 1e3), solver="daqp",
    )  # fmt: skip
    assert found is not None
    return np.asarray(found)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("fixed", [True, False])
@pytest.mark.parametrize("contradicting", [True, False])
@pytest.mark.parametrize("known", [True, False])
def test_it_agrees_with_an_exact_solver(seed: int, fixed: bool, contradicting: bool, known: bool) -> None:
    asked = program(seed, fixed, contradicting)
    asked = asked if known else asked._replace(start=None)
    answer = interior_point.minimise(asked, 1e-7, 1e-10)
    assert answer.solved
    np.testing.assert_allclose(answer.z, dense(asked), atol=2e-5)


def test_it_takes_few_iterations() -> None:
    assert max(minimise(*program(seed)).iterations for seed in range(8)) <= 20


def test_a_program_without_an_answer_ends() -> None:
    """The only unknown is to be above 0.2 and below 0.1."""
    eye = sp.csc_matrix(np.ones((1, 1)))
    twice = sp.csc_matrix(np.ones((2, 1)))
    answer = minimise(
        eye, np.zeros(1), twice, np.array([0.2, -np.inf]), np.array([np.inf, 0.1]), -np.ones(1), np.ones(1), None,
    )  # fmt: skip
    assert not answer.solved
    assert np.isfinite(answer.z).all()


def test_unknowns_without_room_stay() -> None:
    asked = program(0)
    still = asked._replace(least=np.full(len(asked.c), 0.1), most=np.full(len(asked.c), 0.1))
    np.testing.assert_array_equal(minimise(*still).z, 0.1)


@pytest.mark.parametrize(("asked", "solved"), [(2.0, True), (5.0, False)])
@pytest.mark.parametrize("free", [0, 1])
def test_rows_of_unknowns_without_room_hold_or_not(asked: float, solved: bool, free: int) -> None:
    """Two unknowns are 1 each, and their sum is to be at least so much; others do not enter the row."""
    n = 2 + free
    least, most = np.full(n, -3.0), np.full(n, 3.0)
    least[:2] = most[:2] = 1.0
    G = sp.csc_matrix(np.array([[1.0, 1.0, 0.0][:n]]))
    answer = minimise(
        sp.csc_matrix(np.eye(n)),
        np.zeros(n),
        G,
        np.array([asked]),
        np.full(1, np.inf),
        least,
        most,
        None,
    )
    assert answer.solved == solved
    np.testing.assert_allclose(answer.z[:2], 1.0)


def test_bounds_that_cross_have_no_answer() -> None:
    eye, none = sp.csc_matrix(np.eye(1)), sp.csc_matrix((0, 1))
    assert not minimise(eye, np.ones(1), none, *[np.zeros(0)] * 2, np.ones(1), -np.ones(1), None).solved


def test_unknowns_without_bounds_are_found() -> None:
    eye, none = sp.csc_matrix(np.eye(2)), sp.csc_matrix((0, 2))
    bound = np.array([np.inf, 0.5])
    answer = minimise(eye, np.array([-2.0, -2.0]), none, *[np.zeros(0)] * 2, -bound, bound, None)
    assert answer.solved
    np.testing.assert_allclose(answer.z, [2.0, 0.5], atol=1e-5)


def test_two_figures_that_do_not_meet_cost_as_much_as_two_programs() -> None:
    """Frames of both have their unknowns by turns; no row has some of both."""
    rng, frames, size = np.random.default_rng(0), 60, 40
    coupled = sp.kron(sp.diags([2.0, -0.9, -0.9], [0, 1, -1], shape=(frames, frames)), sp.eye(2 * size))
    rows = [np.zeros((2, 2 * size)) for _ in range(frames)]
    for row in rows:
        row[0, :size], row[1, size:] = rng.normal(size=(2, size))
    count = 2 * size * frames
    program = (
        sp.csc_matrix(coupled), rng.normal(size=count), sp.csc_matrix(sp.block_diag(rows)), np.full(2 * frames, 0.1),
        np.full(2 * frames, np.inf), np.full(count, -2.0), np.full(count, 2.0),
    )  # fmt: skip
    tracemalloc.start()
    answer = minimise_well(*program, None)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert answer.solved
    assert peak < 2.5 * 8 * count * 2 * size  # bytes: the band and its copy; of both together it is twice as wide
    one, other = np.arange(count).reshape(frames, 2, size).transpose(1, 0, 2).reshape(2, -1)
    for own, first in ((one, 0), (other, 1)):
        kept = np.arange(first, 2 * frames, 2)
        P, c, G, lower, upper, least, most = program
        alone = minimise_well(
            sp.csc_matrix(P[own][:, own]), c[own], sp.csc_matrix(G[kept][:, own]), lower[kept], upper[kept], least[own],
            most[own], None,
        )  # fmt: skip
        np.testing.assert_allclose(answer.z[own], alone.z, atol=1e-4)


@pytest.mark.parametrize("rows", [0, 2])
def test_a_program_whose_objective_couples_nothing(rows: int) -> None:
    """Any unknown could be a slack then; the answer is the target, clipped."""
    target = np.array([0.3, -0.1, 0.05])
    G = sp.csc_matrix(np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0]])[:rows].reshape(rows, 3))
    answer = minimise(
        sp.csc_matrix(np.eye(3)), -target, G, np.full(rows, -1.0), np.full(rows, np.inf), np.full(3, -0.2),
        np.full(3, 0.2), None,
    )  # fmt: skip
    assert answer.solved
    half = minimise(
        sp.csc_matrix(np.eye(3)), -target, G, np.full(rows, -1.0), np.full(rows, np.inf), np.zeros(3),
        np.full(3, np.inf), np.zeros(3),
    )  # fmt: skip
    np.testing.assert_allclose(half.z, np.maximum(target, 0.0), atol=1e-4)
    np.testing.assert_allclose(answer.z, np.clip(target, -0.2, 0.2), atol=1e-4)


def test_squares_of_rows_in_a_band() -> None:
    random = np.random.default_rng(0)
    first, lengths = np.array([0, 2, 3, 5, 4]), np.array([3, 4, 1, 0, 3])
    begins = np.concatenate([[0], np.cumsum(lengths)])
    values, weights = random.normal(size=begins[-1]), random.normal(size=5)
    rows = np.zeros((5, 8))
    for k in range(5):
        rows[k, first[k] : first[k] + lengths[k]] = values[begins[k] : begins[k + 1]]

    def full(band: np.ndarray) -> np.ndarray:
        lower = np.array([[band[j, i - j] if 0 <= i - j < band.shape[1] else 0.0 for j in range(8)] for i in range(8)])
        return lower + np.tril(lower, -1).T

    band = np.zeros((8, 7))
    add_rows(band, first, begins, values, weights)
    np.testing.assert_allclose(full(band), rows.T @ np.diag(weights) @ rows, atol=1e-12)
