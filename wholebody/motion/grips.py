"""Where a hand is held whose place at the other one overlaps it: beside that place, as near and as smooth as can be.

`Hold("left_palm", relative_to="right_palm")` keeps the grip of each frame. Where the recording has both hands in each
other, contact and grip contradict. There the grip is shifted, by the shift s_t (3,) of each frame t for which

    1/2 sum_t (|s_t|^2 + tau^4 |(s_(t+1) - 2 s_t + s_(t-1)) / dt^2|^2 + c |s_t - (u_t . s_t) u_t|^2)    is least, and
    n . s_t >= depth + room

for every near pair of pieces with its normal n, in each frame and, where hands turn past each other, between two
frames; u_t is the direction from one held frame to the other. Normals turn with the shift, so it is solved a few times.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.motion.trajectory.deviations import Objective
from wholebody.motion.windows import Window, windows
from wholebody.scene.scene import Scene
from wholebody.tasks import Hold

NEAR = 0.02  # m: pairs nearer than this have rows
SHARES = (0.25, 0.5, 0.75)  # of the path to the next frame: these places


class _Row(NamedTuple):
    """A near pair at a place (1.25: a quarter of the path from frame 1 to 2), its distance (m), and the normal (3,)."""

    place: float
    distance: float
    normal: Array


class _Grip:
    """Pieces that are rigid with a frame, and those with the frame that it is held at."""

    def __init__(self, scene: Scene, term: Hold) -> None:
        model, table = scene.model, scene.pair_table
        self.model, self._data = model, model.createData()
        self._own, self._other = (model.frames[scene.frame_id(name)] for name in (term.frame, str(term.relative_to)))
        joints = self._own.parentJoint, self._other.parentJoint
        pieces = scene.geometry.geometryObjects
        self._pairs = []
        for first, second in table.pairs.tolist():
            for a, b in ((first, second), (second, first)):
                if (pieces[a].parentJoint, pieces[b].parentJoint) == joints and joints[0] != joints[1]:
                    self._pairs.append((pieces[a], pieces[b]))
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()

    def line(self, q: Array) -> Array:
        """(3,) direction from the other frame to the held one at a posture (nq,), in the other one's axes; or zero."""
        pin.forwardKinematics(self.model, self._data, q)
        base, held = (self._data.oMi[each.parentJoint] * each.placement for each in (self._other, self._own))
        way: Array = np.asarray(base.actInv(held).translation)
        length = float(np.linalg.norm(way))
        return way / length if length > 0.0 else way

    def rows(self, place: float, q: Array, shift: Array, clearance: float) -> list[_Row]:
        """Near pairs at a posture (nq,) with a shift (3,) in the other frame's axes, less the clearance, metres."""
        if not self._pairs:
            return []
        pin.forwardKinematics(self.model, self._data, q)
        base = self._data.oMi[self._other.parentJoint] * self._other.placement
        at = base.actInv(self._data.oMi[self._own.parentJoint])
        at.translation += shift
        back, found = self._other.placement.inverse(), []
        for own, other in self._pairs:
            moved, fixed = at * own.placement, back * other.placement
            self._result.clear()
            distance = -clearance + coal.distance(
                other.geometry, coal.Transform3s(fixed.rotation, fixed.translation),
                own.geometry, coal.Transform3s(moved.rotation, moved.translation), self._request, self._result,
            )  # fmt: skip
            normal = np.array(self._result.normal)
            if distance < NEAR and np.isfinite(normal).all() and normal.any():
                found.append(_Row(place, float(distance), normal))
        return found


