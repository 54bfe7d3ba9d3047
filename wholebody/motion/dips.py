"""Motions between frames: which of them dip into something, and where to look there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.workspace import Workspace

DIP = 8e-5  # m: sweeps find dips deeper than this; frames themselves are met to 1e-5, so no dip is deeper than 0.1 mm
SAMPLED = 4e-5  # m: of a dip that is found by looking at a few places; half, because the deepest place may be elsewhere
NEAR = 2e-4  # m: what is nearer than this between frames gets rows as soon as something dips
FEW = (0.25, 0.5, 0.75)
MANY = tuple(float(k) / 12.0 for k in range(1, 12))
"""Shares of a gap at which it is looked at: the deepest of them becomes a node."""


def dips(workspace: Workspace, q: Array, gaps: Iterable[int]) -> dict[int, float]:
    """Gaps that dip, and the share of each at which it is deepest.

    Args:
        workspace: of this run alone.
        q: (n, nq) postures.
        gaps: frames whose motion to the next frame is swept.
    """
    found = {}
    for gap in gaps:
        contact = workspace.sweep.first_contact(q[gap], q[gap + 1], tolerance=DIP)
        if contact is not None:
            found[gap] = _deepest(workspace, q[gap], q[gap + 1], contact.fraction)
    return found


def sampled_dips(workspace: Workspace, q: Array, gaps: Iterable[int]) -> list[tuple[int, float]]:
    """Places between frames that overlap, or nearly so, if some of them dip: a fiftieth of the time of sweeps.

    Looks at three places of each gap, so it may miss dips. What nearly overlaps is told too, because what pushes one
    gap out pushes its neighbours in.
    """
    near, dipping = [], False
    for gap in gaps:
        for share, one in zip(FEW, _depths(workspace, q[gap], q[gap + 1], FEW, NEAR), strict=True):
            dipping |= one > SAMPLED
            if one > -NEAR:
                near.append((gap, share))
    return near if dipping else []


def _deepest(workspace: Workspace, before: Array, after: Array, otherwise: float) -> float:
    """Share of the way at which some pair is deepest; `otherwise` where nothing overlaps at the shares looked at."""
    depths = _depths(workspace, before, after, MANY)
    place = int(np.argmax(depths))
    return MANY[place] if depths[place] > 0.0 else float(np.clip(otherwise, MANY[0], MANY[-1]))


def _depths(
    workspace: Workspace, before: Array, after: Array, shares: Sequence[float], within: float = 0.0
) -> list[float]:
    """Depth of the deepest overlap at shares of the way between two postures (nq,), metres; at least minus `within`."""
    between = (np.asarray(pin.interpolate(workspace.model, before, after, share)) for share in shares)
    return [-float(workspace.near(q, within).distance.min(initial=within)) for q in between]
