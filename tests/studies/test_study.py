"""Studies: the product of people, targets and layouts, by functions and by files."""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from tests.task_text import box, figure, hold, point
from wholebody.cli.main import main
from wholebody.studies.study_files import TaskFile, read_study

TASK = (
    figure("human")
    + box("post", [0.05, 0.05, 0.5], [1.5, 0.0, 0.25])
    + hold("pelvis")
    + point("right_index_tip", [0.4, -0.2, 1.2])
)
STUDY = """
task = "task.toml"
[[person]]
name = "short"
sex = "female"
stature = 1.55
[[person]]
name = "tall"
stature = 1.9
[[target]]
name = "near"
at = [0.35, -0.2, 1.2]
[[target]]
name = "far"
at = [3.0, -0.2, 1.2]
[[layout]]
name = "nearer"
move = { post = [1.2, 0.0, 0.25] }
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "task.toml").write_text(TASK)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


def reach(figure: wb.Figure, target: Any, layout: Any) -> wb.Problem:
    assert layout is None
    return wb.Problem(wb.Scene(figure), goals=[wb.Point("hand", target)])


def broken(figure: wb.Figure, target: Any, layout: Any) -> wb.Problem:
    if target == 1:
        raise ZeroDivisionError("a mistake in the task")
    return wb.Problem(wb.Scene(figure), goals=[wb.Point("hand", (0.4, 0.0, 0.5))])


def test_each_combination_has_a_record_with_its_factors() -> None:
    arm = wb.load(Path(__file__).resolve().parents[2] / "examples" / "tasks" / "arm.urdf")
    places = {"a": (0.4, 0.0, 0.5), "b": (0.4, 0.1, 0.5)}
    records = wb.study(reach, people={"one": arm, "two": arm}, targets=places, warm_start=True)
    assert [one.factors for one in records] == [{"person": p, "target": t} for p in ("one", "two") for t in "ab"]
    for one in records:
        assert one.factors is not None
        there = arm.placement(one.q, "hand").translation
        np.testing.assert_allclose(there, places[one.factors["target"]], atol=2e-5)
        assert one.row()["person"] == one.factors["person"]


def test_a_mistake_in_a_task_is_a_record() -> None:
    arm = wb.load(Path(__file__).resolve().parents[2] / "examples" / "tasks" / "arm.urdf")
    first, second = wb.study(broken, people=[arm], targets=[0, 1])
    assert first.solved
    assert second.outcome == "refused"
    assert "a mistake in the task" in second.message


def among_things(figure: wb.Figure, target: Any, layout: Any) -> wb.Problem:
    scene = wb.Scene(figure).add(wb.Sphere(0.05), name="ball", at=(0.4, 0.3, 0.5))
    return wb.Problem(scene, goals=[wb.Point("hand", (0.4, 0.0, 0.5))])


def test_what_a_method_leaves_out_of_a_study_is_said_once_before_it_is_computed() -> None:
    """`dls` does not look at contacts; `qp` leaves nothing out."""
    arm = wb.load(Path(__file__).resolve().parents[2] / "examples" / "tasks" / "arm.urdf")
    people, told = {"one": arm, "two": arm}, r"method 'dls' leaves out contacts"
    for run in (wb.study, wb.accommodation):
        with pytest.warns(UserWarning, match=told) as said:
            run(among_things, people=people, method="dls", progress=lambda _: True)
        assert [one.filename for one in said] == [__file__]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        wb.study(among_things, people=people, method="qp", progress=lambda _: True)


def test_a_study_file_is_solved_by_command(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", str(folder / "study.toml"), "--out", str(folder / "out")]) == 1
    shown = capsys.readouterr().out
    assert "4 cases: 2 solved, 2 unreachable" in shown
    rows = (folder / "out" / "cases.csv").read_text().splitlines()
    assert rows[0].startswith("name,person,target,layout,outcome")
    assert len(rows) == 5
    assert ",short,far,nearer,unreachable," in rows[2]


@pytest.mark.parametrize("moves", ["", "move = {}\n"])
def test_a_layout_may_be_the_tasks_own(folder: Path, moves: str) -> None:
    (folder / "study.toml").write_text(f'task = "task.toml"\n[[layout]]\nname = "as it is"\n{moves}')
    assert main(["study", str(folder / "study.toml"), "--out", str(folder / "out")]) == 0
    assert ",as it is,solved," in (folder / "out" / "cases.csv").read_text()


def test_a_person_takes_the_place_of_the_percentile_of_a_file(folder: Path) -> None:
    small = TASK.replace('name = "human"', 'name = "human"\nsex = "female"\npercentile = 5')
    (folder / "task.toml").write_text(small)
    found = wb.study(folder / "task.toml", people=["F5", "M95"])
    alone = wb.study(folder / "task.toml", targets=[(0.4, -0.2, 1.2)])
    assert {one.outcome for one in found} == {"solved"}
    np.testing.assert_allclose(found[0].q, alone[0].q, atol=1e-6)


def test_people_of_a_study_have_proportions_of_their_own(folder: Path) -> None:
    near, far = wb.study(
        folder / "task.toml", people=[{"proportions": {"span": 1.75}}, {"proportions": {"span": 1.90}}],
        targets=[(3.0, 0.0, 1.0)],
    )  # fmt: skip
    assert near.goal_error > far.goal_error + 0.02
    with pytest.raises(wb.UnknownNameError, match="no dimension is called 'spam'"):
        wb.study(folder / "task.toml", people=[{"proportions": {"spam": 1.75}}])


def test_a_study_file_says_of_a_person_what_a_task_file_can_say(folder: Path) -> None:
    person = "percentile = 5\nage = 60\nproportions = { span = 1.6 }"
    (folder / "study.toml").write_text(STUDY.replace("stature = 1.55", person, 1))
    people = read_study(folder / "study.toml")["people"]
    assert {"sex": "female", "percentile": 5.0, "age": 60.0, "proportions": {"span": 1.6}} in people.values()


def test_a_person_takes_the_place_of_one_of_several_figures(folder: Path) -> None:
    figures = (
        '[[figure]]\nname = "human"\ncalled = "anna"\n[[figure]]\nname = "human"\ncalled = "ben"\nat = [0, 3, 0]\n'
    )
    held = "".join(hold(f"{name}/pelvis") for name in ("anna", "ben"))
    quick = '[method]\nname = "qp"\nbudget = 0\n'
    (folder / "task.toml").write_text(figures + held + point("anna/right_index_tip", [3.0, -0.2, 1.2]) + quick)
    people = [{"called": "anna", "stature": 1.6}, {"called": "anna", "stature": 1.9}, {"called": "ben", "stature": 1.9}]
    low, high, other = wb.study(folder / "task.toml", people=people)
    assert other.goal_error == pytest.approx(wb.study(folder / "task.toml", targets=[(3.0, -0.2, 1.2)])[0].goal_error)
    assert high.goal_error < other.goal_error < low.goal_error  # the taller reaches farther
    with pytest.raises(wb.InputError, match=r"several figures; say whose place.*'called': 'anna'"):
        wb.study(folder / "task.toml", people=["F5"])
    with pytest.raises(wb.UnknownNameError, match="no figure is called 'carl'; known: anna, ben"):
        wb.study(folder / "task.toml", people=[{"called": "carl"}])
    with pytest.raises(wb.InputError, match="the function knows them"):
        wb.study(reach, people=[{"called": "anna"}])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('task = "task.toml"', 'task = "tusk.toml"', "task.toml"),
        ("stature = 1.55", "stature = 155", "1.55"),
        ("stature = 1.55", "height = 1.55", "height"),
        ('name = "near"', 'name = "far"', "another"),
        ("at = [3.0, -0.2, 1.2]", "at = [3.0, -0.2]", "target 2"),
        ("post = [", "past = [", "post"),
        ("[[layout]]", "[[layouts]]", "layout"),
        ('task = "task.toml"', "", "task is missing"),
    ],
)
def test_a_wrong_study_file_is_refused_with_place(
    folder: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, said: str
) -> None:
    (folder / "study.toml").write_text(STUDY.replace(old, new, 1))
    assert main(["study", str(folder / "study.toml"), "--out", str(folder / "out")]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_targets_take_the_place_of_a_goal_that_is_to_be_met(folder: Path) -> None:
    task = folder / "task.toml"
    head, found, rest = task.read_text().partition("[[goal]]")
    assert found
    soft = '[[goal]]\ntype = "point"\nframe = "left_palm"\ntarget = [0.3, 0.3, 1.0]\nsoft = 1.0\n'
    task.write_text(head + soft + found + rest)
    (record,) = wb.study(task, targets=[(3.0, 0.0, 1.0)])
    assert record.goal_error > 1.0


def test_a_function_of_the_figure_alone_is_refused() -> None:
    def task(figure: wb.Figure) -> wb.Problem:
        return wb.Problem(wb.Scene(figure))

    with pytest.raises(wb.InputError, match=r"takes \(figure.*\).*def task\(figure, target, layout\)"):
        wb.study(task, people=["F5"])  # type: ignore[arg-type]
    with pytest.raises(wb.InputError, match="a figure, a target and a layout"):
        wb.accommodation(task, wb.people(1))  # type: ignore[arg-type]


def test_a_task_of_another_person_than_the_given_one_is_refused() -> None:
    """Else a task that loads its own figure has one answer for everybody, and accommodates all of them."""
    everybody = wb.load("human")
    beside = {"man": everybody}

    def of_one(figure: wb.Figure, target: object, layout: object) -> wb.Problem:
        return wb.Problem(wb.Scene(everybody))

    def of_two(figure: wb.Figure, target: object, layout: object) -> wb.Problem:
        return wb.Problem(wb.Scene({**beside, "guest": (figure, (0.0, 2.0, 0.0))}))

    def of_an_arm(figure: wb.Figure, target: object, layout: object) -> wb.Problem:
        return wb.Problem(wb.Scene(figure.reduced(["right_arm"])))

    with pytest.raises(wb.InputError, match="is of 'human' of another size than the figure that the task was given"):
        wb.accommodation(of_one, wb.people(1))
    (refused,) = wb.study(of_one, people=["F5"])
    assert refused.outcome == "refused"
    for task in (of_two, of_an_arm):
        assert wb.study(task, people=["F5"])[0].solved


def test_what_was_refused_is_told_with_its_reason() -> None:
    def task(figure: wb.Figure, target: object, layout: object) -> wb.Problem:
        return wb.Problem(wb.Scene(figure), goals=[wb.Point("no such frame", (0.0, 0.0, 1.0))])

    told = repr(wb.study(task, people=["F5"]))
    assert "first refused: F5, Point: no frame is called 'no such frame'" in told
    assert "goal missed most: none" in told
    with pytest.raises(wb.InputError, match="everybody is refused; the first, female 1: Point: no frame is called"):
        wb.accommodation(task, wb.people(1))


def test_a_task_file_is_found_by_a_process_in_another_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    file = TaskFile(Path("task.toml"))
    (folder / "elsewhere").mkdir()
    monkeypatch.chdir(folder / "elsewhere")
    again = pickle.loads(pickle.dumps(file))
    assert again.path == folder / "task.toml"
    assert again.task.problem.scene.objects.keys() == {"post"}
