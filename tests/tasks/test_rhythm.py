"""The rhythm of shoulder girdle and lumbar spine against the numbers of its sources."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.audits import human_postures
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.tasks import Hang, LevelHead
from wholebody.tasks.base import filled


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return wb.Scene(wb.load("human"))


def value(scene: wb.Scene, degrees: dict[str, float], tilt: float = 0.0) -> float:
    """The measure where joints have these angles and the pelvis tips by `tilt` degrees, from a neutral start."""
    term, state = prepared(scene)
    straight = pin.neutral(scene.model)
    q = scene.figure.with_joints(straight, {joint: math.radians(angle) for joint, angle in degrees.items()})
    q[4], q[6] = math.sin(math.radians(tilt) / 2.0), math.cos(math.radians(tilt) / 2.0)
    return float(term.value(state.update(q)))


@lru_cache(maxsize=1)
def prepared(scene: wb.Scene) -> tuple[wb.tasks.Rhythm, State]:
    """The measure from a neutral start, and a state."""
    return wb.tasks.Rhythm().resolve(scene, pin.neutral(scene.model)), State(scene.model)


@pytest.mark.parametrize("joint", ["shoulder_flexion", "shoulder_abduction"])
@pytest.mark.parametrize("elevation", [30.0, 60.0, 90.0, 120.0, 150.0])
def test_clavicle_follows_its_arm(scene: wb.Scene, joint: str, elevation: float) -> None:
    """0.2 (elevation - 30 degrees), to 3 degrees, in whatever plane the arm is raised."""
    angles = np.arange(0.0, 40.0, 1.0)
    raised = {f"left_{joint}": elevation}
    found = [value(scene, {**raised, "left_clavicle_elevation": angle}) for angle in angles]
    assert angles[int(np.argmin(found))] == pytest.approx(0.2 * (elevation - 30.0), abs=3.0)
    assert min(found) < 100.0 * math.radians(1.0) ** 2


@pytest.mark.parametrize(("pelvis", "lumbar"), [(10.3, 19.7), (26.1, 33.9), (47.5, 42.5)])
def test_lumbar_spine_and_pelvis_share_bending(scene: wb.Scene, pelvis: float, lumbar: float) -> None:
    """Lumbar to hip motion of 1.9, 0.9 and 0.4 in the thirds of 90 degrees: that is where the sums above come from."""
    angles = np.arange(0.0, 60.0, 1.0)
    found = [value(scene, {f"spine{k}_flexion": angle / 3.0 for k in (1, 2, 3)}, pelvis) for angle in angles]
    assert angles[int(np.argmin(found))] == pytest.approx(lumbar, abs=3.5)
    ratios = np.array([1.9, 0.9, 0.4])
    assert np.cumsum(30.0 * ratios / (1.0 + ratios))[-1] == pytest.approx(42.4, abs=0.1)


def test_a_start_that_bends_is_what_counts(scene: wb.Scene) -> None:
    figure = scene.figure
    for name in ("prone", "sitting", "squatting"):
        q = figure.posture(name)
        term = wb.tasks.Rhythm().resolve(scene, q)
        assert term.lumbar
        turned = pin.SE3(pin.utils.rotate("z", 1.0), np.zeros(3)) * pin.XYZQUATToSE3(q[:7])
        q[:7] = pin.SE3ToXYZQUAT(turned)  # which way it faces does not count
        clavicles = filled(term, lumbar=())
        state = State(figure.model).update(q)
        assert term.value(state) == pytest.approx(clavicles.value(state), abs=1e-9)


def test_figures_without_clavicles_are_told(scene: wb.Scene) -> None:
    with pytest.raises(InputError, match="no clavicles and no lumbar spine"):
        wb.tasks.Rhythm().resolve(wb.Scene(wb.load("hand")), wb.load("hand").neutral)
    assert [type(term) for term in wb.Problem(wb.Scene(wb.load("avatar"))).measures] == [wb.Effort]


def test_curvature_bounds_the_second_derivative(scene: wb.Scene) -> None:
    """The diagonal less the Hessian of the squares has no negative eigenvalue where the rhythm is kept."""
    figure = scene.figure
    term = wb.tasks.Rhythm().resolve(scene, figure.neutral)
    q = figure.neutral
    state = State(figure.model)
    size = 1e-5
    steps = size * np.eye(figure.model.nv)
    hessian = np.array(
        [
            (term.gradient(state.update(pin.integrate(figure.model, q, step))).copy()
             - term.gradient(state.update(pin.integrate(figure.model, q, -step)))) / (2.0 * size)
            for step in steps
        ]
    )  # fmt: skip
    left = np.diag(term.curvature(state.update(q))) - 0.5 * (hessian + hessian.T)
    assert np.linalg.eigvalsh(left).min() > -3.0  # the bend of the rise itself, 100 * 2 * 13 deg * what is missed


BENT = ((25.0, 28.0), (45.0, 47.0), (75.0, 68.0), (95.0, 89.0))
"""Degrees: hips, and knees beyond those of standing, of a recorded man who bends to the floor."""


@pytest.mark.parametrize(("hip", "knee"), BENT)
@pytest.mark.parametrize("abduction", [0.0, 30.0])
def test_knees_follow_hips(scene: wb.Scene, hip: float, knee: float, abduction: float) -> None:
    """Half as far as those of the man at least, and not farther."""
    angles = np.arange(0.0, 110.0, 1.0)
    held = {"left_hip_flexion": hip, "left_hip_abduction": abduction}
    found = [value(scene, {**held, "left_knee_flexion": angle}) for angle in angles]
    assert 0.5 * knee < angles[int(np.argmin(found))] < knee


@pytest.mark.parametrize("abduction", [0.0, 30.0])
def test_knees_stay_straight_where_hips_do_not_flex(scene: wb.Scene, abduction: float) -> None:
    held = {"left_hip_flexion": 0.0, "left_hip_abduction": abduction}
    assert value(scene, held) == pytest.approx(0.0, abs=1e-12)


def test_knees_stay_where_the_start_has_them(scene: wb.Scene) -> None:
    sitting = scene.figure.posture("sitting")
    knees = wb.tasks.Rhythm().resolve(scene, sitting).squares(scene.state(sitting))[0][2:4]
    assert knees == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("posture", ["standing", "squatting"])
def test_gradient_is_that_of_finite_differences(scene: wb.Scene, posture: str) -> None:
    figure = scene.figure
    rng = np.random.default_rng(5)
    q = figure.clamp(pin.integrate(figure.model, figure.posture(posture), 0.05 * rng.normal(size=figure.model.nv)))
    term = wb.tasks.Rhythm().resolve(scene, figure.posture(posture))
    state, size = State(figure.model), 1e-6
    gradient = term.gradient(state.update(q)).copy()
    for place, step in enumerate(size * np.eye(figure.model.nv)):
        ends = [term.value(state.update(pin.integrate(figure.model, q, way * step))) for way in (1.0, -1.0)]
        assert (ends[0] - ends[1]) / (2.0 * size) == pytest.approx(gradient[place], abs=1e-5)


def test_a_box_is_taken_from_the_floor_with_bent_knees(scene: wb.Scene) -> None:
    """Neither a stoop nor a squat: people lift from the floor with knees between 40 and 100 degrees."""
    room = wb.Scene(scene.figure).add(wb.HalfSpace(), name="floor")
    room.add(wb.Box((0.3, 0.3, 0.25)), name="box", at=(0.42, 0.0, 0.1255))
    goals = [wb.Point(f"{side}_palm", (0.42, sign * 0.1505, 0.16)) for side, sign in (("left", 1), ("right", -1))]
    solution = wb.solve(wb.Problem(room, goals=goals, constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")]))
    assert solution.status == "solved"
    angles = scene.figure.joint_values(solution.q)
    knees = [math.degrees(angles[f"{side}_knee_flexion"]) for side in ("left", "right")]
    spine = math.degrees(sum(angle for joint, angle in angles.items() if joint.startswith("spine") and "flex" in joint))
    assert 40.0 < min(knees) <= max(knees) < 100.0
    assert spine < 70.0


def taken(scene: wb.Scene, *goals: wb.Goal) -> dict[str, float]:
    """Angles of the joints, degrees, of a person who stands and meets the goals."""
    feet = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    solution = wb.solve(wb.Problem(wb.Scene(scene.figure), goals=goals, constraints=feet))
    assert solution.status == "solved"
    return {name: math.degrees(angle) for name, angle in scene.figure.joint_values(solution.q).items()}


def test_a_low_reach_bends_the_knees(scene: wb.Scene) -> None:
    """Nobody reaches for something 0.3 m above the floor with straight knees."""
    angles = taken(scene, wb.Point("right_index_tip", (0.45, -0.20, 0.30)))
    assert min(angles[f"{side}_knee_flexion"] for side in ("left", "right")) > 15.0


def test_an_arm_that_is_raised_sideways_turns_outward_by_itself(scene: wb.Scene) -> None:
    """Without turning it ends at 120 degrees, where the greater tubercle meets the acromion."""
    angle = math.radians(170.0)
    goal = wb.Axis("left_upper_arm", (0, 0, -1), direction=(0.0, math.sin(angle), -math.cos(angle)))
    assert taken(scene, goal)["left_shoulder_rotation"] < -10.0


def test_one_raised_arm_hardly_bends_the_spine_sideways(scene: wb.Scene) -> None:
    """Neither the upper nor the lower thorax moves by more than six degrees in any direction (Stewart et al. 1995)."""
    angles = taken(scene, wb.Point("right_index_tip", (0.30, -0.25, 2.05)))
    bend = [angles[f"spine{level}_lateral"] for level in (1, 2, 3, 4)]
    assert abs(sum(bend[2:])) < 6.0
    assert abs(sum(bend)) < 9.0  # with the lumbar spine, of which the source says nothing


def test_both_arms_at_the_end_of_their_range_extend_the_thorax_as_people_do(scene: wb.Scene) -> None:
    """By 12.8 degrees, standard deviation 7.6, on radiographs of 21 men (Edmondston et al. 2012)."""
    solution = wb.solve(human_postures.overhead(scene.figure))
    angles = {name: math.degrees(angle) for name, angle in scene.figure.joint_values(solution.q).items()}
    assert solution.solved
    assert min(angles[f"{side}_shoulder_flexion"] for side in ("left", "right")) > 150.0
    assert 12.8 - 7.6 < -sum(angles[f"spine{level}_flexion"] for level in (3, 4)) < 12.8 + 7.6


def test_its_squares_are_its_value_and_their_rows_their_derivatives(scene: wb.Scene) -> None:
    figure, rng, step = scene.figure, np.random.default_rng(5), 1e-6
    term, state = wb.tasks.Rhythm(2.0).resolve(scene, figure.posture("standing")), State(figure.model)
    for _ in range(3):
        q = pin.integrate(figure.model, figure.posture("sitting"), 0.5 * rng.normal(size=figure.model.nv))
        residuals, rows = term.squares(state.update(q))
        assert len(residuals) == 5  # two clavicles, two knees, one lumbar spine
        assert residuals @ residuals == pytest.approx(term.value(state))
        np.testing.assert_allclose(2.0 * residuals @ rows, term.gradient(state), atol=1e-12)
        way = rng.normal(size=figure.model.nv)
        ends = [term.squares(state.update(pin.integrate(figure.model, q, side * step * way)))[0] for side in (1, -1)]
        np.testing.assert_allclose((ends[0] - ends[1]) / (2.0 * step), rows @ way, atol=1e-6)


def test_who_sits_has_knees_where_the_pedals_are(scene: wb.Scene) -> None:
    """127 drivers had knees of 115 and hips of 98 degrees (Wolf et al. 2022): knees stretch as hips open."""
    car = wb.Scene({"anna": scene.figure, "bo": scene.figure}).add(wb.Box((0.5, 0.5, 0.1)), name="seat", at=(0, 0, 0.3))
    start = car.figure.posture({"anna": "sitting", "bo": "standing"})
    problem = wb.Problem(car, start, goals=[wb.Sit("seat", pelvis="anna/pelvis", trunk="anna/thorax")])
    hips, knees, lumbar = ([f"{who}/{name}" for who in ("anna", "bo")] for name in
                           ("right_hip_flexion", "right_knee_flexion", "spine2_flexion"))  # fmt: skip
    rhythm = problem.measures[1]
    reclined = car.figure.with_joints(
        start, {hips[0]: math.radians(82.0), knees[0]: math.radians(65.0), lumbar[0]: 0.2}
    )
    crouched = car.figure.with_joints(start, {hips[1]: math.radians(82.0), lumbar[1]: 0.2})
    state = State(car.model)
    at_start = rhythm.value(state.update(start))
    assert rhythm.value(state.update(reclined)) == pytest.approx(at_start, abs=1e-12)
    assert rhythm.value(state.update(crouched)) > at_start + 1.0


def test_the_way_to_a_seat_is_no_effort_of_who_sits(scene: wb.Scene) -> None:
    """Drivers choose a seat's place for their limbs, not for its distance to where the world has its origin."""
    car = wb.Scene({"anna": scene.figure, "bo": scene.figure}).add(wb.Box((0.5, 0.5, 0.1)), name="seat", at=(0, 0, 0.3))
    start = car.figure.posture({"anna": "sitting", "bo": "standing"})
    effort = wb.Problem(car, start, goals=[wb.Sit("seat", pelvis="anna/pelvis", trunk="anna/thorax")]).measures[0]
    state = State(car.model)
    for who, least in (("anna", 0.0), ("bo", 5.0)):
        moved = start.copy()
        moved[car.model.joints[car.figure.roots[f"{who}/root"]].idx_q] += 1.0
        assert effort.value(state.update(moved)) == pytest.approx(least)
    bent = car.figure.with_joints(start, {"anna/right_elbow_flexion": math.radians(20.0) + 0.5})
    assert effort.value(state.update(bent)) == pytest.approx(0.25)


