"""Where the parts of a figure touch things that bear them, frame by frame: a hand on a rail, a pelvis on a seat.

A part bears on a thing while it is as near to it as retargeting and `wb.avoid` bring what touches, and slow there.
Feet are left out: they stand by height and speed, on whatever is below them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, Mask
from wholebody.geometry.proximity import Contacts
from wholebody.motion.clip import Clip
from wholebody.motion.footholds import RestLimits
from wholebody.motion.inverse_dynamics import InverseDynamics, Stand, Touches
from wholebody.scene.scene import Scene

TOUCHING = 0.005  # m: the farthest of what touches; retargeted hands are up to 1 mm away, and avoiders keep a clearance


class Bearing(NamedTuple):
    """What bears a figure in a clip."""

    dynamics: InverseDynamics  # on the feet, and on the joints of the segments that touch
    names: tuple[str, ...]  # of the feet, and after them of these segments
    stands: list[Stand]  # of each frame


def bearing(clip: Clip, q: Array, feet: Mapping[str, Mask], scene: Scene | None, friction: float) -> Bearing:
    """What bears the frames of a clip at smoothed postures q (n, nq), on feet in frames (n,) where they stand.

    Without a scene, or with a root that is fixed, nothing else touches.
    """
    figure, names, touches = clip.figure, tuple[str, ...](), list[Touches]()
    if scene is not None and figure.root == "free":
        names, touches = touching_parts(clip, scene, feet)
    joints = [figure.model.frames[figure.frame_id(name)].parentJoint for name in names]
    dynamics = InverseDynamics(figure, tuple(feet), friction, joints)
    stands = [
        dynamics.stand(posture, [bool(marks[k]) for marks in feet.values()], touches[k] if touches else None)
        for k, posture in enumerate(q)
    ]
    return Bearing(dynamics, (*feet, *names), stands)


def touching_parts(clip: Clip, scene: Scene, feet: Collection[str]) -> tuple[tuple[str, ...], list[Touches]]:
    """Segments other than feet that touch things of a scene, and where they do in each frame.

    Things that move in the clip bear nothing: what they weigh is not known.
    """
    figure, owners, slow = clip.figure, scene.piece_owner, RestLimits().speed
    model, data = figure.model, figure.model.createData()
    carrier = {name: name for name in figure.segments}
    carrier |= {name: each.segment for name, each in scene.objects.items() if each.segment is not None}
    joints = {name: int(model.frames[figure.frame_id(segment)].parentJoint) for name, segment in carrier.items()}
    standing = {model.frames[figure.frame_id(name)].parentJoint for name in feet}
    bearing = {name for name, joint in joints.items() if not standing & set(model.supports[joint])}
    found = list[list[tuple[str, Array, Array]]]()
    with scene.borrow() as workspace:
        for q, v in zip(clip.q, clip.velocities(), strict=True):
            pin.forwardKinematics(model, data, q, v)
            here = list[tuple[str, Array, Array]]()
            for first, second, normal, point in _sides(workspace.near(q, TOUCHING)):
                mine, other = owners[first], owners[second]
                if mine in bearing and other not in carrier and other not in clip.things:
                    twist = pin.getVelocity(model, data, joints[mine], pin.ReferenceFrame.WORLD)
                    if np.linalg.norm(twist.linear + np.cross(twist.angular, point)) <= slow:
                        here.append((carrier[mine], point, normal))
            found.append(here)
    names = tuple(dict.fromkeys(segment for here in found for segment, _, _ in here))
    return names, [
        Touches(
            np.array([point for _, point, _ in here]).reshape(-1, 3),
            np.array([len(feet) + names.index(segment) for segment, _, _ in here], dtype=np.intp),
            np.array([normal for _, _, normal in here]).reshape(-1, 3),
        )
        for here in found
    ]


def _sides(near: Contacts) -> Iterator[tuple[int, int, Array, Array]]:
    """Of each pair in both orders: a piece, the other, the normal (3,) out of it, and the point (3,) of the first."""
    for number, (first, second) in enumerate(near.pair.tolist()):
        yield first, second, -near.normal[number], np.array(near.point_a[number])
        yield second, first, np.array(near.normal[number]), np.array(near.point_b[number])
