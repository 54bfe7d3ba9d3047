"""Legal but absurd input is warned of, and messages about wrong input name the mend."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.errors import nearest_names
from wholebody.cli.main import main

NAMES = ("left_hand", "right_hand", "left_palm", "right_palm", "right_index_tip", "left_index_tip", "head", "pelvis")


@pytest.fixture(scope="module")
def person() -> wb.Figure:
    return wb.load("human")


def problem(person: wb.Figure, **given: object) -> wb.Problem:
    return wb.Problem(wb.Scene(person).add(wb.HalfSpace(), name="floor"), **given)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "written", ["hand_left", "LeftHand", "l_hand", "hand_l", "Left Hand", "left-hand", "LEFT_HAND"]
)
def test_words_sides_and_case_are_recognised(written: str) -> None:
    assert nearest_names(written, NAMES)[0] == "left_hand"


def test_of_few_names_all_are_offered_if_none_is_alike() -> None:
    assert set(nearest_names("ipopt", ("ccd", "dls", "newton", "placo", "qp"))) == {
        "ccd",
        "dls",
        "newton",
        "placo",
        "qp",
    }
    assert nearest_names("QP", ("ccd", "dls", "newton", "placo", "qp"))[0] == "qp"
    assert nearest_names("x", ()) == []


def test_the_nearest_do_not_depend_on_the_order() -> None:
    assert nearest_names("hand", NAMES) == nearest_names("hand", NAMES[::-1])


@pytest.mark.parametrize(
    ("shape", "told"),
    [
        (wb.Box((600, 1200, 40)), "600 x 1200 x 40 m"),
        (wb.Sphere(300.0), "600 m"),
        (wb.Cylinder(30.0, 750.0), "60 x 750 m"),
        (wb.Mesh((450.0 * np.vstack([np.zeros(3), np.eye(3)]), [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])),
         "scale=0.001"),
    ],
)  # fmt: skip
def test_a_thing_in_millimetres_is_warned_of(person: wb.Figure, shape: wb.Box, told: str) -> None:
    with pytest.warns(UserWarning, match=told) as warned:
        scene = wb.Scene(person).add(shape, name="thing")
    assert len(warned) == 1
    assert list(scene.objects) == ["thing"]  # warned of, and taken


@pytest.mark.parametrize(
    "shape", [wb.HalfSpace(), wb.Box((200, 200, 0.1)), wb.Box((60, 30, 8)), wb.Box((0.6, 1.2, 0.04))]
)
def test_floors_and_rooms_are_not(person: wb.Figure, shape: wb.Box) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = wb.Scene(person).add(shape, name="thing").move("thing", at=(20.0, 0.0, 0.0))
    np.testing.assert_array_equal(scene.objects["thing"].placement.translation, (20.0, 0.0, 0.0))


def test_a_thing_that_is_moved_by_millimetres_is_warned_of(person: wb.Figure) -> None:
    scene = wb.Scene(person).add(wb.Sphere(0.1), name="ball")
    with pytest.warns(UserWarning, match="divide millimetres by 1000") as warned:
        scene.move("ball", at=(600.0, 0.0, 0.0))
    assert len(warned) == 1
    assert scene.objects["ball"].placement.translation[0] == 600.0


def test_frames_a_second_for_a_time_step_are_warned_of(person: wb.Figure) -> None:
    with pytest.warns(UserWarning, match="give 1 / 60") as warned:
        clip = wb.Clip(person, np.tile(person.posture("standing"), (3, 1)), dt=60, name="clip")
    assert len(warned) == 1
    assert clip.duration == 120.0


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["psoe", "task.toml"], "did you mean pose"),
        (["pose", "task.toml", "--methd", "ccd"], "no option is called '--methd'; did you mean --method"),
        (["bench", "compre"], "did you mean compare"),
        (
            ["reach", "task.toml", "--frame", "head", "--high", "1,1,1", "--low", "0.3", "-0.4", "1.0"],
            "join numbers by commas",
        ),
    ],
)
def test_the_command_line(given: list[str], told: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as ended:
        main(given)
    assert ended.value.code == 2
    assert told in capsys.readouterr().err


def test_a_value_may_begin_with_a_negative_number(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    task = str(tmp_path / "task.toml")
    assert main(["reach", task, "--frame", "left_palm", "--low", "-0.3,-0.4,1.0", "--high", "0.6,0.1,1.3"]) == 2
    assert "task.toml" in capsys.readouterr().err  # the corners were understood, the task does not exist


def test_warnings_are_of_the_line_that_called(person: wb.Figure) -> None:
    scene, q = wb.Scene(person), person.posture("standing")
    calls = (
        lambda: scene.add(wb.Sphere(300.0), name="huge", at=(900.0, 0.0, 0.0)),
        lambda: scene.move("huge", at=(0.0, 9e5, 0.0)),
        lambda: person.with_joints(q, {"left_elbow_flexion": 90.0}),
        lambda: wb.Clip(person, np.tile(q, (3, 1)), 30.0),
        lambda: wb.methods.QP().tracker(problem(person), 30.0),
    )
    for call in calls:
        with pytest.warns(UserWarning, match="metres|degrees|frames a second") as told:
            call()
        assert {(one.filename, one.lineno) for one in told} == {(__file__, call.__code__.co_firstlineno)}


def test_a_long_time_that_is_no_frame_is_not_warned_of() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert wb.dynamics.Spring(1.0, 1.0, 1.0).transition(20.0).shape == (2, 2)
