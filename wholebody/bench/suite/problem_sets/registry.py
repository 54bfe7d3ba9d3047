"""The problem sets by name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from wholebody.base.errors import UnknownNameError
from wholebody.bench.suite.problem_sets import (
    balance,
    closed_loop,
    drag,
    drivers,
    held_out,
    passage,
    reaching,
    robot_arm,
    robots,
    self_contact,
)
from wholebody.bench.suite.problem_sets.case import ProblemSet

_ALL = (
    reaching.FREE, reaching.SEVERAL, reaching.CLUTTER, self_contact.SET, balance.SET, closed_loop.SET, passage.SET,
    drag.SET, robot_arm.SET,
)  # fmt: skip
SETS: Mapping[str, ProblemSet] = MappingProxyType({each.name: each for each in _ALL})
"""By name, as they are listed in reports."""

NAMED: Mapping[str, ProblemSet] = MappingProxyType(
    {each.name: each for each in (held_out.UNIFORM, held_out.PEOPLE_SET, held_out.CLUTTER, robots.SET, drivers.SET)}
)
"""Sets that take part where they are named: distributions that nothing was tuned on, of which the robots need files
that are not a part of this package; and drivers, whose contacts most other tools and the published files lack."""

TUNED_ON: Mapping[str, str] = MappingProxyType(
    {
        held_out.UNIFORM.name: reaching.SEVERAL.name,
        held_out.PEOPLE_SET.name: reaching.CLUTTER.name,
        held_out.CLUTTER.name: reaching.CLUTTER.name,
        robots.SET.name: robot_arm.SET.name,
    }
)
"""Those distributions -> the set of the same question that constants were tuned on."""

CASES = 200
"""Problems of a set, if nothing else is asked for."""


def problem_set(name: str) -> ProblemSet:
    """Return a set.

    Raises:
        UnknownNameError: with the nearest names.
    """
    known = {**SETS, **NAMED}
    if name not in known:
        raise UnknownNameError("problem set", name, known)
    return known[name]
