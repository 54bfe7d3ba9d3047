"""One task many times: many problems at once, studies of people, targets and layouts, reach maps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wholebody.base.imports import exported

if TYPE_CHECKING:
    from wholebody.studies.accommodation import Accommodation
    from wholebody.studies.many import SolveProgress
    from wholebody.studies.reach_result import ReachMap
    from wholebody.studies.records import Records, SolveRecord

__all__ = ["Accommodation", "ReachMap", "Records", "SolveProgress", "SolveRecord"]

__getattr__, __dir__ = exported(
    __name__,
    {
        "wholebody.studies.accommodation": "Accommodation",
        "wholebody.studies.many": "SolveProgress",
        "wholebody.studies.reach_result": "ReachMap",
        "wholebody.studies.records": "Records SolveRecord",
    },
)
