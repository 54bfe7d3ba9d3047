"""The joints of an assembly, and constraints of users' own classes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array, Indices
from wholebody.base.checks import choice, flag, instance, known, numbers, shown
from wholebody.base.errors import InputError
from wholebody.geometry.placement import PlacementLike
from wholebody.geometry.shapes import Box, Capsule, Shape, Sphere
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.assembly_bodies import WORLD, AssemblyBodies
from wholebody.methods.newton.batches import (
    HARD,
    ONE_SIDED,
    OTHER_PLACE,
    OTHER_TURN,
    PLACE,
    TURN,
    Batch,
    EquationSet,
)  # fmt: skip
from wholebody.methods.newton.own_rows import AssemblyConstraint, OwnRows, checked, names_of
from wholebody.methods.newton.quaternions import axes_along
from wholebody.tasks.inputs import direction, point, target_placement

if TYPE_CHECKING:
    from typing_extensions import Self


class OnSurface(Batch):
    """The signed distance of a point of the second body to a rounded box that is fixed to the first body [m].

    A box of half sizes h, all points within the radius r of it: the distance of the local point p is
    |max(|p| - h, 0)| + min(max_i(|p_i| - h_i), 0) - r. With h = 0 it is a sphere, with h along z a capsule, with r = 0
    a box. Its derivative is the unit normal n of the nearest surface point.
    """

    size = 1
    pattern = np.ones((1, 14), dtype=bool)

    def __init__(
        self,
        bodies: Indices,
        labels: list[str],
        turns: Array,
        centers: Array,
        half: Array,
        radius: Array,
        points: Array,
    ) -> None:
        """Take surfaces by axes (k, 3, 3), centers (k, 3), half sizes (k, 3) and radii (k,); points (k, 3)."""
        super().__init__(bodies, labels)
        self.turns, self.centers, self.half, self.radius, self.points = turns, centers, half, radius, points

    def _local(self, x: Array) -> tuple[Array, Array]:
        """(k, 3) the points in the surfaces' axes, and from the first body's origin to them in the world."""
        a, b = x[self.bodies[:, 0]], x[self.bodies[:, 1]]
        offset = b[:, PLACE] + quat.rotate(b[:, TURN], self.points) - a[:, PLACE]
        inside = quat.rotate(quat.conjugate(a[:, TURN]), offset) - self.centers
        return np.einsum("kji,kj->ki", self.turns, inside), offset

    def residual(self, x: Array) -> Array:  # noqa: D102
        local, _ = self._local(x)
        beyond = np.abs(local) - self.half
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        result: Array = (outside + np.minimum(beyond.max(axis=1), 0.0) - self.radius)[:, None]
        return result

    def jacobian(self, x: Array) -> Array:  # noqa: D102
        local, offset = self._local(x)
        beyond, sign = np.abs(local) - self.half, np.where(local < 0.0, -1.0, 1.0)
        out = np.maximum(beyond, 0.0)
        length = np.linalg.norm(out, axis=1)
        central = 1e-9  # m: nearer to the axis of a surface every direction leads outwards
        normal = np.where((length > central)[:, None], out / np.maximum(length, central)[:, None], 0.0)
        within = np.flatnonzero(length <= central)
        normal[within, beyond[within].argmax(axis=1)] = 1.0
        normal = np.einsum("kij,kj->ki", self.turns, normal * sign)  # in the first body
        first, second = x[self.bodies[:, 0], TURN], x[self.bodies[:, 1], TURN]
        push = quat.rotate(first, normal)
        result = np.zeros((len(self), 1, 14))
        result[:, 0, PLACE], result[:, 0, OTHER_PLACE] = -push, push
        result[:, 0, TURN] = np.einsum("ki,kij->kj", offset, quat.rotate_derivative(first, normal))
        result[:, 0, OTHER_TURN] = np.einsum("ki,kij->kj", push, quat.rotate_derivative(second, self.points))
        return result


def _surface(shape: Shape, where: str) -> tuple[Array, float]:
    """Half sizes (3,) and radius of a shape's surface as that of a rounded box, metres."""
    if isinstance(shape, Sphere):
        return np.zeros(3), shape.radius
    if isinstance(shape, Capsule):
        return np.array((0.0, 0.0, 0.5 * shape.length)), shape.radius
    if isinstance(shape, Box):
        return 0.5 * np.array(shape.size), 0.0
    raise InputError(
        f"{where}: a point stays on the surface of a box, a sphere or a capsule, not of a {type(shape).__name__}; "
        "use on_plane for one of its faces"
    )


