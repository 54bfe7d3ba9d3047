"""Retargeting: the motion of a skeleton becomes a clip of a figure, whatever the proportions of both."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping

import numpy as np
import pinocchio as pin
from scipy.linalg import LinAlgError, solveh_banded

from wholebody.base.arrays import Array, Mask
from wholebody.base.checks import function, warn
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.motion.bones import errors_of, said_of
from wholebody.motion.clip import Clip
from wholebody.motion.posture_fit import Fitter, Goals
from wholebody.motion.retarget_targets import Footfalls, Targets, footfalls, has_trunk, targets
from wholebody.motion.roles import Roles, matched
from wholebody.motion.skeleton import SkeletonMotion, checked_motion
from wholebody.tracking.tracks import check_figure

CONE = 3.0
"""Weight of an angle outside of a reach cone, metres per radian."""

DAMPING, WORSE, TRIALS = 3e-3, 10.0, 4
"""First damping, square metres per squared radian, its factor after a step that makes the sum greater, and most trials.

Where errors are left, their curvature is about the error times a limb's length, and Gauss-Newton leaves it out."""

PART, OVERLAP = 600, 60
"""Frames that are solved together, and by how many two parts overlap: memory grows with the first."""


def smooth(
    fitter: Fitter, q: Array, goals: Callable[[int], Goals], dt: float, iterations: int, told: Callable[[], None]
) -> Array:
    """The postures (n, nq) of least sum, by descent from q.

    Args:
        fitter: of the figure.
        q: (n, nq) where the descent begins, within the limits.
        goals: of each frame.
        dt: seconds from frame to frame.
        iterations: at most.
        told: called after each iteration.
    """
    if len(q) < 3:
        return q
    damping = DAMPING
    for _ in range(iterations):
        q, damping = _iteration(fitter, q, goals, dt, damping)
        told()
    return q


def _iteration(
    fitter: Fitter, q: Array, goals: Callable[[int], Goals], dt: float, damping: float
) -> tuple[Array, float]:
    """Better postures, and the damping for the next iteration."""
    model, count, size = fitter.model, len(q), fitter.model.nv
    # 1e-4 m for each rad/s², and m/s² of the root: 900 rad/s² weigh as much as 90 mm
    weights = np.full(size, (1e-4 / dt**2) ** 2)
    gradients, blocks = np.empty((count, size)), np.empty((count, size, size))
    before = np.empty(count)
    for k in range(count):
        gradients[k], blocks[k], before[k] = fitter.quadratic(q[k], goals(k), CONE)
    a = _second_differences(model, q)
    pulled = weights * a
    gradients[:-2] += pulled
    gradients[1:-1] -= 2.0 * pulled
    gradients[2:] += pulled
    lower, upper = (np.array(ends) for ends in zip(*(fitter.bounds(posture) for posture in q), strict=True))
    least = before.sum() + 0.5 * float((weights * a * a).sum())
    for _ in range(TRIALS):
        step = _bounded(blocks, gradients, weights, lower, upper, damping)
        trial = np.array([fitter.figure.clamp(pin.integrate(model, *pair)) for pair in zip(q, step, strict=True)])
        a = _second_differences(model, trial)
        cost = sum(fitter.cost(trial[k], goals(k), CONE) for k in range(count))
        if cost + 0.5 * float((weights * a * a).sum()) <= least:
            return trial, damping / WORSE
        damping *= WORSE
    return q, damping


def _second_differences(model: pin.Model, q: Array) -> Array:
    """(n - 2, nv) displacement to the next frame plus that to the one before."""
    found = np.empty((len(q) - 2, model.nv))
    for k in range(1, len(q) - 1):
        found[k - 1] = pin.difference(model, q[k], q[k + 1]) + pin.difference(model, q[k], q[k - 1])
    return found


