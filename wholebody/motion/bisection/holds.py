"""After the recursion: what is held is made to hold in interpolated frames."""

from __future__ import annotations

from wholebody.motion.avoider import Watch
from wholebody.motion.bisection.prediction import Predictor
from wholebody.motion.bisection.recursion import Recursion


def hold_between(recursion: Recursion, predictor: Predictor, changed: list[int], watch: Watch) -> list[int]:
    """Move interpolated frames to the nearest posture in which everything holds; returns those that have none."""
    failed = []
    for number, frame in enumerate(changed):
        q = recursion.q[frame]
        if predictor.holds(frame, q):
            continue
        if watch.tell(number / len(changed), f"holds of frame {frame}"):
            break
        found = predictor.predict(frame, q, effort_from=q)
        recursion.predictions += 1
        recursion.programs += found.programs
        if found.good:
            recursion.q[frame] = found.q
        else:
            failed.append(frame)
    return failed
