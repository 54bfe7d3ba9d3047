"""Somebody's own goal, constraint and measure, solved by qp and by newton and judged by formulas of this file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize

import wholebody as wb
from wholebody.bench.suite.stability.bodies import Builder
from wholebody.figures.state import Wrench
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.own_rows import constraint_rows, goal_rows

Array = np.ndarray[Any, np.dtype[np.float64]]


class Sum(wb.Goal):
    """The angles of an arm add up to a value."""

    angular = np.ones(1, dtype=bool)

    def __init__(self, value: float) -> None:
        self.wanted = value

    def error(self, state: Any) -> Array:
        return np.array([state.q.sum() - self.wanted])

    def jacobian(self, state: Any) -> Array:
        return np.ones((1, state.model.nv))


class Product(wb.Constraint):
    """The product of the first two angles within bounds."""

    def __init__(self, lower: float, upper: float) -> None:
        self._lower, self._upper = lower, upper

    @property
    def lower(self) -> Array:
        return np.array([self._lower])

    @property
    def upper(self) -> Array:
        return np.array([self._upper])

    def value(self, state: Any) -> Array:
        return np.array([state.q[0] * state.q[1]])

    def jacobian(self, state: Any) -> Array:
        row = np.zeros((1, state.model.nv))
        row[0, :2] = state.q[1], state.q[0]
        return row


class Bend(wb.Measure):
    """A sum of cosh of the angles, less by a half [no unit]: least where each is a half."""

    def value(self, state: Any) -> float:
        return float(np.cosh(state.q - 0.5).sum())

    def gradient(self, state: Any) -> Array:
        return np.sinh(state.q - 0.5)

    def curvature(self, state: Any) -> Array:
        return np.cosh(state.q - 0.5)


class Upright(wb.Constraint):
    """An axis of a segment within an angle of the vertical, by the cosine of its tilt."""

    def __init__(self, frame: str, cosine: float) -> None:
        self.frame, self.cosine = frame, cosine

    @property
    def lower(self) -> Array:
        return np.array([self.cosine])

    def value(self, state: Any) -> Array:
        index = state.model.getFrameId(self.frame)
        return np.array([state.frame(index).rotation[2, 2]])

    def jacobian(self, state: Any) -> Wrench:
        index = state.model.getFrameId(self.frame)
        x, y, _ = state.frame(index).rotation[:, 2]
        return Wrench(np.array([[0.0, 0.0, 0.0, y, -x, 0.0]]), int(state.model.frames[index].parentJoint))


METHODS = [wb.methods.QP(), wb.methods.Newton()]


@pytest.mark.parametrize("method", METHODS, ids=["qp", "newton"])
@pytest.mark.parametrize("bounds", [(0.3, 0.3), (0.3, np.inf), (-np.inf, -0.2)], ids=["equal", "least", "most"])
def test_own_terms_lead_to_the_minimum_that_scipy_finds(
    planar_arm: Callable[..., wb.Figure], method: Any, bounds: tuple[float, float]
) -> None:
    scene = wb.Scene(planar_arm((0.3, 0.3, 0.2)))
    start = np.array([0.4, 0.3 if bounds[0] > 0.0 else -0.3, 0.6])
    problem = wb.Problem(scene, start, goals=[Sum(1.2)], constraints=[Product(*bounds)], measures=[Bend()])
    solution = wb.solve(problem, method)
    assert solution.solved, solution.message
    assert "reported" not in solution.message
    rules: list[dict[str, Any]] = [{"type": "eq", "fun": lambda q: q.sum() - 1.2}]
    if bounds[0] == bounds[1]:
        rules.append({"type": "eq", "fun": lambda q: q[0] * q[1] - bounds[0]})
    else:
        if np.isfinite(bounds[0]):
            rules.append({"type": "ineq", "fun": lambda q: q[0] * q[1] - bounds[0]})
        if np.isfinite(bounds[1]):
            rules.append({"type": "ineq", "fun": lambda q: bounds[1] - q[0] * q[1]})
    least = min(
        (
            minimize(lambda q: np.cosh(q - 0.5).sum(), begin, constraints=rules, method="SLSQP", tol=1e-12)
            for begin in (solution.q, start)
        ),
        key=lambda found: np.linalg.norm(found.x - solution.q),
    )
    assert solution.q.sum() == pytest.approx(1.2, abs=2e-5)
    assert bounds[0] - 2e-5 <= solution.q[0] * solution.q[1] <= bounds[1] + 2e-5
    assert np.cosh(solution.q - 0.5).sum() == pytest.approx(least.fun, abs=1e-4)


@pytest.mark.parametrize("method", METHODS, ids=["qp", "newton"])
def test_an_own_constraint_on_a_person_with_a_free_root_holds(method: Any) -> None:
    """Reaching low without leaning: without the constraint the trunk leans farther."""
    human = wb.load("human", detail="capsules")
    scene = wb.Scene(human)
    tilts = []
    for own in ([], [Upright("thorax", np.cos(0.1))]):
        problem = wb.Problem(
            scene,
            "standing",
            goals=[wb.Point("right_index_tip", (0.5, -0.2, 0.7))],
            constraints=[wb.Hold("left_foot"), wb.Hold("right_foot"), *own],
        )
        solution = wb.solve(problem, method)
        assert solution.solved, solution.message
        data = human.model.createData()
        pin.framesForwardKinematics(human.model, data, solution.q)
        tilts.append(np.arccos(data.oMf[human.model.getFrameId("thorax")].rotation[2, 2]))
    assert tilts[0] > 0.12
    assert tilts[1] < 0.1 + 1e-3


def test_rows_in_bodies_are_the_derivatives_of_what_they_say() -> None:
    """Against differences, along the motions of the bodies that are motions of the person."""
    human = wb.load("human", detail="capsules")
    bodies = FigureBodies(human)
    start = human.posture("standing")
    rng = np.random.default_rng(3)
    q = pin.integrate(human.model, start, 0.2 * rng.normal(size=human.model.nv))
    limits = human.limits
    q[limits.idx_q] = limits.lower + rng.uniform(0.2, 0.8, len(limits.lower)) * (limits.upper - limits.lower)
    equal, one_sided = constraint_rows(bodies, Upright("thorax", 0.9), "upright")
    assert equal is None
    assert one_sided is not None

    def at(posture: Array) -> Array:
        return np.concatenate([bodies.variables(posture), (0, 0, 0, 0, 0, 0, 1.0)]).reshape(-1, 7)

    slope = one_sided.jacobian(at(q))[0, 0]
    for dq in rng.normal(size=(20, human.model.nv)):
        ahead, behind = (at(pin.integrate(human.model, q, sign * 1e-5 * dq)) for sign in (1.0, -1.0))
        turned = np.sign((ahead[:, 3:] * behind[:, 3:]).sum(axis=1))[:, None]
        behind[:, 3:] *= turned
        here = at(q)
        flipped = np.repeat(np.sign((ahead[:-1, 3:] * here[:-1, 3:]).sum(axis=1))[:, None], 7, axis=1)
        flipped[:, :3] = 1.0
        moved = ((ahead - behind)[:-1] * flipped).ravel()
        change = one_sided.residual(ahead)[0, 0] - one_sided.residual(behind)[0, 0]
        assert slope @ moved == pytest.approx(change, abs=1e-9)


@pytest.mark.parametrize("method", METHODS, ids=["qp", "newton"])
def test_own_terms_of_joints_that_slide_are_kept(free_bodies: Callable[..., wb.Figure], method: Any) -> None:
    scene = wb.Scene(free_bodies(wb.Sphere(0.1), wb.Sphere(0.1)))
    start = scene.figure.neutral.copy()
    tilted = pin.Quaternion(pin.exp3(np.array((0.9, 0.0, 0.0))))
    problem = wb.Problem(
        scene,
        start,
        goals=[wb.Frame("body1", pin.SE3(tilted.toRotationMatrix(), np.array((0.4, 0.3, 0.2))))],
        constraints=[Upright("body1", 0.8)],
        measures=[wb.tasks.Displacement()],
    )
    solution = wb.solve(problem, method)
    up = scene.state(solution.q).frame(scene.frame_id("body1")).rotation[2, 2]
    assert up == pytest.approx(0.8, abs=1e-4)  # the goal is at cos 0.9 = 0.62
    assert solution.assessment.constraint_violation < 1e-5


def test_a_goal_of_one_value_has_one_row(planar_arm: Callable[..., wb.Figure]) -> None:
    bodies = FigureBodies(wb.Scene(planar_arm((0.3, 0.2))).figure)
    assert goal_rows(bodies, Sum(0.0), "sum").size == 1


@pytest.mark.parametrize("method", METHODS, ids=["qp", "newton"])
def test_measures_of_joints_that_slide_are_minimised_too(method: Any) -> None:
    """Of two equal convex terms with a given sum, each has half of it."""
    builder = Builder("a slide and a hinge")
    slide = builder.joint("px", "slide")
    builder.rod(builder.joint("rz", "hinge", parent=slide, at=(0.3, 0.0, 0.0)), (0.3, 0.0, 0.0), 0.02)
    problem = wb.Problem(wb.Scene(builder.figure()), np.zeros(2), goals=[Sum(1.2)], measures=[Bend()])
    found = wb.solve(problem, method)
    assert found.solved, found.message
    np.testing.assert_allclose(found.q, 0.6, atol=1e-5)


def test_a_figure_of_an_assembly_keeps_a_constraint_of_ones_own(planar_arm: Callable[..., wb.Figure]) -> None:
    """A bar is fixed to the tip, so the answer is the arm's alone, whose first two angles have a product."""
    arm = planar_arm((0.3, 0.3, 0.2))
    made = wb.Assembly().figure("arm", arm, [0.4, 0.3, 0.6], constraints=[Product(0.3, 0.3)])
    target = arm.placement(np.array([0.5, 0.6, 0.2]), "tip").translation
    made.body("bar", made.placement("arm/tip").translation).fixed("arm/tip", "bar").point_goal("bar", target)
    assert made.solve(tolerance=1e-8).status == "solved"
    q = made.posture("arm")
    assert q[0] * q[1] == pytest.approx(0.3, abs=1e-7)
    assert made.placement("arm/tip").translation == pytest.approx(target, abs=1e-7)
