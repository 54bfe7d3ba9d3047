"""Recordings followed by two tools and judged alike."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.motion.test_retargeting import person
from wholebody.base.errors import InputError
from wholebody.bench.measure.clips import compare, judged, totals
from wholebody.bench.rows import Row
from wholebody.cli.main import main
from wholebody.motion.roles import matched
from wholebody.motion.stance import point_paths


def number(value: object) -> float:
    assert isinstance(value, float)
    return value


def test_the_judge_tells_slides_depths_and_bones() -> None:
    figure = wb.load("human")
    motion = person(16)
    roles = matched(motion, figure, None)
    clip = wb.retarget(motion, figure)
    good = judged(motion, clip, roles)
    assert good["frames that overlap"] == "0 of 16"
    assert number(good["slide mm/s"]) < 1.0
    moved = np.array(clip.q)
    moved[:, 0] += 0.2 * motion.dt * np.arange(16)  # at 0.2 m/s
    moved[:, 2] -= 0.03  # 3 cm deep
    bad = judged(motion, clip.with_q(moved), roles)
    assert number(bad["slide mm/s"]) == pytest.approx(200.0, abs=2.0)
    assert number(bad["deepest mm"]) == pytest.approx(30.0, abs=1.0)
    assert bad["bones median deg"] == pytest.approx(number(good["bones median deg"]), abs=1e-6)
    assert number(bad["jerk"]) == pytest.approx(number(good["jerk"]), rel=1e-6)  # a constant speed has none


def test_the_judge_looks_at_what_lies_below() -> None:
    """A person turns about the left foot on a box: the right one slides if the box is below it, or hangs beside it."""
    figure, low = wb.load("human"), person(16)
    motion = replace(low, positions=low.positions + [0.0, 0.0, 0.6])
    roles, q = matched(motion, figure, None), np.array(wb.retarget(low, figure).q)
    placed = roles.places(figure)
    feet = [placed[f"{side}_{part}"] for side in ("left", "right") for part in ("ankle", "toe")]
    points = point_paths(figure, q[:1], feet)[0]
    left, far = points[0], 1e3 * np.linalg.norm((points - points[0])[:, :2], axis=1)
    for k in range(16):
        turn = pin.utils.rotate("z", 0.5 * motion.dt * k)
        at = pin.XYZQUATToSE3(q[k, :7])
        at = pin.SE3(turn @ at.rotation, turn @ (at.translation - left) + left + [0.0, 0.0, 0.6])
        q[k, :7] = pin.SE3ToXYZQUAT(at)
    slides = []
    for edge in (-1.0, 0.0):
        scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
        scene.add(wb.Box((2.0, 1.0 - edge, 0.6)), name="box", at=(0.0, 0.5 + 0.5 * edge, 0.3))
        slides.append(number(judged(motion, wb.Clip(figure, q, motion.dt), roles, scene)["slide mm/s"]))
    assert slides[0] == pytest.approx(0.5 * far.mean(), rel=0.01)
    assert slides[1] == pytest.approx(0.5 * far[:2].mean(), rel=0.01)


def test_what_goes_with_a_thing_slides_relative_to_it() -> None:
    """A lift goes up and forward at 0.5 m/s, faster than what rests in the world, and a person stands on it."""
    figure, motion = wb.load("human"), person(24)
    roles, clip, frames = matched(motion, figure, None), wb.retarget(motion, figure), np.arange(24)
    ways = 0.5 * motion.dt * frames[:, None] * [0.6, 0.0, 0.8]
    goes = replace(motion, positions=motion.positions + ways[:, None])
    scene = wb.Scene(figure).add(wb.Box((1.0, 1.0, 0.1)), name="lift", at=(0.0, 0.0, -0.05))
    track = np.hstack([ways + [0.0, 0.0, -0.05], np.tile([0.0, 0.0, 0.0, 1.0], (24, 1))])
    for speed in (0.0, 0.3):
        q = np.array(clip.q)
        q[:, :3] += ways
        q[:, 1] += speed * motion.dt * frames
        carried = wb.Clip(figure, q, clip.dt, things={"lift": track})
        found = judged(goes, carried, roles, scene, {"lift": track})
        assert number(found["slide mm/s"]) == pytest.approx(1e3 * speed, abs=2.0)
        assert found["frames that overlap"] == "0 of 24"


def test_totals_are_medians_of_each_figure_and_tool() -> None:
    figures = {"bones median deg": 1.0, "slide mm/s": 2.0, "jerk": 1.0, "frames a s": 50.0}
    rows = [
        Row("a, man", "one", {**figures, "frames that overlap": "0 of 9", "deepest mm": 4.0}),
        Row("b, man", "one", {**figures, "slide mm/s": 4.0, "frames that overlap": "3 of 9", "deepest mm": 8.0}),
        Row("a, man", "other", {**figures, "frames that overlap": "0 of 9", "deepest mm": 1.0}),
    ]
    one, other = totals(rows)
    assert (one["clips"], one["without overlap in frames"], one["slide mm/s"]) == (2, 1, 3.0)
    assert (one["deepest mm, median"], one["deepest mm, most"]) == (6.0, 8.0)
    assert (other.case, other["clips"]) == ("man", 1)
    (lying,) = totals([Row("a, man", "one", {**rows[0].figures, "slide mm/s": float("nan")})])
    assert np.isnan(number(lying["slide mm/s"]))
    assert lying["jerk"] == 1.0


def test_both_tools_follow_a_recording(tmp_path: Path) -> None:
    pytest.importorskip("mink")
    figure = wb.load("human")
    wb.Clip(figure, np.tile(figure.posture("standing"), (4, 1)), 1 / 30, "stands").write(tmp_path / "stands.bvh")
    ours, theirs = compare(tmp_path, [figure], 4)
    assert (ours.tool, theirs.tool) == ("wholebody", "mink, GMR's weights")
    assert number(ours["bones median deg"]) < 1.0
    assert number(theirs["bones median deg"]) < 5.0


def test_a_folder_without_recordings_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"is no folder with \.bvh files"):
        list(compare(tmp_path, [wb.load("human")], 4))


def test_the_command_writes_what_the_installed_tools_do(tmp_path: Path) -> None:
    figure, folder = wb.load("human"), tmp_path / "clips"
    folder.mkdir()
    wb.Clip(figure, np.tile(figure.posture("standing"), (4, 1)), 1 / 30, "stands").write(folder / "stands.bvh")
    assert main(["bench", "clips", str(folder), "--quick", "--out", str(tmp_path)]) == 0
    text = (tmp_path / "clips.md").read_text()
    assert "| stands, human | wholebody |" in text
    assert ("| stands, human | mink, GMR's weights |" in text) != ("Left out: mink" in text)