@lru_cache(maxsize=3)
def lifted(style: str) -> tuple[wb.Figure, np.ndarray]:
    """A man at a box on the floor."""
    figure = wb.load("human")
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    goals = [wb.Point(f"{side}_palm", (0.45, 0.2 * sign, 0.16)) for side, sign in (("left", 1.0), ("right", -1.0))]
    measures = [wb.Effort(), wb.tasks.Rhythm(style=style), wb.tasks.Stance()]  # type: ignore[arg-type]
    solution = wb.solve(wb.Problem(scene, goals=goals, constraints=[wb.Stand("floor")], measures=measures))
    assert solution.solved
    return figure, solution.q


def stooped(style: str) -> float:
    """Share of the lowering of the shoulders that is not of the hips: 0 in a full squat, 1 in a full stoop."""
    figure, q = lifted(style)
    upright = figure.posture("standing")
    high = {
        part: [figure.placement(posture, part).translation[2] for posture in (upright, q)]
        for part in ("right_shoulder", "right_hip")
    }
    down = {part: before - after for part, (before, after) in high.items()}
    return float(1.0 - down["right_hip"] / down["right_shoulder"])


def test_styles_of_lifting_are_a_choice() -> None:
    """People have 0.9 and more in a stoop, and least in a squat (Schmid et al. 2022, Archives of Physiotherapy 12:8).

    Who does as he likes is between (Burgess-Limerick et al. 1995, Human Factors 37(2)).
    """
    assert stooped("stoop") > 0.88
    assert stooped("squat") < 0.5 < stooped("free") < stooped("stoop")


