"""On which side of a thing windows and their parts are freed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from tests.freeing import begun
from wholebody.figures.figure import Figure
from wholebody.geometry.continuous.swept_depth import Depths
from wholebody.motion.trajectory import window_run
from wholebody.motion.trajectory.sqp import SQPResult, WindowProgram
from wholebody.motion.trajectory.window_run import ClipRun
from wholebody.motion.windows import Window


def through_a_ball(planar_arm: Callable[..., Figure], angles: np.ndarray) -> tuple[wb.Clip, wb.Scene]:
    """A straight arm at angles from a ball that it reaches through; more than 0.14 rad are free."""
    figure = planar_arm((0.5, 0.5), radius=0.02)
    scene = wb.Scene(figure).add(wb.Sphere(0.1), name="ball", at=(0.9, 0.0, 0.0))
    return wb.Clip(figure, np.stack([angles, np.zeros(len(angles))], axis=1), 1 / 30), scene


def test_a_part_stays_on_the_side_of_the_part_before_it(planar_arm: Callable[..., Figure]) -> None:
    clip, scene = through_a_ball(planar_arm, np.full(40, 0.05))  # 0.05: the way out is to larger angles
    around = clip.q.copy()
    around[:11, 0] = -0.2
    with begun(clip, scene) as run:
        part = Window(10, 40)
        found = ClipRun(run, clip.q, 0.1).window(part, run.faults(clip.q), lambda _: False, around=around)
        assert not found.missed, found.missed
        assert found.q[0] == pytest.approx(around[10])
        assert found.q[:, 0].max() < 0.0
        assert not run.faults(found.q).number


def test_the_first_part_is_on_the_side_where_all_parts_deviate_less(planar_arm: Callable[..., Figure]) -> None:
    angles = np.full(150, 0.06)
    angles[20:30] = -0.01  # the deepest: from here alone the other side is nearer
    clip, scene = through_a_ball(planar_arm, angles)
    freed = wb.avoid(clip, scene)
    assert freed.report.solved, freed.report.message
    assert freed.clip.q[:, 0].min() > 0.0


@pytest.mark.parametrize(("passed", "ends"), [(0.029, False), (0.031, True)])
def test_what_passes_a_thing_by_more_than_a_step_asks_for_waits_for_other_starts(
    planar_arm: Callable[..., Figure], monkeypatch: pytest.MonkeyPatch, passed: float, ends: bool
) -> None:
    clip, scene = through_a_ball(planar_arm, np.linspace(0.3, 0.05, 30))
    run, begins, said = WindowProgram.run, list[np.ndarray](), [passed]
    ended = list[np.ndarray]()

    def told(self: WindowProgram, x: np.ndarray, *given: Any) -> SQPResult:
        found = run(self, x, *given)
        begins.append(x)
        ended.append(found.x)
        return found

    monkeypatch.setattr(WindowProgram, "run", told)
    pair = np.zeros(1, dtype=np.intp)
    dipping = lambda *given: {0: Depths(pair, np.array([said.pop()]))} if said else {}  # noqa: E731
    monkeypatch.setattr(window_run, "dipping", dipping)
    monkeypatch.setattr(window_run, "deepest_shares", lambda *given: {0: [0.5]})
    freed = wb.avoid(clip, scene, method=wb.motion.Trajectory(time=0.1))
    assert freed.report.solved, freed.report.message
    assert any(x is ended[0] for x in begins[1:]) is not ends
