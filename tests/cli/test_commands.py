"""The command line as people use it: what it prints, writes and returns."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.needs import each
from tests.task_text import figure, point, table
from wholebody.cli import main
from wholebody.figures.packaged_urdf import task_paths
from wholebody.view import browser, screenshot

TASK = (
    'title = "A small reach"\nclearance = 0.002\n'
    + figure("human", detail="spheres")
    + table("[[object]]", name="ball", shape="sphere", radius=0.1, at=[0.6, 0.0, 1.0])
    + point("right_index_tip", [0.35, -0.25, 1.0])
    + table("[[goal]]", type="axis", frame="gaze", axis=[1, 0, 0], toward=[0.35, -0.25, 1.0])
)


@pytest.fixture
def task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(TASK)
    return tmp_path / "small.toml"


@pytest.fixture
def no_browser(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(browser, "find_chromium", lambda: None)


@pytest.mark.usefixtures("no_browser")
def test_pose_reports_writes_and_goes_on_without_a_browser(task: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["pose", "small.toml"]) == 0
    printed = capsys.readouterr().out
    for part in ("A small reach", "solved", "point right_index_tip", "axis gaze", "Effort", "deepest penetration"):
        assert part in printed
    assert "no picture: " in printed
    folder = task.parent / "out" / "small"
    assert sorted(file.name for file in folder.iterdir()) == ["result.json", "scene.html"]
    assert "<html" in (folder / "scene.html").read_text()[:200].lower()


def test_the_result_is_the_posture_and_no_browser_is_asked_for(
    task: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(browser, "find_chromium", lambda: pytest.fail("a browser is looked for"))
    assert main(["pose", str(task), "--out", "here", "--method", "qp", "--json"]) == 0
    captured = capsys.readouterr()
    result = json.loads(captured.out)
    assert "wrote here/result.json" in captured.err
    assert json.loads(Path("here/result.json").read_text()) == result
    assert result["status"] == "solved"
    figure = wb.load("human", detail="spheres")
    q = figure.with_joints(figure.posture("standing"), result["joints"])
    q[:7] = result["root"]
    np.testing.assert_array_equal(q, result["q"])
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, q)
    tip = data.oMf[figure.frame_id("right_index_tip")].translation
    np.testing.assert_allclose(tip, [0.35, -0.25, 1.0], atol=1e-4)
    reach, gaze = result["goals"]
    assert reach["distance"] == pytest.approx(np.linalg.norm(tip - [0.35, -0.25, 1.0]), abs=1e-9)
    assert (reach["angle"], gaze["distance"]) == (None, None)


@pytest.mark.parametrize("command", [["pose"], ["drag"]])
def test_every_method_can_be_named_and_the_help_lists_them(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main([*command, "--help"])
    assert "qp, ccd, newton, placo, dls" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("method", each(["newton", "dls", "placo"]))
def test_methods_are_called_the_same_everywhere(
    tmp_path: Path, method: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "free.toml"
    path.write_text(
        "[figure]\nname = 'avatar'\n[[goal]]\ntype = 'point'\nframe = 'right_index_tip'\ntarget = [0.35, -0.25, 1.1]\n"
    )
    main(["pose", str(path), "--method", method, "--out", str(tmp_path / "out"), "--json"])
    assert json.loads(capsys.readouterr().out)["method"].partition("/")[0] == method
    path.write_text(path.read_text() + f"[method]\nname = '{method}'\n")
    assert wb.read_task(path).method.name.partition("/")[0] == method


@pytest.mark.usefixtures("no_browser")
def test_a_goal_out_of_reach_is_an_answer_with_its_own_code(task: Path, capsys: pytest.CaptureFixture[str]) -> None:
    far = (
        TASK.replace("[0.35, -0.25, 1.0]", "[0.35, -0.25, 9.0]")
        + '[[constraint]]\ntype = "hold"\nframe = "left_foot"\n'
    )
    task.write_text(far + "[method]\nname = 'qp'\nbudget = 0\n")
    assert main(["pose", str(task), "--json"]) == 1
    result = json.loads(capsys.readouterr().out)
    assert result["status"] != "solved"
    assert result["assessment"]["penetration"] < 1e-4


@pytest.mark.browser
def test_pose_draws_and_the_result_can_be_shown_again(task: Path, capsys: pytest.CaptureFixture[str]) -> None:
    require_browser()
    assert main(["pose", str(task), "--out", "drawn"]) == 0
    assert Path("drawn/scene.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    shutil.move("drawn", "moved")
    shutil.copytree("moved", "drawn")
    assert main(["show", "drawn/result.json", "--save", "again.html"]) == 0
    assert Path("again.html").read_bytes() == Path("drawn/scene.html").read_bytes()
    assert main(["show", "hand", "--save", "hand.png"]) == 0
    assert "wrote hand.png" in capsys.readouterr().out
    assert Path("hand.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def require_browser() -> None:
    if browser.find_chromium() is None:
        (pytest.fail if os.environ.get("WHOLEBODY_REQUIRE_BROWSER") else pytest.skip)("there is no Chromium")


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["pose", "absent.toml"], ["no task file is called 'absent.toml'", "small.toml"]),
        (["pose", "small.toml", "--method", "xyz"], ["no method is called 'xyz'", "qp"]),
        (["pose", "small.toml", "--out", "small.toml/x"], ["small.toml/x cannot be made", "another place"]),
        (["show", "humna"], ["no figure is called 'humna'", "human"]),
        (["show", "human", "--posture", "siting", "--save", "a.html"], ["no posture", "sitting"]),
        (["show", "human", "--save", "a.gif"], [".html", ".png"]),
        (["show", "absent.json"], ["absent.json", "no such file"]),
        (["figure", "."], ["figure .: is a folder; give a file"]),
        (["figure", "human", "--stature", "175"], ["175", "between"]),
        (["figure", "human", "--age", "175"], ["175", "between 17 and 69"]),
        (["figure", "human", "--proportion", "sitting_height"], ["'sitting_height'", "NAME=METRES"]),
        (["figure", "human", "--proportion", "sitting=0.9"], ["sitting", "sitting_height"]),
        (["figure", "avatar", "--out", "a.urdf"], ["--out", "human"]),
        (["figure", "human", "--out", "a.txt"], [".urdf"]),
        (["demo", "shef"], ["no demo", "shelf"]),
    ],
)
def test_what_is_wrong_is_one_sentence_and_code_2(
    task: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], parts: list[str]
) -> None:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("wholebody: ")
    assert captured.err.count("\n") == 1
    assert "Traceback" not in captured.err
    for part in parts:
        assert part in captured.err, captured.err
    assert not list(task.parent.rglob("*.part"))


@pytest.mark.parametrize(
    "content",
    [
        "a = " + "[" * 3000 + "]" * 3000,
        "clearance = " + "9" * 5000,
        "clearance = 1e999",
        "'a\\nb' = 1",
        "\ufeffclearance = -1",
        "x" * 20_000_000,
    ],
)
def test_a_task_that_is_none_is_refused(task: Path, content: str, capsys: pytest.CaptureFixture[str]) -> None:
    task.write_text(content)
    assert main(["pose", str(task)]) == 2
    captured = capsys.readouterr().err
    assert captured.startswith("wholebody: ")
    assert captured.count("\n") == 1
    assert len(captured) < 500


@pytest.mark.parametrize("name", ["/dev/zero", "pipe.toml", ".", "x" * 5000 + ".toml", "a\0b.toml", "\ud800.toml"])
def test_what_is_no_file_is_refused(task: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(task.parent / "pipe.toml")
    assert main(["pose", name]) == 2
    captured = capsys.readouterr().err
    assert captured.startswith("wholebody: ")
    assert captured.count("\n") == 1
    assert len(captured) < 700


@pytest.mark.parametrize(
    "content",
    [
        '{"task": "small.toml", "q": [' + "9" * 400 + "]}",
        '{"task": "small.toml", "q": [' + "9" * 5000 + "]}",
        "[" * 200_000,
        '{"task": "a\\u0000b", "q": [1]}',
        '{"task": "/dev/zero", "q": [1]}',
        "{}",
        "[]",
        '{"task": "small.toml", "q": [1, 2]}',
        '{"task": "small.toml", "q": "x"}',
        '{"task": "gone.toml", "q": [1]}',
        "{",
    ],
)
def test_a_result_that_is_none_is_refused(task: Path, content: str, capsys: pytest.CaptureFixture[str]) -> None:
    (task.parent / "result.json").write_text(content)
    assert main(["show", "result.json", "--save", "a.html"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_figure_describes_and_writes_what_can_be_loaded_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["figure", "human", "--sex", "female", "--stature", "1.62", "--mass", "60"]) == 0
    printed = capsys.readouterr().out
    assert "55 degrees of freedom, 60.0 kg" in printed
    assert re.search(r"left_elbow_flexion\s+0.0 deg\s+150.0 deg", printed)
    out = tmp_path / "woman.urdf"
    assert main(["figure", "human", "--sex", "female", "--stature", "1.62", "--mass", "60", "--out", str(out)]) == 0
    model = pin.buildModelFromUrdf(str(out), pin.JointModelFreeFlyer())
    assert model.nv == 55
    assert pin.computeTotalMass(model) == pytest.approx(60.0, abs=1e-6)
    options = ["--proportion", "sitting_height=0.92", "--proportion", "hand_length=0.19", "--age", "50"]
    assert main(["figure", "human", "--sex", "female", *options, "--out", str(out)]) == 0
    model = pin.buildModelFromUrdf(str(out), pin.JointModelFreeFlyer())
    same = wb.load("human", sex="female", proportions={"sitting_height": 0.92, "hand_length": 0.19}, age=50).model
    np.testing.assert_allclose(model.upperPositionLimit, same.upperPositionLimit)
    for joint, placement in zip(list(model.names)[2:], list(model.jointPlacements)[2:], strict=True):
        wanted = same.jointPlacements[same.getJointId(joint)]
        np.testing.assert_allclose(placement.translation, wanted.translation, atol=1e-9)


def test_demo_tasks_can_all_be_read(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--list"]) == 0
    listed = capsys.readouterr().out
    for name, path in task_paths().items():
        assert name in listed
        assert wb.read_task(path).problem.goals


def test_help_is_there_and_light() -> None:
    commands = [[], ["pose"], ["show"], ["figure"], ["demo"], ["doctor"]]
    code = (
        "import sys; from wholebody.cli import main\n"
        f"for command in {commands}:\n"
        "    try: main([*command, '--help'])\n"
        "    except SystemExit as end: assert end.code == 0\n"
        "assert 'pinocchio' not in sys.modules and 'rich' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("usage: wholebody") == len(commands)


UNUSED = (
    *(
        "wholebody.cli.clip.avoid",
        "wholebody.cli.bench.measurements",
        "wholebody.motion.clip",
        "wholebody.tracking.drag",
    ),
    *("wholebody.methods.newton.assembly", "wholebody.figures.surface.making", "scipy.ndimage", "scipy.spatial"),
    *("asyncio", "jinja2", "matplotlib", "osqp", "qpsolvers", "rich.progress", "tornado", "trimesh"),
)


def test_a_command_loads_nothing_that_it_does_not_use(tmp_path: Path) -> None:
    """The name of its task is a title whatever the locale: it is asked for after the solve, which would be lost."""
    task = tmp_path / f"\u00fcn\u00ef\n{'a' * 230}.toml"
    shutil.copyfile(task_paths()["shelf"], task)
    problem = wb.read_task(task).problem
    with wb.Viewer(problem.scene) as viewer:
        viewer.show(problem.start)  # makes the body's surface, which is kept
    code = (
        "import sys, wholebody.cli as cli; cli.main(sys.argv[1:])\n"
        f"print(*(name for name in {UNUSED} if name in sys.modules), file=sys.stderr)"
    )
    command = [sys.executable, "-c", code, "pose", str(task), "--no-picture", "--out", str(tmp_path / "out")]
    plain = {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0", "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0"}
    done = subprocess.run(command, env={**os.environ, **plain}, capture_output=True, text=True, check=True)
    assert not done.stderr.split()
    assert (tmp_path / "out" / "scene.html").exists()


def test_the_browser_starts_before_the_posture_is_found(
    task: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    started: list[int] = []

    def solve(*_: object) -> None:
        raise wb.InputError(f"{len(started)} browsers wait")

    monkeypatch.setattr(screenshot.Screenshots, "start", lambda _: started.append(1))
    monkeypatch.setattr("wholebody.cli.pose.solve", solve)
    assert main(["pose", str(task)]) == 2
    assert "1 browsers wait" in capsys.readouterr().err


def test_a_wrong_option_is_code_2() -> None:
    with pytest.raises(SystemExit) as ended:
        main(["pose"])
    assert ended.value.code == 2


def test_what_takes_long_is_told_on_stderr_once_and_the_cache_is_cleared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("WHOLEBODY_CACHE", str(tmp_path))
    arm = str(root / "tests" / "data" / "arm" / "arm.urdf")
    command = [sys.executable, "-c", "import sys; from wholebody.cli import main; sys.exit(main(sys.argv[1:]))"]
    first, again = (
        subprocess.run([*command, "figure", arm], capture_output=True, text=True, check=True) for _ in range(2)
    )
    assert "bracket.stl" in first.stderr
    assert not again.stderr
    assert first.stdout == again.stdout
    assert "more volume" in first.stdout
    assert main(["doctor", "--clear-cache"]) == 0
    assert "removed 1 meshes" in capsys.readouterr().out
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("package", "command"), [("viser", ["drag", "--live"])])
def test_a_package_that_is_missing_is_named(
    package: str,
    command: list[str],
    root: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    if command[0] == "drag":
        command = ["drag", str(root / "examples" / "tasks" / "shelf.toml"), "--live", "--out", str(tmp_path)]
    assert main(command) == 2
    assert f"{package}, which is not installed; run: pip install 'wholebody[" in capsys.readouterr().err


@pytest.mark.parametrize(
    "command",
    [
        ["clip", "check", "walk.npz"],
        ["clip", "avoid", "walk.npz"],
        ["clip", "retarget", "walk.bvh"],
        ["study", "study.toml"],
        ["reach", "task.toml", "--frame", "tip", "--low", "0,0,0", "--high", "1,1,1"],
        ["bench", "compare"],
    ],
    ids=" ".join,
)
def test_a_cluster_that_does_not_answer_is_refused_even_for_one_case(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed")
    before = set(threading.enumerate())
    assert main([*command, "--cluster", "not an address"]) == 2
    assert set(threading.enumerate()) <= before  # a client that is left as it is blocks the next one, now and then
    assert "no dask scheduler answers at not an address" in capsys.readouterr().err
