"""A body's surface in the scene graph: sent once, then moved by the nodes of the joints alone.

The page bends it itself (linear blend skinning): each of its bones follows the node of a joint.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.view import commands
from wholebody.view.scene_graph import SceneGraph
from wholebody.view.style import Color
from wholebody.view.surface import Surface


class Skinned(NamedTuple):
    """One drawn patch: its node, segment and color."""

    path: str
    segment: str
    color: Color


class Skin:
    """A figure's surface, whose bones are found among the figure's joints; some figures lack segments of the body."""

    def __init__(self, surface: Surface, figure: Any) -> None:
        self._surface = surface
        self._places: list[tuple[str, Array]] = []
        for bone in surface.bones:
            segment, extra = bone.segment, np.eye(4)
            if segment not in figure.segments and bone.instead is not None:
                segment, extra = bone.instead, bone.rest
            frame = figure.model.frames[figure.frame_id(segment)]
            offset = np.asarray(frame.placement.homogeneous) @ extra
            self._places.append((str(figure.model.names[frame.parentJoint]), offset))
        self.joints = tuple(dict.fromkeys(name for name, _ in self._places))

    def build(self, graph: SceneGraph, root: str, carriers: Mapping[str, str], color: Color | None) -> list[Skinned]:
        """Put the surface at a node, moved by the nodes of its joints; in a colour, or each patch in its own."""
        bones = self._surface.bones
        whole = {bone.segment: number for number, bone in enumerate(bones) if bone.parent is None}
        halves = [
            (number, whole[bone.parent], whole[bone.segment])
            for number, bone in enumerate(bones)
            if bone.parent is not None
        ]
        graph.do(
            commands.set_skeleton(
                root,
                [carriers[joint] for joint, _ in self._places],
                np.array([offset for _, offset in self._places]),
                np.linalg.inv(np.array([bone.bind for bone in bones])),
                halves,
            )
        )
        drawn = []
        for patch in self._surface.patches:
            shown: Color = (*patch.color, 1.0) if color is None else color
            path = f"{root}/{patch.name}"
            # metres: positions are sent as whole multiples of it, in half of the bytes
            graph.do(commands.set_skin(path, root, patch, shown, 1e-4))
            drawn.append(Skinned(path, patch.segment, shown))
        return drawn
