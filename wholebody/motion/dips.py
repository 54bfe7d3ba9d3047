"""Motions between frames: which of them dip into something, and where to look there."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.workspace import Workspace

DIP = 8e-5  # m: sweeps find dips deeper than this; frames themselves are met to 1e-5, so no dip is deeper than 0.1 mm
SHARES = np.arange(1, 12) / 12.0
"""Where a dip is looked at: the deepest of these becomes a node."""


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


def _deepest(workspace: Workspace, before: Array, after: Array, otherwise: float) -> float:
    """Share of the way at which some pair is deepest; `otherwise` where nothing overlaps at the shares looked at."""
    depths = [
        -float(workspace.near(_between(workspace.model, before, after, share), 0.0).distance.min(initial=0.0))
        for share in SHARES.tolist()
    ]
    place = int(np.argmax(depths))
    return float(SHARES[place]) if depths[place] > 0.0 else float(np.clip(otherwise, SHARES[0], SHARES[-1]))


def _between(model: pin.Model, before: Array, after: Array, share: float) -> Array:
    return np.asarray(pin.interpolate(model, before, after, share))
