"""What a task file becomes is what the same calls in Python make."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.state import State
from wholebody.taskfile.result import describe
from wholebody.taskfile.schema import CONSTRAINTS, GOALS, MEASURES, TABLES

TURNED = [0.0, 0.0, 0.7071067811865476, 0.7071067811865476]

EVERYTHING = Path(__file__).parents[1] / "data" / "tasks" / "everything.toml"


@pytest.fixture(scope="module")
def everything() -> wb.taskfile.Task:
    return wb.read_task(EVERYTHING)


def test_every_type_of_the_schema_is_in_the_example() -> None:
    text = EVERYTHING.read_text()
    for forms in (GOALS, CONSTRAINTS, MEASURES):
        for name in forms:
            assert f'type = "{name}"' in text
    for name in TABLES["object"].forms or {}:
        assert f'shape = "{name}"' in text


def test_scene_and_start(everything: wb.taskfile.Task) -> None:
    problem = everything.problem
    figure = problem.scene.figure
    assert everything.title == "everything"
    assert (figure.detail, figure.model.nv) == ("spheres", 55)
    assert problem.clearance == 0.004
    assert problem.touching == (("right_hand", "ball"),)
    np.testing.assert_allclose(problem.start[:7], [0.1, 0.0, 0.9, *TURNED])
    assert figure.joint_values(problem.start)["left_elbow_flexion"] == 0.5
    objects = problem.scene.objects
    assert [type(thing.shape).__name__ for thing in objects.values()] == [
        "Box", "Sphere", "Capsule", "Ellipsoid", "Cylinder", "Torus", "HalfSpace", "Hull", "Mesh", "Box",
    ]  # fmt: skip
    assert objects["pack"].segment == "thorax"
    assert objects["box"].color == (1.0, 0.0, 0.0, 1.0)
    np.testing.assert_allclose(objects["drum"].color, (70 / 255, 130 / 255, 180 / 255, 1.0))
    np.testing.assert_allclose(objects["wheel"].color, (128 / 255, 1.0, 0.0, 64 / 255))
    np.testing.assert_allclose(objects["box"].placement.rotation @ [1, 0, 0], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(objects["rod"].placement.translation, [2, 1, 0])
    np.testing.assert_allclose(np.abs(objects["tetrahedron"].shape.vertices).max(), 1.0)
    assert everything.view == ((1.0, 2.0, 3.0), (0.0, 0.0, 1.0), ("box",))


def test_terms_are_those_that_python_makes(everything: wb.taskfile.Task) -> None:
    problem = everything.problem
    turn = pin.Quaternion(np.array(TURNED)).matrix()
    held = [wb.Force("left_palm", (0.0, 0.0, -49.0))]
    same = wb.Problem(
        problem.scene,
        problem.start,
        goals=[
            wb.Point("right_index_tip", (0.5, 0, 1), offset=(0, 0, 0.1), weight=2.0),
            wb.Frame("left_palm", pin.SE3(turn, np.array([0.5, 0, 1.0]))),
            wb.Orientation("right_palm", TURNED),
            wb.Axis("gaze", (1, 0, 0), toward=(3, 0, 0)),
            wb.CenterOfMass((0, 0, 1), axes="xy"),
            wb.Relative("left_palm", "right_palm", (0, 0.3, 0), orientation=False),
            wb.Posture("sitting", joints=["left_leg"]),
            wb.Touch("right_index_tip", "box"),
            wb.tasks.Lean("rod", side=(1, 0, 0)),
            wb.Sit("box", "rod"),
            wb.Grasp("left", "box", side=(0, 1, 0)),
        ],
        constraints=[
            wb.Hold("left_foot", orientation=False),
            wb.Plane("left_elbow", (0, 1, 0), side="above"),
            wb.Balance(("left_foot", "right_foot"), margin=0.01),
            wb.Freeze("lower_body", "root"),
            wb.tasks.ReachCones(["right_shoulder"]),
            wb.tasks.RangeOfMotion(["neck", "left_hamstrings"]),
            wb.Stand("ground", feet=["left_foot"], balance=False),
            wb.Grasp("right", "rod", "power"),
            wb.ergonomics.LoadedBalance(held, margin=0.02),
            wb.ergonomics.StrengthLimit(held, strength=wb.motion.Strength(25, "female"), standing=False),
            wb.ergonomics.Look((1.0, 0.5, 0.2)),
        ],
        measures=[
            wb.Effort(),
            wb.tasks.Discomfort(0.1),
            wb.tasks.Displacement(),
            wb.tasks.PotentialEnergy(0.01),
            wb.tasks.Rhythm(2.0),
            wb.tasks.RotationEffort(3.0),
            wb.tasks.Stance(weight=4.0),
            wb.tasks.Hang(["left_upper_arm"]),
            wb.tasks.LevelHead(weight=2.0),
            wb.tasks.SeatCenterline("ground", weight=3.0),
            wb.ergonomics.Exertion(strength=wb.motion.Strength(sex="female"), weight=5.0),
        ],
    )
    q = pin.integrate(problem.scene.model, problem.start, np.linspace(-0.1, 0.1, 55))
    state = State(problem.scene.model).update(q)
    for mine, theirs in zip(same.goals, problem.goals, strict=True):
        assert type(mine) is type(theirs)
        assert mine.weight == theirs.weight
        np.testing.assert_allclose(mine.error(state), theirs.error(state), atol=1e-12)
    for mine, theirs in zip(same.constraints, problem.constraints, strict=True):
        np.testing.assert_allclose(mine.value(state), theirs.value(state), atol=1e-12)
        np.testing.assert_allclose(mine.upper, theirs.upper)
    for mine, theirs in zip(same.bounds, problem.bounds, strict=True):
        np.testing.assert_allclose(mine.bounds(state, None), theirs.bounds(state, None))
    for mine, theirs in zip(same.measures, problem.measures, strict=True):
        assert mine.weight * mine.value(state) == pytest.approx(theirs.weight * theirs.value(state))


def test_a_soft_goal_is_read_beside_the_default_measures_and_written(tmp_path: Path) -> None:
    file = tmp_path / "soft.toml"
    file.write_text(
        '[figure]\nname = "human"\n'
        '[[goal]]\ntype = "point"\nframe = "left_palm"\ntarget = [0.5, 0.3, 1.2]\nsoft = 40.0\n'
    )
    task = wb.read_task(file)
    again = wb.read_task(wb.taskfile.write_task(task.problem, tmp_path / "again.toml"))
    for problem in (task.problem, again.problem):
        assert problem.goals == ()
        assert [type(term).__name__ for term in problem.measures] == ["Effort", "Rhythm", "Soft"]
        assert problem.measures[2].weight == 40.0


def test_method_has_its_settings(everything: wb.taskfile.Task) -> None:
    method = everything.method
    assert isinstance(method, wb.methods.QP)
    assert (method.solver, method.tolerance, method.iterations) == ("daqp", 1e-7, 50)
    assert (method.budget, method.restarts, method.seed) == (50, 2, 3)


def test_what_is_left_out_is_what_python_leaves_out(tmp_path: Path) -> None:
    (tmp_path / "least.toml").write_text('[figure]\nname = "human"\n')
    task = wb.read_task(tmp_path / "least.toml")
    assert task.title == "least"
    np.testing.assert_array_equal(task.problem.start, wb.load("human").posture("standing"))
    assert [type(measure) for measure in task.problem.measures] == [wb.Effort, wb.tasks.Rhythm]
    assert [type(term) for term in task.problem.defaults] == [wb.tasks.RangeOfMotion, wb.tasks.ReachCones]
    assert task.problem.goals == ()
    assert task.problem.clearance == 0.0


def test_a_figure_with_fewer_joints_and_a_urdf_by_path(tmp_path: Path, root: Path) -> None:
    (tmp_path / "arm.toml").write_text('[figure]\nname = "human"\njoints = ["right_arm"]\n')
    assert wb.read_task(tmp_path / "arm.toml").problem.scene.model.nv == 9
    (tmp_path / "man.urdf").write_text((root / "urdf" / "human.urdf").read_text())
    (tmp_path / "own.toml").write_text('[figure]\npath = "man.urdf"\nroot = "free"\n')
    assert wb.read_task(tmp_path / "own.toml").problem.scene.model.nv == 55


def test_soft_goals_leave_the_default_measures_of_who_is_to_kneel_and_are_told_apart(tmp_path: Path) -> None:
    file = tmp_path / "kneel.toml"
    asked = (
        '[figure]\nname = "human"\n[[object]]\nname = "floor"\nshape = "halfspace"\n[[constraint]]\ntype = "stand"\n'
        'on = "floor"\nfeet = ["left_shank", "right_shank"]\nknees = ["left_shank", "right_shank"]\n'
    )
    soft = '[[goal]]\ntype = "point"\nframe = "{}_palm"\ntarget = [0.4, 0.2, 0.6]\nsoft = 5.0\n'
    file.write_text(asked)
    rest = wb.read_task(file).problem.measures[0].distance.reference  # type: ignore[attr-defined]
    file.write_text(asked + soft.format("left") + soft.format("right"))
    problem = (task := wb.read_task(file)).problem
    assert problem.measures[0].distance.reference == pytest.approx(rest)  # type: ignore[attr-defined]
    told = describe(task, wb.solve(problem), tmp_path)["measures"]
    assert list(told) == ["Effort", "Rhythm", "Soft", "Soft 2"]
    with pytest.raises(wb.InputError, match="all Soft"):
        wb.taskfile.write_task(
            wb.Problem(problem.scene, measures=[wb.Soft(wb.Point("left_palm", (0.4, 0.2, 0.6)))]), file
        )
