"""Figures made of others: several side by side, one mounted on a frame of another, one with some of its joints."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, Indices, with_values
from wholebody.base.errors import InputError
from wholebody.figures.description import (
    ROOT_JOINT,
    Articulated,
    Chain,
    Description,
    ExcludedPair,
    JointCone,
    Member,
    is_root,
)
from wholebody.figures.motion_ranges import CoupledRange, EllipticRange, MotionRange, ReachCone
from wholebody.figures.self_pairs import carriers_above, drop_rigid_pairs
from wholebody.figures.state import State
from wholebody.geometry.large_models import geometry_model, pairs_of
from wholebody.geometry.proximity import PairTable, Proximity

OF_LINK = " (link)"  # after the name of a link, while models are joined

Parts: TypeAlias = tuple[pin.Model, pin.GeometryModel, Description, pin.GeometryModel | None]


class _Part(NamedTuple):
    """A figure in a model of several."""

    figure: Articulated  # as it is alone
    joints: tuple[int, ...]  # index in the model of each of its joints; of its world, the joint that carries that
    frames: tuple[int, ...]  # the same of its frames
    world: pin.SE3  # where its world is in the joint that carries it
    prefix: str  # what its names begin with
    seat: str  # the frame of the model that carries its world
    turn: Array  # (3, 3) of its world in the axes of that frame


def check_single(figure: Articulated, name: str) -> None:
    """Refuse by an InputError what is no one figure, or meets things with pieces that it has for them alone."""
    if figure.root == "several":
        raise InputError(f"{name!r} is several figures already; give each of them its own name")
    if figure.outer:
        raise InputError(
            f"{name!r} has detail {figure.detail!r}, whose pieces are too coarse to meet another figure; load it with "
            "detail='capsules' or 'hulls'"
        )


def joined_parts(members: Mapping[str, Member]) -> Parts:
    """Model, pieces, named parts and what is drawn of figures side by side; see `figures.join`."""
    model, parts = pin.Model(), list[_Part]()
    for name, (figure, at) in members.items():
        model, part = _with(model, figure, f"{name}/", 0, pin.SE3.Identity() if figure.roots else at)
        parts.append(part)
    # Pinocchio gives links other numbers where the next model is appended
    parts = [with_values(part, frames=_frames(model, part.figure, part.prefix, 0)) for part in parts]
    between = [_between(parts, first, second) for second in range(len(parts)) for first in range(second)]
    description = with_values(
        _merged(parts), postures=_postures(members), members=members, prefixes=tuple(part.prefix for part in parts)
    )
    return model, _geometry(parts, between), description, _visual(parts)


def joint_in(model: pin.Model, prefix: str, joint: str) -> int:
    """Index in the joined model of a figure's joint; what a fixed root carries hangs on the world."""
    return int(model.getJointId(prefix + joint)) if joint != model.names[0] else 0


def mounted_parts(base: Articulated, other: Articulated, frame: int, prefix: str, at: pin.SE3) -> Parts:
    """The same of a figure with another one on a frame of it; see `Figure.mounted`."""
    for one in (base, other):
        if one.root == "several":
            raise InputError(f"{one.name!r} is several figures; mount one on another before they are joined")
        check_single(one, one.name)
    figure = welded(other)
    model, part = _with(pin.Model(base.model), figure, prefix, frame, at)
    joints = (0, *(model.getJointId(joint) for joint in list(base.model.names)[1:]))
    frames = tuple(model.getFrameId(one.name, one.type) for one in base.model.frames)
    parts = [_Part(base, joints, frames, pin.SE3.Identity(), "", "universe", np.eye(3)), part]
    held: dict[str, Any] = {"base": base, "other": figure, "prefix": prefix}
    postures = {one: partial(_mounted_posture, posture=one, **held) for one in base.postures}
    rest = _on_model(model, posture=base.postures[0], **held)
    tested, excluded = _pairs_of_mount(model, _geometry(parts, []), parts, rest)
    known, carrying = _merged(parts), _carrying(base, frame)  # what carries it is a part of its limbs
    limbs = {prefix + name for name in figure.chains}
    chains = {
        name: Chain((*carrying, *one.joints), one.tip) if name in limbs else one for name, one in known.chains.items()
    }
    excluded = (*known.excluded, *excluded)
    description = with_values(known, postures=postures, chains=chains, excluded=excluded, person=base.describe().person)
    return model, _geometry(parts, [tested]), description, _visual(parts)


def welded(figure: Articulated) -> Articulated:
    """The figure with its free root fixed as in its first posture; itself where it is fixed."""
    return figure.reduced(figure.joints) if figure.roots else figure


