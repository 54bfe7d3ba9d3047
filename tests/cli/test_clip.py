"""The commands `wholebody clip`: what they write, and that nothing is written where something is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.motion.files.test_formats import glb
from tests.motion.test_things import SIZE, among, gaps, lifting
from wholebody import view
from wholebody.cli import main


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    """A clip of a person that bends an elbow."""
    human = wb.load("human")
    q = np.tile(human.neutral, (12, 1))
    q[:, human.model.joints[human.joint_id("left_elbow_flexion")].idx_q] = np.radians(np.linspace(10.0, 120.0, 12))
    return wb.Clip(human, q, 0.05, "bend").write(tmp_path / "bend.npz")


def test_info_tells_size_and_what_moves(walk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["clip", "info", str(walk)]) == 0
    said = capsys.readouterr().out
    assert "bend: 12 frames at 20 Hz, 0.550 s, human with 55 degrees of freedom" in said
    assert "frames beyond joint limits: 0" in said
    row = next(line for line in said.splitlines() if line.startswith("left_elbow_flexion")).split()
    assert row[1:] == ["10", "deg", "120", "deg", "200", "deg/s"]


def test_clips_of_several_figures_are_read_with_their_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    task, clip, out = tmp_path / "two.toml", tmp_path / "two.npz", tmp_path / "two.csv"
    task.write_text(
        '[[figure]]\nname = "human"\ncalled = "ann"\n[[figure]]\nname = "hand"\ncalled = "by"\nat = [2.0, 0.0, 1.0]\n'
        '[[object]]\nname = "table"\nshape = "box"\nsize = [0.2, 0.2, 0.2]\nat = [1.0, 0.0, 0.1]\n'
    )
    figure = wb.read_task(task).problem.scene.figure
    q = np.tile(figure.neutral, (12, 1))
    q[:, figure.model.joints[figure.joint_id("ann/left_elbow_flexion")].idx_q] = np.radians(
        np.linspace(10.0, 120.0, 12)
    )
    wb.Clip(figure, q, 0.05).write(clip)
    assert main(["clip", "info", str(clip), "--scene", str(task)]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("ann/left_elbow")).split()
    assert row[1:] == ["10", "deg", "120", "deg", "200", "deg/s"]
    assert main(["clip", "convert", str(clip), str(out), "--scene", str(task)]) == 0
    np.testing.assert_allclose(wb.read_clip(out, figure).q, q, atol=1e-9)
    assert main(["clip", "play", str(clip), "--scene", str(task), "--out", str(tmp_path / "two.glb")]) == 0
    nodes = glb(tmp_path / "two.glb")[0]["nodes"]
    assert any("table" in node.get("name", "") for node in nodes)


@pytest.mark.parametrize("ending", [".bvh", ".csv", ".txt", ".npz"])
def test_convert_writes_a_file_that_is_read_again(walk: Path, ending: str, tmp_path: Path) -> None:
    out = tmp_path / f"out{ending}"
    assert main(["clip", "convert", str(walk), str(out), "--dt", "0.1", "--mirror"]) == 0
    clip = wb.read_clip(out, wb.load("human"))
    assert len(clip) == 6
    values = [clip.figure.joint_values(q)["right_elbow_flexion"] for q in clip.q]
    assert np.degrees(values) == pytest.approx(np.linspace(10.0, 110.0, 6), abs=1e-5)


def test_retarget_writes_a_clip_of_the_figure(walk: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A small woman takes over what a man's BVH holds."""
    assert main(["clip", "convert", str(walk), str(tmp_path / "bend.bvh")]) == 0
    size = ["--sex", "female", "--stature", "1.55"]
    out = tmp_path / "woman.npz"
    assert main(["clip", "retarget", str(tmp_path / "bend.bvh"), "--out", str(out), *size]) == 0
    table = [line.split() for line in capsys.readouterr().out.splitlines() if " to " in line]
    assert ["left_shoulder", "to", "left_elbow"] in [row[:3] for row in table]
    assert all(float(row[3]) < 6.0 for row in table)  # degrees
    clip = wb.read_clip(out, wb.load("human", sex="female", stature=1.55))
    values = [clip.figure.joint_values(q)["left_elbow_flexion"] for q in clip.q]
    assert np.degrees(values) == pytest.approx(np.linspace(10.0, 120.0, 12), abs=6.0)


