"""Markers beside the figure: goals and their errors; contacts, and the arrows of penetrations."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from wholebody.assessment.posture import distance_and_angle
from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.checks import a
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.geometry.placement import placement
from wholebody.geometry.proximity import PENETRATION
from wholebody.tasks.frame import PlacementResidual
from wholebody.view import drawing
from wholebody.view.bodies import Bodies
from wholebody.view.scene_graph import Keyframe, Marker
from wholebody.view.style import LOOK
from wholebody.view.viewed_scene import ViewedScene, place_of

if TYPE_CHECKING:
    from wholebody.tracking.overlaps import Overlap

FARTHEST_LOOK = 1.0
"""Metres: what an axis is turned to is not drawn, and not kept in the picture, if it is farther from the frame."""


class Goals:
    """The resolved goals of a `wholebody.Problem`, drawn at any posture; raises InputError for what is no problem."""

    def __init__(self, scene: ViewedScene, problem: Any) -> None:
        self.scene = scene
        goals = getattr(problem, "goals", None)
        if not isinstance(goals, (tuple, list)):
            raise InputError(f"problem is {a(type(problem))}, not a Problem; state one with wb.Problem(scene)")
        self.goals = goals

    def mark(self, keyframe: Keyframe, state: State) -> None:
        """Mark each goal that has a position: target, line to it, axes of an orientation goal, the error."""
        for number, goal in enumerate(self.goals):
            root = f"{LOOK.goal_node}/{number}"
            here = self._here(goal, state)
            target, directed = _target(goal, here, state, self.scene)
            if here is None or target is None:
                continue
            if not _far(goal, here) and (
                np.linalg.norm(target.translation - here.translation) > 1e-9 or not (directed or hasattr(goal, "axis"))
            ):
                ball = Marker("ball", LOOK.target, LOOK.target_radius)
                keyframe.markers[f"{root}/target"] = (ball, drawing.point_placement(target.translation))
            line = drawing.rod_placement(here.translation, target.translation, LOOK.line_radius)
            if line is not None:
                keyframe.markers[f"{root}/line"] = (Marker("rod", LOOK.target), line)
            if directed:
                mark_axes(keyframe, f"{root}/axes", target, LOOK.axes_length)
                mark_axes(keyframe, f"{root}/frame", here, LOOK.axes_length / 2)
            self._point(keyframe, root, goal, here)
            text = f"{getattr(goal, 'frame', 'centre of mass')}  {left(goal, state)}"
            label = Marker("label", LOOK.goal_label, LOOK.label_size, text)
            at = target.translation
            if getattr(goal, "toward", at) is None:  # beside the tip of the arrow, as a label hides what it is at
                at = at + _arrow() * _wanted(goal, here) / np.linalg.norm(_wanted(goal, here))
            keyframe.markers[f"{root}/text"] = (label, drawing.point_placement(at))

    def targets(self, state: State) -> Array:
        """Positions (n, 3) that should be in the picture; with those between it and a distant gaze target."""
        found = [np.zeros((0, 3))]
        for goal in self.goals:
            target, _ = _target(goal, self._here(goal, state), state, self.scene)
            if target is not None:
                found.append(target.translation[None])
        return np.concatenate(found)

    def _here(self, goal: Any, state: State) -> pin.SE3 | None:
        """Placement of the goal's frame; None for a goal without a position."""
        name = getattr(goal, "frame", None)
        if isinstance(name, str):
            here = place_of(self.scene, state, name)
            if here is not None:
                here.translation = here.act(np.asarray(getattr(goal, "offset", (0.0, 0.0, 0.0)), dtype=float))
            return here
        if hasattr(goal, "axes") and hasattr(goal, "target"):
            return pin.SE3(np.eye(3), state.center_of_mass())
        return None

    def _point(self, keyframe: Keyframe, root: str, goal: Any, here: pin.SE3) -> None:
        """The axis of a goal, and its target direction."""
        axis = getattr(goal, "axis", None)
        if axis is None:
            return
        now = here.rotation @ np.asarray(axis, dtype=float)
        wanted = _wanted(goal, here)
        blue, green = LOOK.axes[2], LOOK.target
        for name, color, way in (("is", blue, now), ("wanted", green, wanted)):
            place = drawing.arrow_placement(here.translation, way / np.linalg.norm(way), _arrow())
            keyframe.markers[f"{root}/{name}"] = (Marker("arrow", color, 0.35, symbol=True), place)


def _arrow() -> float:
    """Length of an arrow along an axis, metres."""
    return float(2.5 * LOOK.axes_length)


def _wanted(goal: Any, here: pin.SE3) -> Array:
    if goal.direction is not None:
        return np.asarray(goal.direction, dtype=float)
    return np.asarray(np.asarray(goal.toward, dtype=float) - here.translation)


