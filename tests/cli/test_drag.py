"""`wholebody drag` as people use it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.csv_rows import csv_rows
from tests.saved_page import unpacked
from tests.task_text import box, figure, point, table
from wholebody.cli import main

ARM = (
    figure("avatar")
    + box("wall", [0.1, 3.0, 3.0], [0.65, 0.0, 1.0])
    + point("right_palm", [0.35, -0.3, 1.2])
    + table("[[constraint]]", type="freeze", joints=["root", "left_leg", "right_leg"])
)


@pytest.fixture
def task(tmp_path: Path) -> Path:
    file = tmp_path / "reach.toml"
    file.write_text(ARM)
    return file


def test_a_circle_by_newton_prints_a_table_and_writes_all_files(
    task: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    path = ["--path", "circle", "--size", "0.05"]
    code = main(["drag", str(task), *path, "--method", "newton", "--frames", "8", "--out", str(out)])
    printed = capsys.readouterr().out
    assert code == 0
    assert "reach" in printed
    assert "end: solved" in printed
    assert {path.name for path in out.iterdir()} == {
        f"reach-newton.{kind}" for kind in ("csv", "html", "md", "png", "svg")
    }
    rows = csv_rows(out / "reach-newton.csv")
    assert "# processor: " in (out / "reach-newton.csv").read_text()
    assert [int(row["frame"]) for row in rows] == list(range(8))
    assert max(float(row["deepest mm"]) for row in rows) < 0.1
    assert max(float(row["between mm"]) for row in rows) < 1.0
    assert "| reach | newton" in (out / "reach-newton.md").read_text()
    assert "animation" in unpacked(out / "reach-newton.html")


def test_a_file_that_leads_into_the_wall_ends_there(
    task: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "way.csv").write_text("x,y,z\n0.35,-0.3,1.2\n0.75,-0.3,1.2\n")
    out = tmp_path / "out"
    command = ["drag", str(task), "--path", str(tmp_path / "way.csv"), "--method", "qp", "--out", str(out)]
    assert main([*command, "--goal", "0", "--frames", "20"]) == 1
    assert "unreachable" in "".join(capsys.readouterr().out.split())
    rows = csv_rows(out / "reach-qp.csv")
    assert float(rows[-1]["error mm"]) > 100.0
    assert max(float(row["deepest mm"]) for row in rows) < 0.1


def test_a_bad_file_of_places_is_named_with_its_line(
    task: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "way.csv").write_text("0.3 0 1\n0.3 zero 1\n")
    assert main(["drag", str(task), "--path", str(tmp_path / "way.csv"), "--out", str(tmp_path / "out")]) == 2
    assert "way.csv, line 2: '0.3 zero 1' is not a place" in capsys.readouterr().err


def test_a_task_without_a_goal_that_moves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "none.toml").write_text('[figure]\nname = "avatar"\n')
    assert main(["drag", str(tmp_path / "none.toml"), "--path", "line"]) == 2
    assert "no point, frame or relative goal" in capsys.readouterr().err