def test_retarget_takes_things_and_where_they_go(tmp_path: Path) -> None:
    """A man lifts a box in a BVH; a woman's hands are at the box of the task file where its track has it."""
    motion, track = lifting(10)
    man = wb.load("human")
    wb.retarget(motion, man, among(man, track[0]), things={"box": track}).write(tmp_path / "lift.bvh")
    (tmp_path / "room.toml").write_text(
        '[figure]\nname = "human"\nsex = "female"\n[[object]]\nname = "floor"\nshape = "halfspace"\n'
        f'[[object]]\nname = "box"\nshape = "box"\nsize = {list(SIZE)}\nat = [0.4, 0.0, 1.0]\n'
    )
    rows = np.array([pin.SE3ToXYZQUAT(at) for at in track])
    np.savetxt(tmp_path / "box.csv", rows, delimiter=",", header="x, y, z, qx, qy, qz, qw")
    given = [str(tmp_path / "lift.bvh"), "--scene", str(tmp_path / "room.toml")]
    given += ["--track", f"box={tmp_path / 'box.csv'}", "--out", str(tmp_path / "lift.npz")]
    assert main(["clip", "retarget", *given]) == 0
    clip = wb.read_clip(tmp_path / "lift.npz", wb.load("human", sex="female"))
    assert np.abs(np.diff(clip.things["box"][:, 2]) / np.diff(rows[:, 2]) - 1.0).max() < 0.15
    assert max(np.abs(gaps(clip, side)[:, 0]).max() for side in ("left", "right")) < 1e-3


def test_a_robot_goes_about_where_that_is_asked(walk: Path, tmp_path: Path) -> None:
    inertia = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
    link = f"<link name='{{0}}'>{inertia}</link>"
    joint = "<joint name='{0}' type='revolute'><parent link='{1}'/><child link='{2}'/><origin xyz='{3}'/>\
<axis xyz='0 1 0'/><limit lower='-2' upper='2' effort='1' velocity='1'/></joint>"
    parts = [link.format("base")]
    for side, away in (("left", 0.1), ("right", -0.1)):
        above = "base"
        for part, at in (("hip", f"0 {away} 0"), ("knee", "0 0 -0.4"), ("ankle", "0 0 -0.4")):
            parts += [
                link.format(f"{side}_{part}_link"),
                joint.format(f"{side}_{part}", above, f"{side}_{part}_link", at),
            ]
            above = f"{side}_{part}_link"
    (tmp_path / "legs.urdf").write_text(f"<robot name='legs'>{''.join(parts)}</robot>")
    human = wb.load("human")
    clip = wb.read_clip(walk, human)
    gone = clip.q.copy()
    gone[:, 0] += np.linspace(0.0, 0.5, len(gone))
    clip.with_q(gone).write(tmp_path / "walk.bvh")
    out = tmp_path / "legs.npz"
    given = ["clip", "retarget", str(tmp_path / "walk.bvh"), "--out", str(out), "--figure", str(tmp_path / "legs.urdf")]
    assert main([*given, "--root", "free"]) == 0
    way = wb.read_clip(out, wb.load(tmp_path / "legs.urdf", root="free")).q[:, 0]
    assert way[-1] - way[0] == pytest.approx(0.5 * 0.8 / _leg(human), abs=0.05)
    given = ["clip", "retarget", str(tmp_path / "walk.bvh"), "--to", str(tmp_path / "legs.urdf"), "--ground", "auto"]
    table = tmp_path / "walk.csv"
    assert main([*given, "--rate", "40", "--bare", "--out", str(table)]) == 0
    rows = np.loadtxt(table, delimiter=",")
    assert rows.shape == (round(clip.duration * 40) + 1, 13)
    assert rows[-1, 0] - rows[0, 0] == pytest.approx(0.5 * 0.8 / _leg(human), abs=0.05)


def _leg(human: wb.Figure) -> float:
    """Length of thigh and shank, metres."""
    state = wb.Scene(human).state(human.neutral)
    hip, knee, ankle = (
        np.array(state.frame(human.frame_id(f"left_{part}")).translation) for part in ("hip", "knee", "ankle")
    )
    return float(np.linalg.norm(hip - knee) + np.linalg.norm(knee - ankle))


