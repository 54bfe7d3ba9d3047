"""`wholebody bench motion`: its clips, what it keeps, and its report."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.bench.measure import clips, motion
from wholebody.bench.measure.motion import CHECKED
from wholebody.bench.rows import Row, chart
from wholebody.bench.tables import read_rows
from wholebody.cli import main
from wholebody.motion import avoidance, judging
from wholebody.motion.worn_equipment import dressed

NAME = "sword cut"


@pytest.mark.parametrize("name", clips.SYNTHETIC)
def test_synthetic_clips_collide_are_smooth_and_within_limits(name: str) -> None:
    figure = wb.load("human")
    clip = clips.synthetic(name, figure)
    assert clip.dt == pytest.approx(1 / 30)
    assert all(figure.within_limits(q, 1e-6) for q in clip.q)
    assert np.abs(clip.velocities()[[0, -1]]).max() < 0.5
    found = wb.check(clip)
    assert found.colliding > 5
    assert not wb.check(clip[:1]).contacts


@pytest.mark.parametrize("worn", clips.EQUIPMENT)
def test_equipment_is_attached(worn: str) -> None:
    scene = dressed(wb.load("human"), worn)
    assert all(thing.segment is not None for thing in scene.objects.values())
    assert bool(scene.objects) == (worn != "nothing")


def test_a_run_goes_on_where_it_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []

    def run(*worn: str) -> list[Row]:
        return motion.run({NAME: None}, [(NAME, each, CHECKED) for each in worn], tmp_path, {}, tell=told.append)

    (first,) = run("nothing")
    clip = clips.synthetic(NAME, wb.load("human"))
    found = wb.check(clip)
    assert [first[name] for name in ("frames", "collide before", "dips")] == [len(clip), found.colliding, found.dips]
    assert first["deepest mm"] == pytest.approx(1e3 * found.deepest)
    assert [first[name] for name in ("deviation rad", "jerk", "outcome")] == [0.0, 1.0, "left"]
    (kept,) = read_rows(tmp_path / "motion.csv", Row)[1]
    assert {"said": "", **kept.figures} == first.figures
    told.clear()
    again, other = run("nothing", "pack")
    assert again == kept  # its times too: it was not measured again
    assert other.case == f"{NAME}, pack"
    assert told == [f"{NAME}, pack, check: {other['outcome']}"]
    monkeypatch.setattr(motion, "measured", None)
    (same,) = run("pack")
    assert {"said": "", **same.figures} == other.figures


def test_a_case_that_ends_is_told_and_the_others_go_on(tmp_path: Path) -> None:
    (row,) = motion.run(
        {NAME: None}, [(NAME, "nothing", CHECKED)], tmp_path, {}, slowest=lambda duration: 1e-3
    )  # fmt: skip
    assert row["outcome"] == "overtime"
    assert "sword cut, nothing, check: overtime" in motion.motion_report([row], {"wholebody": "0"})


def test_a_recording_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    (tmp_path / "broken.bvh").write_text("HIERARCHY\n")
    cases = [("broken", "nothing", CHECKED)]
    rows = motion.run({"broken": tmp_path / "broken.bvh"}, cases, tmp_path / "out", {})
    assert rows[0]["outcome"] == "no clip"
    assert "broken.bvh" in rows[0]["said"]


def test_a_clip_that_misses_what_is_held_is_not_free(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing collides before or after, but a hand or a foot has left its place."""
    figure = wb.load("human")
    path = tmp_path / "still.npz"
    wb.Clip(figure, np.array([figure.posture("standing")] * 8), 1 / 30, "still").write(path)
    missed, freed = 0.0, avoidance.avoid

    def avoid(*given: object, **more: object) -> judging.Avoided:
        found = freed(*given, **more)  # type: ignore[arg-type]
        return dataclasses.replace(found, report=dataclasses.replace(found.report, missed=missed))

    monkeypatch.setattr(avoidance, "avoid", avoid)
    assert motion.measured("nothing", "trajectory", str(path), 600.0)["outcome"] == "free"
    missed = 5e-3
    assert motion.measured("nothing", "trajectory", str(path), 600.0)["outcome"] == "left"


def test_the_report_has_every_method_and_every_case(tmp_path: Path) -> None:
    base = {"frames": 60, "outcome": "free", "collide before": 20, "after": 0, "deepest mm": 0.01, "between mm": 0.05,
            "deviation rad": 0.1, "mm": 9.0, "jerk": 2.0, "feet slide mm": 0.5, "s a second": 0.5}  # fmt: skip
    rows = [
        Row("walk, pack", "bisection", base),
        Row("walk, pack", "trajectory", base | {"deviation rad": 0.06, "jerk": 1.1, "s a second": 1.5}),
        Row("walk, pack", "frames", base | {"outcome": "left", "after": 3, "deepest mm": 2.0}),
        Row("walk, pack", CHECKED, base | {"outcome": "left"}),
    ]
    one, other = (next(row for row in motion.summary(rows) if row.tool == name) for name in ("trajectory", "frames"))
    assert (one["free"], one["deviation rad, median"], one["s a second of motion, median"]) == ("1 of 1", 0.06, 1.5)
    assert (other["free"], other["deepest, most mm"]) == ("0 of 1", 2.0)
    text = motion.motion_report(rows, {"wholebody": "0"})
    assert "| all clips | trajectory | 1 of 1 |" in text
    assert "nan" not in text
    drawn = motion.panels(rows)
    assert {label for panel in drawn for label in panel.lines} == {"bisection", "trajectory"}
    for path in chart(drawn, tmp_path / "motion"):
        assert path.stat().st_size > 1000


def test_an_unknown_name_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path)
    assert main(["bench", "motion", "--out", out, "--equipment", "pak"]) == 2
    assert "pack" in capsys.readouterr().err
    assert main(["bench", "motion", "--out", out, "--clips", str(tmp_path / "none")]) == 2
    assert "--clips" in capsys.readouterr().err
