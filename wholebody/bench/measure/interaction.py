"""Frame loops measured: a row a scene, as in table 2 of Schmidl and Lin, a row a frame, and the worst frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wholebody.base.arrays import Array
from wholebody.bench import plot_style
from wholebody.bench.report import render
from wholebody.bench.tables import filled, of
from wholebody.tracking.judging import IN_TIME, Judgement
from wholebody.tracking.recording import Recording

PAPER = (
    ("two arms", "1496", "14.63", "16", "3", "12.7", "3", "17.4"),
    ("self-collision", "2327", "15.99", "28", "5", "14.6", "5", "21.1"),
    ("two arms and leg", "2440", "17.47", "32", "6", "16.7", "6", "24.8"),
    ("arm in corner", "2146", "20.49", "40", "7", "18.5", "13", "31.3"),
)
"""Table 2 of Schmidl and Lin, on a processor of 1.7 GHz: scene, frames, frame ms, joints, iterations, IK %, pairs,
collision queries %."""

GOAL_MEAN, GOAL_P99 = 8.0, 16.0  # ms
FAR = 0.2  # rad: root mean square over the joints, from which on a frame is called far from the tracked one
DEEPEST = {"qp": 0.1, "ccd": 1.0}  # mm


@dataclass(frozen=True)
class FrameRow:
    """One frame; milliseconds, millimetres, radians."""

    scene: str
    overlap: str
    frame: int = field(metadata=of(lambda run, judged, k: k))
    milliseconds: float = field(metadata=of(lambda run, judged, k: 1e3 * run.seconds[k]))
    cpu_ms: float = field(metadata=of(lambda run, judged, k: 1e3 * run.cpu_seconds[k]))
    contact_ms: float = field(metadata=of(lambda run, judged, k: 1e3 * run.contact_seconds[k]))
    solve_ms: float = field(metadata=of(lambda run, judged, k: 1e3 * run.solve_seconds[k]))
    iterations: int = field(metadata=of(lambda run, judged, k: run.iterations[k]))
    joints: int = field(metadata=of(lambda run, judged, k: run.joints[k]))
    pairs: int = field(metadata=of(lambda run, judged, k: run.pairs[k]))
    tracked_pairs: int = field(metadata=of(lambda run, judged, k: judged.tracked_pairs[k]))
    depth_mm: float = field(metadata=of(lambda run, judged, k: 1e3 * judged.depth[k]))
    tracked_depth_mm: float = field(metadata=of(lambda run, judged, k: 1e3 * judged.tracked_depth[k]))
    distance_rad: float = field(metadata=of(lambda run, judged, k: judged.distance[k]))
    root_distance_mm: float = field(metadata=of(lambda run, judged, k: 1e3 * judged.root_distance[k]))
    note: str = field(metadata=of(lambda run, judged, k: run.notes[k]))


def _median(values: Array) -> float:
    return float(np.median(values)) if len(values) else 0.0


@dataclass(frozen=True)
class InteractionRow:
    """One scene by one method; units in the names, counts are means over the frames."""

    scene: str
    overlap: str
    frames: int = field(metadata=of(lambda run, judged: len(run)))
    mean_ms: float = field(metadata=of(lambda run, judged: 1e3 * run.seconds.mean()))
    p95_ms: float = field(metadata=of(lambda run, judged: 1e3 * np.quantile(run.seconds, 0.95)))
    p99_ms: float = field(metadata=of(lambda run, judged: 1e3 * np.quantile(run.seconds, 0.99)))
    max_ms: float = field(metadata=of(lambda run, judged: 1e3 * run.seconds.max()))
    cpu_mean_ms: float = field(metadata=of(lambda run, judged: 1e3 * run.cpu_seconds.mean()))
    cpu_p99_ms: float = field(metadata=of(lambda run, judged: 1e3 * np.quantile(run.cpu_seconds, 0.99)))
    joints: float = field(metadata=of(lambda run, judged: run.joints.mean()))
    iterations: float = field(metadata=of(lambda run, judged: np.where(run.pairs > 0, run.iterations, 0).mean()))
    ik_percent: float = field(metadata=of(lambda run, judged: 100.0 * run.solve_seconds.sum() / run.seconds.sum()))
    tracked_pairs: float = field(metadata=of(lambda run, judged: judged.tracked_pairs.mean()))
    query_percent: float = field(metadata=of(lambda run, judged: 100.0 * run.contact_seconds.sum() / run.seconds.sum()))
    depth_mm: float = field(metadata=of(lambda run, judged: 1e3 * judged.depth.max()))
    tracked_depth_mm: float = field(metadata=of(lambda run, judged: 1e3 * judged.tracked_depth.max()))
    passed: int = field(metadata=of(lambda run, judged: len(judged.passed)))
    limit_rad: float = field(metadata=of(lambda run, judged: judged.limit_violation))
    cone_rad: float = field(metadata=of(lambda run, judged: judged.cone_violation))
    distance_rad: float = field(metadata=of(lambda run, judged: judged.distance.mean()))
    root_distance_mm: float = field(metadata=of(lambda run, judged: 1e3 * judged.root_distance.mean()))
    jerk: float = field(metadata=of(lambda run, judged: _median(judged.jerk)))
    tracked_jerk: float = field(metadata=of(lambda run, judged: _median(judged.tracked_jerk)))
    worst_jerk: float = field(metadata=of(lambda run, judged: judged.jerk.max(initial=0.0)))
    returns: int = field(metadata=of(lambda run, judged: len(judged.returns)))
    latest: int
    noted: int = field(metadata=of(lambda run, judged: sum(map(bool, run.notes))))

    @property
    def misses(self) -> list[str]:
        """What was asked of every scene and is not so here; times are the processor's, for others may work beside."""
        late = self.latest < 0 or self.latest > IN_TIME
        asked = (
            (self.cpu_mean_ms > GOAL_MEAN, f"mean {self.cpu_mean_ms:.1f} ms"),
            (self.cpu_p99_ms > GOAL_P99, f"p99 {self.cpu_p99_ms:.1f} ms"),
            (self.depth_mm > DEEPEST[self.overlap], f"{self.depth_mm:.2f} mm deep"),
            (self.passed > 0, f"{self.passed} frames pass"),
            (max(self.limit_rad, self.cone_rad) > 1e-6, "out of limits or cones"),
            (bool(self.returns) and late, "late after contact"),
        )
        return [text for missed, text in asked if missed]


