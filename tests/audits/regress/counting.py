"""Counts of what a call did, which are the same on every machine but for rounding.

Distances and kinematic passes are counted where Pinocchio is called, so that it does not matter which part of the
package asks. What the assessment asks is left out: it asks for all pairs, always.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.assessment.all_pairs import AllPairs


@dataclass
class Counts:
    """What was done while `counting`.

    Attributes:
        passes: kinematic passes: placements of all joints at a posture, with or without Jacobians.
        calls: times that coal was asked for distances.
        pairs: pairs that it was asked for.
    """

    passes: int = 0
    calls: int = 0
    pairs: int = 0


@contextmanager
def counting() -> Iterator[Counts]:
    """Count until the context ends; for one thread, and not within another `counting`."""
    counts, judging = Counts(), [False]

    def all_distances(*arguments: Any) -> Any:
        if not judging[0]:
            counts.calls += 1
            counts.pairs += int(np.count_nonzero(list(_results(arguments).activeCollisionPairs)))
        return whole["computeDistances"](*arguments)

    def one_distance(*arguments: Any) -> Any:
        counts.calls += not judging[0]
        counts.pairs += not judging[0]
        return whole["computeDistance"](*arguments)

    def kinematics(name: str) -> Callable[..., Any]:
        def passed(*arguments: Any) -> Any:
            counts.passes += not judging[0] and len(arguments) > 2  # without a posture it uses the last pass
            return whole[name](*arguments)

        return passed

    def judged(name: str) -> Callable[..., None]:
        def asked(self: AllPairs, what: Any) -> None:
            before, judging[0] = judging[0], True
            try:
                asks[name](self, what)
            finally:
                judging[0] = before

        return asked

    passes = ("forwardKinematics", "framesForwardKinematics", "computeJointJacobians")
    instead = {"computeDistances": all_distances, "computeDistance": one_distance}
    instead |= {name: kinematics(name) for name in passes}
    whole = {name: getattr(pin, name) for name in instead}
    asks = {name: getattr(AllPairs, name) for name in ("move", "ask")}
    try:
        for name, function in instead.items():
            setattr(pin, name, function)
        for name in asks:
            setattr(AllPairs, name, judged(name))
        yield counts
    finally:
        for name, function in whole.items():
            setattr(pin, name, function)
        for name, ask in asks.items():
            setattr(AllPairs, name, ask)


def peak_bytes(call: Callable[[], object]) -> int:
    """Most memory that a call had taken for itself at one time, of Python's and numpy's, bytes."""
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        call()
        return max(0, tracemalloc.get_traced_memory()[1] - before)
    finally:
        tracemalloc.stop()


def _results(arguments: tuple[Any, ...]) -> Any:
    return next(one for one in arguments if isinstance(one, pin.GeometryData))
