"""A scene whose things move: each thing that moves gets joints, so that it is treated as a segment is.

A thing that moves is carried by a translation of its centre, 3 numbers, and a rotation about it, a quaternion of 4. On
`pin.interpolate` the centre goes straight with constant velocity, and the thing turns about it with constant angular
velocity. Sweeps, bounds of motions, distances and contact rows then need not know what moves: both sides are joints.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.checks import known, numbers
from wholebody.base.errors import InputError
from wholebody.geometry.large_models import add_pairs, pairs_of
from wholebody.scene.geometry_model import SceneGeometry

PER_THING = 7
"""Numbers of a thing in a configuration: where its centre is, and how it is turned, x, y, z, w."""


class MovingScene:
    """Model and geometry of a scene some of whose things move.

    Pieces keep their places in the geometry model, and so do the scene's own pairs; pairs of two things come last.

    Attributes:
        model: the figure's joints, then two for each thing that moves.
        geometry: the pieces of the scene; those of things that move are carried by their joints.
        names: the things that move, in the order of the configuration.
        owners: the segment or thing that each piece is part of.
        figure_nq: numbers of the figure in a configuration; they come first.
        scene_pairs: number of pairs that the scene has itself; those after them are pairs of two things.
        centres: thing to its centre (3,) in its own frame, metres.
        joints: thing to the joint that carries it.
    """

    def __init__(
        self,
        built: SceneGeometry,
        names: Iterable[str],
        *,
        centres: Mapping[str, Array] | None = None,
        between_things: bool = True,
    ) -> None:
        """Add the joints of things that move, about `centres` (3,), by default of their volume."""
        self.built, self.names, self.owners = built, tuple(names), built.owners
        for name in self.names:
            known(name, built.pieces_of, "object")
        if len(set(self.names)) < len(self.names):
            raise InputError(f"a thing that moves is named twice in {list(self.names)}; name each once")
        self.figure_nq = built.model.nq
        self.model = built.model.copy()
        with built.lock:
            self.geometry = built.geometry.copy()
        self.scene_pairs = len(self.geometry.collisionPairs)
        self.centres = {name: self._centre(name, centres or {}) for name in self.names}
        self.joints = {name: self._add_joints(name) for name in self.names}
        self._still = [
            (index, name) for name in built.pieces_of if name not in self.joints for index, _ in built.pieces_of[name]
        ]
        if between_things:
            self._add_pairs()

    def refresh(self, geometry: pin.GeometryModel | None = None) -> None:
        """Put the things that stay to where a geometry model has them, by default the scene's."""
        given = self.built.geometry if geometry is None else geometry
        with self.built.lock:
            for index, _ in self._still:
                self.geometry.geometryObjects[index].placement = given.geometryObjects[index].placement

    def configuration(self, q: Array, placements: Mapping[str, pin.SE3]) -> Array:
        """The configuration (nq,) of a posture (figure_nq,) and placements, in the world or a carried thing's joint."""
        parts = [np.asarray(q, dtype=float)]
        for name in self.names:
            place = placements[name]
            parts += [place.act(self.centres[name]), pin.Quaternion(place.rotation).coeffs()]
        return np.concatenate(parts)

    def placement(self, configuration: Array, name: str) -> pin.SE3:
        """Where a thing is in a configuration (nq,), as in `configuration`."""
        first = self.figure_nq + PER_THING * self.names.index(name)
        rotation = pin.Quaternion(configuration[first + 3 : first + PER_THING]).toRotationMatrix()
        return pin.SE3(rotation, configuration[first : first + 3] - rotation @ self.centres[name])

    @property
    def pairs(self) -> Indices:
        """(pairs, 2) the pieces of each pair, the scene's own first."""
        return pairs_of(self.geometry)

    def _centre(self, name: str, given: Mapping[str, Array]) -> Array:
        if name in given:
            return numbers(given[name], (3,), f"{name!r}: centre")
        total, weighted = 0.0, np.zeros(3)
        for index, local in self.built.pieces_of[name]:
            piece = self.geometry.geometryObjects[index].geometry
            volume = float(piece.computeVolume())
            if not (np.isfinite(volume) and volume > 0.0):  # a half-space
                return np.zeros(3)
            total += volume
            weighted += volume * local.act(np.asarray(piece.computeCOM()))
        return np.asarray(weighted / total)

    def _add_joints(self, name: str) -> int:
        pieces = self.built.pieces_of[name]
        parent = self.geometry.geometryObjects[pieces[0][0]].parentJoint
        along = self.model.addJoint(parent, pin.JointModelTranslation(), pin.SE3.Identity(), f"{name}: centre")
        about = self.model.addJoint(along, pin.JointModelSpherical(), pin.SE3.Identity(), f"{name}: rotation")
        to_centre = pin.SE3(np.eye(3), -self.centres[name])
        for index, local in pieces:
            piece = self.geometry.geometryObjects[index]
            piece.parentJoint, piece.placement = about, to_centre * local
        return int(about)

    def _add_pairs(self) -> None:
        in_world = [
            name for name, pieces in self.built.pieces_of.items()
            if self.built.geometry.geometryObjects[pieces[0][0]].parentJoint == 0
        ]  # fmt: skip
        pairs = [
            sorted((i, j))
            for number, first in enumerate(in_world)
            for second in in_world[number + 1 :]
            if first in self.joints or second in self.joints
            for i, _ in self.built.pieces_of[first]
            for j, _ in self.built.pieces_of[second]
        ]
        add_pairs(self.geometry, np.array(pairs, dtype=np.intp).reshape(-1, 2))
