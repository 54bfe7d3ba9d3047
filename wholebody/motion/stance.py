"""Feet that stand: found in a clip by speed and height, where they are held, and how far they slide.

Recordings that were brought onto a wider body stand with one foot in the other. Such feet cannot be held where they
are. A foot does not slide while its shift stays the same; so each stand of a foot, from when its first point is down
until its last one is up, gets one horizontal shift. Feet that do not overlap get none.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base import checks
from wholebody.base.arrays import Array, Mask
from wholebody.base.errors import InputError
from wholebody.base.fields import Checked, Names, Range
from wholebody.figures.figure import Figure
from wholebody.geometry.pieces import swept_points
from wholebody.motion.clip import Clip
from wholebody.motion.footholds import Point, RestLimits, resting
from wholebody.motion.roles import figure_roles
from wholebody.motion.solids import least_distance
from wholebody.motion.windows import Window, runs
from wholebody.tasks import Hold

FEET = ("left_foot", "right_foot")
POINTS = ("heel", "ball", "toe_tip")  # ends of the names of frames that are points of a foot


def foot_points(figure: Figure) -> tuple[str, ...]:
    """Names of the frames of a figure that are points of feet; none where the figure does not name any."""
    return tuple(name for name in figure.frames if name.endswith(POINTS))


def own_feet(figure: Figure) -> tuple[str, ...]:
    """The feet of a figure by name, or the ankles of a robot by its structure; none where it has neither."""
    named = (f"{body}{foot}" for body in figure.bodies for foot in FEET)
    found = tuple(name for name in named if name in (*figure.frames, *figure.segments))
    if found or len(figure.bodies) > 1 or figure.root != "free":
        return found
    roles = figure_roles(figure)
    return tuple(roles[role] for role in ("left_ankle", "right_ankle") if role in roles)


def _usual(figure: Figure) -> tuple[str, ...]:
    return foot_points(figure) or own_feet(figure)


def has_feet(figure: Figure) -> bool:
    """Whether a figure that may move about has frames that `StanceFeet` finds by itself."""
    return bool(figure.roots) and bool(_usual(figure))


@dataclass(frozen=True)
class StanceFeet(Checked):
    """Hold every foot that stands where it was: a constraint for `wb.avoid`.

    A frame stands where it is slow, and low above what is below it: the floor, a step, uneven ground. Of a foot of
    which one point stands, this point is held, and the foot may turn about it; of a foot of which two stand, the
    orientation is held too.

    Attributes:
        feet: frames of the feet; None for the figure's heels, balls and tips of the toes, or without these for its
            "left_foot" and "right_foot".
        speed: largest speed of a standing frame, m/s.
        height: largest height of a standing frame above the lowest nearby, metres, unless it came down from above.
        least: shortest stand, seconds; shorter ones are moments of a swing.

    Raises:
        InputError: a value out of range.

    Examples:
        >>> freed = wb.avoid(clip, scene, constraints=[wb.motion.StanceFeet(speed=0.2)])
    """

    feet: Annotated[Sequence[str], Names("['left_foot']", 0)] | None = None
    speed: Annotated[float, Range(0.0, 100.0)] = 0.15
    height: Annotated[float, Range(0.0, 10.0)] = 0.05
    least: Annotated[float, Range(0.0, 100.0)] = 0.1

    def names(self, figure: Figure) -> tuple[str, ...]:
        """Frames of the feet of a figure.

        Raises:
            UnknownNameError: the figure has no such frame.
            InputError: no feet are named, and the figure has none of the usual names.
        """
        checks.instance(figure, Figure, "StanceFeet: figure", "load one with wb.load('human')")
        if self.feet is not None:
            for name in self.feet:
                figure.frame_id(name)
            return tuple(self.feet)
        found = _usual(figure)
        if not found:
            raise InputError(f"StanceFeet: {figure.name} has no frames {' or '.join(FEET)}; name the feet")
        return found


def standing(figure: Figure, q: Array, dt: float, feet: StanceFeet | None = None) -> Mapping[str, Mask]:
    """For each foot in which frames of (n, nq), `dt` seconds apart, it stands: name -> (n,)."""
    settings = StanceFeet() if feet is None else feet
    names = settings.names(figure)
    limits = RestLimits(settings.speed, settings.height, settings.least, slid=np.inf, stayed=0.0)
    ends = [next(((k, end) for k, end in enumerate(POINTS, 1) if name.endswith(end)), (0, "")) for name in names]
    points = [Point(name.removesuffix(end), kind) for name, (kind, end) in zip(names, ends, strict=True)]
    found = resting(paths(figure, q, names), dt, limits, points)
    return {name: found[:, number] for number, name in enumerate(names)}


def pieces_on(figure: Figure, joint: int) -> list[Any]:
    """Pieces of a figure that a joint, or one after it, carries."""
    return [piece for piece in figure.geometry.geometryObjects if joint in figure.model.supports[piece.parentJoint]]


def usual_feet(figure: Figure, constraints: Iterable[object]) -> tuple[str, ...]:
    """The segments on which a figure with a free root stands, or else the frames that `StanceFeet` among terms name."""
    if figure.root != "free":
        return ()
    given = [term for term in constraints if isinstance(term, StanceFeet) and term.feet is not None]
    return own_feet(figure) or tuple(name for term in given for name in term.names(figure))


BEARING_SPEED, BEARING_HEIGHT = 0.5, 0.012
"""m/s, m: a foot that comes down, or leaves, bears too, though its points roll on: both do between two steps."""


def standing_feet(clip: Clip, feet: Sequence[str]) -> dict[str, Mask]:
    """Frames (n,) in which each foot stands, that is, one of its points rests; none with a fixed root."""
    figure = clip.figure
    found: dict[str, Mask] = {}
    if figure.root != "free":
        return found
    for name in feet:
        joint = figure.model.frames[figure.frame_id(name)].parentJoint
        points = tuple(
            point
            for point in foot_points(figure)
            if joint in figure.model.supports[figure.model.frames[figure.frame_id(point)].parentJoint]
        )
        marks = [
            mark
            for rest in (StanceFeet(points or (name,)), StanceFeet(points or (name,), BEARING_SPEED, BEARING_HEIGHT))
            for mark in standing(figure, clip.q, clip.dt, rest).values()
        ]
        found[name] = np.any(marks, axis=0)
    if not found:
        raise InputError(f"torques: {figure.name} has no segments {' or '.join(FEET)}; name its feet with feet=[...]")
    return found


def held_feet(figure: Figure, stand: Sequence[str]) -> tuple[Hold, ...]:
    """What holds the feet of which some frames stand; a term that is not resolved keeps what is at the start.

    A frame that is not the only one of its segment, or that is no point of a foot, is held with its orientation.
    """
    joints = [figure.model.frames[figure.frame_id(name)].parentJoint for name in stand]
    found = []
    for number, (name, joint) in enumerate(zip(stand, joints, strict=True)):
        if not name.endswith(POINTS):
            found.append(Hold(name))
        elif joint not in joints[:number]:
            found.append(Hold(name, orientation=joints.count(joint) > 1))
    return tuple(found)


class _Foot:
    """One foot: the frames that may stand, its pieces, and its stands."""

    def __init__(self, figure: Figure, joint: int, names: set[str], stands: Sequence[Sequence[str]]) -> None:
        self.names = names
        self.pieces = pieces_on(figure, joint)
        self.stands: list[Window] = runs(np.array([any(name in names for name in each) for each in stands], dtype=bool))
        self.shifts = [np.zeros(3) for _ in self.stands]


def shifts(figure: Figure, q: Array, stands: Sequence[Sequence[str]]) -> tuple[tuple[Array, ...], ...]:
    """For each posture (n, nq), the shift (3,) of each of the frames that stand there, by name, metres."""
    feet = _feet(figure, stands)
    places = {}
    for first, second in combinations(feet, 2):
        for _ in range(10):  # a stand may be beside several of the other foot
            moved = False
            for i, one in enumerate(first.stands):
                for j, other in enumerate(second.stands):
                    begin, end = max(one.first, other.first), min(one.end, other.end)
                    if begin >= end:
                        continue
                    # six frames are enough: a foot hardly moves while it stands
                    looked = np.unique(np.linspace(begin, end - 1, 6).round().astype(int))
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
    far, apart_by = 0.0, 1e-3  # m: room for the rows of feet that were shifted
    for _ in range(20):
        least = min(_distance(first, second, each, before + far * way) for each in frames)
        if least >= (apart_by if far else 0.0):
            break
        far += max(apart_by - least, 1e-4)
    return np.asarray(far * way)


def _middle(foot: _Foot, places: dict[str, pin.SE3]) -> Array:
    centers = []
    for piece in foot.pieces:
        points = swept_points(piece.geometry).points
        centers.append(places[piece.name].act(points.mean(axis=0) if len(points) else np.zeros(3)))
    return np.asarray(np.mean(centers, axis=0))


def _distance(first: _Foot, second: _Foot, places: dict[str, pin.SE3], shift: Array) -> float:
    moved = pin.SE3(np.eye(3), shift)
    here = [(piece.geometry, moved * places[piece.name]) for piece in first.pieces]
    return least_distance(here, [(piece.geometry, places[piece.name]) for piece in second.pieces])


@dataclass(frozen=True, eq=False)
class Sliding:
    """How far a point of a foot slides while it stands.

    Attributes:
        frame: name of the point's frame.
        stands: (n,) whether it stands in each frame.
        distance: farthest from where it stood first, in the horizontal plane, in any of the times that it stands,
            metres.
        at: the frame in which it is farthest.
    """

    frame: str
    stands: NDArray[np.bool_] = field(repr=False)
    distance: float
    at: int


def paths(figure: Figure, q: Array, frames: tuple[str, ...]) -> Array:
    """Positions (n, frames, 3) of frames in the world at postures (n, nq), metres."""
    found = [figure.model.frames[figure.frame_id(name)] for name in frames]
    return point_paths(figure, q, [(int(frame.parentJoint), frame.placement.translation) for frame in found])


def point_paths(figure: Figure, q: Array, points: Sequence[tuple[int, Array]]) -> Array:
    """The same (n, p, 3) of points, of each its joint and where (3,) it is in it."""
    data, found = figure.model.createData(), np.zeros((len(q), len(points), 3))
    for k, posture in enumerate(q):
        pin.forwardKinematics(figure.model, data, posture)
        for i, (joint, place) in enumerate(points):
            found[k, i] = data.oMi[joint].act(place)
    return found


def standing_points(figure: Figure, q: Array, dt: float) -> dict[str, NDArray[np.bool_]]:
    """In which frames of (n, nq), `dt` seconds apart, each point of the feet stands: name -> (n,)."""
    names = foot_points(figure)
    return dict(standing(figure, q, dt, StanceFeet(names))) if names else {}


def slid(path: Array, stands: NDArray[np.bool_]) -> tuple[float, int]:
    """How far a point (n, 3) moves in the horizontal plane while it stands, metres, and the frame; 0 and 0 for none."""
    far, at = 0.0, 0
    for first, after in runs(stands):
        away = np.linalg.norm(path[first:after, :2] - path[first, :2], axis=1)
        if away.max() > far:
            far, at = float(away.max()), int(first + np.argmax(away))
    return far, at


def sliding(figure: Figure, q: Array, dt: float) -> tuple[Sliding, ...]:
    """How far each point of the feet slides while it stands, at postures (n, nq), `dt` seconds apart."""
    stand, found = standing_points(figure, q, dt), []
    for name, path in zip(stand, paths(figure, q, tuple(stand)).transpose(1, 0, 2), strict=True):
        found.append(Sliding(name, stand[name], *slid(path, stand[name])))
    return tuple(found)
