"""Drags measured: a row a method, and a row a frame for the chart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wholebody.bench import plot_style
from wholebody.bench.report import render
from wholebody.bench.tables import filled, of
from wholebody.tracking.dragging import Dragged, DragJudgement

ALLOWED = 1e-3  # m: of overlap, in a frame and on the way to the next


@dataclass(frozen=True)
class DragFrameRow:
    """One frame; milliseconds, millimetres."""

    task: str
    method: str
    frame: int = field(metadata=of(lambda drag, judged, k: k))
    milliseconds: float = field(metadata=of(lambda drag, judged, k: 1e3 * drag.seconds[k]))
    cpu_ms: float = field(metadata=of(lambda drag, judged, k: 1e3 * drag.cpu_seconds[k]))
    iterations: int = field(metadata=of(lambda drag, judged, k: drag.iterations[k]))
    error_mm: float = field(metadata=of(lambda drag, judged, k: 1e3 * judged.error[k]))
    depth_mm: float = field(metadata=of(lambda drag, judged, k: 1e3 * judged.depth[k + 1]))
    between_mm: float = field(metadata=of(lambda drag, judged, k: 1e3 * judged.between[k]))


@dataclass(frozen=True)
class DragRow:
    """One drag; units in the names. `depth_mm` is of frames, start and end, `between_mm` a bound on the ways between.

    Attributes:
        error_mean_mm, error_max_mm: what was left to the goal in the frames.
        end_error_mm: what is left of it at the end.
        hold_mm: how far the worst constraint was off, mm or mrad.
        status: of the end.
    """

    task: str
    method: str
    frames: int = field(metadata=of(lambda drag, judged: len(drag)))
    mean_ms: float = field(metadata=of(lambda drag, judged: 1e3 * drag.seconds.mean()))
    p95_ms: float = field(metadata=of(lambda drag, judged: 1e3 * np.quantile(drag.seconds, 0.95)))
    max_ms: float = field(metadata=of(lambda drag, judged: 1e3 * drag.seconds.max()))
    cpu_mean_ms: float = field(metadata=of(lambda drag, judged: 1e3 * drag.cpu_seconds.mean()))
    iterations: float = field(metadata=of(lambda drag, judged: drag.iterations.mean()))
    error_mean_mm: float = field(metadata=of(lambda drag, judged: 1e3 * judged.error.mean()))
    error_max_mm: float = field(metadata=of(lambda drag, judged: 1e3 * judged.error.max()))
    end_error_mm: float
    depth_mm: float = field(metadata=of(lambda drag, judged: 1e3 * judged.depth.max()))
    between_mm: float = field(metadata=of(lambda drag, judged: 1e3 * judged.between.max()))
    limit_rad: float = field(metadata=of(lambda drag, judged: max(0.0, judged.limit_violation)))
    hold_mm: float = field(metadata=of(lambda drag, judged: 1e3 * judged.constraint_violation.max()))
    jerk: float = field(metadata=of(lambda drag, judged: np.median(judged.jerk) if len(judged.jerk) else 0.0))
    status: str = field(metadata=of(lambda drag, judged: drag.end.status))

    @property
    def clean(self) -> bool:
        """Whether limits were kept and nothing was penetrated or passed."""
        return max(self.depth_mm, self.between_mm) <= 1e3 * ALLOWED and self.limit_rad <= 1e-6

    @property
    def cells(self) -> tuple[str, ...]:
        """The row as text, in the order of the table's columns."""
        between = f"{self.between_mm:.2g}" if np.isfinite(self.between_mm) else "passes"
        return (
            self.task, self.method, str(self.frames), f"{self.mean_ms:.2f}", f"{self.p95_ms:.2f}",
            f"{self.max_ms:.1f}", f"{self.cpu_mean_ms:.2f}", f"{self.iterations:.1f}", f"{self.error_mean_mm:.3f}",
            f"{self.error_max_mm:.2f}", f"{self.end_error_mm:.1e}", f"{self.depth_mm:.4f}", between,
            f"{self.limit_rad:.0e}", f"{self.hold_mm:.3f}", f"{self.jerk:.2g}", self.status,
        )  # fmt: skip


def drag_summary(task: str, dragged: Dragged, judged: DragJudgement) -> DragRow:
    """The row of one drag."""
    end = dragged.end.assessment
    return filled(DragRow, dragged, judged, task=task, end_error_mm=1e3 * max(end.goal_error, end.goal_angle))


def drag_frames(task: str, dragged: Dragged, judged: DragJudgement) -> list[DragFrameRow]:
    """The rows of all frames."""
    return [filled(DragFrameRow, dragged, judged, k, task=task) for k in range(len(dragged))]


def drag_report(rows: Sequence[DragRow], facts: Mapping[str, str]) -> str:
    """The table as Markdown."""
    return render("drag.md", rows=rows, facts=facts)


def drag_chart(drags: Mapping[str, Sequence[DragFrameRow]], path: Path) -> tuple[Path, Path]:
    """Frame time and what is left to the goal over the frames, of one method or several."""
    chart, axes = plot_style.figure(2, 1, (7.6, 4.8))
    above, below = axes[0][0], axes[1][0]
    for method, rows in drags.items():
        frame = [row.frame for row in rows]
        color = plot_style.method_style(method).color
        above.plot(frame, [row.milliseconds for row in rows], color=color, linewidth=0.8, alpha=0.35)
        above.plot(frame, [max(row.cpu_ms, 1e-3) for row in rows], color=color, linewidth=1.2, label=method)
        below.plot(frame, [max(row.error_mm, 1e-6) for row in rows], color=color, linewidth=1.0)
    above.set(yscale="log", ylabel="frame time [ms]\nprocessor; pale: wall")
    above.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, ncols=3, fontsize=8)
    first = next(iter(drags.values()))
    above.set_title(f"{first[0].task.replace('_', ' ')}, dragged", loc="left")
    below.set(yscale="log", ylabel="left to the goal [mm]", xlabel="frame")
    for axis in (above, below):
        axis.set_xlim(0, max(len(first) - 1, 1))
    return plot_style.save(chart, path)
