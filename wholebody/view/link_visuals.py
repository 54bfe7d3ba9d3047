"""The visuals of a robot's links in the scene graph."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wholebody.figures.link_visuals import drawn_of
from wholebody.view import drawing
from wholebody.view.scene_graph import SceneGraph
from wholebody.view.skin import Skinned
from wholebody.view.style import Color


class LinkVisuals:
    """The visuals of a figure. A link with a mesh that cannot be read is left out: its pieces are drawn.

    Attributes:
        drawn: the objects.
        links, joints: names of the links that are drawn, and of the joints that carry them.
    """

    def __init__(self, figure: Any, skinned: tuple[str, ...] = ()) -> None:
        """Read the visuals, but for links whose names begin with one of `skinned`: figures that have a surface."""
        self.drawn = [one for one in drawn_of(figure) if not one.link.startswith(skinned)]
        self.links = frozenset(one.link for one in self.drawn)
        self.joints = tuple(dict.fromkeys(one.joint for one in self.drawn))

    def build(self, graph: SceneGraph, carriers: Mapping[str, str], color: Color | None) -> list[Skinned]:
        """Put the visuals below the nodes of their joints; all in one colour if there is one."""
        found = []
        for number, one in enumerate(self.drawn):
            path = f"{carriers[one.joint]}/visual {number}"
            shown = one.color if color is None else color
            if isinstance(one.shape, tuple):
                vertices, faces = one.shape
                graph.put(path, drawing.mesh(vertices, faces, path, shown))
            else:
                graph.put(path, drawing.piece(one.shape, path, shown))
            graph.place(path, one.placement)
            found.append(Skinned(path, one.link, shown))
        return found
