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


def test_stance_counts_what_the_feet_are_off_side_by_side_and_the_load_off_their_middle() -> None:
    person = wb.load("human")
    stance = wb.tasks.Stance().resolve(wb.Scene(person), person.posture("standing"))
    model, standing = person.model, person.posture("standing")
    apart = person.placement(standing, "left_foot").translation[1] * 2.0

    def load(q: Array) -> Array:  # where the centre of mass is over the middle of the feet
        middle = np.mean([person.placement(q, f"{side}_foot").translation for side in ("left", "right")], axis=0)
        return (pin.centerOfMass(model, model.createData(), q) - middle)[:2]

    def value(**degrees: float) -> tuple[float, Array, float]:
        q = person.with_joints(standing, {name: np.radians(angle) for name, angle in degrees.items()})
        left, right = (person.placement(q, f"{side}_foot") for side in ("left", "right"))
        borne = 600.0 * float(np.square(load(q) - load(standing)).sum())
        return stance.value(State(model).update(q)), left.translation - right.translation, borne

    assert value()[0] == pytest.approx(0.0, abs=1e-12)
    split, way, borne = value(left_hip_flexion=20.0, left_ankle_dorsiflexion=-20.0)
    assert split == pytest.approx(60.0 * way[0] ** 2 + borne, rel=1e-9)
    mirrored = value(right_hip_flexion=20.0, right_ankle_dorsiflexion=-20.0)[0]
    assert mirrored == pytest.approx(split, rel=1e-9)
    wide, way, _ = value(left_hip_abduction=10.0, right_hip_abduction=10.0)
    turned = np.cos(np.radians(10.0)) * way[1]  # as either foot sees it, which the leg has tipped by ten degrees
    assert stance.of_feet().value(State(model).update(person.with_joints(standing, dict.fromkeys(
        ("left_hip_abduction", "right_hip_abduction"), np.radians(10.0)
    )))) == pytest.approx(300.0 * (turned - apart) ** 2, rel=1e-6)  # fmt: skip
    assert wide == pytest.approx(300.0 * (turned - apart) ** 2, rel=1e-4)  # both sides alike: equal load
    bowed, _, borne = value(spine1_flexion=20.0, spine2_lateral=10.0)
    assert borne > 0.1
    assert bowed == pytest.approx(borne, rel=1e-9)


def test_load_is_that_over_the_ground_where_the_feet_are_on_a_slope() -> None:
    person = wb.load("human")
    stance, q = wb.tasks.Stance().resolve(wb.Scene(person), person.neutral), person.posture("standing")
    ankles = dict.fromkeys(("left_ankle_dorsiflexion", "right_ankle_dorsiflexion"), np.radians(20.0))
    upright = person.with_joints(q, ankles)  # the person is plumb over soles that are steep
    assert stance.value(State(person.model).update(upright)) < 0.01


def test_of_a_task_alike_on_both_sides_both_feet_and_both_halves_of_the_seat_bear_alike() -> None:
    """Before, the centre of mass was 0.11 m beside the middle of the feet, on either side; a driver 0.18 m."""
    person = wb.load("human", percentile=28)
    scene = wb.Scene(person).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.60, 1.2, 0.04)), name="table", at=(0.62, 0.0, 0.72))
    goals: list[wb.tasks.Goal] = []
    for side, y in (("left", 0.16), ("right", -0.16)):
        goals += [wb.Point(f"{side}_palm", (0.45, y, 0.86)), wb.Axis(f"{side}_palm", (0, 0, 1), direction=(0, -y, 0))]
    solution = wb.solve(wb.Problem(scene, goals=goals, constraints=[wb.Stand("floor")]))
    assert solution.solved
    feet = [person.placement(solution.q, f"{side}_foot").translation for side in ("left", "right")]
    center = pin.centerOfMass(person.model, person.model.createData(), solution.q)
    assert abs(center[1] - 0.5 * (feet[0][1] + feet[1][1])) < 0.01
    assert abs(center[1]) < 0.02

    stool = wb.Scene(person).add(wb.Box((0.5, 0.52, 0.08)), name="seat", at=(0.0, 0.3, 0.40))
    far = [wb.Point(f"{side}_grip", (0.62, 0.3 + y, 0.85)) for side, y in (("left", 0.15), ("right", -0.15))]
    seated = wb.solve(wb.Problem(stool, "sitting", goals=[wb.Sit("seat"), *far]))
    assert seated.solved
    assert seated.q[1] == pytest.approx(0.3, abs=0.02)


