"""A figure as bodies of an assembly: its joints, limits and constraints among the assembly's equations."""

from __future__ import annotations

from typing import Any

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.methods.newton.batches import ONE_SIDED, Batch, Key
from wholebody.methods.newton.figure_bodies import FigureBodies
from wholebody.methods.newton.tangent_rows import TangentRows
from wholebody.methods.newton.terms import bound_equations, constraint_equations
from wholebody.problem import Problem


class AssemblyFigure:
    """A figure whose body k is the assembly's body `first + k`.

    Attributes:
        name: of the figure in the assembly.
        problem: the figure with its start and constraints; without goals.
        first: index of its first body.
        bodies: the figure in full coordinates.
    """

    def __init__(self, name: str, problem: Problem, first: int) -> None:
        """Read the joints.

        Raises:
            UnsupportedTermError: a joint or a constraint has no equations.
        """
        self.name, self.problem, self.first = name, problem, first
        self.bodies = FigureBodies(problem.scene.figure, problem.start)
        self._limits = self.bodies.limits()
        self._q = problem.start
        self._equations = [
            self.bodies.equations,
            constraint_equations(problem, self.bodies),
            bound_equations(problem, State(problem.scene.model)),
        ]

    def __getstate__(self) -> tuple[str, Problem, int]:
        """Return the arguments that it is made from; Pinocchio's data are computed anew."""
        return self.name, self.problem, self.first

    def __setstate__(self, state: tuple[str, Problem, int]) -> None:
        self.__init__(*state)  # type: ignore[misc]

    @property
    def last(self) -> int:
        """Index of the body after its last one."""
        return self.first + int(self.bodies.count)

    def batches(self, world: int) -> list[tuple[Batch, Key]]:
        """Joints, limits and constraints, with the assembly's indices of bodies; `world` is the index of the world.

        Raises:
            InputError: a constraint of a class of the user's.
        """
        count = self.bodies.count
        self._limits = self.bodies.limits()
        listed: list[tuple[Batch, Key]] = [(self._limits, ONE_SIDED)]
        for equations in self._equations:
            listed += equations.batches(count)
        for batch, _ in listed:
            if isinstance(batch, TangentRows):
                raise InputError(
                    f"figure {self.name!r}: {batch.labels[0]} is of a class of your own, which figures of an assembly "
                    "do not take; write it as a wb.methods.AssemblyConstraint"
                )
            batch.bodies = np.where(batch.bodies == count, world, batch.bodies + self.first)
            batch.labels = [f"{self.name!r}, {label}" for label in batch.labels]
        return listed

    def variables(self, q: Array) -> Array:
        """The bodies (7 count,) at the posture q (nq,)."""
        return self.bodies.variables(q)

    def posture(self, x: Array) -> Array:
        """The posture (nq,), within limits, at the assembly's variables x (7 n,)."""
        return self.bodies.posture(x[7 * self.first : 7 * self.last])

    def retract(self, x: Array) -> None:
        """Move the figure's bodies, among the assembly's variables x (7 n,), to the nearest posture."""
        self._q = self.posture(x)
        x[7 * self.first : 7 * self.last] = self.variables(self._q)

    def choose_limits(self) -> None:
        """Set the rows of the limits to the nearer limits at the last posture of `retract`."""
        self.bodies.choose_limits(self._limits, self._q)

    def frames(self) -> list[tuple[str, int, Any]]:
        """Name, index of the body, and placement in it (pin.SE3) of the figure's bodies and frames."""
        model, seen = self.bodies.model, set[str]()
        found = []
        for k, joint in enumerate(self.bodies.names):
            seen.add(joint)
            found.append((f"{self.name}/{joint}", self.first + k, None))
        for frame in model.frames:
            if frame.parentJoint and frame.name not in seen:
                seen.add(frame.name)
                found.append((f"{self.name}/{frame.name}", self.first + int(frame.parentJoint) - 1, frame.placement))
        return found