def summary(scene: str, recording: Recording, judged: Judgement) -> InteractionRow:
    """The row of one run."""
    late = [frames for _, frames in judged.returns]
    latest = -1 if -1 in late else max(late, default=0)
    return filled(InteractionRow, recording, judged, scene=scene, latest=latest)


def frame_rows(scene: str, recording: Recording, judged: Judgement) -> list[FrameRow]:
    """The rows of all frames."""
    return [filled(FrameRow, recording, judged, k, scene=scene) for k in range(len(recording))]


def frame_chart(rows: Sequence[FrameRow], path: Path) -> tuple[Path, Path]:
    """Frame time over frames, as figures 7 and 8 of the paper; shaded where the tracked posture overlaps."""
    chart, axes = plot_style.figure(2, 1, (7.6, 4.4))
    frame = np.array([row.frame for row in rows])
    time = np.array([row.milliseconds for row in rows])
    above, below = axes[0][0], axes[1][0]
    touching = np.array([row.tracked_pairs > 0 for row in rows])
    for axis in (above, below):
        axis.fill_between(frame, 0.0, 1.0, where=touching, step="mid", transform=axis.get_xaxis_transform(),
                          color="#e6eef5", linewidth=0.0)  # fmt: skip
        axis.set_xlim(0, max(len(rows) - 1, 1))
    above.plot(frame, time, color=plot_style.COLORS["wholebody"], linewidth=0.8, label="whole frame")
    queries = [row.contact_ms for row in rows]
    above.plot(frame, queries, color="#d55e00", linewidth=0.8, label="collision queries")
    above.set(ylim=(0.0, 1.25 * max(float(np.quantile(time, 0.995)), 1e-3)), ylabel="frame time [ms]")
    above.legend(loc="upper right", frameon=False, ncols=2, fontsize=8)
    above.set_title(f"{rows[0].scene.replace('_', ' ')}, overlap removed by {rows[0].overlap}", loc="left")
    tracked = [row.tracked_depth_mm for row in rows]
    below.plot(frame, tracked, color="#666666", linewidth=1.0, label="tracked posture")
    below.plot(frame, [row.depth_mm for row in rows], color="#009e73", linewidth=1.4, label="shown posture")
    below.set(ylabel="deepest overlap [mm]", xlabel="frame (shaded: the tracked posture is inside of something)")
    below.legend(loc="upper right", frameon=False, ncols=2, fontsize=8)
    return plot_style.save(chart, path)


