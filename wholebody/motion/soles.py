"""Feet of a recorded skeleton with the joints of a figure's: skeletons have ankles and toes at other heights."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.motion.roles import Roles
from wholebody.motion.skeleton import SkeletonMotion


def soled(
    motion: SkeletonMotion, roles: Roles, stands: Mapping[str, Mask], places: Mapping[str, Array]
) -> dict[str, Array]:
    """Places (n, 3) of a skeleton's toes as if its feet had the two joints as high above their soles as the figure's.

    The way between the two may differ by 20 degrees and more. While both stand (n,) the sole is flat, which says in
    the ankle's axes where the toes of the figure would be: `places` (3,) are those in its neutral posture, by role.
    """
    found = {}
    for side in ("left", "right"):
        ankle, toe = f"{side}_ankle", f"{side}_toe"
        if not {ankle, toe} <= stands.keys() & places.keys():
            continue
        flat = stands[ankle] & stands[toe]
        start, end = (motion.names.index(roles.joints[role]) for role in (ankle, toe))
        ways, turns = motion.positions[:, end] - motion.positions[:, start], motion.rotations[:, start]
        lengths, own = np.linalg.norm(ways, axis=1), places[toe] - places[ankle]
        heading = ways[flat] * (1.0, 1.0, 0.0)
        along = np.linalg.norm(heading, axis=1)
        if not flat.any() or along.min() < 0.5 * np.median(lengths):  # a foot that hangs says nothing
            continue
        rise = float(own[2] / np.linalg.norm(own))
        wanted = heading / along[:, None] * np.sqrt(1.0 - rise**2) + (0.0, 0.0, rise)
        local = np.einsum("nji,nj->ni", turns[flat], wanted).mean(axis=0)
        found[toe] = motion.positions[:, start] + lengths[:, None] * (turns @ (local / np.linalg.norm(local)))
    return found
