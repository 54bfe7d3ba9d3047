"""Forces on a figure beside its weight, and where the ground presses against both."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.base.fields import Checked
from wholebody.figures.state import State
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.balance import Balance, Feet, Margin, SolePolygon, standing_corners
from wholebody.tasks.base import ComputedTogether, filled

GRAVITY = 9.81  # m/s^2, as in Pinocchio's models
FRICTION = 0.8  # coefficient of friction where none is stated

MOST_FORCE = 1e5  # N: a greater force is a mistake of units


def _force(value: object, where: str) -> Array:
    """Force (3,), N."""
    found = checks.numbers(value, (3,), where)
    if np.linalg.norm(found) > MOST_FORCE:
        raise InputError(f"{where} is {np.linalg.norm(found):.4g} N; forces are in newtons, at most {MOST_FORCE:g}")
    return found


@dataclass(frozen=True, eq=False)
class Force(Checked):
    """A force on a figure that keeps its direction: 10 kg in a hand are ``Force("left_palm", (0, 0, -98))``.

    Who pushes a cart forward by 100 N has a force of (-100, 0, 0) on the hands: the cart pushes back.

    Attributes:
        frame: where it acts: the origin of a frame.
        force: (3,) in the world [N].

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a frame that the figure does not have.

    Examples:
        >>> push = wb.Force("right_palm", (-100.0, 0.0, 0.0))  # the hand pushes forward by 100 N
    """

    frame: inputs.Name
    force: Annotated[Any, _force]


def _forces(value: object, where: str) -> tuple[Force, ...]:
    listed = checks.listed(value, where, "[wb.Force('right_palm', (0, 0, -100))]")
    return tuple(checks.instance(one, Force, where, "give wb.Force('right_palm', (0, 0, -100))") for one in listed)


Forces: TypeAlias = Annotated[Sequence[Force], _forces]


class Loads(NamedTuple):
    """Forces on the joints of a figure, ready to be evaluated."""

    places: tuple[inputs.Place, ...]  # frame and joint of each
    vectors: Array  # (k, 3) in the world [N]

    def at(self, state: State) -> tuple[Array, Array]:
        """Where they act (k, 3) [m], and the derivative (k, 3, nv)."""
        points = np.array([state.frame(place.frame).translation for place in self.places]).reshape(-1, 3)
        moves = [point_rows(state, point, one.joint) for point, one in zip(points, self.places, strict=True)]
        return points, np.array(moves).reshape(-1, 3, state.model.nv)


def resolved(forces: Sequence[Force], scene: Scene, where: str) -> Loads:
    """Forces on a scene's figure."""
    places = tuple(inputs.find_place(scene, one.frame, where) for one in forces)
    return Loads(places, np.array([one.force for one in forces]).reshape(-1, 3))


def point_rows(state: State, point: Array, joint: int) -> Array:
    """Derivative (3, nv) of a point (3,) in the world that a joint carries."""
    wrench = np.hstack([np.eye(3), pin.skew(point).T])
    return state.rows(wrench, np.full(3, joint, dtype=np.intp), np.zeros(3, dtype=np.intp))


def pressure(
    state: State, loads: Loads, mass: range | None, height: float, rises: Array | float = 0.0
) -> tuple[Array, Array]:
    """The point (2,) of no moment but a vertical one, at a height [m] that `rises` (nv,), and its derivative."""
    model = state.model
    weight = GRAVITY * sum(model.inertias[k].mass for k in (mass or range(1, model.njoints)))
    center, moved = state.center_of_mass(mass)[:2], state.center_of_mass_jacobian(mass)[:2]
    if not len(loads.vectors):
        return center, moved
    points, rows = loads.at(state)
    down = weight - float(loads.vectors[:, 2].sum())
    if down < 0.05 * weight:
        raise InputError(
            f"forces lift the figure: {down:.0f} N of its weight are left on the ground; make them smaller"
        )
    f = loads.vectors
    if (along := float(np.hypot(*f[:, :2].sum(axis=0)))) > FRICTION * down:
        raise InputError(
            f"forces push the figure along the ground by {along:.0f} N, and its soles slip at {FRICTION * down:.0f} N, "
            f"{FRICTION:g} of what they bear; make them smaller, add the forces of what holds it, such as a wall "
            "behind, or leave them to who sits (standing=False)"
        )
    arm = np.einsum("k,ki->i", -f[:, 2], points[:, :2]) + np.einsum("k,ki->i", points[:, 2] - height, f[:, :2])
    turn = np.einsum("k,kij->ij", -f[:, 2], rows[:, :2]) + np.einsum("kj,ki->ij", rows[:, 2] - rises, f[:, :2])
    return (weight * center + arm) / down, (weight * moved + turn) / down


@dataclass(frozen=True, eq=False)
class LoadedBalance(ComputedTogether):
    """Keep the balance under forces: the ground presses within the support polygon of the feet.

    As `Balance`, which it takes the place of, but of the point where the ground presses in place of the centre of mass:
    who pushes leans forward, and who carries leans back. The polygon goes with the feet, which may slide: that of the
    points on which they stand at the start, a row for each [m]; 1 m for one that is no corner.

    Attributes:
        forces: on the figure beside its weight.
        feet: segments that carry the figure, as for `Balance`.
        margin: least distance from the edges [m]; None for 0.15 of the polygon's least width.
        keeps: that margin; once resolved.

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a frame that the figure does not have.

    Examples:
        >>> steady = wb.ergonomics.LoadedBalance([wb.Force("right_palm", (-100, 0, 0))])
    """

    forces: Forces
    _: KW_ONLY
    feet: Feet = ("left_foot", "right_foot")
    margin: Margin | None = None
    keeps: float = field(init=False, repr=False)
    loads: Loads = field(init=False, repr=False)
    soles: SolePolygon = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> LoadedBalance:
        """Find the points on which the feet stand at the start."""
        points, joints = standing_corners(scene, start, self.feet)
        whole = Balance(self.feet, margin=self.margin or 0.0).on_points(points, scene, self.margin is None)
        loads = resolved(self.forces, scene, "LoadedBalance: forces")
        with scene.figure.posed(start) as state:
            own = [state.data.oMi[joint].actInv(point) for joint, point in zip(joints.tolist(), points, strict=True)]
            pressure(state, loads, whole.joints, 0.0)  # forces that lift are refused here
        soles = SolePolygon(np.array(own), joints, whole.joints)
        return filled(self, loads=loads, soles=soles, keeps=whole.margin)

    @property
    def lower(self) -> Array:
        """The margin."""
        return np.array(self.keeps)

    def value_and_jacobian(self, state: State, value: Callable[[State], Array]) -> tuple[Array, Array]:
        """(m,) distance inside each edge [m], and its derivative (m, nv)."""
        point, rows = pressure(state, self.loads, self.soles.mass, *self.soles.height(state))
        return self.soles.inside(state, point, rows)
