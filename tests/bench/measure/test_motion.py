"""`wholebody bench motion`: its clips, its summary, and the command."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.measure import motion
from wholebody.cli import main
from wholebody.motion.batch_table import AvoidedCase
from wholebody.motion.worn_equipment import dressed


def test_synthetic_clips_collide_are_smooth_and_within_limits() -> None:
    figure = wb.load("human")
    clip = motion.synthetic("arms crossed", figure)
    assert clip.dt == pytest.approx(1 / 30)
    assert all(figure.within_limits(q, 1e-6) for q in clip.q)
    assert np.abs(clip.velocities()[[0, -1]]).max() < 0.5
    found = wb.check(clip)
    assert found.colliding > 5
    assert not wb.check(clip[:1]).contacts


@pytest.mark.parametrize("worn", motion.EQUIPMENT)
def test_equipment_is_attached(worn: str) -> None:
    scene = dressed(wb.load("human"), worn)
    assert all(thing.segment is not None for thing in scene.objects.values())
    assert bool(scene.objects) == (worn != "nothing")


def test_a_summary_has_every_method_and_the_report_every_case_without_a_clip(tmp_path: Path) -> None:
    done = AvoidedCase("walk", "pack", "bisection", "free", frames=61, duration=2.0, seconds=1.0, deepest=1e-5)
    done = replace(done, deepest_between=5e-5, angle=0.1, distance=9e-3, jerk=2.0, sliding=5e-4)
    better = replace(done, method="trajectory", angle=0.06, jerk=None, seconds=3.0)
    worse = replace(done, method="mine", outcome="left", deepest=2e-3)
    refused = AvoidedCase("walk", "pack", "other", "refused", "it has one frame")
    cases = [done, better, replace(better, clip="run", angle=0.08), worse, refused]
    rows = {row.tool: row for row in motion.summary(cases)}
    assert [row["free"] for row in rows.values()] == ["1 of 1", "2 of 2", "0 of 1", "0 of 1"]
    assert rows["trajectory"]["deviation rad, median"] == pytest.approx(0.07)
    assert rows["trajectory"]["s a second of motion, median"] == 1.5
    assert rows["mine"]["deepest, most mm"] == 2.0
    text = motion.motion_report(cases, {"wholebody": "0"})
    assert "| all clips | trajectory | 2 of 2 |" in text
    assert "walk, pack, other: refused (it has one frame)" in text
    assert "nan" not in text
    drawn = motion.panels(cases)
    assert {label for panel in drawn for label in panel.lines} == {"bisection", "trajectory"}


def test_the_command_frees_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    short = motion.synthetic("squat", wb.load("human"))[:8]
    monkeypatch.setattr(motion, "synthetic", lambda name, figure: short)
    monkeypatch.setattr(motion, "panels", lambda cases: ())  # the test before this one draws them
    words = ["bench", "motion", "--only", "squat", "--equipment", "nothing", "--methods", "bisection", "--out"]
    for said in ("squat, nothing, bisection: free\n", ""):
        assert main([*words, str(tmp_path)]) == 0
        assert capsys.readouterr().out.startswith(said + "Clips of a person")
    assert "| all clips | bisection | 1 of 1 |" in (tmp_path / "motion.md").read_text()
    assert (tmp_path / "motion" / "cases.csv").is_file()


def test_an_unknown_name_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path)
    assert main(["bench", "motion", "--out", out, "--equipment", "pak"]) == 2
    assert "pack" in capsys.readouterr().err
    assert main(["bench", "motion", "--out", out, "--clips", str(tmp_path / "none")]) == 2
    assert "--clips" in capsys.readouterr().err
