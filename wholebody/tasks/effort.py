"""Measure: distance of the joints from the start."""

from __future__ import annotations

from dataclasses import dataclass, field

from wholebody.arrays import Array
from wholebody.tasks import inputs
from wholebody.tasks.base import Surroundings, filled
from wholebody.tasks.distance import DistanceMeasure, SquaredDistance


@dataclass(frozen=True, eq=False)
class Effort(DistanceMeasure):
    """Squared displacement of every joint from the start, weighted by joint [rad^2].

    ``sum_i gamma_i (q_i - q_i_start)^2`` (Marler and Arora's effort; eq. 2.5 of the thesis on posture prediction), with
    the figure's `effort_weights` for gamma: moving the spine costs more than moving an arm.

    The angles of a ball joint that is made of three hinges count one by one, which is not the square of its rotation
    vector: near an arm stretched to the side two of them turn it alike. docs/theory/person.md says how far the two are
    apart.

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
