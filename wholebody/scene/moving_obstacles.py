"""Things that move during a frame: a model of them, by what shares of a path to follow them, and what they pass.

A thing that moves is carried by a translation of its centre, 3 numbers, and a rotation about it, a quaternion of 4, as
a segment is by its joints. On `pin.interpolate` the centre goes straight with constant velocity, and the thing turns
about it with constant angular velocity, so sweeps, bounds of motions, distances and contact rows need not know what
moves. The figure goes from posture to posture of its path meanwhile.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.base.checks import known
from wholebody.base.errors import InputError
from wholebody.geometry.continuous.passing_through import OVERLAP, entered
from wholebody.geometry.continuous.sweep import FirstContact, Sweep
from wholebody.geometry.continuous.swept_depth import SweptDepth
from wholebody.geometry.large_models import add_pairs
from wholebody.geometry.proximity import Contacts, PairTable
from wholebody.scene.geometry_model import SceneGeometry

PER_THING = 7  # numbers of a thing in a configuration: where its centre is, and how it is turned, x, y, z, w


class MovingScene:
    """Model and geometry of a scene some of whose things move.

    Pieces keep their places in the geometry model, and so do the scene's own pairs; pairs of two things come last.

    Attributes:
        model: the figure's joints, then two for each thing that moves.
        geometry: the pieces of the scene; those of things that move are carried by their joints.
        names: the things that move, in the order of the configuration.
        owners: the segment or thing that each piece is part of.
        figure_nq: numbers of the figure in a configuration; they come first.
        centres: thing to its centre (3,) in its own frame, metres.
        joints: thing to the joint that carries it.
        table: pieces and pairs as arrays.
    """

    def __init__(self, built: SceneGeometry, names: Iterable[str], *, between_things: bool = True) -> None:
        """Add the joints of things that move."""
        self.built, self.names, self.owners = built, tuple(names), built.owners
        for name in self.names:
            known(name, built.pieces_of, "object")
        if len(set(self.names)) < len(self.names):
            raise InputError(f"a thing that moves is named twice in {list(self.names)}; name each once")
        self.figure_nq = built.model.nq
        self.model = built.model.copy()
        with built.lock:
            self.geometry = built.geometry.copy()
        self.centres = {name: self._centre(name) for name in self.names}
        self.joints = {name: self._add_joints(name) for name in self.names}
        self._still = {k for name, pieces in built.pieces_of.items() if name not in self.joints for k, _ in pieces}
        pairs = built.table.pairs
        if between_things:
            between = self._pairs_of_things()
            add_pairs(self.geometry, between)
            pairs = np.concatenate([pairs, between])
        self.table = PairTable(self.model, self.geometry, pairs, built.table.swept)

    def refresh(self, geometry: pin.GeometryModel | None = None, pieces: Iterable[int] | None = None) -> None:
        """Put things that stay, all or those of some pieces, to where a geometry model has them; None: the scene's."""
        given = self.built.geometry if geometry is None else geometry
        with self.built.lock:
            for index in self._still if pieces is None else self._still.intersection(pieces):
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

    def _centre(self, name: str) -> Array:
        """Of the volume of a thing; the origin of one without end."""
        total, weighted = 0.0, np.zeros(3)
        for index, local in self.built.pieces_of[name]:
            piece = self.geometry.geometryObjects[index].geometry
            volume = float(piece.computeVolume())
            if not (np.isfinite(volume) and volume > 0.0):
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

    def _pairs_of_things(self) -> Indices:
        """Pairs (k, 2) of two things in the world of which one moves."""
        pieces_of, pieces = self.built.pieces_of, self.built.geometry.geometryObjects
        in_world = [name for name, own in pieces_of.items() if pieces[own[0][0]].parentJoint == 0]
        moving = [number for number, name in enumerate(in_world) if name in self.joints]
        both = {(min(one, other), max(one, other)) for one in moving for other in range(len(in_world)) if one != other}
        pairs = [
            sorted((i, j))
            for first, second in sorted(both)
            for i, _ in pieces_of[in_world[first]]
            for j, _ in pieces_of[in_world[second]]
        ]
        return np.array(pairs, dtype=np.intp).reshape(-1, 2)


LEAST_APPROACH, LARGEST_APPROACH = 5e-4, 0.02  # m: the same at least, and at most: rows are of first order only
MOST_SHARES = 128  # of a frame; what is too fast for them comes in deeper, and is found by the sweep


class Collision(NamedTuple):
    """Two that a frame could not keep apart."""

    first: str  # name of a segment or thing
    second: str  # name of the other
    depth: float  # how deep they overlap at the end, metres; where they do not, how deep they did at most on the way
    inside: bool  # whether they overlap at the end; otherwise one went into the other and came out, or through it

    def __str__(self) -> str:
        if self.inside:
            return f"{self.first} and {self.second} overlap by {1e3 * self.depth:.1f} mm"
        return f"{self.second} passed through {self.first}, or {1e3 * self.depth:.1f} mm into it and out"


