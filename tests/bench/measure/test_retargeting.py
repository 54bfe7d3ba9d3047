"""Recordings followed by two tools and judged alike."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from tests.motion.test_retargeting import person
from wholebody.base.errors import InputError
from wholebody.bench.measure.files import compare, judged, totals
from wholebody.bench.rows import Row
from wholebody.motion.roles import matched


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


def test_both_tools_follow_a_recording(tmp_path: Path) -> None:
    pytest.importorskip("mink")
    figure = wb.load("human")
    wb.Clip(figure, np.tile(figure.posture("standing"), (4, 1)), 1 / 30, "stands").write(tmp_path / "stands.bvh")
    ours, theirs = compare(tmp_path, [figure], 4)
    assert (ours.tool, theirs.tool) == ("wholebody", "mink, GMR's weights")
    assert number(ours["bones median deg"]) < 1.0
    assert number(theirs["bones median deg"]) < 5.0


def test_a_folder_without_recordings_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no \.bvh files"):
        list(compare(tmp_path, [wb.load("human")], 4))
