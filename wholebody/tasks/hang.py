"""Measure: how far free arms are from hanging."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.fields import Names
from wholebody.figures.state import State, Wrench
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.axis import equidistant_error, equidistant_jacobian
from wholebody.tasks.base import filled
from wholebody.tasks.distance import SumOfSquares

HANGS = 6.0
"""1/rad^2, beside an effort of 0.7 that counts from the trunk: ESTIMATE."""


BELOW = np.array((1.0, 1.0, -1.0))  # x, y and down by x, y and z


@dataclass(frozen=True, eq=False)
class Hang(SumOfSquares):
    """Squared angles of upper arms from where they hang when the figure is upright [rad^2].

    A person who stands or kneels has this measure by default for each arm that no term moves. By `Effort` alone, which
    counts from the trunk, it would point back where the trunk bends.

    Attributes:
        arms: the segments that hang.
        weight: factor on the measure.
        places: of these, once resolved.
        down: (k, 3) directions in their joints that hang.

    Raises:
        InputError: no name, or a weight out of range.
        UnknownNameError: in a problem, an arm that the figure does not have.

    Examples:
        >>> at_ease = wb.tasks.Hang(["left_upper_arm"])
    """

    arms: Annotated[Sequence[str], Names("['left_upper_arm']")] = ("left_upper_arm", "right_upper_arm")
    weight: inputs.Weight = HANGS
    places: tuple[inputs.Place, ...] = field(init=False, repr=False)
    down: Array = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> Hang:
        """Find the upper arms, and how they hang in the first posture."""
        places, figure = tuple(inputs.find_place(scene, arm, "Hang") for arm in self.arms), scene.figure
        with figure.posed(figure.neutral) as upright:
            down = np.array([-upright.data.oMi[place.joint].rotation[2] for place in places])
        return filled(self, places=places, down=down)

    def squares(self, state: State) -> tuple[Array, Array]:
        """The angle of each along the world's x and y axes (2 k,), and the derivatives (2 k, nv)."""
        found, moves = [], []
        for place, down in zip(self.places, self.down, strict=True):
            way = state.data.oMi[place.joint].rotation @ down
            x, y, z = way.tolist()
            wrench = np.zeros((2, 6))
            wrench[:, 3:] = -(equidistant_jacobian(x, y, -z) * BELOW) @ pin.skew(way)
            found.append(equidistant_error(x, y, -z))
            moves.append(state.wrench_jacobian(Wrench(wrench, place.joint)))
        return np.concatenate(found), np.vstack(moves)
