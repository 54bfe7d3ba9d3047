"""Every Jacobian and gradient against central differences along pin.integrate."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from wholebody import tasks
from wholebody.figures import load
from wholebody.figures.description import JointCone
from wholebody.figures.state import State, Wrench
from wholebody.scene.scene import Scene

STEP = 1e-6
TERMS = {
    "point": tasks.Point("tip", (0.3, -0.2, 0.9)),
    "point_offset": tasks.Point("tip", (0.3, -0.2, 0.9), offset=(0.1, 0.02, -0.3)),
    "point_of_joint": tasks.Point("rarm_elbow_joint", (0.3, -0.2, 0.9)),
    "frame": tasks.Frame("tip", (0.1, 0.2, 0.3, 0.5, -0.5, 0.5, 0.5)),
    "orientation": tasks.Orientation("tip", (0.0, 0.0, 0.0, 1.0)),
    "axis_direction": tasks.Axis("tip", (1.0, 2.0, -0.5), direction=(0.0, 0.3, 1.0)),
    "axis_toward": tasks.Axis("tip", (0.0, 0.0, 2.0), toward=(0.8, 0.3, 1.0)),
    "center_of_mass": tasks.CenterOfMass((0.1, 0.0, 0.4)),
    "center_of_mass_xy": tasks.CenterOfMass((0.1, 0.0, 0.4), axes="xy"),
    "relative": tasks.Relative("tip", "rarm_wrist1_joint"),
    "relative_placement": tasks.Relative("tip", "rarm_wrist1_joint", (0.1, 0.2, 0.3, 0.5, -0.5, 0.5, 0.5)),
    "relative_place": tasks.Relative("tip", "rarm_wrist1_joint", (0.1, 0.2, 0.3), orientation=False),
    "posture": tasks.Posture("standing"),
    "posture_of_an_arm": tasks.Posture("standing", joints=("left_arm",)),
    "hold": tasks.Hold("tip"),
    "hold_place": tasks.Hold("tip", (0.0, 0.3, 0.5), orientation=False),
    "hold_relative": tasks.Hold("tip", relative_to="rarm_wrist1_joint"),
    "plane": tasks.Plane("larm_elbow_joint", (0.3, -2.0, 0.4)),
    "plane_side": tasks.Plane("tip", (0.0, 0.0, 1.0), point=(0.0, 0.0, 0.2), side="above"),
    "balance": tasks.Balance(("lfoot", "rfoot")),
    "reach_cones": tasks.ReachCones(),
    "effort": tasks.Effort(),
    "displacement": tasks.Displacement(2.0),
    "discomfort": tasks.Discomfort(0.1),
    "potential_energy": tasks.PotentialEnergy(0.01),
    "soft": tasks.Soft(tasks.Frame("tip", (0.1, 0.2, 0.3, 0.5, -0.5, 0.5, 0.5), weight=2.0), 0.5),
}
MEASURES = [name for name, term in TERMS.items() if isinstance(term, tasks.Measure)]


def value_of(term: Any, state: State) -> Any:
    return term.error(state) if isinstance(term, tasks.Goal) else term.value(state)


def derivative_of(term: Any, state: State) -> Any:
    if isinstance(term, tasks.Measure):
        return term.gradient(state)
    jacobian = term.jacobian(state)
    return state.wrench_jacobian(jacobian) if isinstance(jacobian, Wrench) else jacobian


def differences(term: Any, state: State, q: Any, value: Any = value_of) -> Any:
    columns = []
    for step in STEP * np.eye(state.model.nv):
        ahead = np.array(value(term, state.update(pin.integrate(state.model, q, step))))
        behind = np.array(value(term, state.update(pin.integrate(state.model, q, -step))))
        columns.append((ahead - behind) / (2.0 * STEP))
    return np.array(columns).T


class RoundCone:
    """A circular reach cone: the angle to its edge is known in closed form."""

    def __init__(self, axis: Any, half_angle: float) -> None:
        self.axis, self.half_angle = np.array(axis) / np.linalg.norm(axis), half_angle

    def signed_angle(self, d: Any) -> tuple[float, Any]:
        cosine = float(d @ self.axis)
        tangent = self.axis - cosine * d
        return self.half_angle - np.arccos(cosine), tangent / np.linalg.norm(tangent)


@pytest.fixture
def scene(humanoid: Any) -> Any:
    cone = RoundCone((0.2, 0.9, -0.3), 1.0)
    humanoid.figure.cones = {
        "left": JointCone(cone=cone, reference="chest2_body", limb="larm_upperarm_body", axis=np.array([0, 0, -1.0])),
        "right": JointCone(cone=cone, reference="chest2_body", limb="rarm_upperarm_body", axis=np.array([0, 1.0, 1])),
    }
    return humanoid


@pytest.mark.parametrize("name", TERMS)
def test_derivative_equals_central_differences(name: str, scene: Any, random_posture: Any) -> None:
    state = State(scene.model)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        start, q = random_posture(scene.model, rng, 0.3), random_posture(scene.model, rng)
        # Feet that are turned about stand on a corner each, which is no polygon.
        term = TERMS[name].resolve(scene, scene.figure.neutral if name == "balance" else start)
        exact = derivative_of(term, state.update(q))
        expected = differences(term, state, q)
        assert exact.shape == expected.shape
        np.testing.assert_allclose(exact, expected, atol=2e-7 * max(1.0, np.abs(expected).max()))


HUMAN_TERMS = {
    "point": tasks.Point("right_index_tip", (0.55, -0.25, 0.95), offset=(0.0, 0.0, 0.02)),
    "frame": tasks.Frame("left_palm", (0.4, 0.2, 1.0, 0.5, 0.5, -0.5, 0.5)),
    "gaze": tasks.Axis("gaze", (1.0, 0.0, 0.0), toward=(1.0, 0.3, 0.8)),
    "center_of_mass": tasks.CenterOfMass((0.0, 0.0, 1.0)),
    "hold_relative": tasks.Hold("left_palm", relative_to="right_palm"),
    "plane": tasks.Plane("left_elbow", (1.0, 1.0, 0.0)),
    "balance": tasks.Balance(),
    "reach_cones": tasks.ReachCones(),
    "range_of_motion": tasks.RangeOfMotion(),
    "posture": tasks.Posture("sitting"),
    "effort": tasks.Effort(),
    "rotation_effort": tasks.RotationEffort(),
    "displacement": tasks.Displacement(),
    "discomfort": tasks.Discomfort(),
    "rhythm": tasks.Rhythm(),
    "potential_energy": tasks.PotentialEnergy(0.01),
}


@pytest.fixture(scope="module")
def human() -> Any:
    return Scene(load("human"))


@pytest.mark.parametrize("name", HUMAN_TERMS)
def test_derivative_equals_central_differences_on_the_human(name: str, human: Any) -> None:
    state = State(human.model)
    start = human.figure.posture("standing")
    low, high = human.figure.tangent_bounds(start)
    for seed in range(2):
        rng = np.random.default_rng(seed)
        reach = rng.uniform(np.maximum(low, -1.5), np.minimum(high, 1.5))
        q = pin.integrate(human.model, start, reach)
        term = HUMAN_TERMS[name].resolve(human, start)
        exact = derivative_of(term, state.update(q))
        expected = differences(term, state, q)
        np.testing.assert_allclose(exact, expected, atol=2e-7 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("angle", [0.0, 1e-7, 1e-3, 1.0, 3.0, 3.1])
@pytest.mark.parametrize("kind", ["frame", "axis"])
def test_rotation_rows_are_exact_at_small_and_large_angles(
    kind: str, angle: float, scene: Any, random_posture: Any
) -> None:
    rng = np.random.default_rng(7)
    state = State(scene.model)
    for _ in range(4):
        q = random_posture(scene.model, rng)
        turn = state.update(q).frame(scene.model.getFrameId("tip")).rotation.copy()
        about = rng.normal(size=3)
        about /= np.linalg.norm(about)
        if kind == "frame":
            term: Any = tasks.Orientation("tip", pin.AngleAxis(angle, about).matrix() @ turn).resolve(scene, q)
        else:
            axis = np.cross(about, rng.normal(size=3))
            axis /= np.linalg.norm(axis)
            wanted = turn @ (pin.AngleAxis(angle, about).matrix() @ axis)
            term = tasks.Axis("tip", axis, direction=wanted).resolve(scene, q)
        exact = derivative_of(term, state.update(q))
        np.testing.assert_allclose(np.linalg.norm(term.error(state)), angle, atol=1e-9)
        expected = differences(term, state, q)
        np.testing.assert_allclose(exact, expected, atol=1e-7 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("name", [name for name in MEASURES if name != "soft"])  # its curvature is a bound
def test_curvature_is_the_second_derivative_at_rest(name: str, scene: Any) -> None:
    state = State(scene.model)
    q = scene.figure.neutral
    term = TERMS[name].resolve(scene, q)
    curvature = term.curvature(state.update(q))
    second = np.diag(differences(term, state, q, lambda term, state: term.gradient(state)))
    assert (curvature > 0.0).all()
    np.testing.assert_allclose(curvature, second, rtol=1e-5, atol=2e-6)


@pytest.mark.parametrize("name", ["effort", "displacement", "discomfort"])
def test_curvature_is_no_less_than_the_second_derivative(name: str, scene: Any, random_posture: Any) -> None:
    rng = np.random.default_rng(3)
    state = State(scene.model)
    for _ in range(5):
        q = random_posture(scene.model, rng)
        term = TERMS[name].resolve(scene, scene.figure.neutral)
        curvature = term.curvature(state.update(q))
        second = np.diag(differences(term, state, q, lambda term, state: term.gradient(state)))
        assert (curvature >= second - 1e-5 * np.abs(second).max()).all()
        convex = second > 1e-4
        np.testing.assert_allclose(curvature[convex], second[convex], rtol=1e-4, atol=2e-6)