def _far(goal: Any, here: pin.SE3) -> bool:
    """Whether a goal turns an axis to a place that is too far to be drawn."""
    toward = getattr(goal, "toward", None) if hasattr(goal, "axis") else None
    return toward is not None and bool(np.linalg.norm(_wanted(goal, here)) > FARTHEST_LOOK)


def _target(goal: Any, here: pin.SE3 | None, state: State, scene: ViewedScene) -> tuple[pin.SE3 | None, bool]:
    """Target placement of the goal's frame, and whether the goal includes the orientation."""
    if here is None:
        return None, False
    target = getattr(goal, "target", None)
    if hasattr(goal, "axis"):
        way = np.zeros(3) if goal.toward is None else _wanted(goal, here)
        if _far(goal, here):
            way *= FARTHEST_LOOK / np.linalg.norm(way)
        return pin.SE3(np.eye(3), here.translation + way), False
    asked = getattr(goal, "residual", None)
    if isinstance(asked, PlacementResidual):
        wanted = pin.SE3(state.frame(asked.base.frame) * asked.placement)
        wanted.translation = wanted.translation if asked.position else here.translation
        return wanted, asked.orientation
    if target is None or isinstance(target, str):
        return None, False
    if getattr(goal, "axes", "") == "xy":
        return pin.SE3(np.eye(3), np.array([target[0], target[1], 0.0])), False
    try:
        return placement(target), isinstance(target, pin.SE3) or np.shape(target) != (3,)
    except InputError:
        return None, False


def left(goal: Any, state: State) -> str:
    """Remaining error of a goal in words: "3.2 mm", "1.5°", or both."""
    distance, angle = distance_and_angle(goal, state)
    parts = [] if distance is None else [f"{1000 * distance:.1f} mm"]
    return "  ".join(parts if angle is None else [*parts, f"{np.degrees(angle):.1f}°"])


def mark_axes(keyframe: Keyframe, path: str, place: pin.SE3, length: float) -> None:
    """Draw the three axes of a placement in the world, `length` metres long."""
    for name, color, direction in zip("xyz", LOOK.axes, place.rotation.T, strict=True):
        arrow = drawing.arrow_placement(place.translation, direction, length)
        keyframe.markers[f"{path}/{name}"] = (Marker("arrow", color, 0.7), arrow)


def mark_frames(keyframe: Keyframe, scene: ViewedScene, state: State, names: Iterable[str], length: float) -> None:
    """Draw the axes of named frames of the figure, each with its name, `length` metres long."""
    for name in names:
        place = state.frame(scene.figure.frame_id(name))
        mark_axes(keyframe, f"{LOOK.frame_node}/{name}", place, length)
        label = Marker("label", LOOK.label, LOOK.label_size, name)
        keyframe.markers[f"{LOOK.frame_node}/{name}/name"] = (label, drawing.point_placement(place.translation))


_DEPTH, _GLOBAL = Marker("arrow", LOOK.depth, 1.3), Marker("arrow", LOOK.global_depth, 1.3)


def color_contacts(keyframe: Keyframe, bodies: Bodies, contacts: Any) -> None:
    """Give every piece in contact the colour of its state; penetration takes precedence over contact."""
    for pairs, state in (
        (contacts.pair, LOOK.contact),
        (contacts.pair[np.asarray(contacts.distance) < -PENETRATION], LOOK.penetration),
    ):
        for index in np.unique(pairs):
            bodies.paint(keyframe, int(index), state)


def mark_contacts(keyframe: Keyframe, bodies: Bodies, contacts: Any) -> None:
    """Mark witness points and normals, penetrations by vectors of at least `LOOK.shortest_depth`, labelled."""
    # number of the nearest contacts with markers; a page with thousands of nodes is slow
    witness, touch = Marker("ball", LOOK.witness, LOOK.witness_radius), Marker("arrow", LOOK.normal, 0.8, symbol=True)
    for row in range(min(len(contacts.distance), 60)):
        root = f"{LOOK.contact_node}/{row}"
        distance, normal = float(contacts.distance[row]), np.asarray(contacts.normal[row])
        start, end = np.asarray(contacts.point_a[row]), np.asarray(contacts.point_b[row])
        for name, point in (("a", start), ("b", end)):
            keyframe.markers[f"{root}/{name}"] = (witness, drawing.point_placement(point))
        if distance >= -PENETRATION:
            place = drawing.arrow_placement(start, normal, LOOK.normal_length)
            keyframe.markers[f"{root}/normal"] = (touch, place)
            continue
        first, second = (bodies.all[int(index)] for index in contacts.pair[row])
        out, origin = -normal, start
        if first.joint == 0 or (first.thing is not None and second.thing is None):
            out, origin = normal, end
        length = max(-distance, LOOK.shortest_depth)
        keyframe.markers[f"{root}/depth"] = (_DEPTH, drawing.arrow_placement(origin, out, length))
        if row < 3:  # number of the deepest penetrations that are labelled with their depth
            text = Marker("label", LOOK.depth_label, LOOK.label_size, f"{-1000 * distance:.1f} mm")
            keyframe.markers[f"{root}/text"] = (text, drawing.point_placement(origin + out * length))


