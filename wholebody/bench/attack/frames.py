"""Frames: goals of mixed weights that can all be met, and things that are put into a figure that is shown."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.bench.attack.bodies import body
from wholebody.bench.attack.case import Verdict, Written
from wholebody.bench.attack.judging import Pairs
from wholebody.bench.attack.solves import Terms, script_head
from wholebody.bench.attack.things import clear, xyzquat
from wholebody.bench.suite.problem_sets.things import Occupied
from wholebody.methods.qp.method import QP
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tracking.loop import FrameLoop

MET = 1e-4  # m, rad: goals are met
MOST = 60  # frames in which goals of equal weights are met, or else nothing is asked of mixed ones
LONGER = 3  # times the frames of equal weights that mixed ones may take
HEAVIEST = 6.0  # decades: of weights
DT = 1.0 / 60.0
TOLD = 1.2e-4  # m: overlap that a frame has to tell
PUTS = (5, 20)

MIXED = """
verdict = frames.mixed(scene, start, lambda point, turn: [{point}, {turn}], {weights!r})
print(verdict)
"""
PUT = """
places = {places!r}
verdict = frames.put(scene, start, places, overlap={overlap!r})
print(verdict)
"""


def written_mixed(rng: np.random.Generator) -> Written:
    """Write goals of one frame, as it is in a posture near the start, with weights from 1 to a million."""
    figure = body(rng)
    start = figure.figure.clamp(figure.figure.posture(figure.figure.postures[0]))
    frame = str(rng.choice(figure.frames))
    there = figure.figure.placement(figure.near(start, float(rng.choice([0.2, 0.5, 1.0])), rng), frame)
    weights = [float(10.0 ** rng.uniform(0.0, HEAVIEST)) for _ in range(2)]
    point = f"wb.Point({frame!r}, {there.translation.tolist()!r}, weight=point)"
    turn = f"wb.Orientation({frame!r}, np.array({there.rotation.tolist()!r}), weight=turn)"
    head = script_head(f"{figure.figure.name}: weights {weights}", figure, start, [], Terms(), "frames")
    return Written(head + MIXED.format(point=point, turn=turn, weights=weights), figure.files)


def written_put(rng: np.random.Generator) -> Written:
    """Write a figure that is shown where it is tracked, and a thing that is put somewhere now and then."""
    figure = body(rng)
    start = figure.figure.clamp(figure.figure.posture(figure.figure.postures[0]))
    thing = None
    while thing is None:
        thing = clear(rng, Occupied(figure.figure, [start]), figure.size, 1e-3 * figure.size, [0])
    frames = [str(rng.choice(figure.frames)) for _ in range(int(rng.integers(*PUTS)))]
    places: list[tuple[float, ...] | None] = []
    for frame in frames:
        place = thing.placement
        place.translation = figure.figure.placement(start, frame).translation + 0.1 * figure.size * rng.normal(size=3)
        places += [xyzquat(place), *[None] * int(rng.integers(0, 6))]
    head = script_head(
        f"{figure.figure.name}: a thing put {len(frames)} times", figure, start, [thing], Terms(), "frames"
    )
    return Written(head + PUT.format(places=places, overlap=str(rng.choice(["qp", "ccd"]))), figure.files)


def mixed(scene: Scene, start: Array, goals: Any, weights: list[float]) -> Verdict:
    """Whether goals of these weights are met in at most three times the frames of equal ones."""
    equal = _frames(Problem(scene, start, goals=goals(1.0, 1.0)), MOST)
    if equal > MOST:
        return Verdict("right", f"goals of equal weights are not met in {MOST} frames; nothing is asked")
    found = _frames(Problem(scene, start, goals=goals(*weights)), LONGER * equal)
    if found > LONGER * equal:
        return Verdict("wrong", f"weights {weights}: not met in {LONGER * equal} frames, with equal ones in {equal}")
    return Verdict("right", f"met in {found} frames, with equal weights in {equal}")


def _frames(problem: Problem, most: int) -> int:
    """Frames until all goals are met; one more than `most` if they are not."""
    tracker, q = QP().tracker(problem, DT), problem.start
    for number in range(1, most + 1):
        q = tracker.frame(q).q
        state = problem.scene.state(q)
        if all(np.linalg.norm(goal.error(state)) <= MET for goal in problem.goals):
            return number
    return most + 1


def put(scene: Scene, start: Array, places: list[tuple[float, ...] | None], *, overlap: str) -> Verdict:
    """Whether every frame is free of overlap, or tells it."""
    loop = FrameLoop(scene, start, overlap=overlap, dt=DT)
    (name,) = scene.objects
    told = 0
    for number, place in enumerate(places):
        if place is not None:
            scene.move(name, at=place)
        frame = loop.frame(start)
        deepest = -float(Pairs(scene).distances(frame.q).min(initial=0.0))
        if deepest > TOLD and not frame.note:
            return Verdict("wrong", f"frame {number}: {1e3 * deepest:.2f} mm of overlap, and no note")
        told += bool(frame.note)
    return Verdict("right", f"{len(places)} frames, {told} with notes")
