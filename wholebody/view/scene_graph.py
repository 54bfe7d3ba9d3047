"""The page's content as a scene graph: sends only changes to the live page, and makes animations of keyframes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.geometry.placement import quaternions, steady
from wholebody.view import commands, drawing
from wholebody.view.commands import Track
from wholebody.view.server import Command, Server, Store
from wholebody.view.style import LOOK, Color

MANY = 1000  # opaque pieces of things in the world, from which on those of one form are drawn together


@dataclass(frozen=True)
class Marker:
    """A small object drawn on top of the picture. It is made once and then only moved."""

    kind: str  # "arrow", "rod", "dashes", "ball" or "label"
    color: Any  # red, green, blue; of a label, its CSS colour
    size: float = 1.0  # of an arrow its width relative to the usual, of a ball its radius, of a label its height
    text: str = ""  # of a label
    symbol: bool = False  # of an arrow: its length is no measure


@dataclass
class Keyframe:
    """Everything that can change from one posture to the next."""

    transforms: dict[str, Array] = field(default_factory=dict)  # placement (4, 4) by node, relative to the node above
    colors: dict[str, Color] = field(default_factory=dict)  # by node
    # pieces that are drawn together, by node; a motion shows those of its first keyframe
    crowds: dict[str, Instances] = field(default_factory=dict)
    # marker and placement (4, 4) by node. Markers of earlier keyframes that are not named are hidden.
    markers: dict[str, tuple[Marker, Array]] = field(default_factory=dict)
    contacts_shown: bool = True  # whether all pairs that overlap are shown
    # touching and overlapping: numbers of pairs that are shown as touching, and that overlap
    touching: int = 0
    overlapping: int = 0
    overlap: float = 0.0  # depth of the deepest overlap, metres


class SceneGraph:
    """The page's content. Without a connection it is only stored, for saving."""

    def __init__(self) -> None:
        self.store = Store()
        self._server: Server | None = None
        self._waiting: list[Command] = []
        self._markers: dict[str, Marker] = {}
        self._crowds: dict[str, Instances] = {}

    def connect(self, server: Server) -> None:
        """Connect to the live page, which then shows everything."""
        self._server = server
        self._waiting.clear()
        server.send(self.store.commands())

    def disconnect(self) -> None:
        """Disconnect from the live page; the content is kept."""
        self._server = None
        self._waiting.clear()

    def put(self, path: str, three: Mapping[str, Any]) -> None:
        """Put a three.js object at a node, in place of an earlier one."""
        self.do(commands.set_object(path, three))

    def remove(self, path: str) -> None:
        """Remove a node and all below it."""
        if any(name == path or name.startswith(path + "/") for name in self.store.nodes):
            self.do(commands.delete(path))

    def place(self, path: str, matrix: Array) -> None:
        """Place a node relative to the one above."""
        self.do(commands.set_transform(path, matrix))

    def set(self, path: str, name: str, value: Any) -> None:
        """Set a property of a node."""
        self.do(commands.set_property(path, name, value))

    def flush(self) -> None:
        """Send all changes since the last call together."""
        if self._server is not None and self._waiting:
            self._server.send(self._waiting)
        self._waiting.clear()

    def show(self, keyframe: Keyframe) -> None:
        """Make the page show this keyframe."""
        if self.store.animation is not None:
            self.do(commands.stop_animation())
        for path, (marker, _) in keyframe.markers.items():
            self._provide(path, marker)
        for path, matrix in keyframe.transforms.items():
            self.place(path, matrix)
        for path, color in keyframe.colors.items():
            self.set(path, "color", color)
        for path, crowd in keyframe.crowds.items():
            if self._crowds.get(path) is not crowd:
                self._crowds[path] = crowd
                self.put(path, crowd.drawn(path))
        for path in self._markers:
            shown = path in keyframe.markers
            self.set(path, "visible", shown)
            if shown:
                self.place(path, keyframe.markers[path][1])
        self.flush()

    def play(self, keyframes: Sequence[Keyframe], times: Array, repetitions: float) -> None:
        """Let the page play keyframes at times (n,), seconds. A marker that changes its appearance is left out."""
        later: set[str] = set()
        for keyframe in keyframes[1:]:
            for path, (marker, place) in keyframe.markers.items():
                if path not in keyframes[0].markers:
                    self._provide(path, marker)
                    if path not in later:  # tracks carry only what changes, such as no scale of an arrow that keeps it
                        self.place(path, place)
                        later.add(path)
        self.show(keyframes[0])
        tracks = [*_placements(keyframes), *_colors(keyframes), *self._appearances(keyframes)]
        self.do(commands.set_animation(tracks, times, repetitions))
        self.flush()

    def do(self, command: Command) -> None:
        """Carry out a command, unless it would change nothing."""
        if self.store.has(command):
            return
        self.store.apply(command)
        if self._server is not None:
            self._waiting.append(command)

    def _provide(self, path: str, marker: Marker) -> None:
        """Make a marker unless it exists already."""
        if self._markers.get(path) == marker:
            return
        self._markers[path] = marker
        if marker.kind == "label":
            self.do(commands.label(path, marker.text, marker.color, marker.size))
        elif marker.kind == "arrow":
            self.put(path, drawing.arrow(path, marker.color, marker.size, symbol=marker.symbol))
        elif marker.kind in ("rod", "dashes"):
            self.put(path, drawing.rod(path, marker.color, 1 if marker.kind == "rod" else 4))
        else:
            self.put(path, drawing.ball(path, marker.color, marker.size))

    def _appearances(self, keyframes: Sequence[Keyframe]) -> list[Track]:
        """Tracks of the markers: their visibility and placements."""
        tracks: list[Track] = []
        for path, marker in self._markers.items():
            found = [keyframe.markers.get(path) for keyframe in keyframes]
            places = [entry[1] if entry is not None and entry[0] == marker else None for entry in found]
            if all(place is None for place in places):
                continue
            if any(place is None for place in places):
                tracks.append(Track(path, "visible", "bool", [place is not None for place in places], steps=True))
            last = next(place for place in places if place is not None)
            matrices = np.array([last := place if place is not None else last for place in places])
            tracks.extend(_motion(path, matrices, steps=path.startswith(LOOK.contact_node)))
        return tracks


