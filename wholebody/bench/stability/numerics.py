"""Numbers at the ends of their range: sizes, nothings, nonsense, and budgets that run out."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from wholebody.bench.adapters.base import Adapter
from wholebody.bench.stability.bodies import planar_arm, spatial_arm
from wholebody.bench.stability.case import HardCase, Kind, Nonsense, Posed
from wholebody.geometry.shapes import Box
from wholebody.methods.drag import Drag
from wholebody.methods.qp.active_set import guess_active_set
from wholebody.methods.qp.method import QP
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram
from wholebody.methods.qp.solvers.base import QPSolver
from wholebody.methods.qp.solvers.fallback import GUESS_TOLERANCE
from wholebody.methods.qp.solvers.osqp_solver import OSQPSolver
from wholebody.problem import Problem
from wholebody.scene import Scene
from wholebody.tasks import Point

GROUP = "Numbers"
BENT = np.array([-0.6, 0.8, 0.5])
NAN, INFINITE = float("nan"), float("inf")


def _scaled(size: float) -> Problem:
    """An arm that reaches over a box, all lengths times `size`."""
    scene = Scene(planar_arm(size * np.array([0.4, 0.3, 0.29]), size * 0.02))
    scene.add(Box((size * 0.1, size * 0.3, size * 0.4)), name="box", at=size * np.array([0.5, 0.0, 0.0]))
    return Problem(scene, np.array([-0.9, 0.3, 0.2]), goals=[Point("tip", size * np.array([0.62, 0.0, 0.1]))])


class Small(HardCase):
    """An arm of one centimetre."""

    name, group, title = "1-cm-scale", GROUP, "An arm of 1 cm"
    why = (
        "Everything is a hundredth of the usual size: a tolerance of 0.1 mm is a whole link, and damping, trust "
        "regions and contact distances in metres are as large as the arm."
    )
    acceptable = "Solved to 10 µm. It is drawn a hundred times as large, its micrometre of overlap too."
    tolerance = 1e-5

    def question(self) -> Posed:
        """Over a box of 4 mm."""
        return Posed(_scaled(0.01))

    def drawn(self) -> Posed:
        """The same a hundred times as large."""
        return Posed(_scaled(1.0))


class Large(HardCase):
    """An arm of a hundred metres."""

    name, group, title = "100-m-scale", GROUP, "An arm of 100 m"
    why = (
        "Everything is a hundred times the usual size: 0.1 mm is a millionth of the arm, steps bounded to centimetres "
        "never arrive, and contact queries within centimetres see nothing."
    )
    acceptable = "Solved to 0.1 mm."

    def question(self) -> Posed:
        """Over a box of 40 m."""
        return Posed(_scaled(100.0))


class TinyDifference(HardCase):
    """A goal a picometre away."""

    name, group, title = "goal-1e-12-away", GROUP, "A goal 1e-12 m away"
    why = (
        "The goal is a picometre from where the tip is: differences drown in rounding, lengths divide by nearly "
        "nothing."
    )
    acceptable = "Solved at once."

    def question(self) -> Posed:
        """From a bent arm."""
        scene = Scene(planar_arm((0.5, 0.4, 0.3)))
        tip = scene.state(BENT).frame(scene.figure.frame_id("tip")).translation.copy()
        return Posed(Problem(scene, BENT, goals=[Point("tip", tip + (1e-12, 0.0, 0.0))]))


class TinyWeight(HardCase):
    """A goal of weight 1e-12."""

    name, group, title = "weight-1e-12", GROUP, "A goal of weight 1e-12"
    why = "The only goal has the weight 1e-12: where goals are costs beside others, it is lost among tolerances."
    acceptable = "Solved: a goal is met if it can be, whatever its weight."

    def question(self) -> Posed:
        """Within easy reach."""
        scene = Scene(planar_arm((0.5, 0.4, 0.3)))
        return Posed(Problem(scene, BENT, goals=[Point("tip", (0.7, 0.0, 0.5), weight=1e-12)]))


class NotNumbers(HardCase):
    """NaN and infinity wherever a number is given."""

    name, group, title = "not-a-number", GROUP, "NaN and infinity"
    why = (
        "NaN passes every comparison: a check like `error > tolerance` lets it through, and it comes out of the method "
        "as a posture of NaN or an endless loop."
    )
    acceptable = "A clear refusal of each: an InputError that says where and how to mend it."
    expected, best = "refusal", None

    def question(self) -> Nonsense:
        """A start, a goal, a goal in the middle of a drag, a thing's place, and the method's own tolerance."""
        return Nonsense(
            {
                "NaN in the start": lambda adapter: _solve(adapter, start=NAN),
                "NaN in a goal": lambda adapter: _solve(adapter, goal=NAN),
                "infinity in a goal": lambda adapter: _solve(adapter, goal=INFINITE),
                "NaN in a thing's place": lambda adapter: _solve(adapter, box=NAN),
                "NaN in a drag": lambda adapter: Drag(_reach(), adapter.make(1e-5, None)).to((NAN, 0.0, 0.5)),
                "NaN in where a drag is": _drag_from_nowhere,
                "NaN as tolerance": lambda adapter: adapter.make(NAN, None).solve(_reach()),
            },
            _reach(),
        )


def _reach(start: float = 0.5, goal: float = 0.5, box: float = 0.0) -> Problem:
    scene = Scene(planar_arm((0.5, 0.4, 0.3)))
    scene.add(Box((0.1, 0.1, 0.1)), name="box", at=(0.9, 0.0, -0.8))
    problem = Problem(scene, np.array([-0.6, 0.8, start]), goals=[Point("tip", (0.7, 0.0, goal))])
    if box != 0.0:
        scene.move("box", at=(0.9, box, -0.8))
    return problem


def _solve(adapter: Adapter, **changed: float) -> object:
    return adapter.make(1e-5, None).solve(_reach(**changed))


def _drag_from_nowhere(adapter: Adapter) -> object:
    drag = Drag(_reach(), adapter.make(1e-5, None))
    drag.q = np.array([-0.6, NAN, 0.5])
    return drag.to((0.7, 0.0, 0.4))


class FewIterations(HardCase):
    """Two iterations for a reach that needs twenty."""

    name, group, title = "two-iterations", GROUP, "A budget of two iterations"
    why = "The method may take two iterations for a reach across a table: it is stopped anywhere, and has to know it."
    acceptable = "An honest answer of what was reached, outside of the table and within limits."
    expected, near = "honest", np.inf

    def question(self) -> Posed:
        """An arm of six joints over a table."""
        return Posed(_across(), iterations=2)

    def accepts(self, kind: Kind, miss: float) -> bool:
        """Who arrives in two iterations is welcome."""
        return kind in ("honest", "solved", "refusal")


class QPLimit(HardCase):
    """A quadratic program that its solver does not finish."""

    name, group, title = "qp-iteration-limit", GROUP, "A QP that hits its iteration limit"
    why = (
        "OSQP solves every quadratic program and may take five iterations for it, and everything that would finish its "
        "answer exactly is taken away: every step is built on an answer that is none. Methods without such programs "
        "get one iteration."
    )
    acceptable = "An honest answer, outside of the table and within limits; or solved all the same."
    expected, near = "honest", np.inf

    def question(self) -> Posed:
        """The same reach."""
        return Posed(_across(), iterations=None, adjust=unfinished)

    def accepts(self, kind: Kind, miss: float) -> bool:
        """Slower, but never wrong."""
        return kind in ("honest", "solved", "refusal")


def unfinished(method: Any) -> Any:
    """The method with quadratic programs that `Unfinished` solves; one without any gets one iteration itself."""
    from wholebody.methods.qp.method import QP

    if isinstance(method, QP):
        return UnfinishedQP(**{field.name: getattr(method, field.name) for field in fields(method)})
    if is_dataclass(method) and not isinstance(method, type):
        return replace(method, iterations=1)
    method.iterations = 1  # an adapter of another tool
    return method


def _across() -> Problem:
    scene = Scene(spatial_arm()).add(Box((0.5, 0.8, 0.1)), name="table", at=(0.55, 0.0, 0.35))
    start = np.array([-0.9, 0.5, 0.9, 0.0, 0.5, 0.0])
    return Problem(scene, start, goals=[Point("tip", (0.55, 0.35, 0.45))])


CASES = (Small, Large, TinyDifference, TinyWeight, NotNumbers, FewIterations, QPLimit)


LIMIT = 5  # iterations: OSQP takes 25 to some hundreds for programs of a reach


class Unfinished(OSQPSolver):
    """OSQP that is stopped early, without the active sets and the fallback that make its answers exact."""

    name = "osqp, unfinished"

    def solve(self, program: QuadraticProgram, guess: ActiveSet | None) -> QPSolution:
        """Minimise, not quite; a guess is not used."""
        return self.solve_cold(program)

    def solve_cold(self, program: QuadraticProgram) -> QPSolution:
        """What some iterations lead to, inside the box of the program."""
        workspace = self.workspace(program)
        used = workspace.run(LIMIT)
        x = workspace.x().clip(program.lower, program.upper)
        return QPSolution(x, guess_active_set(program, x, GUESS_TOLERANCE), False, used, self.name)


class UnfinishedQP(QP):
    """The QP method with such a solver."""

    def _qp_solver(self) -> QPSolver:
        """One that never finishes."""
        return Unfinished()
