"""Newton on the Karush-Kuhn-Tucker system: the state nearest to an anchor among all that satisfy the equations.

With L(x, y) = 1/2 (x - a)' D (x - a) - y . c(x), the step solves eqs. 4 to 7 with second derivatives of the equations,

    [H, -J'; -J, 0] [d; y] = [-D (x - a); c],        H = D - sum_i y_i c_i''.

Without the second derivatives, as in eq. 6, the equations converge quadratically and the multipliers only linearly.
After each step Newton steps return to the equations, and the distances there are compared: a merit of distance and
errors would refuse good long steps along curved equations (Maratos; Nocedal and Wright 2006, section 15.4).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.records import with_values
from wholebody.methods.newton.linear_algebra import LinearSystem, QuasiDefinite, SingularSystemError
from wholebody.methods.newton.settings import STEPS
from wholebody.methods.newton.system import System


class Projection(NamedTuple):
    """The end of the iteration.

    Attributes:
        x: (7 n,) the variables.
        errors: largest error of the KKT system before each iteration and at the end.
        met: whether it is below the tolerance.
    """

    x: Array
    errors: tuple[float, ...]
    met: bool


def kkt_algebra(system: System) -> QuasiDefinite:
    """The factorisation of the KKT matrix of a system's equations, analysed."""
    rows, columns, _ = system.curvature(system.weight, np.zeros(system.pattern.height))
    return QuasiDefinite(system.pattern, (rows, columns))


def project(
    system: System, algebra: QuasiDefinite, x: Array, anchor: Array, *, tolerance: float, iterations: int
) -> Projection:
    """Move x, which meets the equations or nearly so, to the nearest place to the anchor (both (7 n,)).

    Args:
        system: equations; those with inequalities are not for this iteration.
        algebra: `kkt_algebra` of the system.
        x: where to begin.
        anchor: what it is to be near to, by the system's weights.
        tolerance: of every equation of the KKT system.
        iterations: most iterations.
    """
    damping = np.full(system.pattern.height, STEPS.hard_damping)
    y = np.zeros(system.pattern.height)
    residual, values = system.residual(x), system.values(x)
    errors: list[float] = []
    convexity = 0.0
    for number in range(iterations + 1):
        gradient = system.weight * (x - anchor)
        slope = gradient - system.pattern.transpose_times(values, y)
        errors.append(float(max(np.abs(slope).max(initial=0.0), np.abs(residual).max(initial=0.0))))
        if errors[-1] <= tolerance or number == iterations:
            break
        task = LinearSystem(values, system.weight, damping, gradient, residual)
        try:
            second = -system.curvature(x, y)[2]
            step, multiplier = algebra.solve(task, second)
            convexity = max(1e-2, 0.3 * convexity) if not algebra.convex() else 0.0
            while convexity and convexity < 1e6:  # far from the answer: more of D, until it is convex
                raised = with_values(task, weight=(1.0 + convexity) * system.weight)
                step, multiplier = algebra.solve(raised, second)
                if algebra.convex():
                    break
                convexity *= 4.0
        except SingularSystemError:
            break
        here, slope_along = _distance(system, x, anchor), float(gradient @ step)
        for halving in range(12):
            length = 0.5**halving
            trial, found = _brought_back(system, algebra, task, x + length * step, 0.1 * tolerance)
            most = here * (1.0 + 1e-12) + 1e-4 * length * slope_along  # rounding, and Armijo's decrease
            good = np.abs(found).max(initial=0.0) <= tolerance
            if good and _distance(system, trial, anchor) <= most:
                break
        else:
            break
        x, y, residual, values = trial, multiplier, found, system.values(trial)
    return Projection(x, tuple(errors), errors[-1] <= tolerance)


def _brought_back(
    system: System, algebra: QuasiDefinite, task: LinearSystem, x: Array, tolerance: float
) -> tuple[Array, Array]:
    """The variables (7 n,) moved by Newton steps until the equations hold, and their residual there."""
    residual = system.residual(x)
    for _ in range(8):
        if not np.isfinite(residual).all() or np.abs(residual).max(initial=0.0) <= tolerance:
            break
        back = with_values(task, values=system.values(x), gradient=np.zeros(len(x)), residual=residual)
        try:
            x = x + algebra.solve(back)[0]
        except SingularSystemError:
            break
        residual = system.residual(x)
    return x, residual


def _distance(system: System, x: Array, anchor: Array) -> float:
    way = x - anchor
    return float(0.5 * (system.weight * way) @ way)
