"""Which programs the QP method poses on the problem sets: recorded as they are posed, a seed has the same ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wholebody.base.errors import InputError
from wholebody.bench.suite.problem_sets.case import Case, generator
from wholebody.bench.suite.problem_sets.registry import problem_set
from wholebody.methods.qp.method import QP
from wholebody.methods.qp.quadratic_program import QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.solvers.registry import make_solver

A_CASE = 8  # programs taken of one case at the most; more: fewer cases, whose programs are alike
FRAMES = 16  # of a case with moving goals that are followed
CASES = 1000  # of a set, after which it is said that it has too few programs


@dataclass(frozen=True)
class Recorded:
    """One program and where it was posed.

    Attributes:
        set, case: problem set and number of the case.
        place: how many programs of the case were posed before it.
        program: the program, with the elastic rows that the solver was given.
    """

    set: str
    case: int
    place: int
    program: QuadraticProgram

    @property
    def name(self) -> str:
        """For files and tables."""
        return f"{self.set}-{self.case:03d}-{self.place:03d}"


class Recorder(QPSolver):
    """Keeps a copy of every program; active sets answer."""

    name = "recorder"

    def __init__(self) -> None:
        """Begin with no programs."""
        super().__init__()
        self.programs: list[QuadraticProgram] = []
        self._solver = make_solver("active_set")

    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """Keep a copy of a program, and solve it."""
        self.programs.append(QuadraticProgram(*map(np.array, program)))
        return self._solver.solve_cold(program)


@dataclass(frozen=True)
class RecordedQP(QP):
    """The QP method with one descent, whose programs a recorder keeps."""

    recorder: Recorder | None = None

    def _qp_solver(self) -> QPSolver:
        return self.recorder or Recorder()


def record(
    sets: Sequence[str], count: int, seed: int, say: Callable[[str], None] = lambda text: None
) -> list[Recorded]:
    """Pose the programs of the cases of some problem sets, about as many of each set.

    Args:
        sets: names.
        count: how many programs in all.
        seed: of the sets, and of which programs of a case are taken.
        say: takes a line about each set.

    Raises:
        UnknownNameError: there is no such set.
        InputError: a set has no more programs.
    """
    found: list[Recorded] = []
    for place, name in enumerate(sets):
        family = problem_set(name)
        wanted = count * (place + 1) // len(sets) - count * place // len(sets)
        mine: list[Recorded] = []
        for number in range(CASES):
            if len(mine) >= wanted:
                break
            posed = _posed(family.make(number, seed))
            rng = generator(name, number, seed)
            chosen = np.sort(rng.permutation(len(posed))[: min(A_CASE, wanted - len(mine))])
            mine += [Recorded(name, number, int(k), posed[k]) for k in chosen]
        if len(mine) < wanted:
            raise InputError(f"{name} has {len(mine)} programs in {CASES} cases; ask for fewer than {count}")
        found += mine
        if mine:
            say(f"{name}: {len(mine)} programs of {len({one.case for one in mine})} cases")
    return found


def _posed(case: Case) -> list[QuadraticProgram]:
    """All programs that one descent, or the first frames of a tracker, pose."""
    recorder = Recorder()
    method = RecordedQP(budget=0, restarts=0, time_limit=np.inf, recorder=recorder)
    if not case.frames:
        method.solve(case.problem)
        return recorder.programs
    tracker = method.tracker(case.problem, case.dt)
    q = case.problem.scene.figure.clamp(case.problem.start)
    for goals in case.frames[:FRAMES]:
        case.problem.retarget(goals)
        q = tracker.frame(q).q
    return recorder.programs
