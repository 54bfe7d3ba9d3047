"""Riders: who sits far below the saddle at the start is tried on it, and others begin around it."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb


def rider(percentile: float, saddle: float, crank: float, bar: float, reach: float) -> wb.Problem:
    """A man on a saddle [m], both hands at a bar across, a foot on each pedal at an angle of the crank [rad]."""
    scene = wb.Scene(wb.load("human", sex="male", percentile=percentile)).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.26, 0.16, 0.06)), name="saddle", at=(-0.2, 0.0, saddle))
    half = float(np.sqrt(0.5))
    scene.add(wb.Capsule(0.016, 0.56), name="bar", at=(reach - 0.2, 0.0, bar, half, 0.0, 0.0, half))
    for side, y, angle in (("left", 0.12, crank), ("right", -0.12, crank + np.pi)):
        at = (0.17 * np.cos(angle), y, 0.30 + 0.17 * np.sin(angle))
        scene.add(wb.Box((0.10, 0.09, 0.02)), name=f"{side}_pedal", at=at)
    hands = [wb.Grasp(side, "bar", kind="power") for side in ("left", "right")]
    feet = [wb.Touch(f"{side}_foot", f"{side}_pedal") for side in ("left", "right")]
    gaze = wb.Axis("gaze", (1, 0, 0), direction=(1, 0, -0.2), weight=0.1)
    return wb.Problem(scene, "sitting", goals=[wb.Sit("saddle"), *hands, *feet, gaze])


@pytest.mark.parametrize(("given", "most"), [((50, 0.86, np.pi, 1.0, 0.6), 4.4), ((70, 0.88, 0.0, 1.05, 0.55), 4.6)])
def test_a_rider_has_the_measure_of_a_descent_from_the_saddle(given: tuple[float, ...], most: float) -> None:
    """Contacts from beside the saddle were met at 7.0 and 7.1."""
    solution = wb.solve(rider(*given))
    assert solution.status == "solved"
    assert solution.assessment.measure < most


@pytest.mark.parametrize("given", [(67, 0.95, 2.5, 1.05, 0.55), (70, 0.94, 2.5, 1.0, 0.6)])
def test_a_saddle_that_is_hard_to_sit_on_is_reached_from_around_it(given: tuple[float, ...]) -> None:
    """Probes from around the start, half a metre below, ended 0.3 and 6 mm short: unreachable, it was said."""
    assert wb.solve(rider(*given)).status == "solved"
