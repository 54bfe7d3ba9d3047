"""A scene: one figure, the things that it carries, the things around it, and the pairs that can touch."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.geometry.broad_phase import near_among
from wholebody.geometry.placement import FARTHEST
from wholebody.geometry.placement import placement as to_placement
from wholebody.geometry.proximity import Contacts
from wholebody.scene.contents import SceneContents
from wholebody.scene.workspace import Workspace, borrowed

if TYPE_CHECKING:
    from wholebody.geometry.continuous.sweep import FirstContact
    from wholebody.geometry.penetration import ObjectPenetration


class Scene(SceneContents):
    """A figure among things.

    Threads may share a scene: every query and every solve has a workspace of its own, and uses the placements that the
    things had when it began. A solve during which objects are added or removed ends with an `InputError`.

    A scene can be pickled. A copy of it, `copy.copy` or `copy.deepcopy`, has things of its own.

    Raises:
        InputError: no figure, or figures of one name.

    Examples:
        >>> kitchen = wb.Scene(human).add(wb.HalfSpace(), name="floor")
        >>> kitchen.add(wb.Box((0.6, 1.2, 0.04)), name="table", at=(0.6, 0.0, 0.74)).penetration(standing)
        []
    """

    def borrow(self) -> AbstractContextManager[Workspace]:
        """Borrow a workspace for one run: ``with scene.borrow() as workspace``. Do not use it after the context."""
        return borrowed(self.built)

    def workspace(self) -> Workspace:
        """A new workspace for a long-lived object, such as a tracker, which alone uses it."""
        return Workspace(self.built)

    def state(self, q: Array) -> State:
        """A new kinematic state at q, shape (nq,). `State.update` moves it to another posture far faster."""
        return State(self.model).update(q)

    def contacts(self, q: Array, within: float = 0.05) -> Contacts:
        """Every pair of the scene nearer than `within` metres at the posture q, shape (nq,), nearest first.

        These are the pairs that a posture changes, `pair_table.pairs`; see `overlapping` for those of things too. Their
        field `pair` has indices of pieces: `piece_owner[i]` is the segment or object of piece i.

        Raises:
            InputError: q has the wrong shape or is not finite, or `within` is not a finite number.
        """
        within = checks.number(within, "within", -FARTHEST, FARTHEST, "m")
        self._warn_of_angles(q, "contacts: q")
        with self.borrow() as workspace:
            return workspace.near(q, within).nearest_first()

    def penetration(self, q: Array) -> list[ObjectPenetration]:
        """Depth of overlap of owners (segments, objects) at q (nq,): PD_g and the deepest pair.

        The deepest first; empty if nothing overlaps. The pairs are those of `overlapping`.
        """
        from wholebody.geometry.penetration import object_penetrations

        self._warn_of_angles(q, "penetration: q")
        with self.borrow() as workspace:
            return object_penetrations(self.overlapping(q, workspace), workspace.owners)

    def overlapping(self, q: Array, workspace: Workspace | None = None) -> Contacts:
        """Every pair of pieces that overlap at the posture q, shape (nq,), the deepest first.

        Beside the pairs of the scene these are pairs of two things in the world, and of a thing and a part of the
        figure that cannot move. Left out are two half-spaces, which have no end, and things that a joint of their
        `wb.Body` holds together, which do not collide. `number` is -1 for pairs that the scene does not have. The
        placements are those of a workspace of the scene, or its present ones.
        """
        if workspace is None:
            self._warn_of_angles(q, "overlapping: q")
            with self.borrow() as borrowed_one:
                return self.overlapping(q, borrowed_one)
        near = workspace.near(q, 0.0)
        pieces, group = self.built.standing
        standing = near_among(self.built.table, near.placements, pieces, group, 0.0, self._held())
        return near.joined(standing).nearest_first()

    def _warn_of_angles(self, q: Array, what: str) -> None:
        self.figure.warn_of_angles(checks.posture(q, self.model.nq), what)

    def _held(self) -> list[tuple[int, int]]:
        """Pairs of things that joints hold together, as numbers of `SceneGeometry.standing`."""
        number = self.built.number_of
        return [
            (min(number[name], number[joint.to]), max(number[name], number[joint.to]))
            for name, thing in self.objects.items()
            if thing.body is not None
            for joint in thing.body.joints
            if joint.to in number
        ]

    def sweep(
        self, q0: Array, q1: Array, tolerance: float = 1e-4, *, moves: Mapping[str, tuple[Any, Any]] | None = None
    ) -> FirstContact | None:
        """First contact of the motion from q0 to q1, both (nq,), along pin.interpolate; None if there is none.

        The test is continuous and finds objects of any thickness.

        Args:
            q0: start of the motion.
            q1: its end.
            tolerance: depth up to which an overlap is no contact, metres, at least 1e-5.
            moves: thing to its placements at the start and at the end, as for `add`, if it moves at the same time: its
                centre straight, and turning about it. All others stay where they are. Things that meet each other are
                not looked at.

        Raises:
            InputError: postures of the wrong shape, not finite or with a quaternion that is not of unit length; a
                tolerance that is too small; placements that cannot be read.
            UnknownNameError: `moves` names no object.
        """
        nq = self.model.nq
        begin, end = checks.posture(q0, nq, "q0"), checks.posture(q1, nq, "q1")
        self.figure.warn_of_angles(np.array([begin, end]), "sweep")
        tolerance = checks.number(tolerance, "tolerance", 1e-5, FARTHEST, "m")
        with self.borrow() as workspace:
            if moves is None:
                return workspace.sweep.first_contact(begin, end, tolerance=tolerance)
            checks.instance(moves, Mapping, "sweep: moves", "give {name: (placement at the start, at the end)}")
            frame = workspace.frame({name: self._way(name, way) for name, way in moves.items()})
            found = frame.first_contact(begin, end, tolerance)
            return None if found is None else replace(found, q=found.q[:nq])

    def _way(self, name: str, way: tuple[Any, Any]) -> tuple[pin.SE3, pin.SE3]:
        thing = self._object(name)
        if not isinstance(way, (tuple, list)) or len(way) != 2:
            raise InputError(f"moves: {name!r} has {checks.shown(way)}; give two placements, at the start and the end")
        start = to_placement(way[0], f"moves: {name!r} at the start")
        end = to_placement(way[1], f"moves: {name!r} at the end")
        if thing.segment is None:
            return start, end
        base = self.figure.place_of(thing.segment).placement
        return base * start, base * end
