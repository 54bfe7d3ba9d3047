"""The best value of one joint, against scans of all its values; sweeps, against plane trigonometry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import wholebody as wb
from tests.reference import limbs as reference
from wholebody.methods.ccd.limbs import Limbs, movable
from wholebody.methods.ccd.sweep import Aims, within


def _one_joint(made: Any, low: float, high: float) -> tuple[Any, Limbs]:
    model = pin.Model()
    bounds = [np.array([value]) for value in (1.0, 1.0, low, high)]
    model.addJoint(0, made, pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.5])), np.array([0.1, 0.2, 0.3])), "joint", *bounds)
    limbs, data = Limbs(model, [1]), model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    limbs.read(pin.neutral(model), data)
    limbs.forward()
    return model, limbs


@given(seed=st.integers(0, 10_000), low=st.floats(-7.0, 0.0), high=st.floats(0.0, 7.0), slides=st.booleans())
def test_a_joint_takes_the_best_of_all_its_values(seed: int, low: float, high: float, slides: bool) -> None:
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    made = pin.JointModelPrismaticUnaligned(axis) if slides else pin.JointModelRevoluteUnaligned(axis)
    model, limbs = _one_joint(made, low, high)
    kinds = [False, False, False] if slides else [False, True, False, True]
    here, there = rng.normal(size=(len(kinds), 3)), rng.normal(size=(len(kinds), 3))
    weights = rng.uniform(0.1, 2.0, len(kinds))
    aims = Aims(limbs, [0] * len(kinds), here, there, [not direction for direction in kinds], weights)
    aims.here[:] = here  # in the world, wherever the node is
    aims.sweep(aims.plan())
    assert low <= limbs.values[0] <= high

    data = model.createData()

    def left(value: float) -> float:
        pin.forwardKinematics(model, data, np.zeros(1))
        start = data.oMi[1].copy()
        pin.forwardKinematics(model, data, np.array([value]))
        motion = data.oMi[1] * start.inverse()
        total = 0.0
        for k, direction in enumerate(kinds):
            now = motion.rotation @ here[k] if direction else motion.act(here[k])
            total += weights[k] * float(np.sum((now - there[k]) ** 2))
        return total

    found = left(limbs.values[0])
    assert aims.distance**2 == pytest.approx(found, abs=1e-9)
    assert found <= min(left(float(value)) for value in np.linspace(low, high, 100)) + 1e-9


def test_the_nearest_allowed_angle_is_found_across_half_a_turn() -> None:
    assert within(3.0, -3.0, 2.0) == -3.0  # beyond the upper limit, but nearer to the lower one on the circle
    assert within(2.5, -3.0, 2.0) == 2.0
    assert within(-6.0, -1.0, 1.0) == pytest.approx(2.0 * np.pi - 6.0)
    assert within(7.0, -np.inf, 1.0) == pytest.approx(7.0 - 2.0 * np.pi)


@settings(max_examples=20)
@given(radius=st.floats(0.15, 0.65), angle=st.floats(-2.0, 2.0))
def test_two_links_reach_where_the_triangle_says(radius: float, angle: float, planar_arm: Callable[..., Any]) -> None:
    figure = planar_arm((0.4, 0.3))
    target = (radius * np.cos(angle), radius * np.sin(angle), 0.0)
    problem = wb.Problem(wb.Scene(figure), goals=[wb.Point("tip", target)])
    solution = wb.methods.CCD(tolerance=1e-5).solve(problem)
    assert solution.solved
    bend = np.arccos((radius**2 - 0.4**2 - 0.3**2) / (2.0 * 0.4 * 0.3))
    assert abs(solution.q[1]) == pytest.approx(bend, abs=2e-3)


def test_an_orientation_in_the_plane_makes_three_links_unique(planar_arm: Callable[..., Any]) -> None:
    figure = planar_arm((0.4, 0.3, 0.2))
    heading = 0.9
    wrist = np.array([0.35, 0.3])
    tip = wrist + 0.2 * np.array([np.cos(heading), np.sin(heading)])
    target = pin.SE3(pin.exp3(np.array([0.0, 0.0, heading])), np.array([*tip, 0.0]))
    solution = wb.methods.CCD(tolerance=1e-5).solve(wb.Problem(wb.Scene(figure), goals=[wb.Frame("tip", target)]))
    assert solution.solved
    assert solution.q.sum() == pytest.approx(heading, abs=1e-4)
    bend = np.arccos((wrist @ wrist - 0.4**2 - 0.3**2) / (2.0 * 0.4 * 0.3))
    assert abs(solution.q[1]) == pytest.approx(bend, abs=1e-3)


@pytest.mark.parametrize("reach", [0.2, 0.5, 0.89])
def test_a_straight_arm_leaves_the_line_to_its_target(reach: float, planar_arm: Callable[..., Any]) -> None:
    """The classical trap: joint, tip and target on one line, where no single joint gains anything."""
    figure = planar_arm((0.4, 0.3, 0.2))
    problem = wb.Problem(wb.Scene(figure), np.zeros(3), goals=[wb.Point("tip", (reach, 0.0, 0.0))])
    assert wb.methods.CCD().solve(problem).solved


def test_a_target_out_of_reach_is_said_to_be_so(planar_arm: Callable[..., Any]) -> None:
    figure = planar_arm((0.4, 0.3))
    solution = wb.methods.CCD().solve(wb.Problem(wb.Scene(figure), goals=[wb.Point("tip", (0.6, 0.6, 0.0))]))
    assert solution.status == "unreachable"
    assert solution.assessment.goal_error == pytest.approx(np.hypot(0.6, 0.6) - 0.7, abs=1e-4)


@pytest.mark.parametrize("name", ["human", "avatar", "slides"])
def test_compiled_kinematics_and_sweeps_do_what_plain_floats_do(name: str) -> None:
    """On random postures, aims and plans, entry by entry; the same numbers but for the last digits."""
    rng = np.random.default_rng(5)
    model = _sliding_arm(rng) if name == "slides" else wb.load(name).model
    joints = [joint for joint in range(1, model.njoints) if movable(model, joint)]
    data = model.createData()
    for case in range(60):
        chosen = sorted(rng.choice(joints, size=int(rng.integers(1, len(joints) + 1)), replace=False).tolist())
        limbs = Limbs(model, chosen)
        q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
        pin.forwardKinematics(model, data, q)
        limbs.read(q, data)
        limbs.forward()
        frames, lines = reference.forward(limbs)
        assert np.abs(limbs.frames - frames).max() < 1e-13
        assert np.abs(limbs.lines - lines).max() < 1e-13
        count = int(rng.integers(1, 5))
        here, there = rng.normal(size=(2, count, 3))
        tips, weights = rng.integers(len(chosen), size=count).tolist(), rng.uniform(0.1, 2.0, count)
        aims = Aims(limbs, tips, here, there, (rng.random(count) < 0.6).tolist(), weights)
        aims.here[:] = here
        plan = aims.plan() if case % 2 else aims.plan(rng.choice(len(chosen), 3).tolist())
        steps = [(node, tuple(plan.moved[k:last].tolist()), points) for node, k, last, points in plan.turns.tolist()]
        values, carried = limbs.values.tolist(), [tuple(place) for place in here.tolist()]
        targets = [tuple(place) for place in there.tolist()]
        expected = reference.sweep(limbs, values, carried, targets, aims.weights.tolist(), steps)
        assert aims.sweep(plan) == pytest.approx(expected, abs=1e-12)
        assert np.abs(limbs.values - values).max() < 1e-12
        assert np.abs(aims.here - carried).max() < 1e-12
        assert aims.distance == pytest.approx(np.sqrt(aims.weights @ ((there - aims.here) ** 2).sum(axis=1)))


def _sliding_arm(rng: np.random.Generator) -> Any:
    """A tree of joints that turn and slide about all kinds of axes, some without limits."""
    model, parent = pin.Model(), 0
    for number in range(12):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        kinds = (
            pin.JointModelRX(), pin.JointModelRY(), pin.JointModelRZ(), pin.JointModelPX(), pin.JointModelPZ(),
            pin.JointModelRevoluteUnaligned(axis), pin.JointModelPrismaticUnaligned(axis),
            pin.JointModelRevoluteUnaligned(np.array([0.0, -1.0, 0.0])),
        )  # fmt: skip
        bounds = [np.array([value]) for value in (1.0, 1.0, -rng.uniform(0.1, 4.0), rng.uniform(0.1, 4.0))]
        place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3)) if number % 3 else pin.SE3.Identity()
        made = kinds[number % len(kinds)]
        parent = model.addJoint(int(rng.integers(0, parent + 1)), made, place, f"joint{number}", *bounds)
    model.addJoint(parent, pin.JointModelRUBY(), pin.SE3.Random(), "endless")
    return model


def test_aims_go_along_with_their_nodes_and_errors_are_distances_and_angles() -> None:
    model = wb.load("avatar").model
    limbs = Limbs(model, [joint for joint in range(1, model.njoints) if movable(model, joint)])
    data, rng = model.createData(), np.random.default_rng(2)
    for _ in range(50):
        q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
        pin.forwardKinematics(model, data, q)
        limbs.read(q, data)
        limbs.forward()
        node, place, turn = int(rng.integers(-1, len(limbs.joints))), rng.normal(size=3), pin.exp3(rng.normal(size=3))
        stand = pin.SE3.Identity() if node < 0 else data.oMi[limbs.joints[node]]
        aims = Aims(limbs, [node] * 4, np.vstack([place, turn.T]), np.zeros((4, 3)), [True, False, False, False])
        here = aims.here
        assert np.abs(here[0] - stand.act(place)).max() < 1e-12
        assert np.abs(here[1:].T - stand.rotation @ turn).max() < 1e-12
        off, angle = 0.5 * rng.normal(size=3), float(rng.uniform(0.0, 3.1))
        axis = rng.normal(size=3)
        wanted = stand.rotation @ turn @ pin.exp3(angle * axis / np.linalg.norm(axis))
        aims.there[:] = np.vstack([here[0] + off, wanted.T])
        assert aims.error == pytest.approx(max(float(np.linalg.norm(off)), angle), abs=1e-7)
        aims.there[0] = here[0]
        assert aims.error == pytest.approx(angle, abs=1e-7)


def test_a_slide_stays_where_there_are_directions_alone() -> None:
    _, limbs = _one_joint(pin.JointModelPrismaticUnaligned(np.array([1.0, 0.0, 0.0])), -1.0, 1.0)
    there = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    aims = Aims(limbs, [0] * 3, np.eye(3), there, [False] * 3)
    assert len(aims.plan().turns) == 0
    assert aims.sweep(aims.plan()) == 0.0