class FrameMotion:
    """How things move during one frame.

    Attributes:
        names: of the things.
        way: (n,) longest way of any point of each piece that moves by itself, metres; 0 for all others.
        still: whether nothing moves: things were put into the figure, or are still in it.
    """

    def __init__(self, both: BothSides, moved: Mapping[str, tuple[pin.SE3, pin.SE3]]) -> None:
        self._both, self._scene, self.names = both, both.scene, both.scene.names
        nothing = np.zeros(self._scene.figure_nq)
        self._start, self._end = (
            self._scene.configuration(nothing, {name: way[end] for name, way in moved.items()})[len(nothing) :]
            for end in (0, 1)
        )
        self.way = self._ways(moved)
        self._fastest = float(self.way.max(initial=0.0))
        self.still = self._fastest == 0.0

    def placements(self, share: float) -> dict[str, pin.SE3]:
        """Where each thing is after a share of the frame, in the frame of the joint that carries it."""
        at = self._at(np.zeros(self._scene.figure_nq), share)
        return {name: self._scene.placement(at, name) for name in self._scene.names}

    def next_share(self, share: float, near: Contacts, within: float) -> float:
        """The share of the frame up to which things may move before the figure's next step."""
        # Until then no pair, `near` or beyond `within` metres, overlaps by more than a part of its width.
        pairs, table = near.pair, self._both.table
        coming = self.way[pairs].sum(axis=1)
        # Share of the width of two pieces by which one may come into the other before the figure gives way. More =
        # fewer steps a frame; from a half on a figure may end on the far side.
        room = np.clip(0.25 * table.widths[near.number], LEAST_APPROACH, LARGEST_APPROACH)
        room += np.maximum(near.distance, 0.0)
        least = float((room / np.maximum(coming, 1e-12)).min(initial=np.inf))
        step = min(least, (max(within, 0.0) + LEAST_APPROACH) / max(self._fastest, 1e-12))
        return min(1.0, share + max(step, 1.0 / MOST_SHARES))

    def first_contact(self, q0: Array, q1: Array, tolerance: float) -> FirstContact | None:
        """First contact while the figure goes from q0 to q1 (nq,); see `Sweep.first_contact`."""
        return self._both.sweep.first_contact(self._at(q0, 0.0), self._at(q1, 1.0), tolerance=tolerance)

    def collisions(self, path: Sequence[tuple[float, Array]]) -> tuple[Collision, ...]:
        """What was not avoided on a path of shares of the frame and postures, the deepest first; none if free."""
        along = [self._at(q, share) for share, q in path]
        found = entered(self._both.sweep, self._both.depths, along, self._both.moves)
        owners, pairs = self._scene.owners, self._both.table.pairs
        deepest: dict[tuple[str, str], Collision] = {}
        for one in found:
            first, second = (owners[piece] for piece in pairs[one.number])
            known = deepest.get((first, second))
            if known is None or (one.inside, one.depth) > (known.inside, known.depth):
                deepest[first, second] = Collision(first, second, one.depth, one.inside)
        return tuple(sorted(deepest.values(), key=lambda one: (not one.inside, -one.depth)))

    def _at(self, q: Array, share: float) -> Array:
        """The configuration of figure and things after a share of the frame."""
        scene = self._scene
        if share in (0.0, 1.0):
            return np.concatenate([q, self._start if share == 0.0 else self._end])
        ends = (np.concatenate([self._both.rest, end]) for end in (self._start, self._end))
        at = pin.interpolate(scene.model, *ends, share)
        return np.concatenate([q, at[scene.figure_nq :]])

    def _ways(self, moved: Mapping[str, tuple[pin.SE3, pin.SE3]]) -> Array:
        way = np.zeros(len(self._scene.owners))
        for name, (start, end) in moved.items():
            centre = self._scene.centres[name]
            gone = float(np.linalg.norm(end.act(centre) - start.act(centre)))
            turn = float(np.linalg.norm(pin.log3(start.rotation.T @ end.rotation)))
            for index, local in self._scene.built.pieces_of[name]:
                lever = float(np.linalg.norm(local.translation - centre)) + self._both.table.reach[index]
                way[index] = gone + (turn * lever if turn > 0.0 else 0.0)
        return way


class BothSides:
    """A moving scene with its sweeps: sweeps of both sides are made for each set of things that move, and kept."""

    def __init__(self, scene: MovingScene) -> None:
        self.scene = scene
        self.table = scene.table
        self.sweep = Sweep(scene.model, scene.geometry, self.table)
        self.depths = SweptDepth(self.table, scene.geometry, OVERLAP)
        self.rest = pin.neutral(scene.built.model)
        owners = np.array([owner in scene.joints for owner in scene.owners], dtype=bool)
        self.moves: Mask = np.asarray(owners[self.table.pairs].any(axis=1))
