"""The arms stretched sideways, where flexion and rotation of the shoulder turn about one axis: limits and measures.

At 90 degrees of abduction, flexion and rotation by the same angle leave the arm as it was. What depends on the arm's
rotation must not notice.
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.state import State


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return wb.Scene(wb.load("human"))


def arms(scene: wb.Scene, flexion: float, abduction: float, rotation: float) -> np.ndarray:
    """The T-pose with both shoulders at these degrees, and without the clavicles' share."""
    angles = {"flexion": flexion, "abduction": abduction, "rotation": rotation}
    values = {f"{side}_shoulder_{name}": math.radians(v) for side in ("left", "right") for name, v in angles.items()}
    return scene.figure.with_joints(scene.figure.posture("t_pose"), values)


def terms(scene: wb.Scene) -> dict[str, object]:
    start = scene.figure.posture("t_pose")
    made = (
        wb.tasks.RangeOfMotion(),
        wb.tasks.ReachCones(),
        wb.tasks.Rhythm(),
        wb.Effort(),
        wb.tasks.RotationEffort(),
        wb.tasks.Discomfort(),
    )
    return {type(term).__name__: term.resolve(scene, start) for term in made}


def both(term: object, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Value (m,) and derivative (m, nv)."""
    slope = term.jacobian(state) if hasattr(term, "jacobian") else term.gradient(state)[None]
    return np.atleast_1d(term.value(state)).copy(), np.array(slope)


@pytest.mark.parametrize("name", ["RangeOfMotion", "ReachCones", "Rhythm", "Effort", "RotationEffort", "Discomfort"])
@pytest.mark.parametrize("flexion", [0.0, 30.0])
def test_values_and_gradients_are_finite_and_continuous_there(scene: wb.Scene, name: str, flexion: float) -> None:
    term, state = terms(scene)[name], State(scene.figure.model)
    value, slope = both(term, state.update(arms(scene, flexion, 90.0, 0.0)))
    assert np.isfinite(value).all()
    assert np.isfinite(slope).all()
    for abduction in (89.9999, 90.0001):
        other, steep = both(term, state.update(arms(scene, flexion, abduction, 0.0)))
        assert np.abs(other - value).max() < 1e-4
        assert np.abs(steep - slope).max() < 1e-3
    q, size = arms(scene, flexion, 90.0, 0.0), 1e-6
    for place, step in enumerate(size * np.eye(scene.figure.model.nv)):
        ends = [both(term, state.update(pin.integrate(scene.figure.model, q, way * step)))[0] for way in (1.0, -1.0)]
        assert (ends[0] - ends[1]) / (2.0 * size) == pytest.approx(slope[:, place], abs=1e-4)


@pytest.mark.parametrize("name", ["RangeOfMotion", "ReachCones", "Rhythm", "RotationEffort"])
@pytest.mark.parametrize("turn", [-40.0, 15.0, 60.0])
def test_one_rotation_of_the_arm_has_one_value(scene: wb.Scene, name: str, turn: float) -> None:
    """Two triples of angles for one rotation: limits and rhythm see the same arm."""
    state, figure = State(scene.figure.model), scene.figure
    one, other = arms(scene, 0.0, 90.0, 0.0), arms(scene, turn, 90.0, turn)
    for side in ("left", "right"):
        places = [figure.placement(q, f"{side}_upper_arm").rotation for q in (one, other)]
        assert np.abs(places[0] - places[1]).max() < 1e-9
    term = terms(scene)[name]
    assert both(term, state.update(other))[0] == pytest.approx(both(term, state.update(one))[0], abs=1e-9)


@pytest.mark.parametrize("forward", [5.0, 30.0, 60.0])
def test_arms_leave_the_t_pose_forwards(scene: wb.Scene, forward: float) -> None:
    """No angle of the shoulder leads there to first order; the solve finds the way nevertheless."""
    angle = math.radians(forward)
    goal = wb.Axis("left_upper_arm", (0, 0, -1), direction=(math.sin(angle), math.cos(angle), 0.0))
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    assert wb.solve(wb.Problem(scene, start="t_pose", goals=[goal], constraints=feet)).status == "solved"
