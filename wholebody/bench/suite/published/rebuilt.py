"""A published problem, rebuilt from its files by Pinocchio and coal alone, and the score of a posture for it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.files import LARGEST, is_folder, read_text

VERSION = "1.0"
INDEX = "index.json"


def read_json(path: Path, kind: str) -> dict[str, Any]:
    """Read a JSON object of an export whose "format" is "wholebody KIND"; FileFormatError for anything else."""
    found = loaded(path, f"{kind} file")
    if not isinstance(found, dict) or found.get("format") != f"wholebody {kind}":
        raise FileFormatError(f'{path}: its "format" is not "wholebody {kind}"; export the problems again')
    if found.get("version") != VERSION:
        raise FileFormatError(f"{path}: its version is {found.get('version')!r}; this judge reads {VERSION}")
    return found


def loaded(path: Path, kind: str) -> Any:
    """Read a JSON file; NaN and infinities are refused, as is a file that is missing or no JSON: FileFormatError."""
    text = read_text(path, kind, LARGEST)
    try:
        return json.loads(text, parse_constant=_refused)
    except json.JSONDecodeError as error:
        raise FileFormatError(
            f"{path}, line {error.lineno}: is not JSON ({error.msg}); write it with a library"
        ) from None
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{path}: is not JSON ({error}); write it with a library") from None


def _refused(name: str) -> None:
    raise ValueError(f"it has the number {name}, and JSON has finite numbers only")


def dumped(content: Mapping[str, Any]) -> str:
    """JSON text with a line for each entry, and for each object or list in a list of them."""
    lines = []
    for key, value in content.items():
        text = json.dumps(value, allow_nan=False)
        if isinstance(value, list) and value and isinstance(value[0], (dict, list)):
            text = "[\n  " + ",\n  ".join(json.dumps(item, allow_nan=False) for item in value) + "\n ]"
        elif isinstance(value, dict) and value and all(isinstance(item, dict) for item in value.values()):
            inner = ",\n  ".join(
                f"{json.dumps(name)}: {json.dumps(item, allow_nan=False)}" for name, item in value.items()
            )
            text = "{\n  " + inner + "\n }"
        lines.append(f" {json.dumps(key)}: {text}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


@lru_cache(maxsize=2)
def read_index(folder: Path) -> dict[str, Any]:
    """Read the index of an export; InputError where there is no folder, FileFormatError where it is no export."""
    if not is_folder(folder):
        raise InputError(f"{folder}: there is no such folder; make one with `wholebody bench export {folder}`")
    if not (folder / INDEX).is_file():
        raise FileFormatError(f"{folder}: has no {INDEX}; give a folder that `wholebody bench export` wrote")
    return read_json(folder / INDEX, "index")


def files_of(folder: Path) -> list[Path]:
    """The files of an export, which no answer or verdict is written over."""
    parts = ("problems", "bodies", "meshes", "witnesses", "difficulty", "clients")
    return [
        *folder.glob("*.schema.json"),
        folder / INDEX,
        *(path for part in parts for path in (folder / part).rglob("*")),
    ]


SHAPES: Mapping[str, tuple[Any, Mapping[str, int]]] = {
    "box": (coal.Box, {"size": 3}),
    "sphere": (coal.Sphere, {"radius": 1}),
    "capsule": (coal.Capsule, {"radius": 1, "length": 1}),
    "ellipsoid": (coal.Ellipsoid, {"semi_axes": 3}),
    "half-space": (coal.Halfspace, {"normal": 3, "offset": 1}),
}
"""Shapes by the words of the files: coal's class, and its arguments with how many numbers each has."""

SOLVED = 1e-3  # m, rad: worst of goals and of all that must hold, up to which a problem counts as solved
EXACT = 1e-6  # m, rad: what a witness meets, and an answer whose effort counts as the best known


@dataclass(frozen=True)
class Score:
    """The score of a posture for a problem.

    The worst of goals [m], [rad]; of pairs: the deepest overlap and the largest shortfall [m]; of limits, and of what
    is held and balanced [m, rad]. `effort`: weighted squared displacement of joints and root from the start.
    """

    goal_error: float
    goal_angle: float
    overlap: float
    clearance: float
    limits: float
    holds: float
    effort: float

    @property
    def worst(self) -> float:
        """The one figure of accuracy: the worst of goals and of all that must hold [m or rad]."""
        errors = (self.goal_error, self.goal_angle, self.overlap, self.clearance, self.limits, self.holds)
        return float(np.max(errors))  # NaN if one is: it is not solved


@dataclass(frozen=True)
class Body:
    """A body, read from its files: the model of the URDF, the JSON file, and the shapes of its pieces."""

    model: pin.Model
    content: Mapping[str, Any]
    shapes: tuple[Any, ...]


