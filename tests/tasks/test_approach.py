"""Terms before contact: the plane of a face has one open side, a thing has two."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.state import State
from wholebody.tasks.contact_parts import approached, has_face

BOARD, IN_FRONT = 0.30, 0.01  # m


@pytest.fixture(scope="module")
def problem() -> wb.Problem:
    scene = wb.Scene(wb.load("human")).add(wb.Box((1.0, 1.0, 0.02)), name="board", at=(0.0, 0.0, BOARD - 0.01))
    return wb.Problem(scene, "standing", goals=[wb.Touch("left_hand", "board")], constraints=[wb.Stand("board")])


def test_a_sole_under_a_board_is_as_far_from_its_plane_as_it_is_below(problem: wb.Problem) -> None:
    standing = approached(problem.constraints[0], IN_FRONT)
    state = State(problem.scene.model).update(problem.start)  # the soles are on z = 0, under the board
    values = standing.value(state)
    np.testing.assert_allclose(values[[0, 6]], -(BOARD + IN_FRONT), atol=1e-6)
    q = problem.start.copy()
    q[2] += BOARD + IN_FRONT
    np.testing.assert_allclose(standing.value(state.update(q))[[0, 6]], 0.0, atol=1e-6)


def test_its_derivative_leads_to_the_open_side(problem: wb.Problem) -> None:
    standing = approached(problem.constraints[0], IN_FRONT)
    model, q, step = problem.scene.model, problem.start, 1e-6
    rows = standing.jacobian(State(model).update(q))
    rng = np.random.default_rng(0)
    for way in rng.normal(size=(5, model.nv)):
        ahead, behind = (
            standing.value(State(model).update(pin.integrate(model, q, sign * step * way))) for sign in (1.0, -1.0)
        )
        difference = (ahead - behind) / (2.0 * step)
        np.testing.assert_allclose((rows @ way)[:10], difference[:10], atol=1e-4)  # the contacts; then the balance
    assert rows[0, 2] == pytest.approx(1.0)  # up, through the board


def test_what_may_touch_from_any_side_stays_as_it_is(problem: wb.Problem) -> None:
    assert not has_face(problem.goals[0])
    assert approached(problem.goals[0], IN_FRONT) is problem.goals[0]
