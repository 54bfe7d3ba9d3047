"""Many things that stand in the world: those of one form are one mesh, as each node costs milliseconds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.view import drawing
from wholebody.view.style import Color

MANY = 1000  # opaque pieces of things in the world, from which on those of one form are drawn together


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
