"""Distances of all pairs of a scene at a posture, by one call to coal: what judgements of postures look at.

It shares nothing with the culled distances of the methods. Every pair is asked, from coal's own first guess, so the
answer for a posture does not depend on what was asked before it.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import InputError
from wholebody.base.pool import Pool
from wholebody.figures.state import State
from wholebody.geometry.memory_views import RESULT_FIELDS, Guesses, distance_view, placement_view, read_result
from wholebody.geometry.single_pairs import KEPT, SinglePairs, pair_data
from wholebody.scene.geometry_model import SceneGeometry

NOT_A_NUMBER = "a distance is not a number; an object's placement or shape is broken"

Label = tuple[Literal["contact", "limit", "bound", "constraint"], tuple[str, ...]]


class AllPairs:
    """All pairs of a scene, at one posture after the other; on data of its own, borrowed by one judgement at a time.

    Attributes:
        state: the kinematic state of the last posture.
        distance: (pairs,) signed distance of every pair there, metres. In a scene of more than `KEPT` pairs a lower
            bound, by the balls around the pieces, of those that no question was about: they do not overlap, and are
            farther apart than the nearest pair and than what `nearer` and `ask` were asked.
        least: the least of them; inf without pairs.
    """

    def __init__(self, built: SceneGeometry) -> None:
        """Allocate."""
        self._built = built
        self.state = State(built.model)
        self._kept = len(built.table.pairs) <= KEPT
        self._results = pair_data(built.geometry, len(built.table.pairs))
        self._asked, self._rows = np.zeros(0, dtype=bool), np.zeros((0, RESULT_FIELDS))
        self._placed, self._single = np.zeros((0, 4, 3)), SinglePairs(built.geometry)
        self._guesses = Guesses(self._results)
        self._views: tuple[Array | None, Array | None] | None = None  # laid over results once they are computed
        self.distance, self.least = np.zeros(0), float("inf")

    def move(self, q: Array) -> None:
        """Measure all pairs at the posture q (nq,).

        Raises:
            InputError: q has the wrong shape or a value that is not finite, or a distance is not a number.
        """
        built, results = self._built, self._results
        self.state.update(q)
        with built.lock:  # not while a thing is moved, one piece after the other
            pin.updateGeometryPlacements(built.model, self.state.data, built.geometry, results)
        if not self._kept:
            self._bound()
            return
        self._guesses.reset()  # the judgement of a posture does not depend on the one before
        pin.computeDistances(built.geometry, results)
        if self._views is None:
            self._views = distance_view(results.distanceResults), placement_view(results.oMg)
        view = self._views[0]
        if view is not None:
            self.distance = view[:, 0].copy()
        else:
            self.distance = np.array([result.min_distance for result in results.distanceResults], dtype=float)
        self.least = float(np.minimum.reduce(self.distance, initial=np.inf))
        if np.isnan(self.least):
            raise InputError(NOT_A_NUMBER)

    def ask(self, within: Array | float) -> None:
        """Let `distance` be exact for all pairs that are nearer than `within` metres, (pairs,) or one for all.

        Raises:
            InputError: a distance is not a number.
        """
        if self._kept:
            return
        while len(number := np.flatnonzero(~self._asked & (self.distance < within))):
            number = number[:100_000]  # pairs
            self._rows[number] = self._single.measured(self._placed, self._built.table.pairs[number])
            self.distance[number], self._asked[number] = self._rows[number, 0], True
        if np.isnan(self.distance).any():
            raise InputError(NOT_A_NUMBER)

    def _bound(self) -> None:
        """Bound all distances from below, and ask for those that can be the least."""
        table, view = self._built.table, placement_view(self._results.oMg)
        oMg = self._results.oMg
        self._placed = np.array([[*at.rotation.T, at.translation] for at in oMg]) if view is None else view.copy()
        first, second = table.pairs.T
        centre = self._placed[:, 3]
        self.distance = (
            np.linalg.norm(centre[second] - centre[first], axis=1) - table.reach[first] - table.reach[second]
        )
        self._asked = np.zeros(len(first), dtype=bool)
        self._rows = np.zeros((len(first), RESULT_FIELDS))  # memory that is never written takes none
        # pairs of a scene of very many that are asked for first, to bound the least distance
        self.ask(float(np.sort(self.distance)[min(100, len(first) - 1)]))
        self.ask(max(0.0, float(self.distance[self._asked].min(initial=np.inf))))  # what overlaps is counted
        self.least = float(self.distance.min(initial=np.inf))

    def nearer(self, within: Array) -> NearPairs:
        """What there is to know of pairs nearer than `within` (pairs,), metres; it outlives the next `move`."""
        self.ask(within)
        number = (self.distance < within).nonzero()[0]
        if not len(number):
            return NearPairs(self._built, number, number.reshape(0, 2), np.zeros((0, 10)), np.zeros((0, 2, 4, 3)))
        if not self._kept:
            pair = self._built.table.pairs[number]
            return NearPairs(self._built, number, pair, self._rows[number], self._placed[pair])
        results, (near, placed) = self._results, self._views or (None, None)
        found = near[number] if near is not None else [read_result(results.distanceResults[k]) for k in number.tolist()]
        pair = self._built.table.pairs[number]
        if placed is not None:
            placement = placed[pair]
        else:
            both = [results.oMg[k] for k in pair.ravel().tolist()]
            placement = np.array([[*at.rotation.T, at.translation] for at in both], dtype=float)
        return NearPairs(self._built, number, pair, np.reshape(found, (-1, 10)), placement.reshape(-1, 2, 4, 3))


def all_pairs(built: SceneGeometry) -> Pool[AllPairs]:
    """What judgements of a scene borrow. A problem makes the first, so its first answer is judged as fast as others."""
    return built.pool(AllPairs, lambda: AllPairs(built))


class NearPairs(NamedTuple):
    """Some pairs of a scene at a posture; arrays have k rows.

    Attributes:
        built: the scene's geometry; where its pieces are now is not read.
        number: (k,) places among the geometry model's collision pairs.
        pair: (k, 2) the two pieces.
        found: (k, 10) distance, normal from the first piece to the second, nearest points of both.
        placement: (k, 2, 4, 3) where both pieces were: columns of the rotation, then the translation.
    """

    built: SceneGeometry
    number: Indices
    pair: Indices
    found: Array
    placement: Array

    def label(self, row: int) -> Label:
        """What the pair in a row is called."""
        first, second = self.pair[row].tolist()
        return "contact", (self.built.owners[first], self.built.owners[second])

    def gradients(self, state: State) -> tuple[Array, list[int]]:
        """Derivatives (n, nv) of the gaps at the corners of the patches, and the row of the pair of each (n,).

        Args:
            state: at the posture where the pairs are.
        """
        corners = [(row, *corner) for row in range(len(self.number)) for corner in self._patch(row)]
        rows = np.zeros((len(corners), state.model.nv))
        numbers = [corner[0] for corner in corners]
        if not corners:
            return rows, numbers
        normals, points = np.array([corner[1] for corner in corners]), np.array([corner[2] for corner in corners])
        wrenches = np.hstack([normals, np.cross(points, normals)])
        joints = np.array([self._joint(piece) for piece in self.pair.ravel().tolist()]).reshape(-1, 2)[numbers]
        for side, sign in ((1, 1.0), (0, -1.0)):
            for joint in set(joints[:, side].tolist()) - {0}:
                moved = joints[:, side] == joint
                jacobian = pin.getJointJacobian(state.model, state.data, joint, pin.WORLD)
                rows[moved] += sign * wrenches[moved] @ jacobian.reshape(6, -1)  # of one degree of freedom it is (6,)
        return rows, numbers

    def _joint(self, piece: int) -> int:
        return int(self.built.geometry.geometryObjects[piece].parentJoint)

    def _patch(self, row: int) -> list[tuple[Array, Array]]:
        """Normal and place of the witness point and of the corners of the contact patch."""
        normal, places = self.found[row, 1:4], [self.found[row, 4:7]]
        if np.linalg.norm(normal) < 0.5:
            return []
        first, placed_first, second, placed_second = (*self._placed(row, 0), *self._placed(row, 1))
        request, contact = coal.CollisionRequest(), coal.CollisionResult()
        # m: beyond the nearest points up to which corners of a contact patch count
        request.security_margin = float(self.found[row, 0]) + 1e-4
        coal.collide(first, placed_first, second, placed_second, request, contact)
        if contact.isCollision():
            patch = coal.ContactPatchResult()
            try:
                coal.computeContactPatch(
                    first, placed_first, second, placed_second, contact, coal.ContactPatchRequest(), patch
                )
                for number in range(patch.numContactPatches()):
                    polygon = patch.getContactPatch(number)
                    places += [np.array(polygon.getPoint(i)) for i in range(polygon.size())]
            except (RuntimeError, ValueError):
                pass  # coal has no patch for this pair of shapes; the witness point stands alone
        return [(normal, place) for place in places]

    def _placed(self, row: int, side: int) -> tuple[Any, Any]:
        piece = self.built.geometry.geometryObjects[int(self.pair[row, side])].geometry
        place = self.placement[row, side]
        return piece, coal.Transform3s(place[:3].T, place[3])
