"""Posture prediction for one frame of a clip: least effort from the original posture, without penetration."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.methods.base import Method
from wholebody.motion.frame_terms import FrameTerms
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import Workspace
from wholebody.tasks import Effort, Freeze, Hold, Plane
from wholebody.tasks.base import Goal, Surroundings, filled
from wholebody.tasks.distance import DistanceMeasure, SquaredDistance

ELBOWS = ("left_elbow", "right_elbow")
ANKLES = ("left_ankle", "right_ankle")

STANDS = 1e-4  # m: a shorter way from frame to frame has no direction; trackers are less exact than this


def path_planes(figure: Figure, q: Array, frame: int, joints: Sequence[str], state: State) -> list[Plane]:
    """Planes through the places of joints at a frame, normal to their paths there (eqs. 3.2 and 3.3 of the thesis).

    Elbows and wrists leave their paths only sideways.

    The normal is the direction from the place at this frame to the place at the next one, at the last frame from the
    one before. They are made anew from the present curves each time that a posture is predicted.

    Args:
        figure: the figure.
        q: (n, nq) the present curves.
        frame: which.
        joints: names of the frames that move in their planes.
        state: of the run; it is moved.

    Returns:
        One plane for each joint that moves there.
    """
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
        if np.linalg.norm(end - start) > STANDS:
            planes.append(Plane(joint, end - start, point=at))
    return planes


HELD = 2e-4  # m, rad: by which what is held may be missed in a frame; a fifth of the millimetre that is visible
ROOT_WEIGHT = 100.0  # of the root in the effort [1/m^2, 1/rad^2]: as the spine's, since moving it moves the whole body


class RootEffort(DistanceMeasure):
    """Squared displacement of the root from the start, which `Effort` leaves out."""

    def resolve(self, scene: Surroundings, start: Array) -> RootEffort:
        """Store the start."""
        weights = np.zeros(scene.model.nv)
        weights[:6] = ROOT_WEIGHT
        return filled(self, distance=SquaredDistance.build(scene.model, start, weights))


class Prediction(NamedTuple):
    """What posture prediction found for a frame.

    Attributes:
        q: (nq,) posture.
        free: whether nothing overlaps in it.
        good: whether in addition everything holds that is held in the frame.
        programs: quadratic programs that were solved.
    """

    q: Array
    free: bool
    good: bool
    programs: int


class Predictor:
    """Posture prediction in the frames of one clip.

    Attributes:
        scene: figure and things.
        original: (n, nq) postures from which the effort is counted.
        terms: what holds in each frame.
        overlap: deepest overlap of a good posture, metres.
    """

    def __init__(
        self,
        scene: Scene,
        original: Array,
        terms: FrameTerms,
        frozen: Sequence[str],
        method: Method,
        clearance: float,
        overlap: float,
        workspace: Workspace,
    ) -> None:
        """Take what stays the same from frame to frame; `workspace` is the run's."""
        self.scene, self.original, self.terms, self.overlap = scene, original, terms, overlap
        self._frozen = [Freeze(*frozen)] if frozen else []
        self._method, self._clearance, self._workspace = method, clearance, workspace
        moves = scene.figure.root == "free" and "root" not in scene.figure.joint_names(frozen)
        self._weights = np.array(scene.figure.effort_weights)
        if scene.figure.root == "free":
            self._weights[:6] = ROOT_WEIGHT
        self._measures = (Effort(), RootEffort()) if moves else (Effort(),)

    def predict(
        self,
        frame: int,
        start: Array,
        planes: Sequence[Plane] = (),
        *,
        effort_from: Array | None = None,
        most: int | None = None,
    ) -> Prediction:
        """Predict the posture of a frame.

        Args:
            frame: which; holds and the effort refer to its original posture.
            start: (nq,) where the search starts.
            planes: further constraints.
            effort_from: (nq,) posture from which the effort is counted instead.
            most: iterations of the method after which its best posture so far is taken; None for as many as it likes.
        """
        asked = self.terms.asked(frame)
        goals = [term for term in asked if isinstance(term, Goal)]
        others = [term for term in asked if not isinstance(term, Goal)]
        problem = Problem(
            self.scene,
            self.original[frame],
            goals=goals,
            constraints=[*others, *self.terms.feet(frame), *self._frozen, *planes],
            measures=self._measures,
            clearance=self._clearance,
        )
        self.terms.leave_out(frame, problem.left_out)
        problem.clearances[self._together(frame)] = 0.0
        if effort_from is not None:
            problem.measures = tuple(measure.resolve(self.scene, effort_from) for measure in self._measures)
        told = itertools.count(1)
        progress = None if most is None else lambda entry: next(told) >= most
        solution = self._method.solve(problem.with_start(start), progress)
        free = self.free(solution.q)
        return Prediction(solution.q, free, free and self.holds(frame, solution.q), sum(solution.programs.values()))

    def _together(self, frame: int) -> Mask:
        """(pairs,) which pairs are of pieces that are held at each other in a frame, or both in the world.

        No posture has more room between them than where they are held, so none is asked for: hands at one weapon, a
        foot on the floor. Feet that stand side by side and turn about a toe have little more, and are asked for none
        either. Otherwise what is held by its place alone may turn, and has its room.
        """
        number = np.arange(self.scene.model.njoints)
        stands = np.zeros(len(number), dtype=bool)
        for term in self.terms.held(frame):
            if isinstance(term, Hold):
                held, base = term.residual.place.joint, term.residual.base.joint
                stands[held] |= base == 0
                if term.orientation:
                    one, other = number[[held, base]]
                    number[number == one] = other
        table = self._workspace.table
        first, second = table.joint[table.pairs].T
        return np.asarray((number[first] == number[second]) | (stands[first] & stands[second]))

    def good(self, frame: int, q: Array) -> bool:
        """Whether nothing overlaps in a posture of a frame and everything that is held there holds."""
        return self.free(q) and self.holds(frame, q)

    def free(self, q: Array) -> bool:
        """Whether no pair overlaps."""
        return self.depth(q) <= self.overlap

    def depth(self, q: Array) -> float:
        """Depth of the deepest overlap in a posture, metres."""
        return -float(self._workspace.near(q, 0.0).distance.min(initial=0.0))

    def holds(self, frame: int, q: Array) -> bool:
        """Whether what is held in a frame holds."""
        return not self.terms.holds or self.terms.missed(frame, self._workspace.state.update(q)) <= HELD

    def effort(self, frame: int, q: Array) -> float:
        """Effort of a posture (nq,) of a frame from the original one, that of the root included."""
        away = pin.difference(self.scene.model, self.original[frame], q)
        return float(self._weights @ (away * away))

    def farthest(self, frame: int, q: Array) -> float:
        """Largest change of a joint or of the root from the original posture of a frame, radians or metres."""
        return float(np.abs(pin.difference(self.scene.model, self.original[frame], q)).max(initial=0.0))

    def deepest(self, q: Array) -> str:
        """The pair that overlaps most, in words; empty if none does."""
        near = self._workspace.near(q, 0.0)
        if not len(near.distance):
            return ""
        worst = int(np.argmin(near.distance))
        first, second = (self._workspace.owners[piece] for piece in near.pair[worst])
        return f"{first} and {second} overlap by {-1e3 * near.distance[worst]:.1f} mm"
