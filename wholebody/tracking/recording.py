"""Recordings: the shown postures, frame by frame, with times and counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.arrays import Array
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
        paths: the way to each posture, as in `Frame`; empty where it is straight.
        moves: things that moved, with their placements at the ends of the frames.
    """

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
        return cls(
            q=np.array([frame.q for frame in frames]),
            tracked=np.array(tracked),
            dt=dt,
            overlap=overlap,
            seconds=np.array([frame.seconds for frame in frames]),
            cpu_seconds=np.array([frame.cpu_seconds for frame in frames]),
            contact_seconds=np.array([frame.contact_seconds for frame in frames]),
            solve_seconds=np.array([frame.solve_seconds for frame in frames]),
            iterations=np.array([frame.iterations for frame in frames], dtype=np.intp),
            joints=np.array([frame.joints for frame in frames], dtype=np.intp),
            pairs=np.array([frame.pairs for frame in frames], dtype=np.intp),
            notes=tuple(frame.note for frame in frames),
            paths=tuple(frame.path for frame in frames),
            moves={} if moves is None else dict(moves),
        )

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.q)
