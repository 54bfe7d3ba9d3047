"""`wholebody bench motion`: its clips, what it keeps, and its report."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.audits import motion_figures as figures
from wholebody.bench.measure.motion import cases, measuring, report
from wholebody.bench.measure.motion.measuring import CHECKED, NEAREST, MotionRow
from wholebody.bench.tables import read_rows
from wholebody.cli import main
from wholebody.motion import avoidance, judging
from wholebody.motion.worn_equipment import dressed

NAME = "sword cut"


@pytest.mark.parametrize("name", cases.SYNTHETIC)
def test_synthetic_clips_collide_are_smooth_and_within_limits(name: str) -> None:
    figure = wb.load("human")
    clip = cases.synthetic(name, figure)
    assert clip.dt == pytest.approx(1 / 30)
    assert all(figure.within_limits(q, 1e-6) for q in clip.q)
    assert np.abs(clip.velocities()[[0, -1]]).max() < 0.5
    found = wb.check(clip)
    assert found.colliding > 5
    assert not wb.check(clip[:1]).contacts


@pytest.mark.parametrize("worn", cases.EQUIPMENT)
def test_equipment_is_attached(worn: str) -> None:
    scene = dressed(wb.load("human"), worn)
    assert all(thing.segment is not None for thing in scene.objects.values())
    assert bool(scene.objects) == (worn != "nothing")


def test_a_run_goes_on_where_it_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []

    def run(worn: tuple[str, ...]) -> list[MotionRow]:
        return measuring.run({NAME: None}, worn, (CHECKED,), tmp_path, {}, tell=lambda *said: told.append(said[2]))

    (first,) = run(("nothing",))
    clip = cases.synthetic(NAME, wb.load("human"))
    found = wb.check(clip)
    assert (first.frames, first.before, first.dips) == (len(clip), found.colliding, found.dips)
    assert first.deepest_mm == pytest.approx(1e3 * found.deepest)
    assert (first.angle, first.jerk, first.hand_mm, first.outcome) == (0.0, 1.0, -1.0, "left")
    assert read_rows(tmp_path / "motion.csv", MotionRow)[1] == [first]
    told.clear()
    again, other = run(("nothing", "pack"))
    assert again == first  # its times too: it was not measured again
    assert other.equipment == "pack"
    assert sum("check" in line for line in told) == 1
    monkeypatch.setattr(measuring, "measured", None)
    assert run(("pack",)) == [other]


def test_a_case_that_ends_is_told_and_the_others_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measuring, "START", 0.0)
    monkeypatch.setattr(measuring, "SLOWEST", 1e-3)
    (row,) = measuring.run({NAME: None}, ("nothing",), (CHECKED,), tmp_path, {})
    assert (row.outcome, row.frames > 0, row.measured) == ("overtime", True, False)
    assert "sword cut, nothing, check: overtime" in report.report([row], {"wholebody": "0"})


def test_a_recording_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    (tmp_path / "broken.bvh").write_text("HIERARCHY\n")
    rows = measuring.run({"broken": tmp_path / "broken.bvh"}, ("nothing",), (CHECKED,), tmp_path / "out", {})
    assert rows[0].outcome == "no clip"
    assert "broken.bvh" in rows[0].said


def test_a_clip_that_misses_what_is_held_is_not_free(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing collides before or after, but a hand or a foot has left its place."""
    figure = wb.load("human")
    path = tmp_path / "still.npz"
    wb.Clip(figure, np.array([figure.posture("standing")] * 8), 1 / 30, "still").write(path)
    row, missed, freed = MotionRow("still", "nothing", "trajectory"), 0.0, avoidance.avoid

    def avoid(*given: object, **more: object) -> judging.Avoided:
        found = freed(*given, **more)  # type: ignore[arg-type]
        return dataclasses.replace(found, report=dataclasses.replace(found.report, missed=missed))

    monkeypatch.setattr(avoidance, "avoid", avoid)
    assert measuring.measured(row, str(path), 600.0).outcome == "free"
    missed = 5e-3
    assert measuring.measured(row, str(path), 600.0).outcome == "left"


def rows() -> list[MotionRow]:
    base = MotionRow("walk", "pack", "bisection", 60, 2.0, "free", 1.0, 1.0, 20, 0, 0, 30.0, 0.01, 0.05, angle=0.1,
                     distance_mm=9.0, jerk=2.0, sliding_mm=0.5, solves=40)  # fmt: skip
    return [
        base,
        dataclasses.replace(
            base, method="trajectory", angle=0.06, jerk=1.1, seconds=3.0, programs=12, hand_mm=1.4, off_mm=0.4
        ),
        dataclasses.replace(base, method="fade", outcome="left", after=3, deepest_mm=2.0, seconds=0.2),
        dataclasses.replace(base, method=CHECKED, seconds=0.1, outcome="left"),
    ]


