"""The equations of an assembly during a solve, and those of a figure in it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.geometry.memory_views import placement_view
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.batches import Batch
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.kkt import Projection, kkt_algebra, project
from wholebody.methods.newton.linear_algebra import QuasiDefinite
from wholebody.methods.newton.own_rows import TangentRows
from wholebody.methods.newton.system import ActiveSystem, System, unit
from wholebody.methods.newton.terms import bound_equations, constraint_equations
from wholebody.problem import Problem
from wholebody.scene.scene import Scene


class AssemblyFigure(FigureBodies):
    """A figure among the bodies of an assembly.

    Attributes:
        name: of the figure in the assembly.
        problem: the figure with its start and constraints; without goals.
        batches: its joints, limits and constraints.
    """

    def __init__(self, name: str, problem: Problem, first: int) -> None:
        """Read the joints; `first` is the index of the first body.

        Raises:
            UnsupportedTermError: a joint or a constraint has no equations.
            InputError: a constraint of a class of the user's.
        """
        super().__init__(problem.scene.figure, problem.start, first)
        self.name, self.problem = name, problem
        constraints = constraint_equations(problem, self)
        bounds = bound_equations(problem, self, State(problem.scene.model))
        sets = (self.equations, constraints, bounds)
        self.batches: list[Batch] = [self.limits, *(batch for one in sets for batch in one.batches())]
        for batch in self.batches:
            if isinstance(batch, TangentRows):
                raise InputError(
                    f"figure {name!r}: {batch.labels[0]} is of a class of your own, which figures of an assembly "
                    "do not take; write it as a wb.methods.AssemblyConstraint"
                )
            batch.labels = [f"{name!r}, {label}" for label in batch.labels]

    def __getstate__(self) -> tuple[str, Problem, int]:
        """Return the arguments that it is made from; Pinocchio's data are computed anew."""
        return self.name, self.problem, self.first

    def __setstate__(self, state: tuple[str, Problem, int]) -> None:
        self.__init__(*state)  # type: ignore[misc]


class AssemblySystem(ActiveSystem):
    """An assembly's equations, renewed from state to state.

    Attributes:
        revision: of the assembly.
    """

    def __init__(
        self,
        held: Sequence[Batch],
        weight: Array,
        algebra: str,
        figures: Sequence[AssemblyFigure],
        to_scene: Callable[[Array], Array],
        revision: int,
    ) -> None:
        """Take the equations.

        Args:
            held: the constraints.
            weight: (7 n,) of each variable in the least motion.
            algebra: name of the factorisation.
            figures: whose bodies are placed by their postures.
            to_scene: the scene's posture (nq,) at variables (7 n,).
            revision: of the assembly.
        """
        super().__init__(held, weight, algebra, figures)
        self._to_scene, self.revision = to_scene, revision
        self._nearest: tuple[System, QuasiDefinite] | None = None

    def among(self, scene: Scene, clearance: float) -> None:
        """Let the pairs of a scene of the bodies touch, at a distance of at least `clearance` metres."""
        if len(scene.pair_table.pairs):
            self.workspace = scene.workspace()
            data = pin.Data()  # without the tensors of a model's data, which grow with the cube of its freedoms
            data.oMi.extend([pin.SE3.Identity()] * self.workspace.model.njoints)
            self._find_contacts(np.full(len(scene.pair_table.pairs), clearance), self.workspace, data)

    def nearest(self, x: Array, anchor: Array, tolerance: float, iterations: int) -> Projection:
        """The place nearest to the anchor from x (both (7 n,)); analysed once while the pattern stays."""
        if self._nearest is None or self._nearest[0] is not self.system:
            self._nearest = self.system, kkt_algebra(self.system)
        return project(self.system, self._nearest[1], x, anchor, tolerance=tolerance, iterations=iterations)

    def _projected(self, x: Array) -> Array:
        x = unit(x)
        for figure in self._figures:
            figure.retract(x)
        if self.contacts is not None:
            self.q = self._to_scene(x)
            self._place(x)
        return x

    def _place(self, x: Array) -> None:
        """Write the placements of the bodies at x (7 n,) into the data."""
        bodies, joints = x.reshape(-1, 7), placement_view(self._data.oMi)
        if joints is None:
            for number, body in enumerate(bodies):
                self._data.oMi[number + 1] = pin.XYZQUATToSE3(body)
            return
        joints[1:, 3] = bodies[:, :3]
        for axis, unit_vector in enumerate(np.eye(3)):
            joints[1:, axis] = quat.rotate(bodies[:, 3:], np.broadcast_to(unit_vector, (len(bodies), 3)))
