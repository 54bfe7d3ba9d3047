"""Where motions between frames dip, and attempts that end early."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from tests.freeing import begun
from wholebody.figures.figure import Figure
from wholebody.motion.avoider import followed
from wholebody.motion.faults import deepest_shares, dipping
from wholebody.motion.trajectory import method as trajectory
from wholebody.motion.trajectory import window_run
from wholebody.motion.trajectory.deviations import Objective
from wholebody.motion.trajectory.nodes import MET, Node, Rows
from wholebody.motion.trajectory.program import Limits
from wholebody.motion.trajectory.sqp import End, SQPResult, WindowProgram
from wholebody.motion.windows import Window


def among_needles(planar_arm: Callable[..., Figure], shares: list[tuple[float, float]]) -> dict[int, list[float]]:
    """Dips of a straight arm that turns from 0 to 0.4 rad, past needles at shares of the way and distances."""
    figure = planar_arm((0.5, 0.5), radius=0.002)
    scene = wb.Scene(figure)
    for number, (share, reach) in enumerate(shares):
        at = (reach * np.cos(0.4 * share), reach * np.sin(0.4 * share), 0.0)
        scene.add(wb.Sphere(0.002), name=f"needle {number}", at=at)
    with scene.borrow() as workspace:
        q = np.array([[0.0, 0.0], [0.4, 0.0]])
        return deepest_shares(workspace, q, dipping(workspace, q, [0]))


def test_each_needle_passed_in_a_gap_is_told_where_the_arm_meets_it(planar_arm: Callable[..., Figure]) -> None:
    found = among_needles(planar_arm, [(0.27, 0.9), (0.71, 0.8)])
    assert sorted(found[0]) == pytest.approx([0.27, 0.71], abs=3e-3)


def test_needles_met_at_nearly_the_same_share_are_told_once(planar_arm: Callable[..., Figure]) -> None:
    assert among_needles(planar_arm, [(0.6, 0.9), (0.604, 0.7)])[0] == pytest.approx([0.602], abs=5e-3)


class Asked:
    """Looks at frames of one degree of freedom: a share of its deviation is to be at least `least` metres."""

    tree = np.zeros(1, dtype=np.intp)

    def __init__(self, least: float, share: float) -> None:
        self.least, self.share = least, share

    def nodes(self) -> list[Node]:
        return [Node(frame) for frame in range(3)]

    def at(self, node: Node, x: np.ndarray, within: float) -> Rows:
        gap = self.share * x[node.frame] - self.least
        return Rows(node, gap, (np.ones((1, 1)),), np.zeros(1, dtype=np.intp), np.zeros(0), np.zeros((0, 1)))


def asked(least: float, early: bool, share: float = 1.0) -> SQPResult:
    """What a run of three frames ends with that begins with no deviation."""
    wide, free = np.full((3, 1), 9.0), np.full((2, 1), np.inf)
    limits, objective = Limits(-wide, wide, -free, free), Objective(3, np.ones(1), 0.0, 1.0, (False, False))
    looking: Any = Asked(least, share)
    program = WindowProgram(looking, objective, limits, 60)
    return program.run(np.zeros((3, 1)), lambda number, worst: False, early=early)


def test_a_run_whose_steps_gain_little_ends_early_where_there_are_others() -> None:
    hurried, patient = asked(0.05, True, share=0.05), asked(0.05, False, share=0.05)  # a step brings 1.5 mm
    assert hurried.end is End.EARLY
    assert hurried.programs == 3
    assert patient.end is End.LAST
    assert patient.worst < 0.5 * hurried.worst


def test_a_run_that_gains_what_its_steps_ask_for_goes_on() -> None:
    found = asked(0.25, True)
    assert found.met
    assert found.x == pytest.approx(np.full((3, 1), 0.25), abs=10.0 * MET)


def test_what_follows_a_frame_stays_on_its_side(planar_arm: Callable[..., Figure]) -> None:
    figure = planar_arm((0.5, 0.5), radius=0.02)
    q = np.stack([np.linspace(-0.3, 0.3, 9), np.zeros(9)], axis=1)
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(0.1), name="ball", at=(0.8, 0.12, 0.0))  # the last frame is past its middle
    with begun(wb.Clip(figure, q, 1 / 30), scene) as run:
        beyond, before = (followed(run, Window(0, 9), frame) for frame in (8, 0))
    assert (beyond - q)[:, 0].max() > 0.05
    assert (before - q)[:, 0].min() < -0.05


def test_attempts_that_end_early_are_gone_on_with(
    planar_arm: Callable[..., Figure], monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = planar_arm((0.5, 0.5), radius=0.002)
    clip = wb.Clip(figure, np.stack([np.linspace(-0.8, 0.8, 6), np.full(6, 0.0)], axis=1), 1 / 30)
    scene = wb.Scene(figure)
    scene.add(wb.Sphere(0.002), name="needle", at=(0.985, 0.05, 0.0))  # passed between two frames
    run, runs = WindowProgram.run, []

    def once(self: WindowProgram, x: np.ndarray, *given: Any) -> SQPResult:
        found, early = run(self, x, *given), len(given) > 3 and given[3]
        runs.append((x, early, found.x))
        return found._replace(end=End.EARLY) if early else found

    monkeypatch.setattr(WindowProgram, "run", once)
    wb.avoid(clip, scene, method="trajectory")
    ended = [ended for _, early, ended in runs if early]
    began = [begun for begun, early, _ in runs if not early]
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
        if len(given) < 4 or not given[3]:
            return run(self, x, *given)
        ended.append(x)
        return SQPResult(x, 0.0, 1.0, 0, End.EARLY)

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
    program = WindowProgram(looking, objective, Limits(none, none, -free, free), 3)
    assert program.run(none, lambda number, worst: False).met is met


def test_a_long_window_is_freed_in_parts_without_seams(
    planar_arm: Callable[..., Figure], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An arm that sways inside of a ball for five seconds: as when all frames are freed at once, to a milliradian."""
    figure = planar_arm((0.5, 0.5))
    t = np.arange(75) / 15.0
    clip = wb.Clip(figure, np.stack([0.02 * np.sin(2.0 * t), 0.3 + 0.02 * np.cos(3.0 * t)], axis=1), 1 / 15)
    scene = wb.Scene(figure).add(wb.Sphere(0.1), name="ball", at=(0.8, 0.17, 0.0))
    run, longest, shares = WindowProgram.run, list[int](), list[float]()

    def told(self: WindowProgram, x: np.ndarray, *given: Any) -> SQPResult:
        longest.append(len(x))
        return run(self, x, *given)

    monkeypatch.setattr(WindowProgram, "run", told)
    parts = wb.avoid(clip, scene, method=wb.motion.Trajectory(time=0.1), progress=lambda at: shares.append(at.share))
    assert max(shares) > 0.3  # the second part goes on from where the first one is
    assert parts.report.solved, parts.report.message
    assert max(longest) <= 60
    monkeypatch.setattr(trajectory, "LONG", 100.0)
    whole = wb.avoid(clip, scene, method=wb.motion.Trajectory(time=0.1))
    assert max(longest) == 75
    np.testing.assert_allclose(parts.clip.q, whole.clip.q, atol=1e-3)
    assert parts.report.jerk < 1.05 * whole.report.jerk


