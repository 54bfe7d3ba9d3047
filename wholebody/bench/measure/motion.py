"""`wholebody bench motion`: cases of `wb.motion.avoid_many`, summed up by method, and charted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isfinite, nan

import numpy as np

from wholebody.bench.rows import Figure, Panel, Row, report, shares, texts
from wholebody.motion.batch_table import AvoidedCase

FIGURES: Mapping[str, Callable[[AvoidedCase], float]] = {
    "deviation rad": lambda case: case.angle,
    "deviation mm": lambda case: 1e3 * case.distance,
    "jerk": lambda case: nan if case.jerk is None else case.jerk,
    "feet slide mm": lambda case: 1e3 * case.sliding,
    "s a second of motion": lambda case: case.seconds / case.duration if case.duration > 0.0 else 0.0,
}
"""Figures of a case of which a summary has the median and the 95 % quantile."""


def summary(cases: Sequence[AvoidedCase]) -> list[Row]:
    """A row for each method, over all its cases that have a clip."""
    found = []
    for method in dict.fromkeys(case.method for case in cases):
        asked = [case for case in cases if case.method == method]
        mine = [case for case in asked if case.frames]
        figures: dict[str, Figure] = {
            "free": f"{sum(case.outcome == 'free' for case in asked)} of {len(asked)}",
            "deepest, most mm": 1e3 * max((case.deepest for case in mine), default=nan),
            "between, most mm": 1e3 * max((case.deepest_between for case in mine), default=nan),
        }
        for name, of in FIGURES.items():
            values = [value for value in map(of, mine) if isfinite(value)] or [nan]
            figures[f"{name}, median"] = float(np.median(values))
            figures[f"{name}, p95"] = float(np.quantile(values, 0.95))
        found.append(Row("all clips", method, figures))
    return found


def motion_report(cases: Sequence[AvoidedCase], facts: Mapping[str, str]) -> str:
    """The summary as Markdown; `cases.csv` has every case."""
    notes = [
        f"{case.clip}, {case.equipment}, {case.method}: {case.outcome} ({case.message})"
        for case in cases
        if not case.frames
    ]
    return report(texts()["motion"], {"": summary(cases)}, facts, notes)


def panels(cases: Sequence[AvoidedCase]) -> list[Panel]:
    """Shares of the cases that a method frees within a deviation, a jerk, and a time."""
    methods = list(dict.fromkeys(case.method for case in cases))
    counts = {name: sum(case.method == name for case in cases) for name in methods}
    free = {name: [case for case in cases if case.method == name and case.outcome == "free"] for name in methods}
    drawn = []
    for figure, title in (
        ("deviation mm", "deviation of the joints' centres [mm]"),
        ("jerk", "jerk, of that before"),
        ("s a second of motion", "seconds a second of motion"),
    ):
        values = {
            name: np.maximum(np.nan_to_num([FIGURES[figure](case) for case in mine]), 1e-3)
            for name, mine in free.items()
            if mine
        }
        if values:
            drawn.append(shares("free", title, values, counts))
    return drawn
