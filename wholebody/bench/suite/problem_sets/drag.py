"""A fingertip dragged along a smooth curve, frame by frame, past random things."""

from __future__ import annotations

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.bench.suite.problem_sets.bodies import (
    ROOM,
    TIPS,
    alone,
    floor_scene,
    human,
    is_free,
    point,
    shaken,
    standing_problem,
)
from wholebody.bench.suite.problem_sets.case import Posed, numbers
from wholebody.bench.suite.problem_sets.things import Occupied, add_things

given = numbers("drag")


def posed(number: int, rng: np.random.Generator) -> Posed:
    """The goals are where the fingertip is in each posture of `way`; the first is where it is at the start."""
    figure, tip = human(), TIPS[number % len(TIPS)]
    postures = way(figure, rng)
    scene = floor_scene(figure)
    add_things(scene, given.things, Occupied(figure, postures), ROOM, rng)
    goals = [point(figure, q, tip) for q in postures]
    moving = tuple((goal,) for goal in goals[1:])
    return standing_problem(scene, postures[0], goals[:1]), postures[0], moving, tuple(postures[1:])


def way(figure: wb.Figure, rng: np.random.Generator) -> Array:
    """Postures (frames + 1, nq) of a smooth motion from standing, at rest at both ends, each one free.

    A uniform cubic B-spline (de Boor 1978, "A Practical Guide to Splines") whose control postures are random. It stays
    within their convex hull, so within the limits; a span depends on four of them, so a new one is tried until the span
    that it ends is free.

    Raises:
        InputError: none was found.
    """
    standing = figure.posture("standing")
    spans = int(rng.integers(given.spans[0], given.spans[1] + 1))
    for _ in range(50):
        control, frames = [standing] * 3, [standing[None]]
        while len(frames) <= spans:
            resting = len(frames) > spans - given.spans_to_rest
            for _ in range(1 if resting else 40):
                point = control[-1] if resting else shaken(figure, control[-1], given.stride, rng)
                span = _span(np.array([*control[-3:], point]))
                if all(is_free(alone(figure), q) for q in span):
                    control.append(point)
                    frames.append(span)
                    break
            else:
                break
        else:
            return np.vstack(frames)
    raise InputError("none of 50 ways is free; give another seed")


def _span(control: Array) -> Array:
    """Postures (frames, nq) of the span between the second and the third of four control postures (4, nq)."""
    t = np.arange(1, given.frames_a_span + 1)[:, None] / given.frames_a_span
    weights = np.hstack([(1.0 - t) ** 3, 3.0 * t**3 - 6.0 * t**2 + 4.0, -3.0 * t**3 + 3.0 * t**2 + 3.0 * t + 1.0, t**3])
    return np.asarray(weights @ control / 6.0)