def _carrying(base: Articulated, frame: int) -> tuple[str, ...]:
    """The joints of the limb on which a frame is, from the root outwards to it; none where it is on no limb."""
    carrier = base.model.names[base.model.frames[frame].parentJoint]
    limbs = (tuple(joints) for joints, _ in base.chains.values() if carrier in joints)
    return next((joints[: joints.index(carrier) + 1] for joints in limbs), ())


def _told_apart(model: pin.Model) -> pin.Model:
    """A copy in which no link has the name of a joint, which Pinocchio refuses to append."""
    result = pin.Model(model)
    for one in list(result.frames)[1:]:
        if one.type == pin.FrameType.BODY:
            one.name += OF_LINK
    return result


def _with(model: pin.Model, figure: Articulated, prefix: str, frame: int, at: pin.SE3) -> tuple[pin.Model, _Part]:
    """A model with a figure's joints on a frame of it too, and the figure as a part of it."""
    own = pin.Model(figure.model)
    for k in range(1, own.njoints):
        own.names[k] = prefix + (ROOT_JOINT if k in figure.roots.values() else own.names[k])
    for k in range(1, own.nframes):
        own.frames[k].name = prefix + own.frames[k].name
    seat, carrier = model.frames[frame], int(model.frames[frame].parentJoint)
    world = seat.placement * at
    made = pin.appendModel(_told_apart(model), own := _told_apart(own), frame, at)
    joints = (carrier, *(made.getJointId(name) for name in list(own.names)[1:]))
    # of a reduced figure Pinocchio puts the masses of what was locked to the wrong places
    for k in range(1, model.njoints):
        made.inertias[made.getJointId(model.names[k])] = model.inertias[k]
    for k in range(1, own.njoints):
        made.inertias[joints[k]] = own.inertias[k]
    seated = made.getJointId(model.names[carrier])
    made.inertias[seated] = model.inertias[carrier] + world.act(own.inertias[0])
    for one in made.frames:
        one.name = one.name.removesuffix(OF_LINK)
    frames = _frames(made, figure, prefix, frame)
    return made, _Part(figure, (seated, *joints[1:]), frames, world, prefix, seat.name, at.rotation)


def _frames(model: pin.Model, figure: Articulated, prefix: str, first: int) -> tuple[int, ...]:
    """Index in the model of each frame of a figure, `first` of its world."""
    own = list(figure.model.frames)[1:]
    return (first, *(model.getFrameId(prefix + one.name, one.type) for one in own))


def _geometry(parts: Sequence[_Part], between: Sequence[Indices]) -> pin.GeometryModel:
    """The pieces of all parts, one part after the other, with their pairs and those between two parts."""
    pieces, pairs = list[pin.GeometryObject](), [np.zeros((0, 2), dtype=np.intp)]
    for part in parts:
        pairs.append(pairs_of(part.figure.geometry) + len(pieces))
        pieces += _placed(part, part.figure.geometry)
    return geometry_model(pieces, np.concatenate([*pairs, *between]))


def _visual(parts: Sequence[_Part]) -> pin.GeometryModel | None:
    """What is drawn of all parts; None where that is their pieces."""
    if all(part.figure.visual is part.figure.geometry for part in parts):
        return None
    return geometry_model([piece for part in parts for piece in _placed(part, part.figure.visual)])


def _placed(part: _Part, geometry: pin.GeometryModel) -> list[pin.GeometryObject]:
    """Copies of the pieces of a part in the model of all."""
    made = []
    for piece in geometry.geometryObjects:
        copied = pin.GeometryObject(piece)
        copied.name = part.prefix + piece.name
        copied.parentJoint, copied.parentFrame = part.joints[piece.parentJoint], part.frames[piece.parentFrame]
        if piece.parentJoint == 0:
            copied.placement = part.world * piece.placement
        made.append(copied)
    return made


def _between(parts: Sequence[_Part], first: int, second: int) -> Indices:
    """(k, 2) every pair of pieces of two parts, but of those that one joint carries."""
    begin = np.cumsum([0, *(part.figure.geometry.ngeoms for part in parts)])
    joints = [[part.joints[piece.parentJoint] for piece in part.figure.geometry.geometryObjects] for part in parts]
    a, b = np.meshgrid(*(np.arange(len(joints[k])) for k in (first, second)), indexing="ij")
    kept = np.array(joints[first], dtype=np.intp)[a] != np.array(joints[second], dtype=np.intp)[b]
    return np.column_stack([a[kept] + begin[first], b[kept] + begin[second]])


