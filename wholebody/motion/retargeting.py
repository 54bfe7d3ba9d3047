"""Retargeting: the motion of a skeleton becomes a clip of a figure, whatever the proportions of both."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import function
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.motion.clip import Clip
from wholebody.motion.footfalls import Footfalls, footfalls
from wholebody.motion.posture_fit import Fitter, Goals
from wholebody.motion.retarget_targets import Targets, has_trunk, targets
from wholebody.motion.roles import Roles, matched
from wholebody.motion.skeleton import SkeletonMotion, checked_motion
from wholebody.motion.smooth_fit import smooth
from wholebody.tracking.tracks import check_figure

POINTS = {"hip": 1.0, "knee": 1.0, "ankle": 2.0, "toe": 1.0, "shoulder": 1.0, "elbow": 1.0, "wrist": 1.5, "hand": 0.5,
          "neck": 0.5, "head": 0.7}  # fmt: skip
"""Weight of the distance of each part."""

TURNS = {"pelvis": 0.3, "head": 0.15, "ankle": 0.15, "hand": 0.08}
"""Weight of the angle of each part, metres per radian."""

STANDING = 30.0
"""Weight of the distance of a foot that stands."""

POSTURE = 0.03
"""Weight of the difference of each joint from the neutral posture, metres per radian, for what no goal determines."""

NEARBY = 0.3
"""Weight of the difference from the smooth posture where a limb is brought back into its reach cone."""

OWN, FROM_NEIGHBOUR, ROUNDS = 25, 6, 4
"""Iterations of a frame alone, of one that begins at its neighbour's posture, and of all frames at once."""

JUMP = 0.05
"""Cost of a difference of one radian between neighbouring frames, beside the costs of both, square metres."""


def retarget(
    motion: SkeletonMotion,
    figure: Figure,
    names: str | os.PathLike[str] | Mapping[str, Mapping[str, str]] | None = None,
    *,
    progress: Callable[[float], object] | None = None,
) -> Clip:
    """The motion of a skeleton as a clip of a figure.

    Args:
        motion: the skeleton, from `wb.motion.read_skeleton`.
        figure: the figure.
        names: which joint of the skeleton and which frame of the figure are which part of a body: a TOML file or a
            mapping; see docs/motion.md. CMU, Mixamo, LAFAN1, SMPL and DeepMimic are known.
        progress: called now and then with the share of the work that is done.

    Returns:
        A clip within the figure's joint limits and reach cones. It may collide with itself.

    Raises:
        UnknownNameError: a name that does not exist.
        FileFormatError: the TOML file cannot be read.
        InputError: no bones are known to belong to the figure, or two ends of none.
    """
    motion = checked_motion(motion, "retarget: motion")
    check_figure(figure, "retarget")
    function(progress, "progress")
    roles = matched(motion.names, figure, names)
    steps = footfalls(motion, roles) if figure.root == "free" else Footfalls({}, {})  # no floor moves with a pelvis
    wanted = targets(motion, figure, roles, steps)
    if not wanted.points:
        raise InputError(
            f"the roles that {motion.name} and {figure.name} have in common ({', '.join(roles.joints)}) make no bone; "
            "name both ends of one"
        )
    return Clip(figure, _Retargeting(motion, figure, roles, wanted, steps, progress).run(), motion.dt, motion.name)


