"""Shortcuts through a path, and a smooth path beside it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pinocchio as pin
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from wholebody.base.arrays import Array, Mask
from wholebody.figures.model_check import joint_of
from wholebody.methods.control import BUDGET
from wholebody.planning.tracked_motions import LocalPlanner

LEAST = 0.01  # rad, m: by which a part becomes shorter where one joint moves evenly
APART = 0.5  # rad, m: between the postures of a path that is tightened; smaller = shorter paths, later
SPREAD = 0.05  # of the length of a path: width of the filter; larger = smoother, farther off


def length(model: pin.Model, path: Sequence[Array]) -> float:
    """Length of a path through postures (nq,), radians and metres."""
    return float(sum(np.linalg.norm(pin.difference(model, *pair)) for pair in pairwise(path)))


def shortcut(
    model: pin.Model, path: list[Array], local: LocalPlanner, rng: np.random.Generator, partial: bool
) -> list[Array]:
    """A shorter path: parts are replaced by motions of the local planner until several tries in a row fail."""
    # if `partial`, in every other try one freedom or limb goes straight alone (Geraerts and Overmars 2007)
    failed = 0
    while failed < local.tries and len(path) > 2 and not BUDGET.over:
        first, last = sorted(rng.choice(len(path), 2, replace=False).tolist())
        part = path[first : last + 1]
        most = 0.98 * length(model, part)  # a shortcut is shorter
        alone = partial and failed % 2
        shorter = _evened(model, part, local, rng) if alone else local.joined(path[first], path[last], most)
        path = [*path[: first + 1], *shorter, *path[last + 1 :]] if shorter else path
        failed = 0 if shorter else failed + 1
    return path


def _evened(model: pin.Model, part: list[Array], local: LocalPlanner, rng: np.random.Generator) -> list[Array]:
    """A part of a path in which freedoms that turn back move evenly, without its first posture."""
    away = places(model, part)
    wasted = np.abs(np.diff(away, axis=0)).sum(axis=0) - np.abs(away[-1])
    if len(part) < 3 or wasted.max() < LEAST:
        return []
    freedom = int(rng.choice(len(wasted), p=np.maximum(wasted, 0.0) / np.maximum(wasted, 0.0).sum()))
    steps = np.linalg.norm(np.diff(away, axis=0), axis=1)
    evened = _together(model, freedom, rng)
    away[1:, evened] = np.cumsum(steps)[:, None] / steps.sum() * away[-1, evened]
    even = _postures(model, part, away)
    return local.through(even) if length(model, list(even)) < length(model, part) - LEAST else []


def _together(model: pin.Model, freedom: int, rng: np.random.Generator) -> list[int]:
    """The freedoms that move evenly with one: it alone on a fixed base; of a body its root's, or those of a limb."""
    roots = [joint.nv for joint in model.joints if joint.nv == 6]
    if not roots:
        return [freedom]
    number = joint_of(model, freedom)
    if model.joints[number].nv == 6:
        chosen = [number]
    else:
        above = [int(j) for j in model.supports[number]][1:]
        top = above[rng.integers(len(above))]
        chosen = [int(j) for j in model.subtrees[top] if model.joints[int(j)].nv < 6]
    return [model.joints[j].idx_v + k for j in chosen for k in range(model.joints[j].nv)]


def banded(model: pin.Model, path: list[Array], local: LocalPlanner) -> list[Array]:
    """Postures of a path about `APART`, and nearer ones between two of them that a straight motion does not join."""
    at, found, dear = _lengths(model, path), [path[0]], model.nv > 20  # a posture of a body costs as ten of an arm
    places = np.linspace(0.0, at[-1], max(4, int(np.ceil(at[-1] / APART)) + 1))
    for here, there in pairwise(np.unique(np.abs(at[:, None] - places).argmin(axis=0)).tolist()):
        while here < there:
            ahead = there
            while dear and ahead > here + 1 and not local.joined(path[here], path[ahead], np.inf):
                ahead = (here + ahead + 1) // 2
            alone = dear or bool(local.joined(path[here], path[ahead], np.inf))
            found += [path[ahead]] if alone else path[here + 1 : there + 1]
            here = ahead
    return found


def _lengths(model: pin.Model, path: Sequence[Array]) -> Array:
    """(n,) lengths of a path as far as each of its postures."""
    return np.concatenate([[0.0], np.cumsum([np.linalg.norm(pin.difference(model, *pair)) for pair in pairwise(path)])])


def resampled(model: pin.Model, path: Sequence[Array], count: int) -> Array:
    """Postures (count, nq) at equal lengths on a path."""
    at = _lengths(model, path)
    return _at(model, path, at, np.linspace(0.0, at[-1], count))


def refined(model: pin.Model, path: Sequence[Array], count: int) -> Array:
    """About so many postures (n, nq) on a path, at nearly equal lengths, its own ones among them: no corner is cut."""
    at = _lengths(model, path)
    if at[-1] < 1e-9:  # it stays: no length tells its postures apart
        return resampled(model, path, count)
    even = np.linspace(0.0, at[-1], count)
    nearest = np.rint(at[1:-1] / even[1]).astype(int)
    kept = np.delete(even, np.unique(nearest[(nearest > 0) & (nearest < count - 1)]))
    places = np.sort(np.concatenate([kept, at[1:-1]]))
    apart = np.diff(places, prepend=-1.0) > 1e-6 * even[1]
    return _at(model, path, at, places[apart])