def _pairs_of_mount(
    model: pin.Model, geometry: pin.GeometryModel, parts: Sequence[_Part], rest: Array
) -> tuple[Indices, tuple[ExcludedPair, ...]]:
    """Pairs (k, 2) of what carries and what is mounted, and those that are not tested, with the reason."""
    pieces = geometry.geometryObjects
    joint = np.array([piece.parentJoint for piece in pieces], dtype=np.intp)
    above = carriers_above(model, joint)
    seat = parts[1].joints[0]
    pairs = _between(parts, 0, 1)
    probe = geometry_model(list(pieces), pairs)
    # what starts within 1 mm of its carrier is not tested against it
    near = Proximity(PairTable(model, probe)).query(State(model).update(rest).data, 1e-3).pair
    touching = {(a, b) for a, b in near.tolist() if joint[a] in (seat, above[seat])}
    why = []
    for a, b in pairs.tolist():
        neighbours = above[joint[a]] == joint[b] or above[joint[b]] == joint[a]
        why.append("neighbours" if neighbours else "touch where it is mounted" if (a, b) in touching else "")
    kept = np.array([not reason for reason in why], dtype=bool)
    excluded = [
        ExcludedPair(pieces[a].name, pieces[b].name, reason)
        for (a, b), reason in zip(pairs.tolist(), why, strict=True)
        if reason
    ]
    return pairs[kept], tuple(excluded)


def _merged(parts: Sequence[_Part]) -> Description:
    """The named parts of all, each with the prefix of its part; without postures."""
    known = [_described(part) for part in parts]

    def all_of(field: str) -> dict[str, Any]:
        return {name: value for one in known for name, value in getattr(one, field).items()}

    def listed(field: str) -> tuple[Any, ...]:
        return tuple(value for one in known for value in getattr(one, field))

    return Description(
        groups=all_of("groups"), chains=all_of("chains"), frames=listed("frames"), segments=listed("segments"),
        postures={}, cones=all_of("cones"), collision_groups=all_of("collision_groups"), effort=all_of("effort"),
        excluded=listed("excluded"), ranges=all_of("ranges"), root_effort=listed("root_effort"), notes=listed("notes"),
    )  # fmt: skip


def _described(part: _Part) -> Description:
    old: Description = part.figure.describe()
    prefix, figure = part.prefix, part.figure

    def named(names: Sequence[str]) -> tuple[str, ...]:
        return tuple(prefix + name for name in names)

    groups = {prefix + name: named(joints) for name, joints in old.groups.items()}
    if prefix:
        groups[prefix[:-1]] = named(figure.joints)
    return with_values(
        old,
        groups=groups,
        chains={prefix + name: Chain(named(joints), prefix + tip) for name, (joints, tip) in old.chains.items()},
        frames=named(old.frames),
        segments=named(old.segments),
        cones={prefix + name: _named_cone(cone, part) for name, cone in old.cones.items()},
        collision_groups={prefix + name: prefix + group for name, group in old.collision_groups.items()},
        effort={prefix + name: weight for name, weight in old.effort.items()},
        excluded=tuple(ExcludedPair(prefix + a, prefix + b, why) for a, b, why in old.excluded),
        ranges={prefix + name: _named_range(one, prefix) for name, one in old.ranges.items()},
        root_effort=old.root_effort[: 2 * len(figure.roots)],
        notes=tuple(f"{prefix[:-1]}: {note}" if prefix else note for note in old.notes),
    )


def _named_cone(joint: JointCone, part: _Part) -> JointCone:
    if joint.reference != "universe":
        return with_values(joint, reference=part.prefix + joint.reference, limb=part.prefix + joint.limb)
    return with_values(turned_cone(joint, part.turn), reference=part.seat, limb=part.prefix + joint.limb)


def turned_cone(joint: JointCone, turn: Array) -> JointCone:
    """A cone with its axes in the world turned (3, 3); one with a limb's axes as it is."""
    cone = ReachCone(joint.cone.vertices @ turn.T, turn @ joint.cone.visible)
    return with_values(joint, cone=cone) if joint.reference == "universe" else joint


def _named_range(part: MotionRange, prefix: str) -> MotionRange:
    if isinstance(part, CoupledRange):
        return CoupledRange({prefix + joint: factor for joint, factor in part.joints.items()}, part.bound)
    if isinstance(part, EllipticRange):
        axes = (with_values(axis, joints=tuple(prefix + joint for joint in axis.joints)) for axis in part.axes)
        return EllipticRange(tuple(axes))
    return with_values(part, reference=prefix + part.reference, limb=prefix + part.limb)


