"""Motions frame by frame, for `wholebody drag`, `interact` and `world`: a row a frame, a row a run, and a chart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.bench.rows import Figure, Panel, Row, report, texts
from wholebody.dynamics.world import WorldFrame
from wholebody.tracking.dragging import Dragged, DragJudgement
from wholebody.tracking.recording import Judgement, Recording


def _run(case: str, tool: str, figures: Mapping[str, Figure], columns: Mapping[str, Any]) -> tuple[Row, list[Row]]:
    """A row of a run, and a row for each of its frames from columns (frames,) by name."""
    lists = {name: np.asarray(column).tolist() for name, column in columns.items()}
    frames = [dict(zip(lists, each, strict=True)) for each in zip(*lists.values(), strict=True)]
    rows = [Row(case, tool, {"frame": number, **frame}) for number, frame in enumerate(frames)]
    return Row(case, tool, {"frames": len(rows), **figures}), rows


def _spent(milliseconds: Array, name: str = "") -> dict[str, Figure]:
    front = f"{name} " if name else ""
    return {
        f"{front}mean ms": float(milliseconds.mean()),
        f"{front}p95 ms": float(np.quantile(milliseconds, 0.95)),
        f"{front}p99 ms": float(np.quantile(milliseconds, 0.99)),
        f"{front}max ms": float(milliseconds.max()),
    }


def _jerk(values: Array) -> float:
    """Median of third differences of joint angles [rad/s^3]; 0 without any."""
    return float(np.median(values)) if len(values) else 0.0


def drag_rows(task: str, drag: Dragged, judged: DragJudgement) -> tuple[Row, list[Row]]:
    """A drag and its frames: "deepest" is of frames, start and end, "between" a bound on the motions between them."""
    columns = {
        "ms": 1e3 * drag.seconds,
        "CPU ms": 1e3 * drag.cpu_seconds,
        "iterations": drag.iterations,
        "error mm": 1e3 * judged.error,
        "deepest mm": 1e3 * judged.depth[1 : len(drag) + 1],
        "between mm": 1e3 * judged.between[: len(drag)],
    }
    end = drag.end.assessment
    figures: dict[str, Figure] = {
        **_spent(1e3 * drag.seconds),
        "CPU mean ms": 1e3 * float(drag.cpu_seconds.mean()),
        "iterations": float(drag.iterations.mean()),
        "error mean mm": 1e3 * float(judged.error.mean()),
        "error max mm": 1e3 * float(judged.error.max()),
        "at the end mm": 1e3 * max(end.goal_error, end.goal_angle),
        "deepest mm": 1e3 * float(judged.depth.max()),
        "between mm": 1e3 * float(judged.between.max()),
        "beyond limits rad": max(0.0, judged.limit_violation),
        "holds off mm": 1e3 * float(judged.constraint_violation.max()),
        "jerk": _jerk(judged.jerk),
        "end": drag.end.status,
    }
    return _run(task, drag.method, figures, columns)


def is_clean(drag: Row) -> bool:
    """Whether a drag kept all limits, and nothing was penetrated or passed by more than a millimetre."""
    return bool(max(drag["deepest mm"], drag["between mm"]) <= 1.0 and drag["beyond limits rad"] <= 1e-6)


def loop_rows(scene: str, run: Recording, judged: Judgement) -> tuple[Row, list[Row]]:
    """A run of the frame loop and its frames; joints and iterations are counted as Schmidl and Lin count them."""
    columns = {
        "ms": 1e3 * run.seconds,
        "CPU ms": 1e3 * run.cpu_seconds,
        "queries ms": 1e3 * run.contact_seconds,
        "IK ms": 1e3 * run.solve_seconds,
        "iterations": run.iterations,
        "joints": run.joints,
        "pairs": run.pairs,
        "tracked pairs": judged.tracked_pairs,
        "deepest mm": 1e3 * judged.depth,
        "tracked deepest mm": 1e3 * judged.tracked_depth,
        "joints off rad": judged.distance,
        "root off mm": 1e3 * judged.root_distance,
        "note": run.notes,
    }
    late = [after for _, after in judged.returns]
    seconds = float(run.seconds.sum())
    figures: dict[str, Figure] = {
        **_spent(1e3 * run.seconds),
        **_spent(1e3 * run.cpu_seconds, "CPU"),
        "joints": float(run.joints.mean()),
        "iterations": float(np.where(run.pairs > 0, run.iterations, 0).mean()),
        "IK %": 100.0 * float(run.solve_seconds.sum()) / seconds,
        "pairs": float(judged.tracked_pairs.mean()),
        "queries %": 100.0 * float(run.contact_seconds.sum()) / seconds,
        "deepest mm": 1e3 * float(judged.depth.max()),
        "tracked deepest mm": 1e3 * float(judged.tracked_depth.max()),
        "frames that pass": len(judged.passed),
        "beyond limits rad": judged.limit_violation,
        "beyond cones rad": judged.cone_violation,
        "joints off rad": float(judged.distance.mean()),
        "root off mm": 1e3 * float(judged.root_distance.mean()),
        "jerk": _jerk(judged.jerk),
        "tracked jerk": _jerk(judged.tracked_jerk),
        "largest jerk": float(judged.jerk.max(initial=0.0)),
        "ends of contact": len(late),
        "back after frames": "never" if -1 in late else max(late, default=0),
        "frames with a note": sum(map(bool, run.notes)),
    }
    return _run(scene, run.overlap, figures, columns)


def is_held(run: Row) -> bool:
    """Whether a run kept limits and cones, passed through nothing, and was never deeper than a millimetre."""
    beyond = max(run["beyond limits rad"], run["beyond cones rad"])
    return bool(run["deepest mm"] <= 1.0 and not run["frames that pass"] and beyond < 1e-6)


def paper_report(about: str, rows: Sequence[Row], facts: Mapping[str, str]) -> str:
    """The table beside the paper's; `about` names a text of `texts.toml`."""
    paper = [Row(scene, "paper", figures) for scene, figures in texts()["paper"].items()]
    return report(texts()[about], {"": [*rows, *paper]}, facts)


