"""Correcting an active set in array code: what `wholebody.methods.qp.active_set` must do."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.methods.qp.quadratic_program import ActiveSet, QPSolution, QuadraticProgram
from wholebody.methods.qp.settings import CORRECTIONS


def same(one: ActiveSet, other: ActiveSet) -> bool:
    """Whether both are the same set."""
    return all(map(np.array_equal, one, other))


def guess_active_set(program: QuadraticProgram, x: Array, tolerance: float) -> ActiveSet:
    """Active set read off an approximate minimiser x, shape (n,): what is within `tolerance` of its bound."""
    gradient = program.gradient(x)
    lower = (x <= program.lower + tolerance) & (gradient >= 0.0)
    upper = (x >= program.upper - tolerance) & (gradient <= 0.0) & ~lower
    return ActiveSet(lower, upper, program.elastic @ x <= program.least + tolerance)


def objective(program: QuadraticProgram, x: Array) -> float:
    """What a program minimises, at x (n,)."""
    residual = program.rows @ x - program.target
    violated = np.maximum(program.least - program.elastic @ x, 0.0)
    smooth = 0.5 * (program.diagonal * x) @ x + program.linear @ x
    return float(smooth + 0.5 * program.weight @ residual**2 + 0.5 * program.elastic_weight @ violated**2)


def solve_from(program: QuadraticProgram, guess: ActiveSet, corrections: int) -> QPSolution | None:
    """Return what `solve_from` returns."""
    active = guess
    for _ in range(corrections):
        point = minimise_on_face(program, active)
        if point is None:
            return None
        following = _corrected(program, active, point)
        if same(following, active):
            return QPSolution(np.clip(point.x, program.lower, program.upper), active, True, 0)
        active = following
    return None


def _corrected(program: QuadraticProgram, active: ActiveSet, point: FacePoint) -> ActiveSet:
    """The set with wrong signs put right."""
    x, gradient = point.x, point.gradient
    elastic = program.elastic @ x < program.least - CORRECTIONS.tolerance
    elastic[active.elastic] = point.push >= 0.0
    lower = np.where(active.lower, gradient >= 0.0, x < program.lower - CORRECTIONS.tolerance)
    upper = np.where(active.upper, gradient <= 0.0, x > program.upper + CORRECTIONS.tolerance)
    return ActiveSet(lower, upper, elastic)


class FacePoint(NamedTuple):
    """Stationary point for one active set: x, derivative of the Lagrangian in x, push of every active elastic row."""

    x: Array
    gradient: Array
    push: Array


def minimise_on_face(program: QuadraticProgram, active: ActiveSet) -> FacePoint | None:
    """Minimiser with the bounds of the set held and the elastic rows of the set pushing; None if it is not finite.

    Signs are read off the multipliers: weight times residual would drown them in rounding where weights are large.
    """
    from scipy.linalg.lapack import dposv

    rows = np.vstack([program.rows, program.elastic[active.elastic]])
    target = np.concatenate([program.target, program.least[active.elastic]])
    weight = np.concatenate([program.weight, program.elastic_weight[active.elastic]])
    x = np.where(active.lower, program.lower, np.where(active.upper, program.upper, 0.0))
    free = ~(active.lower | active.upper)
    inverse = np.where(free, 1.0 / program.diagonal, 0.0)
    multiplier, in_columns = np.zeros(len(rows)), len(rows) > program.size
    if len(rows) and not in_columns:
        scaled = rows * inverse
        system = scaled @ rows.T
        system.flat[:: len(rows) + 1] += 1.0 / weight
        _, multiplier, info = dposv(system, rows @ x - scaled @ program.linear - target)
        trial = x - inverse * (program.linear + multiplier @ rows)
        # rows that repeat each other to rounding leave multipliers that do not belong to their residuals
        in_columns = info != 0 or not np.abs(rows @ trial - target - multiplier / weight).max() <= CORRECTIONS.tolerance
    if in_columns:
        x[free] = _in_columns(program, rows[:, free], target - rows @ x, weight, free)
        multiplier = weight * (rows @ x - target)
    pull = program.linear + multiplier @ rows
    x = x if in_columns else x - inverse * pull
    if not np.isfinite(x).all():
        return None
    return FacePoint(x, program.diagonal * x + pull, -multiplier[len(program.target) :])


def _in_columns(program: QuadraticProgram, rows: Array, target: Array, weight: Array, free: Mask) -> Array:
    """Free entries (f,) of the minimiser on a face with more rows than variables.

    They minimise |W^1/2 (A x - b)|^2 + |D^1/2 x + D^-1/2 g|^2. The rows stand in the order of their weights, for which
    Householder's QR is stable row by row (Cox and Higham 1998).
    """
    from scipy.linalg import qr_multiply, solve_triangular

    if not free.any():
        return np.zeros(0)
    heavy = np.argsort(-weight, kind="stable")
    root, own = np.sqrt(weight[heavy]), np.sqrt(program.diagonal[free])
    table = np.vstack([rows[heavy] * root[:, None], np.diag(own)])
    right = np.concatenate([target[heavy] * root, -program.linear[free] / own])
    turned, factor = qr_multiply(table, right, mode="right")
    result: Array = solve_triangular(factor, turned)
    return result
