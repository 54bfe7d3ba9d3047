"""Rigid parts without a figure, such as those of a `wholebody.Assembly`, in a form that the viewer shows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.base.records import with_values
from wholebody.geometry.placement import FARTHEST, PlacementLike, placement
from wholebody.geometry.shapes import Shape
from wholebody.view.style import Color
from wholebody.view.viewed_scene import Colored


class Part(NamedTuple):
    """One shape of a part, its placement in the part's frame, and its color: chosen by the viewer if left out."""

    shape: Shape
    at: PlacementLike = (0.0, 0.0, 0.0)
    color: Color | None = None


class _Nothing(NamedTuple):
    """No contacts: contacts of parts are not computed."""

    pair: NDArray[np.intp] = np.zeros((0, 2), dtype=np.intp)
    distance: Array = np.zeros(0)
    normal: Array = np.zeros((0, 3))
    point_a: Array = np.zeros((0, 3))
    point_b: Array = np.zeros((0, 3))


class Parts:
    """Free rigid parts, for `Viewer(Parts(...))`; a posture is the placements of all of them, see `posture`.

    Contacts are not computed. Raises InputError where there is no part, or one has no shape or a wrong placement.

    Example:
        >>> import wholebody as wb
        >>> parts = Parts({"board": [Part(wb.Box((0.8, 0.3, 0.02)))]})
        >>> parts.posture({"board": (0.0, 0.0, 1.0)}).shape
        (7,)
    """

    revision = 0

    def __init__(self, parts: Mapping[str, Iterable[Part]]) -> None:
        if not isinstance(parts, Mapping):
            raise InputError(
                f"Parts: parts is {checks.shown(parts)}; give shapes by name, such as {{'board': [Part(shape)]}}"
            )
        if not parts:
            raise InputError("there are no parts to show; give a mapping from names to shapes")
        self.figure = None
        self.model, self.geometry = pin.Model(), pin.GeometryModel()
        owners, objects = [], {}
        for name, shapes in parts.items():
            checks.text(name, "the name of a part")
            listed = [
                _part(entry, name) for entry in checks.listed(shapes, f"part {name!r}", "[Part(wb.Box((1, 1, 1)))]")
            ]
            if not listed:
                raise InputError(f"part {name!r} has no shape; give it one")
            joint = self.model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), name)
            for number, part in enumerate(listed):
                key = name if number == 0 else f"{name} {number + 1}"
                base = placement(part.at, f"part {name!r}")
                for count, piece in enumerate(part.shape.pieces()):
                    made = pin.GeometryObject(f"{key}:{count}", joint, 0, base * piece.placement, piece.geometry)
                    self.geometry.addGeometryObject(made)
                    owners.append(key)
                objects[key] = Colored(part.color)
        self.names = tuple(parts)
        self.piece_owner = tuple(owners)
        self.objects = MappingProxyType(objects)

    def posture(self, placements: Mapping[str, Any]) -> Array:
        """The posture (7 n,) of all parts from a placement for each name, such as `AssemblySolution.placements`.

        Raises UnknownNameError where a part has no placement, InputError where one cannot be read.
        """
        if not isinstance(placements, Mapping):
            raise InputError(
                f"placements is {checks.shown(placements)}; give a placement for each of {', '.join(self.names)}"
            )
        for name in self.names:
            if name not in placements:
                given = [key for key in placements if isinstance(key, str)]
                raise UnknownNameError("placement", name, given, "posture")
        return np.concatenate([pin.SE3ToXYZQUAT(placement(placements[name], name)) for name in self.names])

    def contacts(self, q: Array, within: float = 0.05) -> _Nothing:
        """No contacts."""
        checks.posture(q, self.model.nq)
        within = checks.number(within, "within", -FARTHEST, FARTHEST, "m")
        return _Nothing()


def _part(entry: Any, name: str) -> Part:
    """A part from an entry of a list, with its shape and color checked."""
    part = Part(*entry) if isinstance(entry, tuple) and 1 <= len(entry) <= len(Part.__match_args__) else Part(entry)
    if not isinstance(part.shape, Shape):
        raise InputError(f"part {name!r} has {checks.shown(part.shape)} for a shape; give wb.Box, wb.Sphere or another")
    return part if part.color is None else with_values(part, color=checks.color(part.color, f"part {name!r}: color"))
