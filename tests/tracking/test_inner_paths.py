"""Motions whose frames have inner paths are played along them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import wholebody as wb
from wholebody.tracking import inner_paths
from wholebody.tracking.inner_paths import resampled, timed
from wholebody.tracking.loop import follow

DT = 0.1


def postures(*numbers: float) -> list[np.ndarray]:
    return [np.array([number]) for number in numbers]


def test_straight_frames_are_a_time_step_apart() -> None:
    found = timed(postures(0.0, 1.0, 3.0), (), DT)
    assert [float(q[0]) for q in found.q] == [0.0, 1.0, 3.0]
    assert found.times == pytest.approx([0.0, DT, 2 * DT])


def test_the_postures_within_a_frame_stand_at_their_shares_of_it() -> None:
    zero, one, two, three = postures(0.0, 1.0, 2.0, 3.0)
    path = ((0.0, zero), (0.25, two), (1.0, three), (1.0, one))
    found = timed([zero, one], [(), path], DT)
    assert [float(q[0]) for q in found.q] == [0.0, 2.0, 3.0, 1.0]
    assert found.times[[0, 1, 3]] == pytest.approx([0.0, 0.25 * DT, DT])
    assert (np.diff(found.times) > 0.0).all()
    assert found.frames == [0, 1, 1, 1]


def test_a_file_of_a_motion_goes_along_its_paths(planar_arm, tmp_path) -> None:
    """A reader who goes straight from row to row meets the postures within frames at their times."""
    arm = planar_arm((0.5, 0.4, 0.3))
    start, inner, other, end = (np.array((0.02 * angle, 0.2, 0.2)) for angle in (0, 3, 5, 1))
    way = ((0.0, start), (0.3, inner), (0.55, other), (1.0, end))
    motion = SimpleNamespace(q=np.array((start, end, end)), dt=DT, paths=((), way, ()))
    track = wb.read_clip(resampled(arm, motion).write(tmp_path / "way.csv"), arm)
    for share, q in way:
        place = share * DT / track.dt
        rows = track.q[int(place)], track.q[min(int(place) + 1, len(track) - 1)]
        assert rows[0] + (place - int(place)) * (rows[1] - rows[0]) == pytest.approx(q, abs=1e-3)
    assert (len(track) - 1) * track.dt == pytest.approx(2 * DT)
    straight = SimpleNamespace(q=motion.q, dt=DT)
    np.testing.assert_array_equal(resampled(arm, straight).q, motion.q)


def test_no_more_rows_than_a_clip_may_have(planar_arm, monkeypatch: pytest.MonkeyPatch) -> None:
    """A detour of a thousandth of a frame asks for more than 64 rows a frame."""
    figure = planar_arm((0.4, 0.3))
    there, beside = np.array([0.2, 0.1]), np.array([1.2, 0.1])
    path = ((0.0, there), (0.499, there), (0.5, beside), (0.501, there), (1.0, there))
    motion = SimpleNamespace(q=np.array([there] * 10), dt=0.1, paths=((), path, *[()] * 8))
    with pytest.warns(UserWarning, match="64 rows a frame"):
        assert len(resampled(figure, motion)) == 9 * 64 + 1
    monkeypatch.setattr(inner_paths, "MOST_FRAMES", 100)
    with pytest.warns(UserWarning, match="; 8 rows a frame"):
        assert len(resampled(figure, motion)) == 9 * 8 + 1


def test_as_many_paths_as_postures() -> None:
    with pytest.raises(wb.InputError, match="2 paths and 1 postures"):
        timed(postures(0.0), [(), ()], DT)


def test_a_viewer_plays_the_way_round_a_thing() -> None:
    """The arm gives way to a ball within frames; the page has more keyframes than the motion has postures."""
    from wholebody.view import commands

    figure = wb.load("hand")  # an avatar's surface takes a second to make
    q = figure.clamp(figure.neutral)
    palm = wb.Scene(figure).state(q).frame(figure.frame_id(figure.frames[-1])).translation
    scene = wb.Scene(figure).add(wb.Sphere(0.05), name="ball", at=palm + (0.6, 0.0, 0.0))
    places = [palm + (0.6 - 0.1 * number, 0.0, 0.0) for number in range(8)]
    recording = follow(scene, wb.Clip(figure, [q] * 8, 1 / 60), moves={"ball": places})
    inner = sum(max(0, len(path) - 2) for path in recording.paths[1:])
    assert inner > 0
    seen = []
    made = commands.set_animation

    def noted(tracks, times, repetitions):
        seen.append(times)
        return made(tracks, times, repetitions)

    with pytest.MonkeyPatch.context() as patch, wb.Viewer(scene) as viewer:
        patch.setattr(commands, "set_animation", noted)
        viewer.play(recording, ghost=recording.tracked)
    assert len(seen[0]) == len(recording) + inner
    assert seen[0][-1] == pytest.approx(7 / 60)
