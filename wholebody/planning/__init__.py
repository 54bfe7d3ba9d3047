"""Motions between postures: `plan` finds one that is free of collision and keeps constraints on the way."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wholebody.base.imports import exported

if TYPE_CHECKING:
    from wholebody.planning.planner import Plan, plan
    from wholebody.planning.timing import Pace

__all__ = ["Pace", "Plan", "plan"]

__getattr__, __dir__ = exported(
    __name__, {"wholebody.planning.planner": "Plan plan", "wholebody.planning.timing": "Pace"}
)
