"""Scenes in which things move by themselves, measured: a row a frame, a row a scene, and a chart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from wholebody.bench import plot_style
from wholebody.dynamics.world import WorldFrame


@dataclass(frozen=True)
class WorldFrameRow:
    """One frame; milliseconds, millimetres, joules.

    `contacts` counts contact points that bore a force at its end, `events` its impacts, `unavoided` collisions that
    the figure could not avoid.
    """

    scene: str
    frame: int
    milliseconds: float
    energy: float
    events: int
    contacts: int
    sleeping: int
    deepest_mm: float
    unavoided: int
    note: str


@dataclass(frozen=True)
class WorldRow:
    """One scene; units in the names."""

    scene: str
    bodies: int
    frames: int
    median_ms: float
    p99_ms: float
    max_ms: float
    events: int
    deepest_mm: float
    unavoided: int
    first_energy: float
    last_energy: float


def frame_rows(scene: str, frames: Sequence[WorldFrame]) -> list[WorldFrameRow]:
    """A row for each frame."""
    rows = []
    for number, frame in enumerate(frames):
        engine = frame.engine
        energy, events, contacts, sleeping = (
            (engine.energy, len(engine.events), engine.contacts, engine.sleeping) if engine else (0.0, 0, 0, 0)
        )
        deepest = max(frame.deepest, engine.deepest if engine else 0.0)
        rows.append(
            WorldFrameRow(
                scene, number, 1e3 * frame.seconds, energy, events, contacts, sleeping, 1e3 * deepest,
                len(frame.collisions), frame.note,
            )
        )  # fmt: skip
    return rows


def summary(bodies: int, rows: Sequence[WorldFrameRow]) -> WorldRow:
    """The row of a scene."""
    time = np.array([row.milliseconds for row in rows])
    return WorldRow(
        rows[0].scene, bodies, len(rows), float(np.median(time)), float(np.quantile(time, 0.99)), float(time.max()),
        sum(row.events for row in rows), max(row.deepest_mm for row in rows), sum(row.unavoided for row in rows),
        rows[0].energy, rows[-1].energy,
    )  # fmt: skip


def moments(frames: Sequence[WorldFrame]) -> list[int]:
    """Five frames, between which what moves by itself goes the same way each time."""
    ways = [0.0]
    for before, after in pairwise(frames):
        shifts = [
            float(np.linalg.norm(after.placements[name].translation - place.translation))
            for name, place in before.placements.items()
        ]
        ways.append(ways[-1] + sum(shifts))
    chosen = np.searchsorted(ways, ways[-1] * np.array([0.02, 0.25, 0.5, 0.75, 1.0]))
    return [min(int(number), len(frames) - 1) for number in chosen]


def chart(rows: Sequence[WorldFrameRow], dt: float, path: Path) -> tuple[Path, Path]:
    """Energy of the things that move by themselves and frame time, over time; returns the SVG and the PNG."""
    drawn, axes = plot_style.figure(2, 1, (7.6, 4.4))
    time = dt * np.arange(1, len(rows) + 1)
    above, below = axes[0][0], axes[1][0]
    above.plot(time, [row.energy for row in rows], color=plot_style.COLORS["wholebody"], linewidth=1.4)
    hit = [index for index, row in enumerate(rows) if row.events]
    above.plot(time[hit], [rows[index].energy for index in hit], ".", color="#d55e00", label="frame with impacts")
    above.set(ylabel="energy [J]")
    above.legend(loc="upper right", frameon=False, fontsize=8)
    above.set_title(f"{rows[0].scene.replace('_', ' ')}: energy of what moves by itself", loc="left")
    below.plot(time, [row.milliseconds for row in rows], color="#666666", linewidth=0.8)
    below.axhline(1e3 * dt, color="#d55e00", linewidth=0.8, linestyle="--", label="real time")
    below.set(ylabel="frame time [ms]", xlabel="time [s]")
    below.legend(loc="upper right", frameon=False, fontsize=8)
    return plot_style.save(drawn, path)
