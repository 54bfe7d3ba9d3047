"""A method of one's own in forty lines: the Jacobian transpose, accepted wherever a method is named.

wholebody pose examples/tasks/shelf.toml --method own_method:JacobianTranspose     # in the folder of this file
wholebody bench compare --sets free_reach --methods own_method:JacobianTranspose qp
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.methods.base import SolvesAnew
from wholebody.methods.conclusion import Ending, concluded
from wholebody.methods.control import Control
from wholebody.solution import TraceEntry


@dataclass(frozen=True)
class JacobianTranspose(SolvesAnew):
    """Steps down the squared errors of goals and equalities (Wolovich and Elliott 1984); the rest is only assessed."""

    tolerance: float = 1e-3
    iterations: int = 2000
    name = "transpose"

    def accepts(self, problem):
        """Take any problem: what it does not see, the assessment judges."""

    def solve(self, problem, progress=None):
        """Descend from the start with exact steps of the linearised errors."""
        trace, figure = [], problem.scene.figure
        holds = [term for term in problem.constraints if np.array_equal(term.lower, term.upper)]
        q = figure.clamp(problem.start)
        with Control(None, progress) as control, problem.borrow() as workspace:
            for _ in range(self.iterations):
                state = workspace.state.update(q)
                error = np.concatenate([*(g.error(state) for g in problem.goals), *(h.value(state) for h in holds)])
                rows = np.vstack([state.dense_jacobian(term.jacobian(state)) for term in (*problem.goals, *holds)])
                trace.append(TraceEntry(float(np.linalg.norm(error)), 0.0, 0.0, 0.0))
                control.tell(trace[-1])
                if trace[-1].goal_error <= self.tolerance or control.over:
                    break
                down = -rows.T @ error
                along = rows @ down
                share = -(along @ error) / max(along @ along, 1e-12)
                q = figure.clamp(pin.integrate(figure.model, q, share * down))
        done = trace[-1].goal_error <= self.tolerance
        ending = Ending(q, done, len(trace), tuple(trace), "by the Jacobian transpose", contradictions=())
        return concluded(problem, ending, method=self.name, tolerance=self.tolerance, control=control)


def main(out: Path = Path("pictures"), pictures: bool = True) -> None:
    """Reach with a hand, compare with the QP method, and draw."""
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.6, 1.2, 0.04)), name="table", at=(0.65, 0.0, 0.74))
    problem = wb.Problem(
        scene, "standing", goals=[wb.Point("right_palm", (0.5, -0.3, 1.1))],
        constraints=[wb.Freeze("root")], range_of_motion=False,
    )  # fmt: skip
    for method in (JacobianTranspose(tolerance=1e-5), wb.methods.QP()):
        solution = wb.solve(problem, method)
        print(f"{solution.method}: {solution.message}, {solution.iterations} iterations")
        if pictures and solution.method == "transpose":
            picture("own_method", problem, solution, out, eye=(2.0, -3.0, 2.0), target=(0.2, 0.0, 0.95))


if __name__ == "__main__":
    from presenting import command_line, picture  # here, so that a command finds the class from any folder

    command_line(main, __doc__)
