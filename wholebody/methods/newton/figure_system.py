"""The equations of a problem during a solve: joints, constraints and goals stay, limits and contacts are renewed."""

from __future__ import annotations

from wholebody.base.arrays import Array
from wholebody.methods.newton.batches import Role
from wholebody.methods.newton.equations import unit_lengths
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.measures import Objective
from wholebody.methods.newton.system import ActiveSystem
from wholebody.methods.newton.terms import bound_equations, constraint_equations, goal_equations
from wholebody.problem import Problem
from wholebody.scene.workspace import Workspace
from wholebody.tasks.answers import is_own
from wholebody.tasks.checks import undefined


class FigureSystem(ActiveSystem):
    """A problem's equations, renewed from posture to posture: every iterate is a posture.

    Attributes:
        problem: to be solved.
        workspace: of the run.
        bodies: of the figure.
        objective: the rows of the measures.
    """

    def __init__(self, problem: Problem, workspace: Workspace, algebra: str, *, yielding: bool = False) -> None:
        """Build the equations.

        Args:
            problem: to be solved.
            workspace: of the run, for as long as this is used.
            algebra: name of the factorisation.
            yielding: minimise the violation of the constraints, in place of the goals.

        Raises:
            InputError: a term or a joint that has no equations here.
        """
        self.problem, self.workspace, self._yielding = problem, workspace, yielding
        self.bodies = bodies = FigureBodies(problem.scene.figure, problem.start)
        held = [unit_lengths(bodies.names), bodies.limits, *bodies.equations.batches()]
        held += bound_equations(problem, bodies, workspace.state).batches()
        if not yielding:
            held += constraint_equations(problem, bodies).batches()
        self.objective = Objective(problem, bodies, workspace.state)
        super().__init__([*held, *self.objective.batches()], bodies.weight, algebra, [bodies])
        self._find_contacts(problem.clearances, workspace, bodies.data)
        self._own = tuple(filter(is_own, problem.measures))
        self.retarget()
        self.arrive(self.variables(problem.start))

    def variables(self, q: Array) -> Array:
        """Move to the posture q (nq,); returns its variables."""
        self.q = self.bodies.q = q
        self._here = self.bodies.variables(q)
        if self.contacts is not None:
            self.contacts.measure(self.bodies.data)
        return self._here

    def posture(self, x: Array) -> Array:
        """The posture (nq,) of the bodies x (7 n,)."""
        return self.q if x is self._here else self.bodies.posture(x)

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
            asked = constraint_equations(problem, self.bodies).batches()
            for batch in asked:
                batch.role = batch.role if batch.role.one_sided else Role(weight=1.0)
        else:
            asked = goal_equations(problem, self.bodies, problem.goals).batches()
        self.aim(asked)

    def arrive(self, x: Array) -> bool:
        """Renew limits, measures and contacts at x; returns whether the pattern changed."""
        x = self.retract(x)
        if self._own and (error := undefined(self._own, self.workspace.state.update(self.q))) is not None:
            raise error  # measures are read where a step ends, and not on the way there
        self.objective.renew(self.q)
        changed = super().arrive(x)
        self.objective.enter(self.system)
        return changed

    def _projected(self, x: Array) -> Array:
        x = x.copy()
        self.bodies.retract(x)
        self.q = self.bodies.q
        return x