@pytest.mark.parametrize(("ways_on", "asked"), [
    (lambda part: (part.first, part.end) != (22, 52), [(0, 30), (22, 52), (0, 52), (44, 100)]),
    (lambda part: part.end < 52, [(0, 30), (22, 52), (0, 52), (0, 100)]),
    (lambda part: part.first == 0, [(0, 30), (22, 52), (0, 52), (44, 100), (0, 100)]),
])  # fmt: skip
def test_a_part_that_cannot_go_on_is_freed_with_the_one_before(
    planar_arm: Callable[..., Figure], ways_on: Callable[[Window], bool], asked: list[tuple[int, int]]
) -> None:
    """Parts of 30 frames: which are asked for where some have no answer, and the whole window where nothing is left."""
    figure, seen = planar_arm((0.5, 0.5)), list[tuple[int, int]]()

    class Windows:
        def window(self, part: Window, *_: Any, patient: bool = True, **__: Any) -> window_run.WindowResult:
            seen.append((part.first, part.end))
            assert patient is (seen[-1] == (0, 100))
            free = ways_on(part) or patient
            return window_run.WindowResult(np.full((len(part), 2), float(part.end)), "" if free else "something", free)

    with begun(wb.Clip(figure, np.zeros((100, 2)), 1 / 15), wb.Scene(figure)) as run:
        given: Any = (Window(0, 100), np.zeros((100, 2)), None, lambda _: False)
        found = trajectory._in_parts(run, Windows(), *given)  # type: ignore[arg-type]
    assert seen == asked
    assert not found.missed
    assert (found.q[-1] == 100.0).all()
