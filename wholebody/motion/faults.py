"""What is wrong with the frames of a clip and the motions between them, by culled distances, as methods see it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.geometry.continuous.swept_depth import Depths
from wholebody.motion.frame_terms import FrameTerms
from wholebody.scene.workspace import Workspace

DIP = 8e-5  # m: a deeper overlap between two frames is a dip; `wb.check` allows 0.1 mm and may add 0.01 mm
DEPTH = 5e-5  # m: of an overlap that is to go; half of what counts as a collision


def dipping(workspace: Workspace, q: Array, gaps: Iterable[int]) -> dict[int, Depths]:
    """Gaps that dip, however thin the things in their way, and of each the pairs that do, the deepest first."""
    found = dict[int, Depths]()
    for gap, passing in _swept(workspace, q, gaps):
        order = np.argsort(-passing.depth, kind="stable")
        if len(order := order[passing.depth[order] > DIP]):
            found[gap] = Depths(passing.number[order], passing.depth[order])
    return found


def depths_between(workspace: Workspace, q: Array, gaps: Iterable[int]) -> dict[int, float]:
    """How deep motions between frames dip, metres; see `dipping`."""
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


def deepest_shares(workspace: Workspace, q: Array, found: Mapping[int, Depths]) -> dict[int, list[float]]:
    """Shares of each gap of `dipping` at which its pairs are deepest; nearly the same share is listed once."""
    return {gap: _deepest(workspace, q[gap], q[gap + 1], pairs.number[:6]) for gap, pairs in found.items()}


def _deepest(workspace: Workspace, before: Array, after: Array, numbers: Indices) -> list[float]:
    """Fractions of the path between two postures (nq,) at which pairs are nearest, by their numbers."""
    # A corner dips in a hundredth of a gap: between the nearest of many places golden sections look.
    model, data = workspace.model, workspace.model.createData()
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    pairs = [[workspace.geometry.geometryObjects[int(piece)] for piece in workspace.table.pairs[k]] for k in numbers]
    joints = {piece.parentJoint for pieces in pairs for piece in pieces}
    posed: dict[float, dict[int, pin.SE3]] = {}

    def distance(pieces: list[pin.GeometryObject], share: float) -> float:
        if share not in posed:
            pin.forwardKinematics(model, data, pin.interpolate(model, before, after, share))
            posed[share] = {joint: data.oMi[joint].copy() for joint in joints}
        at = [posed[share][piece.parentJoint] * piece.placement for piece in pieces]
        places = [coal.Transform3s(one.rotation, one.translation) for one in at]
        result.clear()
        found = coal.distance(pieces[0].geometry, places[0], pieces[1].geometry, places[1], request, result)
        return float(found) if np.isfinite(found) else 0.1  # m, in place of a distance that coal does not find

    contact = workspace.sweep.first_contact(before, after, tolerance=DIP)
    begun: tuple[float, ...] = () if contact is None else (contact.fraction, contact.fraction + 2e-3)
    shares = sorted({*(k / 64.0 for k in range(65)), *begun})
    kept, golden = list[float](), 0.5 * (5.0**0.5 - 1.0)
    for pieces in pairs:
        place = 1 + int(np.argmin([distance(pieces, share) for share in shares[1:-1]]))
        low, high = shares[place - 1], shares[place + 1]
        for _ in range(8):  # to a fiftieth of what is between two places
            first, second = high - golden * (high - low), low + golden * (high - low)
            low, high = (low, second) if distance(pieces, first) < distance(pieces, second) else (first, high)
        deepest = float(0.5 * (low + high))
        if all(abs(deepest - other) > 0.01 for other in kept):
            kept.append(deepest)
    return kept


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
    return Faults(depths, wrong, list(dipping(workspace, q, quiet)))