def _placements(keyframes: Sequence[Keyframe]) -> list[Track]:
    """Tracks of the nodes that move."""
    return [
        track
        for path in keyframes[0].transforms
        for track in _motion(path, np.array([keyframe.transforms[path] for keyframe in keyframes]))
    ]


def _colors(keyframes: Sequence[Keyframe]) -> list[Track]:
    """Tracks of the pieces whose colour changes; opacity stays as it is."""
    tracks = []
    for path in keyframes[0].colors:
        colors = np.array([keyframe.colors[path][:3] for keyframe in keyframes])
        if (colors != colors[0]).any():
            tracks.append(Track(f"{path}/<object>", "material.color", "color", colors, steps=True))
    return tracks


def _motion(path: str, matrices: Array, *, steps: bool = False) -> list[Track]:
    """Tracks of one node's placements (n, 4, 4); none if it does not move."""
    if (np.ptp(matrices, axis=0) < 1e-9).all():
        return []
    scales = np.linalg.norm(matrices[:, :3, :3], axis=1)
    turns = steady(quaternions(matrices[:, :3, :3] / scales[:, None, :]))
    tracks = [
        Track(path, "position", "vector3", matrices[:, :3, 3], steps),
        Track(path, "quaternion", "quaternion", turns, steps),
    ]
    if (np.ptp(scales, axis=0) > 1e-9).any():
        tracks.append(Track(path, "scale", "vector3", scales, steps))
    return tracks


class Instances(NamedTuple):
    """Pieces of one form, where they are and in which colours."""

    form: Any  # a coal shape that all of them are, each with a scale of its own
    places: Array  # (k, 4, 4) placements with scales
    colors: Array  # (k, 3) red, green, blue

    def painted(self, number: int, color: Color) -> Instances:
        """The same with another colour of one of them."""
        colors = self.colors.copy()
        colors[number] = color[:3]
        return self._replace(colors=colors)

    def drawn(self, name: str) -> drawing.Three:
        """All of them as one three.js object of this name."""
        return drawing.instances(self.form, name, self.places, self.colors)


class Crowd:
    """Pieces of one form that stand in the world; `members` (k,) are their indices among all pieces."""

    def __init__(self, path: str, members: Indices, pieces: Sequence[Any], colors: Sequence[Color]) -> None:
        self.path, self.members = path, members
        forms = [_form(pieces[index].geometry) for index in members.tolist()]
        self._scales = np.array([scale for _, scale in forms])
        places = np.zeros((len(members), 4, 4))
        painted = np.array([colors[index][:3] for index in members.tolist()])
        self._last = Instances(drawing.unit(pieces[members[0]].geometry), places, painted)

    def at(self, pieces: Sequence[Any]) -> Instances:
        """Where they are now; the same object as long as none moves."""
        places = np.array([pieces[index].placement.homogeneous for index in self.members.tolist()])
        places[:, :3, :3] *= self._scales[:, None, :]
        if not np.array_equal(places, self._last.places):
            self._last = self._last._replace(places=places)
        return self._last


def crowds(folder: str, standing: Sequence[int], pieces: Sequence[Any], colors: Sequence[Color]) -> tuple[Crowd, ...]:
    """What is drawn together of the opaque pieces of things in the world; nothing where there are few of them."""
    if len(standing) < MANY:
        return ()
    alike: dict[Any, list[int]] = {}
    for index in standing:
        alike.setdefault(_form(pieces[index].geometry)[0], []).append(index)
    groups = [np.array(members, dtype=np.intp) for members in alike.values() if len(members) > 1]
    return tuple(Crowd(f"{folder}/together {k}", members, pieces, colors) for k, members in enumerate(groups))


def _form(geometry: Any) -> tuple[Any, tuple[float, float, float]]:
    """What pieces of one form share, and the scale of this one."""
    kind, one = type(geometry).__name__, (1.0, 1.0, 1.0)
    if kind == "Sphere":
        return ("ball",), (geometry.radius,) * 3
    if kind == "Ellipsoid":
        return ("ball",), tuple(geometry.radii)
    if kind == "Box":
        return ("box",), tuple(2.0 * side for side in geometry.halfSide)
    if kind == "Convex":
        return np.asarray(geometry.points()).tobytes(), one
    return (kind, geometry.radius, geometry.halfLength), one
