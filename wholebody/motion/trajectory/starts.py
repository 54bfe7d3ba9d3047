"""Where the iterations of a window begin when the original postures are too deep for their own normals.

A limb that passes through the trunk is pushed out on one side before the middle and on the other after it. Then rows
contradict each other from frame to frame. So the deepest posture is freed on its own, and from there the limb follows
the original motion frame by frame, outwards in both directions, in contact with what is in its way. It stays on one
side. The iterations begin with what that gives.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.motion.dips import dip_depth
from wholebody.motion.fade import freed_posture
from wholebody.motion.following import BACK, SHALLOW, Follower, keep_back
from wholebody.motion.frame_terms import FrameTerms
from wholebody.motion.windows import Window, outwards
from wholebody.scene.workspace import Workspace

PATIENCE = 0.25  # s: a run of frames at the original posture this long ends the following


class _Followed(NamedTuple):
    """Postures (n, nq), the sum of their squared deviations, and the frame that they were followed from."""

    q: Array
    apart: float
    middle: int


class Carried:
    """Starts of windows of one clip.

    Attributes:
        posture_solves: how many postures were solved for on their own.
        programs: how many quadratic programs the following took.
    """

    def __init__(self, terms: FrameTerms, clearance: float) -> None:
        """Take what is needed; nothing is computed yet."""
        self._terms, self._clearance = terms, clearance
        self._follower: Follower | None = None
        self.posture_solves = 0

    @property
    def programs(self) -> int:
        """How many quadratic programs the following took."""
        return 0 if self._follower is None else self._follower.programs

    def beside(self, window: Window, q: Array, gaps: Iterable[int], workspace: Workspace) -> Array:
        """(n, nq) postures of a window, on one side of what motions between them pass as far as that is found.

        Args:
            window: which frames.
            q: (n, nq) its postures.
            gaps: frames of the window whose motion to the next one passes something.
            workspace: of this run alone.
        """
        if self._follower is None:
            self._follower = Follower(self._terms, self._clearance)
        q = np.array(q)
        for gap in sorted(gaps):
            if 0 <= gap < len(q) - 1 and dip_depth(workspace, q[gap], q[gap + 1]) > SHALLOW:
                keep_back(self._follower, workspace, q, gap, len(q) - 1, window.first)
        return q

    def outwards(self, window: Window, middles: Iterable[int]) -> Iterator[Array]:
        """Postures (n, nq) of a window, followed from the freed postures of frames; the nearest to the original first.

        Followed from one frame a limb may stay on the farther side of a thing for the whole window. Iterations keep the
        side, so which start ends nearest is seen before them. Following ends where another start is nearer already;
        it is gone on with only if that one leads to nothing.

        Args:
            window: which frames.
            middles: frames of it to begin at.
        """
        best, others = _Followed(np.zeros(0), np.inf, -1), list[int]()
        for middle in dict.fromkeys(middles):
            found = self._outwards(window, middle, best.apart)
            if found.apart < best.apart:
                best, found = found, best
            if found.middle >= 0:
                others.append(found.middle)
        yield best.q
        for middle in others:
            yield self._outwards(window, middle, np.inf).q

    def _outwards(self, window: Window, middle: int, most: float) -> _Followed:
        """What following from a frame gives; ended where the sum of squared deviations is more than `most`."""
        terms = self._terms
        if self._follower is None:
            self._follower = Follower(terms, self._clearance)
        q = np.array(terms.q[window.first : window.end])
        freed, _ = freed_posture(terms, middle, terms.q[middle], self._clearance)
        self.posture_solves += 1
        q[middle - window.first] = freed
        model = terms.scene.model
        far = float((pin.difference(model, terms.q[middle], freed) ** 2).sum())
        patience, calm, side = max(2, round(PATIENCE / terms.dt)), 0, 1
        for frame, neighbour in outwards(window, middle):
            if frame - neighbour != side:
                calm, side = 0, frame - neighbour
            if calm >= patience:
                continue
            here = self._follower.frame(frame, q[neighbour - window.first])
            q[frame - window.first] = here
            near = np.abs(here - terms.q[frame]).max() <= BACK
            calm = calm + 1 if near else 0
            far += float((pin.difference(model, terms.q[frame], here) ** 2).sum())
            if far > most:
                break
        return _Followed(q, far, middle)
