"""Assemblies: bodies and joints that URDF cannot describe, such as closed chains, rings, stars and loose parts."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.arrays import Array
from wholebody.checks import choice, flag, known, number, numbers, shown, text, whole
from wholebody.errors import InputError
from wholebody.geometry.pieces import check_length
from wholebody.geometry.placement import PlacementLike
from wholebody.methods.inputs import ITERATIONS, TOLERANCE
from wholebody.methods.newton.assembly_solution import AssemblySolution, solved
from wholebody.methods.newton.batches import Batch, Key
from wholebody.methods.newton.equations import EquationSet, axes_along, unit_lengths
from wholebody.methods.newton.inequalities import KINDS, Kind
from wholebody.methods.newton.joint_register import JointRegister
from wholebody.methods.newton.kkt import kkt_algebra
from wholebody.methods.newton.linear_algebra.base import LinearAlgebra
from wholebody.methods.newton.linear_algebra.choice import NAMES, linear_algebra
from wholebody.methods.newton.linear_algebra.quasi_definite import QuasiDefinite
from wholebody.methods.newton.system import ActiveSystem, System, unit
from wholebody.pool import OneAtATime
from wholebody.tasks.inputs import direction, point, target_placement

WORLD = "world"
UNIT_TOLERANCE = 1e-3  # largest deviation of a quaternion from unit length; more is refused as a mistake
FINEST = 1e-12  # m, rad: least tolerance; below it only rounding remains


@dataclass
class _Prepared:
    """What solves of one pattern share.

    Attributes:
        algebra: name of the factorisation that was asked for.
        laid: types and bodies of the goals.
        held: batches of what must hold.
        system: all equations; their numbers follow the goals.
        factor: the analysed factorisation.
    """

    algebra: str
    laid: tuple[tuple[Key, bytes], ...]
    held: list[tuple[Batch, Key]]
    system: System
    factor: LinearAlgebra
    _nearest: QuasiDefinite | None = None

    def nearest(self) -> QuasiDefinite:
        """The analysed factorisation for the nearest place."""
        if self._nearest is None:
            self._nearest = kkt_algebra(self.system)
        return self._nearest


class Assembly:
    """Rigid bodies, joints between them and with the world, and goals; solved in full coordinates.

    Joints are given at the bodies' present placements: `at` and `axis` in the world. If the two sides do not fit
    yet, `at_first` and `at_second` give the position in either body's frame instead. Bodies need not be connected.

    A solve moves the bodies, so an assembly serves one thread at a time. It can be pickled; a copy is independent.
    """

    def __init__(self) -> None:
        """Make an assembly with the world alone."""
        self._names: dict[str, int] = {}
        self._places: list[Array] = []
        self._sizes: list[float] = []
        self._joints = JointRegister()
        self._holding, self._goals = EquationSet(), EquationSet()
        self._prepared: _Prepared | None = None
        self._retargeted = False
        self._alone = OneAtATime("assembly")
        self.structures = 0

    def __getstate__(self) -> dict[str, Any]:
        """Return the bodies, joints and goals, and the placements; data that a solve prepares are prepared anew."""
        return {name: value for name, value in self.__dict__.items() if name not in ("_prepared", "_alone")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._prepared, self._alone = None, OneAtATime("assembly")

    def __copy__(self) -> Assembly:
        return copy.deepcopy(self)

    # ---- bodies

    def body(self, name: str, at: PlacementLike = (0.0, 0.0, 0.0), *, size: float = 0.3) -> Assembly:
        """Add a body.

        Args:
            name: one that no other body has.
            at: (x, y, z), (x, y, z, qx, qy, qz, qw), a 4x4 matrix or a pin.SE3.
            size: metres from its origin to its rim; a rotation of the body counts as the motion of the rim.

        Raises:
            InputError: the name exists already, the size is not positive, or the placement cannot be read.
        """
        if text(name, "the name of a body") == WORLD or name in self._names:
            raise InputError(f"body {name!r}: the name is taken; give another one")
        length = check_length(size, f"body {name!r}: size")
        placed = pin.SE3ToXYZQUAT(target_placement(at, f"body {name!r}"))
        self._names[name] = len(self._places)
        self._places.append(np.array(placed))
        self._sizes.append(length)
        self._prepared = None
        return self

    @property
    def bodies(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self._names)

    def placement(self, name: str) -> Any:
        """Placement of a body (pin.SE3)."""
        return pin.XYZQUATToSE3(self._place(self._index(name, "placement")))

    # ---- joints

    def spherical(self, first: str, second: str, **where: Any) -> Assembly:
        """A point of one body stays at a point of the other. Takes `at`, or `at_first` and `at_second`."""
        a, b = self._pair(first, second, "spherical joint")
        ends = self._ends(a, b, "spherical joint", first, second, **where)
        self._holding.coincide(a, b, f"the spherical joint of {first!r} and {second!r}", *ends)
        return self._changed()

    def revolute(
        self,
        first: str,
        second: str,
        *,
        axis: ArrayLike,
        limits: Sequence[float] | None = None,
        axis_second: ArrayLike | None = None,
        **where: Any,
    ) -> Assembly:
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
        a, b = self._pair(first, second, "revolute joint")
        along = direction(axis, f"{what}: axis")
        turn_a, turn_b = pin.Quaternion(self._place(a)[3:]), pin.Quaternion(self._place(b)[3:])
        if axis_second is None:
            ours, theirs = turn_a.inverse() * along, turn_b.inverse() * along
        else:
            ours, theirs = along, direction(axis_second, f"{what}: axis_second")
        low, high = (-np.inf, np.inf) if limits is None else numbers(limits, (2,), f"{what}: limits").tolist()
        if low >= high:
            raise InputError(f"{what}: limits {low:g} and {high:g} leave no room; give the lower one first")
        ends = self._ends(a, b, "revolute joint", first, second, **where)  # registers the joint, after all other checks
        basis_a = axes_along(ours)
        # the second body's axes agree with the first's at the present placements, so that the angle is zero now
        basis_b = (turn_b.inverse() * turn_a * basis_a) if axis_second is None else axes_along(theirs)
        self._holding.coincide(a, b, what, *ends)
        self._holding.turn(a, b, what, basis_a, basis_b, 2)
        if limits is not None:
            self._holding.limit(a, b, f"the limit of {what[4:]}", basis_a, basis_b, low, high)
        return self._changed()

    def prismatic(self, first: str, second: str, *, axis: ArrayLike) -> Assembly:
        """Two bodies translate along one direction (3,) in the world, without rotation."""
        what = f"the prismatic joint of {shown(first)} and {shown(second)}"
        a, b = self._pair(first, second, "prismatic joint")
        along = direction(axis, f"{what}: axis")
        self._joints.add("prismatic joint", first, second)
        turn_a, turn_b = pin.Quaternion(self._place(a)[3:]), pin.Quaternion(self._place(b)[3:])
        basis = axes_along(turn_a.inverse() * along)
        self._holding.turn(a, b, what, basis, turn_b.inverse() * turn_a * basis, 3)
        way = turn_a.inverse() * (self._place(b)[:3] - self._place(a)[:3])
        for side in basis.toRotationMatrix().T[:2]:
            self._holding.slide(a, b, what, side, np.zeros(3), float(side @ way))
        return self._changed()

    def fixed(self, first: str, second: str, *, placement_second: PlacementLike | None = None) -> Assembly:
        """Two bodies keep their relative placement: the present one, or the second's given one in the first's frame."""
        what = f"the fixed joint of {shown(first)} and {shown(second)}"
        a, b = self._pair(first, second, "fixed joint")
        here = pin.XYZQUATToSE3(self._place(a)).actInv(pin.XYZQUATToSE3(self._place(b)))
        wanted = here if placement_second is None else target_placement(placement_second, what)
        self._joints.add("fixed joint", first, second)
        self._holding.coincide(a, b, what, np.array(wanted.translation), np.zeros(3))
        self._holding.turn(a, b, what, pin.Quaternion(wanted.rotation), pin.Quaternion.Identity(), 3)
        return self._changed()

    def on_plane(
        self, body: str, place: ArrayLike, *, normal: ArrayLike, through: ArrayLike, of: str = WORLD, side: str = "on"
    ) -> Assembly:
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
        a, b = self._index(of, what), self._index(body, what)
        if a == b:
            raise InputError(f"{what}: a body cannot stay on a plane of its own; name another one")
        unit = direction(normal, f"{what}: normal")
        height = float(unit @ point(through, f"{what}: through"))
        self._holding.slide(a, b, what, unit, point(place, f"{what}: place"), height, above=side == "above")
        return self._changed()

    # ---- goals

    def point_goal(self, body: str, target: ArrayLike, *, place: ArrayLike = (0.0, 0.0, 0.0)) -> Assembly:
        """Move a point of a body, (3,) in its frame, to a position in the world (3,), if possible."""
        what = f"the goal of {shown(body)}"
        ends = point(place, f"{what}: place"), point(target, f"{what}: target")
        self._goals.coincide(self._moved(body, what), -1, what, *ends, goal=True)
        return self._changed_goals()

    def frame_goal(self, body: str, target: PlacementLike) -> Assembly:
        """Move a body to a placement in the world, if possible."""
        what = f"the goal of {shown(body)}"
        wanted, index = target_placement(target, what), self._moved(body, what)
        self._goals.coincide(index, -1, what, np.zeros(3), np.array(wanted.translation), goal=True)
        identity = pin.Quaternion.Identity()
        self._goals.turn(index, -1, what, identity, pin.Quaternion(wanted.rotation), 3, goal=True)
        return self._changed_goals()

    def drop_goals(self) -> Assembly:
        """Take all goals out.

        Where others of the same bodies come in their place, what earlier solves laid out and analysed serves again.
        """
        self._goals = EquationSet()
        return self._changed_goals()

    # ---- solving

    def system(self) -> System:
        """The equations as they stand."""
        return System(len(self._places), [*self._held(), *self._goals.batches(len(self._places))], self._weight())

    def variables(self) -> Array:
        """(7 n,) the placements of the bodies."""
        return np.concatenate(self._places)

    def place(self, variables: ArrayLike) -> Assembly:
        """Set the placements of the bodies.

        Args:
            variables: (7 n,) as `variables` returns them: for each body its origin [m] and quaternion (x, y, z, w).

        Raises:
            InputError: another number of values, one that is not finite, or a quaternion that is not of unit length.
        """
        bodies = numbers(variables, (7 * len(self._places),), "place: variables").reshape(-1, 7)
        if (np.abs(np.linalg.norm(bodies[:, 3:], axis=1) - 1.0) > UNIT_TOLERANCE).any():
            raise InputError("place: variables holds a quaternion that is not of unit length; divide it by its length")
        self._places = list(unit(bodies).reshape(-1, 7))
        return self

    def solve(
        self,
        *,
        tolerance: float = 1e-5,
        iterations: int = 200,
        algebra: str = "auto",
        inequalities: Kind = "slack",
        nearest: bool = False,
    ) -> AssemblySolution:
        """Move the bodies until joints and goals hold; each step is the least motion. They keep their new placements.

        Args:
            tolerance: metres and radians, from 1e-12.
            iterations: most Newton iterations.
            algebra: "auto", "normal", "llt", "kkt", "schur", "dense" or "svd".
            inequalities: "slack" or "barrier".
            nearest: find the placements nearest to those before (eq. 1), which many least steps miss by a
                little; without inequalities only.

        Raises:
            InputError: there are no bodies, a setting is out of range, or another thread solves this assembly.
            UnknownNameError: no such linear algebra.
        """
        number(tolerance, "tolerance", FINEST, TOLERANCE.high)
        whole(iterations, "iterations", int(ITERATIONS.low), int(ITERATIONS.high))
        known(algebra, NAMES, "linear algebra")
        choice(inequalities, KINDS, "inequalities")
        flag(nearest, "nearest")
        with self._alone:
            prepared = self._ready(algebra)
            if nearest and prepared.system.inequality.any():
                raise InputError("nearest is for assemblies without limits and one-sided planes; leave it out")
            x, solution = solved(
                list(self._names), ActiveSystem(prepared.system, prepared.factor), self.variables(),
                tolerance=tolerance, iterations=iterations, kind=inequalities,
                nearest=prepared.nearest() if nearest else None,
            )  # fmt: skip
            self._places = list(x.reshape(-1, 7))
            return solution

    def _ready(self, algebra: str) -> _Prepared:
        """The equations as they stand; what was laid out and analysed serves while their pattern stays."""
        found = self._prepared
        if found is not None and not self._retargeted and found.algebra == algebra:
            return found
        goals = self._goals.batches(len(self._places))
        laid = tuple((key, batch.bodies.tobytes()) for batch, key in goals)
        if found is None or (found.algebra, found.laid) != (algebra, laid):
            held = self._held()
            system = System(len(self._places), [*held, *goals], self._weight())
            found = self._prepared = _Prepared(algebra, laid, held, system, linear_algebra(system.pattern, algebra))
            self.structures += 1
        else:
            found.system.renew([*found.held, *goals])
        self._retargeted = False
        return found

    def _held(self) -> list[tuple[Batch, Key]]:
        """What must hold, in batches."""
        if not self._places:
            raise InputError("the assembly has no bodies; add some with body(...)")
        return [unit_lengths(list(self._names)), *self._holding.batches(len(self._places))]

    def _weight(self) -> Array:
        """(7 n,) of each variable in the least motion."""
        rims = np.repeat((2.0 * np.array(self._sizes)) ** 2, 4).reshape(-1, 4)
        return np.concatenate([np.ones((len(rims), 3)), rims], axis=1).ravel()

    def _changed(self) -> Assembly:
        self._prepared = None
        return self

    def _changed_goals(self) -> Assembly:
        self._retargeted = True
        return self

    def _index(self, name: str, where: str) -> int:
        found = known(name, [*self._names, WORLD], "body", where)
        return -1 if found == WORLD else self._names[found]

    def _moved(self, name: str, where: str) -> int:
        index = self._index(name, where)
        if index < 0:
            raise InputError(f"{where}: the world does not move; name a body")
        return index

    def _place(self, index: int) -> Array:
        return self._places[index] if index >= 0 else np.array((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))

    def _pair(self, first: str, second: str, kind: str) -> tuple[int, int]:
        a, b = self._index(first, kind), self._index(second, kind)
        if a == b:
            raise InputError(f"{kind}: {first!r} cannot be joined to itself; name two bodies")
        return a, b

    def _ends(
        self,
        a: int,
        b: int,
        kind: str,
        first: str,
        second: str,
        at: Any = None,
        at_first: Any = None,
        at_second: Any = None,
    ) -> tuple[Array, Array]:
        """The joint's position in either body."""
        where = f"{kind} of {first!r} and {second!r}"
        if (at is None) == (at_first is None) or (at_first is None) != (at_second is None):
            raise InputError(f"{where}: give its place as at=(x, y, z) in the world, or as at_first and at_second")
        if at is None:
            ends = point(at_first, f"{where}: at_first"), point(at_second, f"{where}: at_second")
        else:
            place = point(at, f"{where}: at")
            sides = [pin.XYZQUATToSE3(self._place(index)).actInv(place) for index in (a, b)]
            ends = np.array(sides[0]), np.array(sides[1])
        self._joints.add(kind, first, second, ends)
        return ends
