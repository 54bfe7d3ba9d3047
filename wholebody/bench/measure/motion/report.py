"""Tables and charts of `wholebody bench motion`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wholebody.bench import plot_style
from wholebody.bench.measure.motion.measuring import CHECKED, NEAREST, MotionRow
from wholebody.bench.report import render

DEEP = 0.1  # mm: what may remain, in frames and in between
ASKED = {"jerk": 1.2, "sliding_mm": 1.0, "hand_mm": 1.0}
OF_BISECTION = 0.7
"""Of bisection's deviation that is asked of the trajectory's."""

NAMED = 3
"""Cases that fall short that a line names."""

REAL_TIME = {"check": 0.1, "bisection": 1.0, "frames": 1.0, "trajectory": 2.0}
"""Seconds for each second of motion that are asked of a method."""

BESIDE = (CHECKED, NEAREST)
"""What stands in place of a method."""

STYLES = {"trajectory": ("#0072b2", "o"), "bisection": ("#d55e00", "s"), "frames": ("#009e73", "^"),
         "fade": ("#8c8c8c", "X"), "check": ("#000000", ".")}  # fmt: skip

DRAWN = (
    ("distance_mm", "deviation of the joints' centres, mm", None),
    ("jerk", "jerk, of that before", 1.2),
    ("sliding_mm", "standing feet slide, mm (0.001: or less)", 1.0),
)
"""Column, title and what is asked."""


@dataclass(frozen=True)
class Standing:
    """All cases of one method.

    Attributes:
        method: its name.
        cases: how many were asked.
        rows: those with an answer.
        asked: seconds for each second of motion that are asked for; infinite where nothing is.
    """

    method: str
    cases: int
    rows: tuple[MotionRow, ...]
    asked: float

    @property
    def free(self) -> int:
        """How many clips are free and within limits."""
        return sum(row.outcome == "free" for row in self.rows)

    def of(self, name: str) -> list[float]:
        """A column of all answers."""
        return [float(getattr(row, name)) for row in self.rows]

    def most(self, name: str) -> float:
        """The greatest value of a column; not a number without answers."""
        return max(self.of(name), default=float("nan"))


def standings(rows: Sequence[MotionRow]) -> list[Standing]:
    """The methods in the order in which they were asked."""
    found = []
    for method in dict.fromkeys(row.method for row in rows):
        own = [row for row in rows if row.method == method]
        answers = tuple(row for row in own if row.measured)
        found.append(Standing(method, len(own), answers, REAL_TIME.get(method, float("inf"))))
    return found


def against_bisection(rows: Sequence[MotionRow]) -> float:
    """Median of the trajectory's deviation in parts of bisection's, where both end free; not a number without."""
    free = {row.key: row.angle for row in rows if row.outcome == "free"}
    ratios = [
        angle / free[clip, worn, "bisection"]
        for (clip, worn, method), angle in free.items()
        if method == "trajectory" and free.get((clip, worn, "bisection"), 0.0) > 0.0
    ]
    return float(np.median(ratios)) if ratios else float("nan")


@dataclass(frozen=True)
class Line:
    """What is asked of a method, and how many cases reach it.

    Attributes:
        method: whose.
        asked: in words.
        cases: how many there are.
        short: those that fall short, the worst first, each with its value.
        unit: of the values.
    """

    method: str
    asked: str
    cases: int
    short: tuple[tuple[MotionRow, float], ...]
    unit: str

    @property
    def named(self) -> str:
        """The worst that fall short, and how many there are besides."""
        told = [f"{row.clip}, {row.equipment}: {value:.3g}{self.unit}" for row, value in self.short[:NAMED]]
        more = len(self.short) - NAMED
        return "; ".join(told) + (f"; {more} more" if more > 0 else "")


def lines(rows: Sequence[MotionRow]) -> list[Line]:
    """Everything that is asked, line by line, of each method that was measured."""
    bisected = {row.key[:2]: row.angle for row in rows if row.method == "bisection" and row.outcome == "free"}
    asked: list[tuple[str, str, str, float, Callable[[MotionRow], float | None]]] = []
    for method in (each.method for each in standings(rows) if each.method not in BESIDE):
        asked += [
            (method, f"no frame deeper than {DEEP} mm", " frames", 0.0, lambda row: row.after),
            (method, f"no dip deeper than {DEEP} mm between frames", " mm", DEEP, lambda row: row.between_mm),
            (method, "joint limits hold", " rad or m", 1e-6, lambda row: row.limit),
            (method, "standing feet slide at most 1 mm", " mm", ASKED["sliding_mm"], lambda row: row.sliding_mm),
            (method, "hands on the weapon within 1 mm", " mm", ASKED["hand_mm"],
             lambda row: row.off_mm if row.off_mm >= 0.0 else None),
            (method, "hands within 1 mm along the weapon too", " mm", ASKED["hand_mm"],
             lambda row: row.hand_mm if row.hand_mm >= 0.0 else None),
        ]  # fmt: skip
        if method in REAL_TIME:
            most = REAL_TIME[method]
            asked.append((method, f"at most {most:g} s a second of motion", " s", most, lambda row: row.slowness))
    asked += [
        ("trajectory", "jerk at most 1.2 of that before", "", ASKED["jerk"], lambda row: row.jerk),
        ("trajectory", "deviation (rad) at most 0.7 of bisection's", "", OF_BISECTION,
         lambda row: row.angle / other if row.outcome == "free" and (other := bisected.get(row.key[:2])) else None),
        (CHECKED, "at most a tenth of real time", "", REAL_TIME[CHECKED], lambda row: row.slowness),
    ]  # fmt: skip
    found = []
    for method, words, unit, most, value in asked:
        own = [(row, value(row)) for row in rows if row.method == method and row.measured]
        told = [(row, float(number)) for row, number in own if number is not None]
        short = sorted((each for each in told if not each[1] <= most), key=lambda each: -each[1])
        if told:
            found.append(Line(method, words, len(told), tuple(short), unit))
    return found


class Bound(NamedTuple):
    """A case in which the trajectory deviates by more of bisection's deviation than is asked.

    Attributes:
        row: of the trajectory.
        share: its deviation in parts of bisection's.
        least: that of frames each for itself.
    """

    row: MotionRow
    share: float
    least: float


def bounds(rows: Sequence[MotionRow]) -> list[Bound]:
    """Cases in which the trajectory deviates by more than is asked, where the nearest frames are known; worst first."""
    angles = {row.key: row.angle for row in rows if row.outcome == "free" or (row.method == NEAREST and row.measured)}
    found = []
    for row in rows:
        other, least = (angles.get((*row.key[:2], method), 0.0) for method in ("bisection", NEAREST))
        if row.method == "trajectory" and row.key in angles and other and least and row.angle > OF_BISECTION * other:
            found.append(Bound(row, row.angle / other, least / other))
    return sorted(found, key=lambda each: -each.share)


def report(rows: Sequence[MotionRow], facts: Mapping[str, str]) -> str:
    """The tables as Markdown."""
    found = lines(rows)
    return render(
        "motion.md",
        standings=[each for each in standings(rows) if each.method not in BESIDE],
        checks=[row for row in rows if row.method == CHECKED and row.measured],
        rows=[row for row in rows if row.method != CHECKED and row.measured],
        missing=[row for row in rows if not row.measured],
        ratio=against_bisection(rows),
        asked=ASKED,
        deep=DEEP,
        lines=found,
        misses=sum(len(line.short) for line in found),
        bounds=bounds(rows),
        of_bisection=OF_BISECTION,
        facts=facts,
    )


def chart(rows: Sequence[MotionRow], path: Path) -> tuple[Path, Path]:
    """Deviation, jerk and sliding against seconds for each second of motion; a point a clip, hollow where not free."""
    drawn, axes = plot_style.figure(1, len(DRAWN), (10.5, 3.6))
    for axis, (name, title, asked) in zip(axes[0], DRAWN, strict=True):
        for each in standings([row for row in rows if row.method not in BESIDE]):
            color, marker = STYLES.get(each.method, ("#882255", "p"))
            for outcome, face in (("free", color), ("left", "none")):
                own = [row for row in each.rows if row.outcome == outcome]
                axis.scatter(
                    [row.slowness for row in own], [max(getattr(row, name), 1e-3) for row in own], s=22, marker=marker,
                    facecolors=face, edgecolors=color, linewidths=0.9, label=each.method if outcome == "free" else None,
                )  # fmt: skip
        if asked is not None:
            axis.axhline(asked, color="#555555", linewidth=0.9, linestyle=":")
        axis.axvline(1.0, color="#555555", linewidth=0.9, linestyle=":")
        plot_style.plain_log(axis)
        axis.set_yscale("log")
        axis.set_xlabel("CPU seconds a second of motion")
        axis.set_title(title, fontsize=10)
    if axes[0][0].get_legend_handles_labels()[0]:
        axes[0][0].legend(fontsize=8, frameon=False)
    return plot_style.save(drawn, path)


def check_chart(rows: Sequence[MotionRow], path: Path) -> tuple[Path, Path]:
    """CPU time of a check a frame, by clip; a point a piece of equipment."""
    own = [row for row in rows if row.measured]
    names = list(dict.fromkeys(row.clip for row in own))
    drawn, axes = plot_style.figure(1, 1, (7.4, 0.9 + 0.32 * len(names)))
    axis = axes[0][0]
    for row in own:
        color, marker = STYLES.get(row.method, ("#882255", "p"))
        axis.scatter(row.check_ms, names.index(row.clip), s=18, color=color, marker=marker)
    axis.axvline(1e3 / 30.0 / 10.0, color="#555555", linewidth=0.9, linestyle=":")
    axis.set_yticks(range(len(names)), names)
    axis.set_ylim(len(names) - 0.4, -0.6)
    axis.set_xlim(left=0.0)
    axis.set_xlabel("CPU time of a check, ms a frame (dotted: a tenth of real time at 30 Hz)")
    return plot_style.save(drawn, path)
