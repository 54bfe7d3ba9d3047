"""Motions between postures, free of collision, by `plan`; all postures that meet goals, by `solutions`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wholebody.base.imports import exported

if TYPE_CHECKING:
    from wholebody.planning.distinct import Solutions, solutions
    from wholebody.planning.planner import Plan, plan
    from wholebody.planning.timing import Pace

__all__ = ["Pace", "Plan", "Solutions", "plan", "solutions"]

__getattr__, __dir__ = exported(
    __name__,
    {
        "wholebody.planning.planner": "Plan plan",
        "wholebody.planning.distinct": "Solutions solutions",
        "wholebody.planning.timing": "Pace",
    },
)
