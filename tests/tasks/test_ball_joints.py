"""Effort counts the three angles of a ball joint: how far that is from counting its rotation vector, and where.

The page on the person states these figures. Rotations are those of pinocchio's frames, not of the measure.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.audits import human_tasks
from wholebody.base.arrays import Array
from wholebody.figures.state import State

FIRST = ("flexion", "abduction", "rotation")
TRUNK = ("flexion", "lateral", "rotation")
BALLS = {
    **{f"{side}_{name}": FIRST for side in ("left", "right") for name in ("shoulder", "hip")},
    **dict.fromkeys(("spine1", "spine2", "spine3", "spine4", "neck1"), TRUNK),
}


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return wb.Scene(wb.load("human"))


@pytest.fixture(scope="module")
def arms(scene: wb.Scene) -> Array:
    """(400, nq) standing people whose left arm is anywhere in its ranges of motion."""
    figure, rng = scene.figure, np.random.default_rng(0)
    start, state, found = figure.posture("standing"), State(scene.model), []
    kept = [term.resolve(scene, start) for term in (wb.tasks.RangeOfMotion(), wb.tasks.ReachCones())]
    places = [figure.model.joints[figure.joint_id(f"left_shoulder_{name}")].idx_q for name in FIRST]
    lower, upper = figure.model.lowerPositionLimit[places], figure.model.upperPositionLimit[places]
    while len(found) < 400:
        q = start.copy()
        q[places] = rng.uniform(lower, upper)
        state.update(q)
        if all(term.value(state).min() >= 0.0 for term in kept):
            found.append(q)
    return np.array(found)


@cache
def scratch(figure: wb.Figure) -> pin.Data:
    return figure.model.createData()


def turn(figure: wb.Figure, q: Array, ball: str) -> Array:
    """(3, 3) rotation of the last of a ball joint's hinges against what carries the first."""
    ids = [figure.joint_id(f"{ball}_{name}") for name in BALLS[ball]]
    data = scratch(figure)
    pin.forwardKinematics(figure.model, data, q)
    return np.asarray(data.oMi[figure.model.parents[ids[0]]].rotation.T @ data.oMi[ids[-1]].rotation)


def both(figure: wb.Figure, q: Array, start: Array, ball: str, weighted: bool = True) -> tuple[float, float]:
    """Squares of the changes of the angles, and of the rotation vector in the parent's axes."""
    joints = [figure.model.joints[figure.joint_id(f"{ball}_{name}")] for name in BALLS[ball]]
    away = np.array([q[joint.idx_q] - start[joint.idx_q] for joint in joints])
    weights = np.array([figure.effort_weights[joint.idx_v] if weighted else 1.0 for joint in joints])
    vector = pin.log3(turn(figure, q, ball) @ turn(figure, start, ball).T)
    # At zero flexion turns about y, abduction and bending to a side about x, rotation about z.
    return float(weights @ away**2), float(weights @ vector[[1, 0, 2]] ** 2)


def shoulder(figure: wb.Figure, flexion: float, abduction: float, rotation: float) -> Array:
    values = zip(FIRST, (flexion, abduction, rotation), strict=True)
    joints = {f"left_shoulder_{name}": math.radians(degrees) for name, degrees in values}
    return np.asarray(figure.with_joints(figure.posture("standing"), joints))


def test_shoulders_alone_can_bring_their_first_and_last_axis_together(scene: wb.Scene) -> None:
    figure = scene.figure
    for ball, names in BALLS.items():
        joint = figure.model.joints[figure.joint_id(f"{ball}_{names[1]}")]
        low, high = figure.model.lowerPositionLimit[joint.idx_q], figure.model.upperPositionLimit[joint.idx_q]
        if ball.endswith("shoulder"):
            assert low < 0.5 * math.pi < high
        else:
            assert max(-low, high) <= math.radians(45.0) + 1e-9


def test_a_motion_about_one_axis_counts_the_same(scene: wb.Scene) -> None:
    figure, start = scene.figure, shoulder(scene.figure, 0.0, 0.0, 0.0)
    for angles in ((100.0, 0.0, 0.0), (0.0, 100.0, 0.0), (0.0, 0.0, 60.0), (-40.0, 0.0, 0.0)):
        counted, vector = both(figure, shoulder(figure, *angles), start, "left_shoulder")
        assert counted == pytest.approx(vector)
        state = State(scene.model).update(shoulder(figure, *angles))
        assert wb.Effort().resolve(scene, start).value(state) == pytest.approx(counted)