def grip_shifts(scene: Scene, q: Array, dt: float, term: Hold, clearance: float = 0.0) -> Array:
    """(n, 3) shifts of a grip in the axes of the frame it is relative to, metres; zero where nothing is too near."""
    grip, shifts = _Grip(scene, term), np.zeros((len(q), 3))
    depths = np.array([_deepest(grip.rows(frame, one, shifts[frame], clearance)) for frame, one in enumerate(q)])
    overlap = 5e-5  # m: a grip that is nearer than asked by no more stays as it is
    wrong, passing = depths > overlap, list[int]()
    # where pairs are nearer than a centimetre, places between frames are looked at
    for gap in np.flatnonzero((depths[:-1] > -0.01) | (depths[1:] > -0.01)).tolist():
        if max(_deepest(_rows_at(grip, gap + share, q, shifts, clearance)) for share in SHARES) > overlap:
            passing.append(gap)
            wrong[gap : gap + 2] = True
    for window in windows(wrong, max(3, round(0.5 / dt))):  # 0.5 s before and after an overlap
        found = _window(grip, window, [gap for gap in passing if window.first <= gap < window.end], q, dt, clearance)
        if found is not None:
            shifts[window.first : window.end] = found
    return shifts


def _rows_at(grip: _Grip, place: float, q: Array, shifts: Array, clearance: float, first: int = 0) -> list[_Row]:
    """Near pairs at a place of a clip, with the shifts (n, 3) of the frames from `first` on."""
    frame, share = divmod(place, 1.0)
    here = int(frame) - first
    if share == 0.0:
        return grip.rows(here, q[int(frame)], shifts[here], clearance)
    posture = np.asarray(pin.interpolate(grip.model, q[int(frame)], q[int(frame) + 1], share))
    return grip.rows(here + share, posture, (1.0 - share) * shifts[here] + share * shifts[here + 1], clearance)


def _deepest(rows: list[_Row]) -> float:
    """Depth of the deepest of the rows, metres; negative where all are apart."""
    return max((-row.distance for row in rows), default=-NEAR)


def _over_frames(row: _Row, count: int) -> Array:
    """(3 count,) what the shifts of the frames move along the normal of a row."""
    values, (frame, share) = np.zeros((count, 3)), divmod(row.place, 1.0)
    values[int(frame)] = (1.0 - share) * row.normal
    if share:
        values[int(frame) + 1] = share * row.normal
    return values.ravel()


def _window(grip: _Grip, window: Window, passing: Sequence[int], q: Array, dt: float, clearance: float) -> Array | None:
    """(frames, 3) shifts of a window; None where none part all. Grips pass each other after frames in `passing`."""
    import scipy.sparse as sp

    from wholebody.motion.trajectory.interior_point import BandedQP, minimise

    count = len(window)
    seams = window.first > 0, window.end < len(q)
    bands = Objective(count, np.ones(3), 0.1, dt, seams).bands  # tau is 0.1 s
    lines = [grip.line(q[window.first + k]) for k in range(count)]
    across = sp.block_diag([sp.coo_array(np.eye(3) * (line @ line) - np.outer(line, line)) for line in lines])
    P = sp.csc_matrix(sp.kron(sp.csc_matrix(bands), sp.eye(3)) + 100.0 * across)  # c is 100
    shifts = np.zeros((count, 3))
    places = [*map(float, range(window.first, window.end)), *(gap + share for gap in passing for share in SHARES)]
    room = 3e-4  # m: beyond the required distance; things come nearer by less between places that are looked at
    for _ in range(8):  # the normals turn less each time
        rows = [row for place in places for row in _rows_at(grip, place, q, shifts, clearance, window.first)]
        if min((row.distance for row in rows), default=NEAR) >= 0.5 * room:
            return shifts
        G = sp.vstack([sp.csr_matrix(_over_frames(row, count)) for row in rows], format="csc")
        lower = np.array([room - row.distance for row in rows]) + G @ shifts.ravel()
        most = np.full(3 * count, 0.05)  # m: what needs a larger shift is no grip, and stays as it is
        answer = minimise(BandedQP(P, np.zeros(3 * count), G, lower, np.full(len(rows), np.inf), -most, most))
        if not answer.solved:
            return None
        shifts = answer.z.reshape(count, 3)
    return None
