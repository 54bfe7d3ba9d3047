"""A body's surface in the scene graph: sent once, then bent by the page (linear blend skinning)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.surface import Surface
from wholebody.view import commands
from wholebody.view.scene_graph import SceneGraph
from wholebody.view.style import Color


class Skinned(NamedTuple):
    """One drawn patch: its node, segment and color."""

    path: str
    segment: str
    color: Color
    whole: bool = True  # whether all of it takes the colour of a contact; on a surface the page colours a patch


class Skin:
    """A figure's surface, whose bones are found among the figure's joints; some figures lack segments of the body.

    Attributes:
        surface: of the figure.
        places: of each bone the joint that carries it, and its placement (4, 4) there.
        joints: names of the joints that carry bones.
    """

    def __init__(self, surface: Surface, figure: Any, at: Array) -> None:
        """Find the bones of a figure; `at` (4, 4) is where its world is."""
        self.surface = surface
        self.places = surface.attached(figure, at)
        self.joints = tuple(dict.fromkeys(name for name, _ in self.places))

    def build(self, graph: SceneGraph, root: str, carriers: Mapping[str, str], color: Color | None) -> list[Skinned]:
        """Put the surface at a node, moved by the nodes of its joints; in a colour, or each patch in its own."""
        bones = self.surface.bones
        graph.do(
            commands.set_skeleton(
                root,
                [carriers[joint] for joint, _ in self.places],
                np.array([offset for _, offset in self.places]),
                np.linalg.inv(np.array([bone.bind for bone in bones])),
                [(*half, *bones[half[0]].slide) for half in self.surface.halves],
            )
        )
        drawn = []
        for patch in self.surface.patches:
            shown: Color = (*patch.color, 1.0) if color is None else color
            path = f"{root}/{patch.name}"
            # metres: positions are sent as whole multiples of it, in half of the bytes
            graph.do(commands.set_skin(path, root, patch, shown, 1e-4))
            drawn.append(Skinned(path, patch.segment, shown, whole=False))
        return drawn
