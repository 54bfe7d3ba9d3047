"""Where the flesh of hips is, computed apart from the package: Pinocchio places it as it is spread on a seat."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.geometry.flesh import is_flesh


def settle(geometry: pin.GeometryModel, placed: pin.GeometryData) -> None:
    """Move flesh to where the hip has it: spread from 60 degrees on, up to 30 in the thigh, between by a cubic."""
    for k, piece in enumerate(geometry.geometryObjects):
        if not is_flesh(piece):
            continue
        front = piece.name.rpartition("/")[0]
        names = [one.name for one in geometry.geometryObjects]
        pelvis = names.index(f"{front}/pelvis" if front else "pelvis")
        own = geometry.geometryObjects[pelvis].placement.rotation
        up, down = (placed.oMg[pelvis].rotation @ own.T)[:, 2], placed.oMg[k - 1].rotation[:, 2]
        share = np.clip((0.866 + up @ down) / (0.866 - 0.5), 0.0, 1.0)
        share = 3.0 * share**2 - 2.0 * share**3
        straight, spread = placed.oMg[k - 1], placed.oMg[k]
        turn = pin.log3(straight.rotation.T @ spread.rotation)
        placed.oMg[k] = pin.SE3(
            straight.rotation @ pin.exp3(share * turn),
            straight.translation + share * (spread.translation - straight.translation),
        )
