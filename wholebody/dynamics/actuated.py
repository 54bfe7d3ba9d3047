"""What drives the joints of a figure that yields: a spring and a damper between tracker and figure at each freedom."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import a, instance, known, number
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure

Gains = float | Mapping[str, float] | None

RATE = 2500.0  # 1/s^2: stiffness over inertia of Schmidl and Lin's spring, 1000 N/m at 0.4 kg
MOST = 1e9  # N m/rad, N/m, N m s/rad, N s/m


@dataclass(frozen=True)
class Actuated:
    """A figure whose joints follow a tracker through springs and dampers, and yield to what they meet.

    Equation 6 of Schmidl and Lin for each freedom, as torques: I q'' = -K (q - tracked) - R (q' - tracked').
    A freedom with a spring also bears the figure's own weight there; one without is free, and all of them a ragdoll.

    Attributes:
        figure: whose joints are meant.
        stiffness: K [N m/rad], of translations [N/m]: one for all freedoms, or a mapping of joints, groups and "root",
            where what is not named has none. None: 2500 /s^2 times the inertia that the freedom moves at the start.
        damping: R [N m s/rad, N s/m] likewise. None: critical, at that inertia.

    Raises:
        InputError: no figure, or a number that is negative or too large.
        UnknownNameError: a name that is no joint or group of the figure.

    Examples:
        >>> soft = wb.Actuated(human, stiffness={"right_arm": 40.0})  # the other joints are limp
        >>> world = wb.World(scene, standing, spring=soft)
    """

    figure: Figure
    stiffness: Gains = None
    damping: Gains = None

    def __post_init__(self) -> None:
        instance(self.figure, Figure, "Actuated: figure", "give a figure, such as scene.figure")
        for what, gains in (("stiffness", self.stiffness), ("damping", self.damping)):
            if gains is not None:
                self._spread(gains, f"Actuated: {what}")

    def gains(self, inertia: Array) -> tuple[Array, Array]:
        """K and R (nv,) of freedoms that move inertias (nv,) [kg m2, kg]."""
        stiffness = RATE * inertia if self.stiffness is None else self._spread(self.stiffness, "Actuated: stiffness")
        critical = 2.0 * np.sqrt(stiffness * inertia)
        return stiffness, critical if self.damping is None else self._spread(self.damping, "Actuated: damping")

    def _spread(self, gains: float | Mapping[str, float], what: str) -> Array:
        """Numbers for all freedoms (nv,)."""
        model, figure = self.figure.model, self.figure
        if not isinstance(gains, Mapping):
            return np.full(model.nv, number(gains, what, 0.0, MOST))
        found = np.zeros(model.nv)
        roots = {name: [str(model.names[joint])] for name, joint in figure.roots.items()}
        names = {**roots, **figure.groups, **{name: [name] for name in figure.joints}}
        for name, value in gains.items():
            size = number(value, f"{what}[{name!r}]", 0.0, MOST)
            for joint in names[known(name, names, "joint or group", what)]:
                moved = model.joints[model.getJointId(joint)]
                found[moved.idx_v : moved.idx_v + moved.nv] = size
        return found

    def check(self, model: pin.Model) -> None:
        """Raise InputError for a scene with another model."""
        if list(model.names) != list(self.figure.model.names):
            raise InputError(f"Actuated: the scene is not one of {a(self.figure.name)}; give scene.figure")
