"""Terms of one's own that are not finite, or answer something odd, in a part of the space that a solve goes through.

The goal leads through that part or into it. Whatever a method or the assessment answers, no number that is not finite
may be called met, and an odd answer is refused by one sentence. Ours judges by the place of the frame alone.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.bench.attack.case import Verdict, Written
from wholebody.problem import Problem
from wholebody.solution import Solution

PARTS = ("error", "jacobian", "value", "slope", "measure", "gradient", "curvature")
BAD = ("np.nan", "np.inf", "-np.inf", "'far'", "None", "1j", "np.zeros((2, 2))")
FIGURES = (("'human'", "right_index_tip"), ("'human', detail='spheres'", "left_palm"), ("'avatar'", "right_palm"))
METHODS = ("'qp'", "'qp'", "'newton'", "'dls'", "'tracker'")

SCRIPT = '''"""A term whose {part} is {bad} beyond {reach:.3f} m."""

from time import process_time

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.bench.attack import own_terms
from wholebody.figures.state import Wrench

WAY, REACH, PART, BAD = np.array({way!r}), {reach!r}, {part!r}, {bad}


class Own:
    def __init__(self, tip=None):
        self.tip = tip

    def resolve(self, scene, start):
        index = scene.figure.frame_id({frame!r})
        place = scene.state(start).frame(index).translation.copy()
        return type(self)((index, scene.model.frames[index].parentJoint, place))

    def answer(self, part, state, usual):
        far = (state.frame(self.tip[0]).translation - self.tip[2]) @ WAY > REACH * np.linalg.norm(WAY)
        if part != PART or not far:
            return usual
        return usual * BAD if isinstance(BAD, float) else BAD


class Reach(Own, wb.Goal):
    def error(self, state):
        return self.answer("error", state, state.frame(self.tip[0]).translation - self.tip[2] - WAY)

    def jacobian(self, state):
        x, y, z = state.frame(self.tip[0]).translation
        rows = np.array([[1.0, 0, 0, 0, z, -y], [0, 1.0, 0, -z, 0, x], [0, 0, 1.0, y, -x, 0]])
        return Wrench(self.answer("jacobian", state, rows), self.tip[1])


class Keep(Own, wb.Constraint):
    def value(self, state):
        return self.answer("value", state, np.ones(1))

    def jacobian(self, state):
        return self.answer("slope", state, np.full((1, state.model.nv), 1e-9))


class Low(Own, wb.Measure):
    def value(self, state):
        return self.answer("measure", state, 0.5 * float(state.q[7:] @ state.q[7:]))

    def gradient(self, state):
        return self.answer("gradient", state, np.concatenate([np.full(6, 1e-9), state.q[7:]]))

    def curvature(self, state):
        return self.answer("curvature", state, np.ones(state.model.nv))


scene = wb.Scene(wb.load({figure}))
constraints = [] if {method} == "dls" else [Keep()]
problem = wb.Problem(scene, goals=[Reach()], constraints=constraints, measures=[Low()])
began = process_time()
if {method} == "tracker":
    tracker, q = wb.QP().tracker(problem, 0.05), problem.start
    for _ in range(30):
        q = tracker.step(q).q
    verdict = own_terms.tracked(problem, q, {frame!r}, WAY, REACH)
else:
    solution = wb.solve(problem, method={method})
    verdict = own_terms.judged(problem, solution, {frame!r}, WAY, REACH, seconds=process_time() - began)
print(verdict)
'''


def written(rng: np.random.Generator) -> Written:
    """Write a case."""
    figure, frame = FIGURES[int(rng.integers(len(FIGURES)))]
    part, bad = str(rng.choice(PARTS)), BAD[int(rng.integers(len(BAD)))]
    way = rng.normal(size=3) * (1.0, 1.0, 0.5)
    way *= rng.uniform(0.1, 0.5) / np.linalg.norm(way)
    reach = float(rng.uniform(0.2, 0.98) * np.linalg.norm(way))
    script = SCRIPT.format(
        figure=figure, frame=frame, part=part, bad=bad, way=way.tolist(), reach=reach,
        method=METHODS[int(rng.integers(len(METHODS)))],
    )  # fmt: skip
    return Written(script)


def judged(problem: Problem, solution: Solution, frame: str, way: Array, reach: float, *, seconds: float) -> Verdict:
    """Judge an answer: it may not lie where a term is not defined, and may be called solved at the goal alone."""
    moved, away = _moved(problem, solution.q, frame), float(np.linalg.norm(way))
    words = f"{solution.method} says {solution.status!r} {1e3 * np.linalg.norm(moved - way):.3g} mm from the goal"
    if not np.isfinite(solution.q).all() or moved @ way / away > reach + 1e-6:
        return Verdict("wrong", f"{words}, where a term is not defined", seconds, solution.status)
    if solution.status != "stalled" or "of iteration" not in solution.message:
        return Verdict("wrong", f"{words}, and does not name the term: {solution.message}", seconds, solution.status)
    return Verdict("right", words, seconds, solution.status)


def tracked(problem: Problem, q: Array, frame: str, way: Array, reach: float) -> Verdict:
    """Judge where a tracker ended (nq,): not where a term is not defined."""
    if not np.isfinite(q).all() or _moved(problem, q, frame) @ way / np.linalg.norm(way) > reach + 1e-6:
        return Verdict("wrong", "tracked to where a term is not defined")
    return Verdict("right", "tracked to before where a term is not defined")


def _moved(problem: Problem, q: Array, frame: str) -> Array:
    """How far a frame is from where it was at the start (3,), by Pinocchio alone."""
    model = problem.scene.model
    data, index, places = model.createData(), model.getFrameId(frame), []
    for posture in (problem.start, q):
        pin.framesForwardKinematics(model, data, posture)
        places.append(data.oMf[index].translation.copy())
    return np.asarray(places[1] - places[0])
