"""Looking: the share of eyes and head against angles that are known, and derivatives."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.ergonomics.vision import COMFORTABLE

FEET = [wb.Hold("left_foot"), wb.Hold("right_foot")]


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return wb.Scene(wb.load("human"))


def pitch(scene: wb.Scene, q: np.ndarray) -> float:
    """Of the head, downwards, degrees."""
    return float(np.degrees(-np.arcsin(scene.figure.placement(q, "gaze").rotation[2, 0])))


@pytest.mark.parametrize("at", [(1.0, 0.0, 0.0), (0.4, 0.3, 0.9), (-0.5, 0.4, 1.5)])
def test_the_eyes_turn_as_far_as_is_easy_and_the_head_by_the_rest(
    scene: wb.Scene, at: tuple[float, float, float]
) -> None:
    solution = wb.solve(wb.Problem(scene, constraints=[wb.ergonomics.Look(at), *FEET]))
    assert solution.solved
    local = scene.figure.placement(solution.q, "gaze").actInv(np.array(at))
    # the field's border: 15 degrees about a line 15 degrees below ahead
    line = pin.utils.rotate("y", np.radians(15.0))[:, 0]
    assert np.degrees(np.arccos(line @ local / np.linalg.norm(local))) == pytest.approx(15.0, abs=0.6)


def test_the_floor_a_metre_ahead_is_looked_at_with_eyes_down_by_thirty_degrees(scene: wb.Scene) -> None:
    at = np.array((1.0, 0.0, 0.0))
    q = wb.solve(wb.Problem(scene, constraints=[wb.ergonomics.Look(at), *FEET])).q
    way = at - scene.figure.placement(q, "gaze").translation
    below = np.degrees(np.arctan2(-way[2], way[0]))
    assert below - pitch(scene, q) == pytest.approx(30.0, abs=0.1)


@pytest.mark.parametrize("at", [(-2.0, 1.0, 1.0), (0.5, 0.0, 3.0)])
def test_what_the_head_turned_to_is_seen(scene: wb.Scene, at: tuple[float, float, float]) -> None:
    for view in (wb.ergonomics.FieldOfView(), COMFORTABLE):
        solution = wb.solve(wb.Problem(scene, constraints=[wb.ergonomics.Look(at, view=view), *FEET]))
        found = wb.ergonomics.sight(scene, solution.q, np.array(at))
        assert solution.solved
        assert found.seen
    assert found.comfortable


def test_who_sees_a_point_keeps_the_head(scene: wb.Scene) -> None:
    usual = wb.solve(wb.Problem(scene, constraints=FEET)).q
    at = scene.figure.placement(usual, "gaze").act(np.array((2.0, 0.1, -0.5)))
    solution = wb.solve(wb.Problem(scene, constraints=[wb.ergonomics.Look(at), *FEET]))
    np.testing.assert_allclose(solution.q, usual, atol=1e-6)


def test_the_derivative_is_that_of_finite_differences(scene: wb.Scene) -> None:
    rng, model = np.random.default_rng(3), scene.model
    for _ in range(6):
        q = pin.integrate(model, scene.figure.posture("standing"), 0.2 * rng.normal(size=model.nv))
        look = wb.ergonomics.Look(2.0 * rng.normal(size=3)).resolve(scene, q)
        state = scene.state(q)
        row = state.dense_jacobian(look.jacobian(state))[0]
        step = rng.normal(size=model.nv)
        ends = [look.value(scene.state(pin.integrate(model, q, sign * 1e-6 * step)))[0] for sign in (1.0, -1.0)]
        assert row @ step == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-5, abs=1e-7)


def test_another_frame_or_no_field_is_refused(scene: wb.Scene) -> None:
    with pytest.raises(wb.UnknownNameError, match="gazes"):
        wb.Problem(scene, constraints=[wb.ergonomics.Look((1, 0, 1), eyes="gazes")])
    with pytest.raises(wb.InputError, match="FieldOfView"):
        wb.ergonomics.Look((1, 0, 1), view=0.3)  # type: ignore[arg-type]
