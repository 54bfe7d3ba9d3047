"""A case of the attack, and the judge: distances of all pairs by plain calls of coal, limits and goals by Pinocchio.

The judge shares with the package's own assessment only the terms as they were given, the shapes of things and where
they stand. Balance, reach cones and ranges of motion, constructions of the package's own, are read from their terms.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import coal
import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.geometry.flesh import in_joints
from wholebody.geometry.pieces import box_corners
from wholebody.problem import Problem
from wholebody.scene.scene import Scene

Outcome = Literal["right", "refused", "gave up", "wrong"]

CORPUS = Path(__file__).parent / "corpus"
"""Small files of every kind that people give to the package, each right as it stands."""

PATTERN = (
    ("file", "solve", "file") * 4
    + ("file", "sweep", "file", "solve") * 3
    + ("file", "solve", "file", "stream") * 2
    + ("file", "solve", "file", "contact")
    + ("file", "own-term", "file", "pairs")
    + ("file", "sleeper", "file", "weights")
    + ("file", "put")
)
"""Kinds of cases in turn: two mutated files for each solve."""
KINDS = {
    "file": "mutated tasks, tracks, results, robots and meshes",
    "solve": "solves, judged by coal over all pairs and by Pinocchio",
    "sweep": "sweeps against a fine subdivision",
    "stream": "streams of moving goals and things, every step and the motion between two",
    "contact": "contacts, against the effort of a point or frame at the place found",
    "own-term": "solves and steps with terms of one's own that are not finite, or answer something odd",
    "pairs": "things in each other, against every two pieces",
    "sleeper": "sleeping bodies whose support slides, turns, jumps or leaves",
    "weights": "goals of one frame with weights from 1 to 1e6, met in at most thrice the frames of equal ones",
    "put": "things that are put into a figure that is shown, every frame free or reported",
}


class Verdict(NamedTuple):
    """What came of a case.

    `outcome`: "refused" where an input was refused by one sentence, "gave up" where an answer says that it is none
    although there is one; `words` in one line; `seconds` of the processor; `status` that the answer gives itself.
    """

    outcome: Outcome
    words: str
    seconds: float = 0.0
    status: str = ""


class Case(NamedTuple):
    """One case, by the seed of the attack, its number and its kind."""

    seed: int
    number: int
    kind: str

    def rng(self) -> np.random.Generator:
        """Return a generator that depends on the case alone."""
        return np.random.default_rng([self.seed, self.number, [*KINDS].index(self.kind)])

    @property
    def name(self) -> str:
        """Name of the folder in which a failure is written."""
        return f"{self.kind}-{self.seed}-{self.number:06d}"


def chosen(rng: np.random.Generator, choices: Sequence[Any]) -> Any:
    """Return one of some choices."""
    return choices[int(rng.integers(len(choices)))]


def kind_of(number: int) -> str:
    """Return the kind of a case of an attack on everything."""
    return PATTERN[number % len(PATTERN)]


@dataclass(frozen=True)
class Judged:
    """What a posture measures, metres and radians.

    `goal`: largest error; `least`: least signed distance of any pair, inf without pairs; `shortfall`: by how much the
    worst pair, `closest`, misses its required distance; `limits`, `constraints`: the worst violation; `unit`: how far
    quaternions are from unit length.
    """

    finite: bool = True
    goal: float = 0.0
    least: float = np.inf
    shortfall: float = 0.0
    closest: str = ""
    limits: float = 0.0
    constraints: float = 0.0
    unit: float = 0.0

    @property
    def violation(self) -> float:
        """The worst of everything that must hold [m, rad]."""
        return max(self.shortfall, self.limits, self.constraints, -self.least, 0.0)


class Pairs:
    """Pairs of a figure and of things, with their distances at postures."""

    def __init__(self, scene: Scene) -> None:
        figure = scene.figure
        self._model, self._data, self._geometry = figure.model, figure.model.createData(), scene.geometry
        self._request = coal.DistanceRequest()
        self._pieces: list[tuple[str, int, pin.SE3, Any]] = [
            (self._model.frames[piece.parentFrame].name, int(piece.parentJoint), piece.placement, piece.geometry)
            for piece in (*figure.geometry.geometryObjects, *figure.outer)
        ]
        pairs = [(int(pair.first), int(pair.second)) for pair in figure.geometry.collisionPairs]
        own = figure.geometry.ngeoms if figure.outer else 0  # which are too coarse to meet things
        meeting = range(own, len(self._pieces))
        moving = [number for number in meeting if self._pieces[number][1] > 0]
        for name, thing in scene.objects.items():
            for piece in thing.shape.pieces():
                pairs += [(k, len(self._pieces)) for k in moving]
                self._pieces.append((name, 0, thing.placement * piece.placement, piece.geometry))
        self.owners = [(self._pieces[a][0], self._pieces[b][0]) for a, b in pairs]
        self._pairs = pairs
        self.size = max((extent(geometry) for _, _, _, geometry in self._pieces), default=0.0)

    def distances(self, q: Array) -> Array:
        """Signed distances (pairs,) at a posture (nq,), metres."""
        pin.forwardKinematics(self._model, self._data, q)
        placed, flesh = [], in_joints(self._geometry, self._data.oMi)  # the figure's pieces come first in both
        for number, (_, joint, place, geometry) in enumerate(self._pieces):
            place = pin.SE3(flesh[number]) if number in flesh else place
            there = self._data.oMi[joint] * place if joint else place
            placed.append((geometry, coal.Transform3s(there.rotation, there.translation)))
        found = np.empty(len(self._pairs))
        for number, (first, second) in enumerate(self._pairs):
            (a, at), (b, bt) = placed[first], placed[second]
            found[number] = coal.distance(a, at, b, bt, self._request, coal.DistanceResult())
        return found

    def asked(self, start: Array, clearance: float) -> Array:
        """Distance (pairs,) asked of every pair: the clearance, or what a pair that rests has at the start."""
        began = self.distances(start)
        return np.where(began >= -1e-6, np.minimum(clearance, np.maximum(began, 0.0)), clearance)


def judge(problem: Problem, goals: Sequence[Any], constraints: Sequence[Any], q: Array) -> Judged:
    """Measure a posture (nq,) against goals and constraints as they were given."""
    scene, start = problem.scene, problem.start
    q = np.asarray(q, dtype=float)
    if q.shape != (scene.model.nq,) or not np.isfinite(q).all():
        return Judged(finite=False)
    pairs = Pairs(scene)
    distance, asked = pairs.distances(q), pairs.asked(start, problem.clearance)
    least, shortfall, closest = np.inf, 0.0, ""
    if len(distance):
        worst = int(np.argmax(asked - distance))
        least, shortfall = float(distance.min()), float(max((asked - distance)[worst], 0.0))
        closest = " and ".join(pairs.owners[worst])
    if not np.isfinite(distance).all():
        return Judged(finite=False)
    body = _Body(scene.model, start, q)
    held = [value for term in constraints for value in body.constraint(term)]
    for term in problem.constraints:
        if isinstance(term, (wb.Balance, wb.tasks.ReachCones, wb.tasks.RangeOfMotion)):
            value = np.atleast_1d(term.value(scene.state(q)))
            held += list(np.maximum(term.lower - value, value - term.upper))
    return Judged(
        goal=max((body.goal(term) for term in goals), default=0.0),
        least=least,
        shortfall=shortfall,
        closest=closest,
        limits=_limits(scene.model, q),
        constraints=float(max([0.0, *held])),
        unit=float(np.abs(pin.normalize(scene.model, q) - q).max(initial=0.0)),
    )


def _limits(model: pin.Model, q: Array) -> float:
    worst = 0.0
    for joint in model.joints[1:]:
        if joint.nq == joint.nv == 1:
            value = q[joint.idx_q]
            low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
            worst = max(worst, low - value, value - high)
    return float(worst)


def extent(geometry: Any) -> float:
    """Radius of a piece about its origin, metres; 0 for a half-space, whose distances need none."""
    if isinstance(geometry, coal.Halfspace):
        return 0.0
    return float(np.linalg.norm(box_corners(geometry), axis=1).max())


class _Body:
    """A figure at its start and at an answer."""

    def __init__(self, model: pin.Model, start: Array, q: Array) -> None:
        self._model, self._start, self._q = model, start, q
        self._before, self._after = model.createData(), model.createData()
        for data, posture in ((self._before, start), (self._after, q)):
            pin.framesForwardKinematics(model, data, posture)
            pin.centerOfMass(model, data, posture)

    def goal(self, term: Any) -> float:
        """Residual of a goal, metres or radians, the larger."""
        if isinstance(term, wb.Point):
            there = self._at(term.frame).act(np.array(term.offset, dtype=float))
            return float(np.linalg.norm(there - np.array(term.target, dtype=float)))
        if isinstance(term, wb.CenterOfMass):
            left = self._after.com[0] - np.array(term.target, dtype=float)
            return float(np.linalg.norm(left[: len(term.axes)]))
        if isinstance(term, wb.Frame):
            return apart(self._at(term.frame), _placement(term.target))
        if isinstance(term, wb.Orientation):
            return _angle(self._at(term.frame).rotation, pin.Quaternion(np.array(term.target, dtype=float)).matrix())
        if isinstance(term, wb.Axis):
            return self._axis(term)
        if isinstance(term, wb.Posture):
            way = pin.difference(self._model, np.array(term.target, dtype=float), self._q)
            slides = self._slides()
            return float(max(np.linalg.norm(way[slides]), np.linalg.norm(way[~slides])))
        raise TypeError(f"the judge does not know the goal {type(term).__name__}")

    def constraint(self, term: Any) -> Iterator[float]:
        """By how much a constraint or a frozen joint is violated; nothing for bounds on speeds."""
        if isinstance(term, wb.Hold):
            wanted = self._at(term.frame, self._before) if term.at is None else _placement(term.at)
            yield apart(self._at(term.frame), wanted, term.orientation)
        elif isinstance(term, wb.Plane):
            normal = np.array(term.normal, dtype=float)
            point = self._at(term.frame, self._before).translation if term.point is None else np.array(term.point)
            height = float((self._at(term.frame).translation - point) @ normal / np.linalg.norm(normal))
            yield -height if term.side == "above" else abs(height)
        elif isinstance(term, wb.Freeze):
            way = pin.difference(self._model, self._start, self._q)
            for name in term.joints:
                joint = self._model.joints[1 if name == "root" else self._model.getJointId(name)]
                yield float(np.abs(way[joint.idx_v : joint.idx_v + joint.nv]).max())

    def _axis(self, term: wb.Axis) -> float:
        there = self._at(term.frame)
        pointing = there.rotation @ np.array(term.axis, dtype=float)
        wanted = np.array(term.direction, dtype=float)
        return float(np.arctan2(np.linalg.norm(np.cross(pointing, wanted)), pointing @ wanted))

    def _at(self, frame: str, data: Any = None) -> pin.SE3:
        return (self._after if data is None else data).oMf[self._model.getFrameId(frame)]

    def _slides(self) -> Any:
        """Which places of the tangent (nv,) are in metres: sliding joints, and where a free root is."""
        slides = np.zeros(self._model.nv, dtype=bool)
        for joint in self._model.joints[1:]:
            if joint.nv == 6:
                slides[joint.idx_v : joint.idx_v + 3] = True
            elif "JointModelP" in joint.shortname():
                slides[joint.idx_v : joint.idx_v + joint.nv] = True
        return slides


def _placement(at: Any) -> pin.SE3:
    values = np.array(at, dtype=float)
    turn = np.eye(3) if len(values) == 3 else pin.Quaternion(values[3:] / np.linalg.norm(values[3:])).matrix()
    return pin.SE3(turn, values[:3])


def apart(a: pin.SE3, b: pin.SE3, orientation: bool = True) -> float:
    """Distance of two placements, metres, or their angle, radians, where it is larger."""
    distance = float(np.linalg.norm(a.translation - b.translation))
    return max(distance, _angle(a.rotation, b.rotation)) if orientation else distance


def _angle(a: Array, b: Array) -> float:
    return float(np.linalg.norm(pin.log3(b.T @ a)))
