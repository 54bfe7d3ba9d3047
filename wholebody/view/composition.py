"""Makes the keyframe of a posture of a scene: pieces, contacts, goals, names, camera, and the panel."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from math import degrees
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import Assessment
from wholebody.base.arrays import Array, with_values
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.geometry.proximity import PENETRATION
from wholebody.view import commands, drawing
from wholebody.view.bodies import Bodies
from wholebody.view.commands import pack
from wholebody.view.markers import Goals, color_contacts, mark_blockers, mark_contacts, mark_frames, mark_overlaps
from wholebody.view.scene_graph import Keyframe, Marker, SceneGraph
from wholebody.view.server import Command, Op
from wholebody.view.style import LOOK, Color
from wholebody.view.viewed_scene import ViewedScene

if TYPE_CHECKING:
    from wholebody.tracking.overlaps import Overlap


class Composition:
    """A scene in a scene graph; nothing is drawn before the first posture.

    Pieces nearer than `contact_distance` metres are shown as touching; `see_through` names things to draw transparent,
    and `names` writes the names of things beside them.
    """

    def __init__(
        self, scene: ViewedScene, graph: SceneGraph, contact_distance: float, see_through: Collection[str], names: bool
    ) -> None:
        self.scene, self._graph = scene, graph
        self._contact_distance, self._see_through, self._names = contact_distance, see_through, names
        self._state = State(scene.model)
        self.pieces = False
        self._bodies: Bodies | None = None
        self._goals: Goals | None = None
        self._frames: tuple[str, ...] = ()
        self._axes = LOOK.axes_length
        self.segment_colors: dict[str, Color] = {}

    @property
    def figure(self) -> Figure:
        """The figure; raises InputError where there is none: the scene is of parts alone."""
        if self.scene.figure is None:
            raise InputError("the scene has no figure, so it has no frames to show and no segments to color")
        figure: Figure = self.scene.figure
        return figure

    def frames(self, names: Iterable[str], length: float) -> None:
        """Draw the axes of these frames of the figure in every keyframe made from now on, `length` metres long."""
        self._frames, self._axes = tuple(names), length

    @property
    def bodies(self) -> Bodies:
        """The body or pieces, and things; drawn when first needed, and again after things were added or removed."""
        drawn = self._bodies
        if drawn is None or drawn.revision != self.scene.revision or drawn.pieces != self.pieces:
            drawn = self._bodies = Bodies(self.scene, self._see_through, self.pieces)
            drawn.build(self._graph)
        return drawn

    def checked(self, q: Any) -> Array:
        """Copy of a posture (nq,); raises InputError where it has the wrong shape or is not finite."""
        return np.array(self._state.update(q).q)

    def keyframe(
        self, q: Array, problem: Any, blockers: Sequence[Any] = (), overlaps: Sequence[Overlap] = ()
    ) -> Keyframe:
        """The keyframe of a posture, with the goals of a problem if there is one, the blockers, and overlaps."""
        bodies, state, keyframe = self.bodies, self._state.update(q), Keyframe()
        bodies.pose(keyframe, state.data)
        bodies.color_segments(keyframe, self.segment_colors)
        contacts = self.scene.contacts(q, within=self._contact_distance)
        color_contacts(keyframe, bodies, contacts)
        mark_contacts(keyframe, bodies, contacts)
        keyframe.contacts_shown = self._contact_distance >= 0.0
        keyframe.overlapping = int(np.sum(contacts.distance < -PENETRATION))
        keyframe.touching = len(contacts.distance) - keyframe.overlapping
        keyframe.overlap = max(0.0, -float(np.min(contacts.distance, initial=0.0)))
        self._goals = Goals(self.scene, problem) if problem is not None else None
        if self._goals is not None:
            self._goals.mark(keyframe, state)
        if blockers:
            asked = float(problem.clearances.max(initial=0.0))
            near = self.scene.contacts(q, within=asked + self._contact_distance)
            mark_blockers(keyframe, self.scene, state, near, blockers)
        mark_overlaps(keyframe, bodies, state.data, overlaps)
        mark_frames(keyframe, self.scene, state, self._frames, self._axes)
        if self._names:
            for path, (name, top) in bodies.tops(state.data).items():
                label = Marker("label", LOOK.label, LOOK.label_size, name)
                keyframe.markers[path] = (label, drawing.point_placement(top))
        return keyframe

    def ghosts(self, postures: Sequence[Array], color: Color) -> None:
        """Draw the figure, transparent, at these postures, in place of earlier ghosts."""
        if postures and self.scene.figure is not None:
            self.scene.figure.warn_of_angles(np.array(postures), "ghosts")
        self._graph.remove(LOOK.ghost_node)
        for number, q in enumerate(postures):
            self.bodies.ghost(self._graph, number, self._state.update(q).data, color)

    def moving_ghost(self, keyframes: Sequence[Keyframe], postures: Any, color: Color, played: Timed) -> list[Array]:
        """Add a moving ghost, one posture a frame, to a motion's keyframes; return its first posture."""
        checked, count = [self.checked(q) for q in postures], played.frames[-1] + 1
        if len(checked) != count:
            raise InputError(f"the ghost has {len(checked)} postures and the motion {count}; give as many")
        self.ghosts(checked[:1], color)
        for keyframe, q in zip(keyframes, played.between(self.scene.model, checked), strict=True):
            self.bodies.pose_ghost(keyframe, self._state.update(q).data)
        return checked[:1]

    def camera(self, postures: Iterable[Array]) -> Command:
        """A camera that sees the figure at all of these postures, and the last shown goals."""
        figure, things = [], []
        for q in postures:
            state = self._state.update(q)
            figure.append(self.bodies.corners(state.data, things=False))
            things.append(self.bodies.corners(state.data, things=True))
            if self._goals is not None:
                figure.append(self._goals.targets(state))
        seen, around = np.concatenate(figure), np.concatenate(things)
        if not len(seen):
            seen = around if len(around) else np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 2.0]])
        # m: distance from the figure within which things are kept in the picture
        near = np.clip(around, seen.min(axis=0) - 0.3, seen.max(axis=0) + 0.3)
        return commands.look_at(np.concatenate([seen, near]), LOOK.direction, LOOK.margin)


