"""Contacts, penetrations, overlap of whole objects, and what was in the way of a pose: colours and markers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.figures.state import State
from wholebody.geometry.proximity import PENETRATION
from wholebody.view import drawing
from wholebody.view.bodies import Bodies
from wholebody.view.scene_graph import Keyframe, Marker
from wholebody.view.style import LOOK
from wholebody.view.viewed_scene import ViewedScene

if TYPE_CHECKING:
    from wholebody.tracking.overlaps import Overlap

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
        frame = blocker.frame
        if frame is None:
            return None
        frame_id = scene.model.getFrameId(frame)
        joint = scene.model.frames[frame_id].parentJoint
        return np.array(state.data.oMi[joint].act(scene.model.frames[frame_id].placement.translation))
    return np.array(state.data.oMi[scene.model.getJointId(blocker.names[0])].translation)
