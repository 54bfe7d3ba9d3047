"""Accommodation: who reaches a shelf follows from the statures."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.special import ndtr

import wholebody as wb


def upright(figure: wb.Figure, target: Any, layout: Any) -> wb.Problem:
    """Somebody who stands still under a beam, and is to bring the top of the head to 1.70 m."""
    scene = wb.Scene(figure)
    goals = [wb.Point("head_top", (*figure.placement(figure.posture("standing"), "head_top").translation[:2], 1.70))]
    return wb.Problem(scene, goals=goals, constraints=[wb.Freeze("root", *figure.joints)])


def test_statures_stand_for_equal_shares() -> None:
    found = wb.people(4, ["male"])
    statures = np.array([one["stature"] for one in found.values()])
    np.testing.assert_allclose(ndtr((statures - 1.7562) / 0.0686), [0.125, 0.375, 0.625, 0.875], atol=1e-6)


def test_only_those_of_the_right_height_are_counted() -> None:
    found = wb.accommodation(upright, count=2, sees=(2.0, 0.0, 1.2))
    assert found.share == 0.0
    assert all(found.fits)
    assert found.sees is not None
    left = [one.goal_error for one in found.records]
    statures = [one["stature"] for one in wb.people(2).values()]
    np.testing.assert_allclose(left, np.abs(np.array(statures) - 1.70), atol=0.02)


def test_odd_populations_are_refused() -> None:
    with pytest.raises(wb.InputError, match="count"):
        wb.people(0)
    with pytest.raises(wb.InputError, match="sex"):
        wb.people(3, ["tall"])
