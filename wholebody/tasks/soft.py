"""Measure: the squared error of a goal that may give way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.checks import instance
from wholebody.figures.state import State
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.base import Goal, filled
from wholebody.tasks.distance import SumOfSquares


@dataclass(frozen=True, eq=False)
class Soft(SumOfSquares):
    """A goal as a preference: its squared error [m^2, rad^2], which is weighed against the other measures.

    Goals and constraints come first: where a preference cannot be met, or costs more than it is worth, the answer is
    solved all the same. The error that is left is ``problem.measures[k].goal.error(state)``. Of a preference
    that stays far off "newton" converges slowly; take "qp".

    Attributes:
        goal: any goal, such as `wb.Point("left_palm", place)`. Its weight is a factor too.
        weight: factor on the squared error. `Effort` of a person who reaches is about 1: with a weight of 100, 0.1 m
            cost as much.

    Raises:
        InputError: no goal, or a weight out of range.

    Examples:
        >>> rather = wb.Soft(wb.Point("left_palm", (0.3, 0.3, 1.0)), weight=10.0)
    """

    goal: Goal
    weight: inputs.Weight = 100.0

    def __post_init__(self) -> None:
        """Check the goal."""
        super().__post_init__()
        instance(self.goal, Goal, "Soft: goal", 'give a goal such as wb.Point("left_palm", place)')

    def resolve(self, scene: Scene, start: Array) -> Soft:
        """Resolve the goal."""
        return filled(self, goal=self.goal.resolve(scene, start))

    @property
    def touching(self) -> tuple[tuple[str, str], ...]:
        """Those of the goal."""
        return self.goal.touching

    def squares(self, state: State) -> tuple[Array, Array]:
        """The error (m,) and its derivative (m, nv), times the root of the goal's weight."""
        error, part = self.goal.value_and_jacobian(state, self.goal.error)
        root = np.sqrt(self.goal.weight)
        return root * np.atleast_1d(error), root * state.dense_jacobian(part)