def test_who_squats_bends_the_back_less() -> None:
    """25.1 degrees of lordosis are lost in a squat and 35.9 in a stoop (von Arx et al. 2021): 0.70."""
    bent = {style: sum(lifted(style)[0].joint_values(lifted(style)[1])[f"spine{k}_flexion"] for k in (1, 2, 3))
            for style in ("stoop", "squat")}  # fmt: skip
    assert bent["squat"] < 0.7 * bent["stoop"]


@pytest.mark.parametrize("at", [(0.45, -0.2, 0.05), (0.6, -0.1, 0.3)])
def test_a_free_arm_hangs_where_the_trunk_bends(scene: wb.Scene, at: tuple[float, float, float]) -> None:
    figure = scene.figure
    goals = [wb.Point("right_index_tip", at)]
    held = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    found = []
    for measures in (None, [wb.Effort(), wb.tasks.Rhythm()]):
        problem = wb.Problem(scene, "standing", goals=goals, constraints=held, measures=measures)
        solution = wb.solve(problem)
        assert solution.solved
        shoulder, elbow = (figure.placement(solution.q, f"left_{end}").translation for end in ("shoulder", "elbow"))
        arm = (elbow - shoulder) / np.linalg.norm(elbow - shoulder)
        found.append(float(np.degrees(np.arccos(-arm[2]))))
    # By an effort that counts from the trunk it points back, as far as the trunk is bent.
    assert found[1] > 60.0
    assert found[0] < 40.0


