"""Corrects what a method left: frames and motions between frames, and what is too rough, in windows of all frames.

Methods that make posture after posture leave motions that dip between two free frames, frames in which contact and what
is held contradict each other, and kinks where contact begins and interpolation ends. All are corrected by the program
of the method "trajectory", which begins at the method's postures, so on the sides of things that they are on:

- `repaired` finds the least smooth change of a few tenths of a second around each fault, with rows of contact in every
  frame and at the places between frames that dip. What passes right through something is kept on one side before.
- `smoothed` minimises the deviation from the original and its acceleration around what is beyond `MotionBounds`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.motion.avoider import Run
from wholebody.motion.faults import Faults, dip_depth, dips
from wholebody.motion.measures import MotionBounds, excess
from wholebody.motion.one_side import SHALLOW, keep_back, one_sided
from wholebody.motion.trajectory.deviations import Chart, Objective
from wholebody.motion.trajectory.nodes import NEAREST, Node, NodeEvaluator
from wholebody.motion.trajectory.program import Limits
from wholebody.motion.trajectory.sqp import WindowProgram
from wholebody.motion.trajectory.window_run import ClipRun
from wholebody.motion.windows import Window


@dataclass(frozen=True)
class RepairSettings:
    """Numbers of the repair.

    Attributes:
        margin: seconds before and after a fault in which postures may change; doubled in each round.
        rounds: of looking at the clip and repairing what is wrong.
        added: rounds of sweeping one window and adding the places that dip.
        programs: most of one round of a window; more = more that is freed, longer where nothing can be.
        radius: first trust region, radians and metres; postures are nearly free.
        through: metres, as thick as a forearm; no rows free a deeper dip, of a limb that goes right through.
        spread: seconds that a push at one frame spreads over.
    """

    margin: float = 0.1
    rounds: int = 4
    added: int = 6
    programs: int = 12
    radius: float = 0.05
    through: float = 0.06
    spread: float = 0.06


SETTINGS = RepairSettings()


def repaired(run: Run, q: Array) -> Array:
    """Postures (n, nq) with less that is wrong; others are the given ones but for those beside something passed.

    Args:
        run: of the clip; is told of every window.
        q: (n, nq) postures; they stay as they are.
    """
    q = one_sided(run, np.array(q))
    for number in range(SETTINGS.rounds):
        found = run.faults(q)
        # what rows cannot free, and later what they did not free
        deep = SHALLOW if number else SETTINGS.through
        changed = [_kept_back(run, q, gap, deep) for gap in found.gaps]
        if run.ended:
            return q
        found = run.faults(q) if any(changed) else found
        for window in run.windows(found.frames, SETTINGS.margin * 2**number, 2):
            if run.watch.tell(1.0, f"frames {window.first} to {window.end - 1} are repaired"):
                return q
            changed.append(_repair(run, window, q))
        if not any(changed) and number:
            break
    return q


def _kept_back(run: Run, q: Array, gap: int, deep: float) -> bool:
    """Keep frames beside a gap that is deeper on one side of what it passes, in place; whether that succeeded."""
    if run.ended or dip_depth(run.workspace, q[gap], q[gap + 1]) <= deep:
        return False
    note = f"what passes after frame {gap} is kept on one side"
    return keep_back(run, q, gap, len(q), cancelled=lambda: run.watch.tell(1.0, note))


def _repair(run: Run, window: Window, q: Array) -> bool:
    """Repair one window of q (n, nq) in place; whether it is better than before."""
    terms, workspace = run.terms, run.workspace
    chart = Chart(workspace.model, q[window.first : window.end].copy())
    seams = window.first > 0, window.end < len(q)
    objective = Objective(len(window), np.ones(workspace.model.nv), SETTINGS.spread, terms.dt, seams)
    held = [terms.held(frame) for frame in range(window.first, window.end)]
    evaluator = NodeEvaluator(workspace, chart, held, run.clearance)
    limits = Limits.of(terms, chart, window.first, seams)
    program = WindowProgram(evaluator, objective, limits, SETTINGS.programs)

    def looked_at(postures: Array) -> tuple[Faults, dict[int, list[float]]]:
        found = run.faults(postures, window.first)
        return found, dips(workspace, postures, found.gaps)

    x, best = np.zeros((len(window), workspace.model.nv)), chart.original.copy()
    found, dipping = looked_at(best)
    before = least = found.number
    for number in range(SETTINGS.added):
        places = [(gap, at) for gap, shares in dipping.items() for at in shares]
        program.add([Node(gap, float(np.clip(at, NEAREST, 1.0 - NEAREST))) for gap, at in places])
        answer = program.run(x, lambda count, worst: False, SETTINGS.radius)
        run.work.programs += answer.programs
        x, postures, moved = answer.x, chart.original.copy(), (answer.x != 0.0).any(axis=1)
        postures[moved] = chart.postures(x)[moved]
        found, dipping = looked_at(postures)
        if found.number < least:
            least, best = found.number, postures
        if not dipping or (number and not answer.met):
            break
    q[window.first : window.end] = best
    return least < before


class Smoothed(NamedTuple):
    """Smoother postures.

    Attributes:
        q: (n, nq) postures; the given ones where none are found that are as free.
        windows: how many windows were made smooth.
    """

    q: Array
    windows: int


def smoothed(run: Run, q: Array, asked: MotionBounds) -> Smoothed:
    """Make postures smooth where they are beyond bounds on jerk, speed and deviation.

    Args:
        run: of the clip; is told of every window.
        q: (n, nq) postures made of it; they stay as they are.
        asked: bounds, resolved for the clip.
    """
    q, count, clip, terms = np.array(q), 0, run.clip, run.terms
    beyond = excess(clip, clip.with_q(q), asked).beyond
    if not beyond.any():
        return Smoothed(q, 0)
    found = run.faults(terms.q)
    for time in (None, 0.2, 0.4):  # s: the smoothness of the method "trajectory", and more where its jerk is beyond
        windows = ClipRun(run, terms.q, time)
        for window in run.windows(beyond, 0.5):
            frames = slice(window.first, window.end)
            if not run.ended:
                told = run.watch.teller(1.0, 0.0, f"frames {window.first} to {window.end - 1} are made smooth")
                smooth = windows.window(window, found, told, q)
                if not smooth.missed and not run.ended:
                    q[frames], count = smooth.q, count + 1
        beyond = excess(clip, clip.with_q(q), asked).beyond
        if not beyond.any() or run.ended:
            break
    return Smoothed(q, count)
