"""Animated skeletons of glTF files (.glb, .gltf), and clips that `gltf.write` wrote."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation, Slerp

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.files import title_of
from wholebody.figures.description import follows
from wholebody.figures.figure import Figure
from wholebody.geometry.gltf import GltfDocument
from wholebody.motion.clip import MOST_FRAMES
from wholebody.motion.files.base import Frames
from wholebody.motion.files.gltf import JOINT
from wholebody.motion.files.nodes import OFF, wrapped
from wholebody.motion.skeleton import UNITS, UP, SkeletonMotion, longest_way
from wholebody.motion.structure import is_sized, recognised_unit

ENDINGS = (".glb", ".gltf")
PATHS = ("translation", "rotation", "scale")


class Animated:
    """The first animation of a file that moves nodes, sampled at equal steps.

    Attributes:
        document: the file.
        moved: node to translations (n, 3), rotations (n, 4) and scales (n, 3).
        count, dt: number of frames, and seconds between them.
        notes: sentences on what was chosen.
    """

    def __init__(self, path: Path, longest: float = np.inf) -> None:
        """Read a file; between keyframes that are more than `longest` seconds apart 60 frames a second."""
        self._longest = longest
        self.document = GltfDocument(path)
        self.notes: list[str] = []
        self.document.decoded(self._sample)

    def _sample(self) -> None:
        document = self.document
        animations = document.tree.get("animations", [])
        moving = [[c for c in each["channels"] if c["target"].get("path") in PATHS] for each in animations]
        chosen = next((k for k, channels in enumerate(moving) if channels), None)
        if chosen is None:
            raise FileFormatError(
                f"{document.path.name}: there is no animation of nodes in it; export it with its motion"
            )
        if len(animations) > 1:
            name = animations[chosen].get("name") or f"number {chosen + 1}"
            self.notes.append(f"{len(animations)} animations are in the file; {name!r} is read")
        samplers = animations[chosen]["samplers"]
        channels = [c for c in moving[chosen] if "node" in c["target"]]
        keys = [document.accessor(samplers[c["sampler"]]["input"])[:, 0] for c in channels]
        times, self.dt, even = _steps_of(np.concatenate(keys), self._longest, document.path.name)
        if not even:
            self.notes.append("keyframes are at unequal times or far apart; 60 frames a second are read between them")
        self.count = len(times)
        self.moved: dict[int, tuple[Array, Array, Array]] = {}
        for channel, at in zip(channels, keys, strict=True):
            node, sampler = channel["target"]["node"], samplers[channel["sampler"]]
            if node not in self.moved:
                place, turn, scale = (np.tile(part, (self.count, 1)) for part in document.parts(node))
                self.moved[node] = place, turn, scale
            values = document.accessor(sampler["output"]).astype(float)
            column = PATHS.index(channel["target"]["path"])
            self.moved[node][column][:] = _sampled(at.astype(float), values, sampler, times, turns=column == 1)

    def worlds(self) -> Array:
        """(n, k, 4, 4) placements of all nodes."""
        return self.document.worlds(self.moved, self.count)


def _sampled(keys: Array, values: Array, sampler: dict[str, Any], times: Array, *, turns: bool) -> Array:
    """Values (n, k) at times, of keyframes as the sampler interpolates them."""
    kind = sampler.get("interpolation", "LINEAR")
    times = np.clip(times, keys[0], keys[-1])
    if kind == "CUBICSPLINE":
        before, values, after = (values.reshape(len(keys), 3, -1)[:, k] for k in range(3))
        if len(keys) == 1:
            return np.tile(values, (len(times), 1))
        starts = np.clip(np.searchsorted(keys, times, side="right") - 1, 0, len(keys) - 2)
        found = np.empty((len(times), values.shape[1]))
        for k in np.unique(starts):
            ends = [k, k + 1]
            part = CubicHermiteSpline(keys[ends], values[ends], np.stack([after[k], before[k + 1]]))
            found[starts == k] = part(times[starts == k])
    elif kind == "STEP" or len(keys) == 1:
        found = values[np.clip(np.searchsorted(keys, times + 1e-5, side="right") - 1, 0, len(keys) - 1)]
    elif turns:
        return np.asarray(Slerp(keys, Rotation.from_quat(values))(times).as_quat())
    else:
        found = np.stack([np.interp(times, keys, column) for column in values.T], axis=1)
    return found / np.linalg.norm(found, axis=1, keepdims=True) if turns else found


def skeleton_of(animated: Animated, unit: str | None = None, up: str | None = None) -> SkeletonMotion:
    """The skeleton of the skin with most joints, or of the animated nodes; units and axes as for `read_skeleton`."""
    if animated.dt > 0.1:
        animated = Animated(animated.document.path, 0.1)
    return animated.document.decoded(lambda: _skeleton(animated, unit, up))


def _skeleton(animated: Animated, unit: str | None, up: str | None) -> SkeletonMotion:
    document, notes = animated.document, list(animated.notes)
    title, rest, skins = title_of(document.path), document.worlds({})[0], document.tree.get("skins", [])
    if skins:
        skin = max(range(len(skins)), key=lambda k: len(skins[k]["joints"]))
        joints, bind = set(skins[skin]["joints"]), _bound(document, skin, rest)
    else:
        joints, bind = set(animated.moved), rest
        notes.append("no body is bound to the nodes; they rest as the file places them")
    nodes = document.tree["nodes"]
    for node in document.downwards:  # the ends of limbs, and without a skin what does not turn by itself
        bare = not {"mesh", "camera"} & nodes[node].keys() and not (skins and nodes[node].get("children"))
        if bare and document.parents[node] in joints:
            joints.add(node)
    kept = _joined(document.parents, joints)
    parents = np.array([kept.index(int(document.parents[node])) if at else -1 for at, node in enumerate(kept)])
    turn, worlds, bind = UP[up or "y"], animated.worlds()[:, kept], bind[kept]
    bound = _rigid(bind[:, :3, :3])
    offsets = np.zeros((len(kept), 3))
    offsets[1:] = bind[1:, :3, 3] - bind[parents[1:], :3, 3]
    size = longest_way(parents, offsets)
    if size == 0.0:
        raise FileFormatError(f"{title}: all joints of the skeleton are at one place")
    if unit is None:
        unit = "metres"
        if not is_sized(parents, offsets):  # exporters forget the unit
            unit = recognised_unit(parents, offsets)
            notes += [f"lengths are in {unit}, though the format has metres"] if unit != "metres" else []
    scale = UNITS[unit]
    rotations = turn @ (_rigid(worlds[:, :, :3, :3]) @ np.swapaxes(bound, 1, 2)) @ turn.T
    try:
        return SkeletonMotion(
            tuple(document.names[node] for node in kept), parents, scale * offsets @ turn.T, rotations,
            scale * worlds[:, :, :3, 3] @ turn.T, animated.dt, title, tuple(notes),
        )  # fmt: skip
    except InputError as error:
        raise FileFormatError(f"{title}: {error}") from None


def _bound(document: GltfDocument, skin: int, rest: Array) -> Array:
    """(k, 4, 4) placements of the nodes where a skin is bound, the body nearest to the posture of the nodes."""
    joints = document.tree["skins"][skin]["joints"]
    bind = np.linalg.inv(document.inverse_binds(skin))
    if np.ptp(bind[:, :3, 3], axis=0).max() < 1e-9:  # no matrices: the mesh is bound by the nodes as they rest
        return rest
    theirs, ours = bind[:, :3, 3], rest[joints][:, :3, 3]
    meshes = [node for node, fields in enumerate(document.tree["nodes"]) if fields.get("skin") == skin]
    tops = [int(document.parents[node]) for node in joints if document.parents[node] not in joints]
    places = [np.eye(4), *(rest[node] for node in (*meshes, *tops) if node >= 0)]

    def off(place: Array) -> float:
        moved = theirs @ place[:3, :3].T
        return float(np.linalg.norm((moved - moved.mean(axis=0)) - (ours - ours.mean(axis=0))))

    best = min(places, key=off)
    found = np.array(rest)
    for node in document.downwards:
        if node in joints:
            found[node] = best @ bind[joints.index(node)]
        elif document.parents[node] >= 0:
            above = int(document.parents[node])
            found[node] = found[above] @ np.linalg.solve(rest[above], rest[node])
    return found


def _joined(parents: Indices, joints: Collection[int]) -> list[int]:
    """The nodes, and those between them and the nearest one above all, parents before children."""
    chains = []
    for joint in joints:
        way = [joint]
        while parents[way[-1]] >= 0:
            way.append(int(parents[way[-1]]))
        chains.append(way[::-1])
    common = 0
    while len({way[common] if common < len(way) else -1 for way in chains}) == 1 and common < min(map(len, chains)):
        common += 1
    if not common:
        raise FileFormatError("the joints of the skeleton hang on no common node; give each skeleton a file of its own")
    depth = {node: level for way in chains for level, node in enumerate(way)}
    return sorted({node for way in chains for node in way[common - 1 :]}, key=lambda node: (depth[node], node))


def _rigid(matrices: Array) -> Array:
    """The rotations (..., 3, 3) nearest to matrices that scale too."""
    u, _, vt = np.linalg.svd(matrices)
    sign = np.linalg.det(u @ vt)
    u[..., :, 2] *= sign[..., None]
    return np.asarray(u @ vt)


def _steps_of(times: Array, longest: float, title: str) -> tuple[Array, float, bool]:
    """Times of frames, their step, and whether keyframes are at equal steps up to `longest`; otherwise every 1/60 s."""
    keys = np.unique(np.asarray(times, dtype=float))
    keys = keys[np.r_[True, np.diff(keys) > 1e-4]]  # s: rounding of single precision
    if len(keys) < 2:
        return keys, 1.0 / 30.0, True
    span, step = float(keys[-1] - keys[0]), float(np.median(np.diff(keys)))
    count = round(span / step)
    even = len(keys) > 2 and bool(np.abs((keys - keys[0]) / (span / count) % 1.0 - 0.5).min() > 0.45)
    even = (even or len(keys) == 2) and step <= longest
    if not even:
        count = max(1, round(span * 60.0))
    if count >= MOST_FRAMES:
        raise FileFormatError(f"{title}: {count + 1} frames; give at most {MOST_FRAMES}")
    return np.linspace(keys[0], keys[-1], count + 1), _rounded_step(span / count), even


def _rounded_step(dt: float) -> float:
    """A time step of single precision as it was meant: a whole number of frames a second, or of microseconds."""
    for meant in (1.0 / max(1, round(1.0 / dt)), round(dt, 6)):
        if abs(meant - dt) < 1e-6 * dt:
            return meant
    return dt


def read_motion(path: Path, unit: str | None = None, up: str | None = None) -> SkeletonMotion:
    """Read a moving skeleton; see `wholebody.motion.reading.read_skeleton`."""
    return skeleton_of(Animated(path), unit, up)


def own(animated: Animated, figure: Figure) -> Frames | None:
    """Postures of a file whose nodes are the figure's joints, as `gltf.write` writes it; None for any other."""
    document, model = animated.document, figure.model
    place = {name.removeprefix(JOINT): node for node, name in enumerate(document.names) if name.startswith(JOINT)}
    if set(place) != set(model.names):
        return None
    q = np.tile(pin.neutral(model), (animated.count, 1))
    data = model.createData()
    pin.forwardKinematics(model, data, q[0], np.zeros(model.nv))
    for joint in range(1, model.njoints):
        node, made = place[model.names[joint]], model.joints[joint]
        if document.names[document.parents[node]] != JOINT + model.names[model.parents[joint]]:
            return None
        parts = animated.moved.get(node) or tuple(np.tile(part, (animated.count, 1)) for part in document.parts(node))
        if follows(made):
            continue
        fixed = model.jointPlacements[joint]
        turned = Rotation.from_matrix(fixed.rotation.T) * Rotation.from_quat(parts[1])
        moved = (parts[0] - fixed.translation) @ fixed.rotation
        ends = [float(limit[made.idx_q]) for limit in (model.lowerPositionLimit, model.upperPositionLimit)]
        values = _values(made, turned, moved, np.asarray(data.joints[joint].S).reshape(6, -1)[:, 0], ends)
        if values is None:
            return None
        q[:, made.idx_q : made.idx_q + made.nq] = values
    return Frames(q, animated.dt, title_of(document.path))


def _values(made: Any, turned: Rotation, moved: Array, along: Array, ends: list[float]) -> Array | None:
    """Values (n, nq) of a joint that turns and moves its frame; None of one elsewhere, or that no own file has."""
    slides = made.nv == 6 or made.shortname() == "JointModelPlanar" or bool(np.linalg.norm(along[:3]) > 0.5)
    if not slides and np.abs(moved).max(initial=0.0) > OFF:
        return None  # of a figure of another size
    if made.nv == 1:
        if slides:
            return (moved @ along[:3])[:, None]
        angle, middle = turned.as_rotvec() @ along[3:], 0.5 * (ends[0] + ends[1])
        within = made.nq == 1 and ends[1] - ends[0] <= 2.0 * np.pi
        angle = middle + wrapped(angle - middle) if within else np.unwrap(angle)
        return angle[:, None] if made.nq == 1 else np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if made.nv == 6:
        return np.hstack([moved, turned.as_quat()])
    if made.shortname() == "JointModelPlanar":
        angle = turned.as_rotvec()[:, 2]
        return np.stack([moved[:, 0], moved[:, 1], np.cos(angle), np.sin(angle)], axis=1)
    return turned.as_quat() if made.nq == 4 and made.nv == 3 else None
