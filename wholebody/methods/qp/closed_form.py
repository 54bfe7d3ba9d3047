"""All postures of an arm for a placement of its end, in closed form, where its axes cross or are parallel.

Six turning joints are solved where the last three axes cross, and the first two cross or the second and the third are
parallel (most industrial arms), or where the second to the fourth are parallel and the last two cross (those of
Universal Robots); or the same from the end to the base. Of seven joints one is held at values all over its limits.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array, with_values
from wholebody.base.compiled import with_loops
from wholebody.methods.qp.chain_goals_kernel import Chain
from wholebody.methods.qp.closed_form_kernel import BRANCHES, CROSSING, PARALLEL, SLACK, THREE_PARALLEL, Arm

ALIKE = 1e-4  # rad: axes that differ by less count as parallel; m: lines that pass each other nearer count as crossing
NEARLY = 0.02  # the same of arms whose closed form is only near to their postures: a descent goes on from there
HELD = (6, 0, 2)
"""Joints of seven that may be held; the elbow's angle does not change where an arm moves with its end at rest."""
TRIED = (0.0, 0.7, -1.9)  # rad: of a joint that is held; what axes have in common at these they always have


class Branches(NamedTuple):
    """Branches of a closed form; arrays have a row a posture."""

    values: Array  # (k, n) of the joints
    effort: Array  # (k,) of each; inf where it does not exist or is beyond limits
    least: Array  # (m, n) those that take less effort than the samples beside them, the least first


def closed_form(chain: Chain, alike: float = ALIKE) -> Arm | None:
    """The arm that a chain is, or with `alike` nearly is, where it has a closed form; else None."""
    size = len(chain.parents)
    if size not in (6, 7) or not chain.turns.any(axis=1).all() or (chain.parents != np.arange(size)).any():
        return None
    return _arm(chain.places.tobytes(), chain.turns.tobytes(), alike)


@lru_cache(maxsize=64)
def _arm(placed: bytes, turned: bytes, alike: float) -> Arm | None:
    """The arm of a serial chain of turning joints with these places (n, 4, 3) and axes (n, 3); every scene asks."""
    places, turns = np.frombuffer(placed).reshape(-1, 4, 3), np.frombuffer(turned).reshape(-1, 3)
    size = len(turns)
    axes, points, turn, at = np.empty((size, 3)), np.empty((size, 3)), np.eye(3), np.zeros(3)
    for k, placed_at in enumerate(places):
        at = at + turn @ placed_at[3]
        turn = turn @ placed_at[:3].T
        axes[k], points[k] = turn @ turns[k], at
    end, there = np.ascontiguousarray(np.vstack([turn.T, at])), np.arange(size)
    for held, backwards, kind in product(HELD if size == 7 else (-1,), (0, 1), (THREE_PARALLEL, PARALLEL, CROSSING)):
        joints, sign = (there[::-1].copy(), -1.0) if backwards else (there, 1.0)
        place = size - 1 - held if backwards and held >= 0 else held
        known = _solvable(Arm(sign * axes[joints], points[joints], joints, place, kind, backwards, end, SLACK), alike)
        if known is not None:
            return known
    return None


def _solvable(arm: Arm, alike: float) -> Arm | None:
    """An arm with its points where axes cross, if its kind is as it says wherever its held joint is; else None."""
    first, last = [0, 1], [4, 5] if arm.kind == THREE_PARALLEL else [3, 4, 5]
    moved = np.delete(np.arange(len(arm.joints)), arm.held) if arm.held >= 0 else np.arange(6)
    points = arm.points.copy()
    for group in (last, first) if arm.kind == CROSSING else (last,):
        points[moved[group]] = _crossing(arm.axes[moved[group]], arm.points[moved[group]])
    parallel = {THREE_PARALLEL: (1, 2, 3), PARALLEL: (1, 2), CROSSING: ()}[arm.kind]
    for value in TRIED if arm.held >= 0 else TRIED[:1]:
        h, o = _held_at(arm, points, value)
        _, there = _held_at(arm, arm.points, value)
        h, o, there = h[moved], o[moved], there[moved]
        if any(np.linalg.norm(np.cross(h[1], h[k])) > alike for k in parallel):
            return None
        for group in (last, first) if arm.kind == CROSSING else (last,):
            away = np.cross(there[group] - o[group[-1]], h[group])
            if (np.linalg.norm(away, axis=1) > alike).any() or np.ptp(o[group], axis=0).max() > alike:
                return None
    return with_values(arm, points=points)


def _held_at(arm: Arm, points: Array, value: float) -> tuple[Array, Array]:
    """Axes and points (n, 3) where the held joint turned those behind it by an angle."""
    if arm.held < 0:
        return arm.axes, points
    axis, centre = arm.axes[arm.held], arm.points[arm.held]
    skew = np.cross(np.eye(3), -axis)
    turn = np.eye(3) + np.sin(value) * skew + (1.0 - np.cos(value)) * skew @ skew
    behind = (np.arange(len(points)) > arm.held)[:, None]
    return np.where(behind, arm.axes @ turn.T, arm.axes), np.where(behind, centre + (points - centre) @ turn.T, points)


def _crossing(axes: Array, points: Array) -> Array:
    """The point (3,) that is nearest to some lines, in least squares."""
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    found: Array = np.linalg.lstsq(across.sum(axis=0), np.einsum("kij,kj->i", across, points), rcond=None)[0]
    return found


@with_loops("wholebody.methods.qp.closed_form_kernel")
def compiled_kernel(closed_form_kernel: Any) -> None:
    """The module of compiled loops, compiled or read back."""
    rows, one, near = np.zeros((1, 3)), np.zeros(1), np.zeros((2, 1))
    arm = Arm(rows, rows, np.zeros(1, dtype=np.intp), 0, CROSSING, 0, np.zeros((4, 3)), SLACK)
    found, goal, limits = np.zeros((0, BRANCHES, 1)), np.zeros(36), (one, one)
    closed_form_kernel.branches(arm, goal, np.zeros(0), found)
    order = np.zeros(0, dtype=np.intp)
    closed_form_kernel.sampled(arm, goal, limits, near, found, np.zeros((0, BRANCHES)), order)
