"""The part of a scene that the viewer uses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.arrays import Array
from wholebody.checks import a
from wholebody.errors import InputError
from wholebody.methods.newton.assembly import Assembly
from wholebody.view.viewed_assembly import ViewedAssembly


def checked_scene(scene: Any) -> Any:
    """Check the argument of a viewer.

    Raises:
        InputError: it is no scene; for some other types the message says how to show them.
    """
    if isinstance(scene, Assembly) and scene.has_shapes:
        return ViewedAssembly(scene)
    if isinstance(getattr(scene, "model", None), pin.Model) and callable(getattr(scene, "contacts", None)):
        return scene
    if isinstance(scene, Assembly):
        mend = "none of its bodies has a shape; give some with body(name, shape=...), or use wholebody.view.parts.Parts"
    elif hasattr(scene, "scene"):  # a problem
        mend = f"give the scene of the {type(scene).__name__}"
    else:
        mend = "make one with wb.Scene(figure)"
    raise InputError(f"Viewer: scene is {a(type(scene))}, not a Scene; {mend}")


class ViewedContacts(Protocol):
    """Near pairs of pieces; k rows each."""

    @property
    def pair(self) -> NDArray[np.intp]:
        """(k, 2) indices of the two pieces."""

    @property
    def distance(self) -> Array:
        """(k,) signed distance, metres."""

    @property
    def normal(self) -> Array:
        """(k, 3) unit vector from the first piece to the second."""

    @property
    def point_a(self) -> Array:
        """(k, 3) witness point on the first piece."""

    @property
    def point_b(self) -> Array:
        """(k, 3) witness point on the second piece."""


class ViewedScene(Protocol):
    """A figure among things, such as a `wholebody.Scene`."""

    @property
    def figure(self) -> Any:
        """The figure; only goals use its frames."""

    @property
    def model(self) -> Any:
        """Pinocchio's model of the figure."""

    @property
    def geometry(self) -> Any:
        """Pinocchio's geometry model with all pieces."""

    @property
    def objects(self) -> Mapping[str, Any]:
        """Things by name; each may have a `color`, red, green, blue, alpha."""

    @property
    def piece_owner(self) -> Sequence[str]:
        """Segment or object of each piece."""

    @property
    def revision(self) -> int:
        """A number that changes when things are added or removed."""

    def contacts(self, q: Array, within: float = ...) -> ViewedContacts:
        """Pairs nearer than `within` metres at the posture q, nearest first."""