def _postures(members: Mapping[str, Member]) -> dict[str, Callable[[Articulated], Array]]:
    """The named postures: that of all first postures, those that several may have, and those of each."""
    figures = {name: member.figure for name, member in members.items()}
    first = next(iter(figures.values())).postures[0]
    found: dict[str, Callable[[Articulated], Array]] = {first: partial(posture_of_all, postures={})}
    for posture in dict.fromkeys(posture for figure in figures.values() for posture in figure.postures):
        chosen = {name: posture for name, figure in figures.items() if posture in figure.postures}
        found.setdefault(posture, partial(posture_of_all, postures=chosen))
    for name, figure in figures.items():
        for posture in figure.postures:
            found[f"{name}/{posture}"] = partial(posture_of_all, postures={name: posture})
    return found


def posture_of_all(figure: Articulated, postures: Mapping[str, str | Array]) -> Array:
    """A posture (nq,) of joined figures from one of each, by name or as an array; see `Figure.posture`."""
    q = np.array(pin.neutral(figure.model))
    for name in postures:
        checks.known(name, figure.members, "figure", "posture")
    for name, (one, at) in figure.members.items():
        given = postures.get(name, one.postures[0])
        if isinstance(given, str):
            own = one.posture(given)
            for joint in one.roots.values():
                idx = int(one.model.joints[joint].idx_q)
                own[idx : idx + 7] = pin.SE3ToXYZQUAT(at * pin.XYZQUATToSE3(own[idx : idx + 7]))
        else:
            own = checks.posture(given, one.model.nq, f"posture of {name!r}")
        figure.part(name, q)[:] = own
    return q


def _mounted_posture(made: Articulated, base: Articulated, posture: str, other: Articulated, prefix: str) -> Array:
    """A posture of what carries, by name, with what is mounted in its first one."""
    return _on_model(made.model, base, posture, other, prefix)


def _on_model(model: pin.Model, base: Articulated, posture: str, other: Articulated, prefix: str) -> Array:
    q = pin.neutral(model)
    for figure, own, before in ((base, base.posture(posture), ""), (other, other.neutral, prefix)):
        _take_values(q, model, figure, own, before)
    return np.asarray(q)


def _take_values(q: Array, model: pin.Model, figure: Articulated, own: Array, prefix: str = "") -> None:
    """Take the values of a figure's posture `own` into a posture of a model, for the joints that it has."""
    for k in range(1, figure.model.njoints):
        name, source = prefix + figure.model.names[k], figure.model.joints[k]
        if model.existJointName(name):
            target = model.joints[model.getJointId(name)]
            q[target.idx_q : target.idx_q + target.nq] = own[source.idx_q : source.idx_q + source.nq]


def reduced_parts(figure: Articulated, keep: tuple[str, ...], q: Array) -> Parts:
    """Model, pieces, named parts and what is drawn of a figure of which only some joints move; see `Figure.reduced`."""
    if not keep:
        raise InputError("a reduced figure needs at least one joint; name joints, groups or 'root'")
    model, old = figure.model, figure.describe()
    kept = {figure.joint_id(name) for name in keep}
    leads = {int(model.joints[joint].idx_q) for joint in kept}
    kept |= {joint for joint in range(1, model.njoints) if int(model.joints[joint].idx_q) in leads}
    locked = [joint for joint in range(1, model.njoints) if joint not in kept]
    small, (geometry, visual) = pin.buildReducedModel(model, [figure.geometry, figure.visual], locked, q)
    fixed = drop_rigid_pairs(geometry)
    names = {name for name in small.names if not is_root(name)}
    frames = {frame.name: frame for frame in small.frames}
    efforts = zip(figure.roots.values(), old.root_effort[::2], old.root_effort[1::2], strict=False)

    def moving(joints: Sequence[str]) -> tuple[str, ...]:
        return tuple(joint for joint in joints if joint in names)

    description = with_values(
        old,
        groups={name: left for name, members in old.groups.items() if (left := moving(members))},
        chains={name: Chain(left, tip) for name, (joints, tip) in old.chains.items() if (left := moving(joints))},
        postures={name: partial(_restricted, figure, name) for name in old.postures},
        cones={
            name: cone
            for name, cone in old.cones.items()
            if frames[cone.reference].parentJoint != frames[cone.limb].parentJoint
        },
        excluded=(*old.excluded, *fixed),
        ranges=_ranges(old.ranges, names, figure.joint_values(q), frames),
        root_effort=tuple(share for joint, *pair in efforts for share in pair if joint in kept),
        members={},
    )
    return small, geometry, description, None if figure.visual is figure.geometry else visual


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


def _restricted(whole: Articulated, name: str, part: Articulated) -> Array:
    """Posture of the reduced figure: the whole one's values of the remaining joints."""
    q = pin.neutral(part.model)
    _take_values(q, part.model, whole, whole.posture(name))
    return np.asarray(q)