def _at(model: pin.Model, path: Sequence[Array], at: Array, places: Array) -> Array:
    """Postures (n, nq) at places (n,) on a path whose postures are at others; the first and the last are its ends."""
    found = []
    for place in places[1:-1]:
        gap = int(np.clip(np.searchsorted(at, place, side="right") - 1, 0, len(at) - 2))
        part = (place - at[gap]) / max(at[gap + 1] - at[gap], 1e-15)
        found.append(np.asarray(pin.interpolate(model, path[gap], path[gap + 1], min(part, 1.0))))
    return np.array([path[0], *found, path[-1]])


def places(model: pin.Model, path: Sequence[Array] | Array) -> Array:
    """(n, nv) differences of postures (n, nq) from the first; what turns without limits goes on beyond pi."""
    found = np.array([pin.difference(model, path[0], q) for q in path])
    for joint in model.joints[1:]:
        own = found[:, joint.idx_v : joint.idx_v + joint.nv]
        if (joint.nq, joint.nv) == (2, 1):
            own[:] = np.unwrap(own, axis=0)
        elif joint.shortname() == "JointModelPlanar":  # as a free body
            flat = np.zeros((len(own), 6))
            flat[:, [0, 1, 5]] = own
            own[:] = _unwrapped(flat)[:, [0, 1, 5]]
        elif (joint.nq, joint.nv) in ((7, 6), (4, 3)):  # free bodies and balls
            own[:] = _unwrapped(own)
    return found


def _unwrapped(motions: Array) -> Array:
    """Motions (n, 6) or turns (n, 3) as other logarithms, so that turns go on beyond pi in place of jumping back."""
    found: Array = motions.copy()
    for k in range(1, len(found)):
        turn, before = found[k, -3:], found[k - 1, -3:]
        angle = float(np.linalg.norm(turn))
        if angle < 1e-6:
            continue
        whole = 2.0 * np.pi * np.round((before @ turn / angle - angle) / (2.0 * np.pi))
        if whole:
            away = pin.exp6(found[k]).translation if len(found[k]) == 6 else None
            found[k, -3:] = (1.0 + whole / angle) * turn
            if away is not None:
                found[k, :3] = np.linalg.solve(pin.Jexp3(-found[k, -3:]), away)
    return found


def smooth(model: pin.Model, path: Array, local: LocalPlanner) -> Array:
    """A path (n, nq) filtered by a Gaussian, less so where that is not free; the path itself where time ends before."""
    free = places(model, path)
    wide, share, found = _filtered(free, SPREAD * len(path)), np.ones(len(path)), path.copy()
    blocked, anew = np.zeros(len(path) - 1, dtype=bool), np.ones(len(path), dtype=bool)
    for _ in range(8):  # mixtures of the filtered path and the free one; more = smoother beside things, and later
        share[[0, -1]] = 0.0
        mixed = _postures(model, path, free + share[:, None] * (wide - free))
        for part in _runs(anew):
            mixed[[part.start, part.stop - 1]] = found[[part.start, part.stop - 1]]
            found[part], blocked[part.start : part.stop - 1] = local.settled(mixed[part])
        if BUDGET.over:
            return path
        if not blocked.any():
            break
        near = gaussian_filter1d(np.convolve(blocked, [1.0, 1.0]), 0.5 * SPREAD * len(path), mode="nearest")
        anew = near > 0.01 * near.max()
        share -= 0.6 * share * np.where(anew, near / near.max(), 0.0)
    # width of the filter of the remaining corners, points; larger = rounder, less exact
    free = places(model, found)
    wide, beside = _filtered(free, 2.0), maximum_filter1d(blocked, 10)
    stays = np.concatenate([[False], beside]) | np.concatenate([beside, [False]])
    # what is not proven free there is as the path was before, and stays so
    rounded, cut = local.settled(_postures(model, path, np.where(stays[:, None], free, wide)))
    if BUDGET.over:
        return path
    return found if (cut & ~blocked).any() else rounded


def _runs(marked: Mask) -> list[slice]:
    """Where marks (n,) are side by side, with one more place on either side."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]))).reshape(-1, 2)
    return [slice(max(first - 1, 0), min(last + 1, len(marked))) for first, last in edges.tolist()]


def _filtered(free: Array, spread: float) -> Array:
    """A Gaussian of a width in points filters (n, nv); reflections about both ends keep these in place."""
    count = len(free)
    mirrored = np.concatenate([2.0 * free[0] - free[:0:-1], free, 2.0 * free[-1] - free[-2::-1]])
    return np.asarray(gaussian_filter1d(mirrored, spread, axis=0, mode="nearest")[count - 1 : 2 * count - 1])


def _postures(model: pin.Model, path: Sequence[Array] | Array, away: Array) -> Array:
    """The postures (n, nq) of such differences, between the ends of a path."""
    return np.array([path[0], *(pin.integrate(model, path[0], place) for place in away[1:-1]), path[-1]])
