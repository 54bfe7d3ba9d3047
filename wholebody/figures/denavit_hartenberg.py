"""Denavit-Hartenberg tables of a figure's branches, derived from the model.

Standard convention (Denavit & Hartenberg 1955): ``A_i = Rot_z(theta_i) Trans_z(d_i) Trans_x(a_i) Rot_x(alpha_i)`` with
``theta_i = q_i + offset_i``; z_{i-1} is the axis of joint i, x_i the common normal of the axes of joints i and i + 1.
A branch whose first axis does not lie in its base frame, and whose tip does not lie on its last axis, needs two fixed
placements beside the table: `base` and `tool`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, brief
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.figures.figure import Figure

_PARALLEL = 1e-9  # axes with a smaller sine of their angle count as parallel; otherwise d would be kilometres


class DenavitHartenberg(NamedTuple):
    """Table of one branch.

    Attributes:
        joints: (n) names, from the root outwards.
        reference: reference frame of the branch.
        tip: frame at its end.
        base: placement of DH frame 0 in the reference frame.
        offset: (n,) radians, added to the joint values.
        d: (n,) metres along the joint's axis.
        a: (n,) metres along the common normal.
        alpha: (n,) radians about the common normal.
        tool: placement of the tip in the last DH frame.

    Examples:
        >>> table = wb.figures.denavit_hartenberg(human, "right_arm")
        >>> table.d.shape == table.a.shape == (len(table.joints),)
        True
    """

    joints: tuple[str, ...]
    reference: str
    tip: str
    base: pin.SE3
    offset: Array
    d: Array
    a: Array
    alpha: Array
    tool: pin.SE3

    def __repr__(self) -> str:
        return brief(self)

    def forward(self, values: Array) -> pin.SE3:
        """Return the placement of the tip in the reference frame at joint values (n,)."""
        values = np.asarray(values, dtype=float)
        if values.shape != self.offset.shape:
            raise InputError(
                f"this branch has {len(self.offset)} joints; give that many values, not shape {values.shape}"
            )
        placement = self.base
        for theta, d, a, alpha in zip(values + self.offset, self.d, self.a, self.alpha, strict=True):
            placement = placement * _link(theta, d, a, alpha)
        return placement * self.tool

    def __str__(self) -> str:
        head = f"{'joint':32s} {'theta':>22s} {'d [m]':>9s} {'a [m]':>9s} {'alpha [deg]':>12s}"
        rows = [
            f"{name:32s} {'q + ' + format(np.degrees(o), '.2f'):>22s} {d:9.4f} {a:9.4f} {np.degrees(alpha):12.2f}"
            for name, o, d, a, alpha in zip(self.joints, self.offset, self.d, self.a, self.alpha, strict=True)
        ]
        return "\n".join([head, *rows])


def denavit_hartenberg(figure: Figure, branch: str) -> DenavitHartenberg:
    """Return the table of a chain of revolute joints: "right_arm", "left_leg", "spine", "neck", ...

    Raises:
        UnknownNameError: no such chain.
        InputError: the chain has a joint that is not revolute.

    Examples:
        >>> wb.figures.denavit_hartenberg(human, "right_arm").tip
        'right_index_tip'
    """
    if branch not in figure.chains:
        raise UnknownNameError("branch", branch, figure.chains)
    chain, model = figure.chains[branch], figure.model
    ids = [figure.joint_id(name) for name in chain.joints]
    for joint in ids:
        if not model.joints[joint].shortname().startswith("JointModelR"):
            raise InputError(f"joint {model.names[joint]!r} is not revolute; a table is made of revolute joints here")
    data = model.createData()
    tip_id = figure.frame_id(chain.tip)
    pin.computeJointJacobians(model, data, pin.neutral(model))
    pin.updateFramePlacements(model, data)
    parent = model.parents[ids[0]]
    reference = _link_frame(figure, parent)
    inverse = (data.oMf[reference[1]] if reference[1] >= 0 else pin.SE3.Identity()).inverse()
    directions = data.J[3:, [model.joints[joint].idx_vExtended for joint in ids]].T @ inverse.rotation.T
    axes = [(inverse.act(data.oMi[joint].translation), axis) for joint, axis in zip(ids, directions, strict=True)]
    tip = inverse * data.oMf[tip_id]
    frames = _frames(axes)
    links = [frames[k].inverse() * frames[k + 1] for k in range(len(ids))]
    offset, d, a, alpha = (np.array(column) for column in zip(*(_parameters(link) for link in links), strict=True))
    return DenavitHartenberg(
        chain.joints, reference[0], chain.tip, frames[0], offset, d, a, alpha, frames[-1].inverse() * tip
    )


def _link_frame(figure: Figure, joint: int) -> tuple[str, int]:
    """Name and index of the first segment frame on a joint; the world if there is none."""
    frames = ((name, figure.frame_id(name)) for name in figure.segments)
    return next((each for each in frames if figure.model.frames[each[1]].parentJoint == joint), ("world", -1))


def _frames(axes: list[tuple[Array, Array]]) -> list[pin.SE3]:
    """DH frames 0 ... n at zero, in the reference frame: frame i has z on axis i + 1 and x on the normal to axis i."""
    point, z = axes[0]
    # The first x and origin are free: in the plane of the reference frame nearest to its own x.
    start = np.eye(3)[0 if abs(z[0]) < 0.9 else 1]
    x = start - z * (z @ start)
    x /= np.linalg.norm(x)
    frames = [_frame(point, x, z)]
    for next_point, next_z in axes[1:]:
        cross = np.cross(z, next_z)
        sine = np.linalg.norm(cross)
        between = next_point - point
        if sine < _PARALLEL:
            # Parallel: any common normal; take the one through the last origin, which makes d = 0.
            foot = frames[-1].translation
            across = (next_point - foot) - z * (z @ (next_point - foot))
            origin, distance = foot + across, float(np.linalg.norm(across))
            x = across / distance if distance > _PARALLEL else frames[-1].rotation[:, 0]
        else:
            normal = cross / sine
            along = float(np.linalg.det(np.column_stack([between, z, cross]))) / sine**2
            origin = next_point + along * next_z
            distance = float(between @ normal)
            x = normal if distance >= 0.0 or abs(distance) < _PARALLEL else -normal
        frames.append(_frame(origin, x, next_z))
        point, z = next_point, next_z
    # After the last joint nothing follows: keep its axis, so that alpha = a = d = 0 and the tool does the rest.
    frames.append(frames[-1])
    return frames


def _frame(origin: Array, x: Array, z: Array) -> pin.SE3:
    return pin.SE3(np.column_stack([x, np.cross(z, x), z]), np.array(origin, dtype=float))


def _parameters(link: pin.SE3) -> tuple[float, float, float, float]:
    """Theta, d, a, alpha of one link's placement."""
    rotation, translation = link.rotation, link.translation
    theta = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
    alpha = float(np.arctan2(rotation[2, 1], rotation[2, 2]))
    a = float(translation[0] * np.cos(theta) + translation[1] * np.sin(theta))
    return theta, float(translation[2]), a, alpha


def _link(theta: float, d: float, a: float, alpha: float) -> pin.SE3:
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    rotation = np.array([[ct, -st * ca, st * sa], [st, ct * ca, -ct * sa], [0.0, sa, ca]])
    return pin.SE3(rotation, np.array([a * ct, a * st, d]))
