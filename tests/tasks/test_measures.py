"""Values of the measures against numbers worked out by hand or from the papers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody import tasks
from wholebody.base.arrays import Array
from wholebody.figures.state import State


def test_effort_is_the_weighted_squared_displacement_from_the_start(humanoid: Any, random_posture: Any) -> None:
    rng = np.random.default_rng(0)
    start = random_posture(humanoid.model, rng)
    step = rng.normal(size=humanoid.model.nv)
    effort = tasks.Effort().resolve(humanoid, start)
    state = State(humanoid.model)
    assert effort.value(state.update(start)) == 0.0
    moved = state.update(pin.integrate(humanoid.model, start, step))
    np.testing.assert_allclose(effort.value(moved), np.sum(humanoid.figure.effort_weights * step**2))


def test_weights_on_the_root_bend_the_gradient(humanoid: Any, random_posture: Any) -> None:
    rng = np.random.default_rng(1)
    humanoid.figure.effort_weights[:6] = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    effort = tasks.Effort().resolve(humanoid, random_posture(humanoid.model, rng))
    state = State(humanoid.model)
    q = random_posture(humanoid.model, rng)
    gradient = effort.gradient(state.update(q))
    for direction in rng.normal(size=(10, humanoid.model.nv)):
        ahead, behind = (
            effort.value(state.update(pin.integrate(humanoid.model, q, h * direction))) for h in (1e-6, -1e-6)
        )
        np.testing.assert_allclose(gradient @ direction, (ahead - behind) / 2e-6, rtol=1e-6)


def test_displacement_is_zero_only_in_the_neutral_posture(humanoid: Any) -> None:
    displacement = tasks.Displacement().resolve(humanoid, humanoid.figure.neutral)
    state = State(humanoid.model).update(humanoid.figure.neutral)
    assert displacement.value(state) == 0.0
    q = humanoid.figure.neutral.copy()
    q[7 + 3] += 0.5
    np.testing.assert_allclose(displacement.value(state.update(q)), 0.25 * humanoid.figure.neutral_weights[6 + 3])


def penalty(humanoid: Any, ratio: float) -> float:
    """Discomfort of one joint at a ratio of its range from the upper limit, without the term of neutral."""
    figure = humanoid.figure
    figure.effort_weights[:] = 0.0
    term = tasks.Discomfort().resolve(humanoid, figure.neutral)
    q = figure.neutral.copy()
    q[12] = figure.limits.upper[5] - ratio * (figure.limits.upper[5] - figure.limits.lower[5])
    state = State(humanoid.model)
    return float(term.value(state.update(q)) - term.value(state.update(figure.neutral)))


def test_discomfort_rises_from_0_to_1_in_the_last_tenth_of_the_range(humanoid: Any) -> None:
    # [(sin(5 r + pi/2) + 1) / 2]^100 worked out with bc to six digits.
    for ratio, expected in [(0.0, 1.0), (0.01, 0.939407), (0.05, 0.208757), (0.1, 0.001807), (0.2, 0.0)]:
        np.testing.assert_allclose(penalty(humanoid, ratio), expected, atol=2e-6)


def test_discomfort_is_bounded_and_quiet_beyond_limits(humanoid: Any) -> None:
    for ratio in (-1e-6, -0.1, -1.0, -1e6):
        np.testing.assert_allclose(penalty(humanoid, ratio), 1.0, atol=1e-6)
    term = tasks.Discomfort().resolve(humanoid, humanoid.figure.neutral)
    state = State(humanoid.model)
    for size in (10.0, 1e8):
        q = humanoid.figure.neutral + np.r_[np.zeros(7), np.full(humanoid.model.nv - 6, size)]
        state.update(q)
        assert np.isfinite(term.value(state))
        assert np.isfinite(term.gradient(state)).all()
        assert (term.curvature(state) > 0.0).all()


def test_discomfort_counts_the_stiffest_joint_over_its_range_as_one(humanoid: Any) -> None:
    figure = humanoid.figure
    figure.limits.lower[:], figure.limits.upper[:] = -1.0, 1.0
    figure.effort_weights[6:] = 2.0
    figure.effort_weights[6 + 4] = 50.0
    term = tasks.Discomfort().resolve(humanoid, figure.neutral)
    state = State(humanoid.model)
    rest = term.value(state.update(figure.neutral))
    q = figure.neutral.copy()
    q[7 + 4] = 0.5
    np.testing.assert_allclose(term.value(state.update(q)) - rest, 0.25**2, atol=1e-12)
    q = figure.neutral.copy()
    q[7 + 5] = 0.5
    np.testing.assert_allclose(term.value(state.update(q)) - rest, 0.25**2 * 2.0 / 50.0, atol=1e-12)


def test_discomfort_leaves_out_joints_without_a_range(humanoid: Any) -> None:
    figure = humanoid.figure
    figure.limits.upper[3] = np.inf
    figure.limits.lower[4] = figure.limits.upper[4] = 0.0
    term = tasks.Discomfort().resolve(humanoid, figure.neutral)
    state = State(humanoid.model)
    rest = term.value(state.update(figure.neutral))
    q = figure.neutral.copy()
    q[7 + 3], q[7 + 4] = 2.0, 2.0
    assert term.value(state.update(q)) == rest
    np.testing.assert_array_equal(term.gradient(state)[[6 + 3, 6 + 4]], 0.0)


def test_a_soft_goal_gives_way_to_goals_and_is_weighed_against_effort(planar_arm: Any) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3)))
    goal, far = wb.Axis("tip", (1.0, 0.0, 0.0), direction=(0.0, 1.0, 0.0)), wb.Point("tip", (0.6, 0.4, 0.0))
    wrong = wb.Point("tip", (9.0, 0.0, 0.0))
    for method in ("qp", "newton"):
        left = []
        for weight in (0.1, 10.0, 1e5):
            measures = [wb.tasks.Displacement(), wb.Soft(far, weight)]
            solution = wb.solve(wb.Problem(scene, np.full(3, 0.2), goals=[goal], measures=measures), method)
            assert solution.solved
            left.append(np.linalg.norm(scene.figure.placement(solution.q, "tip").translation - (0.6, 0.4, 0.0)))
        assert left[0] > 0.05
        assert left[0] > left[1] > left[2]
        assert left[2] < 1e-3
    problem = wb.Problem(scene, np.full(3, 0.2), goals=[goal], measures=[wb.tasks.Displacement(), wb.Soft(wrong)])
    assert wb.solve(problem).solved
    assert wb.solve(wb.Problem(scene, np.full(3, 0.2), goals=[goal, wrong])).status == "unreachable"
    soft = wb.Problem(
        wb.Scene(planar_arm((0.5, 0.4, 0.3))).add(wb.Sphere(0.1), name="ball", at=(0.6, 0.6, 0.0)),
        np.full(3, 0.2), measures=[wb.Soft(wb.Touch("link2", "ball"))], clearance=0.02,
    )  # fmt: skip
    assert (soft.clearances == 0.0).any()  # what it brings together may touch
    with pytest.raises(wb.InputError, match="Soft: goal"):
        wb.Soft(wb.Effort())  # type: ignore[arg-type]


def test_raising_the_whole_body_costs_the_weight_of_each_segment_times_the_height(humanoid: Any) -> None:
    model = humanoid.model
    q = humanoid.figure.neutral
    term = tasks.PotentialEnergy().resolve(humanoid, q)
    state = State(model)
    assert term.value(state.update(q)) == 0.0
    raised = q.copy()
    raised[:3] += (0.3, -0.2, 0.5)
    expected = sum((inertia.mass * 9.80665 * 0.5) ** 2 for inertia in list(model.inertias)[1:])
    np.testing.assert_allclose(term.value(state.update(raised)), expected)
    # Where the figure stands at the start does not matter.
    elsewhere = tasks.PotentialEnergy().resolve(humanoid, raised)
    assert elsewhere.value(state.update(raised)) == 0.0


def test_squared_changes_are_those_of_the_potential_energies_of_the_segments(
    humanoid: Any, random_posture: Any
) -> None:
    model = humanoid.model
    q = random_posture(model, np.random.default_rng(8))
    start = humanoid.figure.neutral
    term = tasks.PotentialEnergy().resolve(humanoid, start)
    total = 0.0
    for joint in range(1, model.njoints):
        # Pinocchio's own potential energy of a model in which all but one body has lost its mass.
        alone = model.copy()
        for other in range(1, model.njoints):
            if other != joint:
                alone.inertias[other] = pin.Inertia.Zero()
        alone.gravity.linear = np.array([0.0, 0.0, -9.80665])
        data = alone.createData()
        energies = [pin.computePotentialEnergy(alone, data, posture) for posture in (q, start)]
        total += (energies[0] - energies[1]) ** 2
    np.testing.assert_allclose(term.value(State(model).update(q)), total)


def test_stance_counts_what_the_feet_are_off_side_by_side() -> None:
    person = wb.load("human")
    stance = wb.tasks.Stance().resolve(wb.Scene(person), person.posture("standing"))
    apart = person.placement(person.posture("standing"), "left_foot").translation[1] * 2.0

    def value(**degrees: float) -> tuple[float, Array, Array]:
        joints = {name: np.radians(angle) for name, angle in degrees.items()}
        q = person.with_joints(person.posture("standing"), joints)
        left, right = (person.placement(q, f"{side}_foot") for side in ("left", "right"))
        return stance.value(State(person.model).update(q)), left.translation - right.translation, left.rotation

    assert value()[0] == pytest.approx(60.0 * 0.001**2)  # the right foot would be 1 mm ahead
    split, way, _ = value(left_hip_flexion=20.0, left_ankle_dorsiflexion=-20.0)
    assert split == pytest.approx(60.0 * (way[0] + 0.001) ** 2, rel=1e-9)
    wide, way, _ = value(left_hip_abduction=10.0, right_hip_abduction=10.0)
    turned = np.cos(np.radians(10.0)) * way[1]  # as either foot sees it, which the leg has tipped by ten degrees
    assert wide == pytest.approx(60.0 * ((turned - apart) ** 2 + 0.001**2), rel=1e-6)
    mirrored, way, _ = value(right_hip_flexion=20.0, right_ankle_dorsiflexion=-20.0)
    assert mirrored == pytest.approx(60.0 * (way[0] + 0.001) ** 2, rel=1e-9)
    assert mirrored < split


def test_of_a_split_stance_and_its_mirror_image_one_is_taken() -> None:
    """A box on the median plane: nothing but the measure says which foot goes ahead."""
    person = wb.load("human", percentile=5)
    ahead = []
    for height in (0.20, 0.25):
        scene = wb.Scene(person).add(wb.HalfSpace(), name="floor")
        scene.add(wb.Box((0.30, 0.40, 0.30)), name="box", at=(0.45, 0.0, height))
        goals: list[wb.tasks.Goal] = []
        for side, sign in (("left", 1.0), ("right", -1.0)):
            goals.append(wb.Point(f"{side}_palm", (0.45, 0.2005 * sign, height)))
            goals.append(wb.Axis(f"{side}_palm", (0, 0, 1), direction=(0, -sign, 0), weight=0.1))
        solution = wb.solve(wb.Problem(scene, goals=goals, constraints=[wb.Stand("floor")]))
        left, right = (person.placement(solution.q, f"{side}_foot").translation for side in ("left", "right"))
        assert solution.solved
        ahead.append(right[0] - left[0])
    assert min(ahead) > 0.05


def test_stance_has_derivatives_and_two_feet() -> None:
    scene = wb.Scene(wb.load("human"))
    wb.check_derivatives(wb.tasks.Stance(), scene)
    with pytest.raises(wb.InputError, match="feet has 1 names; give two"):
        wb.Problem(scene, measures=[wb.tasks.Stance(["left_foot"])])
