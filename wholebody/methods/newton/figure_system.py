"""The equations of a problem during a solve: joints, constraints and goals stay, limits and contacts are renewed."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.newton.batches import HARD, OBJECTIVE, ONE_SIDED, Batch, Key, Unit
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.objective import Objective
from wholebody.methods.newton.system import ActiveSystem, Patterns
from wholebody.methods.newton.terms import bound_equations, constraint_equations, goal_equations
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks.answers import is_own
from wholebody.tasks.checks import undefined


class FigureSystem(ActiveSystem):
    """A problem's equations, renewed from posture to posture.

    After every step the posture is computed from the bodies, and the bodies are placed by forward kinematics, so joints
    never drift, limits always hold, and every iterate is a posture.

    Attributes:
        algebra_name: name of the factorisation in the settings.
        patterns: what was laid out and analysed.
    """

    def __init__(self, problem: Problem, workspace: Workspace, algebra: str, *, yielding: bool = False) -> None:
        """Build the equations.

        Args:
            problem: the problem.
            workspace: of the run, for as long as this is used.
            algebra: name of the factorisation.
            yielding: minimise the violation of the constraints, in place of the goals.

        Raises:
            InputError: a term or a joint that has no equations here.
        """
        self.problem, self.workspace, self.algebra_name = problem, workspace, algebra
        self.bodies = FigureBodies(problem.scene.figure, problem.start)
        self._find_contacts(problem.clearances, workspace)
        count = self.bodies.count
        unit = Unit(np.arange(count)[:, None], [f"the Euler parameters of {name!r}" for name in self.bodies.names])
        self._limits = self.bodies.limits()
        self._fixed: list[tuple[Batch, Key]] = [(unit, HARD), (self._limits, ONE_SIDED)]
        self._fixed += self.bodies.equations.batches(count)
        self._fixed += bound_equations(problem, workspace.state).batches(count)
        self._yielding = yielding
        if not yielding:
            self._fixed += constraint_equations(problem, self.bodies).batches(count)
        self._goals: list[tuple[Batch, Key]] = []
        self.retarget()
        self.objective = Objective(problem, self.bodies, workspace.state)
        self._fixed += [(rows, Key(OBJECTIVE, False, False, 1.0)) for rows in self.objective.batches()]
        self.q = self._left = problem.start
        self.patterns = Patterns(count, self.bodies.weight, algebra)
        self._ordered = np.zeros(0)
        self._own = tuple(filter(is_own, problem.measures))
        self.arrive(self.variables(problem.start))

    def variables(self, q: Array) -> Array:
        """Move to the posture q (nq,); returns its variables."""
        self.q = q
        self._ordered = self.bodies.variables(q)
        if self.contacts is not None:
            self.contacts.measure(self.bodies.data)
        return self._ordered

    def posture(self, x: Array) -> Array:
        """The posture (nq,) of the bodies x (7 n,)."""
        return self.q if x is self._ordered else self.bodies.posture(x)

    def defined(self, q: Array) -> bool:
        """Whether all terms of one's own are finite at a posture (nq,)."""
        problem, state = self.problem, self.workspace.state.update(q)
        return undefined((*problem.goals, *problem.constraints, *problem.measures), state) is None

    def retarget(self) -> None:
        """Update to the problem's new goals."""
        problem = self.problem
        if any(map(is_own, problem.goals)):
            self.bodies.state_of(problem.start)  # where they are asked for their rows: a step may have been taken back
        if self._yielding:
            asked = constraint_equations(problem, self.bodies).yielding()
        else:
            asked = goal_equations(problem, self.bodies, problem.goals)
        self._goals = asked.batches(self.bodies.count)

    def retract(self, x: Array) -> Array:
        """The variables of the nearest posture."""
        return x if x is self._ordered else self.variables(self.bodies.posture(x))

    def arrive(self, x: Array) -> bool:
        """Renew limits and contacts at x; returns whether the pattern changed."""
        if x is not self._ordered:
            x = self.retract(x)
        if self._own and (error := undefined(self._own, self.workspace.state.update(self.q))) is not None:
            raise error  # measures are read where a step ends, and not on the way there
        self._left = self.q
        self.bodies.choose_limits(self._limits, self.q)
        self.objective.renew(self.q)
        goals = tuple((type(batch), batch.size, batch.bodies.tobytes(), key) for batch, key in self._goals)
        changed = self._lay([*self._fixed, *self._goals], goals, x, self.bodies.data)
        self.objective.enter(self.system)
        return changed
