"""Batches: each clip with each equipment by each method, once, whatever happens to the run."""

from __future__ import annotations

import csv
import json
import multiprocessing
import os
import sys
import time
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.cli import main
from wholebody.motion.batch_table import SHEET, TABLE


@pytest.fixture(scope="module")
def clip(human: wb.Figure) -> wb.Clip:
    """An arm that goes into the thigh and comes back."""
    angles = np.concatenate([np.linspace(0.1, -0.2, 4), np.linspace(-0.2, 0.1, 4)[1:]])
    standing = human.posture("standing")
    q = np.array([human.with_joints(standing, {"right_shoulder_abduction": angle}) for angle in angles])
    return wb.Clip(human, q, 0.1, "an arm")


def test_each_case_is_as_avoid_makes_it_and_is_done_once(clip: wb.Clip, tmp_path: Path) -> None:
    told: list[wb.motion.BatchProgress] = []

    def run(*equipment: str) -> tuple[wb.motion.AvoidedCase, ...]:
        return wb.motion.avoid_many([clip], tmp_path, equipment=equipment, methods=["bisection"], progress=told.append)

    (first,) = run("nothing")
    alone = wb.avoid(clip, method="bisection")
    assert (first.outcome, first.colliding_before, first.colliding) == ("free", alone.report.before.colliding, 0)
    made = wb.read_clip(tmp_path / first.file, clip.figure)
    assert np.array_equal(made.q, alone.clip.q)
    assert first.angle > 0.0
    assert [(now.done, now.total) for now in told] == [(0, 1), (1, 1)]
    again, packed = run("nothing", "pack")
    assert again == first  # its seconds too
    assert (packed.equipment, packed.file) == ("pack", "an_arm-pack-bisection.npz")
    assert [row["file"] for row in csv.DictReader((tmp_path / SHEET).open())] == [first.file, packed.file]
    rows = (json.loads(line)[1] for line in (tmp_path / TABLE).read_text().splitlines()[1:])
    assert [row["frames"] for row in rows] == [len(clip)] * 2
    (tmp_path / first.file).unlink()
    told.clear()
    run("nothing", "pack")
    assert [now.done for now in told] == [1, 2]


def test_another_clip_of_the_name_or_other_settings_are_done_anew(clip: wb.Clip, tmp_path: Path) -> None:
    (first,) = wb.motion.avoid_many([clip], tmp_path, methods=["bisection"])
    kept = wb.motion.avoid_many([clip[1:]], tmp_path, methods=[wb.motion.Bisection(), wb.motion.Bisection(room=0.02)])
    assert [row.method for row in kept] == ["bisection", "bisection 2"]
    assert kept[0].frames == first.frames - 1
    assert kept[1].angle > kept[0].angle


def test_what_is_wrong_with_one_file_is_told_and_the_others_are_made(
    clip: wb.Clip, human: wb.Figure, tmp_path: Path
) -> None:
    (tmp_path / "broken.csv").write_text("time\n")
    good = clip.write(tmp_path / "good.npz")
    rows = wb.motion.avoid_many(
        [tmp_path / "broken.csv", good], tmp_path / "out", figure=human, methods=["bisection"], jobs=2
    )
    assert [row.outcome for row in rows] == ["refused", "free"]
    assert "broken.csv" in rows[0].message
    made = wb.motion.read_many([good, tmp_path / "broken.csv"], tmp_path / "out", human)
    assert isinstance(made["good"], Path)
    assert "broken.csv" in str(made["broken"])
    made = wb.motion.read_many(["none.csv", "there/none.csv"], tmp_path / "out", human)
    assert set(made) == {"none", "there none"}


def test_input_is_refused_before_anything_is_written(clip: wb.Clip, tmp_path: Path) -> None:
    out = tmp_path / "out"
    for arguments, sentence in (
        ({"clips": [clip, clip]}, "two clips are named 'an arm'"),
        ({"clips": ["walk.bvh"]}, "say of which figure"),
        ({"clips": ["walk.bvh", 5]}, "a clip is 5; give the path"),
        ({"equipment": ["pak"]}, "pack"),
        ({"equipment": ["pack", "pack"]}, "two pieces of equipment are named 'pack'"),
        ({"methods": ["bisectoin"]}, "bisection"),
        ({"jobs": 0}, "jobs is 0"),
    ):
        with pytest.raises(wb.WholebodyError, match=sentence):
            wb.motion.avoid_many(**{"clips": [clip], "folder": out, **arguments})  # type: ignore[arg-type]
        assert not out.exists()


def told_to(command: list[str], said: Path) -> None:
    """Give a command in a process of its own, forked from this one."""
    os.setsid()
    with said.open("w") as file, redirect_stdout(file):
        code = main(command)
    sys.exit(code)


def test_a_batch_that_is_ended_goes_on(clip: wb.Clip, tmp_path: Path) -> None:
    """No half file is left, and the case that was made before is not made again."""
    files = [str(clip[k:].write(tmp_path / f"part{k}.npz")) for k in range(2)]
    command = ["clip", "avoid", *files, "--method", "bisection", "--out", str(tmp_path / "out")]
    run = multiprocessing.get_context("fork").Process(target=told_to, args=(command, tmp_path / "said"))
    run.start()
    table, ends = tmp_path / "out" / SHEET, time.monotonic() + 120.0
    while not (table.exists() and len(table.read_text().splitlines()) > 1):
        assert time.monotonic() < ends
        time.sleep(0.05)
    run.kill()
    run.join(60.0)
    before = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "out").glob("*.npz")}
    for name in before:
        wb.read_clip(tmp_path / "out" / name, clip.figure)
    assert main(command) == 0
    after = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "out").glob("*.npz")}
    assert len(after) == 2
    kept = [row["file"] for row in csv.DictReader(table.open())]
    assert before[kept[0]] == after[kept[0]]


def test_checking_many_gives_a_line_each(clip: wb.Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = clip.write(tmp_path / "arm.npz")
    assert main(["clip", "check", str(file), "--equipment", "nothing", "--equipment", "pack", "--json"]) == 1
    rows = json.loads(capsys.readouterr().out)
    assert [row["equipment"] for row in rows] == ["nothing", "pack"]
    assert [row["frames_in_collision"] for row in rows] == [wb.check(clip).colliding] * 2
    assert main(["clip", "check", str(file), str(file), "--html", str(tmp_path / "x.html")]) == 2


def test_retargeting_many_writes_a_folder(clip: wb.Clip, tmp_path: Path) -> None:
    files = [str(clip.write(tmp_path / f"arm{k}.npz")) for k in range(2)]
    assert main(["clip", "retarget", *files, "--out", str(tmp_path / "out")]) == 0
    for k in range(2):
        made = wb.read_clip(tmp_path / "out" / "originals" / f"arm{k}.npz", clip.figure)
        assert np.array_equal(made.q, clip.q)
    assert main(["clip", "retarget", *files, "--ground", "none", "--out", str(tmp_path / "other")]) == 2
