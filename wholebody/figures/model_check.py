"""Numbers of a model that lead to postures with NaN: refused before a figure is made of it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.base.errors import InputError

HEAVIEST = 1e9
"""Kilograms: greatest mass carried by one joint."""
LARGEST = 1e6
"""Largest value of a joint, radians or metres, and largest tolerance; larger ones are refused as mistakes."""


def check_model(model: pin.Model, name: str) -> None:
    """Refuse a model with impossible numbers, which would lead to postures with NaN.

    Args:
        model: Pinocchio's model.
        name: of the figure, for the message.

    Raises:
        InputError: a mass is negative or beyond `HEAVIEST`, a position, an inertia or a limit is not a number, or a
            lower limit is above the upper one.
    """
    for joint in range(1, model.njoints):
        inertia, at = model.inertias[joint], model.jointPlacements[joint]
        where = f"{name}, joint {model.names[joint]!r}"
        if not 0.0 <= inertia.mass <= HEAVIEST:
            raise InputError(f"{where}: what it carries has a mass of {inertia.mass:g} kg; give 0 to {HEAVIEST:g} kg")
        for what, values in (("centre of mass", inertia.lever), ("inertia", inertia.inertia)):
            if not np.isfinite(values).all():
                raise InputError(f"{where}: the {what} of what it carries is not finite; give finite numbers")
        if not (np.isfinite(at.rotation).all() and (np.abs(at.translation) <= LARGEST).all()):
            raise InputError(f"{where}: its origin is not finite or beyond {LARGEST:g} m; give metres")
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    wrong = np.flatnonzero(~(low <= high))
    if len(wrong):
        joint = next(j for j in model.joints if j.idx_q <= wrong[0] < j.idx_q + j.nq)
        ends = f"{low[wrong[0]]:g} and {high[wrong[0]]:g}"
        raise InputError(f"{name}, joint {model.names[joint.id]!r}: its limits are {ends}; give the lower one first")
    if not (model.velocityLimit >= 0.0).all():
        wrong = np.flatnonzero(~(model.velocityLimit >= 0.0))
        joint = next(j for j in model.joints if j.idx_v <= wrong[0] < j.idx_v + j.nv)
        speed = model.velocityLimit[wrong[0]]
        raise InputError(f"{name}, joint {model.names[joint.id]!r}: its velocity limit is {speed:g}; give 0 or more")
