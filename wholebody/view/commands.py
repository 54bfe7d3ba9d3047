"""The commands that the page understands, as msgpack: meshcat's own, and `label` of page.js."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.view.server import Command, Op
from wholebody.view.style import LOOK

if TYPE_CHECKING:
    from wholebody.figures.surface import Patch


def floats(values: Any) -> Any:
    """Numbers as the page's Float32Array, in C order."""
    return _extension(0x17, np.ascontiguousarray(values, dtype="<f4").tobytes())


def integers(values: Any) -> Any:
    """Numbers as the page's Uint32Array, in C order."""
    return _extension(0x16, np.ascontiguousarray(values, dtype="<u4").tobytes())


def set_object(path: str, three: Mapping[str, Any]) -> Command:
    """Put a three.js object (its JSON form) at a node."""
    return Command(Op.OBJECT, path, "", pack({"type": "set_object", "path": path, "object": dict(three)}))


def label(path: str, text: str, color: str, size: float) -> Command:
    """Put a line of text at a node, upright; `size` is its height as a fraction of the distance from the camera."""
    return Command(
        Op.OBJECT, path, "", pack({"type": "label", "path": path, "text": text, "color": color, "size": size})
    )


def set_skeleton(
    path: str, carriers: Sequence[str], offsets: Array, inverses: Array, halves: Sequence[Sequence[float]]
) -> Command:
    """Put a skeleton at a node: bones that follow other nodes, and bend the skins that name it.

    Each of n bones has its carrier, `offsets` (n, 4, 4) from it, and `inverses` (n, 4, 4) where the skin was bound;
    `halves` turn between two others: index of the bone, of the first and of the second, its origin, its slide (3,),
    shares of the turn and the twist and, if any, the direction (3,) from which that counts, as `Bone` has them.
    """
    message = {
        "type": "skeleton",
        "path": path,
        "carriers": list(carriers),
        "offsets": _numbers(np.swapaxes(offsets, 1, 2), "<f4"),
        "inverses": _numbers(np.swapaxes(inverses, 1, 2), "<f4"),
        "halves": [list(half) for half in halves],
    }
    return Command(Op.OBJECT, path, "", pack(message))


def set_skin(path: str, skeleton: str, patch: Patch, color: tuple[float, ...], unit: float) -> Command:
    """Put a patch, of 65,536 vertices and 256 bones at most, at a node behind its skeleton's, rounded to `unit` [m]."""
    weights = np.round(255.0 * patch.weights).astype(int)
    weights[:, 0] += 255 - weights.sum(axis=1)  # the strongest takes the rounding: the page adds them up unscaled
    message = {
        "type": "skin",
        "path": path,
        "skeleton": skeleton,
        "unit": unit,
        "position": _differences(np.round(patch.vertices / unit), "<i2"),
        "normal": _differences(np.round(127.0 * patch.normals), "i1"),
        "bones": _numbers(patch.bones, "u1"),
        "weights": _numbers(weights, "u1"),
        "index": _differences(np.concatenate([patch.faces, patch.coarse]).reshape(-1, 1), "<u2"),
        "fine": patch.faces.size,
        "color": [float(part) for part in color],
        "contacts": contact_paint(),
    }
    return Command(Op.OBJECT, path, "", pack(message))


def contact_paint() -> dict[str, Any]:
    """How the page paints a body around its contacts: colours, red, green, blue, of a radius [m], and their share."""
    return {
        "touch": list(LOOK.contact[:3]), "overlap": list(LOOK.penetration[:3]),
        "radius": LOOK.patch_radius, "share": LOOK.patch,
    }  # fmt: skip


def _numbers(values: Any, kind: str) -> bytes:
    return np.ascontiguousarray(values).astype(kind).tobytes()


def _differences(rows: Array, kind: str) -> bytes:
    """Rows less those before them, which compress better; the page adds them up, modulo the range of the numbers."""
    return _numbers(np.diff(rows.astype(np.int64), axis=0, prepend=0), kind)


