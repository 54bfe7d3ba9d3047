"""What the viewer shows: the part of a scene that it uses, assemblies, and scenes whose things move."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import a
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.geometry.proximity import Contacts
from wholebody.scene.geometry_model import SceneGeometry
from wholebody.scene.moving_obstacles import MovingScene
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import Workspace
from wholebody.view.style import LOOK, Color

if TYPE_CHECKING:
    from wholebody.methods.newton.assembly import Assembly


@dataclass(frozen=True)
class Colored:
    """A thing as the viewer knows it: its color, or None for the viewer's choice."""

    color: Color | None


class ViewedAssembly:
    """Bodies with shapes and things of an assembly, and its `figures`; a posture is `assembly.q` or a row of a path."""

    figure: Any = None
    revision = 0

    def __init__(self, assembly: Assembly) -> None:
        self._scene = assembly.scene
        self.model, self.geometry = self._scene.model, self._scene.geometry
        self.piece_owner = self._scene.piece_owner
        self.figures = {name: (figure, assembly.colors.get(name)) for name, figure in assembly.figures.items()}
        self.objects = MappingProxyType({name: Colored(_color(assembly, name)) for name in self.piece_owner})

    def contacts(self, q: Array, within: float = 0.05) -> Contacts:
        """Pairs nearer than `within` metres at the posture q (nq,), nearest first."""
        return self._scene.contacts(q, within)


def _color(assembly: Assembly, owner: str) -> Color | None:
    """The color of a body, a figure's segment or a thing; None for the viewer's choice."""
    if owner in assembly.scene.objects:
        return assembly.scene.objects[owner].color
    figure = owner.split("/")[0]
    if owner not in assembly.bodies and figure in assembly.figures:
        usual: Color = LOOK.figure
        return assembly.colors.get(figure, usual)
    return assembly.colors.get(owner)


def checked_scene(scene: Any) -> Any:
    """The scene that a viewer is given; raises InputError for what is none, and says how to show it."""
    if isinstance(scene, Scene):
        return scene
    from wholebody.methods.newton.assembly import Assembly

    if isinstance(scene, Assembly) and scene.has_shapes:
        return ViewedAssembly(scene)
    if isinstance(getattr(scene, "model", None), pin.Model) and callable(getattr(scene, "contacts", None)):
        return scene
    if isinstance(scene, Assembly):
        correction = "none of its bodies has a shape; give some with body(name, shape=...)"
    elif hasattr(scene, "scene"):  # a problem
        correction = f"give the scene of the {type(scene).__name__}"
    else:
        correction = "make one with wb.Scene(figure)"
    raise InputError(f"Viewer: scene is {a(type(scene))}, not a Scene; {correction}")


class ViewedWorld:
    """A figure, things that stay, and things that move, which have joints here; postures are of `configuration`."""

    revision = 0

    def __init__(self, scene: Scene, names: Iterable[str], *, between_things: bool = True) -> None:
        """Take things that move; contacts of two things are shown if `between_things`."""
        self._moving = MovingScene(scene.built, names, between_things=between_things)
        self.figure, self.objects = scene.figure, scene.objects
        self.model, self.geometry = self._moving.model, self._moving.geometry
        self.piece_owner = self._moving.owners
        self.configuration = self._moving.configuration
        owners, table = tuple(self.piece_owner), self._moving.table
        self._workspace = Workspace(SceneGeometry(self.model, self.geometry, owners, {}, table.pairs, table.swept))

    def contacts(self, q: Array, within: float = 0.05) -> Contacts:
        """Pairs nearer than `within` metres in a configuration (nq,), nearest first."""
        return self._workspace.near(np.asarray(q, dtype=float), within).nearest_first()


def place_of(scene: ViewedScene, state: State, name: str) -> pin.SE3 | None:
    """Placement of what a term is about: a frame's, or that of a piece of a thing or segment; None for another name."""
    model = scene.model
    if model.existFrame(name):
        return state.frame(model.getFrameId(name)).copy()
    for piece, owner in zip(scene.geometry.geometryObjects, scene.piece_owner, strict=True):
        if name in (owner, piece.name):
            return state.data.oMi[piece.parentJoint] * piece.placement
    return None


ViewedScene: TypeAlias = Scene | ViewedAssembly | ViewedWorld  # what the viewer shows
