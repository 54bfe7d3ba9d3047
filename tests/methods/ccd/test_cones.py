"""Cones on floats against the figure's own, and limbs that stay in them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import wholebody as wb
from wholebody.methods.ccd.guards import Kept, Polygon


@pytest.mark.parametrize("name", ["right_shoulder", "left_hip"])
def test_a_polygon_is_the_figures_cone(name: str, human: wb.Figure) -> None:
    cone = human.cones[name].cone
    polygon = Polygon(cone)
    rows = np.random.default_rng(4).normal(size=(3000, 3))
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    angles = np.array([cone.signed_angle(row)[0] for row in rows])
    assert [polygon.contains(tuple(row)) for row in rows.tolist()] == (angles >= 0.0).tolist()
    nearest = np.array([polygon.nearest(tuple(row)) for row in rows[angles < 0.0].tolist()])
    turned = np.linalg.norm(np.cross(rows[angles < 0.0], nearest), axis=1)
    assert np.arctan2(turned, (rows[angles < 0.0] * nearest).sum(axis=1)) == pytest.approx(
        -angles[angles < 0.0], abs=2e-6
    )
    assert all(cone.contains(each) for each in nearest)


@pytest.mark.parametrize("chain", ["right_arm", "left_leg"])
def test_a_limb_that_left_its_cone_is_brought_back(
    chain: str, human: wb.Figure, outside: Callable[..., float], brought_back: Callable[..., int]
) -> None:
    rng = np.random.default_rng(7)
    assert brought_back(human.chains[chain].joints, Kept(), lambda q: outside(human, q), 150, rng) > 5
