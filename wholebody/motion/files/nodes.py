"""A figure as a tree of nodes that rotate about axes of the world at zero; joints at one place are one node."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure


def angles_about(turned: Rotation, axes: Array) -> Array:
    """Angles (n, 3) of rotations about axes (3, 3), rows, each turned by the ones before; radians."""
    # In gimbal lock the third angle is that of the nearest regular frame, or zero, so that no angle jumps for a frame.
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Gimbal lock", UserWarning)
        found: Array = turned.as_davenport(axes, "intrinsic")
    first_is_third = abs(float(axes[0] @ axes[2])) > 0.5
    # so near to gimbal lock six digits of a degree, as BVH has, say nothing of the first and the third angle
    locked = np.abs(np.sin(found[:, 1]) if first_is_third else np.cos(found[:, 1])) < 1e-6
    free = np.flatnonzero(~locked)
    if not locked.any() or not len(free):
        return found
    at = np.flatnonzero(locked)
    after = np.minimum(np.searchsorted(free, at), len(free) - 1)
    before = np.maximum(after - 1, 0)
    near = np.where(at - free[before] < np.abs(free[after] - at), free[before], free[after])
    found[at, 2] = found[near, 2]
    back = Rotation.from_rotvec(-found[at, 2:] * axes[2]) * Rotation.from_rotvec(-found[at, 1:2] * axes[1])
    found[at, 0] = (turned[at] * back).as_rotvec() @ axes[0]
    return found


SAME_PLACE = 1e-9  # metres between joints that are at one place

OFF = 1e-4  # metres and radians by which a skeleton may differ from a figure and still be the figure's own


@dataclass(frozen=True)
class Node:
    """A part that rotates about one place."""

    name: str  # of the segment
    parent: int  # index of a node; -1 for the root
    offset: Array  # (3,) from the parent's place to this one's where the posture is zero, metres
    # indices of Pinocchio's joints, from the trunk outwards; none for the base of a fixed figure
    joints: tuple[int, ...]
    axes: Array  # (k, 3) their axes where the posture is zero
    tip: Array | None  # (3,) from its place to its end, or None where other nodes follow

    @property
    def free(self) -> bool:
        """Whether it is a free root, which is moved too."""
        return bool(self.joints) and not len(self.axes)


def nodes_of(figure: Figure) -> list[Node]:
    """The nodes of a figure, parents first; none where joints slide. Joined figures hang on a node "world"."""
    model = figure.model
    data = model.createData()
    columns = pin.computeJointJacobians(model, data, pin.neutral(model)).reshape(6, -1)
    pin.updateFramePlacements(model, data)
    places = [np.zeros(3)]
    base = "world" if figure.root == "several" else figure.segments[0] if figure.segments else "base"
    found = [Node(base, -1, np.zeros(3), (1,) if figure.root == "free" else (), np.zeros((0, 3)), None)]
    node_of = {0: 0, 1: 0}
    for joint in range(2 if figure.root == "free" else 1, model.njoints):
        parent = model.parents[joint]
        if joint in figure.roots.values():
            node_of[joint] = len(found)
            found.append(Node(_segment(figure, joint), 0, np.zeros(3), (joint,), np.zeros((0, 3)), None))
            places.append(np.zeros(3))
            continue
        if model.joints[joint].nv != 1 or np.linalg.norm(columns[3:, model.joints[joint].idx_v]) < 0.5:
            raise InputError(
                f"{figure.name}: joint {model.names[joint]!r} is no hinge, and files of skeletons hold rotations; "
                "give .npz or .csv"
            )
        axis = np.array(columns[3:, model.joints[joint].idx_v])
        place = np.array(data.oMi[joint].translation)
        at = node_of[parent]
        before = found[at]
        merges = (
            len(before.axes)
            and before.joints[-1] == parent
            and len(before.joints) < 3
            and np.linalg.norm(place - places[at]) < SAME_PLACE
            and sum(other == parent for other in model.parents) == 1
            and abs(before.axes[-1] @ axis) < 1e-6
        )
        if merges:
            found[at] = Node(
                _segment(figure, joint), before.parent, before.offset, (*before.joints, joint),
                np.vstack([before.axes, axis]), None,
            )  # fmt: skip
            node_of[joint] = at
            continue
        node_of[joint] = len(found)
        found.append(Node(_segment(figure, joint), at, place - places[at], (joint,), axis[None], None))
        places.append(place)
    ends = set(range(len(found))) - {node.parent for node in found}
    return [
        Node(node.name, node.parent, node.offset, node.joints, node.axes, _tip(figure, data, node, places[k]))
        if k in ends
        else node
        for k, node in enumerate(found)
    ]


def rotations(figure: Figure, nodes: list[Node], q: Array) -> tuple[Array, Array]:
    """Rotation of each node in its parent (n, nodes, 3, 3), and its place (n, nodes, 3), of postures (n, nq)."""
    model = figure.model
    data = model.createData()
    last = [node.joints[-1] if node.joints else 0 for node in nodes]
    pin.forwardKinematics(model, data, pin.neutral(model))
    rest = np.array([data.oMi[joint].rotation for joint in last])
    world, places = np.empty((len(q), len(nodes), 3, 3)), np.empty((len(q), len(nodes), 3))
    for k, posture in enumerate(q):
        pin.forwardKinematics(model, data, posture)
        world[k] = np.array([data.oMi[joint].rotation for joint in last])
        places[k] = [data.oMi[joint].translation for joint in last]
    world = world @ np.swapaxes(rest, 1, 2)
    parents = [node.parent for node in nodes]
    local = np.array(world)
    local[:, 1:] = np.swapaxes(world[:, parents[1:]], 2, 3) @ world[:, 1:]
    return local, places


def postures(figure: Figure, nodes: list[Node], local: Array, places: Array) -> Array | None:
    """Postures (n, nq) of rotations that `rotations` gave; None where the rotations are not the figure's."""
    model = figure.model
    q = np.tile(pin.neutral(model), (len(local), 1))
    for k, node in enumerate(nodes):
        if node.free:
            at = int(model.joints[node.joints[0]].idx_q)
            q[:, at : at + 3] = places[:, k]
            q[:, at + 3 : at + 7] = Rotation.from_matrix(local[:, k]).as_quat()
        if not len(node.axes):
            continue
        angles = _angles(figure, node, local[:, k])
        if angles is None:
            return None
        for joint, values in zip(node.joints, angles.T, strict=True):
            made = model.joints[joint]
            if made.nq == 1:
                q[:, made.idx_q] = values
            else:
                q[:, made.idx_q], q[:, made.idx_q + 1] = np.cos(values), np.sin(values)
    return q


