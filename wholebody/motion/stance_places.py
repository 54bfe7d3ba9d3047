"""Where feet are held that stand in each other: a horizontal shift of each stand, so that both feet have their place.

Recordings that were brought onto a wider body stand with one foot in the other. Such feet cannot be held where they
are. A foot does not slide while its shift stays the same; so each stand of a foot, from when its first point is down
until its last one is up, gets one shift. Feet that do not overlap get none.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.geometry.swept_points import swept_points
from wholebody.motion.windows import Window, runs

APART = 1e-3
"""Metres that feet are apart after their shift: room for their rows to be met."""

LOOKED = 6
"""Frames of a common stand that are looked at, spread evenly; a foot hardly moves while it stands."""

ROUNDS = 10
"""Of shifting pairs of stands, one after the other; a stand may be beside several of the other foot."""

STEPS = 20
"""Of one shift: each goes by the depth that is left."""


class _Foot:
    """One foot: the frames that may stand, its pieces, and its stands."""

    def __init__(self, figure: Figure, joint: int, names: set[str], stands: Sequence[Sequence[str]]) -> None:
        self.names = names
        self.pieces = [
            piece for piece in figure.geometry.geometryObjects if joint in figure.model.supports[piece.parentJoint]
        ]
        self.stands: list[Window] = runs(np.array([any(name in names for name in each) for each in stands], dtype=bool))
        self.shifts = [np.zeros(3) for _ in self.stands]


def shifts(figure: Figure, q: Array, stands: Sequence[Sequence[str]]) -> tuple[tuple[Array, ...], ...]:
    """For each frame, the shift (3,) of each of the frames of the figure that stand there, metres.

    Args:
        figure: with feet.
        q: (n, nq) postures.
        stands: for each of them, names of the frames that stand.
    """
    feet = _feet(figure, stands)
    places = {}
    for first, second in combinations(feet, 2):
        for _ in range(ROUNDS):
            moved = False
            for i, one in enumerate(first.stands):
                for j, other in enumerate(second.stands):
                    begin, end = max(one.first, other.first), min(one.end, other.end)
                    if begin >= end:
                        continue
                    looked = np.unique(np.linspace(begin, end - 1, LOOKED).round().astype(int))
                    for frame in looked:
                        if frame not in places:
                            places[frame] = _placed(figure, q[frame], feet)
                    seen = [places[frame] for frame in looked]
                    push = _push(first, second, seen, first.shifts[i] - second.shifts[j])
                    if push.any():
                        first.shifts[i] += 0.5 * push
                        second.shifts[j] -= 0.5 * push
                        moved = True
            if not moved:
                break
    found = []
    for frame, names in enumerate(stands):
        here = []
        for name in names:
            foot = next(foot for foot in feet if name in foot.names)
            number = next(k for k, stand in enumerate(foot.stands) if stand.first <= frame < stand.end)
            here.append(foot.shifts[number])
        found.append(tuple(here))
    return tuple(found)


def _feet(figure: Figure, stands: Sequence[Sequence[str]]) -> list[_Foot]:
    """Feet of the frames that ever stand: those on one joint, or on joints that follow it, are one foot."""
    model = figure.model
    names = dict.fromkeys(name for each in stands for name in each)
    joints = {name: model.frames[figure.frame_id(name)].parentJoint for name in names}
    every = set(joints.values())
    tops = [joint for joint in sorted(every) if not (set(model.supports[joint].tolist()) - {joint}) & every]
    return [
        _Foot(figure, top, {name for name, joint in joints.items() if top in model.supports[joint]}, stands)
        for top in tops
    ]


def _placed(figure: Figure, q: Array, feet: Sequence[_Foot]) -> dict[str, pin.SE3]:
    """Placements of the feet's pieces in the world at a posture, by name."""
    data = figure.model.createData()
    pin.forwardKinematics(figure.model, data, q)
    return {piece.name: data.oMi[piece.parentJoint] * piece.placement for foot in feet for piece in foot.pieces}


def _push(first: _Foot, second: _Foot, frames: Sequence[dict[str, pin.SE3]], before: Array) -> Array:
    """(3,) horizontal shift of the first foot from the second, beyond one that it has, that brings them apart."""
    if not (first.pieces and second.pieces):
        return np.zeros(3)
    apart = np.mean([_middle(first, each) - _middle(second, each) for each in frames], axis=0) + before
    apart[2] = 0.0
    if not np.linalg.norm(apart) > 0.0:
        return np.zeros(3)
    way = apart / np.linalg.norm(apart)
    far = 0.0
    for _ in range(STEPS):
        least = min(_distance(first, second, each, before + far * way) for each in frames)
        if least >= (APART if far else 0.0):
            break
        far += max(APART - least, 1e-4)
    found: Array = far * way
    return found


def _middle(foot: _Foot, places: dict[str, pin.SE3]) -> Array:
    centers = []
    for piece in foot.pieces:
        points = swept_points(piece.geometry).points
        centers.append(places[piece.name].act(points.mean(axis=0) if len(points) else np.zeros(3)))
    return np.asarray(np.mean(centers, axis=0))


def _distance(first: _Foot, second: _Foot, places: dict[str, pin.SE3], shift: Array) -> float:
    least = np.inf
    for one in first.pieces:
        at = _transform(places[one.name], shift)
        for other in second.pieces:
            request, result = coal.DistanceRequest(), coal.DistanceResult()
            coal.distance(one.geometry, at, other.geometry, _transform(places[other.name]), request, result)
            least = min(least, float(result.min_distance))
    return least


def _transform(place: pin.SE3, shift: Array | float = 0.0) -> Any:
    return coal.Transform3s(place.rotation, place.translation + shift)