class _Retargeting:
    """The search for the postures of all frames."""

    def __init__(
        self,
        motion: SkeletonMotion,
        figure: Figure,
        roles: Roles,
        wanted: Targets,
        steps: Footfalls,
        progress: Callable[[float], object] | None,
    ) -> None:
        self.figure, self.model, self.dt = figure, figure.model, motion.dt
        self.points = [role for role in wanted.points if role in roles.frames]
        self.turns = [role for role in wanted.turns if role in roles.frames]
        self.fitter = Fitter(
            figure, [roles.frames[role] for role in self.points], [roles.turns[role] for role in self.turns]
        )
        self.places = np.stack([wanted.points[role] for role in self.points], axis=1)
        self.angles = (
            np.stack([wanted.turns[role] for role in self.turns], axis=1)
            if self.turns
            else np.zeros((len(motion), 0, 3, 3))
        )
        self.root = wanted.root
        self.point_weights = np.tile([POINTS[role.split("_")[-1]] for role in self.points], (len(motion), 1))
        for column, role in enumerate(self.points):
            if role in steps.stands:
                self.point_weights[steps.stands[role], column] = STANDING
        self.turn_weights = np.array([TURNS[role.split("_")[-1]] for role in self.turns])
        self.count = len(motion)
        self.neutral = figure.neutral
        self.stay = POSTURE * figure.neutral_weights
        self.led = figure.root == "free" and has_trunk(roles.joints)
        if figure.root == "free" and not self.led:
            self.stay[:6] = 1.0  # nothing says where the figure is, so it stays
        self._progress, self._done = progress, 0

    def run(self) -> Array:
        """Postures (n, nq)."""
        own = self._kept(
            [self.fitter.fit(self._start(k), self._goals(k), OWN, cones=False) for k in self._told(range(self.count))]
        )
        forward, backward = self._chain(own, 1), self._chain(own, -1)
        q = self._chosen([own, forward, backward])
        q = smooth(self.fitter, q, self._goals, self.dt, ROUNDS, self._tell)
        found = self._kept([(posture, 0.0) for posture in q], q)
        return np.array([posture for posture, _ in found])

    def _kept(self, found: list[tuple[Array, float]], near: Array | None = None) -> list[tuple[Array, float]]:
        """The postures within reach cones: those outside are fitted again with them."""
        for k in np.flatnonzero(self.fitter.outside(np.array([posture for posture, _ in found]))):
            goals = self._goals(k, None if near is None else near[k])
            found[k] = self.fitter.fit(found[k][0], goals, OWN)
        return found

    def _told(self, frames: range) -> range:
        self._tell()
        return frames

    def _tell(self) -> None:
        if self._progress is not None:
            self._done += 1
            self._progress(self._done / (ROUNDS + 3))

    def _start(self, frame: int) -> Array:
        """Where the descent of a frame alone begins: the neutral posture, with the pelvis as it is wanted."""
        q = np.array(self.neutral)
        if self.led:
            hips = [k for k, role in enumerate(self.points) if role.endswith("hip")] or [0]
            at = self.places[frame, hips].mean(axis=0)
            q[:7] = pin.SE3ToXYZQUAT(pin.SE3(self.root[frame], at))
        return q

    def _goals(self, frame: int, near: Array | None = None) -> Goals:
        posture, weights = self.neutral, self.stay
        if near is not None:
            posture, weights = near, np.full(self.model.nv, NEARBY)
        return Goals(
            self.places[frame], self.point_weights[frame], self.angles[frame], self.turn_weights, posture, weights
        )

    def _chain(self, own: list[tuple[Array, float]], direction: int) -> list[tuple[Array, float]]:
        """Each frame from the posture of the frame before it, in one direction of time."""
        frames = self._told(range(self.count))
        found = list(own)
        for k in frames[::direction][1:]:
            found[k] = self.fitter.fit(found[k - direction][0], self._goals(k), FROM_NEIGHBOUR, cones=False)
        return self._kept(found)

    def _chosen(self, candidates: list[list[tuple[Array, float]]]) -> Array:
        """The postures of least cost and least difference between neighbours, by dynamic programming."""
        q = np.array([[posture for posture, _ in of_kind] for of_kind in candidates])
        cost = np.array([[value for _, value in of_kind] for of_kind in candidates])
        kinds = len(candidates)
        best, came = cost[:, 0].copy(), np.zeros((self.count, kinds), dtype=int)
        for k in range(1, self.count):
            jump = np.array(
                [[JUMP * _squared(self.model, q[a, k - 1], q[b, k]) for b in range(kinds)] for a in range(kinds)]
            )
            through = best[:, None] + jump
            came[k] = through.argmin(axis=0)
            best = through.min(axis=0) + cost[:, k]
        kind = int(best.argmin())
        chosen = np.empty((self.count, self.model.nq))
        for k in range(self.count - 1, -1, -1):
            chosen[k] = q[kind, k]
            kind = int(came[k, kind])
        return chosen


def _squared(model: pin.Model, first: Array, second: Array) -> float:
    step = pin.difference(model, first, second)
    return float(step @ step)
