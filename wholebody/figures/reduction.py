"""Reduction of a figure: only some joints move, the others are locked."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, with_values
from wholebody.base.errors import InputError
from wholebody.figures.description import Articulated, Chain, Description, ExcludedPair, is_root
from wholebody.figures.motion_ranges import CoupledRange, EllipticRange, MotionRange
from wholebody.figures.self_pairs import drop_pairs


def reduced_parts(
    figure: Articulated, keep: tuple[str, ...], q: Array
) -> tuple[pin.Model, pin.GeometryModel, Description, pin.GeometryModel]:
    """Model, pieces, named parts and what is drawn of a figure of which only some joints move; see `Figure.reduced`."""
    if not keep:
        raise InputError("a reduced figure needs at least one joint; name joints, groups or 'root'")
    model = figure.model
    kept = {figure.joint_id(name) for name in keep}
    leads = {int(model.joints[joint].idx_q) for joint in kept}
    kept |= {joint for joint in range(1, model.njoints) if int(model.joints[joint].idx_q) in leads}
    locked = [joint for joint in range(1, model.njoints) if joint not in kept]
    small, geometries = pin.buildReducedModel(model, [figure.geometry, figure.visual], locked, q)
    geometry = geometries[0]
    visual = geometry if figure.visual is figure.geometry else geometries[1]
    fixed = drop_rigid_pairs(geometry)
    names = {name for name in small.names if not is_root(name)}
    old = figure.describe()
    frames = {frame.name: frame for frame in small.frames}
    description = Description(
        groups={
            name: left
            for name, members in old.groups.items()
            if (left := tuple(joint for joint in members if joint in names))
        },
        chains={
            name: Chain(tuple(joint for joint in chain.joints if joint in names), chain.tip)
            for name, chain in old.chains.items()
            if any(joint in names for joint in chain.joints)
        },
        frames=old.frames,
        segments=old.segments,
        postures={name: partial(_restricted, figure, name) for name in old.postures},
        cones={
            name: cone
            for name, cone in old.cones.items()
            if frames[cone.reference].parentJoint != frames[cone.limb].parentJoint
        },
        collision_groups=old.collision_groups,
        effort=old.effort,
        excluded=(*old.excluded, *fixed),
        ranges=_ranges(old.ranges, names, figure.joint_values(q), frames),
        root_effort=tuple(
            share
            for joint, pair in zip(figure.roots.values(), zip(*[iter(old.root_effort)] * 2, strict=True), strict=False)
            for share in pair
            if joint in kept
        ),
        prefixes=old.prefixes,
        notes=old.notes,
        person=old.person,
        outer=old.outer,
    )
    return small, geometry, description, visual


def _ranges(
    ranges: Mapping[str, MotionRange], kept: set[str], values: Mapping[str, float], frames: Mapping[str, pin.Frame]
) -> dict[str, MotionRange]:
    """Ranges of motion of the kept joints; what locked joints share is moved into bounds and offsets."""
    found: dict[str, MotionRange] = {}
    for name, part in ranges.items():
        if isinstance(part, CoupledRange):
            moving = {joint: factor for joint, factor in part.joints.items() if joint in kept}
            still = sum(factor * values[joint] for joint, factor in part.joints.items() if joint not in kept)
            if moving:
                found[name] = CoupledRange(moving, part.bound - still)
        elif isinstance(part, EllipticRange):
            if any(joint in kept for axis in part.axes for joint in axis.joints):
                axes = []
                for axis in part.axes:
                    still = sum(values[joint] for joint in axis.joints if joint not in kept)
                    moving_joints = tuple(joint for joint in axis.joints if joint in kept)
                    axes.append(with_values(axis, joints=moving_joints, offset=axis.offset + still))
                found[name] = EllipticRange(tuple(axes))
        elif frames[part.reference].parentJoint != frames[part.limb].parentJoint:
            found[name] = part
    return found


def drop_rigid_pairs(geometry: pin.GeometryModel) -> list[ExcludedPair]:
    """Remove pairs of pieces on one joint from the geometry, since they never move against each other; return them."""
    pieces = geometry.geometryObjects
    together = [
        number
        for number, pair in enumerate(geometry.collisionPairs)
        if pieces[pair.first].parentJoint == pieces[pair.second].parentJoint
    ]
    return drop_pairs(geometry, together, "locked together")


def _restricted(whole: Articulated, name: str, part: Articulated) -> Array:
    """Posture of the reduced figure: the whole one's values of the remaining joints."""
    q, values = whole.posture(name), pin.neutral(part.model)
    for joint in range(1, part.model.njoints):
        source = whole.model.joints[whole.model.getJointId(part.model.names[joint])]
        target = part.model.joints[joint]
        values[target.idx_q : target.idx_q + target.nq] = q[source.idx_q : source.idx_q + source.nq]
    return np.asarray(values)
