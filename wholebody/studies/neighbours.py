"""Neighbouring cases of many give each other starts: where one is not solved, and where its posture jumps."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import replace
from math import radians
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices
from wholebody.studies.records import SolveRecord
from wholebody.studies.solving import Case, most_turned, solve_from

TRIES = 4  # more solves of a case whose posture jumps: its own start, both neighbours, and one that changed since
JUMP = radians(10.0)  # a posture that turns a joint further from one case to the next is another strategy

Pair = tuple[int, int]
Work = Mapping[Any, tuple[Any, ...]]


class Family(NamedTuple):
    """Cases that give each other starts."""

    order: Sequence[Case]  # the cases
    done: dict[int, SolveRecord]  # their records by number
    # answers of a function of `solving` for work by key: the number of a case, and what goes with it. Those that are
    # None, or whose process ended, are left out.
    compute: Callable[[Callable[..., Any], Work], dict[Any, Any]]
    keep: Callable[[int, SolveRecord], bool]  # puts a record into its place; whether the caller ends the run
    settled: Set[int] = frozenset()  # cases that no other start gives a lower measure


def solve_from_neighbours(family: Family, linked: Mapping[int, int] = MappingProxyType({})) -> bool:
    """Try answers as starts of neighbours, but those `linked` already, until nothing new is solved; whether ended."""
    order, done, compute, keep = family[:4]
    tried: dict[int, dict[int, int]] = {k: {} for k, one in done.items() if one.q is not None and not one.solved}
    for k, j in linked.items():
        if k in tried and j in done and done[j].solved:
            tried[k][j] = 1
    places = np.array([case.place for case in order], dtype=np.intp)
    # two for each of at most two factors that vary: more find more, and cost where there is no answer
    most = 2 * min(max(int((places != places[0]).any(axis=0).sum()), 1), 2)
    while True:
        solved = np.array(sorted(j for j, one in done.items() if one.solved and one.q is not None), dtype=np.intp)
        sizes = np.array([len(done[j].q) for j in solved.tolist()], dtype=np.intp)  # type: ignore[arg-type]
        work = {}
        for k in (k for k in tried if not done[k].solved):
            alike = solved[sizes == len(done[k].q)]  # type: ignore[arg-type]
            if near := _nearest(alike, np.abs(places[alike] - places[k]).sum(axis=1), tried[k], most):
                work[k] = near
        found = compute(solve_from, {k: (k, done[j].q) for k, (j, _) in work.items()})
        for k, (j, distance) in work.items():
            tried[k][j] = distance
            if k in found and keep(k, replace(order[k].record, **found[k], neighbour=order[j].record.name)):
                return True
        if not work:
            return False


def _nearest(solved: Indices, distances: Indices, tried: Mapping[int, int], most: int) -> tuple[int, int] | None:
    """The nearest solved case that was not tried, and how far it is; None where enough were tried."""
    # After `most` only those nearer than all before: an answer spreads from neighbour to neighbour.
    left = ~np.isin(solved, [*tried])
    if not left.any():
        return None
    distance = int(distances[left].min())
    j = int(solved[left & (distances == distance)][0])
    return (j, distance) if len(tried) < most or distance < min(tried.values()) else None


def lower(family: Family, first: Sequence[int] = ()) -> bool:
    """Solve cases again where postures are not, or no longer, of the lowest family; whether the caller ended the run.

    Those of `first` from their own starts, then those beside a jump (`JUMP`) from the answers of all neighbours and, if
    these are of no use, from their own: the lower spreads from case to case, each at most `TRIES` times. A round takes
    the answers of the one before, so the order in which solves end does not matter.
    """
    order, done, compute, keep = family[:4]
    pairs = _neighbours(order)
    beside: dict[int, list[int]] = {k: [] for k in range(len(order))}
    for a, b in pairs:
        beside[a].append(b)
        beside[b].append(a)
    tried: dict[int, set[tuple[int, bytes]]] = {k: set() for k in beside}
    while True:
        asked = {*first} or {k for pair in pairs if _jumps(done, *pair) for k in pair}
        work: dict[tuple[int, int], tuple[int, Array | None]] = {}
        for k in sorted(k for k in asked - family.settled if k in done and done[k].solved and done[k].measure):
            near = [] if first else [j for j in beside[k] if _alike(done, k, j)]
            marks = {j: (j, done[j].q.tobytes()) for j in near}  # type: ignore[union-attr]
            new = {j: mark for j, mark in marks.items() if mark not in tried[k]} or {-1: (-1, b"")}
            for j, mark in new.items():
                if mark not in tried[k] and len(tried[k]) < TRIES:
                    tried[k].add(mark)
                    work[k, j] = k, None if j < 0 else done[j].q
        if not (work or first):
            return False
        best: dict[int, tuple[float, int]] = {}
        found = compute(solve_from, work)
        for k, j in work:
            if (k, j) in found:
                best[k] = min(best.get(k, (np.inf, 0)), (found[k, j]["measure"], j))
        for k, (measure, j) in best.items():
            # a share of the measure: less is the tolerance of a solve, no better posture
            if measure < done[k].measure - 1e-3 * abs(done[k].measure):
                neighbour = "" if j < 0 else order[j].record.name
                if keep(k, replace(order[k].record, **found[k, j], neighbour=neighbour)):
                    return True
        first = ()


def name_changes(family: Family) -> bool:
    """Write into the later case of each remaining jump which joint turns, how far, and from where; see `lower`."""
    order, done, compute, keep = family[:4]
    work = {(a, b): (b, done[a].q, done[b].q) for a, b in _neighbours(order) if _jumps(done, a, b)}
    largest: dict[int, tuple[float, str]] = {}
    for (a, b), (joint, angle) in sorted(compute(most_turned, work).items()):
        if angle > max(JUMP, largest.get(b, (0.0, ""))[0]):
            largest[b] = angle, f"{joint} by {np.degrees(angle):.0f} degrees from {order[a].record.name}"
    return any(keep(k, replace(done[k], change=change)) for k, (_, change) in largest.items())


def _neighbours(order: Sequence[Case]) -> list[Pair]:
    """Pairs of cases that are one step of one factor apart, the earlier one first."""
    at = {case.place: k for k, case in enumerate(order)}
    pairs = []
    for k, case in enumerate(order):
        for n, number in enumerate(case.place):
            before = at.get((*case.place[:n], number - 1, *case.place[n + 1 :]))
            if before is not None:
                pairs.append((before, k))
    return pairs


def _alike(done: Mapping[int, SolveRecord], a: int, b: int) -> bool:
    """Whether two cases are solved and their postures have as many coordinates."""
    one, other = done.get(a), done.get(b)
    if one is None or other is None or one.q is None or other.q is None:
        return False
    return one.solved and other.solved and one.q.shape == other.q.shape


def _jumps(done: Mapping[int, SolveRecord], a: int, b: int) -> bool:
    return _alike(done, a, b) and float(np.abs(done[a].q - done[b].q).max(initial=0.0)) > JUMP  # type: ignore[operator]
