"""What is wrong with the frames of a clip and the motions between them, by culled distances, as methods see it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.geometry.continuous.swept_depth import Depths
from wholebody.motion.frame_terms import FrameTerms
from wholebody.scene.workspace import Workspace

DIP = 8e-5  # m: a deeper overlap between two frames is a dip; `wb.check` allows 0.1 mm and may add 0.01 mm
DEPTH = 5e-5  # m: of an overlap that is to go; half of what counts as a collision


def dips(workspace: Workspace, q: Array, gaps: Iterable[int]) -> dict[int, list[float]]:
    """Gaps that dip, however thin the things in their way, and the shares of each at which its pairs are deepest."""
    found = dict[int, list[float]]()
    for gap, passing in _swept(workspace, q, gaps):
        if passing.depth.max(initial=0.0) > DIP:
            deepest_first = np.argsort(-passing.depth, kind="stable").tolist()
            found[gap] = []
            for share in (float(passing.share[k]) for k in deepest_first if passing.depth[k] > DIP):
                if all(abs(share - other) > 0.01 for other in found[gap]):  # nearly the same share is listed once
                    found[gap].append(share)
    return found


def depths_between(workspace: Workspace, q: Array, gaps: Iterable[int]) -> dict[int, float]:
    """How deep motions between frames dip, metres; see `dips`."""
    return {gap: float(passing.depth.max(initial=0.0)) for gap, passing in _swept(workspace, q, gaps)}


def _swept(workspace: Workspace, q: Array, gaps: Iterable[int]) -> Iterator[tuple[int, Depths]]:
    """Pairs that overlap in each gap, and how deep."""
    swept, last = workspace.depths(DIP), -1
    for gap in sorted(gaps):
        if gap != last:
            swept.start(q[gap])
        last = gap + 1
        yield gap, swept.advance(q[last])[1]


def dip_depth(workspace: Workspace, before: Array, after: Array) -> float:
    """How deep the motion between two postures (nq,) dips, metres; see `SweptDepth.advance`."""
    return depths_between(workspace, np.stack([before, after]), [0])[0]


def depth(workspace: Workspace, q: Array, clearance: float = 0.0) -> float:
    """By how much the nearest pair at a posture (nq,) is nearer than the clearance, metres; at least 0."""
    return clearance - float(workspace.near(q, clearance).distance.min(initial=clearance))


class Faults(NamedTuple):
    """What is wrong with postures of a clip."""

    depths: Array  # (n,) of the deepest overlap, or of what is nearer than the clearance, metres
    wrong: Mask  # (n,) frames that overlap, miss a limit or miss what is held
    gaps: list[int]  # frames whose motion to the next one dips, where neither is wrong

    @property
    def frames(self) -> Mask:
        """(n,) frames that are wrong, or beside a motion that dips."""
        marked: Mask = self.wrong.copy()
        marked[[gap + end for gap in self.gaps for end in (0, 1)]] = True
        return marked

    @property
    def number(self) -> int:
        """How many frames and gaps are wrong."""
        return int(self.wrong.sum()) + len(self.gaps)


def faults(workspace: Workspace, terms: FrameTerms, q: Array, clearance: float = 0.0, first: int = 0) -> Faults:
    """What is wrong with postures (n, nq) from frame `first` of a clip on, and gaps that dip."""
    # Violations: clearance by 0.05 mm, a limit by 1e-6 rad or m, a hold by 1e-4 m or rad.
    limits = terms.scene.figure.limits
    depths = np.array([depth(workspace, posture, clearance) for posture in q])
    values = q[:, limits.idx_q]
    beyond = np.maximum(limits.lower - values, values - limits.upper).max(axis=1, initial=0.0)
    wrong = (depths > DEPTH) | (beyond > 1e-6)
    if terms.holds:
        state = workspace.state
        wrong |= np.array([terms.missed(frame, state.update(posture)) > 1e-4 for frame, posture in enumerate(q, first)])
    quiet = [frame for frame in range(len(q) - 1) if not (wrong[frame] or wrong[frame + 1])]
    return Faults(depths, wrong, list(dips(workspace, q, quiet)))
