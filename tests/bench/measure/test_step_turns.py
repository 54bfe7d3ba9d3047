"""Tools take turns on the same frames: none has the machine of another minute."""

from __future__ import annotations

import numpy as np
import pytest

from wholebody.bench.measure import step as module
from wholebody.bench.measure.track import Track
from wholebody.bench.suite.adapters.base import Tool


def test_every_tool_steps_the_same_frames_in_turn(short_free: Track, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[tuple[str, int]] = []

    class Standing(Tool):
        def __init__(self, name: str, track: Track) -> None:
            self.name, self.track, self.frame = name, track, -1

        def reset(self, q: np.ndarray) -> None:
            self.frame = 0

        def step(self, target: np.ndarray) -> None:
            if self.frame < 0:
                return  # the first step, before the clock starts
            assert np.array_equal(target, self.track.targets[self.frame])
            made.append((self.name, self.frame))
            self.frame += 1

        def posture(self) -> np.ndarray:
            return np.array(self.track.start)

    monkeypatch.setattr(module, "make_tool", Standing)
    monkeypatch.setattr(module, "TURN", 3)
    tools, steps = ("first", "second", "third"), len(short_free.targets)
    runs = module.measure(short_free, tools, 2)
    whole = [(name, frame) for name in tools for frame in range(steps)]
    each = len(whole)
    assert len(made) == 3 * each  # two repeats, and a round before them
    begun = []
    for repeat in range(3):
        own = made[repeat * each : (repeat + 1) * each]
        assert sorted(own) == sorted(whole)
        for first in range(0, steps, 3):
            turn = own[len(tools) * first : len(tools) * min(first + 3, steps)]
            assert {frame for _, frame in turn} == set(range(first, min(first + 3, steps)))
            begun.append(turn[0][0])
    assert {begun.count(name) for name in tools} == {3}  # each begins as many turns
    assert {name: len(mine) for name, mine in runs.items()} == dict.fromkeys(tools, 2)
