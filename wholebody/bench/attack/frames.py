"""Frames: goals of mixed weights that can all be met, and things that are put into a figure that is shown."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.attack.bodies import Body, body
from wholebody.bench.attack.case import Verdict, chosen
from wholebody.bench.attack.judging import Pairs, apart
from wholebody.bench.attack.solves import scene_of
from wholebody.bench.attack.things import clear, xyzquat
from wholebody.bench.suite.problem_sets.things import Occupied
from wholebody.tracking.loop import FrameLoop


def weights(rng: np.random.Generator, folder: Path) -> Verdict:
    """Follow goals of one frame, as it is in a posture near the start, with weights from 1 to a million.

    They have to be met in at most three times the frames of equal weights.
    """
    figure = body(rng, folder)
    frame = str(rng.choice(figure.frames))
    there = figure.figure.placement(figure.near(figure.standing, float(rng.choice([0.2, 0.5, 1.0])), rng), frame)
    there = pin.SE3(there.rotation.copy(), there.translation.copy())
    point, turn = (float(10.0 ** rng.uniform(0.0, 6.0)) for _ in range(2))
    most = 60
    equal = frames_until(figure, frame, there, (1.0, 1.0), most)
    if equal > most:
        return Verdict("right", f"goals of equal weights are not met in {most} frames; nothing is asked")
    found = frames_until(figure, frame, there, (point, turn), 3 * equal)
    words = f"weights {point:.3g} and {turn:.3g}"
    if found > 3 * equal:
        return Verdict("wrong", f"{words}: not met in {3 * equal} frames, with equal ones in {equal}")
    return Verdict("right", f"{words}: met in {found} frames, with equal ones in {equal}")


def frames_until(figure: Body, frame: str, there: pin.SE3, weighed: tuple[float, float], most: int) -> int:
    """Frames until a frame is where it should be, within 0.1 mm and mrad; `most` + 1 if it does not get there."""
    goals = [
        wb.Point(frame, there.translation, weight=weighed[0]),
        wb.Orientation(frame, there.rotation, weight=weighed[1]),
    ]
    problem = wb.Problem(wb.Scene(figure.figure), figure.standing, goals=goals)
    tracker, q = wb.QP().tracker(problem, 1.0 / 60.0), problem.start
    for number in range(1, most + 1):
        q = tracker.frame(q).q
        if apart(figure.figure.placement(q, frame), there) <= 1e-4:
            return number
    return most + 1


def put(rng: np.random.Generator, folder: Path) -> Verdict:
    """Show a figure where it is tracked, and put a thing somewhere into it now and then."""
    figure = body(rng, folder)
    start, thing = figure.standing, None
    while thing is None:
        thing = clear(rng, Occupied(figure.figure, [start]), figure.size, 1e-3 * figure.size, [0])
    places: list[tuple[float, ...] | None] = []
    for _ in range(int(rng.integers(3, 10))):
        place, at = thing.placement, figure.figure.placement(start, str(rng.choice(figure.frames)))
        place.translation = at.translation + 0.1 * figure.size * rng.normal(size=3)
        places += [xyzquat(place), *[None] * int(rng.integers(0, 6))]
    scene = scene_of(figure, [thing])
    return shown(scene, FrameLoop(scene, start, overlap=chosen(rng, ("qp", "ccd"))), places)


def shown(scene: wb.Scene, loop: FrameLoop, places: Sequence[tuple[float, ...] | None]) -> Verdict:
    """Judge whether every frame is free of overlap or tells it, while the scene's only thing is put into places."""
    start: Array = loop.shown
    (name,) = scene.objects
    told = 0
    for number, place in enumerate(places):
        if place is not None:
            scene.move(name, at=place)
        frame = loop.frame(start)
        deepest = -float(Pairs(scene).distances(frame.q).min(initial=0.0))
        if deepest > 1.2e-4 and not frame.note:
            return Verdict("wrong", f"frame {number}: {1e3 * deepest:.2f} mm of overlap, and no note")
        told += bool(frame.note)
    return Verdict("right", f"{len(places)} frames, {told} with notes")
