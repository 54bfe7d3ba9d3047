"""Scenes in which things move by themselves, measured: a row a frame, a row a scene, and a chart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import pairwise
from pathlib import Path

import numpy as np

from wholebody.bench import plot_style
from wholebody.bench.measure.interaction import PAPER
from wholebody.bench.report import render
from wholebody.bench.tables import filled, of
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
    milliseconds: float = field(metadata=of(lambda frame: 1e3 * frame.seconds))
    energy: float = field(metadata=of(lambda frame: frame.engine.energy if frame.engine else 0.0))
    events: int = field(metadata=of(lambda frame: len(frame.engine.events) if frame.engine else 0))
    contacts: int = field(metadata=of(lambda frame: frame.engine.contacts if frame.engine else 0))
    sleeping: int = field(metadata=of(lambda frame: frame.engine.sleeping if frame.engine else 0))
    deepest_mm: float = field(metadata=of(lambda frame: 1e3 * _deepest(frame)))
    unavoided: int = field(metadata=of(lambda frame: len(frame.collisions)))
    drawing_ms: float
    query_ms: float = field(metadata=of(lambda frame: 1e3 * frame.loop.contact_seconds))
    ik_ms: float = field(metadata=of(lambda frame: 1e3 * frame.loop.solve_seconds))
    iterations: int = field(metadata=of(lambda frame: frame.loop.iterations))
    joints: int = field(metadata=of(lambda frame: frame.loop.joints))
    pairs: int
    note: str


@dataclass(frozen=True)
class WorldRow:
    """One scene; units in the names; iterations count in frames in which the tracked posture overlaps something."""

    scene: str
    bodies: int
    frames: int = field(metadata=of(lambda run: len(run["frame"])))
    median_ms: float = field(metadata=of(lambda run: np.median(run["milliseconds"])))
    p99_ms: float = field(metadata=of(lambda run: np.quantile(run["milliseconds"], 0.99)))
    max_ms: float = field(metadata=of(lambda run: run["milliseconds"].max()))
    events: int = field(metadata=of(lambda run: run["events"].sum()))
    deepest_mm: float = field(metadata=of(lambda run: run["deepest_mm"].max()))
    unavoided: int = field(metadata=of(lambda run: run["unavoided"].sum()))
    first_energy: float = field(metadata=of(lambda run: run["energy"][0]))
    last_energy: float = field(metadata=of(lambda run: run["energy"][-1]))
    drawn_mean_ms: float = field(metadata=of(lambda run: (run["milliseconds"] + run["drawing_ms"]).mean()))
    drawn_p99_ms: float = field(metadata=of(lambda run: np.quantile(run["milliseconds"] + run["drawing_ms"], 0.99)))
    mean_ms: float = field(metadata=of(lambda run: run["milliseconds"].mean()))
    joints: float = field(metadata=of(lambda run: run["joints"].mean()))
    iterations: float = field(metadata=of(lambda run: np.where(run["pairs"] > 0, run["iterations"], 0).mean()))
    ik_percent: float = field(metadata=of(lambda run: 100.0 * run["ik_ms"].sum() / run["milliseconds"].sum()))
    pairs: float = field(metadata=of(lambda run: run["pairs"].mean()))
    query_percent: float = field(metadata=of(lambda run: 100.0 * run["query_ms"].sum() / run["milliseconds"].sum()))


def _deepest(frame: WorldFrame) -> float:
    """Deepest overlap in a frame, of the figure or of what moves by itself, metres."""
    return max(frame.deepest, frame.engine.deepest if frame.engine else 0.0)


def frame_rows(
    scene: str, frames: Sequence[WorldFrame], drawing: Sequence[float], pairs: Sequence[int]
) -> list[WorldFrameRow]:
    """A row for each frame; `drawing` has the seconds that drawing it took, `pairs` what the wanted posture was in."""
    return [
        filled(WorldFrameRow, frame, scene=scene, frame=number, drawing_ms=1e3 * drawn, pairs=inside)
        for number, (frame, drawn, inside) in enumerate(zip(frames, drawing, pairs, strict=True))
    ]


def summary(bodies: int, rows: Sequence[WorldFrameRow]) -> WorldRow:
    """The row of a scene."""
    columns = {each.name: np.array([getattr(row, each.name) for row in rows]) for each in fields(WorldFrameRow)}
    return filled(WorldRow, columns, scene=rows[0].scene, bodies=bodies)


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
