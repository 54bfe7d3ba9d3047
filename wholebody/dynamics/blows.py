"""Impacts with a figure that the engine, to which the figure's motion is given, found within a step."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from wholebody.base.arrays import Array, cross
from wholebody.dynamics.frame import EngineFrame, impacts
from wholebody.dynamics.rigid_bodies import RigidBodies

BOUNCE = 0.05  # m/s: slower rebounds, of up to 0.13 mm, are left out


def left_for_later(engine: RigidBodies, frame: EngineFrame, segments: Collection[str], most: float) -> dict[str, Array]:
    """The wrenches of a step without its impacts with the figure, which the next step has at its start."""
    # To the engine it is infinitely heavy, and would bring energy; alternating blows are taken back to `most` [J].
    wrenches = dict(frame.wrenches)
    met = [(event.first, event.second, event.impulse, event.point) for event in frame.given]
    met += [(second, first, -impulse, point) for first, second, impulse, point in met]
    blows = [blow for blow in met if blow[0] in segments]
    if not blows or not impacts(frame.events, segments, BOUNCE):
        return wrenches

    def taken_back(share: float) -> float:
        for _, other, impulse, point in blows:
            engine.push(other, -share * impulse, point)
        return engine.energy()

    share = share_below((engine.energy(), taken_back(0.5), taken_back(0.5)), most)
    if share < 1.0:
        taken_back(share - 1.0)
    for own, _, impulse, point in blows:
        wrenches[own] = wrenches[own] + share * np.hstack([impulse, cross(point, impulse)])
    return wrenches


def share_below(energies: tuple[float, float, float], most: float) -> float:
    """Largest share of an impulse with an energy of at most `most` [J]; `energies`: of none, half and all."""
    none, half, full = energies
    square = 2.0 * (none + full - 2.0 * half)  # the energy is none + (full - none - square) s + square s^2
    if full <= most or square <= 0.0:
        return 1.0
    first = square + none - full
    root = np.sqrt(max(0.0, first**2 - 4.0 * square * (none - most)))
    return float(min(max(0.5 * (first + root) / square, 0.0), 1.0))
