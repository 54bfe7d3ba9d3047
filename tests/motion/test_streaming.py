"""Skeletons that come frame by frame become the postures that a recording of them becomes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from tests.motion.test_ground import flat, slides, walker
from tests.motion.test_things import robot
from wholebody.base.errors import InputError
from wholebody.motion.skeleton import SkeletonMotion


def streamed(stream: wb.motion.Retargeter, motion: SkeletonMotion) -> np.ndarray:
    """Postures of a stream; each comes out `ahead` frames after its skeleton, but for the last ones."""
    found = []
    for k in range(len(motion)):
        q = stream.push(motion.part(k, k + 1))
        assert len(q) == (1 if k >= stream.ahead else 0)
        found.append(q)
    return np.concatenate([*found, stream.finish()])


@pytest.mark.parametrize(("seconds", "rate"), [(2.4, 30.0), (4.6, 60.0)])
def test_a_stream_gives_the_postures_of_the_recording(seconds: float, rate: float, tmp_path: Path) -> None:
    """At 60 Hz too, where first sweeps take every second frame: a walk played twice as fast."""
    motion, figure = replace(walker(flat, seconds)[0], dt=1.0 / rate), robot(tmp_path)
    ground = wb.motion.ground(motion)
    batch = wb.retarget(motion, figure, ground=ground)
    stream = wb.motion.Retargeter(motion, figure, ground=ground)
    assert stream.ahead < len(motion)
    assert stream.latency == pytest.approx(stream.ahead * motion.dt)
    assert np.abs(streamed(stream, motion) - batch.q).max() < 1e-9


def test_feet_of_a_stream_rest_on_the_floor(human: wb.Figure) -> None:
    motion, stands = walker(flat, 2.1)
    found = wb.Clip(human, streamed(wb.motion.Retargeter(motion.part(0, 36), human), motion), motion.dt)  # type: ignore[arg-type]
    assert slides(found, stands)[5:].mean() < 2e-3  # where feet rest is found as frames come
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    assert max(-scene.contacts(q, 0.01).distance.min(initial=0.0) for q in found.q) < 5e-4


@pytest.mark.parametrize("known", [True, False])
def test_a_stream_may_end_while_feet_rest(known: bool, human: wb.Figure) -> None:
    """Its ground is that of a longer recording, or feet have just come down."""
    motion, _ = walker(flat, 2.0)
    ground = wb.motion.ground(motion) if known else None
    for count in (13,):
        q = streamed(wb.motion.Retargeter(motion, human, ground=ground), motion.part(0, count))
        assert q.shape == (count, human.model.nq)
        assert np.isfinite(q).all()


def test_what_does_not_belong_to_a_stream_is_refused(human: wb.Figure) -> None:
    motion, _ = walker(flat, 0.5)
    stream = wb.motion.Retargeter(motion, human)
    with pytest.raises(InputError, match="another time step"):
        stream.push(replace(motion, dt=0.5))
    with pytest.raises(InputError, match="other joints"):
        stream.push(replace(motion, names=tuple(f"{name} of another" for name in motion.names)))
    with pytest.raises(InputError, match="Retargeter: the scene has the figure"):
        wb.motion.Retargeter(motion, human, wb.Scene(wb.load("hand")))
    assert len(stream.finish()) == 0
    with pytest.raises(InputError, match="was finished"):
        stream.push(motion)
