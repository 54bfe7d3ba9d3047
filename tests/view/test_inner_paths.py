"""Motions whose frames have inner paths are played along them."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.tracking.loop import follow
from wholebody.view.composition import timed

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