@dataclass(frozen=True)
class Held:
    """A joint or a constraint: its name and equations, and what a joint connects.

    Attributes:
        name: of the kind and the bodies, as messages give it.
        kind, ends: kind of a joint and its positions (3,) by the names of its two bodies; empty for other constraints.
        joint: the two bodies of a joint, whose shapes are not tested against each other; empty for other constraints.
        fixed: whether it makes two bodies one.
        holds: whether it holds now.
        equations: what it asks.
    """

    name: str
    kind: str = ""
    ends: Mapping[str, Array] = field(default_factory=dict)
    joint: tuple[int, ...] = ()
    fixed: bool = False
    holds: bool = True
    equations: EquationSet = field(default_factory=EquationSet)

    def repeats(self, other: Held) -> bool:
        """Whether another is a joint of the same kind at the same place; two hinges at different places are two."""
        alike = other.holds and other.kind == self.kind != "" and other.ends.keys() == self.ends.keys()
        return alike and all(np.abs(other.ends[name] - end).max() <= 1e-9 for name, end in self.ends.items())


class AssemblyJoints(AssemblyBodies):
    """Joints between the bodies of an assembly; `wholebody.Assembly` adds goals and solving."""

    def __init__(self, clearance: float = 0.0) -> None:
        super().__init__(clearance)
        self._constraints: dict[str, Held] = {}

    @property
    def constraints(self) -> Mapping[str, bool]:
        """Names of the joints and constraints, and whether each holds now."""
        return {name: held.holds for name, held in self._constraints.items()}

    def release(self, constraint: str) -> Self:
        """Let a joint or constraint hold no more, by its name in `constraints`; the shapes that it joined may touch."""
        return self._set(constraint, holds=False)

    def hold(self, constraint: str) -> Self:
        """Let a joint or constraint that was released hold again; the next solve or frames close it."""
        return self._set(constraint, holds=True)

    def spherical(self, first: str, second: str, **where: Any) -> Self:
        """A point of one body stays at a point of the other. Takes `at`, or `at_first` and `at_second`."""
        a, b = self._pair(first, second, "spherical joint")
        held = self._joint(a, b, "spherical joint", (first, second), **where)
        end, other_end = held.ends.values()
        held.equations.coincide(a[0], b[0], f"the {held.name}", end, other_end)
        return self._keep(held)

    def revolute(
        self,
        first: str,
        second: str,
        *,
        axis: ArrayLike,
        limits: Sequence[float] | None = None,
        axis_second: ArrayLike | None = None,
        **where: Any,
    ) -> Self:
        """Two bodies turn about one axis.

        Args:
            first: name of a body, or "world".
            second: another.
            axis: (3,) direction in the world; in the first body's frame if `axis_second` is given.
            limits: least and greatest angle from the present one, radians.
            axis_second: (3,) the direction in the second body's frame.
            where: `at`, or `at_first` and `at_second`.
        """
        what = f"the revolute joint of {shown(first)} and {shown(second)}"
        (a, in_a), (b, in_b) = self._pair(first, second, "revolute joint")
        along = direction(axis, f"{what}: axis")
        turn_a, turn_b = (pin.Quaternion(self._placed(index).rotation) for index in (a, b))
        if axis_second is None:
            ours, theirs = turn_a.inverse() * along, turn_b.inverse() * along
        else:
            ours = in_a.rotation @ along
            theirs = in_b.rotation @ direction(axis_second, f"{what}: axis_second")
        low, high = (-np.inf, np.inf) if limits is None else numbers(limits, (2,), f"{what}: limits").tolist()
        if low >= high:
            raise InputError(f"{what}: limits {low:g} and {high:g} leave no room; give the lower one first")
        held = self._joint((a, in_a), (b, in_b), "revolute joint", (first, second), **where)
        basis_a = axes_along(ours)
        # the second body's axes agree with the first's at the present placements, so that the angle is zero now
        basis_b = (turn_b.inverse() * turn_a * basis_a) if axis_second is None else axes_along(theirs)
        end, other_end = held.ends.values()
        held.equations.coincide(a, b, what, end, other_end)
        held.equations.turn(a, b, what, basis_a, basis_b, 2)
        if limits is not None:
            held.equations.limit(a, b, f"the limit of {held.name}", basis_a, basis_b, low, high)
        return self._keep(held)

    def prismatic(self, first: str, second: str, *, axis: ArrayLike) -> Self:
        """Two bodies translate along one direction (3,) in the world, without rotation."""
        what = f"the prismatic joint of {shown(first)} and {shown(second)}"
        (a, _), (b, _) = self._pair(first, second, "prismatic joint")
        along = direction(axis, f"{what}: axis")
        held = self._placed_joint((a, b), "prismatic joint", (first, second))
        here_a, here_b = self._placed(a), self._placed(b)
        turn_a, turn_b = pin.Quaternion(here_a.rotation), pin.Quaternion(here_b.rotation)
        basis = axes_along(turn_a.inverse() * along)
        held.equations.turn(a, b, what, basis, turn_b.inverse() * turn_a * basis, 3)
        offset = turn_a.inverse() * (here_b.translation - here_a.translation)
        sides = basis.toRotationMatrix().T[:2]
        held.equations.slide(a, b, what, sides, np.zeros(3), sides @ offset)
        return self._keep(held)

    def fixed(self, first: str, second: str, *, placement_second: PlacementLike | None = None) -> Self:
        """Two bodies keep their relative placement: the present one, or the second's given one in the first's frame."""
        what = f"the fixed joint of {shown(first)} and {shown(second)}"
        (a, in_a), (b, in_b) = self._pair(first, second, "fixed joint")
        if placement_second is None:
            wanted = self._placed(a).actInv(self._placed(b))
        else:
            wanted = in_a * target_placement(placement_second, what) * in_b.inverse()
        held = self._placed_joint((a, b), "fixed joint", (first, second), fixed=True)
        held.equations.place(a, b, what, (wanted, pin.SE3.Identity()))
        return self._keep(held)

    def on_plane(
        self, body: str, place: ArrayLike, *, normal: ArrayLike, through: ArrayLike, of: str = WORLD, side: str = "on"
    ) -> Self:
        """A point of a body, (3,) in its frame, stays in a plane that is fixed to the world or to another body.

        Args:
            body: name.
            place: (3,) the point, metres.
            normal: (3,) of the plane, in the frame of `of`.
            through: (3,) a point of the plane, in the frame of `of`.
            of: name of the body to which the plane is fixed.
            side: "on", or "above" if the point may move along the normal.
        """
        what = f"the plane of {shown(body)} and {shown(of)}"
        choice(side, ("on", "above"), f"{what}: side")
        (a, in_a), (b, in_b) = self._frame(of, what), self._frame(body, what)
        if a == b:
            raise InputError(f"{what}: a body cannot stay on a plane of its own; name another one")
        unit = in_a.rotation @ direction(normal, f"{what}: normal")
        height = float(unit @ in_a.act(point(through, f"{what}: through")))
        local = np.array(in_b.act(point(place, f"{what}: place")))
        held = Held(what[4:])
        held.equations.slide(a, b, what, unit, local, height, ONE_SIDED if side == "above" else HARD)
        return self._keep(held)

    def on_surface(self, body: str, place: ArrayLike, *, of: str) -> Self:
        """A point of a body, (3,) in its frame, stays on the surface of another body's, or a thing's, shape.

        Args:
            body: name.
            place: (3,) the point, metres.
            of: a body or a thing with one shape, which is a box, a sphere or a capsule. A thing must not be moved
                afterwards: the point stays where the surface was.
        """
        what = f"the surface of {shown(of)} under {shown(body)}"
        b, in_b = self._moved(body, what)
        known(of, [*self._solids, *self._things], "body or thing with a shape", what)
        a = -1 if of in self._things else self._names[of]
        thing = self._things.get(of)
        listed = self._solids[of] if thing is None else ((thing.shape, thing.placement),)
        if a == b:
            raise InputError(f"{what}: a point cannot stay on a surface of its own body; name another one")
        if len(listed) != 1:
            raise InputError(f"{what}: {of!r} has {len(listed)} shapes; make it of one, or use on_plane")
        (shape, at), local = listed[0], in_b.act(point(place, f"{what}: place"))
        half, radius = _surface(shape, what)
        numbers_of = (at.rotation[None], at.translation[None], half[None], np.array([radius]), local[None])
        held = Held(what[4:])
        held.equations.add(OnSurface(np.array([[a, b]]), [what], *numbers_of), HARD)
        return self._keep(held)

    def constrain(self, term: AssemblyConstraint) -> Self:
        """Add a constraint of a class of your own; its derivative is compared with finite differences."""
        label = f"constraint {type(term).__name__}"
        instance(
            term, AssemblyConstraint, "constrain: term", "give an object of a subclass of wb.methods.AssemblyConstraint"
        )
        bodies = [self._names[known(name, self._names, "body", label)] for name in names_of(term, label)]
        one_sided = flag(term.one_sided, f"{label}: one_sided")
        size = checked(term, np.array([self._places[index] for index in bodies]), label)
        held = Held(label)
        held.equations.add(OwnRows(np.array([bodies]), label, term, size), ONE_SIDED if one_sided else HARD)
        return self._keep(held)

    # ---- internals

    def _keep(self, held: Held) -> Self:
        """Let a new joint or constraint hold; one of the same name that was released makes room for it."""
        name, number = held.name, 1
        while name in self._constraints and self._constraints[name].holds:
            number += 1
            name = f"{held.name} ({number})"
        self._constraints[name] = held
        return self._noted()

    def _set(self, name: str, *, holds: bool) -> Self:
        known(name, self._constraints, "joint or constraint")
        self._constraints[name] = replace(self._constraints[name], holds=holds)
        return self._noted()

    def _noted(self) -> Self:
        """Note which bodies joints connect now, and which of them are as one."""
        joints = [held for held in self._constraints.values() if held.joint and held.holds]
        self._joined = {frozenset(held.joint) for held in joints if min(held.joint) >= 0}
        self._fixed_pairs = [(held.joint[0], held.joint[1]) for held in joints if held.fixed]
        return self._changed()

    def _equations(self) -> EquationSet:
        """The equations of all that holds."""
        found = EquationSet()
        for held in self._constraints.values():
            if held.holds:
                found.extend(held.equations)
        return found

    def _pair(self, first: str, second: str, kind: str) -> tuple[tuple[int, Any], tuple[int, Any]]:
        a, b = self._frame(first, kind), self._frame(second, kind)
        if a[0] == b[0]:
            raise InputError(f"{kind}: {first!r} cannot be joined to itself; name two bodies")
        return a, b

    def _joint(
        self,
        a: tuple[int, Any],
        b: tuple[int, Any],
        kind: str,
        names: tuple[str, str],
        at: Any = None,
        at_first: Any = None,
        at_second: Any = None,
    ) -> Held:
        """A joint without its equations yet, with its position in either body."""
        where = f"{kind} of {names[0]!r} and {names[1]!r}"
        if (at is None) == (at_first is None) or (at_first is None) != (at_second is None):
            raise InputError(f"{where}: give its place as at=(x, y, z) in the world, or as at_first and at_second")
        if at is None:
            ends = a[1].act(point(at_first, f"{where}: at_first")), b[1].act(point(at_second, f"{where}: at_second"))
        else:
            place = point(at, f"{where}: at")
            ends = (np.array(self._placed(a[0]).actInv(place)), np.array(self._placed(b[0]).actInv(place)))
        return self._placed_joint((a[0], b[0]), kind, names, ends)

    def _placed_joint(
        self,
        bodies: tuple[int, int],
        kind: str,
        names: tuple[str, str],
        ends: tuple[Array, Array] | None = None,
        *,
        fixed: bool = False,
    ) -> Held:
        """The same with its positions (3,) in either body, None if it has none; refused if it exists already."""
        by_name = dict(zip(names, ends or (np.zeros(3), np.zeros(3)), strict=True))
        held = Held(f"{kind} of {names[0]!r} and {names[1]!r}", kind, by_name, bodies, fixed)
        if any(map(held.repeats, self._constraints.values())):
            where = "" if ends is None else " there"
            raise InputError(f"{kind}: {names[0]!r} and {names[1]!r} have one already{where}; leave the second out")
        return held
