"""The examples solve what they say, judged by Pinocchio and coal alone, and their task files say the same."""

from __future__ import annotations

import itertools
import runpy
import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from types import ModuleType
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.motion import test_retargeting
from tests.motion.test_things import gaps
from tests.saved_page import unpacked
from wholebody.assessment.motion import assess_motion

Example = Callable[[str], ModuleType]

SINGLE = ("shelf", "carry_box_past_table", "behind_the_back", "look_and_touch_overhead", "robot_arm_among_obstacles")
OTHERS = (
    *("chair", "console_two_people", "hand_on_table", "avatar_two_arms"),
    *("sit_on_chair", "four_bar", "assemble_shelf", "free_a_clip"),
    *("four_bar_among_obstacles", "scissor_lift", "carry_together", "take_a_seat", "lift_a_box", "push_a_cart"),
    *("reach_map", "study_of_people", "own_method", "two_arms_one_bar", "person_and_arm"),
    *("boundary_people", "branches_of_an_arm", "dominoes", "driver", "hold_a_pole", "plan_for_an_arm"),
    *("lift_retargeted", "catch_a_ball"),
)
REST_ON = {("pelvis", "pouch"), ("lower_lumbar", "pouch")}  # what the figure wears lies on it


def places(problem: wb.Problem, q: Any) -> Callable[[str], Any]:
    """Placement of a frame by name, by Pinocchio alone."""
    model = problem.scene.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return lambda name: data.oMf[model.getFrameId(name)]


def deepest(problem: wb.Problem, q: Any) -> tuple[float, str]:
    """Least signed distance of the figure to things and of what it carries to all others, pair by pair in coal."""
    scene = problem.scene
    model, pieces, owners = scene.model, scene.geometry.geometryObjects, scene.piece_owner
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    places = [data.oMi[piece.parentJoint] * piece.placement for piece in pieces]
    turned = [coal.Transform3s(place.rotation, place.translation) for place in places]
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    least, where = np.inf, ""
    for second, thing in enumerate(pieces):
        if owners[second] in scene.figure.segments:
            continue
        for first, other in enumerate(pieces[:second]):
            pair = owners[first], owners[second]
            if thing.parentJoint == other.parentJoint == 0 or pair in REST_ON or pair[0] == pair[1]:
                continue
            result.clear()
            distance = coal.distance(other.geometry, turned[first], thing.geometry, turned[second], request, result)
            if distance < least:
                least, where = distance, f"{pair[0]} and {pair[1]}"
    return least, where


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Callable[[ModuleType], tuple[wb.Problem, wb.Solution]]:
    """Return a function: an example -> its problem and solution; each runs once for all tests, and writes nothing."""
    found: dict[str, tuple[wb.Problem, wb.Solution]] = {}

    def ask(module: ModuleType) -> tuple[wb.Problem, wb.Solution]:
        if module.__name__ not in found:
            out = tmp_path_factory.mktemp("example")
            with redirect_stdout(StringIO()) as said:
                found[module.__name__] = module.build(), module.main(out=out, pictures=False)
            assert "solved" in said.getvalue()
            assert not list(out.iterdir())
        return found[module.__name__]

    return ask


@pytest.mark.parametrize("name", SINGLE)
def test_solved_and_nothing_inside_anything(name: str, example: Example, solved: Any) -> None:
    problem, solution = solved(example(name))
    judged = wb.assess(problem, solution.q)
    assert solution.status == "solved"
    assert judged.met(1e-5)
    assert judged.holds(1e-5)
    assert judged.penetration < 1e-6
    least, where = deepest(problem, solution.q)
    assert least > -1e-6, where


@pytest.mark.parametrize("name", [*SINGLE, "sit_on_chair", "take_a_seat"])
def test_task_file_says_the_same(name: str, example: Example, root: Path) -> None:
    problem, task = example(name).build(), wb.read_task(root / "examples" / "tasks" / f"{name}.toml").problem
    assert np.array_equal(task.start, problem.start)
    assert task.scene.piece_names == problem.scene.piece_names
    for ours, theirs in zip(problem.scene.geometry.geometryObjects, task.scene.geometry.geometryObjects, strict=True):
        assert ours.placement.isApprox(theirs.placement)
        assert ours.geometry == theirs.geometry
    assert np.array_equal(task.clearances, problem.clearances)
    assert str(task.goals) == str(problem.goals)
    assert str(task.measures) == str(problem.measures)
    assert sorted(map(str, task.constraints)) == sorted(map(str, problem.constraints))


