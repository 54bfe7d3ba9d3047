"""`wholebody world` as people use it."""

from __future__ import annotations

from pathlib import Path

import pytest

from wholebody.bench.tables import read_rows
from wholebody.bench.world_runs import WorldFrameRow
from wholebody.cli import main
from wholebody.dynamics.scenes import WORLD_SCENES

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


def test_a_run_writes_numbers_chart_and_animation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["world", "push_ball", "--frames", "20", "--out", str(out)]) == 0
    assert "push_ball" in capsys.readouterr().out
    _, rows = read_rows(out / "push_ball.csv", WorldFrameRow)
    assert len(rows) == 20
    assert max(row.deepest_mm for row in rows) <= 0.1
    assert {path.name for path in out.iterdir()} == {
        "push_ball.csv", "push_ball.html", "push_ball.png", "push_ball.svg", "world.md",
    }  # fmt: skip


def test_objects_of_a_task_file_fall_where_they_have_a_mass(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    task, out = tmp_path / "ball.toml", tmp_path / "out"
    task.write_text(TASK.format(body="mass = 2.0"))
    assert main(["world", str(task), "--frames", "12", "--out", str(out)]) == 0
    _, rows = read_rows(out / "ball.csv", WorldFrameRow)
    energies = [row.energy for row in rows]
    assert energies == pytest.approx(
        [energies[0]] * 12, abs=1e-6
    )  # it falls for a fifth of a second, and meets nothing
    task.write_text(TASK.format(body='material = "metal"'))
    assert main(["world", str(task), "--out", str(out)]) == 2
    assert "density" in capsys.readouterr().err
    task.write_text(TASK.format(body="mass = 2.0\ndensity = 300.0"))
    assert main(["world", str(task), "--out", str(out)]) == 2
    assert "give one of them" in capsys.readouterr().err
