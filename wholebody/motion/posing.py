"""Clips from placements of the root and angles by joint name, such as those of a glove."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array
from wholebody.base.checks import array, known, listed, shown, text
from wholebody.base.checks import posture as checked_posture
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.geometry.placement import placement
from wholebody.motion.clip import ROOT_SIZE, Clip, check_figure


def posed(
    figure: Figure,
    *,
    roots: Sequence[Any] | None = None,
    angles: Mapping[str, ArrayLike] | None = None,
    posture: str | ArrayLike | None = None,
    dt: float,
    name: str = "track",
) -> Clip:
    """The clip of placements of the root and angles by joint name: a hand's placements and a glove's angles.

    Args:
        figure: the figure of the postures.
        roots: n placements of a free root, each as for `Scene.add`; by default that of the posture.
        angles: joint name to n angles, radians, or one for all frames; other joints stay as in the posture.
        posture: (nq,) or a name; the figure's first one if left out.
        dt: seconds from frame to frame.
        name: name of the clip in messages.

    Raises:
        UnknownNameError: a joint that the figure does not have.
        InputError: tracks of different length, a placement that cannot be read (the frame is named), roots for a fixed
            figure.

    Examples:
        >>> track = wb.motion.posed(human, angles={"left_elbow_flexion": [0.0, 0.5, 1.0]}, dt=0.1)
        >>> track.q.shape
        (3, 56)
    """
    check_figure(figure, "posed")
    base = figure.neutral if posture is None else posture
    base = figure.posture(base) if isinstance(base, str) else checked_posture(base, figure.model.nq)
    text(name, "name")
    if not (angles is None or isinstance(angles, Mapping)):
        raise InputError(f"{name}: angles is {shown(angles)}; give angles by joint, such as {{'neck_flexion': [0.5]}}")
    joints = {known(joint, figure.joints, "joint", name): values for joint, values in (angles or {}).items()}
    given = {joint: _angles(values, joint) for joint, values in joints.items()}
    roots = None if roots is None else listed(roots, f"{name}: roots", "placements (x, y, z)")
    if not (roots is None or roots):
        raise InputError(f"{name}: roots is empty; give a placement for each frame, or leave it out")
    frames = _frames(name, roots, given)
    q = np.tile(base, (frames, 1))
    for joint, values in given.items():
        q[:, figure.model.joints[figure.joint_id(joint)].idx_q] = values
    if roots is not None:
        if figure.root != "free":
            what = "is fixed to the world" if figure.root == "fixed" else "are several figures"
            raise InputError(f"{name}: {figure.name} {what}; leave roots out")
        for frame, root in enumerate(roots):
            try:
                q[frame, :ROOT_SIZE] = pin.SE3ToXYZQUAT(placement(root))
            except InputError as error:
                raise InputError(f"{name}: frame {frame}: {error}") from None
    return Clip(figure, q, dt, name)


def _angles(values: object, joint: str) -> Array:
    wanted = "an angle for each frame, radians, or one for all"
    found = np.atleast_1d(array(values, f"angles of {joint!r}", wanted))
    if found.ndim != 1 or not len(found):
        raise InputError(f"angles of {joint!r} have shape {found.shape}; give {wanted}")
    return found


def _frames(name: str, roots: Sequence[Any] | None, angles: Mapping[str, Array]) -> int:
    sizes = {joint: len(values) for joint, values in angles.items() if len(values) != 1}
    if roots is not None:
        sizes["root"] = len(roots)
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{joint} {size}" for joint, size in list(sizes.items())[:5])
        raise InputError(f"{name}: tracks of different length ({listed} frames); cut them to the same")
    return next(iter(sizes.values()), 1)