class Rebuilt:
    """A problem as its files state it; `moving`: an answer has a posture a frame."""

    def __init__(self, folder: Path, name: str) -> None:
        """Read a problem, such as "clutter/0007"; FileFormatError where a file is wrong."""
        path = folder / "problems" / f"{name}.json"
        self.content = read_json(path, "problem")
        body = read_body(folder, str(self.content["body"]))
        self.model, self.moving = body.model, "frames" in self.content
        self._body = body.content
        self._data = self.model.createData()
        pieces = [_piece(body, item, shape) for item, shape in zip(self._body["pieces"], body.shapes, strict=True)]
        pieces += [_piece(body, item, _shape(folder, item["shape"])) for item in self.content["things"]]
        self._geometry = pin.GeometryModel()
        for piece in pieces:
            self._geometry.addGeometryObject(piece)
        self._required = self._pairs(path)
        self._results = pin.GeometryData(self._geometry)
        weights = self._body["effort_weights"]
        self._weights = np.zeros(self.model.nv)
        roots = np.array(self._body["root_effort_weights"]).reshape(-1, 6)
        for joint, own in zip([joint for joint in self.model.joints if joint.nq == 7], roots, strict=True):
            self._weights[joint.idx_v : joint.idx_v + 6] = own
        for joint, weight in weights.items():
            self._weights[self.model.joints[self.model.getJointId(joint)].idx_v] = weight
        self._effort_from = np.array(self.content["effort_from"])
        self._holds = [_Placement(self.model, hold) for hold in self.content["holds"]]

    def seed(self, name: str) -> Array:
        """The posture (nq,) from which a solver begins: "near" or "far"."""
        return np.array(self.content["seeds"][name])

    @property
    def frames(self) -> int:
        """How many postures an answer has."""
        return len(self.content["frames"]) if self.moving else 1

    def score(self, q: Array, frame: int = 0) -> Score:
        """Judge a posture (nq,); of a problem whose goals move, for the goals of one frame."""
        model, data = self.model, self._data
        pin.forwardKinematics(model, data, q)
        pin.updateFramePlacements(model, data)
        goals = self.content["frames"][frame] if self.moving else self.content["goals"]
        errors = [_error(model, data, goal) for goal in goals]
        held = [value for hold in self._holds for value in hold.error(data)]
        held += [value for balance in self.content["balance"] for value in self._balance(balance, q)]
        distance = self._distances(q)
        return Score(
            goal_error=max((error[0] for error in errors), default=0.0),
            goal_angle=max((error[1] for error in errors), default=0.0),
            overlap=max(0.0, float(-distance.min(initial=0.0))),
            clearance=max(0.0, float((self._required - distance).max(initial=0.0))),
            limits=self._beyond(q),
            holds=max(held, default=0.0),
            effort=float(self._weights @ pin.difference(self.model, self._effort_from, q) ** 2),
        )

    def _pairs(self, path: Path) -> Array:
        """Add all pairs that are tested, and return the least distance of each (pairs,) [m]."""
        number = {piece.name: k for k, piece in enumerate(self._geometry.geometryObjects)}
        if len(number) < self._geometry.ngeoms:
            raise FileFormatError(f"{path}: two pieces have one name; export the problems again")
        own = len(self._body["pieces"])
        things = self.content["things"]
        chosen = [(number[a], number[b]) for a, b in self._body["pairs"]]
        untested = {frozenset(pair) for pair in self.content["untested"]}
        names = [piece.name for piece in self._geometry.geometryObjects]
        for second in range(own, len(names)):
            for first in range(second):
                carried = first >= own and things[first - own]["link"] is not None
                if first >= own and carried == (things[second - own]["link"] is not None):
                    continue
                if frozenset((names[first], names[second])) not in untested:
                    chosen.append((first, second))
        asked = self.content["clearance"]
        other = {frozenset((a, b)): least for a, b, least in asked["except"]}
        for first, second in chosen:
            self._geometry.addCollisionPair(pin.CollisionPair(first, second))
        return np.array([other.get(frozenset((names[a], names[b])), asked["every_pair"]) for a, b in chosen])

    def _distances(self, q: Array) -> Array:
        pin.updateGeometryPlacements(self.model, self._data, self._geometry, self._results, q)
        pin.computeDistances(self._geometry, self._results)
        return np.array([result.min_distance for result in self._results.distanceResults], dtype=float)

    def _balance(self, balance: Mapping[str, Any], q: Array) -> Array:
        place = pin.centerOfMass(self.model, self._data, q)[:2]
        if "of" in balance:
            joints = [self.model.frames[self.model.getFrameId(link)].parentJoint for link in balance["of"]]
            heavy = [(self.model.inertias[k].mass, self._data.oMi[k].act(self.model.inertias[k].lever)) for k in joints]
            place = sum(mass * at[:2] for mass, at in heavy) / sum(mass for mass, _ in heavy)
        inside = np.array(balance["normals"]) @ place - np.array(balance["offsets"])
        return np.asarray(np.maximum(balance["margin"] - inside, 0.0))

    def _beyond(self, q: Array) -> float:
        limits = self._body["limits"]
        worst = 0.0
        for value, name in zip(q, self._body["coordinates"], strict=True):
            low, high = limits.get(name, (-np.inf, np.inf))
            worst = max(worst, low - value, value - high)
        return float(worst)


