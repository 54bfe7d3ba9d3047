"""The joints of an assembly, and constraints of users' own classes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array
from wholebody.base.checks import choice, flag, instance, known, numbers, shown
from wholebody.base.errors import InputError
from wholebody.geometry.placement import PlacementLike
from wholebody.methods.newton.assembly_bodies import WORLD, AssemblyBodies
from wholebody.methods.newton.batches import HARD, ONE_SIDED, EquationSet
from wholebody.methods.newton.own_rows import AssemblyConstraint, OwnRows, checked, names_of
from wholebody.methods.newton.quaternions import axes_along
from wholebody.methods.newton.task_batches import OnSurface, surface
from wholebody.tasks.inputs import direction, point, target_placement

if TYPE_CHECKING:
    from typing_extensions import Self


class JointRegister:
    """Joints by kind and pair of bodies, with their positions in both, so that a joint given twice is refused."""

    def __init__(self) -> None:
        """Make an empty register."""
        self._known: dict[tuple[str, frozenset[str]], list[dict[str, Array]]] = {}

    def add(self, kind: str, first: str, second: str, places: tuple[Array, Array] | None = None) -> None:
        """Add a joint of a kind between two bodies, with its positions (3,) in either; None if it has none.

        Joints at different positions are different, such as two hinges; one that exists already is refused.
        """
        listed = self._known.setdefault((kind, frozenset((first, second))), [])
        at = (np.zeros(3), np.zeros(3)) if places is None else places
        here = {first: at[0], second: at[1]}
        for other in listed:
            if all(np.abs(other[name] - place).max() <= 1e-9 for name, place in here.items()):  # m: the same place
                where = "" if places is None else " there"
                raise InputError(f"{kind}: {first!r} and {second!r} have one already{where}; leave the second out")
        listed.append(here)


class AssemblyJoints(AssemblyBodies):
    """Joints between the bodies of an assembly; `wholebody.Assembly` adds goals and solving."""

    def __init__(self, clearance: float = 0.0) -> None:
        super().__init__(clearance)
        self._joints = JointRegister()
        self._holding = EquationSet()

    def spherical(self, first: str, second: str, **where: Any) -> Self:
        """A point of one body stays at a point of the other. Takes `at`, or `at_first` and `at_second`."""
        a, b = self._pair(first, second, "spherical joint")
        ends = self._ends(a, b, "spherical joint", (first, second), **where)
        self._holding.coincide(a[0], b[0], f"the spherical joint of {first!r} and {second!r}", *ends)
        return self._connected(a[0], b[0])

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
        ends = self._ends((a, in_a), (b, in_b), "revolute joint", (first, second), **where)
        basis_a = axes_along(ours)
        # the second body's axes agree with the first's at the present placements, so that the angle is zero now
        basis_b = (turn_b.inverse() * turn_a * basis_a) if axis_second is None else axes_along(theirs)
        self._holding.coincide(a, b, what, *ends)
        self._holding.turn(a, b, what, basis_a, basis_b, 2)
        if limits is not None:
            self._holding.limit(a, b, f"the limit of {what[4:]}", basis_a, basis_b, low, high)
        return self._connected(a, b)

    def prismatic(self, first: str, second: str, *, axis: ArrayLike) -> Self:
        """Two bodies translate along one direction (3,) in the world, without rotation."""
        what = f"the prismatic joint of {shown(first)} and {shown(second)}"
        (a, _), (b, _) = self._pair(first, second, "prismatic joint")
        along = direction(axis, f"{what}: axis")
        self._joints.add("prismatic joint", first, second)
        here_a, here_b = self._placed(a), self._placed(b)
        turn_a, turn_b = pin.Quaternion(here_a.rotation), pin.Quaternion(here_b.rotation)
        basis = axes_along(turn_a.inverse() * along)
        self._holding.turn(a, b, what, basis, turn_b.inverse() * turn_a * basis, 3)
        way = turn_a.inverse() * (here_b.translation - here_a.translation)
        sides = basis.toRotationMatrix().T[:2]
        self._holding.slide(a, b, what, sides, np.zeros(3), sides @ way)
        return self._connected(a, b)

    def fixed(self, first: str, second: str, *, placement_second: PlacementLike | None = None) -> Self:
        """Two bodies keep their relative placement: the present one, or the second's given one in the first's frame."""
        what = f"the fixed joint of {shown(first)} and {shown(second)}"
        (a, in_a), (b, in_b) = self._pair(first, second, "fixed joint")
        if placement_second is None:
            wanted = self._placed(a).actInv(self._placed(b))
        else:
            wanted = in_a * target_placement(placement_second, what) * in_b.inverse()
        self._joints.add("fixed joint", first, second)
        self._holding.coincide(a, b, what, np.array(wanted.translation), np.zeros(3))
        self._holding.turn(a, b, what, pin.Quaternion(wanted.rotation), pin.Quaternion.Identity(), 3)
        self._fixed_pairs.append((a, b))
        return self._connected(a, b)

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
        self._holding.slide(a, b, what, unit, local, height, ONE_SIDED if side == "above" else HARD)
        return self._changed()

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
        half, radius = surface(shape, what)
        numbers_of = (at.rotation[None], at.translation[None], half[None], np.array([radius]), local[None])
        self._holding.add(OnSurface(np.array([[a, b]]), [what], *numbers_of), HARD)
        return self._changed()

    def constrain(self, term: AssemblyConstraint) -> Self:
        """Add a constraint of a class of your own; its derivative is compared with finite differences."""
        label = f"constraint {type(term).__name__}"
        instance(
            term, AssemblyConstraint, "constrain: term", "give an object of a subclass of wb.methods.AssemblyConstraint"
        )
        bodies = [self._names[known(name, self._names, "body", label)] for name in names_of(term, label)]
        one_sided = flag(term.one_sided, f"{label}: one_sided")
        size = checked(term, np.array([self._places[index] for index in bodies]), label)
        self._holding.add(OwnRows(np.array([bodies]), label, term, size), ONE_SIDED if one_sided else HARD)
        return self._changed()

    # ---- internals

    def _connected(self, a: int, b: int) -> Self:
        """Note a joint between two bodies, whose shapes are not tested against each other any more."""
        if min(a, b) >= 0:
            self._joined.add(frozenset((a, b)))
        return self._changed()

    def _pair(self, first: str, second: str, kind: str) -> tuple[tuple[int, Any], tuple[int, Any]]:
        a, b = self._frame(first, kind), self._frame(second, kind)
        if a[0] == b[0]:
            raise InputError(f"{kind}: {first!r} cannot be joined to itself; name two bodies")
        return a, b

    def _ends(
        self,
        a: tuple[int, Any],
        b: tuple[int, Any],
        kind: str,
        names: tuple[str, str],
        at: Any = None,
        at_first: Any = None,
        at_second: Any = None,
    ) -> tuple[Array, Array]:
        """The joint's position in either body; the joint is registered."""
        where = f"{kind} of {names[0]!r} and {names[1]!r}"
        if (at is None) == (at_first is None) or (at_first is None) != (at_second is None):
            raise InputError(f"{where}: give its place as at=(x, y, z) in the world, or as at_first and at_second")
        if at is None:
            ends = a[1].act(point(at_first, f"{where}: at_first")), b[1].act(point(at_second, f"{where}: at_second"))
        else:
            place = point(at, f"{where}: at")
            sides = [self._placed(index).actInv(place) for index in (a[0], b[0])]
            ends = np.array(sides[0]), np.array(sides[1])
        self._joints.add(kind, *names, ends)
        return ends
