"""Placements: every way of writing one, and what is refused."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wholebody import InputError
from wholebody.geometry.placement import placement

number = st.floats(-100, 100)


@given(st.tuples(number, number, number), st.integers(0, 2**32 - 1))
def test_all_ways_of_writing_agree(position: tuple[float, float, float], seed: int) -> None:
    turn = Rotation.random(random_state=seed)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn.as_matrix(), position
    for at in ((*position, *turn.as_quat()), matrix, matrix.tolist(), pin.SE3(matrix)):
        assert np.allclose(placement(at).homogeneous, matrix, atol=1e-12)
    assert np.array_equal(placement(position).homogeneous[:3, 3], position)


def test_typed_digits_are_made_orthonormal() -> None:
    for at in ((0, 0, 0, 0, 0, 0.7071, 0.7071), [[0, -1.0001, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]):
        rotation = placement(at).rotation
        assert np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-15
        assert np.allclose(rotation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)


def test_the_answer_is_a_copy() -> None:
    given_placement = pin.SE3.Random()
    kept = given_placement.copy()
    placement(given_placement).translation = np.zeros(3)
    assert given_placement == kept


@pytest.mark.parametrize(
    ("at", "reason"),
    [
        ((0.0, 0.0, np.nan), "finite"),
        ((0.0, 0.0, np.inf), "finite"),
        ((0, 0, 0, np.nan, 0, 0, 1), "finite"),
        ((0, 0, 0, 0, 0, 0, 0), "length 0"),
        ((0, 0, 0, 0, 0, 1, 1), "length 1.41"),
        ((0, 0), "shape"),
        ("origin", "numbers"),
        (None, "shape|numbers|finite"),
        (np.diag([2.0, 2.0, 2.0, 1.0]), "orthonormal"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "reflection"),
        (np.ones((4, 4)), "last row"),
        (np.full((4, 4), np.nan), "finite"),
        (pin.SE3(np.eye(3) * 1.1, np.zeros(3)), "orthonormal"),
        (pin.SE3(np.eye(3), np.array([0.0, np.nan, 0.0])), "finite"),
    ],
)
def test_what_coal_would_take_silently_is_refused(at: object, reason: str) -> None:
    with pytest.raises(InputError, match=f"chair.*({reason})"):
        placement(at, "chair")
