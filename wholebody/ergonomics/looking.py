"""Looking at a point: the head turns as far as the eyes do not."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from math import sqrt

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.ergonomics.vision import COMFORTABLE, EYES, FieldOfViewGiven
from wholebody.figures.state import State, Wrench
from wholebody.tasks import inputs
from wholebody.tasks.base import Constraint, Surroundings, filled

NEAREST = 1e-3  # m: a nearer point has no direction from the eyes


@dataclass(frozen=True, eq=False)
class Look(Constraint):
    """Keep a point within the field of view: eyes take their share of a gaze, and the head turns by the rest.

    Let r be how far the point is off the normal line of sight, 1 on the field's elliptical border
    (`FieldOfView.off`), and A the field's width to a side. The row is A (1 - r) outside and A (1 - r^2) / 2 inside
    [rad]: smooth, and nearly straight far off. `Axis("gaze", (1, 0, 0), toward=at)` turns the head all the way.

    Attributes:
        at: (3,) the point in the world [m].
        view: the field; by default that of easy eye movement, 15 degrees about a line 15 degrees below the head's axis.
        eyes: the frame between the eyes, such as "anna/gaze" of one of several figures.
        place: that frame and its joint; once resolved.

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a frame that the figure does not have.

    Examples:
        >>> screen = wb.ergonomics.Look((0.6, 0.0, 1.2))
    """

    at: inputs.Position
    _: KW_ONLY
    view: FieldOfViewGiven = COMFORTABLE
    eyes: inputs.Name = EYES
    place: inputs.Place = field(init=False, repr=False)

    def resolve(self, scene: Surroundings, start: Array) -> Look:
        """Find the eyes."""
        return filled(self, place=inputs.find_place(scene, self.eyes, "Look"))

    @property
    def angular(self) -> Mask:
        """The row is in radians."""
        return np.ones((), dtype=bool)

    def value(self, state: State) -> Array:
        """(1,) the angle left within the field [rad]; negative outside."""
        squared = self.view.squared(self._local(state))[0]
        left = 1.0 - sqrt(squared) if squared > 1.0 else 0.5 * (1.0 - squared)
        return np.array([self.view.horizontal * left])

    def jacobian(self, state: State) -> Wrench:
        """One row. In the eyes' axes the point moves by -v + p x w as they move by v and turn by w."""
        local, frame = self._local(state), state.frame(self.place.frame)
        squared, slope = self.view.squared(local)
        slope = slope * (0.5 * self.view.horizontal / max(1.0, sqrt(squared)))
        force, moment = frame.rotation @ slope, frame.rotation @ np.cross(local, slope)
        return Wrench(np.hstack([force, moment + np.cross(frame.translation, force)])[None], self.place.joint)

    def _local(self, state: State) -> Array:
        """The point in the eyes' axes (3,), at least `NEAREST` away [m]."""
        local = np.asarray(state.frame(self.place.frame).actInv(np.asarray(self.at)))
        return local if local @ local > NEAREST**2 else np.array((NEAREST, 0.0, 0.0))
