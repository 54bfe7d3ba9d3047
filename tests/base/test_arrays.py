"""Vector products, against those of numpy."""

from __future__ import annotations

import numpy as np
import pytest

from wholebody.base.arrays import cross


@pytest.mark.parametrize(
    "shapes", [((3,), (3,)), ((5, 3), (3,)), ((3,), (5, 3)), ((4, 1, 3), (5, 3)), ((0, 3), (0, 3))]
)
def test_vector_products_are_those_of_numpy(shapes: tuple[tuple[int, ...], tuple[int, ...]]) -> None:
    rng = np.random.default_rng(0)
    a, b = (rng.normal(size=shape) for shape in shapes)
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))
