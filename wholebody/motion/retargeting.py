"""Retargeting: the motion of a skeleton becomes a clip of a figure, and how well the clip follows it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import function, instance, warn
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.joined import one_figure
from wholebody.motion.clip import Clip
from wholebody.motion.posture_fit import Fitter, Goals, smooth
from wholebody.motion.retarget_targets import (
    LIMBS,
    Footfalls,
    Targets,
    footfalls,
    has_trunk,
    known_bones,
    standing_places,
    targets,
)
from wholebody.motion.roles import Roles, matched
from wholebody.motion.skeleton import SkeletonMotion, checked_motion
from wholebody.motion.soles import soled
from wholebody.motion.stance import paths

ALONE, TOGETHER = 25, 4  # most iterations of a frame alone, and of all frames at once


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
            mapping; see docs/motion.md. Names of CMU, Mixamo, LAFAN1, SMPL, DeepMimic, Bandai-Namco, Biovision, Xsens,
            Poser, Daz, 3ds Max (biped), Unreal, VRM, VRoid, Rokoko and Motive are known.
        progress: called now and then with the share of the work that is done.

    Returns:
        A clip within the figure's joint limits and reach cones. It may collide with itself.

    Raises:
        UnknownNameError: a name that does not exist.
        FileFormatError: the TOML file cannot be read.
        InputError: no bones are known to belong to the figure, or two ends of none.
    """
    motion = checked_motion(motion, "retarget: motion")
    one_figure(figure, "retarget: figure")
    function(progress, "progress")
    roles = matched(motion, figure, names)
    if roles.told:
        told = ", ".join(f"{role} is {roles.joints[role]!r}" for role in roles.told)
        warn(f"retarget: {motion.name}: by the structure of the skeleton {told}; name joints with names={{...}} if not")
    if roles.missing:
        warn(
            f"retarget: no joint of {motion.name} is known for {', '.join(roles.missing)}, so these follow nothing; "
            'name them with names={"skeleton": {"left_wrist": "hand.L"}}'
        )
    steps = footfalls(motion, roles) if figure.root == "free" else Footfalls({}, {})  # no floor moves with a pelvis
    wanted = targets(motion, figure, roles, steps)
    if not wanted.points:
        raise InputError(
            f"the roles that {motion.name} and {figure.name} have in common ({', '.join(roles.joints)}) make no bone; "
            "name both ends of one"
        )
    clip = Clip(figure, _Retargeting(motion, figure, roles, wanted, steps, progress).run(), motion.dt, motion.name)
    if told := said_of(errors_of(motion, clip, roles)):
        warn(f"retarget: {motion.name}: {told}; see wb.motion.bone_errors(motion, clip)")
    return clip


def bone_errors(
    motion: SkeletonMotion,
    clip: Clip,
    names: str | os.PathLike[str] | Mapping[str, Mapping[str, str]] | None = None,
) -> dict[str, Array]:
    """The angle (n,) in radians between each bone of a skeleton and that of a figure, by the bone's two ends.

    Args:
        motion: the skeleton.
        clip: the motion of the figure, from `retarget`, frame by frame the same.
        names: as for `retarget`.

    Returns:
        Errors by names such as "left_shoulder to left_elbow"; a bone without both ends, or without a length, has none.
        Those of feet are between soles: skeletons have ankles and toes at other heights above them.

    Raises:
        InputError: the clip has another number of frames, or no bones are known to belong to the figure.
    """
    motion = checked_motion(motion, "bone_errors: motion")
    instance(clip, Clip, "bone_errors: clip", "give that of wb.retarget(motion, figure)")
    if len(clip) != len(motion):
        raise InputError(
            f"bone_errors: the clip has {len(clip)} frames and the motion {len(motion)}; give its own clip"
        )
    return errors_of(motion, clip, matched(motion, clip.figure, names))


def errors_of(motion: SkeletonMotion, clip: Clip, roles: Roles) -> dict[str, Array]:
    """`bone_errors` with known roles."""
    ways = paths(clip.figure, clip.q, tuple(roles.frames.values())).swapaxes(0, 1)
    places = dict(zip(roles.frames, ways, strict=True))
    centres = {role: motion.positions[:, motion.names.index(joint)] for role, joint in roles.joints.items()}
    if clip.figure.root == "free":
        centres |= soled(motion, roles, footfalls(motion, roles).stands, standing_places(clip.figure, roles)[0])
    found = {}
    for ends in (ends for side in ("left", "right") for limb in LIMBS for ends in known_bones(limb, side, places)):
        start, end = (centres[role] for role in ends)
        theirs, ours = end - start, places[ends[1]] - places[ends[0]]
        lengths = np.linalg.norm(theirs, axis=1) * np.linalg.norm(ours, axis=1)
        if lengths.min() > 1e-9:
            across = np.linalg.norm(np.cross(theirs, ours), axis=1)
            found[" to ".join(ends)] = np.arctan2(across, np.einsum("ni,ni->n", theirs, ours))
    return found