def legend(keyframes: Sequence[Keyframe]) -> list[tuple[str, Any]]:
    """Meanings and colours (red, green, blue) of what occurs in any of the keyframes."""
    found: dict[str, Any] = {}
    if any(keyframe.touching for keyframe in keyframes):
        found["touches"] = LOOK.contact[:3]
    if any(keyframe.overlapping for keyframe in keyframes):
        found["overlaps"] = LOOK.penetration[:3]
    paths = {path for keyframe in keyframes for path in keyframe.markers}
    marked = (  # end of a marker's node, its folder, its colour and its meaning
        ("/normal", LOOK.contact_node, LOOK.normal, "normal of a contact"),
        ("/depth", LOOK.contact_node, LOOK.depth, "way out of an overlap"),
        ("/first", LOOK.contact_node, LOOK.global_depth, "global penetration depth PD_g"),
        ("/second", LOOK.contact_node, LOOK.global_depth, "global penetration depth PD_g"),
        ("/cancelled", LOOK.contact_node, LOOK.global_depth, "global penetration depth PD_g"),
        ("/target", LOOK.goal_node, LOOK.target, "goal, and the line to it"),
        ("/wanted", LOOK.goal_node, LOOK.target, "goal, and the line to it"),
        ("/ball", LOOK.blocker_node, LOOK.blocker, "in the way"),
    )
    for end, folder, shade, meaning in marked:
        if any(path.startswith(folder) and path.endswith(end) for path in paths):
            found[meaning] = shade
    return list(found.items())


def status(keyframes: Sequence[Keyframe], count: int, dt: float, found: Assessment | None) -> str:
    """One line about what is shown: postures `dt` s apart, their paths as keyframes, or the only one's fit."""
    said = [f"{count} postures, {(count - 1) * dt:.2f} s"] if count > 1 else []
    if found is not None and found.goal_errors:
        # radians: smaller angles are not shown
        angle = f", {degrees(found.goal_angle):.1f}°" if found.goal_angle > 1e-3 else ""
        said.append(f"goals missed by at most {1e3 * found.goal_error:.1f} mm{angle}")
    if not all(keyframe.contacts_shown for keyframe in keyframes):
        return "; ".join(said)
    touching = max(keyframe.touching + keyframe.overlapping for keyframe in keyframes)
    said.append(f"{'at most ' if len(keyframes) > 1 else ''}{touching} contact{'' if touching == 1 else 's'}")
    deepest = max(keyframe.overlap for keyframe in keyframes)
    said.append(f"deepest overlap {1e3 * deepest:.1f} mm" if deepest > PENETRATION else "no overlap")
    return "; ".join(said)


def panel(title: str, keyframes: Sequence[Keyframe], count: int, dt: float, found: Assessment | None = None) -> Command:
    """The command that puts the panel on the page; the arguments are those of `status`, and the page's title."""
    rows = [[meaning, *(round(255 * float(part)) for part in color)] for meaning, color in legend(keyframes)]
    message = {"type": "panel", "title": title, "status": status(keyframes, count, dt, found), "legend": rows}
    return Command(Op.OBJECT, "/panel", "", pack(message))  # node under which the page keeps it; nothing is drawn there


class Timed(NamedTuple):
    """Postures (nq,) at ascending times (n,) [s], and their frames and shares; where things move, the path bends."""

    q: list[Array]
    times: Array
    frames: list[int]
    shares: list[float]

    def between(self, model: pin.Model, given: Sequence[Array]) -> list[Array]:
        """Postures (nq,) at the same times, straight between given ones, one a frame."""
        return [
            given[frame] if share == 1.0 else np.asarray(pin.interpolate(model, given[frame - 1], given[frame], share))
            for frame, share in zip(self.frames, self.shares, strict=True)
        ]


def timed(postures: Sequence[Array], paths: Sequence[Sequence[tuple[float, Array]]], dt: float) -> Timed:
    """The postures of a motion, and those on the paths between: `paths` has shares and postures a frame, or nothing."""
    if len(paths) not in (0, len(postures)):
        raise InputError(f"the motion has {len(paths)} paths and {len(postures)} postures; give as many")
    found = Timed([], np.zeros(0), [], [])
    for frame, q in enumerate(postures):
        inner = [(share, there) for share, there in paths[frame][1:-1]] if frame and len(paths) else []
        last, shares = 1.0, list[float]()
        for share, _ in reversed(inner):
            # share of a frame: postures that follow each other at once are shown this far apart
            last = min(share, last - 1e-3)
            shares.append(last)
        found.q.extend([*(there for _, there in inner), q])
        found.shares.extend([*reversed(shares), 1.0])
        found.frames.extend([frame] * (len(inner) + 1))
    times = (np.array(found.frames) - 1.0 + np.array(found.shares)) * dt
    return with_values(found, times=times)
