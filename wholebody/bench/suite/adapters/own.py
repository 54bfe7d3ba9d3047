"""Our own methods as they take part: qp, newton in three variants, ccd and dls."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench.measure.track import SETTING, Track
from wholebody.bench.suite.adapters.base import FEASIBILITY_ONLY, LADDER, Adapter, Tool, few, made
from wholebody.figures.state import State, Wrench
from wholebody.methods.base import Method
from wholebody.methods.qp.method import QP
from wholebody.methods.qp.step_program import QPStep
from wholebody.scene.scene import Scene
from wholebody.tasks.base import Goal, filled
from wholebody.tasks.frame import point_rows

RETARGET = "retarget"
"""The tool with a new `Point` and `Problem.retarget` at each step, where the other moves a target in place."""

NEWTONS: dict[str, dict[str, Any]] = {
    "slack": {"inequalities": "slack"},
    "barrier": {"inequalities": "barrier"},
    "kkt": {"inequalities": "slack", "algebra": "kkt"},
}
"""The variants of newton, as arguments of `Newton`."""


def qp_adapter(solver: str = "") -> Adapter:
    """The QP method as it comes, or with every program by a solver."""
    settings = {"solver": solver} if solver else {}
    exact = (3e-2, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8)
    return Adapter(
        name=f"qp/{solver}" if solver else "qp",
        make=partial(_qp, settings),
        loose=(*((tolerance, FEASIBILITY_ONLY) for tolerance in exact), *LADDER[1:]),
    )


def one_start(family: str) -> Adapter:
    """The method of "qp", "newton" or "ccd" that has one start, as methods have that know no other."""
    known: dict[str, tuple[Adapter, Callable[..., Method]]] = {
        "qp": (qp_adapter(), partial(QP, budget=0, restarts=0)),
        "newton": (newton_adapter("slack"), partial(wb.methods.Newton, restarts=0)),
        "ccd": (ccd_adapter(), partial(wb.methods.CCD, restarts=0)),
    }
    adapter, kind = known[family]
    return replace(
        adapter,
        name=f"{family}/one_start",
        make=partial(made, kind, {}),
        loose=tuple(level for level in adapter.loose if level[1] != FEASIBILITY_ONLY),
    )


def ccd_adapter() -> Adapter:
    """Cyclic coordinate descent."""
    return Adapter("ccd", partial(made, wb.methods.CCD, {"restarts": 0}), (*few(2, 5, 20), *LADDER[:8]))


def dls_adapter() -> Adapter:
    """Damped least squares, the textbook baseline."""
    return Adapter("dls", partial(made, wb.methods.DampedLeastSquares, {}), (*few(2, 3, 4, 6), *LADDER))


def newton_adapter(way: str) -> Adapter:
    """Sparse Newton in full coordinates, in one of the variants of `NEWTONS`."""
    make = partial(made, partial(wb.methods.Newton, **NEWTONS[way]), {"restarts": 0})
    return Adapter(f"newton/{way}", make, (*few(3, 6, 12, 25), *LADDER[1:]))


def _qp(settings: dict[str, Any], tolerance: float, iterations: int | None) -> Method:
    if iterations is None or iterations == FEASIBILITY_ONLY:
        return QP(**settings, tolerance=tolerance, measures=iterations is None)
    return QP(**settings, tolerance=tolerance, iterations=iterations, budget=0, restarts=0)


class MovingPoint(Goal):
    """The origin of a frame at a place that moves: write the place into `target`, shape (3,)."""

    def __init__(self, frame: str, target: Array) -> None:
        """Name the frame; the array is kept, not copied."""
        self.frame, self.target = frame, target
        self._id = self._joint = 0

    def resolve(self, scene: Scene, start: Array) -> MovingPoint:
        """Find the frame."""
        index = scene.figure.frame_id(self.frame)
        return filled(self, _id=index, _joint=int(scene.model.frames[index].parentJoint))

    def error(self, state: State) -> Array:
        """(3,) from the target to the frame [m]."""
        return np.asarray(state.frame(self._id).translation - self.target)

    def jacobian(self, state: State) -> Wrench:
        """Three forces along the world's axes, through the frame's origin."""
        return self.value_and_jacobian(state, self.error)[1]

    def value_and_jacobian(self, state: State, value: Callable[[State], Array]) -> tuple[Array, Wrench]:
        """Both, from one look at the frame."""
        place = state.frame(self._id).translation
        return place - self.target, Wrench(point_rows(place), self._joint)


def reach_problem(track: Track, goal: Goal) -> wb.Problem:
    """The problem of a reach with its feet and bounds on speed."""
    speed, turn = (SETTING.root_speed, SETTING.root_turn) if track.floating else (np.inf, np.inf)
    bound = wb.tasks.StepLimit(SETTING.joint_speed, root_velocity=speed, root_turn=turn)
    kept: list[Any] = [*(wb.Hold(foot) for foot in track.feet), bound]
    # the other tools cannot be told of what a person keeps
    return wb.Problem(
        track.scene, track.start, goals=[goal], constraints=kept, measures=[wb.tasks.Displacement()],
        clearance=track.clearance, range_of_motion=False, balance=False,
    )  # fmt: skip


class OwnTool(Tool):
    """One program a step, with the workspace of the step before."""

    def __init__(self, track: Track, name: str = "wholebody") -> None:
        """State the problem; a name that ends in `RETARGET` is for a goal that is replaced."""
        self.name, self._tip = name, track.tip
        self._moved = None if name.endswith(RETARGET) else MovingPoint(track.tip, np.array(track.targets[0]))
        self.problem = reach_problem(track, self._moved or wb.Point(track.tip, track.targets[0]))
        self._tracker = wb.methods.QP().tracker(self.problem, SETTING.dt)
        self._q = np.array(track.start)
        self._told: list[QPStep] = []

    def reset(self, q: Array) -> None:
        """Go to a posture."""
        self._q = np.array(q)
        self._told.clear()

    def step(self, target: Array) -> None:
        """Move one step."""
        if self._moved is None:
            self.problem.retarget([wb.Point(self._tip, target)])
        else:
            self._moved.target[:] = target
        step = self._tracker.step(self._q)
        self._q = step.q
        self._told.append(step)

    def posture(self) -> Array:
        """Where it is."""
        return np.array(self._q)

    def remarks(self) -> dict[str, float]:
        """Mean number of contact rows, and share of steps whose program was solved exactly."""
        rows, exact = ([getattr(step, name) for step in self._told] for name in ("rows", "exact"))
        return {"rows": float(np.mean(rows)), "exact": float(np.mean(exact))}

    def programs(self) -> dict[str, int]:
        """How many programs each closed."""
        return dict(sum((Counter(step.programs) for step in self._told), Counter[str]()))
