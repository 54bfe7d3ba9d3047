"""Overlap of whole objects: by which translations the two would part, drawn where they overlap most."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wholebody.dynamics.overlaps import Overlap
from wholebody.view import drawing, style
from wholebody.view.scene_graph import Keyframe, Marker

_MOVE = Marker("arrow", style.DEPTH, 1.3)
LEAST = 1e-9  # m: shorter moves are none


def mark_overlaps(keyframe: Keyframe, overlaps: Sequence[Overlap]) -> None:
    """Draw PD_g of every two objects: an arrow for each of them that may move, and its length in words.

    The arrows are as long as the moves, but at least `style.SHORTEST_DEPTH`. Where both may move, each has a half.
    """
    for number, one in enumerate(overlaps):
        root = f"{style.CONTACT_NODE}/overlap {number}"
        for name, move in (("first", one.moves_first), ("second", one.moves_second)):
            length = float(np.linalg.norm(move))
            if length > LEAST:
                shown = max(length, style.SHORTEST_DEPTH)
                place = drawing.arrow_placement(one.point, move / length, shown)
                keyframe.markers[f"{root}/{name}"] = (_MOVE, place)
        matrix = np.eye(4)
        matrix[:3, 3] = one.point
        text = f"{one.first} and {one.second}: {1e3 * float(np.linalg.norm(one.depth)):.1f} mm"
        keyframe.markers[f"{root}/text"] = (Marker("label", style.DEPTH_LABEL, style.LABEL_SIZE, text), matrix)
