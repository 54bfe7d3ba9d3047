"""Goal: the centre of mass at a position."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from typing import Literal

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.base.checks import settle
from wholebody.figures.state import State
from wholebody.tasks import inputs
from wholebody.tasks.base import Goal, Surroundings


@dataclass(frozen=True, eq=False)
class CenterOfMass(Goal):
    """Move the figure's centre of mass to a position, or above one.

    The error is the centre of mass minus the target, in world axes [m].

    Attributes:
        target: (3,) position in the world [m].
        axes: "xyz", or "xy" to leave the height free.
        weight: factor on the squared error [1/m^2].
        resolved_target: (2,) or (3,) the components of `target` along `axes` [m].

    Raises:
        InputError: the target is not in metres, or the axes are others.
    """

    target: inputs.Position
    _: KW_ONLY
    axes: Literal["xy", "xyz"] = "xyz"
    weight: inputs.Weight = 1.0
    resolved_target: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the values."""
        super().__post_init__()
        settle(self, "resolved_target", self.resolved_target[: len(self.axes)])

    def resolve(self, scene: Surroundings, start: Array) -> CenterOfMass:
        """Return the goal itself.

        Raises:
            InputError: no moving part has mass.
        """
        inputs.check_mass(scene, "CenterOfMass")
        return self

    @property
    def angular(self) -> Mask:
        """(m,) no row is in radians."""
        return np.zeros(len(self.axes), dtype=bool)

    def error(self, state: State) -> Array:
        """(2,) or (3,) from the target to the centre of mass [m]."""
        return np.asarray(state.center_of_mass()[: len(self.axes)] - self.resolved_target)

    def jacobian(self, state: State) -> Array:
        """(2, nv) or (3, nv)."""
        return state.center_of_mass_jacobian()[: len(self.axes)]