def test_a_foot_on_a_rung_bears_nothing_and_a_bench_has_hardly_a_middle() -> None:
    person = wb.load("human")
    scene = wb.Scene(person).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.2, 0.4, 0.3)), name="step", at=(0.3, 0, 0.15))
    stands = [wb.Stand("floor", feet=["left_foot"]), wb.Stand("step", feet=["right_foot"], balance=False)]
    one, both = (
        next(term for term in wb.Problem(scene, constraints=terms).measures if isinstance(term, wb.tasks.Stance))
        for terms in (stands, [wb.Stand("floor")])
    )
    state = State(person.model).update(person.with_joints(person.neutral, {"spine1_flexion": 0.3}))
    assert both.value(state) > 0.5 > 0.001 > one.value(state)

    benches = wb.Scene(person)
    for width in (0.5, 4.0):
        benches.add(wb.Box((0.4, width, 0.1)), name=f"{width}", at=(0.0, 0.1, 0.4))
    values = [wb.tasks.SeatCenterline(f"{width}").resolve(benches, person.neutral).value(State(person.model).update(
        person.posture("sitting"))) for width in (0.5, 4.0)]  # fmt: skip
    np.testing.assert_allclose(values, [(0.1 / 0.25) ** 2, (0.1 / 2.0) ** 2])


def test_two_people_on_one_bench_have_no_middle_each() -> None:
    scene = wb.Scene({"anna": wb.load("human", sex="female"), "ben": (wb.load("human"), (0.0, 0.8, 0.0))})
    scene.add(wb.Box((0.5, 2.0, 0.08)), name="bench", at=(0.0, 0.4, 0.4))
    sits = [wb.Sit("bench", pelvis=f"{name}/pelvis", trunk=f"{name}/thorax") for name in ("anna", "ben")]
    for used, count in ((sits, 0), (sits[:1], 1)):
        measures = wb.Problem(scene, constraints=used).measures
        assert sum(isinstance(term, wb.tasks.SeatCenterline) for term in measures) == count


def test_stance_has_derivatives_and_two_feet() -> None:
    scene = wb.Scene(wb.load("human"))
    assert wb.check_derivatives(wb.tasks.Stance(), scene).agrees
    scene.add(wb.Box((0.4, 0.5, 0.1)), name="seat")
    assert wb.check_derivatives(wb.tasks.SeatCenterline("seat"), scene).agrees
    with pytest.raises(wb.InputError, match="feet has 1 names; give two"):
        wb.Problem(scene, measures=[wb.tasks.Stance(["left_foot"])])


def test_a_ball_and_an_upright_capsule_have_a_middle(human: wb.Figure) -> None:
    """Their faces are points, over whose size of zero the distance was not finite: no seat was found."""
    scene = wb.Scene(human).add(wb.Sphere(0.3), name="ball", at=(0.0, 0.0, 0.3))
    scene.add(wb.Capsule(0.1, 0.5), name="post", at=(1.0, 0.0, 0.3))
    for name, x in (("ball", 0.0), ("post", 1.0)):
        measure = wb.tasks.SeatCenterline(name).resolve(scene, human.neutral)
        q = human.neutral.copy()
        q[:2] = x, 0.05
        assert measure.value(State(human.model).update(q)) == pytest.approx(0.5**2)
        assert wb.check_derivatives(wb.tasks.SeatCenterline(name), scene).agrees