def test_rotation_effort_is_the_weighted_square_of_the_rotation_vectors(scene: wb.Scene, arms: Array) -> None:
    """Of the nine ball joints; of the other joints and the root it is what `Effort` counts."""
    figure, start, state = scene.figure, scene.figure.posture("sitting"), State(scene.model)
    rng = np.random.default_rng(1)
    term, angles = wb.tasks.RotationEffort().resolve(scene, start), wb.Effort().resolve(scene, start)
    assert len(term.balls) == len(BALLS)
    for arm in arms[:20]:
        q = figure.clamp(pin.integrate(figure.model, arm, 0.2 * rng.normal(size=figure.model.nv)))
        pairs = np.array([both(figure, q, start, ball) for ball in BALLS])
        state.update(q)
        expected = angles.value(state) - pairs[:, 0].sum() + pairs[:, 1].sum()
        assert term.value(state) == pytest.approx(expected)
        residuals, rows = term.squares(state)
        assert residuals @ residuals == pytest.approx(expected)
        assert 2.0 * residuals @ rows == pytest.approx(term.gradient(state), abs=1e-9)


def test_figures_without_ball_joints_count_angles() -> None:
    scene = wb.Scene(wb.load("hand"))
    rng, figure = np.random.default_rng(0), scene.figure
    terms = [kind().resolve(scene, figure.neutral) for kind in (wb.tasks.RotationEffort, wb.Effort)]
    state = State(scene.model).update(pin.integrate(figure.model, figure.neutral, rng.normal(size=figure.model.nv)))
    assert terms[0].balls == ()
    assert terms[0].value(state) == pytest.approx(terms[1].value(state))
    assert terms[0].curvature(state) == pytest.approx(terms[1].curvature(state))


def test_an_arm_swings_forward_from_the_t_pose_with_little_twist(scene: wb.Scene) -> None:
    """By 60 degrees about the vertical, and twisted because the third hinge ends at 70; angles twist it by 81."""
    figure, start = scene.figure, scene.figure.posture("t_pose")
    shoulder_at = figure.placement(start, "left_upper_arm").translation
    reach = np.linalg.norm(figure.placement(start, "left_elbow").translation - shoulder_at)
    goal = wb.Point("left_elbow", shoulder_at + reach * np.array([math.sqrt(0.75), 0.5, 0.0]))
    free = [f"left_shoulder_{name}" for name in FIRST]
    still = wb.Freeze(*[name for name in figure.joints if name not in free], "root")
    twists = []
    for measure in (wb.tasks.RotationEffort(), wb.Effort()):
        made = [goal], [still], [measure]
        problem = wb.Problem(scene, start, goals=made[0], constraints=made[1], measures=made[2], range_of_motion=False)
        q = wb.solve(problem).q
        vector = pin.log3(turn(figure, q, "left_shoulder") @ turn(figure, start, "left_shoulder").T)
        twists.append(np.degrees(abs(vector[1])))  # about the arm as it was
    assert twists == pytest.approx([18.1, 80.9], abs=1.0)


def test_over_the_shoulders_range_the_two_differ_as_the_page_says(scene: wb.Scene, arms: Array) -> None:
    figure, start = scene.figure, scene.figure.posture("standing")
    pairs = np.array([both(figure, q, start, "left_shoulder", weighted=False) for q in arms])
    low, middle, high = np.percentile(pairs[:, 1] / pairs[:, 0], [5, 50, 95])
    assert low == pytest.approx(0.43, abs=0.06)
    assert middle == pytest.approx(0.93, abs=0.04)
    assert high == pytest.approx(1.28, abs=0.06)
    # The rotation vector has a kink of its own within the range: at 180 degrees it turns round.
    turns = np.degrees(np.sqrt(pairs[:, 1]))
    assert turns.max() > 175.0
    assert np.mean(turns > 170.0) == pytest.approx(0.06, abs=0.03)


def test_in_everyday_tasks_the_sum_differs_by_an_eighth(scene: wb.Scene) -> None:
    figure = scene.figure
    for name, made in list(human_tasks.tasks(figure).items())[::3]:
        problem = made()
        q = wb.solve(problem).q
        pairs = np.array([both(figure, q, problem.start, ball) for ball in BALLS])
        effort = wb.Effort().resolve(problem.scene, problem.start).value(State(problem.scene.model).update(q))
        assert abs(pairs[:, 0].sum() - pairs[:, 1].sum()) < 0.125 * effort, name
