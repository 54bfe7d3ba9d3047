"""Postures with left and right exchanged, of figures whose joints name their sides."""

from __future__ import annotations

import re
from functools import lru_cache

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.loading import one_figure

MIRROR = np.diag([1.0, -1.0, 1.0])  # reflection at the plane y = 0

PLACEMENT = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0])
"""The same of a placement (7,): (x, -y, z), and of a rotation R, which becomes M R M, the x and z of the axis."""

SIDES = (
    ("left", "right"),
    ("Left", "Right"),
    ("LEFT", "RIGHT"),
    (r"(?<![A-Za-z])l(?![A-Za-z])", r"(?<![A-Za-z])r(?![A-Za-z])"),
    (r"(?<![A-Za-z])L(?![A-Za-z])", r"(?<![A-Za-z])R(?![A-Za-z])"),
    (r"(?<![A-Za-z])[lL](?=[A-Z])", r"(?<![A-Za-z])[rR](?=[A-Z])"),
)
"""How names say their side; the patterns of single letters need a letter that stands alone or before a capital."""


def other_side(name: str) -> str:
    """The name of the same part on the other side; the name itself if it names no side."""
    words = {"left": "right", "Left": "Right", "LEFT": "RIGHT", "l": "r", "L": "R"}
    words |= {right: left for left, right in words.items()}
    for left, right in SIDES:
        both = re.compile(f"{left}|{right}")
        if both.search(name):
            return both.sub(lambda found: words[found.group()], name, count=1)
    return name


def mirrored(figure: Figure, q: Array, place: pin.SE3 | None = None) -> Array:
    """Postures (n, nq) mirrored at the plane y = 0 of the world, or of a place for the free root.

    Raises:
        InputError: the figure is not symmetric, or has ball joints.
    """
    source, sign = _exchange(one_figure(figure, "mirrored: the clip's figure"))
    found: Array = q[:, source] * sign
    if figure.root == "free":
        found[:, :7] = q[:, :7] * PLACEMENT
    if figure.root == "free" and place is not None:
        for row, given in zip(found, q[:, :7], strict=True):
            image = pin.SE3ToXYZQUAT(place.actInv(pin.XYZQUATToSE3(given))) * PLACEMENT
            row[:7] = pin.SE3ToXYZQUAT(place.act(pin.XYZQUATToSE3(image)))
    return found


@lru_cache(maxsize=8)  # of the figures that were mirrored last: half of the time of a short solve
def _exchange(figure: Figure) -> tuple[Indices, Array]:
    """For each value of a posture: the value of which it takes the place, and the sign that it gets."""
    model = figure.model
    data = model.createData()
    q = pin.neutral(model)
    pin.computeJointJacobians(model, data, q)
    source, sign = np.arange(model.nq), np.ones(model.nq)
    for name in figure.joints:
        joint = model.joints[figure.joint_id(name)]
        if name in figure.followers:
            continue
        partner = other_side(name)
        if partner not in figure.joints:
            raise InputError(f"{figure.name} cannot be mirrored: {name!r} has no partner {partner!r}")
        other = model.joints[figure.joint_id(partner)]
        if joint.nv != 1 or joint.nq != other.nq:
            raise InputError(f"{figure.name} cannot be mirrored: {name!r} is no joint of one degree of freedom")
        here = MIRROR @ data.oMi[joint.id].translation
        apart = np.linalg.norm(here - data.oMi[other.id].translation)
        if apart > 0.01:  # m: robot descriptions have rounded digits
            raise InputError(f"{figure.name} cannot be mirrored: {name!r} and {partner!r} are not symmetric to y = 0")
        along = _along(data.J[:, joint.idx_vExtended], data.J[:, other.idx_vExtended])
        if abs(along) < np.cos(0.05):
            raise InputError(f"{figure.name} cannot be mirrored: {name!r} and {partner!r} turn about other axes")
        for k in range(joint.nq):  # an unlimited joint has cosine and sine; only the sine changes its sign
            source[joint.idx_q + k] = other.idx_q + k
            sign[joint.idx_q + k] = np.sign(along) if k == joint.nq - 1 else 1.0
    return source, sign


def _along(own: Array, other: Array) -> float:
    """Cosine between a joint's mirrored axis and its partner's, of their columns (6,); axes of rotation turn round."""
    if np.linalg.norm(own[3:]) > 0.5:
        return float(-(MIRROR @ own[3:]) @ other[3:])
    return float((MIRROR @ own[:3]) @ other[:3]) if np.linalg.norm(other[3:]) < 0.5 else 0.0