@pytest.mark.parametrize("name", SINGLE[:4])
def test_people_stand_on_their_feet(name: str, example: Example, solved: Any) -> None:
    problem, solution = solved(example(name))
    q = solution.q
    before, after = places(problem, problem.start), places(problem, q)
    for side in ("left", "right"):
        assert np.abs(pin.log6(before(f"{side}_sole").actInv(after(f"{side}_sole"))).vector).max() < 1e-5
    model = problem.scene.model
    x, y, _ = pin.centerOfMass(model, model.createData(), q)
    assert after("left_heel").translation[0] < x < after("left_toe_tip").translation[0]
    assert after("right_sole").translation[1] - 0.06 < y < after("left_sole").translation[1] + 0.06


def test_shelf_hand_is_between_the_boards(example: Example, solved: Any) -> None:
    module = example("shelf")
    problem, solution = solved(module)
    place = places(problem, solution.q)
    np.testing.assert_allclose(place("right_index_tip").translation, module.PLACE, atol=1e-5)
    assert 1.06 < place("right_wrist").translation[2] < 1.34
    gaze = place("gaze")
    towards = np.array(module.PLACE) - gaze.translation
    assert gaze.rotation[:, 0] @ towards / np.linalg.norm(towards) > 1.0 - 1e-9


def test_box_is_level_between_both_palms(example: Example, solved: Any) -> None:
    module = example("carry_box_past_table")
    problem, solution = solved(module)
    place = places(problem, solution.q)
    right, left = place("right_palm"), place("left_palm")
    np.testing.assert_allclose(right.act(np.array(module.MIDDLE)), module.PLACE, atol=1e-5)
    assert -right.rotation[2, 1] > 1.0 - 1e-9
    assert right.rotation[:, 2] @ left.rotation[:, 2] < -1.0 + 1e-9
    assert np.linalg.norm(right.translation - left.translation) == pytest.approx(module.SIZE[2] + 2e-3, abs=1e-5)


def test_the_arm_goes_round_the_body(example: Example, solved: Any) -> None:
    module = example("behind_the_back")
    problem, solution = solved(module)
    place = places(problem, solution.q)
    pelvis = place("pelvis")
    np.testing.assert_allclose(pelvis.actInv(place("right_index_tip")).translation, module.BUCKLE, atol=1e-5)
    assert pelvis.actInv(place("right_wrist")).translation[0] < -0.1
    assert pelvis.actInv(place("right_elbow")).translation[1] < -0.1


def test_gripper_straddles_the_part(example: Example, solved: Any) -> None:
    module = example("robot_arm_among_obstacles")
    problem, solution = solved(module)
    place = places(problem, solution.q)
    sides = [place(f"{side}_finger").translation[1] for side in ("left", "right")]
    assert max(sides) > 0.14 + 0.025
    assert min(sides) < 0.14 - 0.025
    assert place("left_finger").translation[0] > 0.5


def test_the_console_is_in_reach_of_the_large_man_only(example: Example, tmp_path: Path) -> None:
    solutions = example("console_two_people").main(out=tmp_path, pictures=False)
    assert len(solutions) == 6
    missed = {who_what for who_what, solution in solutions.items() if solution.status != "solved"}
    assert missed == {("small woman", "breaker")}
    assert solutions["small woman", "breaker"].status == "unreachable"
    assert 0.02 < solutions["small woman", "breaker"].assessment.goal_error < 0.2
    for solution in solutions.values():
        assert solution.assessment.holds(1e-5)


def sits(problem: wb.Problem, solution: wb.Solution) -> None:
    """Assert that a person sits on the chair with the hands on the thighs."""
    assert solution.status == "solved"
    assert solution.assessment.holds(1e-5)
    least, where = deepest(problem, solution.q)
    assert least > -1e-6, where
    touched = {problem.scene.piece_owner[a] for a, _ in problem.scene.contacts(solution.q, within=0.002).pair}
    assert {"pelvis", "left_foot", "right_foot"} <= touched
    place = places(problem, solution.q)
    for side in ("left", "right"):
        thigh = place(f"{side}_thigh").actInv(place(f"{side}_palm")).translation
        np.testing.assert_allclose(thigh, [0.067, 0.0, -0.34], atol=1e-5)


