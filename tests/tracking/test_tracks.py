"""Clips of placements and angles, scripted ones, and CSV files, whose faults are told with their line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.motion import posed
from wholebody.tracking.scenes import script, smooth


def track(hand: wb.Figure, frames: int = 5) -> wb.Clip:
    return wb.Clip(hand, np.tile(hand.neutral, (frames, 1)), 0.02, "glove")


def test_placements_and_glove_angles(hand: wb.Figure) -> None:
    angles: dict[str, Any] = {"right_index_pip_flexion": [0.0, 0.1, 0.2], "right_thumb_ip_flexion": 0.3}
    made = posed(hand, roots=[(0.1, 0.2, 0.3)] * 3, angles=angles, posture="open", dt=0.02)
    assert [hand.joint_values(q)["right_index_pip_flexion"] for q in made.q] == [0.0, 0.1, 0.2]
    assert all(hand.joint_values(q)["right_thumb_ip_flexion"] == 0.3 for q in made.q)
    np.testing.assert_allclose(made.q[:, :7], [[0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]] * 3)
    with pytest.raises(wb.InputError, match=r"different length .*right_index_pip_flexion 3, root 2"):
        posed(hand, roots=[(0.0, 0.0, 0.0)] * 2, angles=angles, dt=0.02)
    with pytest.raises(wb.InputError, match="frame 1"):
        posed(hand, roots=[(0.0, 0.0, 0.0), (0.0, np.nan, 0.0)], dt=0.02)
    with pytest.raises(wb.UnknownNameError):
        posed(hand, angles={"right_index_pip": [0.0]}, dt=0.02)


def test_files_give_back_what_was_written(hand: wb.Figure, tmp_path: Path) -> None:
    written = track(hand)
    path = written.write(tmp_path / "glove.csv")
    read = wb.read_clip(path, hand)
    np.testing.assert_array_equal(read.q, written.q)
    assert read.dt == pytest.approx(written.dt)
    lines = path.read_text().splitlines()
    columns = [line.split(",") for line in lines]
    path.write_text("\n".join(",".join(reversed(line)) for line in columns))
    np.testing.assert_array_equal(wb.read_clip(path, hand).q, written.q)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda lines: [lines[0].replace("right_thumb_ip_flexion", "thumb"), *lines[1:]],
            "line 1: no column .*'thumb'",
        ),
        (lambda lines: [line.partition(",")[2] for line in lines], "line 1: the columns lack time"),
        (lambda lines: [line.replace(".", "\0").replace(",", ";").replace("\0", ",") for line in lines], "semicolons"),
        (lambda lines: [*lines[:3], lines[3] + ",1.0", *lines[4:]], "line 4: 29 values and not 28"),
        (lambda lines: [*lines[:2], lines[2].replace("0.5", "x", 1), *lines[3:]], "line 3: 'x' is no number"),
        (lambda lines: [*lines[:3], "9" + lines[3], *lines[4:]], "line 4: the time step changes"),
        (lambda lines: lines[:2], "line 2: .*at least two frames"),
        (
            lambda lines: [*lines[:3], "", lines[3].rsplit(",", 1)[0] + ",nan", *lines[4:]],
            "line 5: right_thumb_ip_flexion is nan; 1 values",
        ),
        (
            lambda lines: [lines[0].replace("right_thumb_ip_flexion", "root_x"), *lines[1:]],
            "line 1: the column root_x occurs twice",
        ),
        (lambda lines: [*lines[:2], "9" * 140_000 + lines[2], *lines[3:]], "line 3: is not CSV .*field larger"),
        (lambda lines: [lines[0], *(line.rsplit(",", 1)[0] + ",1e200" for line in lines[1:])], "line 2: .*beyond 1e"),
    ],
)
def test_broken_files_are_named_by_line(hand: wb.Figure, tmp_path: Path, change: Any, message: str) -> None:
    path = track(hand).write(tmp_path / "glove.csv")
    path.write_text("\n".join(change(path.read_text().splitlines())))
    with pytest.raises(wb.WholebodyError, match=message):
        wb.read_clip(path, hand)


@pytest.mark.parametrize("rate", [119.88, 120.0, 60.0, 30.0])
def test_times_of_three_decimals_have_their_mean_step(rate: float, hand: wb.Figure, tmp_path: Path) -> None:
    path = track(hand).write(tmp_path / "glove.csv")
    header, *lines = path.read_text().splitlines()
    values = [line.partition(",")[2] for line in lines]
    made = [f"{k / rate:.3f},{values[k % len(values)]}" for k in range(600)]
    path.write_text("\n".join([header, *made]))
    assert 1.0 / wb.read_clip(path, hand).dt == pytest.approx(rate, rel=5e-4)
    path.write_text("\n".join([header, *made[:300], *made[302:]]))
    with pytest.raises(wb.FileFormatError, match="line 302: the time step changes"):
        wb.read_clip(path, hand)


@pytest.mark.parametrize("unit", [" [deg]", "_deg", " (°)", "(Degrees)"])
def test_columns_may_be_few_and_in_degrees(unit: str, hand: wb.Figure, tmp_path: Path) -> None:
    path = tmp_path / "glove.csv"
    path.write_text(f"time,right_index_mcp_flexion{unit}\n0.0,0\n0.1,45\n0.2,90\n")
    with pytest.warns(UserWarning, match=r"no column for root_x.* and \d+ more; they stay as in the neutral posture"):
        read = wb.read_clip(path, hand)
    found = [hand.joint_values(q) for q in read.q]
    neutral = hand.joint_values(hand.neutral)
    assert [values["right_index_mcp_flexion"] for values in found] == pytest.approx([0.0, np.pi / 4, np.pi / 2])
    assert all(values["right_thumb_ip_flexion"] == neutral["right_thumb_ip_flexion"] for values in found)


def test_scripts_are_smooth_and_seeded(hand: wb.Figure) -> None:
    assert [smooth(s) for s in (0.0, 0.5, 1.0)] == [0.0, 0.5, 1.0]
    away = hand.posture("grip")
    away[:3] = 0.3, 0.1, 0.5
    keys = [(0.0, hand.neutral), (1.0, away), (0.5, away)]
    made = script(hand, keys, dt=0.01, seed=3)
    assert len(made) == 151
    np.testing.assert_allclose(made.q[0], hand.neutral, atol=1e-12)
    np.testing.assert_allclose(made.q[-1], away, atol=1e-12)
    np.testing.assert_array_equal(made.q, script(hand, keys, dt=0.01, seed=3).q)
    assert not np.array_equal(made.q, script(hand, keys, dt=0.01, seed=4).q)
    speed = np.array([pin.difference(hand.model, a, b) for a, b in zip(made.q[:-1], made.q[1:], strict=True)]) / 0.01
    farthest = np.linalg.norm(away[:3] - hand.neutral[:3])
    assert np.linalg.norm(speed[:, :3], axis=1).max() == pytest.approx(1.875 * farthest, rel=0.1)
    assert np.abs(np.diff(speed, axis=0)).max() < 0.2


def test_a_table_without_names_has_the_order_of_the_figure(tmp_path):
    """Unitree's LAFAN1 files: root, quaternion, joints, thirty lines a second; another count of numbers is refused."""
    figure = wb.load("avatar")
    rng = np.random.default_rng(3)
    q = np.tile(figure.neutral, (4, 1))
    q[:, 7:] += rng.uniform(-0.1, 0.1, (4, len(figure.joints)))
    path = tmp_path / "walk1_subject1.csv"
    np.savetxt(path, q, delimiter=",", fmt="%.9f")
    with pytest.warns(UserWarning, match="no names; the columns were taken as root_x to"):
        track = wb.read_clip(path, figure)
    assert track.dt == pytest.approx(1.0 / 30.0)
    np.testing.assert_allclose(track.q, q, atol=1e-8)
    np.savetxt(path, q[:, 1:], delimiter=",", fmt="%.9f")
    with pytest.raises(wb.FileFormatError, match=rf"no names of columns, and {q.shape[1] - 1} numbers where"):
        wb.read_clip(path, figure)