def set_transform(path: str, matrix: Array) -> Command:
    """Place a node: matrix (4, 4) relative to its parent node, scale allowed."""
    return Command(Op.TRANSFORM, path, "", _transform_head(path) + np.asarray(matrix, dtype="<f4").T.tobytes())


@lru_cache(maxsize=8192)
def set_property(path: str, name: str, value: Any) -> Command:
    """Set a property of a node's three.js object; `color` takes red, green, blue, alpha and reaches all below."""
    payload = pack({"type": "set_property", "path": path, "property": name, "value": value})
    return Command(Op.PROPERTY, path, name, payload)


def delete(path: str) -> Command:
    """Remove a node and all below it."""
    return Command(Op.DELETE, path, "", pack({"type": "delete", "path": path}))


def look_from(eye: Array, target: Array) -> Command:
    """Turn the camera at `eye` (3,) to a target (3,)."""
    return _look(eye=np.asarray(eye, dtype=float).tolist(), target=np.asarray(target, dtype=float).tolist())


def look_at(points: Array, direction: Sequence[float], margin: float) -> Command:
    """Turn the camera to points (n, 3) from a direction (3,), the picture `margin` times as wide as they are."""
    target = (points.min(axis=0) + points.max(axis=0)) / 2
    return _look(direction=list(direction), target=target.tolist(), points=floats(points), margin=margin)


def _look(**how: Any) -> Command:
    return Command(Op.CAMERA, "", "", pack({"type": "look", "fov": LOOK.field_of_view, **how}))


class Track(NamedTuple):
    """Values of one property of one node over time."""

    path: str  # the node
    name: str  # the property, as three.js names it: "position", "material.color"
    kind: str  # "vector3", "quaternion", "color", "number" or "bool"
    values: Any  # (n, size) one row a frame; n booleans for "bool"
    steps: bool = False  # whether the value jumps at each frame instead of being interpolated

    def lower(self, times: Array) -> dict[str, Any]:
        """Return the track in the format of three.js."""
        if self.kind == "bool":
            values: Any = [bool(value) for value in np.ravel(self.values)]
        else:
            values = floats(self.values)
        track = {"name": f".{self.name}", "type": self.kind, "times": floats(times), "values": values}
        if self.steps:
            track["interpolation"] = 2300  # three.js: InterpolateDiscrete
        return track


def set_animation(tracks: Sequence[Track], times: Array, repetitions: float) -> Command:
    """Let the page play a motion by its own clock: tracks at times (n,), seconds, ascending; as often as is said."""
    clips: dict[str, list[dict[str, Any]]] = {}
    for track in tracks:
        clips.setdefault(track.path, []).append(track.lower(times))
    animations = [
        {"path": path, "clip": {"fps": 1, "name": path, "tracks": lowered}} for path, lowered in clips.items()
    ]
    options = {"play": True, "repetitions": float(repetitions)}
    return Command(Op.ANIMATION, "", "", pack({"type": "set_animation", "animations": animations, "options": options}))


def stop_animation() -> Command:
    """End the motion; moved nodes return to their state before it."""
    empty = {"type": "set_animation", "animations": [], "options": {"play": False}}
    return Command(Op.ANIMATION, "", Op.STOP, pack(empty))


@lru_cache(maxsize=4096)
def _transform_head(path: str) -> bytes:
    """All of a set_transform message before its 64 bytes of numbers: packing it each time costs ten times as much."""
    message = pack({"type": "set_transform", "path": path, "matrix": _extension(0x17, bytes(64))})
    return message[:-64]


def _extension(code: int, data: bytes) -> Any:
    import umsgpack

    return umsgpack.Ext(code, data)


def pack(message: dict[str, Any]) -> bytes:
    """A message as msgpack."""
    import umsgpack

    return bytes(umsgpack.packb(message))
