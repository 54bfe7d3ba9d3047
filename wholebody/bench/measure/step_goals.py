"""What is asked of a step of ours, and what was found: a line for each of our solvers, on each reach."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wholebody.bench.measure.step import REFERENCE, StepRow
from wholebody.bench.measure.track import CLEARANCE
from wholebody.bench.report import spanned
from wholebody.bench.statistics import Interval, against

JUDGED = ("free", "contact")  # reaches whose result is judged, beside their time
HOT = ("wholebody", "wholebody/active_set")  # tools that begin from the last active set
NOT_ASKED = (np.inf, np.inf)
ASKED = {**dict.fromkeys(HOT, (0.08, 0.10)), "wholebody/osqp": (0.35, 1.0)}
"""Shares of the reference's median and p95 that steps should take at most; of other solvers nothing is asked."""


def goal_lines(rows: Sequence[StepRow]) -> list[str]:
    """What was to be reached and what was: a line for each of our solvers that something is asked of, on each reach."""
    lines = []
    for row in rows:
        if not row.tool.startswith("wholebody"):
            continue
        hot = row.tool in HOT
        median, p95 = ASKED.get(row.tool, NOT_ASKED)
        if row.reach not in JUDGED:
            median, p95 = (0.25, np.inf) if hot else NOT_ASKED
        asked = [
            (f"median {spanned(row.ratio, '.3f')} of {REFERENCE}'s", row.ratio, median),
            (f"p95 {spanned(row.ratio_p95, '.3f')} of {REFERENCE}'s", row.ratio_p95, p95),
        ]
        if hot and row.reach in JUDGED:
            others = [other for other in rows if other.reach == row.reach and not other.tool.startswith("wholebody")]
            peers = [other.acceleration for other in others if np.isfinite(other.acceleration)]
            short = 1e3 * CLEARANCE - row.least_mm
            asked += [
                (f"final error {row.final_error_mm:.2g} mm", _sure(row.final_error_mm), 1e-3),
                (f"feet off by {row.foot_drift_mm:.2g} mm", _sure(row.foot_drift_mm), 2e-3),
                (f"{max(short, 0.0):.2g} mm short of the clearance", _sure(short), 1e-3),
                (f"acceleration {row.acceleration:.2f} rad/s²", _sure(row.acceleration), min(peers, default=np.nan)),
            ]
        parts = [
            f"{name} (at most {most:.2g}: {against(found, most, at_least=False)})"
            for name, found, most in asked
            if np.isfinite(found.value) and np.isfinite(most)
        ]
        if parts or hot:
            lines.append(f"{row.tool}, {row.reach}: " + ("; ".join(parts) or "nothing to compare with") + ".")
    return lines


def _sure(value: float) -> Interval:
    return Interval(value, value, value)
