"""The worst frames of frame loops: what is left, how long it took, how far from the tracker, how sudden, and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wholebody.bench.interaction import DEEPEST, GOAL_MEAN, GOAL_P99, InteractionRow
from wholebody.bench.report import render
from wholebody.interaction.judging import IN_TIME, Judgement
from wholebody.interaction.recording import Recording

FAR = 0.2  # rad: root mean square over the joints, from which on a frame is called far from the tracked one


@dataclass(frozen=True)
class WorstFrames:
    """The worst frames of one scene by one method; numbers of frames count from 0.

    Attributes:
        row: the whole run.
        deepest, slowest, farthest, sudden: frames with the deepest overlap left, the longest time of the processor, the
            greatest distance between shown and tracked joints, and the greatest jerk.
        milliseconds: of the slowest.
        query_percent: its share of collision queries.
        iterations: its programs, goals or displacements.
        pairs: the overlapping pairs of its tracked posture.
        distance_rad: of the farthest.
        tracked_mm: how deep the farthest's tracked posture is inside of something.
        picture: the frame to look at where something is missed, else -1.
    """

    row: InteractionRow
    deepest: int
    slowest: int
    farthest: int
    sudden: int
    milliseconds: float
    query_percent: float
    iterations: int
    pairs: int
    distance_rad: float
    tracked_mm: float
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
    slowest, deepest = int(np.argmax(recording.cpu_seconds)), int(np.argmax(judged.depth))
    farthest = int(np.argmax(judged.distance))
    sudden = int(np.argmax(judged.jerk)) + 2 if len(judged.jerk) else 0
    seconds = float(recording.seconds[slowest])
    late = [frame for frame, after in judged.returns if after < 0 or after > IN_TIME]
    picture = -1
    if row.misses:
        picture = next(iter([*judged.passed, *late]), slowest if "ms" in " ".join(row.misses) else deepest)
    return WorstFrames(
        row=row,
        deepest=deepest,
        slowest=slowest,
        farthest=farthest,
        sudden=sudden,
        milliseconds=1e3 * float(recording.cpu_seconds[slowest]),
        query_percent=100.0 * float(recording.contact_seconds[slowest]) / max(seconds, 1e-9),
        iterations=int(recording.iterations[slowest]),
        pairs=int(judged.tracked_pairs[slowest]),
        distance_rad=float(judged.distance[farthest]),
        tracked_mm=1e3 * float(judged.tracked_depth[farthest]),
        picture=picture,
    )


def failures(worst: Sequence[WorstFrames], pictures: Sequence[tuple[WorstFrames, str]]) -> str:
    """The part of the page: a table, and a picture where a line is missed.

    Args:
        worst: of every scene and method.
        pictures: those with a picture, and where it is, as seen from the page.
    """
    return render("interaction_failures.md", worst=worst, pictures=pictures)
