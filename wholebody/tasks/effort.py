"""Measure: distance of the joints from the start."""

from __future__ import annotations

from dataclasses import dataclass, field

from wholebody.arrays import Array
from wholebody.figures.state import State
from wholebody.tasks import inputs
from wholebody.tasks.base import Measure, Surroundings, filled
from wholebody.tasks.distance import SquaredDistance


@dataclass(frozen=True, eq=False)
class Effort(Measure):
    """Squared displacement of every joint from the start, weighted by joint [rad^2].

    ``sum_i gamma_i (q_i - q_i_start)^2`` (Marler and Arora's effort; eq. 2.5 of the thesis on posture prediction), with
    the figure's `effort_weights` for gamma: moving the spine costs more than moving an arm.

    Attributes:
        weight: factor on the measure [1/rad^2].
        distance: the start, and the weight of every degree of freedom; once resolved.
    """

    weight: float = 1.0
    distance: SquaredDistance = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the value."""
        object.__setattr__(self, "weight", inputs.weight(self.weight, "Effort: weight"))

    def resolve(self, scene: Surroundings, start: Array) -> Effort:
        """Store the start."""
        return filled(self, distance=SquaredDistance.build(scene.model, start, scene.figure.effort_weights))

    def value(self, state: State) -> float:
        """The effort [rad^2]."""
        return self.distance.value(state)

    def gradient(self, state: State) -> Array:
        """(nv,) derivative [rad]."""
        return self.distance.gradient(state)

    def curvature(self, state: State) -> Array:
        """(nv,) second derivative; exact for joints of one degree of freedom."""
        return self.distance.curvature
