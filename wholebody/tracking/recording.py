"""Recordings, the shown postures frame by frame with times and counts, and their assessment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.assessment.motion import OVERLAPS, assess_motion, cone_violation, frames_passed_through, root_mean_square
from wholebody.base.arrays import Array, brief
from wholebody.base.checks import instance
from wholebody.figures.state import root_freedoms
from wholebody.scene.scene import Scene
from wholebody.tracking.frame import Frame

Counts = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Recording:
    """All frames of a run, as arrays of n rows; it has `q` and `dt` like a clip.

    Attributes:
        q: (n, nq) the shown postures.
        tracked: (n, nq) the tracked postures.
        dt: seconds from frame to frame.
        overlap: "qp" or "ccd".
        seconds, cpu_seconds, contact_seconds, solve_seconds: (n,) as in `Frame`.
        iterations, joints, pairs: (n,) as in `Frame`.
        notes: a note for each frame, mostly empty.
        paths: the path to each posture, as in `Frame`; empty where it is straight.
        moves: things that moved, with their placements at the ends of the frames.

    Examples:
        >>> track = wb.motion.posed(human, angles={"right_elbow_flexion": [0.0, 0.1]}, dt=1 / 60)
        >>> wholebody.tracking.follow(scene, track).overlap
        'qp'
    """

    __repr__ = brief

    q: Array
    tracked: Array
    dt: float
    overlap: str
    seconds: Array
    cpu_seconds: Array
    contact_seconds: Array
    solve_seconds: Array
    iterations: Counts
    joints: Counts
    pairs: Counts
    notes: tuple[str, ...]
    paths: tuple[tuple[tuple[float, Array], ...], ...] = ()
    moves: Mapping[str, Sequence[pin.SE3]] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        frames: Sequence[Frame],
        tracked: Array,
        dt: float,
        overlap: str,
        moves: Mapping[str, Sequence[pin.SE3]] | None = None,
    ) -> Recording:
        """Collect frames."""
        names = "q", "seconds", "cpu_seconds", "contact_seconds", "solve_seconds", "iterations", "joints", "pairs"
        rows = {name: np.array([getattr(frame, name) for frame in frames]) for name in names}
        notes, paths = tuple(frame.note for frame in frames), tuple(frame.path for frame in frames)
        return cls(
            **rows, tracked=np.array(tracked), dt=dt, overlap=overlap, notes=notes, paths=paths, moves=dict(moves or {})
        )

    def __len__(self) -> int:
        return len(self.q)


@dataclass(frozen=True, eq=False)
class Judgement:
    """How good a recording is; arrays have a row a frame.

    Attributes:
        depth: (n,) deepest overlap of any pair in the shown posture, metres; 0 if there is none.
        tracked_depth: (n,) the same of the tracked posture.
        tracked_pairs: (n,) number of overlapping pairs of pieces in the tracked posture.
        limit_violation: largest violation of a joint limit at any shown posture, radians.
        cone_violation: largest angle of a limb outside its reach cone, radians.
        passed: frames before which some pair got deeper than 0.1 mm (qp) or 1 mm (ccd) during the motion.
        distance: (n,) root of the mean square of joint angles between shown and tracked posture, radians.
        root_distance: (n,) distance between the two positions of a free root, metres; the largest of several.
        jerk: (n - 3,) the root of the mean square of the third difference of the shown joint angles, rad/s^3.
        tracked_jerk: (n - 3,) of the tracked ones.
        returns: for every end of contact that was followed by 30 frames without contact: the frame, and the number of
            frames until the shown posture was at the tracked one to 1 mrad; -1 if that did not happen before the next
            contact.

    Examples:
        >>> track = wb.motion.posed(human, angles={"right_elbow_flexion": [0.0] * 4}, dt=1 / 60)
        >>> wholebody.tracking.judge(scene, wholebody.tracking.follow(scene, track)).passed
        ()
    """

    __repr__ = brief

    depth: Array
    tracked_depth: Array
    tracked_pairs: Counts
    limit_violation: float
    cone_violation: float
    passed: tuple[int, ...]
    distance: Array
    root_distance: Array
    jerk: Array
    tracked_jerk: Array
    returns: tuple[tuple[int, int], ...]


def judge(scene: Scene, recording: Recording) -> Judgement:
    """Assess a recording of a scene.

    Examples:
        >>> track = wb.motion.posed(human, angles={"right_elbow_flexion": [0.0] * 4}, dt=1 / 60)
        >>> judged = wholebody.tracking.judge(scene, wholebody.tracking.follow(scene, track))
        >>> bool(judged.depth.max() < 1e-3)
        True
    """
    instance(scene, Scene, "judge: scene", "make one with wb.Scene(figure)")
    instance(recording, Recording, "judge: recording", "make one with follow(scene, track)")
    shown, tracked = (assess_motion(scene, q, recording.dt, recording.moves) for q in (recording.q, recording.tracked))
    model = scene.model
    each = [pin.difference(model, *pair) for pair in zip(recording.tracked, recording.q, strict=True)]
    apart = np.array(each)
    places = [np.zeros(len(recording))]
    for root in scene.figure.roots.values():
        first = int(model.joints[root].idx_q)
        away = recording.q[:, first : first + 3] - recording.tracked[:, first : first + 3]
        places.append(np.linalg.norm(away, axis=1))
    passing = {"qp": 1e-4, "ccd": 1e-3}[recording.overlap]  # m: as much as may remain in the frames themselves
    return Judgement(
        depth=shown.depth,
        tracked_depth=tracked.depth,
        tracked_pairs=tracked.overlapping,
        limit_violation=shown.limit_violation,
        cone_violation=cone_violation(scene, recording.q),
        passed=frames_passed_through(scene, recording.q, passing, recording.moves),
        distance=root_mean_square(apart[:, ~root_freedoms(model)]),
        root_distance=np.max(places, axis=0),
        jerk=shown.jerk,
        tracked_jerk=tracked.jerk,
        returns=_returns(tracked.depth > OVERLAPS, np.abs(apart).max(axis=1)),
    )


def _returns(touching: NDArray[np.bool_], apart: Array) -> tuple[tuple[int, int], ...]:
    found = []
    for end in np.flatnonzero(touching[:-1] & ~touching[1:]) + 1:
        later = np.flatnonzero(touching[end:])
        free = int(later[0]) if len(later) else len(touching) - end
        if free < 30:
            continue
        # rad, m: the shown posture has returned if it is nearer to the tracked one than this
        back = np.flatnonzero(apart[end : end + free] < 1e-3)
        found.append((int(end), int(back[0]) if len(back) else -1))
    return tuple(found)