def said_of(errors: Mapping[str, Array]) -> str:
    """A sentence on bones whose median error is over 15 degrees; empty without one."""
    medians = {name: float(np.degrees(np.median(values))) for name, values in errors.items()}
    loud = {name: angle for name, angle in medians.items() if angle > 15.0}
    listed = ", ".join(
        f"{name} by {angle:.0f} degrees" for name, angle in sorted(loud.items(), key=lambda one: -one[1])
    )
    return f"bones differ from the recording's (median): {listed}" if loud else ""


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
        far = {"ankle": 2.0, "wrist": 1.5, "hand": 0.5, "neck": 0.5, "head": 0.7}  # weights of distances
        # a hand stands for a wrist that is not known
        ends = [
            role if role.replace("hand", "wrist") in self.points else role.replace("hand", "wrist")
            for role in self.points
        ]
        self.point_weights = np.tile([far.get(role.split("_")[-1], 1.0) for role in ends], (len(motion), 1))
        for column, role in enumerate(self.points):
            if role in steps.stands:
                self.point_weights[steps.stands[role], column] = 30.0
        turned = {"pelvis": 0.3, "head": 0.15, "ankle": 0.15, "hand": 0.08}  # m/rad, weights of angles
        self.turn_weights = np.array([turned[role.split("_")[-1]] for role in self.turns])
        self.count = len(motion)
        self.neutral = figure.neutral
        # metres per radian from the neutral posture, for what no goal determines
        self.stay = 0.03 * figure.neutral_weights
        self.led = figure.root == "free" and has_trunk(roles.joints)
        if figure.root == "free" and not self.led:
            self.stay[:6] = 1.0  # nothing says where the figure is, so it stays
        self._progress, self._done = progress, 0

    def run(self) -> Array:
        """Postures (n, nq)."""
        own = self._kept(
            [self.fitter.fit(self._start(k), self._goals(k), ALONE, cones=False) for k in self._told(range(self.count))]
        )
        forward, backward = self._chain(own, 1), self._chain(own, -1)
        q = self._chosen([own, forward, backward])
        q = smooth(self.fitter, q, self._goals, self.dt, TOGETHER, self._tell)
        found = self._kept([(posture, 0.0) for posture in q], q)
        return np.array([posture for posture, _ in found])

    def _kept(self, found: list[tuple[Array, float]], near: Array | None = None) -> list[tuple[Array, float]]:
        """The postures within reach cones: those outside are fitted again with them."""
        for k in np.flatnonzero(self.fitter.outside(np.array([posture for posture, _ in found]))):
            goals = self._goals(k, None if near is None else near[k])
            found[k] = self.fitter.fit(found[k][0], goals, ALONE)
        return found

    def _told(self, frames: range) -> range:
        self._tell()
        return frames

    def _tell(self) -> None:
        if self._progress is not None:
            self._done += 1
            self._progress(self._done / (TOGETHER + 3))

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
            posture, weights = near, np.full(self.model.nv, 0.3)
        return Goals(
            self.places[frame], self.point_weights[frame], self.angles[frame], self.turn_weights, posture, weights
        )

    def _chain(self, own: list[tuple[Array, float]], direction: int) -> list[tuple[Array, float]]:
        """Each frame from the posture of the frame before it, in one direction of time."""
        frames = self._told(range(self.count))
        found = list(own)
        for k in frames[::direction][1:]:
            found[k] = self.fitter.fit(found[k - direction][0], self._goals(k), 6, cones=False)
        return self._kept(found)

    def _chosen(self, candidates: list[list[tuple[Array, float]]]) -> Array:
        """The postures of least cost and least difference between neighbours, by dynamic programming."""
        q = np.array([[posture for posture, _ in of_kind] for of_kind in candidates])
        cost = np.array([[value for _, value in of_kind] for of_kind in candidates])
        kinds = len(candidates)
        best, came = cost[:, 0].copy(), np.zeros((self.count, kinds), dtype=int)
        for k in range(1, self.count):
            # beside the costs of both frames, 0.05 m² for a difference of one radian between them
            jump = np.array(
                [[0.05 * _squared(self.model, q[a, k - 1], q[b, k]) for b in range(kinds)] for a in range(kinds)]
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
