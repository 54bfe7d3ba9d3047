"""A figure: an articulated body with its geometry, and its joints by name."""

from __future__ import annotations

import copyreg
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, Indices, as_dict
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.base.pool import Loan, Pool, Pooled
from wholebody.figures.body_spec import geometry_of
from wholebody.figures.description import Description, Mount, Place, followers_of, is_root, limits_of
from wholebody.figures.joining import mounted_parts, posture_of_all, reduced_parts
from wholebody.figures.model_check import LARGEST, Turning, archived, check_model, with_joint_frames
from wholebody.figures.postures import grounded
from wholebody.figures.state import State, free_roots, root_freedoms
from wholebody.geometry.placement import placement


def _joints_of(names: Sequence[str], prefix: str) -> range:
    """Indices of the joints of a model whose names begin with a prefix."""
    found = [k for k in range(1, len(names)) if names[k].startswith(prefix)]
    return range(found[0], found[-1] + 1) if found else range(0)


copyreg.pickle(pin.Model, archived)


class Figure(checks.FixedAttributes):
    """An articulated body: Pinocchio's model and geometry, with named joint groups, chains, frames and postures.

    It never changes, so any number of scenes and threads may share one. It can be pickled and copied. Methods that take
    a posture raise an `InputError` if it has the wrong shape or is not finite, those that take names an
    `UnknownNameError` with the nearest names, or an `InputError` if a name is no text.

    Attributes:
        name: such as "human".
        model: Pinocchio's model; `model.nq` numbers make a posture, `model.nv` a displacement.
        geometry: the convex pieces and the pairs of them that can touch. A piece is called "<segment>" or
            "<segment>:<k>".
        visual: the geometry that is drawn: the visuals of a URDF, whose meshes are named by `meshPath` and read when
            they are drawn; otherwise the pieces.
        detail: "spheres", "capsules", "hulls", or "own" for the geometry of a URDF. Spheres are too coarse to meet
            things: `outer` does.
        root: "free" (a floating base) or "fixed"; "several" of figures that were joined.
        roots: free root to the index of its joint: "root", or "anna/root" of a joined figure.
        members: figures that were joined, by name; empty for one figure.
        bodies: what the names of each figure's parts begin with, such as "anna/", to the indices of its joints; "" for
            one figure.
        joints: names of the joints in the model's order, without the free root.
        groups: group to joint names, without the root.
        chains: limb to its joints from the root outwards, and the frame at its tip.
        frames: names of frames for goals.
        segments: names of the links; they are frames too.
        cones: reach cones of shoulders and hips.
        ranges: ranges of motion that more than one joint angle decides, by name; see `figures.motion_ranges`.
        collision_groups: segment to collision group ("torso_head", "left_arm", ...).
        excluded_pairs: pairs of pieces that are never tested, with the reason.
        notes: sentences on what had to be changed about the geometry of a file, or about stated dimensions.
        limits: joint limits as arrays.
        loaded_as: name or path and options by which `wb.load` or `adjustable` made it; None for others.
        mount: of a figure that `mounted` made: both figures, frame, name and placement; otherwise None.
        followers: joint to the law by which it follows another (mimic).
        effort_weights: (nv,) weight of each degree of freedom in the effort.
        neutral_weights: (nv,) weight of each degree of freedom in the displacement from neutral: 1, and 0 for the root.
        runs: objects that runs on any of its scenes borrow.

    Examples:
        >>> human.joint_values(standing)["left_elbow_flexion"] >= 0.0
        True
    """

    _settable = frozenset({"loaded_as", "mount"})
    _correction = "a figure never changes: load another one with wb.load(...)"

    def __init__(
        self,
        name: str,
        model: pin.Model,
        geometry: pin.GeometryModel,
        detail: str,
        description: Description,
        visual: pin.GeometryModel | None = None,
    ) -> None:
        """Assemble a figure; `wholebody.load` is the usual way to get one.

        Raises:
            InputError: a mass, a position or a limit of the model is not finite or is impossible.
        """
        check_model(model, name)
        model = with_joint_frames(model)
        self.name, self.model, self.geometry, self.detail = name, model, geometry, detail
        self.visual = geometry if visual is None else visual
        self.groups = MappingProxyType(dict(description.groups))
        self.chains = MappingProxyType(dict(description.chains))
        self.frames, self.segments = description.frames, description.segments
        self.cones = MappingProxyType(dict(description.cones))
        self.ranges = MappingProxyType(dict(description.ranges))
        self.collision_groups = MappingProxyType(dict(description.collision_groups))
        self.excluded_pairs, self.notes = description.excluded, description.notes
        self.loaded_as: tuple[str, dict[str, Any]] | None = None
        self.mount: Mount | None = None
        self.members = MappingProxyType(dict(description.members))
        self._states = Pool(lambda: State(model), at_most=2)  # 6.5 MB for 55 freedoms, 27 MB for 95
        self.runs = Pooled()
        self._description = description
        self._made: dict[str, Array] = {}
        self._outer: tuple[pin.GeometryObject, ...] | None = None
        names = list(model.names)
        self.roots = MappingProxyType({f"{names[k].rpartition('/')[0]}/root".lstrip("/"): k for k in free_roots(model)})
        several = description.prefixes != ("",)
        self.root = "several" if several else "free" if self.roots else "fixed"
        self.bodies = MappingProxyType({prefix: _joints_of(names, prefix) for prefix in description.prefixes})
        self._frame_ids = {frame.name: index for index, frame in reversed(list(enumerate(model.frames)))}
        self._places: dict[str, Place] = {}
        self._joint_ids = {name: index for index, name in enumerate(model.names) if index > 0}
        self.joints: tuple[str, ...] = tuple(name for name in self._joint_ids if not is_root(name))
        self.limits = limits_of(model)
        self._turning = Turning(model)
        self.followers = MappingProxyType(followers_of(model))
        self.effort_weights = np.ones(model.nv)
        for joint, weight in description.effort.items():
            if joint in self._joint_ids:
                self.effort_weights[self.dofs([joint])] = weight
        root = root_freedoms(model)
        self.neutral_weights = np.where(root, 0.0, 1.0)
        self.effort_weights[root] = np.repeat(description.root_effort, 3)[: int(root.sum())]

    def __repr__(self) -> str:
        who = self._description.person
        worn = {} if who is None else {name: getattr(who, name) for name in ("age", "shoes", "clothing")}
        own = "".join(f"{name}={value:g}, " for name, value in worn.items() if value)
        return (
            f"Figure({self.name!r}, {own}detail={self.detail!r}, root={self.root!r}, "
            f"nq={self.model.nq}, nv={self.model.nv}, "
            f"pieces={self.geometry.ngeoms}, pairs={len(self.geometry.collisionPairs)})"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the arguments that it is made from; read-only mappings cannot be pickled."""
        parts = as_dict(self._description)
        known: dict[str, Any] = {
            name: dict(part) if isinstance(part, Mapping) else part for name, part in parts.items()
        }
        visual = None if self.visual is self.geometry else self.visual
        made_from = (self.name, self.model, self.geometry, self.detail, Description(**known), visual)
        return Figure, made_from, {"loaded_as": self.loaded_as, "mount": self.mount}

    @property
    def outer(self) -> tuple[pin.GeometryObject, ...]:
        """The pieces that meet things in the world in place of those of `geometry`; empty if its own pieces do.

        They are not drawn: the fourth number of `meshColor` is 0.
        """
        if self._outer is None:
            solids = () if self._description.outer is None else self._description.outer()
            made = geometry_of(self.model, solids, ())
            for piece in made.geometryObjects:
                piece.name, piece.meshColor = f"{piece.name} (outer)", np.zeros(4)
            self._outer = tuple(made.geometryObjects)
        return self._outer

    @property
    def postures(self) -> tuple[str, ...]:
        """Names of the postures; the first one is the default start of a problem."""
        return tuple(self._description.postures)

    def posture(self, name: str | Mapping[str, str | Array]) -> Array:
        """Return a copy of a named posture, shape (nq,).

        Of figures that were joined a mapping may be given: figure to a posture of it, by name or as an array. Those
        that it leaves out have their first posture.
        """
        if isinstance(name, Mapping):
            return posture_of_all(self, name)
        checks.known(name, self.postures, "posture")
        if name not in self._made:
            self._made[name] = self._description.postures[name](self)
        return np.array(self._made[name])

    def part(self, name: str, q: Array) -> Array:
        """The posture of one of the joined figures in a posture of all, (nq,) or (n, nq): a view of those numbers."""
        checks.known(name, self.members, "figure", "part")
        q = checks.array(q, "part: q", wanted := f"a posture of {self.model.nq} values, or several")
        if q.shape[-1:] != (self.model.nq,):
            raise InputError(f"part: q has shape {q.shape}; give {wanted}")
        joints = [self.model.joints[joint] for joint in self.bodies[f"{name}/"]]
        first = min((int(joint.idx_q) for joint in joints), default=0)
        return q[..., first : max((int(joint.idx_q) + int(joint.nq) for joint in joints), default=0)]

    @property
    def neutral(self) -> Array:
        """The posture of least discomfort, shape (nq,): the first named one."""
        return self.posture(self.postures[0])

    def frame_id(self, name: str) -> int:
        """Return the index of a frame, a segment or a joint in `model.frames`."""
        if not isinstance(name, str) or name not in self._frame_ids:
            checks.known(name, self._frame_ids, "frame", offered={*self.frames, *self.segments})
        return int(self._frame_ids[name])

    def place_of(self, name: str) -> Place:
        """Return where a frame, a segment or a joint is fixed to the model; found once."""
        if not isinstance(name, str) or name not in self._places:
            frame = self.model.frames[index := self.frame_id(name)]
            self._places[name] = Place(index, int(frame.parentJoint), pin.SE3(frame.placement))
        frame, joint, placement = self._places[name]
        return Place(frame, joint, placement.copy())

    def placement(self, q: Array, name: str) -> pin.SE3:
        """Return the placement in the world, at the posture q (nq,), of a frame, a segment or a joint."""
        frame = self.frame_id(name)
        with self.posed(q) as state:
            return state.frame(frame).copy()

    def posed(self, q: Array) -> Loan[State]:
        """Return a context with a state at the posture q (nq,), kept for others: do not move it, copy what is to stay.

        To make a state takes longer than to state the rest of a problem.
        """
        return self._states.borrow(lambda state: state.at(q))

    def joint_id(self, name: str) -> int:
        """Return the index of a joint in the model; "root", or "anna/root", is a free root."""
        if isinstance(name, str) and name in self.roots:
            return self.roots[name]
        return self._joint_ids[checks.known(name, self._joint_ids, "joint", offered=self.joints)]

    def joint_names(self, names: str | Iterable[str]) -> tuple[str, ...]:
        """Return joint names with groups replaced by their joints, each once, in the order given."""
        found: dict[str, None] = {}
        for name in [names] if isinstance(names, str) else checks.listed(names, "names", "['left_arm']"):
            if not isinstance(name, str):
                raise InputError(f"{checks.shown(name)} is not the name of a joint or group; give a text")
            if name in self.groups:
                found.update(dict.fromkeys(self.groups[name]))
            elif name in self._joint_ids or name in self.roots:
                found[name] = None
            else:
                raise UnknownNameError("joint or group", name, {*self.joints, *self.groups, *(self.roots or ["root"])})
        return tuple(found)

    def dofs(self, names: str | Iterable[str]) -> Indices:
        """Return the indices in the tangent vector, ascending, of joints and groups; "root" is the six of a free root.

        The index of a joint that follows another (mimic) is that of the followed joint.
        """
        places: set[int] = set()
        for name in self.joint_names(names):
            joint = self.model.joints[self.joint_id(name)]
            places.update(range(joint.idx_v, joint.idx_v + joint.nvExtended))
        return np.array(sorted(places), dtype=np.intp)

    def joint_values(self, q: Array) -> dict[str, float]:
        """Return the value of each one-degree joint by name at q (nq,): radians, or metres for prismatic joints."""
        q = self._checked(q)
        values = {}
        for name in self.joints:
            joint = self.model.joints[self._joint_ids[name]]
            if name in self.followers:
                values[name] = self.followers[name].value(q)
            elif joint.nq == 1:
                values[name] = float(q[joint.idx_q])
            elif (joint.nq, joint.nv) == (2, 1):
                values[name] = float(np.arctan2(q[joint.idx_q + 1], q[joint.idx_q]))
        return values

    def with_joints(self, q: Array, values: Mapping[str, float]) -> Array:
        """Return a copy of q (nq,) with some joints at other values: radians, or metres for prismatic joints.

        A value of a joint that follows another (mimic) moves the followed joint.

        Raises:
            InputError: a value that is not finite, or a joint with more than one degree of freedom.
        """
        q = self._checked(q).copy()
        if not isinstance(values, Mapping):
            raise InputError(
                f"values is {checks.shown(values)}; give values by joint, such as {{'left_elbow_flexion': 0.5}}"
            )
        for name, given in values.items():
            joint = self.model.joints[self.joint_id(name)]
            value = checks.number(given, f"joint {name!r}", -LARGEST, LARGEST, "radians (metres for sliding joints)")
            if name in self.followers:
                q[joint.idx_q] = self.followers[name].leading(value)
                self._turning.warn_of(name, value, joint.idx_q, q)
            elif joint.nq == 1:
                q[joint.idx_q] = value
                self._turning.warn_of(name, value, joint.idx_q, q)
            elif (joint.nq, joint.nv) == (2, 1):
                checks.warn_of_degrees(value, f"joint {name!r}")
                q[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
            else:
                raise InputError(
                    f"joint {name!r} has {joint.nv} degrees of freedom; set its part of the posture itself"
                )
        return q

    def warn_of_angles(self, q: Array, what: str) -> bool:
        """Warn of the angle farthest out of limits in q, (nq,) or (n, nq), `what` it is called; whether it was said."""
        return self._turning.warn(q, what)

    def tangent_bounds(self, q: Array) -> tuple[Array, Array]:
        """Return lower and upper bound, each (nv,), of the displacement of q (nq,) within the limits.

        Infinite without a limit. If q is beyond a limit, both bounds have the sign of the motion back.
        """
        return self.limits.room(self._checked(q), self.model.nv)

    def within_limits(self, q: Array, tolerance: float = 1e-9) -> bool:
        """Whether every limited joint is within its limits at q (nq,), to a tolerance in radians or metres."""
        tolerance = checks.number(tolerance, "tolerance", 0.0, LARGEST)
        value = self._checked(q)[self.limits.idx_q]
        return bool(((value >= self.limits.lower - tolerance) & (value <= self.limits.upper + tolerance)).all())

    def clamp(self, q: Array) -> Array:
        """Return a copy of q (nq,) with every limited joint moved to its nearest allowed value."""
        q, (idx_q, _, lower, upper) = self._checked(q), self.limits
        within, some = q.copy(), idx_q if len(idx_q) < len(q) else slice(None)  # all are in order
        within[some] = np.minimum(np.maximum(q[some], lower), upper)
        return np.asarray(within)

    def grounded(self, q: Array, scene: Any) -> Array:
        """Return a copy of q (nq,) moved vertically until the lowest segments stand on the things of a scene.

        What the figure carries is not looked at. Of figures that were joined each with a free root is moved alone, and
        none stands on another.

        Raises:
            InputError: the root is fixed, nothing is below the figure, or the scene has another figure.
        """
        if not self.roots:
            raise InputError(f"{self.name} has a fixed root and stays where it is; load it with root='free'")
        if getattr(scene, "model", None) is not self.model or not hasattr(scene, "piece_owner"):
            raise InputError(f"grounded: give a scene of this figure, not {checks.shown(scene)}; see wb.Scene(figure)")
        model, q = scene.model, self._checked(q)
        for name, joint in self.roots.items():
            prefix = name.removesuffix("root")
            own = tuple(segment for segment in self.segments if segment.startswith(prefix))
            q = grounded(model, own, q, scene, int(model.joints[joint].idx_q) + 2)
        return q

    def reduced(self, joints: str | Sequence[str], posture: str | Array | None = None) -> Figure:
        """Return a figure that keeps only some joints; the others are locked, and pairs that cannot move are dropped.

        Args:
            joints: joints and groups to keep; "root" keeps a free root, which is locked otherwise.
            posture: values of the locked joints: a name or an array (nq,); the first posture if left out.

        Raises:
            InputError: no joint remains.
        """
        q = self.neutral if posture is None else self.posture(posture) if isinstance(posture, str) else posture
        self.warn_of_angles(self._checked(q), "reduced: posture")
        model, geometry, description, visual = reduced_parts(self, self.joint_names(joints), self._checked(q))
        return Figure(self.name, model, geometry, self.detail, description, visual)

    def mounted(self, other: Figure, *, on: str, name: str | None = None, at: Any = (0.0, 0.0, 0.0)) -> Figure:
        """Return this figure with another one on a frame: a hand on an arm, a tool with joints in a hand.

        A free root of the other is fixed as in its first posture. Its name comes before its names: "tool/tip".
        Pieces of the two are tested against each other, but for those that touch where it is mounted; see
        `excluded_pairs`.

        Args:
            other: what is mounted.
            on: the frame of this figure that carries the world of the other.
            name: of the other; its own if left out.
            at: where its world is in that frame: (x, y, z), (x, y, z, qx, qy, qz, qw), a 4x4 matrix or a pin.SE3.

        Raises:
            UnknownNameError: there is no such frame.
            InputError: no figure, or a name or a placement that cannot be used.
        """
        checks.instance(other, Figure, "mounted: other", "load one with wb.load('hand')")
        frame, prefix = self.frame_id(on), checks.text(other.name if name is None else name, "mounted: name")
        if "/" in prefix or prefix in {*self.groups, *self.joints}:
            raise InputError(f"mounted: {self.name} has a part {prefix!r}, or it has a slash; give it another name")
        place = placement(at, "mounted: at")
        parts = mounted_parts(self, other, frame, f"{prefix}/", place)
        made = Figure(f"{self.name} with {prefix}", *parts[:2], "own", *parts[2:])
        made.mount = Mount(self, other, on, prefix, place)
        return made

    def describe(self) -> Description:
        """Return the named parts of the figure, to build another one from them."""
        return self._description

    def _checked(self, q: Any) -> Array:
        return checks.posture(q, self.model.nq)