def _bounded(blocks: Array, gradients: Array, weights: Array, lower: Array, upper: Array, damping: float) -> Array:
    """The step (n, nv) within bounds; those that it would exceed are met, and the rest is solved again."""
    fixed: Mask = np.zeros(gradients.shape, dtype=bool)
    at = np.zeros_like(gradients)
    step = at
    for _ in range(3):  # in each more joints are kept at their limits
        step = _in_parts(blocks, gradients, weights, fixed, at, damping)
        beyond = ((step < lower) | (step > upper)) & ~fixed
        if not beyond.any():
            break
        fixed |= beyond
        at = np.where(fixed, np.clip(step, lower, upper), at)
    clipped: Array = np.clip(step, lower, upper)
    return clipped


def _in_parts(blocks: Array, gradients: Array, weights: Array, fixed: Mask, at: Array, damping: float) -> Array:
    """The step of all frames, from parts that overlap; in the middle of an overlap they are joined smoothly."""
    count = len(gradients)
    step, total = np.zeros_like(gradients), np.zeros(count)
    first = 0
    while True:
        last = min(count, first + PART)
        frames = slice(first, last)
        share = np.ones(last - first)
        if first:
            share[:OVERLAP] = np.linspace(0.0, 1.0, OVERLAP)
        if last < count:
            share[-OVERLAP:] = np.minimum(share[-OVERLAP:], np.linspace(1.0, 0.0, OVERLAP))
        part = _solved(blocks[frames], gradients[frames], weights, fixed[frames], at[frames], damping)
        step[frames] += share[:, None] * part
        total[frames] += share
        if last == count:
            return step / total[:, None]
        first = last - OVERLAP


def _solved(blocks: Array, gradients: Array, weights: Array, fixed: Mask, at: Array, damping: float) -> Array:
    """Solution of the banded system; what is fixed is held at its value."""
    count, size = gradients.shape
    stiff = np.where(fixed, 1e6, 0.0)  # m²/rad²
    band = np.zeros((2 * size + 1, count * size))  # row d has the entries (i + d, i), as scipy's lower form
    for offset in range(size):
        diagonal = np.zeros((count, size))
        diagonal[:, : size - offset] = np.diagonal(blocks, offset, axis1=1, axis2=2)
        band[offset] = diagonal.ravel()
    own, one, two = np.zeros(count), np.zeros(count), np.zeros(count)
    own[:-2] += 1.0
    own[1:-1] += 4.0
    own[2:] += 1.0
    one[:-2] -= 2.0
    one[1:-1] -= 2.0
    two[:-2] = 1.0
    band[0] += (own[:, None] * weights + stiff + damping).ravel()
    band[size] += (one[:, None] * weights).ravel()
    band[2 * size] += (two[:, None] * weights).ravel()
    right = (stiff * at - gradients).ravel()
    try:
        found: Array = solveh_banded(band, right, lower=True, overwrite_ab=True, check_finite=False)
    except LinAlgError:  # never where weights are finite and the damping is positive
        return np.zeros_like(gradients)
    return found.reshape(count, size)


POINTS = {"hip": 1.0, "knee": 1.0, "ankle": 2.0, "toe": 1.0, "shoulder": 1.0, "elbow": 1.0, "wrist": 1.5, "hand": 0.5,
          "neck": 0.5, "head": 0.7}  # fmt: skip
"""Weight of the distance of each part."""

TURNS = {"pelvis": 0.3, "head": 0.15, "ankle": 0.15, "hand": 0.08}
"""Weight of the angle of each part, metres per radian."""

OWN, FROM_NEIGHBOUR, ROUNDS = 25, 6, 4
"""Iterations of a frame alone, of one that begins at its neighbour's posture, and of all frames at once."""


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
    check_figure(figure, "retarget")
    function(progress, "progress")
    roles = matched(motion.names, figure, names)
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
                self.point_weights[steps.stands[role], column] = 30.0
        self.turn_weights = np.array([TURNS[role.split("_")[-1]] for role in self.turns])
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
            posture, weights = near, np.full(self.model.nv, 0.3)
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
