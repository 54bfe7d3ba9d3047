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
from wholebody.bench.suite.problem_sets.case import Posed, ProblemSet
from wholebody.bench.suite.problem_sets.things import Occupied, add_things

THINGS = 12
SPAN = 24  # frames from one knot of the spline to the next: 0.4 s
SPANS = (5, 8)  # fewest and most spans of a drag, the last of which come to rest
AT_REST = 2  # spans that the spline takes to come to rest on its last posture
STRIDE = 0.35  # share of the range of every joint between one control posture and the next
TRIES, STARTS = 40, 50  # postures tried for a knot, and ways begun anew where none of them would do


def _posed(number: int, rng: np.random.Generator) -> Posed:
    """The goals are where the fingertip is in each posture of `way`; the first is where it is at the start."""
    figure, tip = human(), TIPS[number % len(TIPS)]
    postures = way(figure, rng)
    scene = floor_scene(figure)
    add_things(scene, THINGS, Occupied(figure, postures), ROOM, rng)
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
    spans = int(rng.integers(SPANS[0], SPANS[1] + 1))
    for _ in range(STARTS):
        control, frames = [standing] * 3, [standing[None]]
        while len(frames) <= spans:
            resting = len(frames) > spans - AT_REST
            for _ in range(1 if resting else TRIES):
                point = control[-1] if resting else shaken(figure, control[-1], STRIDE, rng)
                span = _span(np.array([*control[-3:], point]))
                if all(is_free(alone(figure), q) for q in span):
                    control.append(point)
                    frames.append(span)
                    break
            else:
                break
        else:
            return np.vstack(frames)
    raise InputError(f"none of {STARTS} ways is free; give another seed")


def _span(control: Array) -> Array:
    """Postures (SPAN, nq) of the span between the second and the third of four control postures (4, nq)."""
    t = np.arange(1, SPAN + 1)[:, None] / SPAN
    weights = np.hstack([(1.0 - t) ** 3, 3.0 * t**3 - 6.0 * t**2 + 4.0, -3.0 * t**3 + 3.0 * t**2 + 3.0 * t + 1.0, t**3])
    return np.asarray(weights @ control / 6.0)


SET = ProblemSet(
    "drag",
    "drag",
    "A fingertip is dragged for two to three seconds along a smooth curve past twelve things, a goal every sixtieth of "
    "a second; what counts is how closely and how calmly the body follows.",
    _posed,
    moving=True,
)