def checked_overlaps(given: object, what: str) -> list[Overlap]:
    """Overlaps of an argument of this name; raises InputError where they are none."""
    found = checks.listed(given, what, "frame.overlaps")
    if not found:  # most pictures have none, and need nothing of a world
        return []
    from wholebody.tracking.overlaps import Overlap

    return [checks.instance(one, Overlap, what, "give those of a WorldFrame") for one in found]


def mark_overlaps(keyframe: Keyframe, bodies: Bodies, data: Any, overlaps: Sequence[Overlap]) -> None:
    """Draw PD_g of every two objects, and its length in words.

    An arrow for each that gives way begins where both pieces end; dashes lead there from where the two overlap
    most. Where both give way, each arrow has half of PD_g, but at least `LOOK.shortest_depth`. A ball is drawn where
    PD_g is much shorter than the deepest overlap, since the normals of several pairs cancel. The words stand at the
    end of an upward arrow, where they hide none. `data` is Pinocchio's, at the posture.
    """
    for number, one in enumerate(overlaps):
        root, depth = f"{LOOK.contact_node}/overlap {number}", float(np.linalg.norm(one.depth))
        moves = (one.moves_first, one.moves_second)
        # a PD_g much shorter than the deepest overlap has no use as a direction
        cancelled, end = depth < 0.1 * one.deepest and one.pairs > 1, one.point
        for name, move in zip(("first", "second"), moves, strict=True):
            length = float(np.linalg.norm(move))
            if length < 1e-9 or cancelled:  # m: shorter moves are none
                continue
            way = move / length
            start = one.point + bodies.beyond(data, one.pieces, one.point, way) * way
            place = drawing.arrow_placement(start, way, max(length, LOOK.shortest_depth))
            keyframe.markers[f"{root}/{name}"] = (_GLOBAL, place)
            end = max(end, start + place[:3, 2], key=lambda at: float(at[2]))  # words stand above of where they belong
            line = drawing.rod_placement(one.point, start, LOOK.line_radius)
            if line is not None:
                keyframe.markers[f"{root}/{name} inside"] = (Marker("dashes", LOOK.global_depth), line)
        free = [name for name, move in zip((one.first, one.second), moves, strict=True) if np.any(move)]
        taken = "half each" if len(free) > 1 else "".join(f"by {name}" for name in free)
        both = f"PD_g of {one.first} and {one.second}"
        text = f"{both}: {1e3 * depth:.1f} mm {taken}".rstrip()
        if cancelled:
            ball = Marker("ball", LOOK.global_depth, LOOK.blocker_radius)
            keyframe.markers[f"{root}/cancelled"] = (ball, drawing.point_placement(one.point))
            text = f"{both} cancels; {1e3 * one.deepest:.1f} mm deep"
        label = Marker("label", LOOK.global_depth_label, LOOK.label_size, text)
        keyframe.markers[f"{root}/text"] = (label, drawing.point_placement(end))


def mark_blockers(keyframe: Keyframe, scene: ViewedScene, state: State, contacts: Any, blockers: Sequence[Any]) -> None:
    """Mark each of the strongest blockers, strongest first, by a ball and its name, among near pairs `contacts`."""
    # most blockers that are marked, the strongest; more labels hide each other
    for number, blocker in enumerate(blockers[:4]):
        place = _place(scene, state, contacts, blocker)
        if place is None:
            continue
        root = f"{LOOK.blocker_node}/{number}"
        keyframe.markers[f"{root}/ball"] = (
            Marker("ball", LOOK.blocker, LOOK.blocker_radius),
            drawing.point_placement(place),
        )
        label = Marker("label", LOOK.blocker_label, LOOK.label_size, f"in the way: {blocker}")
        above = drawing.point_placement(place + [0.0, 0.0, 2.0 * LOOK.blocker_radius])
        keyframe.markers[f"{root}/text"] = (label, above)


def _place(scene: ViewedScene, state: State, contacts: Any, blocker: Any) -> Array | None:
    """Position of a blocker (3,), or None for one without a position, such as a balance."""
    if blocker.kind == "contact":
        owners = scene.piece_owner
        for row, (a, b) in enumerate(np.asarray(contacts.pair)):
            if {owners[a], owners[b]} == set(blocker.names):
                return np.asarray(0.5 * (contacts.point_a[row] + contacts.point_b[row]))
        return None
    if blocker.kind == "constraint":
        place = place_of(scene, state, blocker.frame or "")
        return None if place is None else np.array(place.translation)
    return np.array(state.data.oMi[scene.model.getJointId(blocker.names[0])].translation)