def test_an_arm_that_a_term_moves_or_a_seat_carries_does_not_hang(scene: wb.Scene) -> None:
    held = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    right, left = (wb.Point(f"{side}_palm", (0.4, 0.1, 1.0)) for side in ("right", "left"))
    named = {
        ("left",): ([right], held),
        ("left", "right"): ([], held),
        (): ([right, left], held),
        ("right",): ([wb.Relative("left_palm", "pelvis", (0.2, 0.2, 0.2))], [*held, wb.Freeze("right_leg")]),
    }
    for arms, (goals, constraints) in named.items():
        problem = wb.Problem(scene, "standing", goals=goals, constraints=constraints)
        arms = tuple(f"{arm}_upper_arm" for arm in arms)
        assert [tuple(one.arms) for one in problem.measures if isinstance(one, Hang)] == ([arms] if arms else [])
    for constraints in ([*held, wb.Freeze("left_arm", "right_arm")], [wb.Hold("pelvis")]):
        problem = wb.Problem(scene, "standing", constraints=constraints)
        assert not any(isinstance(one, Hang) for one in problem.measures)


def test_hang_is_the_angle_from_where_arms_hang(scene: wb.Scene) -> None:
    figure = scene.figure
    q = figure.with_joints(figure.posture("standing"), {"left_shoulder_flexion": 0.9, "spine2_flexion": 0.2})
    term = Hang(["left_upper_arm"]).resolve(scene, q)
    upright, here = (figure.placement(one, "left_upper_arm").rotation for one in (figure.posture("standing"), q))
    cosine = float((here @ upright.T @ np.array((0.0, 0.0, 1.0)))[2])
    assert term.value(scene.state(q)) == pytest.approx(np.arccos(cosine) ** 2, rel=1e-9)
    assert wb.check_derivatives(Hang(), scene, q).agrees


def test_a_head_is_level_while_it_nods_and_turns(scene: wb.Scene) -> None:
    figure = scene.figure
    standing = figure.posture("standing")
    term = LevelHead().resolve(scene, standing)
    nods = figure.with_joints(standing, {"neck1_rotation": 0.5, "spine2_flexion": 0.0})
    assert term.value(scene.state(nods)) == pytest.approx(0.0, abs=1e-12)
    tilted = figure.with_joints(standing, {"neck1_lateral": 0.4})
    assert term.value(scene.state(tilted)) == pytest.approx(np.sin(0.4) ** 2, rel=1e-9)
    step = 1e-6 * np.eye(figure.model.nv)
    ahead, back = ([term.value(scene.state(pin.integrate(figure.model, tilted, sign * way))) for way in step]
                   for sign in (1.0, -1.0))  # fmt: skip
    np.testing.assert_allclose(term.gradient(scene.state(tilted)), np.subtract(ahead, back) / 2e-6, atol=1e-6)
