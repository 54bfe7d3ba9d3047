"""Retargeting frame by frame: a free fit that follows the skeleton alone, then postures that hold what rests.

The postures follow the free fit by a deviation d. A first pass goes forward in time, each frame from the deviation of
the one before. Then sweeps go over all frames: each is solved anew between its neighbours, whose deviations say where
the acceleration of d is least (block coordinate descent on the sum of all frames' costs and of |w d''|^2),

    d_k* = (4 (d_{k-1} + d_{k+1}) - (d_{k-2} + d_{k+2})) / 6

so that the body begins to give way before a contact comes. No frame looks farther than half a second.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from scipy.linalg import solveh_banded
from scipy.ndimage import correlate1d

from wholebody.base.arrays import Array, with_values
from wholebody.figures.figure import Figure
from wholebody.motion.held_points import HeldPoint, Holds
from wholebody.motion.posture_fit import Fitter, Goals, Layout
from wholebody.motion.retarget_targets import LIMBS, Targets, has_trunk, known_bones
from wholebody.motion.roles import Roles
from wholebody.motion.structure import upright
from wholebody.scene.workspace import Workspace

FIRST, FREE, PASS, SWEEP = 60, 2, 3, 1  # most steps of a first frame, a free one, one of the first pass, one of a sweep
EVERY, WORTH = 10, 0.8  # frames after which a free posture is sought anew, and the share of the cost that it is for
STARTS = 4  # how often the first frame is solved, each time from where soles came down beside each other
SWEEPS = 6  # more: less jerk, and slower by a tenth each
ANCHOR = 0.3  # weight of the place of the hips; 1 is that of a bone
STAY = 0.03  # m/rad from the neutral posture, for what no goal determines
CHANGE = 0.3  # weight of a change of the deviation in the first pass, in metres that limbs move
BEND = 1.0  # s, weight of an acceleration of the deviation in sweeps, over the time step
GOES_ON, RETURN = 0.9, 0.3  # share of the last change that goes on; s in which a deviation that nothing needs goes back
CALM, SPREAD = 0.02, 0.04  # s over which the free fit and the deviation of the first pass are smoothed
LEAST_LEVER = 0.1  # m
SPARE = 0.9  # share of the speed limits that the free fit takes, so that there is some for what deviates from it
BONES = {"hand": 0.5, "toe": 0.7, "head": 0.7}  # weights of bones by their far ends, where it is not 1
TURNS = {"pelvis": 0.3, "head": 0.15, "ankle": 0.15, "hand": 0.08}  # m/rad, weights of angles


class Run:
    """Postures of all frames of one skeleton.

    Attributes:
        lost: what does not reach the things that it is to touch, for a message; empty where all do.
    """

    def __init__(
        self, figure: Figure, wanted: Targets, roles: Roles, dt: float, holds: Holds | None, workspace: Workspace
    ) -> None:
        """Set up; without holds the skeleton alone is followed, and nothing is free."""
        self.lost = ""
        self.figure, self.model, self.dt, self.holds = figure, figure.model, dt, holds
        points = [role for role in wanted.points if role in roles.frames]
        turns = [role for role in wanted.turns if role in roles.frames]
        self.fitter = Fitter(figure, _layout(points, turns, roles, figure, holds.points if holds else []), workspace)
        self.places = np.stack([wanted.points[role] for role in points], axis=1)
        self.hips = [k for k, role in enumerate(points) if role.endswith("hip")] or [0]
        self.count = len(self.places)
        self.turns = (
            np.stack([wanted.turns[role] for role in turns], axis=1) if turns else np.zeros((self.count, 0, 3, 3))
        )
        self.root, self.led = wanted.root, figure.root == "free" and has_trunk(roles.joints)
        self.upright = upright(figure)
        self.stay = STAY * figure.neutral_weights
        if figure.root == "free" and not self.led:
            self.stay[:6] = 1.0  # nothing says where the figure is, so it stays
        limit = np.array(self.model.velocityLimit, dtype=float)
        self.most = np.where(limit > 0.0, np.minimum(limit, 1e9) * dt, np.inf)
        self.levers = levers(figure)
        self.none = (np.zeros((len(self.fitter.layout.held), 3)),) * 2

    def run(self, tell: Callable[[float], object] | None) -> Array:
        """Postures (n, nq)."""
        done = _Progress(tell, self.count * (2 if self.holds is None else 3 + SWEEPS))
        free = self._chosen([self._chain(range(self.count), done), self._chain(range(self.count)[::-1], done)])
        free = self._calmed(free)
        if self.holds is None:
            return np.array([self._within(k, q) for k, q in enumerate(free)])
        paths = np.array([self.fitter.held(q) for q in free])
        self.holds.begin(free)
        found = self._passed(free, paths, self.holds, done)
        self.lost = self.holds.give_up()
        if self.lost:
            found = self._passed(free, paths, self.holds, done)
        deviation = np.array([pin.difference(self.model, *pair) for pair in zip(free, found, strict=True)])
        deviation = smoothed(deviation, self.dt, SPREAD)
        found = np.array(
            [self.figure.clamp(pin.integrate(self.model, *pair)) for pair in zip(free, deviation, strict=True)]
        )
        for _ in range(SWEEPS):
            for k in range(self.count):
                near = deviation[np.clip(np.arange(k - 2, k + 3), 0, self.count - 1)]
                wanted = (4.0 * (near[1] + near[3]) - (near[0] + near[4])) / 6.0
                found[k] = self._swept(k, np.asarray(pin.integrate(self.model, free[k], wanted)), found, paths)
                deviation[k] = pin.difference(self.model, free[k], found[k])
                done.one()
        return found

    def _goals(self, frame: int, posture: Array, weights: Array, held: tuple[Array, Array] | None = None) -> Goals:
        return Goals(self.places[frame], self.turns[frame], *(held or self.none), posture, weights)

    def _chain(self, order: range, done: _Progress) -> list[tuple[Array, float]]:
        """Free postures and their costs, each from the one before in an order, or now and then from upright."""
        found: list[tuple[Array, float]] = [(self.upright, np.inf)] * self.count
        last: Array | None = None
        for number, k in enumerate(order):
            goals = self._goals(k, self.upright, self.stay)
            best = (self.upright, np.inf) if last is None else self.fitter.descend(last, goals, FREE)
            if number % EVERY == 0:
                q = np.array(self.upright)
                if self.led:
                    q[:7] = pin.SE3ToXYZQUAT(pin.SE3(self.root[k], self.places[k, self.hips].mean(axis=0)))
                alone = self.fitter.descend(q, goals, FIRST)
                best = alone if alone[1] < WORTH * best[1] else best
            found[k], last = best, best[0]
            done.one()
        return found

    def _chosen(self, chains: list[list[tuple[Array, float]]]) -> Array:
        """The postures (n, nq) of least cost and least difference between neighbours, by dynamic programming."""
        kinds, came = range(len(chains)), np.zeros((self.count, len(chains)), dtype=int)
        best = np.array([chain[0][1] for chain in chains])
        for k in range(1, self.count):
            # beside the costs of both frames, 0.05 m² for a difference of one radian between them
            jump = np.array([[self._apart(one[k - 1][0], other[k][0]) for other in chains] for one in chains])
            through = best[:, None] + 0.05 * jump
            came[k] = through.argmin(axis=0)
            best = through.min(axis=0) + [chain[k][1] for chain in chains]
        kind, chosen = int(min(kinds, key=lambda each: best[each])), np.empty((self.count, self.model.nq))
        for k in range(self.count - 1, -1, -1):
            chosen[k] = chains[kind][k][0]
            kind = int(came[k, kind])
        return chosen

    def _apart(self, one: Array, other: Array) -> float:
        way = pin.difference(self.model, one, other)
        return float(way @ way)

    def _within(self, frame: int, q: Array) -> Array:
        """The posture within reach cones."""
        goals = self._goals(frame, q, self.levers)
        for _ in range(8):
            if not self.fitter.outside(q):
                break
            q = self.fitter.step(q, goals, among=False)
        return q

    def _calmed(self, q: Array) -> Array:
        """The postures (n, nq) with the noise of limits, and of what no goal determines, smoothed out."""
        found = np.array(q)
        for joint in self.model.joints[1:]:
            if joint.nq != joint.nv:  # a quaternion, or a point of a circle, may have either sign
                turned = slice(joint.idx_q + (3 if joint.nq == 7 else 0), joint.idx_q + joint.nq)
                signs = np.sign((found[1:, turned] * found[:-1, turned]).sum(axis=1))
                if joint.nq != 2:
                    found[1:, turned] *= np.cumprod(signs)[:, None]
        for joint in self.model.joints[1:]:
            if joint.nq == joint.nv and np.isfinite(self.most[joint.idx_v : joint.idx_v + joint.nv]).all():
                values = slice(joint.idx_q, joint.idx_q + joint.nq)
                found[:, values] = slowed(found[:, values], SPARE * self.most[joint.idx_v : joint.idx_v + joint.nv])
        found = smoothed(found, self.dt, CALM)
        return np.array([self.figure.clamp(pin.normalize(self.model, each)) for each in found])

    def _passed(self, free: Array, paths: Array, holds: Holds, done: _Progress) -> Array:
        """Postures (n, nq) of the first pass; it decides where points come down."""
        model, found = self.model, np.empty_like(free)
        deviation, change = np.zeros(model.nv), np.zeros(model.nv)
        for k in range(self.count):
            expected = (1.0 - min(self.dt / RETURN, 0.5)) * (deviation + GOES_ON * change)
            reference = np.asarray(pin.integrate(model, free[k], expected))
            shift = deviation[:3] if self.figure.root == "free" else np.zeros(3)
            shift = pin.XYZQUATToSE3(free[k, :7]).rotation @ shift if self.figure.root == "free" else shift
            before = found[k - 1] if k else None
            self.fitter.see(holds.moved(k))
            found[k] = self._reached(before, reference)
            for _ in range(1 if k else STARTS):
                held = holds.goals(k, paths, shift)
                goals = self._goals(k, reference, CHANGE * self.levers, held)
                found[k] = self._settled(found[k], goals, before)
                if holds.lost(k, self.fitter.held(found[k]), held):
                    found[k] = self._settled(self._reached(before, reference), goals, before)
                holds.landed(k, self.fitter.held(found[k]))
            q = found[k]
            latest = np.asarray(pin.difference(model, free[k], q))
            change = latest - deviation if k else change
            deviation = latest
            done.one()
        return found

    def _settled(self, q: Array, goals: Goals, before: Array | None) -> Array:
        """The posture (nq,) after the steps of a frame of the first pass."""
        for _ in range(FIRST if before is None else PASS):
            if before is None:
                goals = with_values(goals, posture=q)
            following = self.fitter.step(q, goals, most=self._room(q, before))
            moved = float(np.abs(pin.difference(self.model, q, following)).max())
            q = following
            if moved < 1e-3:  # rad, m
                break
        return q

    def _swept(self, frame: int, reference: Array, found: Array, paths: Array) -> Array:
        """The posture (nq,) between its neighbours."""
        assert self.holds is not None
        self.fitter.see(self.holds.moved(frame))
        held = self.holds.goals(frame, paths, np.zeros(3), again=True)
        goals = self._goals(frame, reference, BEND / self.dt * self.levers, held)
        before = found[frame - 1] if frame else None
        q = self._reached(before, reference)
        for number in range(8 * SWEEP):  # more than the usual where cones, or contacts, are curved
            if number >= SWEEP and not (self.fitter.outside(q) or self.fitter.overlaps(q)):
                break
            q = self.fitter.step(q, goals, most=self._room(q, before))
        return q

    def _room(self, q: Array, before: Array | None) -> Array | None:
        """Least and greatest displacement (2, nv) of q that joints reach from the posture before in time."""
        if before is None:
            return None
        return np.asarray(np.stack([-self.most, self.most]) - pin.difference(self.model, before, q))

    def _reached(self, before: Array | None, q: Array) -> Array:
        """The posture nearest to q (nq,) that joints reach from the posture before in time."""
        q = self.figure.clamp(q)
        if before is None:
            return q
        way = np.asarray(pin.difference(self.model, before, q))
        if (np.abs(way) <= self.most).all():
            return q
        return self.figure.clamp(pin.integrate(self.model, before, np.clip(way, -self.most, self.most)))


class _Progress:
    """Tells the caller now and then which share of the frames of all passes is done."""

    def __init__(self, tell: Callable[[float], object] | None, total: int) -> None:
        self._tell, self._total, self._done = tell, total, 0

    def one(self) -> None:
        self._done += 1
        if self._tell is not None and (self._done % 20 == 0 or self._done == self._total):
            self._tell(self._done / self._total)


def _layout(points: list[str], turns: list[str], roles: Roles, figure: Figure, held: list[HeldPoint]) -> Layout:
    """What the goals of a figure are of."""
    place = {role: np.eye(len(points))[k] for k, role in enumerate(points)}
    for part in ("hip", "shoulder"):
        if {f"left_{part}", f"right_{part}"} <= place.keys():
            place[f"{part}s"] = 0.5 * (place[f"left_{part}"] + place[f"right_{part}"])
    trunk = [
        ("left_hip", "right_hip"),
        ("hips", "shoulders"),
        ("left_shoulder", "right_shoulder"),
        ("shoulders", "head"),
    ]
    limbs = [ends for limb in LIMBS for side in ("left", "right") for ends in known_bones(limb, side, points)]
    pairs = [ends for ends in trunk + limbs if set(ends) <= place.keys()]
    rows = [place[end] - place[start] for start, end in pairs]
    weights = [BONES.get(end.split("_")[-1], 1.0) for _, end in pairs]
    if figure.root == "free" and has_trunk(roles.joints) and "hips" in place:
        rows.append(place["hips"])
        weights.append(ANCHOR)
    else:  # what is known says where it is
        rows += [place[role] for role in points]
        weights += [1.0] * len(points)
    return Layout(
        [roles.frames[role] for role in points], [roles.turns[role] for role in turns], np.array(rows),
        np.array(weights), np.array([TURNS[role.split("_")[-1]] for role in turns]),
        [(point.joint, point.place) for point in held],
    )  # fmt: skip


def smoothed(values: Array, dt: float, time: float) -> Array:
    """Means of values (n, m) with the weights of a normal distribution over time, standard deviation `time` [s].

    A mean is within the limits that the values are within, and changes no faster, so nothing has to be cut off
    afterwards: what is cut off has corners.
    """
    count = len(values)
    half = min(int(np.ceil(3.0 * time / dt)), count - 1)
    if half < 1:
        return values
    weights = np.exp(-0.5 * (np.arange(-half, half + 1) * dt / time) ** 2)
    start, end = 2.0 * values[0] - values[half:0:-1], 2.0 * values[-1] - values[-2 : -half - 2 : -1]
    rows = np.concatenate([start, values, end])  # odd at both ends, so that these stay where they are
    return np.asarray(correlate1d(rows, weights / weights.sum(), axis=0)[half : half + count])


def slowed(values: Array, most: Array) -> Array:
    """Values (n, m) nearest to given ones that change by at most `most` (m,) from row to row, but for rounding."""
    # ADMM: Boyd and others, Foundations and Trends in Machine Learning 3(1), 2011.
    changes = np.diff(values, axis=0)
    if not (np.abs(changes) > most).any():
        return values
    weight, count = 10.0, len(values)
    band = np.zeros((2, count))
    band[0] = 1.0 + weight * np.array([1.0, *[2.0] * (count - 2), 1.0])
    band[1, :-1] = -weight
    kept, dual, found = np.clip(changes, -most, most), np.zeros_like(changes), values
    for _ in range(100):
        pull = weight * (kept - dual)
        found = solveh_banded(
            band, values + np.pad(pull, ((1, 0), (0, 0))) - np.pad(pull, ((0, 1), (0, 0))), lower=True
        )
        changes = np.diff(found, axis=0)
        kept = np.clip(changes + dual, -most, most)
        dual += changes - kept
    return np.asarray(found)


def levers(figure: Figure) -> Array:
    """(nv,) by how many metres a degree of freedom moves what it moves farthest, a radian or metre."""
    model, data = figure.model, figure.model.createData()
    pin.forwardKinematics(model, data, figure.neutral)
    ends: list[list[Array]] = [[np.array(data.oMi[joint].translation)] for joint in range(model.njoints)]
    for piece in figure.geometry.geometryObjects:
        ends[piece.parentJoint].append(data.oMi[piece.parentJoint].act(piece.placement.translation))
    found = np.full(model.nv, LEAST_LEVER)
    for joint in range(model.njoints - 1, 0, -1):
        ends[model.parents[joint]] += ends[joint]
        reach = max(float(np.linalg.norm(end - data.oMi[joint].translation)) for end in ends[joint])
        first = model.idx_vs[joint]
        found[first : first + model.nvs[joint]] = max(reach, LEAST_LEVER)
    if figure.root == "free":
        found[:3] = 1.0
    return found