def report(rows: Sequence[InteractionRow], facts: Mapping[str, str]) -> str:
    """Both tables beside the paper's, as Markdown."""
    goals = {"mean": GOAL_MEAN, "p99": GOAL_P99, "deepest": DEEPEST, "back": IN_TIME}
    return render("interaction.md", rows=rows, paper=PAPER, goals=goals, facts=facts)


@dataclass(frozen=True)
class WorstFrames:
    """The worst frames of one scene by one method; numbers of frames count from 0.

    Attributes:
        row: the whole run.
        deepest, slowest, farthest, sudden: frames with the deepest overlap left, the longest time of the processor, the
            greatest distance between shown and tracked joints, and the greatest jerk.
        milliseconds, query_percent, iterations, pairs: of the slowest: time, share of collision queries in it,
            programs, goals or displacements, and overlapping pairs of the tracked posture.
        distance_rad, tracked_mm: of the farthest; the second is how deep its tracked posture is inside of something.
        picture: the frame to look at where something is missed, else -1.
    """

    row: InteractionRow
    deepest: int = field(metadata=of(lambda run, judged: judged.depth.argmax()))
    slowest: int = field(metadata=of(lambda run, judged: run.cpu_seconds.argmax()))
    farthest: int = field(metadata=of(lambda run, judged: judged.distance.argmax()))
    sudden: int = field(metadata=of(lambda run, judged: judged.jerk.argmax() + 2 if len(judged.jerk) else 0))
    milliseconds: float = field(metadata=of(lambda run, judged: 1e3 * run.cpu_seconds.max()))
    query_percent: float
    iterations: int = field(metadata=of(lambda run, judged: run.iterations[run.cpu_seconds.argmax()]))
    pairs: int = field(metadata=of(lambda run, judged: judged.tracked_pairs[run.cpu_seconds.argmax()]))
    distance_rad: float = field(metadata=of(lambda run, judged: judged.distance.max()))
    tracked_mm: float = field(metadata=of(lambda run, judged: 1e3 * judged.tracked_depth[judged.distance.argmax()]))
    picture: int

    @property
    def why(self) -> str:
        """One sentence."""
        row = self.row
        if row.cpu_mean_ms > GOAL_MEAN or row.cpu_p99_ms > GOAL_P99:
            return (
                f"slow where much is in contact: frame {self.slowest} has {self.pairs} overlapping pairs to leave and "
                f"takes {self.iterations} rounds, {self.query_percent:.0f} % of its time are collision queries"
            )
        if row.passed or row.depth_mm > DEEPEST[row.overlap]:
            return (
                f"in frame {self.deepest} limbs hinder each other, and what frees one of them is not found within the "
                "work of a frame"
            )
        if row.misses:
            return "limbs that folded in contact do not find the way back by drawing joints, which is local"
        if self.distance_rad > FAR:
            return (
                f"no line is missed; far from the tracked posture, which is {self.tracked_mm:.0f} mm inside, because "
                "limbs have to fold"
            )
        return "no line is missed"


def worst_frames(row: InteractionRow, recording: Recording, judged: Judgement) -> WorstFrames:
    """Find them in one run."""
    slowest, deepest = int(recording.cpu_seconds.argmax()), int(judged.depth.argmax())
    late = [frame for frame, after in judged.returns if after < 0 or after > IN_TIME]
    picture = -1
    if row.misses:
        picture = next(iter([*judged.passed, *late]), slowest if "ms" in " ".join(row.misses) else deepest)
    queries = recording.contact_seconds[slowest] / max(recording.seconds[slowest], 1e-9)
    return filled(WorstFrames, recording, judged, row=row, query_percent=100.0 * float(queries), picture=picture)


def failures(worst: Sequence[WorstFrames], pictures: Sequence[tuple[WorstFrames, str]]) -> str:
    """The part of the page: a table, and a picture, given by its path from the page, where a line is missed."""
    return render("interaction_failures.md", worst=worst, pictures=pictures)
