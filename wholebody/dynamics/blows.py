"""Impacts with a figure that the engine, to which the figure's motion is given, found within a step."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from wholebody.base.arrays import Array, cross
from wholebody.dynamics.frame import EngineFrame, impacts
from wholebody.dynamics.rigid_bodies import RigidBodies

BOUNCE = 0.1  # m/s: slower rebounds, of up to 0.5 mm, are left out


def left_for_later(
    engine: RigidBodies,
    frame: EngineFrame,
    given: dict[str, Array],
    most: tuple[float, float],
    reacted: Callable[[dict[str, Array]], float],
) -> bool:
    """Take back the impacts of a step with the figure, which the next step has at its start; whether only in part.

    To the engine the motion of the figure is given, which would bring energy. Alternating blows, of which one depends
    on the other, are taken back as far as things and figure together have no more energy than before.

    Args:
        engine: after the step.
        frame: the step.
        given: the wrenches (6,) that segments were given; those of what is taken back leave it, in place.
        most: energy of the things, and of the figure, before the step, J.
        reacted: the figure's energy after such wrenches, J.
    """
    met = [(event.first, event.second, event.impulse, event.point) for event in frame.given]
    met += [(second, first, -impulse, point) for first, second, impulse, point in met]
    blows = [blow for blow in met if blow[0] in given]
    if not blows or not impacts(frame.events, given, BOUNCE):
        return False
    wrenches = [(own, np.hstack([impulse, cross(point, impulse)])) for own, _, impulse, point in blows]

    def taken_back(share: float) -> tuple[float, float]:
        for _, other, impulse, point in blows:
            engine.push(other, -share * impulse, point)
        for own, wrench in wrenches:
            given[own] = given[own] + share * wrench
        return engine.energy(), reacted(given)

    energies = np.array([taken_back(0.0), taken_back(0.5), taken_back(0.5)])
    share = share_below(energies.sum(axis=1), most[0] + most[1])
    if share < 1.0 and sum(taken_back(share - 1.0)) > (1.0 + 1e-9) * (most[0] + most[1]):
        # no share does: then that of the things alone, and the figure is slowed
        taken_back(share_below(energies[:, 0], most[0]) - share)
    return share < 1.0


def undo(engine: RigidBodies, frame: EngineFrame, began: Mapping[str, Array], most: float) -> None:
    """Give the things that were pushed in a step the velocities that they would have without; the next step has it all.

    Args:
        engine: after the step.
        frame: the step.
        began: things to the twists (6,) that weight alone would give them.
        most: energy of the things before, J.
    """
    pushed = frame.wrenches.keys() & began.keys()
    for name in pushed:
        change = began[name] - engine.twist(name)
        engine.push_about_centre(name, np.linalg.lstsq(engine.response(name), change, rcond=None)[0])
    if (gain := engine.energy() - most) > 0.0:  # they are not where they would be
        engine.state.slow(np.array([name in pushed for name in engine.names]), gain)


def share_below(energies: Array, most: float) -> float:
    """Largest share of an impulse with an energy of at most `most` [J]; `energies` (3,): of none, half and all."""
    none, half, full = energies.tolist()
    square = 2.0 * (none + full - 2.0 * half)  # the energy is none + (full - none - square) s + square s^2
    if full <= most or square <= 0.0:
        return 1.0
    first = square + none - full
    root = np.sqrt(max(0.0, first**2 - 4.0 * square * (none - most)))
    return float(min(max(0.5 * (first + root) / square, 0.0), 1.0))
