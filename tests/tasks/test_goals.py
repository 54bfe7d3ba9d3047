"""What goals and holds measure, and that following their Jacobians reaches them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wholebody import tasks
from wholebody.figures.description import Place
from wholebody.figures.state import State, Wrench

TIP = "tip"


def rows(term: Any, state: State) -> Any:
    jacobian = term.jacobian(state)
    return state.wrench_jacobian(jacobian) if isinstance(jacobian, Wrench) else jacobian


def follow(terms: list[Any], state: State, q: Any, steps: int = 200, reach: float = 0.3) -> Any:
    """Damped Gauss-Newton with bounded steps."""
    for _ in range(steps):
        state.update(q)
        residual = np.concatenate([t.error(state) if isinstance(t, tasks.Goal) else t.value(state) for t in terms])
        if np.abs(residual).max() < 1e-10:
            break
        jacobian = np.vstack([rows(t, state) for t in terms])
        step = -jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-9 * np.eye(len(jacobian)), residual)
        step *= min(1.0, reach / np.abs(step).max())
        q = pin.integrate(state.model, q, step)
    return q


def test_errors_are_metres_and_radians_of_the_world(humanoid: Any, random_posture: Any) -> None:
    rng = np.random.default_rng(0)
    q = random_posture(humanoid.model, rng)
    state = State(humanoid.model).update(q)
    data = humanoid.model.createData()
    pin.framesForwardKinematics(humanoid.model, data, q)
    place = data.oMf[humanoid.model.getFrameId(TIP)]
    target = pin.SE3.Random()
    offset = np.array([0.1, 0.2, 0.3])
    point = tasks.Point(TIP, (1.0, 2.0, 3.0), offset=offset).resolve(humanoid, q)
    np.testing.assert_allclose(point.error(state), place.rotation @ offset + place.translation - (1.0, 2.0, 3.0))
    error = tasks.Frame(TIP, target).resolve(humanoid, q).error(state)
    np.testing.assert_allclose(error[:3], place.translation - target.translation)
    np.testing.assert_allclose(pin.exp3(error[3:]) @ target.rotation, place.rotation, atol=1e-12)
    center = tasks.CenterOfMass((1.0, 2.0, 3.0), axes="xy").error(state)
    np.testing.assert_allclose(center, pin.centerOfMass(humanoid.model, data, q)[:2] - (1.0, 2.0))


def test_angular_says_which_rows_are_radians(humanoid: Any) -> None:
    q = humanoid.figure.neutral
    expected = {
        tasks.Point(TIP, (0, 0, 0)): "...",
        tasks.Frame(TIP, (0, 0, 0)): "...rrr",
        tasks.Orientation(TIP, np.eye(3)): "rrr",
        tasks.Axis(TIP, (1, 0, 0), direction=(0, 0, 1)): "rr",
        tasks.CenterOfMass((0, 0, 0)): "...",
        tasks.Relative(TIP, "rarm_wrist1_joint"): "...rrr",
        tasks.Relative(TIP, "rarm_wrist1_joint", orientation=False): "...",
        tasks.Posture("standing"): "..." + "r" * 31,
        tasks.Posture("standing", joints=["left_arm"]): "r" * 6,
        tasks.Hold(TIP): "...rrr",
        tasks.Plane(TIP, (0, 0, 1)): ".",
        tasks.Balance(("lfoot", "rfoot")): "....",
    }
    state = State(humanoid.model).update(q)
    for term, letters in expected.items():
        resolved = term.resolve(humanoid, q)
        value = resolved.error(state) if isinstance(resolved, tasks.Goal) else resolved.value(state)
        assert value.shape == (len(letters),)
        angular = np.broadcast_to(resolved.angular, value.shape)
        assert "".join("r" if angle else "." for angle in angular) == letters


@pytest.mark.parametrize("angle", [np.pi - 1e-3, np.pi - 1e-6, np.pi - 1e-9, np.pi, np.pi + 1e-9])
def test_half_a_turn_is_a_number_and_a_way_out(angle: float, humanoid: Any, random_posture: Any) -> None:
    rng = np.random.default_rng(5)
    state = State(humanoid.model)
    for _ in range(10):
        q = random_posture(humanoid.model, rng)
        turn = state.update(q).frame(humanoid.model.getFrameId(TIP)).rotation.copy()
        about = rng.normal(size=3)
        away = pin.AngleAxis(angle, about / np.linalg.norm(about)).matrix() @ turn
        goal = tasks.Orientation(TIP, away).resolve(humanoid, q)
        error, jacobian = goal.error(state.update(q)), rows(goal, state)
        assert np.isfinite(jacobian).all()
        np.testing.assert_allclose(np.linalg.norm(error), np.pi, atol=2e-3)
        assert np.linalg.norm(jacobian.T @ error) > 0.1
        q = follow([goal], state, q)
        assert np.linalg.norm(goal.error(state.update(q))) < 1e-8


@pytest.mark.parametrize("angle", [0.0, 1e-13, 1e-9, 1.0, 3.0, np.pi - 1e-5, np.pi - 1e-13, np.pi])
@pytest.mark.parametrize("toward", [False, True])
def test_axis_error_is_the_angle_and_never_a_trap(
    angle: float, toward: bool, humanoid: Any, random_posture: Any
) -> None:
    rng = np.random.default_rng(11)
    state = State(humanoid.model)
    for _ in range(5):
        q = random_posture(humanoid.model, rng)
        frame = state.update(q).frame(humanoid.model.getFrameId(TIP))
        axis, across = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
        wanted = frame.rotation @ (np.cos(angle) * axis + np.sin(angle) * across)
        asked = {"toward": frame.translation + 2.0 * wanted} if toward else {"direction": 3.0 * wanted}
        goal = tasks.Axis(TIP, axis, **asked).resolve(humanoid, q)
        error, jacobian = goal.error(state.update(q)), rows(goal, state)
        assert np.isfinite(jacobian).all()
        np.testing.assert_allclose(np.linalg.norm(error), angle, atol=1e-9)
        if angle > 0.5:
            # Along the error one radian of turning is one radian of error, however far away.
            turn = goal.jacobian(state).rows[:, 3:] - goal.jacobian(state).rows[:, :3] @ pin.skew(-frame.translation)
            np.testing.assert_allclose(np.linalg.norm(turn.T @ error), angle, rtol=1e-6)
        q = follow([goal], state, q)
        assert np.linalg.norm(goal.error(state.update(q))) < 1e-8


def test_axis_toward_the_frame_itself_is_met(humanoid: Any) -> None:
    q = humanoid.figure.neutral
    state = State(humanoid.model).update(q)
    here = state.frame(humanoid.model.getFrameId(TIP)).translation
    goal = tasks.Axis(TIP, (1.0, 0.0, 0.0), toward=here).resolve(humanoid, q)
    np.testing.assert_array_equal(goal.error(state), 0.0)
    np.testing.assert_array_equal(rows(goal, state), 0.0)


@given(seed=st.integers(0, 2**32 - 1), opposite=st.booleans())
def test_axis_gradient_is_that_of_the_squared_angle_up_to_the_opposite(seed: int, opposite: bool) -> None:
    rng = np.random.default_rng(seed)
    model = pin.Model()
    model.addJointFrame(model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball"), 0)
    scene: Any = type("Scene", (), {"model": model, "figure": _Ball(model)})()
    axis, direction = rng.normal(size=(2, 3))
    axis, direction = axis / np.linalg.norm(axis), direction / np.linalg.norm(direction)
    if opposite:
        direction = -axis + 1e-3 * direction
        direction /= np.linalg.norm(direction)
    goal = tasks.Axis("ball", axis, direction=direction).resolve(scene, pin.neutral(model))
    state = State(model)
    gradient = rows(goal, state).T @ goal.error(state)
    # Half the squared angle falls fastest by turning about the common normal, at a rate equal to the angle.
    normal = np.cross(axis, direction)
    angle = np.arctan2(np.linalg.norm(normal), axis @ direction)
    np.testing.assert_allclose(gradient, -angle * normal / np.linalg.norm(normal), atol=1e-8)


class _Ball:
    def __init__(self, model: Any) -> None:
        self.model = model

    def place_of(self, name: str) -> Place:
        index = int(self.model.getFrameId(name))
        return Place(index, int(self.model.frames[index].parentJoint), self.model.frames[index].placement.copy())


def test_following_the_rows_closes_a_loop_and_reaches_with_both_hands(humanoid: Any, random_posture: Any) -> None:
    rng = np.random.default_rng(2)
    state = State(humanoid.model)
    start = random_posture(humanoid.model, rng, 0.2)
    other = "rarm_effector_body"
    before = (
        state.update(start).frame(humanoid.model.getFrameId(TIP)).actInv(state.frame(humanoid.model.getFrameId(other)))
    )
    where = state.frame(humanoid.model.getFrameId(TIP)).translation + np.array([0.05, 0.02, 0.08])
    terms = [
        tasks.Hold(other, relative_to=TIP).resolve(humanoid, start),
        tasks.Point(TIP, where).resolve(humanoid, start),
        tasks.Hold("lfoot").resolve(humanoid, start),
        tasks.Hold("rfoot", orientation=False).resolve(humanoid, start),
    ]
    q = follow(terms, state, start)
    state.update(q)
    after = state.frame(humanoid.model.getFrameId(TIP)).actInv(state.frame(humanoid.model.getFrameId(other)))
    np.testing.assert_allclose(after.homogeneous, before.homogeneous, atol=1e-8)
    np.testing.assert_allclose(state.frame(humanoid.model.getFrameId(TIP)).translation, where, atol=1e-8)


def test_posture_goal_brings_back_only_the_joints_named(humanoid: Any, random_posture: Any) -> None:
    rng = np.random.default_rng(4)
    state = State(humanoid.model)
    q = random_posture(humanoid.model, rng)
    arm = humanoid.figure.dofs(["left_arm"])
    goal = tasks.Posture("standing", joints=["left_arm"]).resolve(humanoid, q)
    moved = follow([goal], state, q)
    difference = pin.difference(humanoid.model, q, moved)
    np.testing.assert_allclose(np.delete(difference, arm), 0.0, atol=1e-12)
    np.testing.assert_allclose(pin.difference(humanoid.model, humanoid.figure.neutral, moved)[arm], 0.0, atol=1e-9)
    everything = tasks.Posture(humanoid.figure.neutral).resolve(humanoid, q)
    back = follow([everything], state, q)
    np.testing.assert_allclose(pin.difference(humanoid.model, humanoid.figure.neutral, back), 0.0, atol=1e-8)


def test_plane_measures_the_distance_along_its_normal(humanoid: Any) -> None:
    q = humanoid.figure.neutral
    state = State(humanoid.model).update(q)
    here = state.frame(humanoid.model.getFrameId("larm_elbow_joint")).translation.copy()
    through = tasks.Plane("larm_elbow_joint", (0.0, 0.0, 5.0)).resolve(humanoid, q)
    np.testing.assert_allclose(through.value(state), [0.0], atol=1e-15)
    np.testing.assert_array_equal([through.lower, through.upper], [0.0, 0.0])
    above = tasks.Plane("larm_elbow_joint", (0, 3, 4), point=here - (0.0, 0.6, 0.8), side="above").resolve(humanoid, q)
    np.testing.assert_allclose(above.value(state), [1.0])
    np.testing.assert_array_equal([above.lower, above.upper], [0.0, np.inf])


def test_terms_do_not_change_when_resolved(humanoid: Any, random_posture: Any) -> None:
    rng = np.random.default_rng(1)
    hold = tasks.Hold(TIP)
    first = hold.resolve(humanoid, random_posture(humanoid.model, rng))
    second_start = random_posture(humanoid.model, rng)
    second = hold.resolve(humanoid, second_start)
    state = State(humanoid.model).update(second_start)
    np.testing.assert_allclose(second.value(state), 0.0, atol=1e-12)
    assert np.abs(first.value(state)).max() > 0.1
    target = np.array([0.1, 0.2, 0.3])
    point = tasks.Point(TIP, target).resolve(humanoid, second_start)
    before = point.error(state)
    target[:] = 9.0
    np.testing.assert_array_equal(point.error(state), before)
    with pytest.raises(AttributeError):
        point.frame = "other"  # type: ignore[misc]