class _Placement:
    """A frame at a placement, in the world or in another frame."""

    def __init__(self, model: pin.Model, stated: Mapping[str, Any]) -> None:
        self._frame = _frame(model, stated["frame"])
        self._base = None if stated["in"] is None else _frame(model, stated["in"])
        self._position = np.array(stated["position"])
        turn = stated["quaternion"]
        self._turn = None if turn is None else pin.Quaternion(np.array(turn)).toRotationMatrix()

    def error(self, data: pin.Data) -> tuple[float, float]:
        """Distance [m] and angle [rad] from where it belongs."""
        place = data.oMf[self._frame]
        if self._base is not None:
            place = data.oMf[self._base].actInv(place)
        angle = 0.0
        if self._turn is not None:
            angle = float(np.linalg.norm(pin.log3(place.rotation @ self._turn.T)))
        return float(np.linalg.norm(place.translation - self._position)), angle


def _error(model: pin.Model, data: pin.Data, goal: Mapping[str, Any]) -> tuple[float, float]:
    if goal["type"] == "placement":
        return _Placement(model, goal).error(data)
    place = data.oMf[_frame(model, goal["frame"])]
    way = np.array(goal["toward"]) - place.translation
    axis = place.rotation @ np.array(goal["axis"])
    return 0.0, float(np.arctan2(np.linalg.norm(np.cross(axis, way)), axis @ way))


def _frame(model: pin.Model, link: str) -> int:
    found = model.getFrameId(link, pin.FrameType.BODY)
    if found >= model.nframes:
        raise FileFormatError(f"the body {model.name} has no link {link!r}; export the problems again")
    return int(found)


@lru_cache(maxsize=4)
def read_body(folder: Path, path: str) -> Body:
    """Read a body of an export; its JSON file names its URDF. FileFormatError where a file is wrong."""
    content = read_json(folder / path, "body")
    urdf = folder / str(content["urdf"])
    text = read_text(urdf, "URDF")
    try:
        model = model_of(text, content["root"])
    except (ValueError, RuntimeError) as error:
        raise FileFormatError(f"{urdf}: Pinocchio cannot read it ({error}); export the problems again") from None
    if model.nq != len(content["coordinates"]):
        raise FileFormatError(f"{urdf}: it has {model.nq} coordinates, and {path} names {len(content['coordinates'])}")
    return Body(model, content, tuple(_shape(folder, item["shape"]) for item in content["pieces"]))


def model_of(urdf: str, root: str) -> pin.Model:
    """Pinocchio's model of a URDF on a root that is "free" or "fixed", or of "several" with joints that float."""
    return pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer()) if root == "free" else pin.buildModelFromXML(urdf)


def _piece(body: Body, item: Mapping[str, Any], shape: Any) -> pin.GeometryObject:
    place = pin.XYZQUATToSE3(np.array(item["pose"]))
    if item["link"] is None:
        return pin.GeometryObject(item["name"], 0, 0, place, shape)
    frame = _frame(body.model, item["link"])
    link = body.model.frames[frame]
    return pin.GeometryObject(item["name"], link.parentJoint, frame, link.placement * place, shape)


def _shape(folder: Path, stated: Mapping[str, Any]) -> Any:
    if stated["type"] == "convex":
        return _convex(folder / stated["mesh"])
    kind, sizes = SHAPES[stated["type"]]
    return kind(*(np.array(stated[name]) if count > 1 else stated[name] for name, count in sizes.items()))


def _convex(path: Path) -> Any:
    points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for line in read_text(path, "mesh").splitlines():
        kind, *values = line.split() or [""]
        if kind == "v":
            points.append(np.array([float(value) for value in values]))
        elif kind == "f":
            faces.append(coal.Triangle(*(int(value) - 1 for value in values)))
    return coal.Convex(points, faces)


def worst_of(scores: Sequence[Score]) -> Score:
    """The worst of several frames, figure by figure; the effort is the last one's."""
    worst = {name: float(np.max([getattr(score, name) for score in scores])) for name in Score.__dataclass_fields__}
    return Score(**{**worst, "effort": scores[-1].effort})
