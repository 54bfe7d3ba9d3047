"""A scene whose things move, as the viewer shows it: postures have the placements of the things too."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from wholebody.arrays import Array
from wholebody.geometry.proximity import Contacts
from wholebody.moving_scene import MovingScene
from wholebody.scene import Scene
from wholebody.scene_geometry import SceneGeometry
from wholebody.workspace import Workspace


class ViewedWorld:
    """A figure, the things that stay, and things that move.

    A posture is what `configuration` makes of one of the figure's and the placements of the things that move. So
    `Viewer(ViewedWorld(scene, names)).play(configurations, dt)` shows all of them move.
    """

    revision = 0

    def __init__(self, scene: Scene, names: Iterable[str]) -> None:
        """Give joints to the things that move.

        Raises:
            UnknownNameError: there is no such thing.
        """
        self._moving = MovingScene(scene.built, names)
        self.figure, self.objects = scene.figure, scene.objects
        self.model, self.geometry = self._moving.model, self._moving.geometry
        self.piece_owner = self._moving.owners
        self.configuration = self._moving.configuration
        self._workspace = Workspace(SceneGeometry(self.model, self.geometry, tuple(self.piece_owner), {}))

    def contacts(self, q: Array, within: float = 0.05) -> Contacts:
        """Pairs nearer than `within` metres in a configuration (nq,), nearest first."""
        return self._workspace.near(np.asarray(q, dtype=float), within).nearest_first()
