"""A small set of problems, and methods that misbehave each in its own way."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.errors import InputError
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.suite.problem_sets.case import ProblemSet
from wholebody.methods.base import SolvingTracker
from wholebody.methods.control import Progress

COMPILING = 0.5  # s: that the first solve of the method that compiles takes longer
ARM = Path(__file__).parents[3] / "data" / "arm" / "arm.urdf"


def pose(number: int, rng: np.random.Generator, frames: int = 0) -> Any:
    """Return a reach of a robot arm to where its tip is in a random posture; one after the other where it moves."""
    figure = wb.load(ARM)
    tip = figure.model.names[-1]
    scene = wb.Scene(figure)
    witness = figure.clamp(pin.integrate(figure.model, figure.neutral, rng.uniform(-0.4, 0.4, figure.model.nv)))
    there = pin.SE3(scene.state(witness).frame(figure.frame_id(tip))).translation
    problem = wb.Problem(scene, figure.neutral, goals=[wb.Point(tip, there)])
    here = pin.SE3(scene.state(figure.neutral).frame(figure.frame_id(tip))).translation
    way = tuple((wb.Point(tip, here + (k + 1) / frames * 0.1 * (there - here)),) for k in range(frames))
    return problem, witness, way


SET = ProblemSet("arm", "an arm", "An arm reaches for a place.", pose)
MOVING = ProblemSet("moving", "a moving arm", "An arm follows a place.", partial(pose, frames=5), moving=True)


def broken(number: int, rng: np.random.Generator) -> Any:
    raise RuntimeError("the set is broken")


BROKEN = ProblemSet("broken", "broken", "A set that cannot be built.", broken)


@dataclass(frozen=True)
class Fake:
    """A method that does as it is told, whatever the problem.

    Attributes:
        does: "solves", "raises", "refuses", "hangs", "spins", "dies", "nan", "lies", "sleeps", or "compiles" once in a
            process.
    """

    does: str
    tolerance: float = 1e-4

    @property
    def name(self) -> str:
        return self.does

    def accepts(self, problem: wb.Problem) -> None:
        return None

    def tracker(self, problem: wb.Problem, dt: float) -> SolvingTracker:
        return SolvingTracker(self, problem, dt)

    def solve(self, problem: wb.Problem, progress: Progress | None = None) -> Any:
        if self.does == "raises":
            raise ZeroDivisionError("by nothing")
        if self.does == "refuses":
            raise InputError("it cannot take goals[0], Point; leave it out")
        if self.does == "hangs":
            time.sleep(60.0)
        if self.does == "spins":
            np.linalg.svd(np.random.default_rng(0).normal(size=(3000, 3000)))  # in compiled code for half a minute
        if self.does == "dies":
            os._exit(3)
        if self.does == "sleeps":
            time.sleep(float(os.environ.get("FAKES_SLEEP", "0.01")))
        if self.does == "compiles" and "COMPILED" not in os.environ:
            os.environ["COMPILED"] = "in this process"
            time.sleep(COMPILING)
        solution = wb.methods.QP(solver="daqp", tolerance=self.tolerance).solve(problem)
        if self.does == "nan":
            return replace(solution, q=np.full_like(solution.q, np.nan))
        if self.does == "lies":
            return replace(solution, q=problem.start, status="solved")
        return solution


def _fake(does: str, tolerance: float, iterations: int | None) -> Fake:
    return Fake(does, tolerance)


def adapter(does: str) -> Adapter:
    """Return a fake as it takes part."""
    ladder = ((1e-2, None), (1e-4, None), (1e-6, None))
    differences = (f"it {does}", "wb.Fake() is code")
    return Adapter(does, partial(_fake, does), ladder, setup=f"a fake that {does}", differences=differences)