def test_play_writes_a_page(walk: Path, tmp_path: Path) -> None:
    page = tmp_path / "bend.html"
    assert main(["clip", "play", str(walk), "--ghost", str(walk), "--out", str(page)]) == 0
    assert page.stat().st_size > 100_000


def test_a_strip_has_the_ghost_of_each_of_its_frames(
    walk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: dict[str, Any] = {}

    def strip(_: Any, postures: Any, out: Path, *, ghosts: Any) -> Path:
        drawn.update(postures=postures, ghosts=ghosts)
        return out

    monkeypatch.setattr("wholebody.cli.clip.play.write_filmstrip", strip)
    clip = wb.read_clip(walk, wb.load("human"))
    before = clip.with_q(clip.q[::-1]).write(tmp_path / "before.npz")
    given = ["clip", "play", str(walk), "--out", str(tmp_path / "strip.png"), "--pictures", "3"]
    assert main([*given, "--ghost", str(before)]) == 0
    assert np.array(drawn["postures"]) == pytest.approx(clip.q[[0, 6, 11]])
    assert np.array(drawn["ghosts"]) == pytest.approx(clip.q[[11, 5, 0]])
    assert main(given) == 0
    assert drawn["ghosts"] is None


def test_play_shows_what_the_body_wears_on_a_floor_below_it(
    walk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The floor is where the soles are, however high the recording is."""
    shown: list[wb.Scene] = []

    class Seen(view.Viewer):
        def __init__(self, scene: wb.Scene, **given: Any) -> None:
            shown.append(scene)
            super().__init__(scene, **given)

    monkeypatch.setattr("wholebody.cli.clip.play.Viewer", Seen)
    clip = wb.read_clip(walk, wb.load("human"))
    q = clip.q.copy()
    q[:, 2] -= 0.25
    clip.with_q(q).write(tmp_path / "low.npz")
    for file in (walk, tmp_path / "low.npz"):
        given = ["clip", "play", str(file), "--equipment", "pack+torus", "--out", str(tmp_path / "bend.html")]
        assert main(given) == 0
    assert sorted(shown[0].objects) == ["floor", "pack", "torus"]
    for scene, posture in zip(shown, (clip.q[0], q[0]), strict=True):
        near = scene.contacts(posture, 0.01)
        floor = [
            gap for gap, pair in zip(near.distance, near.pair, strict=True)
            if "floor" in (scene.piece_owner[piece] for piece in pair)
        ]  # fmt: skip
        assert min(floor) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["play", "bend.npz", "--equipment", "pakc", "--out", "out.html"], "pakc"),
        (["info", "none.npz"], "there is no such file"),
        (["convert", "bend.npz", "out.xyz"], "cannot be written as .xyz"),
        (["retarget", "bend.npz", "--out", "out.npz"], "bend.npz: is no skeleton"),
        (["avoid", "bend.npz", "--scene", "none.toml", "--sex", "female"], "leave out --figure"),
        (["avoid", "bend.npz", "bend.npz", "--scene", "none.toml"], "--scene is for one motion"),
        (["retarget", "bend.bvh"], "name it with --out"),
        (["convert", "bend.npz", "bend.npz", "--mirror"], "bend.npz is a file that is read"),
        (["avoid", "bend.npz", "--out", "bend.npz"], "bend.npz is a file that is read"),
        (["retarget", "bend.bvh", "--to", "g1.urdf", "--figure", "h1.urdf", "--out", "o.npz"], "one and the same"),
        (["retarget", "a.bvh", "b.bvh", "--track", "box=b.csv", "--out", "o"], "--track is for one file"),
        (["play", "bend.npz", "--pictures", "0", "--out", "out.png"], "--pictures is 0"),
    ],
)
def test_what_is_wrong_is_one_sentence_and_writes_nothing(
    walk: Path,
    arguments: list[str],
    sentence: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(walk.parent)
    assert main(["clip", *(text.format(folder=walk.parent.name) for text in arguments)]) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1
    assert [path.name for path in walk.parent.iterdir()] == ["bend.npz"]
