"""The equations of an assembly during a solve: joints stay, goals are retargeted, limits and contacts renewed."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.geometry.memory_views import placement_view
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.assembly_figure import AssemblyFigure
from wholebody.methods.newton.batches import Batch, Key
from wholebody.methods.newton.system import ActiveSystem, Patterns, unit
from wholebody.scene.scene import Scene

Batches = Sequence[tuple[Batch, Key]]


class AssemblySystem(ActiveSystem):
    """An assembly's equations, renewed from state to state.

    After every step the bodies of figures are placed by forward kinematics of the nearest posture; Euler parameters of
    all others get unit length. Pairs of shapes become inequalities and cease to be with hysteresis.

    Attributes:
        patterns: what was laid out and analysed.
    """

    def __init__(
        self, held: Batches, figures: Sequence[AssemblyFigure], scene: Scene | None,
        to_scene: Callable[[Array], Array], clearance: float, patterns: Patterns,
    ) -> None:  # fmt: skip
        """Build the equations.

        Args:
            held: what must hold.
            figures: whose bodies are placed by their postures.
            scene: the bodies among things, whose pairs can touch; None without pairs.
            to_scene: the scene's posture (nq,) at variables (7 n,).
            clearance: least distance of every pair, metres.
            patterns: that were laid out; none yet.
        """
        self._held, self._figures = list(held), list(figures)
        self._goals: list[tuple[Batch, Key]] = []
        self.patterns, self._to_scene = patterns, to_scene
        if scene is not None and len(scene.pair_table.pairs):
            self.workspace = scene.workspace()
            self._data = pin.Data()  # without the tensors of a model's data, which grow with the cube of its freedoms
            self._data.oMi.extend([pin.SE3.Identity()] * self.workspace.model.njoints)
            self._find_contacts(np.full(len(scene.pair_table.pairs), clearance), self.workspace)
        self._goals_laid: Hashable = None
        self._here = np.zeros(0)
        self._fresh = True

    def begin(self, x: Array, goals: Batches) -> Array:
        """Begin a solve at x (7 n,) with these goals, and with the things where they are now; returns the start."""
        self._goals = list(goals)
        self._goals_laid = tuple((key, batch.size, batch.bodies.tobytes()) for batch, key in goals)
        self.path = ()
        if self.contacts is not None:
            self.workspace.refresh()
        self._here, self._fresh = np.zeros(0), True
        self.arrive(x)
        return self._here

    def retract(self, x: Array) -> Array:
        """The variables (7 n,) of the nearest state with whole figures and Euler parameters of unit length."""
        if x is self._here:
            return x
        x = unit(x)
        for figure in self._figures:
            figure.retract(x)
        if self.contacts is not None:
            self.q = self._to_scene(x)
            self._place(x)
            self.contacts.measure(self._data)
        self._here = x
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

    def arrive(self, x: Array) -> bool:
        """Renew limits and contacts at x; returns whether the pattern changed."""
        x = self.retract(x)
        self._left = self.q
        if not self.path or not np.array_equal(self.path[-1], x):
            self.path = (*self.path, x)
        if self.contacts is None and not self._figures and not self._fresh:
            return False  # nothing depends on the state
        self._fresh = False
        for figure in self._figures:
            figure.choose_limits()
        data = None if self.contacts is None else self._data
        return self._lay([*self._held, *self._goals], self._goals_laid, x, data)
