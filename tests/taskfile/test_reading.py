"""What task files may say and what they are told when they say something else."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.task_text import box, figure, hold, point, table
from wholebody.base.errors import FileFormatError, WholebodyError
from wholebody.figures import load
from wholebody.taskfile import read_task

GOOD = (
    "clearance = 0.01\n"
    + figure("human", detail="spheres")
    + '\n[start]\nposture = "standing"\njoints = { left_elbow_flexion = 0.5 }\n'
    + box("table", [0.7, 1.2, 0.04], [0.65, 0.0, 0.74])
    + table("[[attach]]", name="ring", shape="sphere", radius=0.01, to="right_hand", at=[0.0, 0.0, -0.3])
    + point("right_index_tip", [0.4, -0.2, 1.0])
    + hold("left_foot")
    + table("[[measure]]", type="effort", weight=2.0)
    + table("[method]", name="qp", tolerance=1e-6)
)


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], Path]:
    def write(text: str) -> Path:
        path = tmp_path / "task.toml"
        path.write_text(text)
        return path

    return write


def test_the_good_file_is_good(write: Callable[[str], Path]) -> None:
    task = read_task(write(GOOD))
    assert task.title == "task"
    assert task.goal_names == ("point right_index_tip",)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        # a wrong number
        ("clearance = 0.01", "clearance = 10", ["task.toml:1", "key clearance", "between 0 and 0.5 m"]),
        ("clearance = 0.01", "clearance = nan", ["task.toml:1", "key clearance", "nan"]),
        ("radius = 0.01", "radius = true", ["attach 1, key radius", "is True; give a number"]),
        # what is asked for is written as a file has it
        ("clearance = 0.01", 'balance = "yes"', ["key balance is 'yes'; give true or false, without quotes"]),
        ('name = "qp"', 'name = "qp"\ntime_limit = -1', ["or inf for no limit"]),
        ("radius = 0.01", "radius = 0.01\ncolor = [1, 2, 3]", ["such as [1.0, 0.0, 0.0]"]),
        ('detail = "spheres"', "stature = 175", ["task.toml:5", "key stature", "write 1.75 if it is in centimetres"]),
        ('detail = "spheres"', "proportions = { siting_height = 0.9 }", ["sitting_height"]),
        (
            "left_elbow_flexion = 0.5",
            "left_elbow_flexion = 30",
            ["task.toml:9", "joints.left_e", "write 0.523599 if it is in degrees"],
        ),
        ("radius = 0.01", "radius = -0.01", ["task.toml:20", "attach 1, key radius", "between 0.0001 and 100 m"]),
        (
            "target = [0.4, -0.2, 1.0]",
            "target = [400, -200, 1000]",
            ["goal 1, key target[0]", "write 0.4 if it is in millimetres or 4"],
        ),
        ("target = [0.4, -0.2, 1.0]", "target = [0.4, inf, 1.0]", ["goal 1, key target[1]", "inf"]),
        (
            'type = "effort"',
            'type = "exertion"\nforces = [1]',
            ["measure 1, key forces[0]", "1 is no force", 'frame = "right_palm"'],
        ),
        # a wrong name
        ('name = "human"', 'name = "humna"', ["figure name", "did you mean human"]),
        (
            'detail = "spheres"',
            'detial = "spheres"',
            ["task.toml:5", "no key", "did you mean detail"],
        ),
        ('posture = "standing"', 'posture = "siting"', ["task.toml:8", "no posture", "sitting"]),
        ('frame = "left_foot"', 'frame = "left_fot"', ["task.toml:31", "constraint 1, key frame", "left_foot"]),
        ('type = "point"', 'type = "pont"', ["no goal type", "did you mean point"]),
        ('name = "qp"', 'name = "xyz"', ["method", "qp"]),
        ("[[goal]]", "[[gaol]]", ["no key or table of a task file is called 'gaol'", "goal"]),
        # a wrong structure
        ('name = "human"\n', "", ["figure", "key name is missing", "human, avatar, hand, adjustable, urdf"]),
        ('frame = "right_index_tip"\n', "", ["goal 1", "key frame is missing"]),
        ("[figure]\n", "", ["task.toml"]),
        ('name = "ring"', 'name = "table"', ["attach 1", "already has"]),
        # what does not go together
        ('type = "point"', 'type = "axis"\naxis = [0, 0, 0]\ndirection = [1, 0, 0]', ["goal 1", "target"]),
        ("[method]", '[view]\nsee_through = ["tabel"]\n[method]', ["view", "see_through", "did you mean table"]),
        ('name = "qp"', 'name = "qp"\nsolver = "oqsp"', ["method", "osqp"]),
    ],
)
def test_what_is_wrong_is_told_in_one_sentence(
    write: Callable[[str], Path], tmp_path: Path, old: str, new: str, expected: list[str]
) -> None:
    (tmp_path / "chair.obj").touch()
    assert old in GOOD
    with pytest.raises(WholebodyError) as caught:
        read_task(write(GOOD.replace(old, new, 1)))
    said = str(caught.value)
    assert said.startswith("task.toml")
    assert "\n" not in said
    for part in expected:
        assert part in said, said


@pytest.mark.parametrize("title", ["two\\nlines", "nul \\u0000", "x" * 1000])
def test_a_title_is_a_line(write: Callable[[str], Path], title: str) -> None:
    with pytest.raises(WholebodyError, match=r"key title is .*; give a line of text, at most 200 characters"):
        read_task(write(f'title = "{title}"\n[figure]\nname = "human"\n'))


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"a = 1\x00", b"[" * 10_000])
def test_what_is_no_text_or_no_toml_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "task.toml"
    path.write_bytes(content)
    with pytest.raises(WholebodyError, match=r"TOML|UTF-8"):
        read_task(path)


def test_a_file_that_is_not_there_is_told_with_its_neighbours(tmp_path: Path) -> None:
    (tmp_path / "shelf.toml").touch()
    with pytest.raises(WholebodyError, match=r"did you mean shelf\.toml"):
        read_task(tmp_path / "shef.toml")
    with pytest.raises(WholebodyError):
        read_task(tmp_path)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("robot.urdf", "is a robot.*path = 'robot.urdf'.*`wholebody show robot.urdf`"),
        ("result.json", "is no task file;.*show"),
    ],
)
def test_a_file_of_another_kind_is_told_with_what_takes_it(tmp_path: Path, name: str, said: str) -> None:
    (tmp_path / name).write_text('<robot name="r"><link name="a"/></robot>')
    with pytest.raises(FileFormatError, match=said):
        read_task(tmp_path / name)


def test_a_path_that_is_too_long_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(WholebodyError):
        read_task(tmp_path / ("a/" * 3000) / "task.toml")


def test_a_list_without_figures_is_none(write: Callable[[str], Path]) -> None:
    with pytest.raises(WholebodyError, match=r"there is no \[figure\] table"):
        read_task(write("figure = []\n"))


@pytest.mark.parametrize(
    ("second", "sentence"),
    [
        ('called = "ben"\ndetail = "spheres"', "figure 2: 'ben' has detail 'spheres'"),
        ('called = "a/b"', "figure 2: the name of a figure is 'a/b'"),
    ],
)
def test_a_fault_of_one_of_several_figures_is_told_there(tmp_path: Path, second: str, sentence: str) -> None:
    (tmp_path / "two.toml").write_text(
        f'[[figure]]\nname = "human"\ncalled = "anna"\n[[figure]]\nname = "human"\n{second}'
    )
    with pytest.raises(WholebodyError) as caught:
        read_task(tmp_path / "two.toml")
    assert str(caught.value).startswith(f"two.toml:4, {sentence}")


HAND = '[[figure]]\nname = "hand"\nside = "right"\nat = [0.0, 0.0, 0.1]\non = '


def test_a_figure_is_mounted_on_another_one(write: Callable[[str], Path]) -> None:
    anna, ben = (
        '[[figure]]\nname = "human"\n' + called for called in ('called = "anna"\n', 'called = "ben"\nat = [2, 0, 0]\n')
    )
    alone = read_task(write('[[figure]]\nname = "human"\n' + HAND + '"right_palm"\n')).problem.scene.figure
    base = load("human")
    made = base.mounted(load("hand", side="right"), on="right_palm", at=(0.0, 0.0, 0.1))
    assert alone.joints == made.joints
    tip = "right_hand/right_index_tip"
    assert alone.placement(alone.neutral, tip).isApprox(made.placement(made.neutral, tip))
    both = read_task(write(anna + ben + HAND + '"ben/right_palm"\ncalled = "tool"\n')).problem.scene.figure
    assert both.members.keys() == {"anna", "ben"}
    assert "ben/tool/right_index_tip" in both.frames
    for text, said in (
        (anna + HAND + '"anna/right_pal"', ":8, figure 2, key on.*right_palm"),
        (anna + HAND + '"right_palm"', "figure 2, key on: no figure is called 'right_palm'; known: anna"),
        (HAND + '"right_palm"', "figure 1, key on: no figure has the frame"),
    ):
        with pytest.raises(WholebodyError, match=said):
            read_task(write(text))


@pytest.mark.parametrize("hand", ["left", "lefty", "anna/lefty", "anne/left"])
def test_a_hand_of_several_people_names_its_owner(tmp_path: Path, hand: str) -> None:
    people = "".join(f'[[figure]]\nname = "human"\ncalled = "{name}"\n' for name in ("anna", "bob"))
    ball = '[[object]]\nname = "ball"\nshape = "sphere"\nradius = 0.05\nat = [0.4, 0.2, 1.0]\n'
    path = tmp_path / "two.toml"
    gripper = '[[figure]]\nname = "hand"\ncalled = "gripper"\non = "bob/head_top"\n'
    path.write_text(f'{people}{gripper}{ball}[[goal]]\ntype = "grasp"\nhand = "{hand}"\nthing = "ball"\n')
    hands = "'anna/left' or 'anna/right' or 'bob/left' or 'bob/right' or 'bob/gripper/right'"
    with pytest.raises(WholebodyError, match=rf"key hand: '{hand}' is no hand of .*give {hands}"):
        read_task(path)
