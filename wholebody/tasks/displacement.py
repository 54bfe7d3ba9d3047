"""Measure: distance of the joints from the neutral posture."""

from __future__ import annotations

from dataclasses import dataclass, field

from wholebody.arrays import Array
from wholebody.tasks import inputs
from wholebody.tasks.base import Surroundings, filled
from wholebody.tasks.distance import DistanceMeasure, SquaredDistance


@dataclass(frozen=True, eq=False)
class Displacement(DistanceMeasure):
    """Squared displacement of every joint from the neutral posture, weighted by joint [rad^2].

    ``sum_i w_i (q_i - q_i_neutral)^2``, the joint displacement of Abdel-Malek and Arora 2013 ("Human Motion Simulation:
    Predictive Dynamics", chapter 3), with the figure's `neutral_weights` for w.

    Attributes:
        weight: factor on the measure [1/rad^2].
        distance: the neutral posture, and the weight of every degree of freedom; once resolved.
    """

    weight: float = 1.0
    distance: SquaredDistance = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the value."""
        object.__setattr__(self, "weight", inputs.weight(self.weight, "Displacement: weight"))

    def resolve(self, scene: Surroundings, start: Array) -> Displacement:
        """Read the neutral posture and the weights of the figure."""
        figure = scene.figure
        return filled(self, distance=SquaredDistance.build(scene.model, figure.neutral, figure.neutral_weights))
