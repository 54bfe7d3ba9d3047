"""The page of the recorded programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from wholebody.bench.qp_programs.measuring import QPRow, QPSummary
from wholebody.bench.report import render


def qp_report(rows: Sequence[QPRow], totals: Sequence[QPSummary], facts: Mapping[str, str]) -> str:
    """Tables: all programs by every solver, and the times set by set."""
    times = {
        (family, total.solver): np.quantile(
            [row.wall_us for row in rows if (row.set, row.solver) == (family, total.solver)], (0.5, 0.95)
        )
        for family in dict.fromkeys(row.set for row in rows)
        for total in totals
    }
    first = [row for row in rows if row.solver == totals[0].solver]
    return render("qp.md", totals=totals, times=times, programs=first, facts=facts)
