"""An assembly as the viewer shows it: bodies and things in their colors, contacts between them."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from wholebody.arrays import Array
from wholebody.geometry.proximity import Contacts
from wholebody.methods.newton.assembly import Assembly
from wholebody.view import style
from wholebody.view.style import Color


@dataclass(frozen=True)
class _Colored:
    color: Color | None


class ViewedAssembly:
    """The bodies and things that an assembly has now.

    A posture is `assembly.q`, `solution.q` or a row of `solution.path`. Bodies without shapes are not drawn. People are
    drawn with their surface, as in a scene.

    Attributes:
        figures: each figure by name, and the color that it was given.
    """

    figure = None
    revision = 0

    def __init__(self, assembly: Assembly) -> None:
        """Read shapes and colors."""
        self._scene = assembly.scene
        self.model, self.geometry = self._scene.model, self._scene.geometry
        self.piece_owner = self._scene.piece_owner
        self.figures = {name: (figure, assembly.colors.get(name)) for name, figure in assembly.figures.items()}
        self.objects = MappingProxyType({name: _Colored(_color(assembly, name)) for name in self.piece_owner})

    def contacts(self, q: Array, within: float = 0.05) -> Contacts:
        """Pairs nearer than `within` metres at the posture q (nq,), nearest first."""
        return self._scene.contacts(q, within)


def _color(assembly: Assembly, owner: str) -> Color | None:
    """The color of a body, a figure's segment or a thing; None for the viewer's choice."""
    if owner in assembly.scene.objects:
        return assembly.scene.objects[owner].color
    figure = owner.split("/")[0]
    if owner not in assembly.bodies and figure in assembly.figures:
        return assembly.colors.get(figure, style.FIGURE)
    return assembly.colors.get(owner)
