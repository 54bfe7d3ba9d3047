"""Check of the derivatives of a goal, constraint or measure of one's own against finite differences."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base import checks
from wholebody.base.arrays import Array, brief
from wholebody.base.errors import InputError
from wholebody.figures.model_check import joint_of
from wholebody.figures.state import State
from wholebody.scene.scene import Scene
from wholebody.tasks.base import Constraint, Goal, Measure

STEP = 1e-6  # rad, m: half of the central difference's width
AGREEMENT = 1e-5  # largest difference, as a share of 1 + the largest entry


@dataclass(frozen=True)
class DerivativeCheck:
    """What a check of derivatives found.

    Attributes:
        term: name of the term's class.
        error: largest difference between the derivative and finite differences, at any posture.
        row: the row where it is; 0 for a measure.
        joint: the joint whose degree of freedom it is; "root" for the free root.
        given: the entry of the term's own derivative there.
        measured: that of finite differences.
        q: (nq,) the posture.
        agrees: whether all derivatives agree with finite differences.
    """

    __repr__ = brief

    term: str
    error: float
    row: int
    joint: str
    given: float
    measured: float
    q: Array
    agrees: bool

    def __bool__(self) -> bool:
        return self.agrees

    def __str__(self) -> str:
        if self.agrees:
            return f"{self.term}: its derivative agrees with finite differences to {self.error:.1e}"
        correction = (
            "; the sign is wrong" if abs(self.given + self.measured) <= AGREEMENT * (1.0 + abs(self.measured)) else ""
        )
        return (
            f"{self.term}: row {self.row} of its derivative has {self.given:.6g} for {self.joint}, "
            f"finite differences have {self.measured:.6g}{correction}"
        )


def check_derivatives(term: Goal | Constraint | Measure, scene: Scene, q: ArrayLike | None = None) -> DerivativeCheck:
    """Compare the derivative of a term with central differences of its value, at a posture and at four others near it.

    At a kink of the value, such as the limit of a joint, the derivative of either side is taken for right.

    Args:
        term: a goal, constraint or measure; it is resolved on the scene.
        scene: figure and things.
        q: (nq,) first posture; the figure's first posture by default.

    Raises:
        InputError: not a term or not a scene, a value or derivative that is not finite, or one of the wrong shape.

    Examples:
        >>> bool(wb.check_derivatives(wb.Point("right_index_tip", (0.5, -0.2, 1.0)), scene))
        True
    """
    checks.instance(term, (Goal, Constraint, Measure), "check_derivatives: term", "give a goal, constraint or measure")
    checks.instance(scene, Scene, "check_derivatives: scene", "make one with wb.Scene(figure)")
    figure, model = scene.figure, scene.model
    start = figure.neutral if q is None else checks.posture(q, model.nq, "check_derivatives: q")
    resolved = term.resolve(scene, start)
    state, rng = State(model), np.random.default_rng(0)
    worst: tuple[float, int, int, float, float, Array, float] = (-1.0, 0, 0, 0.0, 0.0, start, 1.0)
    for number in range(5):
        # rad, m: standard deviation of the postures around the first
        here = start if number == 0 else _inside(scene, pin.integrate(model, start, 0.3 * rng.normal(size=model.nv)))
        given = _derivative(resolved, state.update(here))
        measured, kink = _differences(resolved, state, here)
        if given.shape != measured.shape:
            raise InputError(
                f"{type(term).__name__}: its derivative has shape {given.shape}; give {measured.shape}, one row for "
                "each value and one column for each degree of freedom"
            )
        if not given.size:
            continue
        difference = np.maximum(np.abs(given - measured) - kink, 0.0)
        row, dof = divmod(int(np.argmax(difference)), difference.shape[1])
        scale = 1.0 + float(np.abs(measured).max())
        if difference[row, dof] / scale > worst[0]:
            entry = float(given[row, dof]), float(measured[row, dof])
            worst = (float(difference[row, dof]) / scale, row, dof, *entry, here, scale)
    share, row, dof, mine, true, where, scale = worst
    joint = joint_of(model, dof)
    name = next((root for root, k in figure.roots.items() if k == joint), str(model.names[joint]))
    return DerivativeCheck(
        type(term).__name__, max(share, 0.0) * scale, row, name, mine, true, where, share <= AGREEMENT
    )


def _inside(scene: Scene, q: Array) -> Array:
    """The posture (nq,) with every limited joint inside its limits, where values of terms may have kinks."""
    limits = scene.figure.limits
    # share of its range that a joint stays away from its limits
    room = 0.02 * np.where(np.isfinite(limits.upper - limits.lower), limits.upper - limits.lower, 0.0)
    q = q.copy()
    q[limits.idx_q] = np.clip(q[limits.idx_q], limits.lower + room, limits.upper - room)
    return q


def _value(term: Any, state: State) -> Array:
    return np.atleast_1d(np.asarray(term.error(state) if isinstance(term, Goal) else term.value(state), dtype=float))


def _derivative(term: Any, state: State) -> Array:
    """Derivative (m, nv) of a term as it has it itself."""
    given = term.gradient(state) if isinstance(term, Measure) else term.jacobian(state)
    return np.asarray(state.dense_jacobian(given), dtype=float)


def _differences(term: Any, state: State, q: Array) -> tuple[Array, Array]:
    """Jacobian (m, nv) by central differences, and how far both sides differ from it, as at a kink."""
    model, columns, kinks = state.model, [], []
    here = _value(term, state.update(q))
    for dof in range(model.nv):
        step = np.zeros(model.nv)
        step[dof] = STEP
        ahead = _value(term, state.update(pin.integrate(model, q, step)))
        behind = _value(term, state.update(pin.integrate(model, q, -step)))
        if not ahead.shape == behind.shape == here.shape:
            sizes = f"{len(here)} values at one posture and {len(ahead)} and {len(behind)} beside it"
            raise InputError(f"{type(term).__name__}: it has {sizes}; give as many at all postures")
        columns.append((ahead - behind) / (2.0 * STEP))
        kinks.append(np.abs(ahead + behind - 2.0 * here) / (2.0 * STEP))
    return np.array(columns).T, np.array(kinks).T
