"""Where motions between frames dip, and attempts that end early."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.figures.figure import Figure
from wholebody.motion.dips import dips
from wholebody.motion.frame_terms import frame_terms
from wholebody.motion.trajectory import window_run
from wholebody.motion.trajectory.banded_qp import banded_solver
from wholebody.motion.trajectory.nodes import Node, Rows
from wholebody.motion.trajectory.objective import Objective
from wholebody.motion.trajectory.program import Limits
from wholebody.motion.trajectory.sqp import EARLY, MET, STEPS, SQPResult, WindowProgram
from wholebody.motion.trajectory.starts import Carried
from wholebody.motion.windows import Window


def among_needles(planar_arm: Callable[..., Figure], shares: list[tuple[float, float]]) -> dict[int, list[float]]:
    """Dips of a straight arm that turns from 0 to 0.4 rad, past needles at shares of the way and distances."""
    figure = planar_arm((0.5, 0.5), radius=0.002)
    scene = wb.Scene(figure)
    for number, (share, reach) in enumerate(shares):
        at = (reach * np.cos(0.4 * share), reach * np.sin(0.4 * share), 0.0)
        scene.add(wb.Sphere(0.002), name=f"needle {number}", at=at)
    with scene.borrow() as workspace:
        return dips(workspace, np.array([[0.0, 0.0], [0.4, 0.0]]), [0])


def test_each_needle_passed_in_a_gap_is_told_where_the_arm_meets_it(planar_arm: Callable[..., Figure]) -> None:
    found = among_needles(planar_arm, [(0.27, 0.9), (0.71, 0.8)])
    assert sorted(found[0]) == pytest.approx([0.27, 0.71], abs=3e-3)


def test_needles_met_at_nearly_the_same_share_are_told_once(planar_arm: Callable[..., Figure]) -> None:
    assert among_needles(planar_arm, [(0.6, 0.9), (0.604, 0.7)])[0] == pytest.approx([0.602], abs=5e-3)


class Asked:
    """Looks at frames of one degree of freedom: a share of its deviation is to be at least `least` metres."""

    def __init__(self, least: float, share: float) -> None:
        self.least, self.share = least, share

    def nodes(self) -> list[Node]:
        return [Node(frame) for frame in range(3)]

    def at(self, node: Node, x: np.ndarray, within: float) -> Rows:
        gap = self.share * x[node.frame] - self.least
        return Rows(node, gap, (np.ones((1, 1)),), np.zeros(1, dtype=np.intp), np.zeros(0), np.zeros((0, 1)))


def asked(least: float, early_exit: float | None, share: float = 1.0, rough: bool = False) -> SQPResult:
    """What a run of three frames ends with that begins with no deviation."""
    wide, free = np.full((3, 1), 9.0), np.full((2, 1), np.inf)
    limits, objective = Limits(-wide, wide, -free, free), Objective(3, np.ones(1), 0.0, 1.0, (False, False))
    looking: Any = Asked(least, share)
    program = WindowProgram(looking, objective, limits, banded_solver(None)[1], 60)
    return program.run(np.zeros((3, 1)), lambda number, worst: False, early_exit=early_exit, rough=rough)


def test_a_run_whose_steps_gain_little_ends_early_where_there_are_others() -> None:
    hurried, patient = asked(0.05, np.inf, share=0.05), asked(0.05, None, share=0.05)  # a step brings 1.5 mm
    assert hurried.early
    assert hurried.programs == STEPS
    assert not patient.early
    assert patient.worst < 0.5 * hurried.worst


def test_a_run_that_gains_what_its_steps_ask_for_goes_on() -> None:
    found = asked(0.25, np.inf)
    assert found.met
    assert found.x == pytest.approx(np.full((3, 1), 0.25), abs=10.0 * MET)
    far = asked(0.9, np.inf)  # a twentieth of it a step is what is asked for at most
    assert far.early
    assert far.programs == EARLY


def test_a_run_that_grows_dear_ends_early() -> None:
    found = asked(0.6, 0.1)  # half of three squares of 0.26
    assert found.early
    assert found.objective > 0.1
    assert 0.2 < found.x.max() < 0.3


def test_a_rough_run_ends_once_little_is_missed() -> None:
    rough, whole = asked(0.25, np.inf, rough=True), asked(0.25, np.inf)
    assert rough.roughly
    assert not whole.roughly
    assert rough.worst <= 2e-3
    assert rough.programs <= whole.programs


def test_the_nearest_start_comes_first(planar_arm: Callable[..., Figure]) -> None:
    figure = planar_arm((0.5, 0.5), radius=0.02)
    q = np.stack([np.linspace(-0.3, 0.3, 9), np.zeros(9)], axis=1)
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(0.1), name="ball", at=(0.8, 0.12, 0.0))  # the last frame is past its middle: the farther side
    found = list(Carried(frame_terms(scene, q, 1 / 30, []), 0.0).outwards(Window(0, 9), (8, 0)))
    apart = [((one - q) ** 2).sum() for one in found]
    assert len(found) == 2
    assert apart[0] < apart[1]


def test_attempts_that_end_early_are_gone_on_with(
    planar_arm: Callable[..., Figure], monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = planar_arm((0.5, 0.5), radius=0.002)
    clip = wb.Clip(figure, np.stack([np.linspace(-0.8, 0.8, 6), np.full(6, 0.0)], axis=1), 1 / 30)
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(0.002), name="needle", at=(0.985, 0.05, 0.0))  # passed between two frames
    run, runs = WindowProgram.run, []

    def once(self: WindowProgram, x: np.ndarray, *given: Any) -> SQPResult:
        found = run(self, x, *given)
        runs.append((x, self.between, given[3], found.x))
        return found if given[3] is None else found._replace(early=True)

    monkeypatch.setattr(WindowProgram, "run", once)
    wb.avoid(clip, scene, method="trajectory")
    ended = [ended for _, _, early_exit, ended in runs if early_exit is not None]
    began = [begun for begun, _, early_exit, _ in runs if early_exit is None]
    assert ended
    assert any(begun is one for begun in began for one in ended)


def test_attempts_that_end_early_are_begun_again(
    planar_arm: Callable[..., Figure], monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = planar_arm((0.5, 0.5))
    clip = wb.Clip(figure, np.stack([np.linspace(-0.8, 0.8, 14), np.full(14, 0.5)], axis=1), 1 / 30)
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(0.06), name="ball", at=(0.9, 0.1, 0.0))
    assert not wb.check(clip, scene).free
    run, ended = WindowProgram.run, []

    def hurried(self: WindowProgram, x: np.ndarray, *given: Any) -> SQPResult:
        if given[3] is None:
            return run(self, x, *given)
        ended.append(x)
        return SQPResult(x, 0.0, 1.0, met=False, programs=0, cancelled=False, early=True)

    monkeypatch.setattr(WindowProgram, "run", hurried)
    freed = wb.avoid(clip, scene, method="trajectory")
    assert len(ended) >= 2
    assert freed.report.message.startswith("nothing collides")
    assert wb.check(freed.clip, scene).free


class Missed(Asked):
    """Looks at frames of which nothing can be moved: a contact and something held are missed by so much."""

    def __init__(self, contact: float, held: float) -> None:
        self.contact, self.held = contact, held

    def at(self, node: Node, x: np.ndarray, within: float) -> Rows:
        still = np.zeros((1, 1))
        return Rows(node, np.array([-self.contact]), (still,), np.zeros(1, dtype=np.intp), np.array([self.held]), still)


@pytest.mark.parametrize(
    ("contact", "held", "met"), [(0.0, 0.9e-4, True), (0.0, 1.1e-4, False), (0.9e-4, 0.0, False), (1e-5, 0.0, True)]
)
def test_what_is_held_is_met_to_a_tenth_of_a_millimetre(contact: float, held: float, met: bool) -> None:
    """A check allows 1 mm of what is held, and 0.1 mm of an overlap: a contact is met to a fifth of that."""
    none, free = np.zeros((3, 1)), np.full((2, 1), np.inf)
    looking: Any = Missed(contact, held)
    objective = Objective(3, np.ones(1), 0.0, 1.0, (False, False))
    program = WindowProgram(looking, objective, Limits(none, none, -free, free), banded_solver(None)[1], 3)
    assert program.run(none, lambda number, worst: False).met is met


def runs_of_a_window(
    planar_arm: Callable[..., Figure], monkeypatch: pytest.MonkeyPatch, frames: int, passed: float
) -> list[tuple[np.ndarray, bool, bool, np.ndarray]]:
    """Runs of a clip that is one window, with how deep motions between frames are said to pass something at first.

    Returns:
        Deviations of the beginning, whether it may end early, whether it is rough, and deviations of the end.
    """
    figure = planar_arm((0.5, 0.5))
    clip = wb.Clip(figure, np.stack([np.linspace(-0.3, 0.3, frames), np.full(frames, 0.5)], axis=1), 1 / 30)
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(0.1), name="ball", at=(0.8, 0.1, 0.0))
    run, runs, said = WindowProgram.run, [], [passed]

    def told(self: WindowProgram, x: np.ndarray, *given: Any) -> SQPResult:
        found = run(self, x, *given)
        early, rough = (given[3] is not None, given[4]) if len(given) > 4 else (False, False)
        runs.append((x, early, rough, found.x))
        return found

    monkeypatch.setattr(WindowProgram, "run", told)
    monkeypatch.setattr(window_run, "depths_between", lambda *given: {0: said.pop() if said else 0.0})
    freed = wb.avoid(clip, scene, method=wb.motion.Trajectory(margin=10.0, time=0.1))
    assert freed.report.solved, freed.report.message
    return runs


@pytest.mark.parametrize(("frames", "rough"), [(40, False), (41, True)])
def test_windows_of_more_than_forty_frames_are_looked_at_before_their_optimum(
    planar_arm: Callable[..., Figure], monkeypatch: pytest.MonkeyPatch, frames: int, rough: bool
) -> None:
    assert runs_of_a_window(planar_arm, monkeypatch, frames, 0.0)[0][2] is rough


@pytest.mark.parametrize(("passed", "ends"), [(0.029, False), (0.031, True)])
def test_what_passes_a_thing_by_more_than_a_step_asks_for_ends_an_attempt(
    planar_arm: Callable[..., Figure], monkeypatch: pytest.MonkeyPatch, passed: float, ends: bool
) -> None:
    first, second, *_ = runs_of_a_window(planar_arm, monkeypatch, 60, passed)
    assert not first[0].any()
    assert np.array_equal(second[0], first[3]) is not ends
