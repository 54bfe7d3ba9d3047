"""Contacts, penetrations and overlap of whole objects: colours, normals, witness points, and vectors of penetration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wholebody.base import checks
from wholebody.dynamics.overlaps import Overlap
from wholebody.geometry.proximity import PENETRATION
from wholebody.view import drawing
from wholebody.view.bodies import Bodies
from wholebody.view.scene_graph import Keyframe, Marker
from wholebody.view.style import LOOK
from wholebody.view.viewed_scene import ViewedContacts

_DEPTH = Marker("arrow", LOOK.depth, 1.3)


def color_contacts(keyframe: Keyframe, bodies: Bodies, contacts: ViewedContacts) -> None:
    """Give every piece in contact the colour of its state; penetration takes precedence over contact."""
    for pairs, state in (
        (contacts.pair, LOOK.contact),
        (contacts.pair[np.asarray(contacts.distance) < -PENETRATION], LOOK.penetration),
    ):
        for index in np.unique(pairs):
            bodies.paint(keyframe, int(index), state)


def mark_contacts(keyframe: Keyframe, bodies: Bodies, contacts: ViewedContacts) -> None:
    """Mark witness points and normals; for penetrations the vector that moves the figure's piece out.

    A normal starts at the first piece's witness point and points to the second piece. A penetration vector is as long
    as the depth, but at least `LOOK.shortest_depth`; the deepest ones are labelled with their depth.
    """
    # number of the nearest contacts with markers; a page with thousands of nodes is slow
    witness, touch = Marker("ball", LOOK.witness, LOOK.witness_radius), Marker("arrow", LOOK.normal, 0.8)
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
    """Overlaps of an argument of this name.

    Raises:
        InputError: they are none.
    """
    found = checks.listed(given, what, "frame.overlaps")
    return [checks.instance(one, Overlap, what, "give those of a WorldFrame") for one in found]


def mark_overlaps(keyframe: Keyframe, overlaps: Sequence[Overlap]) -> None:
    """Draw PD_g of every two objects: an arrow for each of them that may move, and its length in words.

    The arrows are as long as the moves, but at least `LOOK.shortest_depth`. Where both may move, each has a half.
    """
    for number, one in enumerate(overlaps):
        root = f"{LOOK.contact_node}/overlap {number}"
        for name, move in (("first", one.moves_first), ("second", one.moves_second)):
            length = float(np.linalg.norm(move))
            if length > 1e-9:  # m: shorter moves are none
                shown = max(length, LOOK.shortest_depth)
                place = drawing.arrow_placement(one.point, move / length, shown)
                keyframe.markers[f"{root}/{name}"] = (_DEPTH, place)
        text = f"{one.first} and {one.second}: {1e3 * float(np.linalg.norm(one.depth)):.1f} mm"
        label = Marker("label", LOOK.depth_label, LOOK.label_size, text)
        keyframe.markers[f"{root}/text"] = (label, drawing.point_placement(one.point))
