"""Impacts with a figure that the engine, to which the figure's motion is given, found within a step."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array
from wholebody.dynamics.frame import EngineFrame
from wholebody.dynamics.rigid_bodies import RigidBodies

BOUNCE = 0.1  # m/s: slower rebounds, of up to 0.5 mm, are left out


def undo(engine: RigidBodies, frame: EngineFrame, began: Array, most: float) -> None:
    """Give the things that were pushed in a step the velocities that they would have without.

    To the engine the motion of the figure is given, which brings energy. The next step has the blows at its start.

    Args:
        engine: after the step.
        frame: the step.
        began: (n, 6) the twists of the engine's bodies that weight alone would give them.
        most: energy of the things before, J.
    """
    things = frozenset(engine.bodies) & frame.wrenches.keys()
    pushed = np.array([name in things for name in engine.names])
    for number in np.flatnonzero(pushed).tolist():
        name = engine.names[number]
        change = began[number] - engine.twist(name)
        wrench = np.asarray(np.linalg.lstsq(engine.response(name), change, rcond=None)[0], dtype=np.float64)
        engine.push_about_centre(name, wrench)
    if (gain := engine.energy() - most) > 0.0:  # they are not where they would be
        engine.state.slow(pushed, gain)
