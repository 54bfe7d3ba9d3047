"""The problem sets by name; `sets.toml` has their titles and numbers."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from wholebody.base.errors import UnknownNameError
from wholebody.bench.suite.problem_sets import drivers, grips, hands, reaching, robots
from wholebody.bench.suite.problem_sets.case import Pose, ProblemSet, numbers


def _sets(poses: Mapping[str, Pose]) -> Mapping[str, ProblemSet]:
    made = {}
    for name, pose in poses.items():
        given = numbers(name)
        made[name] = ProblemSet(name, given.title, given.about, pose, getattr(given, "moving", False))
    return MappingProxyType(made)


SETS = _sets(
    {
        "free_reach": reaching.free,
        "free_reach_several": reaching.several,
        "clutter": reaching.among,
        "self_contact": hands.self_contact,
        "balance": reaching.balance,
        "closed_loop": hands.closed_loop,
        "passage": reaching.passage,
        "drag": reaching.drag,
        "robot_arm": robots.arms,
    }
)
"""By name, as they are listed in reports."""

NAMED = _sets(
    {
        "uniform_witnesses": reaching.uniform,
        "other_people": reaching.people,
        "other_clutter": reaching.clutter,
        "arms_among_things": robots.among,
        "free_arms": robots.free,
        "robots": robots.described,
        "drivers": drivers.posed,
        "hands": grips.posed,
        "two_figures": robots.two_figures,
    }
)
"""Sets that take part where they are named: distributions that nothing was tuned on, the first four and the robots,
which need files that are not a part of this package; free arms; drivers and hands, whose contacts most other tools and
files lack; and two figures, where most tools know one robot."""

CASES = 200  # problems of a set, if nothing else is asked for


def problem_set(name: str) -> ProblemSet:
    """Return a set; UnknownNameError with the nearest names."""
    known = {**SETS, **NAMED}
    if name not in known:
        raise UnknownNameError("problem set", name, known)
    return known[name]
