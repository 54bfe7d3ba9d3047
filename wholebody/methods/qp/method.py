"""The QP method: whole solves by sequential quadratic programming, tracking by one program a step."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from wholebody.assessment.posture import judged
from wholebody.base.arrays import Array
from wholebody.base.checks import posture, shown
from wholebody.base.errors import InputError
from wholebody.methods.base import check_problem
from wholebody.methods.conclusion import Descends, Ending, concluded, meets
from wholebody.methods.control import Control
from wholebody.methods.qp.chain import Met, from_seeds
from wholebody.methods.qp.chain_batch import Batch, batches
from wholebody.methods.qp.multistart import QPMultistart
from wholebody.methods.qp.settings import Settings
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.solvers.registry import make_solver
from wholebody.methods.qp.tracking import QPTracker
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.solution import Solution


@dataclass(frozen=True)
class QP(Settings, Descends):
    """Quadratic programs, solved by a QP solver of your choice.

    A solve is the best of a descent, of another that seeks feasibility first, and of seeded starts, which are tried
    only where the earlier ones did not reach the goals, and within the budget. These are settings alone: one object
    serves any number of problems and threads at the same time.

    Attributes:
        solver: "active_set", our own, with which programs begin with the active set of the one before; or "osqp",
            "daqp" or any name that qpsolvers lists on this machine (see `wholebody doctor`), to which every program
            is given. The answers are the same to rounding; `Solution.programs` says what closed how many programs.
        tolerance: metres and radians to which goals and constraints are met.
        iterations: most programs for one descent; one that ends there while the measures decrease goes on, within the
            budget.
        budget: most programs that restarts may add when no descent from the start reaches the goals; a program takes
            about a millisecond.
        restarts: most seeded starts that are tried.
        restarts_for_measure: how many more descents look for a lower minimum of the measures once the goals are met;
            four times as many feasible postures are found first, and the best of them are descended from. Also with 0
            one is made, and more where things make the measures dear, unless `restarts` is 0.
        seed: of the restarts.
        measures: whether the measures are to be least. Without, the first posture is the answer that meets the goals
            with everything held, which is there in a fifth to nine tenths of the time. This is for `solve`.
        time_limit: seconds after which a solve ends with the best posture so far, infinite for no limit. Where None,
            the numbers of programs end it, and at last ten seconds of processor time.

    Raises:
        UnknownNameError: there is no such QP solver.

    Examples:
        >>> wb.solve(problem, wb.methods.QP(tolerance=1e-8, seed=1)).status
        'solved'
    """

    longest = 10.0  # s: twice what a search within its numbers of programs takes for a person in a cabin

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            InputError: a setting out of range.
            UnknownNameError: no such QP solver.
        """
        super().__post_init__()
        make_solver(self.solver)

    @property
    def name(self) -> str:
        """Name for tables: "qp" as it comes; else what stands behind the slash is asked for every program."""
        return "qp" if self.solver == "active_set" else f"qp/{self.solver}"

    def _descend(self, problem: Problem, workspace: Workspace, control: Control) -> Ending:
        """See `Descends._descend`."""
        met = from_seeds(problem, workspace, self, control)
        if (ending := self._complete(problem, met)) is not None:
            return ending
        search = QPMultistart(problem, workspace, self._qp_solver(), self, control)
        begin, before = ((), ()) if met is None else (() if met.complete else met.begins, met.trace)
        known = () if met is None else (met.blocked, met.near, met.rest, _measure(problem, workspace, met.through))
        best = search.run(begin, *known)
        starts = f"{search.tried} start{'s' * (search.tried != 1)}"
        return Ending(
            best.q, best.converged, len(before) + search.spent, (*before, *search.trace), search.how,
            contradictions=search.contradictions, programs=search.solver.counted(),
            unreached="seems out of reach" if search.out_of_reach else f"not found from {starts}",
        )  # fmt: skip

    def _complete(self, problem: Problem, met: Met | None) -> Ending | None:
        """The end of descents of a chain; None where they leave something to do."""
        judgement = judged(problem, met.q) if met is not None and met.complete else None
        if met is None or judgement is None or not meets(judgement, self.tolerance):
            return None
        return Ending(met.q, True, len(met.trace), met.trace, "directly", judgement=judgement)

    def batches(self, problems: Sequence[Problem], largest: int) -> list[Batch]:
        """Those of many problems that may be solved at once, in batches of at most so many: see `chain_batch`.

        Empty where a time limit, or the `solve` of a class derived from this one, has a say in each.
        """
        alone = self.time_limit is not None or type(self).solve is not QP.solve
        return [] if alone else batches(problems, self, largest)

    def minima(self, problem: Problem, starts: Iterable[Array]) -> Iterator[Solution]:
        """For each start (nq,) the minimum of the measures that one descent from it leads to, without other starts.

        Raises:
            InputError: the scene changed after the problem was stated.
        """
        check_problem(problem, "QP.minima: problem")
        try:
            begins = iter(starts)
        except TypeError:
            raise InputError(f"QP.minima: starts is {shown(starts)}; give postures, such as [problem.start]") from None
        alone = replace(self, restarts=0, restarts_for_measure=0)
        for given in begins:
            start = posture(given, problem.scene.model.nq, "QP.minima: a start")
            with Control(self.time_limit, None, self.longest) as control, problem.borrow() as workspace:
                met = from_seeds(problem.with_start(problem.scene.figure.clamp(start)), workspace, alone, control)
                ending = self._complete(problem, met)
                if ending is None:
                    search = QPMultistart(problem, workspace, self._qp_solver(), alone, control)
                    end = search.feasibility_first(start) or search.directly(start)
                    ending = Ending(
                        end.q, end.converged, search.spent, tuple(search.trace), search.how,
                        programs=search.solver.counted(),
                    )  # fmt: skip
            yield concluded(problem, ending, method=self.name, tolerance=self.tolerance, control=control)

    def _qp_solver(self) -> QPSolver:
        """A QP solver of the name in the settings, for one run."""
        return make_solver(self.solver)

    def tracker(self, problem: Problem, dt: float) -> QPTracker:
        """What follows the goals of a problem that move from call to call: one program a step of `dt` seconds.

        Raises:
            InputError: dt is not a positive finite number, or the scene changed after the problem was stated.
        """
        return QPTracker(problem, self._qp_solver(), dt, self)


def _measure(problem: Problem, workspace: Workspace, q: Array | None) -> float:
    """The weighted sum of the measures at a posture (nq,); 0 without one."""
    if q is None:
        return 0.0
    state = workspace.state.update(q)
    return sum((term.weight * term.value(state) for term in problem.measures), 0.0)
