"""Ranges of motion of several joints in cyclic coordinate descent: the joints are clamped, given the others.

After a sweep, a coupled range gives back what its joints have beyond it, and an elliptic one is scaled to its edge.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from wholebody.figures.figure import Figure
from wholebody.figures.motion_ranges import CoupledRange, EllipticRange
from wholebody.methods.ccd.limbs import Limbs

INWARD = 1e-9  # share by which an ellipse is made smaller, beyond rounding


class CoupledGuard:
    """Keeps a weighted sum of joint values below its bound; see `CoupledRange`."""

    def __init__(self, part: CoupledRange, nodes: Mapping[str, int], limbs: Limbs) -> None:
        """Take a range all of whose joints are nodes of these limbs."""
        self._terms = [(nodes[joint], factor) for joint, factor in part.joints.items()]
        self._bound, self._limbs = part.bound, limbs

    def keep(self) -> bool:
        """Move the joints by the least that is needed, each within its limits; true if one moved."""
        limbs = self._limbs
        excess = sum(factor * float(limbs.values[node]) for node, factor in self._terms) - self._bound
        if excess <= 0.0:
            return False
        square = sum(factor * factor for _, factor in self._terms)
        for node, factor in self._terms:  # what a limit stops is left to the joints after it
            value, share = float(limbs.values[node]), excess / square
            new = min(max(value - factor * share, float(limbs.lower[node])), float(limbs.upper[node]))
            limbs.values[node] = new
            excess -= factor * (value - new)
            square = max(square - factor * factor, 1e-12)
        if excess > 0.0:
            node, factor = self._terms[0]
            limbs.values[node] = max(float(limbs.values[node]) - excess / factor, float(limbs.lower[node]))
        return True


class EllipticGuard:
    """Keeps angles on or in an ellipse; see `EllipticRange`."""

    def __init__(self, part: EllipticRange, nodes: Mapping[str, int], limbs: Limbs) -> None:
        """Take a range all of whose joints are nodes of these limbs."""
        self._axes = [([nodes[joint] for joint in axis.joints], axis) for axis in part.axes]
        self._limbs = limbs

    def keep(self) -> bool:
        """Scale the angles to the edge; true if they moved."""
        values, square = self._limbs.values, 0.0
        for nodes, axis in self._axes:
            angle = axis.offset + float(values[nodes].sum())
            square += (angle / (axis.upper if angle > 0.0 else axis.lower)) ** 2
        if square <= 1.0:
            return False
        scale = (1.0 - INWARD) / square**0.5
        for nodes, axis in self._axes:
            angle = axis.offset + float(values[nodes].sum())
            values[nodes] -= (1.0 - scale) * angle / max(len(nodes), 1)
            np.clip(values, self._limbs.lower, self._limbs.upper, out=values)
        return True


def range_guards(figure: Figure, limbs: Limbs, names: Sequence[str]) -> list[CoupledGuard | EllipticGuard]:
    """The ranges all of whose joints these limbs move, without twists."""
    nodes = {joint: limbs.node_of[figure.joint_id(joint)] for joint in figure.joints
             if figure.joint_id(joint) in limbs.node_of}  # fmt: skip
    found: list[CoupledGuard | EllipticGuard] = []
    for name in names:
        part = figure.ranges[name]
        if isinstance(part, CoupledRange) and set(part.joints) <= set(nodes):
            found.append(CoupledGuard(part, nodes, limbs))
        elif isinstance(part, EllipticRange) and {joint for axis in part.axes for joint in axis.joints} <= set(nodes):
            found.append(EllipticGuard(part, nodes, limbs))
    return found