def test_chair_of_boxes(example: Example, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.setenv("WHOLEBODY_DATA", str(tmp_path))
    module = example("chair")
    solution = module.main(out=tmp_path, pictures=False)
    assert "made of boxes" in capsys.readouterr().out
    sits(module.build(), solution)


@pytest.mark.parametrize("name", ["hand_on_table", "avatar_two_arms"])
def test_what_is_tracked_goes_in_and_what_is_shown_does_not(
    name: str, example: Example, tmp_path: Path, capsys: Any
) -> None:
    module = example(name)
    recording = module.main(out=tmp_path, pictures=False)
    scene, _ = module.build()
    problem = wb.Problem(scene)
    assert min(deepest(problem, q)[0] for q in recording.tracked[::4]) < -0.02
    for q in recording.q[::4]:
        least, where = deepest(problem, q)
        assert least > -1e-4, where
    np.testing.assert_allclose(recording.q[-1], recording.tracked[-1], atol=1e-3)
    assert not any(recording.notes)
    assert "0 frames pass" in capsys.readouterr().out
    assert not list(tmp_path.iterdir())


def test_a_person_is_dragged_down_onto_a_chair(example: Example, tmp_path: Path, capsys: Any) -> None:
    module = example("sit_on_chair")
    module.FRAMES = 30  # of a drag; the example has more to look at
    drags = module.main(out=tmp_path, pictures=False)
    problem = module.build()
    place = places(problem, problem.start)
    soles = [place(f"{side}_sole") for side in ("left", "right")]
    assert set(drags) == {"newton", "qp"}
    for dragged in drags.values():
        assert dragged.end.status == "solved"
        assert dragged.end.assessment.met(1e-5)
        depth = assess_motion(problem.scene, dragged.q, dragged.dt).depth
        assert depth.max() < 1e-4
        lowest = np.inf
        for number, q in enumerate(dragged.q):
            if number % 10 == 0:
                least, where = deepest(problem, q)
                assert least > -1e-4, where
            place = places(problem, q)
            lowest = min(lowest, place("pelvis").translation[2])
            for side, sole in zip(("left", "right"), soles, strict=True):
                assert np.linalg.norm(place(f"{side}_sole").translation - sole.translation) < 5e-4
        assert lowest > module.SEATED[2] - 1e-3  # although the goal went 20 mm lower
        for before, after in itertools.islice(itertools.pairwise(dragged.q), 0, None, 3):
            assert problem.scene.sweep(before, after, 2e-4) is None  # feet dip by 0.05 mm where straight knees bend
        gaps = {
            tuple(problem.scene.piece_owner[piece] for piece in pair)
            for pair in problem.scene.contacts(dragged.q[-1], within=1e-3).pair
        }
        assert ("pelvis", "seat") in gaps
        knee = problem.scene.figure.joint_values(dragged.q[-1])["left_knee_flexion"]
        assert abs(knee - np.pi / 2) < 0.1
    assert "newton" in capsys.readouterr().out
    assert not list(tmp_path.iterdir())


def test_a_four_bar_linkage_turns_as_its_closed_form_says(example: Example, tmp_path: Path, capsys: Any) -> None:
    module = example("four_bar")
    places = module.main(out=tmp_path, pictures=False)
    assert len(places) == module.STEPS + 1
    for place in places:  # the loop closes, and the joints' axes stay parallel: from the placements alone
        tip = place["crank"].act(np.array((module.CRANK, 0.0, 0.0)))
        end = place["coupler"].act(np.array((module.COUPLER, 0.0, 0.0)))
        np.testing.assert_allclose(tip, place["coupler"].translation, atol=1e-9)
        np.testing.assert_allclose(end, place["rocker"].act(np.array((module.ROCKER, 0.0, 0.0))), atol=1e-9)
        np.testing.assert_allclose(place["rocker"].translation, (module.GROUND, 0.0, 0.0), atol=1e-9)
        np.testing.assert_allclose(place["rocker"].rotation[:, 1], (0.0, 1.0, 0.0), atol=1e-9)
    for angle in np.linspace(0.0, 2.0 * np.pi, 7):  # the closed form closes the loop
        coupler, rocker = module.closed_form(angle)
        tip = np.array([module.CRANK * np.cos(angle), module.CRANK * np.sin(angle)])
        end = tip + module.COUPLER * np.array([np.cos(coupler), np.sin(coupler)])
        other = np.array([module.GROUND, 0.0]) + module.ROCKER * np.array([np.cos(rocker), np.sin(rocker)])
        np.testing.assert_allclose(end, other, atol=1e-12)
        place = places[round(angle / (2.0 * np.pi) * module.STEPS)]
        if abs(angle / (2.0 * np.pi) * module.STEPS % 1.0) < 1e-9:
            assert module.angle_of(place["rocker"]) == pytest.approx(rocker, abs=1e-8)
    assert "off their closed form" in capsys.readouterr().out


def test_a_shelf_is_assembled_part_by_part(example: Example, tmp_path: Path) -> None:
    module = example("assemble_shelf")
    module.FRAMES = 12  # of a drag; the example has more to look at
    stages, motion = module.main(out=tmp_path, pictures=False)
    order = (*module.LEVELS, "right side")
    for number, (before, after) in enumerate(itertools.pairwise(stages)):
        for other in ("left side", *order[:number]):  # what is in place stays
            assert before[other].isApprox(after[other], 1e-6)
    for name, level in module.LEVELS.items():
        expected = pin.SE3(np.eye(3), np.array((0.0, 0.0, level + 0.5 * module.THICK)))
        assert stages[-1][name].isApprox(expected, 1e-5)
    y = -0.5 * (module.WIDTH - module.THICK)
    assert stages[-1]["right side"].isApprox(pin.SE3(np.eye(3), np.array((0.0, y, 0.5 * module.HEIGHT))), 1e-5)
    names, boxes = list(module.LOOSE), {name: coal.Box(*module.BOARD) for name in module.LEVELS}
    boxes |= {name: coal.Box(*module.SIDE) for name in ("left side", "right side")}
    for q in motion[::3]:  # no two boards are in each other, by coal alone
        places = [pin.XYZQUATToSE3(place) for place in q.reshape(-1, 7)]
        for (a, first), (b, second) in itertools.combinations(zip(names, places, strict=True), 2):
            ends = (coal.Transform3s(place.rotation, place.translation) for place in (first, second))
            one, other = ends
            found = coal.distance(boxes[a], one, boxes[b], other, coal.DistanceRequest(), coal.DistanceResult())
            assert found > -1e-4, f"{a} and {b}"


def test_a_four_bar_among_obstacles_stops_where_geometry_says(example: Example, tmp_path: Path, capsys: Any) -> None:
    module = example("four_bar_among_obstacles")
    made, _ = module.main(out=tmp_path, pictures=False)
    face = made.placement("slider").translation[0] - 0.5 * module.SLIDER[0]
    assert face == pytest.approx(module.slider_end(), abs=5e-4)
    rocker = made.placement("rocker")
    assert module.angle_of(rocker) == pytest.approx(module.rocker_at_post(), abs=1e-4)
    axis = rocker.act(np.array((module.ROCKER, 0, 0))) - rocker.translation  # the rod's distance from the post's axis
    away = np.array((module.POST[0] - module.GROUND, 0.0, module.POST[1]))
    distance = np.linalg.norm(np.cross(away, axis)) / np.linalg.norm(axis)
    assert distance == pytest.approx(module.RADIUS + module.POST_RADIUS, abs=1e-5)
    assert capsys.readouterr().out.count("passes through anything: True") == 2


def test_a_scissor_lift_stops_at_its_load_limit_and_at_a_beam(example: Example, tmp_path: Path) -> None:
    module = example("scissor_lift")
    module.FRAMES = 2  # of a drag; the example has more to look at
    for load, (low, high) in module.main(out=tmp_path, pictures=False).items():
        angle = np.arcsin(low / (module.STAGES * module.BAR))
        assert module.STAGES * load * module.GRAVITY / np.tan(angle) == pytest.approx(module.STRONGEST, rel=1e-3)
        assert high == pytest.approx(module.BEAM - module.CRATE[2] - module.THICK, abs=2e-4)


def test_two_people_carry_a_box_over_a_post(example: Example, tmp_path: Path) -> None:
    module = example("carry_together")
    module.FRAMES = 6  # of a drag; the example has more to look at
    scene, postures, solution = module.main(out=tmp_path, pictures=False)
    assert solution.status == "solved"
    figure, box = scene.figure, scene.objects["box"].placement
    place = figure.placement(solution.q, module.LEADER) * box
    np.testing.assert_allclose(place.translation, (0.5 * module.APART, module.SIDEWAYS, module.LOW), atol=1e-3)
    for q in postures:
        at = figure.placement(q, module.LEADER) * box
        for palm in module.PALMS:  # where they took hold
            seen = at.actInv(figure.placement(q, palm).translation)
            assert abs(abs(seen[1]) - 0.5 * module.BOX[1] - module.AWAY) < 3e-3  # a frame's steps are long
        for foot in ("ann/left_sole", "ben/right_sole"):
            assert abs(figure.placement(q, foot).translation[2]) < 1e-3
    heights = [scene.contacts(q, 0.0).distance.min(initial=0.0) for q in postures]
    assert min(heights) > -1e-4


@pytest.mark.parametrize("name", ["two_arms_one_bar", "person_and_arm"])
def test_two_figures_meet(example: Example, name: str, tmp_path: Path) -> None:
    problem, solution = example(name).main(out=tmp_path, pictures=False)
    assert solution.status == "solved"
    assert wb.assess(problem, solution.q).holds(1e-5)
    figure = problem.scene.figure
    if name == "two_arms_one_bar":  # both grips where they were at the bar
        left, right = (figure.placement(solution.q, f"{side}/grip") for side in ("left", "right"))
        np.testing.assert_allclose(left.actInv(right.translation), (0.22, 0.0, 0.0), atol=1e-3)
    else:
        touching = {frozenset((problem.scene.piece_owner[a], problem.scene.piece_owner[b])) for a, b in
                    problem.scene.contacts(solution.q, 1e-4).pair}  # fmt: skip
        assert frozenset(("anna/right_hand", "part")) in touching


def test_a_method_of_ones_own_reaches(example: Example, capsys: Any) -> None:
    example("own_method").main(pictures=False)
    assert capsys.readouterr().out.count(": solved ") == 2


def test_a_box_does_not_tip_between_palms(example: Example) -> None:
    """The line from palm to palm goes through its centre of mass; palms were at the edges, 0.12 m away."""
    box = example("lift_a_box")
    problem = box.build()
    at = places(problem, wb.solve(problem).q)
    middle = 0.5 * (at("left_palm").translation + at("right_palm").translation)
    assert middle == pytest.approx(box.ON_TABLE, abs=1e-3)


def test_takes_a_seat_and_lifts_a_box(example: Example, solved: Any, tmp_path: Path) -> None:
    problem, solution = solved(example("take_a_seat"))
    assert solution.status == "solved"
    assert wb.assess(problem, solution.q).holds(1e-5)
    assert deepest(problem, solution.q)[0] > -1e-5
    box = example("lift_a_box")
    taken, lifted = box.main(out=tmp_path, pictures=False)
    assert (taken.status, lifted.status) == ("solved", "solved")
    higher, _ = box.lift(taken, box.build())
    left, right = (places(higher, lifted.q)(f"{side}_palm").translation for side in ("left", "right"))
    assert min(left[2], right[2]) > box.LIFTED[2] - 0.14
    assert np.linalg.norm(left - right) < 0.42


@pytest.mark.parametrize("legs", [0.37, 0.347])
def test_a_woman_with_short_legs_takes_a_lower_seat(example: Example, legs: float) -> None:
    """Of 40 drawn women nine, with knee hollows up to 0.37 m over the soles, found no posture on a seat of 0.38 m."""
    proportions = {"popliteal_height": legs, "buttock_popliteal_length": 0.46}
    problem = example("take_a_seat").build(wb.load("human", sex="female", stature=1.53, proportions=proportions))
    solution = wb.solve(problem)
    assert solution.status == "solved"
    seat = problem.scene.objects["seat"].placement.translation[2] + 0.02
    assert seat <= legs + 1e-9  # feet flat on the floor, at the height of the hollow of the knee


def test_who_lifts_a_box_lifts_with_both_arms_alike(example: Example) -> None:
    """Scene, box and goals are the same on both sides; arms of short and tall women differed by up to 132 degrees."""
    box = example("lift_a_box")
    for percentile in (3,):
        problem = box.build(figure := wb.load("human", sex="female", percentile=percentile))
        _, lifted = box.lift(wb.solve(problem), problem)
        assert lifted.status == "solved"
        angles = figure.joint_values(lifted.q)
        for name in figure.groups["left_arm"]:
            assert abs(angles[name] - angles[name.replace("left_", "right_")]) < np.radians(10.0), (percentile, name)


def test_who_pushes_a_cart_leans_into_it(example: Example, tmp_path: Path) -> None:
    """The ground presses between heel and toes only in the posture that was searched with the force."""
    cart = example("push_a_cart")
    pressed = []
    for solution, pushing in zip(cart.main(out=tmp_path, pictures=False), (True, False), strict=True):
        problem = cart.build(pushing)
        assert solution.status == "solved"
        assert wb.assess(problem, solution.q).holds(1e-5)
        assert deepest(problem, solution.q)[0] > -1e-5
        model, place = problem.scene.model, places(problem, solution.q)
        middle = pin.centerOfMass(model, model.createData(), solution.q)[0]
        height = np.mean([place(f"{side}_palm").translation[2] for side in ("left", "right")])
        weight = 9.81 * sum(one.mass for one in list(model.inertias)[1:])
        pressed.append(middle - cart.PUSH * height / weight - place("right_heel").translation[0])
    assert pressed[0] > 0.0 > pressed[1]
    assert not list(tmp_path.iterdir())


def test_every_example_is_tested_and_listed(root: Path) -> None:
    folder = root / "examples"
    scripts = {path.stem for path in folder.glob("*.py")} - {"presenting"}
    assert scripts == {*SINGLE, *OTHERS}
    assert {path.stem for path in (folder / "tasks").glob("*.toml")} == {*SINGLE, "sit_on_chair", "take_a_seat"}
    table = (folder / "README.md").read_text(encoding="utf-8")
    assert all(f"]({name}.py)" in table for name in scripts)


def test_runs_as_a_script_from_anywhere(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    script = root / "examples" / "robot_arm_among_obstacles.py"
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(script.parent)  # as python does
    monkeypatch.setattr(sys, "argv", [str(script), "--no-pictures"])
    runpy.run_path(str(script), run_name="__main__")
    assert "solved" in capsys.readouterr().out
    assert not list(tmp_path.iterdir())


def test_ends_in_a_picture_and_a_page(example: Example, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a picture shows tests of `view` see."""
    drawn: list[Path] = []
    monkeypatch.setattr(wb.Viewer, "picture", lambda viewer, path: drawn.append(path))
    example("robot_arm_among_obstacles").main(out=tmp_path / "made", pictures=True)
    assert "post" in unpacked(tmp_path / "made" / "robot_arm_among_obstacles.html")
    assert drawn == [tmp_path / "made" / "robot_arm_among_obstacles.png"]


def test_a_clip_with_a_pack_is_free_in_every_frame(
    example: Example, tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Arms swing where there is no recording; the freed clip is judged by coal on all pairs."""
    module = example("free_a_clip")
    monkeypatch.setenv("WHOLEBODY_DATA", str(tmp_path))
    swing = module.swing
    module.swing = lambda figure: swing(figure)[:21]  # the example has more to look at
    freed = module.main(out=tmp_path, pictures=False)
    assert freed.report.solved
    assert freed.report.frames_changed > 10
    scene = wb.Scene(freed.clip.figure)
    for piece in wb.motion.equipment("pack", freed.clip.figure):
        piece.attach(scene)
    assert assess_motion(scene, freed.clip.q, freed.clip.dt).depth.max() <= 1e-4
    assert "arms swing" in capsys.readouterr().out
    assert module.chart(freed.clip, freed.clip, "pack", tmp_path / "curves.png").stat().st_size > 10_000


def test_a_reach_map_knows_what_is_far_and_what_is_in_the_way(example: Example, tmp_path: Path) -> None:
    module = example("reach_map")
    found = module.main(out=tmp_path, pictures=False, step=0.45)
    assert 0.1 < found.share < 1.0
    problem = module.build()
    for place in zip(*np.nonzero(found.reached), strict=True):
        tip = places(problem, found.q[place])("right_index_tip").translation
        np.testing.assert_allclose(tip, (found.x[place[0]], found.y[place[1]], found.z[place[2]]), atol=2e-5)
        least, where = deepest(problem, found.q[place])
        assert least > -1e-6, where
    assert not list(tmp_path.iterdir())


def test_a_study_finds_that_the_tall_man_reaches_more(example: Example, tmp_path: Path) -> None:
    module = example("study_of_people")
    module.HEIGHTS = {"high": module.HEIGHTS["high"]}  # both reach the others
    records = module.main(out=tmp_path, pictures=False)
    left = {one.name: one.goal_error for one in records}
    assert left["small woman, high"] > 0.01
    assert all(one.solved for one in records if one.factors["person"] == "tall man")
    assert not list(tmp_path.iterdir())


def test_a_planned_motion_is_free_between_its_ends(example: Example, tmp_path: Path) -> None:
    module = example("plan_for_an_arm")
    found = module.main(out=tmp_path, pictures=False)
    assert found.solved
    scene, first, last = module.build()
    np.testing.assert_allclose(found.clip.q[[0, -1]], [first.q, last.q], atol=1e-9)
    assert assess_motion(scene, found.clip.q, found.clip.dt).depth.max() <= 1e-4


def test_a_lift_keeps_feet_on_the_floor_and_hands_at_the_crate(example: Example, tmp_path: Path) -> None:
    module = example("lift_retargeted")
    module.FRAMES, module.RATE = 20, 10.0  # the example has more to look at
    clip = module.main(out=tmp_path, pictures=False)
    moves = {name: [pin.XYZQUATToSE3(at) for at in track] for name, track in clip.things.items()}
    assert assess_motion(module.build(clip.things["crate"]), clip.q, clip.dt, moves).depth.max() <= 1e-4
    for side in ("left", "right"):
        assert np.abs(gaps(clip, side, "crate", coal.Box(*module.CRATE))[:, 0]).max() < 1e-3
        assert np.ptp(test_retargeting.places(clip, f"{side}_heel"), axis=0).max() < 1e-3
    assert not list(tmp_path.iterdir())


def test_branches_of_an_arm_differ_and_reach_one_place(example: Example, tmp_path: Path) -> None:
    module = example("branches_of_an_arm")
    problem, found = module.build(), module.main(out=tmp_path, pictures=False)
    assert len(found) == 4
    for answer in found:
        np.testing.assert_allclose(places(problem, answer.q)("grip").translation, (0.45, 0.20, 0.38), atol=1e-5)
    for one, other in itertools.combinations(found, 2):
        assert np.abs(one.q - other.q).max() > 0.4


def test_every_domino_falls(example: Example, tmp_path: Path) -> None:
    module = example("dominoes")
    module.COUNT, build = 3, module.build  # the example has more to look at
    module.build = lambda: (lambda world, way: (world, way[:70]))(*build())
    assert module.main(out=tmp_path, pictures=False) == 3


def test_the_ball_rests_in_the_arms_that_caught_it(
    example: Example, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module, frames, step = example("catch_a_ball"), list[Any](), wb.World.step
    build = module.build
    module.build = lambda: (lambda world, way: (world, way[:90]))(*build())
    monkeypatch.setattr(wb.World, "step", lambda world, q: (frames.append(step(world, q)), frames[-1])[1])
    assert module.main(out=tmp_path, pictures=False) < 1e-3  # m/s
    flown = [np.array(frame.placements["ball"].translation) for frame in frames]
    assert np.linalg.norm(flown[-1] - module.FROM) > 1.5
    # in the air it falls with g, and at last the person alone bears its weight, well above the floor
    assert np.diff(flown[:20], 2, axis=0) * 60**2 == pytest.approx(np.tile((0.0, 0.0, -9.81), (18, 1)), abs=1e-6)
    assert np.linalg.norm(np.diff(flown[-20:], axis=0), axis=1).max() < 1e-3 / 60.0
    assert frames[-1].impulses["ball"] == pytest.approx((0.0, 0.0, module.MASS * 9.81 / 60.0), abs=1e-5)
    assert flown[-1][2] > 1.0
    assert max(frame.deepest for frame in frames) < 1e-4


@pytest.mark.parametrize("name", ["driver", "hold_a_pole"])
def test_hands_hold_what_they_are_told(name: str, example: Example) -> None:
    problem = example(name).build()
    solution = wb.solve(problem, wb.methods.QP(measures=False))
    assert solution.solved
    least, where = deepest(problem, solution.q)
    assert least > -1e-5, where


def test_the_men_at_the_edge_differ_as_they_are_told(example: Example) -> None:
    people = wb.boundary(0.95, example("boundary_people").DIMENSIONS, sex="male")
    wide, middle, narrow = (
        people[f"male boundary {k}"]["proportions"]["hip_breadth_sitting"] for k in example("boundary_people").CHOSEN
    )
    assert narrow < middle - 0.03 < wide - 0.06  # m
