"""The problem sets by name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from wholebody.bench.problem_sets import (
    balance,
    closed_loop,
    clutter,
    drag,
    free_reach,
    free_reach_several,
    passage,
    robot_arm,
    self_contact,
)
from wholebody.bench.problem_sets.case import ProblemSet
from wholebody.errors import UnknownNameError

SETS: Mapping[str, ProblemSet] = MappingProxyType(
    {
        module.SET.name: module.SET
        for module in (
            free_reach,
            free_reach_several,
            clutter,
            self_contact,
            balance,
            closed_loop,
            passage,
            drag,
            robot_arm,
        )
    }
)
"""By name, as they are listed in reports."""

CASES = 200
"""Problems of a set, if nothing else is asked for."""


def problem_set(name: str) -> ProblemSet:
    """Return a set.

    Raises:
        UnknownNameError: with the nearest names.
    """
    if name not in SETS:
        raise UnknownNameError("problem set", name, SETS)
    return SETS[name]
