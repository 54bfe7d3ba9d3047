"""Drags of the human's hand by sparse Newton, frame by frame."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

import wholebody as wb
from wholebody.methods.newton.tracking import NewtonTracker

TABLE_TOP = 0.74  # m
TOUCHING = 1e-4  # m: nearer than this counts as contact


@dataclass(frozen=True)
class DragRow:
    """A drag.

    Attributes:
        case: what.
        frames: how many.
        ms, ms_95: time of a frame that half and 95 % of the frames stay below [ms].
        iterations: Newton iterations a frame, mean.
        touching: share of the frames after which the hand touches the table.
        structures: patterns laid out: contacts that come or go in combinations not met before.
        structure_ms: time of each [ms].
        drift: greatest error of a constraint after any frame [m or rad].
        deepest: deepest overlap with the table after any frame [m].
    """

    case: str
    frames: int
    ms: float
    ms_95: float
    iterations: float
    touching: float
    structures: int
    structure_ms: float
    drift: float
    deepest: float


def drag_row(frames: int, contacts: bool) -> DragRow:
    """A drag of the right hand in an upright circle; with contacts, its lower part lies under a table's top."""
    scene = wb.Scene(wb.load("human"))
    if contacts:
        scene.add(wb.Box((1.2, 0.7, 0.04)), name="table", at=(0.75, 0.0, TABLE_TOP - 0.02))
    start = np.array((0.45, -0.25, 0.9))
    holds = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    problem = wb.Problem(scene, "standing", goals=[wb.Point("right_index_tip", start)], constraints=holds)
    drag = wb.Drag(problem, wb.Newton())
    for _ in range(20):  # to the circle, which is not measured
        drag.to(start)
    low = TABLE_TOP - 0.02 if contacts else 0.8
    owners = scene.piece_owner
    table = np.array(["table" in (owners[a], owners[b]) for a, b in scene.pair_table.pairs], dtype=bool)
    times, iterations, drift, least, workspace = [], [], 0.0, [], scene.workspace()
    for k in range(frames):
        angle = 0.05 * k
        place = (0.45, -0.25 + 0.1 * np.sin(angle), low + 0.1 * (1.0 + np.cos(angle)))
        began = time.process_time()
        frame = drag.to(place)
        times.append(1e3 * (time.process_time() - began))
        iterations.append(frame.iterations)
        near = workspace.near(frame.q, 0.01)
        state = workspace.state
        for term in problem.constraints:
            drift = max(
                drift, float(np.abs(term.value(state) - np.clip(term.value(state), term.lower, term.upper)).max())
            )
        least.append(float(near.distance[table[near.number]].min(initial=np.inf)))
    distance = np.array(least)
    assert isinstance(drag.tracker, NewtonTracker)
    structures, seconds = drag.tracker.laid_out
    return DragRow(
        case="with a table under the lower part of the circle" if contacts else "free",
        frames=frames,
        ms=float(np.median(times)),
        ms_95=float(np.percentile(times, 95)),
        iterations=float(np.mean(iterations)),
        touching=float((distance < TOUCHING).mean()),
        structures=structures,
        structure_ms=1e3 * seconds / max(structures, 1),
        drift=drift,
        deepest=max(0.0, -float(distance.min(initial=np.inf))),
    )