def world_rows(
    scene: str, overlap: str, frames: Sequence[WorldFrame], drawing: Sequence[float], pairs: Sequence[int]
) -> tuple[Row, list[Row]]:
    """A run among moving things, and its frames; `drawing` [s] a frame, `pairs` that overlap in the wanted posture."""
    engines = [frame.engine for frame in frames]
    spent, drawn = 1e3 * np.array([frame.seconds for frame in frames]), 1e3 * np.array(drawing)
    loops = [frame.loop for frame in frames]
    queries = 1e3 * np.array([loop.contact_seconds for loop in loops])
    solving = 1e3 * np.array([loop.solve_seconds for loop in loops])
    columns: dict[str, Any] = {
        "ms": spent,
        "drawing ms": drawn,
        "queries ms": queries,
        "IK ms": solving,
        "energy J": [engine.energy if engine else 0.0 for engine in engines],
        "impacts": [len(engine.events) if engine else 0 for engine in engines],
        "contacts": [engine.contacts if engine else 0 for engine in engines],
        "sleeping": [engine.sleeping if engine else 0 for engine in engines],
        "deepest mm": [1e3 * max(frame.deepest, frame.engine.deepest if frame.engine else 0.0) for frame in frames],
        "not avoided": [len(frame.collisions) for frame in frames],
        "iterations": [loop.iterations for loop in loops],
        "joints": [loop.joints for loop in loops],
        "pairs": list(pairs),
        "note": [frame.note for frame in frames],
    }
    touching = np.array(pairs) > 0
    figures: dict[str, Figure] = {
        "bodies": len(frames[-1].placements),
        **_spent(spent),
        "with drawing mean ms": float((spent + drawn).mean()),
        "joints": float(np.mean(columns["joints"])),
        "iterations": float(np.where(touching, columns["iterations"], 0).mean()),
        "IK %": 100.0 * float(solving.sum() / spent.sum()),
        "pairs": float(np.mean(pairs)),
        "queries %": 100.0 * float(queries.sum() / spent.sum()),
        "impacts": int(np.sum(columns["impacts"])),
        "deepest mm": float(np.max(columns["deepest mm"])),
        "not avoided": int(np.sum(columns["not avoided"])),
        "energy J, first": columns["energy J"][0],
        "last": columns["energy J"][-1],
    }
    return _run(scene, overlap, figures, columns)


def frame_panels(rows: Sequence[Row], *groups: Sequence[str]) -> list[Panel]:
    """Some figures of frames over their numbers, a panel a group."""
    frames = [row["frame"] for row in rows]
    title = f"{rows[0].case.replace('_', ' ')}, {rows[0].tool}"
    return [
        Panel(title, "frame", ", ".join(names), {name: (frames, [row[name] for row in rows]) for name in names})
        for names in groups
    ]


def moments(frames: Sequence[WorldFrame]) -> list[int]:
    """Five frames, between which what moves by itself goes the same way each time."""
    names = frames[0].placements
    places = np.array([[frame.placements[name].translation for name in names] for frame in frames])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=2).sum(axis=1) if len(names) else np.zeros(len(frames) - 1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    chosen = np.searchsorted(travelled, travelled[-1] * np.array([0.02, 0.25, 0.5, 0.75, 1.0]))
    return [min(int(number), len(frames) - 1) for number in chosen]
