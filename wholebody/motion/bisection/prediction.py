"""Posture prediction for one frame of a clip: least effort from the original posture, without penetration."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.figures.figure import Figure
from wholebody.figures.state import State, root_freedoms
from wholebody.methods.base import Method
from wholebody.motion.avoider import Run
from wholebody.motion.faults import DEPTH, depth
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks import Effort, Freeze, Hold, Plane
from wholebody.tasks.base import Goal, filled
from wholebody.tasks.distance import DistanceMeasure, SquaredDistance


def path_planes(figure: Figure, q: Array, frame: int, joints: Sequence[str], state: State) -> list[Plane]:
    """Planes through the places of joints at a frame of q (n, nq), normal to their paths there (eqs. 3.2 and 3.3)."""
    if len(q) < 2:
        return []
    numbers = [figure.frame_id(joint) for joint in joints]
    here, there = (frame, frame + 1) if frame + 1 < len(q) else (frame - 1, frame)
    places = []
    for which in (here, there):
        state.update(q[which])
        places.append([np.array(state.frame(number).translation) for number in numbers])
    planes = []
    for joint, start, end, at in zip(joints, *places, places[frame - here], strict=True):
        if np.linalg.norm(end - start) > 1e-4:  # m: a shorter way has no direction, as trackers are less exact
            planes.append(Plane(joint, end - start, point=at))
    return planes


ROOT_WEIGHT = 100.0  # of the root in the effort [1/m^2, 1/rad^2]: as the spine's, since moving it moves the whole body


class RootEffort(DistanceMeasure):
    """Squared displacement of the root from the start, which `Effort` leaves out."""

    def resolve(self, scene: Scene, start: Array) -> RootEffort:
        """Store the start."""
        weights = np.where(root_freedoms(scene.model), ROOT_WEIGHT, 0.0)
        return filled(self, distance=SquaredDistance.build(start, weights))


class Prediction(NamedTuple):
    """A posture (nq,) that was predicted, and whether nothing overlaps in it and everything that is held holds."""

    q: Array
    good: bool


class Predictor:
    """Posture prediction in the frames of one clip."""

    def __init__(self, run: Run, method: Method, room: float) -> None:
        """Take original postures, what solves for postures, and the least distance of what overlapped, metres."""
        self.run, self._method, self._room = run, method, room
        figure = run.scene.figure
        freezes = [term for term in run.terms.given if isinstance(term, Freeze)]
        frozen = {name for term in freezes for name in figure.joint_names(term.joints)}
        moves = not set(figure.roots) <= frozen
        self._weights = np.where(root_freedoms(figure.model), ROOT_WEIGHT, figure.effort_weights)
        self._measures = (Effort(), RootEffort()) if moves else (Effort(),)

    def predict(self, frame: int, start: Array, planes: Sequence[Plane], most: int | None = None) -> Prediction:
        """Predict the posture of a frame, from a start (nq,), within further planes, by `most` iterations."""
        # Holds refer to the original posture of the frame, and the effort too.
        scene, terms = self.run.scene, self.run.terms
        asked = terms.asked(frame)
        goals = [term for term in asked if isinstance(term, Goal)]
        others = [term for term in asked if not isinstance(term, Goal)]
        problem = Problem(
            scene,
            terms.q[frame],
            goals=goals,
            constraints=[*others, *terms.feet(frame), *planes],
            measures=self._measures,
            clearance=self._room,
        )
        self.run.work.leave_out(frame, problem.left_out)
        problem.clearances[self._together(frame)] = 0.0
        steps = itertools.count(1)
        progress = None if most is None else lambda entry: next(steps) >= most
        solution = self._method.solve(problem.with_start(start), progress)
        self.run.work.posture_solves += 1
        self.run.work.programs += sum(solution.programs.values())
        return Prediction(solution.q, self.good(frame, solution.q))

    def _together(self, frame: int) -> Mask:
        """(pairs,) which pairs are of pieces that are held at each other in a frame, or both in the world."""
        # No posture separates them farther: hands at one weapon, a foot on the floor.
        number = np.arange(self.run.scene.model.njoints)
        stands = np.zeros(len(number), dtype=bool)
        for term in self.run.terms.held(frame):
            if isinstance(term, Hold):
                held, base = term.residual.place.joint, term.residual.base.joint
                stands[held] |= base == 0
                if term.orientation:
                    one, other = number[[held, base]]
                    number[number == one] = other
        table = self.run.workspace.table
        first, second = table.joint[table.pairs].T
        return np.asarray((number[first] == number[second]) | (stands[first] & stands[second]))

    def good(self, frame: int, q: Array) -> bool:
        """Whether nothing overlaps in a posture of a frame and everything that is held there holds."""
        return self.free(q) and self.holds(frame, q)

    def free(self, q: Array) -> bool:
        """Whether no pair overlaps."""
        return self.depth(q) <= DEPTH

    def depth(self, q: Array) -> float:
        """Depth of the deepest overlap in a posture, metres."""
        return depth(self.run.workspace, q)

    def holds(self, frame: int, q: Array) -> bool:
        """Whether what is held in a frame holds, to a fifth of the millimetre that is visible."""
        terms = self.run.terms
        return not terms.holds or terms.missed(frame, self.run.workspace.state.update(q)) <= 2e-4

    def effort(self, frame: int, q: Array) -> float:
        """Effort of a posture (nq,) of a frame from the original one, that of the root included."""
        away = self._away(frame, q)
        return float(self._weights @ (away * away))

    def farthest(self, frame: int, q: Array) -> float:
        """Largest change of a joint or of the root from the original posture of a frame, radians or metres."""
        return float(np.abs(self._away(frame, q)).max(initial=0.0))

    def _away(self, frame: int, q: Array) -> Array:
        return np.asarray(pin.difference(self.run.scene.model, self.run.terms.q[frame], q))