def test_the_report_has_every_method(tmp_path: Path) -> None:
    text = report.report(rows(), {"wholebody": "0"})
    assert "| trajectory | 1 of 1 | 0.01 | 0.05 |" in text
    assert "| fade | 0 of 1 | 2.00 |" in text
    assert "deviation (rad) is 0.60 of bisection's" in text
    assert "| walk | pack | 60 | 20 | 0 | 30.0 | 0.1 |" in text
    assert "| trajectory | no frame deeper than 0.1 mm | 1 of 1 |  |" in text
    assert "| fade | no frame deeper than 0.1 mm | 0 of 1 | walk, pack: 3 frames |" in text
    assert "| trajectory | deviation (rad) at most 0.7 of bisection's | 1 of 1 |  |" in text
    assert "| trajectory | at most 2 s a second of motion | 1 of 1 |  |" in text
    assert "| bisection | hands on the weapon" not in text
    assert "| trajectory | hands on the weapon within 1 mm | 1 of 1 |  |" in text
    assert "| trajectory | hands within 1 mm along the weapon too | 0 of 1 | walk, pack: 1.4 mm |" in text
    assert "that is asked: 2 lines</summary>" in text
    assert "| fade | no frame deeper than 0.1 mm | walk | pack | 3 frames |" in text
    assert "nan" not in text
    for path in (*report.chart(rows(), tmp_path / "motion"), *report.check_chart(rows(), tmp_path / "check")):
        assert path.stat().st_size > 1000


def test_the_camera_sees_who_lies_from_the_side_with_the_head_in_the_picture() -> None:
    human = wb.load("human")
    q = human.neutral.copy()
    # on the belly, the head towards +y
    q[3:7] = pin.Quaternion(np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])).coeffs()
    clip = wb.Clip(human, [q], 0.1)  # type: ignore[arg-type]
    eye, target = figures.camera(clip, 0, figures.SIDE)
    state = wb.Scene(human).state(clip.q[0])
    head, toes = (np.array(state.frame(human.frame_id(name)).translation) for name in ("head", "left_toe_tip"))
    along = (head - toes) / np.linalg.norm(head - toes)
    assert along[1] > 0.99
    towards = (eye - target) / np.linalg.norm(eye - target)
    assert abs(towards @ along) < 0.2
    assert np.linalg.norm(head - target) < 0.6 * np.linalg.norm(head - toes)
    standing = wb.Clip(human, [human.neutral], 0.1)  # type: ignore[arg-type]
    eye, target = figures.camera(standing, 0, figures.FRONT)
    assert (eye - target)[0] > 3.0


def test_every_case_that_misses_something_is_named() -> None:
    """The line above names three of them."""
    bisection, *others = rows()
    slow = [dataclasses.replace(bisection, clip=f"walk {k}", seconds=2.0 + k) for k in range(1, 7)]
    text = report.report([*slow, *others], {"wholebody": "0"})
    assert "| bisection | at most 1 s a second of motion | 0 of 6 | walk 6, pack: 4 s; walk 5, pack: 3.5 s;" in text
    for k in range(1, 7):
        assert f"| bisection | at most 1 s a second of motion | walk {k} | pack | {1.0 + k / 2:.3g} s |" in text


def test_the_nearest_frames_stand_beside_what_deviates_by_more_than_is_asked() -> None:
    bisection, trajectory, *others = rows()
    far = dataclasses.replace(trajectory, angle=0.08)
    near = dataclasses.replace(trajectory, method=NEAREST, outcome="left", angle=0.075)
    text = report.report([bisection, far, near, *others], {"wholebody": "0"})
    assert "| walk | pack | 0.800 | 0.750 |" in text
    assert "| nearest | 1 of 1" not in text  # it is no method
    assert "| 0.750 |" not in report.report([bisection, trajectory, near, *others], {"wholebody": "0"})
    assert not report.bounds([bisection, far, *others])


def test_the_nearest_frames_of_a_clip_that_is_free_are_its_own(tmp_path: Path) -> None:
    figure = wb.load("human")
    path = tmp_path / "still.npz"
    wb.Clip(figure, np.array([figure.posture("standing")] * 8), 1 / 30, "still").write(path)
    row = measuring.measured(MotionRow("still", "nothing", NEAREST), str(path), 600.0)
    assert (row.outcome, row.angle) == ("free", 0.0)


def test_an_unknown_name_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path)
    assert main(["bench", "motion", "--out", out, "--equipment", "pak"]) == 2
    assert "pack" in capsys.readouterr().err
    assert main(["bench", "motion", "--out", out, "--clips", str(tmp_path / "none")]) == 2
    assert "--clips" in capsys.readouterr().err


@pytest.mark.parametrize("drawing", figures.DRAWINGS, ids=lambda drawing: drawing.number)
def test_a_figure_without_its_recording_is_refused(drawing: figures.Drawing, tmp_path: Path) -> None:
    with pytest.raises(wb.InputError, match=f"figure {drawing.number} needs the recording {drawing.clip}"):
        figures.redraw(drawing, {}, wb.load("human"), tmp_path, 1)


def test_a_weapon_is_in_both_hands() -> None:
    """It begins in the right hand, and the left one is on it, 75 cm long, where the arms are as in the drawings."""
    human = wb.load("human")
    q = figures.carrying(human)
    scene = wb.Scene(human)
    hands = [pin.SE3(scene.state(q).frame(human.frame_id(hand))).translation for hand in figures.HANDS]
    assert np.array(hands) == pytest.approx(np.array(figures.CARRIED), abs=1e-4)
    armed = dressed(human, figures.weapon(human))
    rod = armed.objects["weapon"]
    assert rod.segment == "right_hand"
    place = pin.SE3(armed.state(q).frame(human.frame_id("right_hand"))) * pin.SE3(rod.placement)
    for hand in hands:
        across, along = np.linalg.norm(place.actInv(hand)[:2]), abs(place.actInv(hand)[2])
        assert across < 1e-6
        assert along < 0.5 * 0.75
