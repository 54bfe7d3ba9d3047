"""Bounds on the displacement of joints: frozen joints and velocity limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Annotated, TypeAlias

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import FASTEST_TURN, instance, shown, warn_of_degrees
from wholebody.base.errors import InputError
from wholebody.base.fields import Range
from wholebody.figures.description import Limits
from wholebody.figures.state import State
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.base import Bound, filled

SPEED = Range(1e-9, 1e9, endless=True)  # rad/s, m/s
Speed: TypeAlias = Annotated[float, SPEED]


class Freeze(Bound):
    """Keep joints as they are at the start, such as the lower body while the upper body works.

    Attributes:
        joints: names of joints and groups; "root" for the figure's placement in the world, "anna/root" for
            that of one of several.

    Raises:
        InputError: no name.
        UnknownNameError: in a problem, a joint or group that the figure does not have.

    Examples:
        >>> lower_body_stays = wb.Freeze("left_leg", "right_leg", "root")
    """

    _lower: Array
    _upper: Array

    def __init__(self, *joints: str) -> None:
        """Name the frozen joints."""
        if not joints or not all(isinstance(name, str) for name in joints):
            raise InputError(f"Freeze takes names, not {shown(joints)}; write Freeze('left_leg', 'right_leg', 'root')")
        self.joints = joints

    def __repr__(self) -> str:
        """Return the call that builds it."""
        return f"Freeze({', '.join(map(repr, self.joints))})"

    def resolve(self, scene: Scene, start: Array) -> Freeze:
        """Find the joints."""
        upper = np.full(scene.model.nv, np.inf)
        upper[inputs.find_dofs(scene, self.joints, "Freeze")] = 0.0
        return filled(self, _upper=upper, _lower=-upper)

    def bounds(self, state: State, dt: float | None) -> tuple[Array, Array]:
        """Zero for frozen joints."""
        return self._lower, self._upper


@dataclass(frozen=True, eq=False)
class StepLimit(Bound):
    """Bound the displacement of a step by velocity times dt. It does not bound a solve without a time step.

    A joint whose velocity is bounded brakes before its limits too: a step of dt goes at most the share
    1 - exp(-dt / 0.05 s) of their remaining distance.

    Attributes:
        velocity: limit of the joints [rad/s; m/s for prismatic joints].
        joints: other limits for joints and groups, by name; a later name overrides an earlier one.
        root_velocity: limit of the root's translation, along each of its own axes [m/s].
        root_turn: limit of the root's rotation, about each of its own axes [rad/s].

    Raises:
        InputError: a value of the wrong kind, shape or range.
        UnknownNameError: in a problem, a joint or group that the figure does not have.

    Examples:
        >>> slow = wb.tasks.StepLimit(2.0, joints={"right_arm": 1.0}, root_velocity=0.5)
    """

    velocity: Speed = np.inf
    _: KW_ONLY
    joints: Mapping[str, float] = field(default_factory=dict)
    root_velocity: Speed = np.inf
    root_turn: Speed = np.inf
    _velocity: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the values."""
        super().__post_init__()
        instance(self.joints, Mapping, "StepLimit: joints", "give velocities by name, such as {'left_arm': 1.0}")
        speeds = {name: SPEED(speed, f"StepLimit: joints[{shown(name)}]") for name, speed in self.joints.items()}
        for name, speed in {"velocity": self.velocity, "root_turn": self.root_turn, **speeds}.items():
            warn_of_degrees(speed, f"StepLimit: {name}", FASTEST_TURN, "rad/s")
        object.__setattr__(self, "joints", speeds)

    def resolve(self, scene: Scene, start: Array) -> StepLimit:
        """Find the joints."""
        velocity = np.full(scene.model.nv, self.velocity)
        for name in scene.figure.roots:
            root = inputs.find_dofs(scene, (name,), "StepLimit")
            velocity[root[:3]], velocity[root[3:]] = self.root_velocity, self.root_turn
        if not scene.figure.roots and np.isfinite((self.root_velocity, self.root_turn)).any():
            raise InputError("StepLimit: this figure is fixed to the world; leave root_velocity and root_turn out")
        for name, speed in self.joints.items():
            velocity[inputs.find_dofs(scene, (name,), "StepLimit")] = speed
        return filled(self, _velocity=velocity)

    def bounds(self, state: State, dt: float | None) -> tuple[Array, Array]:
        """Plus and minus velocity times dt; no bounds if dt is None."""
        reach = np.full_like(self._velocity, np.inf) if dt is None else self._velocity * dt
        return -reach, reach

    def braking(self, dt: float | None) -> Array:
        """(nv,) largest share of the distance to its limit that each freedom moves in a step of dt seconds."""
        # s in which the distance to a joint's limit decreases by 1/e at most: longer = softer stops, shorter = jolts
        share = 1.0 if dt is None else 1.0 - float(np.exp(-dt / 0.05))
        return np.where(np.isfinite(self._velocity), share, 1.0)


def at_speeds(bounds: Sequence[Bound], state: State, dt: float | None) -> Array | None:
    """Displacements (2, nv) from a state that bounds on velocities allow in dt seconds; None without such bounds."""
    ranges = np.array([bound.bounds(state, dt) for bound in bounds if isinstance(bound, StepLimit)])
    return np.array([ranges[:, 0].max(axis=0), ranges[:, 1].min(axis=0)]) if len(ranges) else None


def clipped(model: pin.Model, begin: Array, q: Array, most: Array | None) -> Array:
    """The posture q, or the nearest one with a displacement from `begin` within `most` (2, nv); both are (nq,)."""
    if most is None:
        return q
    gone = pin.difference(model, begin, q)
    kept = np.clip(gone, *most)
    return q if np.array_equal(gone, kept) else np.asarray(pin.integrate(model, begin, kept))


def shortened(model: pin.Model, begin: Array, q: Array, most: Array | None) -> Array:
    """The motion from `begin` towards q, both (nq,), as far as its displacement is within `most` (2, nv)."""
    if most is None:
        return q
    way = pin.difference(model, begin, q)
    bound = np.where(way > 0.0, most[1], -most[0])
    share = float(np.min(np.where(np.abs(way) > bound, bound / np.maximum(np.abs(way), 1e-12), 1.0)))
    return q if share >= 1.0 else np.asarray(pin.integrate(model, begin, share * way))


def allowed(bounds: Sequence[Bound], limits: Limits, state: State, dt: float | None) -> Array:
    """Displacements (2, nv) from a state that joint limits and bounds allow in dt seconds, without braking."""
    box = np.stack([np.full(state.model.nv, -np.inf), np.full(state.model.nv, np.inf)])
    box[0, limits.idx_v] = limits.lower - state.q[limits.idx_q]
    box[1, limits.idx_v] = limits.upper - state.q[limits.idx_q]
    for bound in bounds:
        low, high = bound.bounds(state, dt)
        np.clip(box, low, high, out=box)
    return box
