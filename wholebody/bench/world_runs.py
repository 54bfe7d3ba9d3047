"""Scenes in which things move by themselves, measured: a row a frame, a row a scene, and a chart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from wholebody.bench import plot_style
from wholebody.bench.interaction import PAPER
from wholebody.bench.report import render
from wholebody.dynamics.world import WorldFrame


@dataclass(frozen=True)
class WorldFrameRow:
    """One frame; milliseconds, millimetres, joules.

    `contacts` counts contact points that bore a force at its end, `events` its impacts, `unavoided` collisions that
    the figure could not avoid. `drawing_ms` is the time to make the picture's commands, as for a live page; `query_ms`
    and `ik_ms` are collision queries and programs of the figure, `joints` and `iterations` those of `Frame`. `pairs`
    counts pairs of pieces by which the posture that the spring wanted was in things.
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
    drawing_ms: float
    query_ms: float
    ik_ms: float
    iterations: int
    joints: int
    pairs: int
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
    drawn_mean_ms: float
    drawn_p99_ms: float
    mean_ms: float
    joints: float
    iterations: float
    ik_percent: float
    pairs: float
    query_percent: float


def frame_rows(
    scene: str, frames: Sequence[WorldFrame], drawing: Sequence[float], pairs: Sequence[int]
) -> list[WorldFrameRow]:
    """A row for each frame; `drawing` has the seconds that drawing it took, `pairs` what the wanted posture was in."""
    rows = []
    for number, (frame, drawn, inside) in enumerate(zip(frames, drawing, pairs, strict=True)):
        loop = frame.loop
        engine = frame.engine
        energy, events, contacts, sleeping = (
            (engine.energy, len(engine.events), engine.contacts, engine.sleeping) if engine else (0.0, 0, 0, 0)
        )
        deepest = max(frame.deepest, engine.deepest if engine else 0.0)
        rows.append(
            WorldFrameRow(
                scene, number, 1e3 * frame.seconds, energy, events, contacts, sleeping, 1e3 * deepest,
                len(frame.collisions), 1e3 * drawn, 1e3 * loop.contact_seconds, 1e3 * loop.solve_seconds,
                loop.iterations, loop.joints, inside, frame.note,
            )
        )  # fmt: skip
    return rows


def summary(bodies: int, rows: Sequence[WorldFrameRow]) -> WorldRow:
    """The row of a scene; iterations count in frames in which the tracked posture overlaps something."""
    time = np.array([row.milliseconds for row in rows])
    drawn, whole = time + [row.drawing_ms for row in rows], float(time.sum())
    return WorldRow(
        rows[0].scene, bodies, len(rows), float(np.median(time)), float(np.quantile(time, 0.99)), float(time.max()),
        sum(row.events for row in rows), max(row.deepest_mm for row in rows), sum(row.unavoided for row in rows),
        rows[0].energy, rows[-1].energy, float(drawn.mean()), float(np.quantile(drawn, 0.99)), float(time.mean()),
        float(np.mean([row.joints for row in rows])),
        float(np.mean([row.iterations if row.pairs else 0 for row in rows])),
        100.0 * sum(row.ik_ms for row in rows) / whole, float(np.mean([row.pairs for row in rows])),
        100.0 * sum(row.query_ms for row in rows) / whole,
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
    whole = [row.milliseconds + row.drawing_ms for row in rows]
    below.plot(time, whole, color="#bbbbbb", linewidth=0.8, label="with drawing")
    below.plot(time, [row.milliseconds for row in rows], color="#444444", linewidth=0.8, label="whole frame")
    below.plot(time, [row.query_ms for row in rows], color="#009e73", linewidth=0.8, label="the figure's queries")
    touching = [row.pairs > 0 for row in rows]
    below.fill_between(time, 0.0, 1.0, where=touching, step="mid", transform=below.get_xaxis_transform(),
                       color="#e6eef5", linewidth=0.0)  # fmt: skip
    below.axhline(1e3 * dt, color="#d55e00", linewidth=0.8, linestyle="--", label="real time")
    below.set(ylabel="frame time [ms]", xlabel="time [s] (shaded: the wanted posture is inside of something)")
    below.set_ylim(0.0, 1.3 * max(float(np.quantile(whole, 0.995)), 1e3 * dt))
    below.legend(loc="upper right", frameon=False, ncols=4, fontsize=8)
    return plot_style.save(drawn, path)


def report(rows: Sequence[WorldRow], facts: Mapping[str, str]) -> str:
    """Table 2 of Schmidl and Lin with things that move, as Markdown."""
    return render("world_scenes.md", rows=rows, paper=PAPER, facts=facts)
