"""`wholebody world` as people use it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.csv_rows import csv_rows
from wholebody.cli import main
from wholebody.dynamics.live_world import LiveWorld
from wholebody.dynamics.world import WORLD_SCENES, build_world_scene
from wholebody.taskfile.task import View

TASK = """\
[figure]
name = "hand"

[[object]]
name = "floor"
shape = "halfspace"
offset = -1.0

[[object]]
name = "ball"
shape = "sphere"
radius = 0.05
at = [0.5, 0.0, 0.0]
{body}
"""


def test_lists_the_scenes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["world", "--list"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in WORLD_SCENES)
    assert main(["world"]) == 2
    assert main(["world", "flik"]) == 2
    assert "did you mean flick" in capsys.readouterr().err
    assert main(["world", "flick", "--overlap", "none"]) == 2
    assert main(["world", "flick", "--udp", "9870"]) == 2
    assert main(["world", "all", "--live"]) == 2


def test_a_run_writes_numbers_chart_and_animation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["world", "push_ball", "--frames", "20", "--out", str(out)]) == 0
    assert "push_ball" in capsys.readouterr().out
    rows = csv_rows(out / "push_ball.csv")
    assert len(rows) == 20
    assert max(float(row["deepest mm"]) for row in rows) <= 0.1
    assert {path.name for path in out.iterdir()} == {
        "push_ball.csv", "push_ball.html", "push_ball.png", "push_ball.svg", "world.md",
    }  # fmt: skip


def test_a_body_of_a_task_file_has_a_mass_or_a_density(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    task, out = tmp_path / "ball.toml", tmp_path / "out"
    task.write_text(TASK.format(body='material = "metal"'))
    assert main(["world", str(task), "--out", str(out)]) == 2
    assert "density" in capsys.readouterr().err
    task.write_text(TASK.format(body="mass = 2.0\ndensity = 300.0"))
    assert main(["world", str(task), "--out", str(out)]) == 2
    assert "give one of them" in capsys.readouterr().err


def test_a_room_in_which_nothing_moves_by_itself_is_for_the_live_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    task, out, served = tmp_path / "room.toml", tmp_path / "out", []

    class Page:
        def __init__(self, live: LiveWorld, *_: object, **__: object) -> None:
            self.live, self.url = live, ""

        def serve(self) -> None:
            served.append(self.live.move())

    monkeypatch.setattr("wholebody.cli.world.LivePage", Page)
    task.write_text(TASK.format(body=""))
    assert main(["world", str(task), "--out", str(out)]) == 2
    assert "give an object a density or a mass, or add --live" in capsys.readouterr().err
    assert main(["world", str(task), "--live", "--out", str(out)]) == 0
    assert [frame.overlap for frame in served] == [0.0]


def test_a_live_page_has_the_camera_of_the_scene_or_the_task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    views = []

    class Page:
        def __init__(self, *_: object, view: View, **__: object) -> None:
            views.append(view)
            self.url = ""

        def serve(self) -> None: ...

    monkeypatch.setattr("wholebody.cli.world.LivePage", Page)
    task = tmp_path / "ball.toml"
    seen = "[view]\neye = [2.0, 1.0, 1.0]\ntarget = [0.5, 0.0, 0.0]\nsee_through = ['ball']\n"
    task.write_text(seen + TASK.format(body="mass = 2.0"))
    assert main(["world", str(task), "--live"]) == 0
    assert main(["world", "flick", "--live"]) == 0
    scene = build_world_scene("flick")
    assert views == [
        View((2.0, 1.0, 1.0), (0.5, 0.0, 0.0), ("ball",)),
        View(scene.eye, scene.target, scene.see_through),
    ]
    assert scene.eye is not None


DOOR = """
[[object]]
name = "wall"
shape = "box"
size = [0.1, 0.5, 2.0]
at = [1.0, -0.72, 1.0]

[[object]]
name = "door"
shape = "box"
size = [0.04, 0.9, 2.0]
at = [1.0, 0.0, 1.01]
mass = 12.0
angular_velocity = [0.0, 0.0, 1.5]
{joints}
"""


def test_a_door_of_a_task_file_swings_on_its_hinge_while_a_ball_falls(tmp_path: Path) -> None:
    """The hinge keeps the angular momentum about the centre as that about its axis; then nothing resists.

    The ball, from the height of 0, falls for a fifth of a second, and meets nothing.
    """
    task, out = tmp_path / "door.toml", tmp_path / "out"
    joints = 'joints = [{ type = "hinge", at = [0.0, -0.45, 0.0], to = "wall" }]'
    task.write_text(TASK.format(body="mass = 2.0") + DOOR.format(joints=joints))
    assert main(["world", str(task), "--frames", "12", "--out", str(out)]) == 0
    first, *_, last = (float(row["energy J"]) for row in csv_rows(out / "door.csv"))
    about_centre = 12.0 * (0.9**2 + 0.04**2) / 12.0
    turning = 0.5 * (about_centre * 1.5) ** 2 / (about_centre + 12.0 * 0.45**2)
    assert last - 12.0 * 9.81 * 1.01 == pytest.approx(turning, rel=1e-3)
    assert last == pytest.approx(first, rel=1e-4)


@pytest.mark.parametrize(
    ("joints", "said"),
    [
        ('joints = [{ type = "hinge", to = "wal" }]', "did you mean wall"),
        ('joints = [{ type = "hinge", to = "door" }]', "the thing cannot hold itself"),
        ('joints = [{ type = "slider" }]', "'hinge' or 'ball'"),
        ('joints = [{ type = "ball", axis = [0, 0, 1] }]', "no key is called 'axis'; known: at"),
        ('joints = [{ type = "hinge", axis = [0, 0, 0] }]', "has no direction; give a vector"),
        ('joints = { type = "hinge" }', "is no list of joints"),
    ],
)
def test_a_wrong_joint_is_named(joints: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    task = tmp_path / "door.toml"
    task.write_text(TASK.format(body="") + DOOR.format(joints=joints))
    assert main(["world", str(task), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert "door.toml" in error
    assert "object 4, key joints" in error