def _angles(figure: Figure, node: Node, turns: Array) -> Array | None:
    """Angles (n, joints) about the axes of a node; None where other axes are needed."""
    count = len(node.joints)
    turned = Rotation.from_matrix(turns)
    if count == 1:
        vectors = turned.as_rotvec()
        angle = vectors @ node.axes[0]
        off = np.linalg.norm(vectors - angle[:, None] * node.axes[0], axis=1)
        choices = angle[:, None][None]
    else:
        axes = node.axes if count == 3 else np.vstack([node.axes, np.cross(node.axes[0], node.axes[1])])
        first = angles_about(turned, axes)
        proper = abs(axes[0] @ axes[2]) > 0.5  # axes as Z X Z, and not as Z X Y
        other = first * (1.0, -1.0, 1.0) + (np.pi, 0.0 if proper else np.pi, np.pi)
        off = np.abs(wrapped(first[:, 2])) if count == 2 else np.zeros(len(first))
        # The other solution of two axes has half a turn about a third one, which the node has not.
        choices = first[:, :2][None] if count == 2 else np.stack([first, other])
    if (off > OFF).any():
        return None
    lower, upper = _ranges(figure, node)
    middle = 0.5 * (lower + upper)
    choices = middle + wrapped(choices - middle)
    beyond = (np.maximum(lower - choices, 0.0) + np.maximum(choices - upper, 0.0)).sum(axis=2)
    # of two solutions within the limits the one nearer to the neutral posture
    resting = np.array([figure.joint_values(figure.neutral)[figure.model.names[joint]] for joint in node.joints])
    best = (beyond + 1e-3 * np.abs(choices - resting).sum(axis=2)).argmin(axis=0)
    return np.asarray(choices[best, np.arange(len(turns))])


def _ranges(figure: Figure, node: Node) -> tuple[Array, Array]:
    """Limits of a node's joints; half a turn in both directions without."""
    limits = {
        int(i): (low, high)
        for i, low, high in zip(figure.limits.idx_q, figure.limits.lower, figure.limits.upper, strict=True)
    }
    found = [limits.get(figure.model.joints[joint].idx_q, (-np.pi, np.pi)) for joint in node.joints]
    return np.array([low for low, _ in found]), np.array([high for _, high in found])


def wrapped(angles: Array) -> Array:
    """Angles between minus and plus half a turn, radians."""
    return np.asarray((angles + np.pi) % (2.0 * np.pi) - np.pi)


def _segment(figure: Figure, joint: int) -> str:
    """Name of the segment that a joint carries; the joint's where there is none."""
    frames = figure.model.frames
    name = next(
        (s for s in figure.segments if frames[figure.frame_id(s)].parentJoint == joint), figure.model.names[joint]
    )
    return "_".join(str(name).split())


def _tip(figure: Figure, data: pin.Data, node: Node, place: Array) -> Array:
    """The frame of the node that is farthest from its place; five centimetres on where there is none."""
    last = node.joints[-1] if node.joints else 0
    frames = figure.model.frames
    ends = [
        data.oMf[figure.frame_id(name)].translation - place
        for name in figure.frames
        if frames[figure.frame_id(name)].parentJoint == last
    ]
    far: Array = np.array(max(ends, key=np.linalg.norm, default=np.zeros(3)))
    if np.linalg.norm(far) < SAME_PLACE:
        along = node.offset / max(float(np.linalg.norm(node.offset)), SAME_PLACE)
        far = 0.05 * (along if np.linalg.norm(along) > 0.5 else np.array([0.0, 0.0, -1.0]))
    return far
