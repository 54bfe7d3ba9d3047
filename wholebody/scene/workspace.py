"""What one run changes as it goes: a kinematic state, the distances at it, a sweep. No two runs share one."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import a
from wholebody.base.errors import InputError
from wholebody.base.pool import Loan
from wholebody.figures.state import State
from wholebody.geometry.contact_rows import ContactRowBuilder
from wholebody.geometry.continuous.motion_bounds import largest_approach, pair_kinds
from wholebody.geometry.continuous.passing_through import INSIDE
from wholebody.geometry.proximity import Contacts, PairTable, Proximity
from wholebody.scene.geometry_model import SceneGeometry

if TYPE_CHECKING:
    from wholebody.geometry.continuous.sweep import Sweep
    from wholebody.geometry.continuous.swept_depth import SweptDepth
    from wholebody.scene.moving_obstacles import BothSides, Collision, FrameMotion


SETS = 16  # sets of things that move for which sweeps are kept; more = more memory, 50 MB each among 5,000 things


class NotCopyable:
    """What belongs to the run that made it: to pickle or to copy it is an InputError."""

    def __reduce__(self) -> NoReturn:
        raise InputError(
            f"{a(type(self))} belongs to the run that made it and cannot be pickled or copied; make another one from "
            "its problem or scene"
        )

    def __repr__(self) -> str:
        problem = repr(getattr(self, "problem", "")).partition("\n")[0]
        return f"{type(self).__name__}({problem.strip(chr(39))})"


class Workspace(NotCopyable):
    """Room for one run on a scene; borrowed by `Scene.borrow`, or made by `Scene.workspace` for what lives on.

    A run sees things where they were at its last `begin` or `refresh`, whoever moves them meanwhile. After `begin` the
    same questions have the same answers, whatever was asked before.

    Attributes:
        model: Pinocchio's model of the figure.
        table: pieces and pairs of the scene.
        rows: builds their contact rows.
        owners: the segment or object that each piece is part of.
        state: moves from posture to posture.
        proximity: distances between the pieces.
        moved: things that moved since the last `next_frame`, with their placements before and after; those that were
            put somewhere did not move, and have where they are as both.
    """

    def __init__(self, built: SceneGeometry) -> None:
        self._built = built
        self.model: pin.Model = built.model
        self.table: PairTable = built.table
        self.rows: ContactRowBuilder = built.rows
        self.owners = built.owners
        self.state = State(built.model)
        self.moved: dict[str, tuple[pin.SE3, pin.SE3]] = {}
        self._short = -1  # a pair that did not keep its clearance, see `least_gap`
        self._inside: tuple[str, ...] = ()
        self.proximity = Proximity(built.table)
        self._sweep: Sweep | None = None
        self._depths: dict[float, SweptDepth] = {}
        self._moving: dict[tuple[str, ...], tuple[BothSides, int]] = {}  # and the number of changes that it has seen
        self._changes, self._changed_at = 0, np.zeros(len(built.owners), dtype=np.intp)  # when a piece was placed
        self._seen = built.update_placements(self.proximity, -1)

    def begin(self) -> None:
        """Forget what was asked before, and see things where they are now."""
        self.proximity.reset()
        self.refresh()
        self.moved.clear()
        self._inside, self._short = (), -1

    def refresh(self) -> None:
        """See things where they are now; `moved` has those that moved there."""
        before, self._seen = self._seen, self._built.update_placements(self.proximity, self._seen, self.moved)
        if before != self._seen:
            self._changes += 1
            self._changed_at[self._built.moved_since(before)] = self._changes

    def place(self, placements: Mapping[str, pin.SE3]) -> None:
        """See things at placements in their joints' frames; the scene keeps its own."""
        self._changes += 1
        for name, base in placements.items():
            for index, local in self._built.pieces_of[name]:
                self.proximity.place_piece(index, base * local)
                self._changed_at[index] = self._changes

    def where(self, name: str) -> pin.SE3:
        """Where this run sees a thing, in its joint's frame."""
        index, local = self._built.pieces_of[name][0]
        return self.geometry.geometryObjects[index].placement * local.inverse()

    def next_frame(self, q: Array) -> FrameMotion | None:
        """The frame of the things that moved since the last one, or are in the figure at q (nq,); None without any."""
        if not (self.moved or self._inside):
            return None
        still = [name for name, (before, after) in self.moved.items() if before == after]
        if still:
            overlapping = self.near(q, -INSIDE).pair
            inside = {self.owners[piece] for piece in overlapping.ravel().tolist()}
            for name in still:
                if name not in inside:
                    del self.moved[name]
        if not (self.moved or self._inside):
            return None
        moved = {name: (self.where(name),) * 2 for name in self._inside} | self.moved
        self.moved.clear()
        return self.frame(moved)

    def keep(self, motion: FrameMotion, collisions: Collection[Collision]) -> None:
        """Let the next frame look after the things of this one too, if it could not keep them out of the figure."""
        self._inside = tuple(motion.names) if collisions else ()

    def frame(self, moved: Mapping[str, tuple[pin.SE3, pin.SE3]]) -> FrameMotion:
        """A frame in which these things move, from one placement to another in the frame of their joint."""
        from wholebody.scene.moving_obstacles import BothSides, FrameMotion, MovingScene

        names = tuple(moved)
        both, seen = self._moving.pop(names, (None, -1))
        if both is None:
            both = BothSides(MovingScene(self._built, moved, between_things=False))
            if len(self._moving) >= SETS:
                del self._moving[next(iter(self._moving))]  # of what moved longest ago
        self._moving[names] = both, self._changes
        both.scene.refresh(self.geometry, np.flatnonzero(self._changed_at > seen).tolist())
        return FrameMotion(both, moved)

    @property
    def geometry(self) -> pin.GeometryModel:
        """The scene's geometry model, with the placements that this run sees."""
        return self.proximity.geometry

    @property
    def sweep(self) -> Sweep:
        """Continuous collision detection; made when it is first needed."""
        if self._sweep is None:
            from wholebody.geometry.continuous.sweep import Sweep

            self._sweep = Sweep(self.model, self.geometry, self.table)
        return self._sweep

    def depths(self, tolerance: float) -> SweptDepth:
        """Depths along postures, to a tolerance in metres; `start` forgets what was asked before."""
        if tolerance not in self._depths:
            from wholebody.geometry.continuous.swept_depth import SweptDepth

            self._depths[tolerance] = SweptDepth(self.table, self.geometry, tolerance)
        return self._depths[tolerance]

    def near(self, q: Array, within: float, most: Array | None = None) -> Contacts:
        """Every pair nearer than `within` metres at the posture q, shape (nq,); see `Proximity.query`."""
        return self.proximity.query(self.state.update(q).data, within, most)

    def deepest(self, q: Array) -> float:
        """Depth of the deepest overlap at the posture q, shape (nq,), metres; 0 without one."""
        return -float(self.near(q, 0.0).distance.min(initial=0.0))

    def least_gap(self, q: Array, clearances: Array, within: float) -> float:
        """The least of distances less clearances (pairs,) at q (nq,), of pairs nearer than `within`, inf without any.

        Where it is negative, it may be that of another pair that is too near: the one of the last time is asked first.
        """
        data = self.state.update(q).data
        if self._short >= 0:
            short = self.proximity.distance(data, self._short) - float(clearances[self._short])
            if short < 0.0:
                return short
        near = self.proximity.query_views(data, within)
        if not len(near.number):
            return np.inf
        gaps = near.distance - clearances[near.number]
        least = int(gaps.argmin())
        if gaps[least] < 0.0:
            self._short = int(near.number[least])
        return float(gaps[least])

    def largest_approach(self, most: Array) -> Array:
        """Most (pairs,) that distances can fall while freedoms move by at most `most` (nv,); inf of carried things."""
        centres = np.array([np.linalg.norm(piece.placement.translation) for piece in self.geometry.geometryObjects])
        for pieces in self._built.pieces_of.values():
            centres[[index for index, _ in pieces]] = np.inf
        pairs, kind = pair_kinds(self.table)
        return np.asarray(largest_approach(self.table, centres, most, pairs)[kind])

    def placements(self, q: Array) -> Array:
        """Where all pieces are at the posture q, shape (nq,); see `Contacts.placements`."""
        return self.proximity.placements(self.state.update(q).data)


def borrowed(built: SceneGeometry, begin: Callable[[Workspace], Any] = Workspace.begin) -> Loan[Workspace]:
    """A workspace of a scene for one run; it is used again when the context ends."""
    return built.pool(Workspace, lambda: Workspace(built)).borrow(begin)
