"""Newton on the Karush-Kuhn-Tucker system: the placement nearest to an anchor among all that meet the equations.

With L(x, y) = 1/2 (x - a)' D (x - a) - y . c(x), the step solves eqs. 4 to 7 with second derivatives of the equations,

    [H, -J'; -J, 0] [d; y] = [-D (x - a); c],        H = D - sum_i y_i c_i''.

Without the second derivatives, as in eq. 6, the equations converge quadratically and the multipliers only linearly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.methods.newton.linear_algebra.base import LinearSystem, SingularSystemError
from wholebody.methods.newton.linear_algebra.quasi_definite import QuasiDefinite
from wholebody.methods.newton.system import System

Array = NDArray[np.float64]

DAMPING = 1e-10  # redundant equations are tolerated at this loss of accuracy
PENALTY = 2.0  # times the greatest multiplier: what an error of the equations counts against distance
HALVINGS = 8  # of a step that does not serve
FIRST_CONVEXITY = 1e-2  # of D that is added where the second derivatives are not convex along the equations
MORE, LESS = 4.0, 0.3  # what it is multiplied by until they are, and from one step to the next
MOST_CONVEXITY = 1e6
DECREASE = 1e-4  # share of the promised decrease that a step must bring (Armijo)


class Settled(NamedTuple):
    """Where it ended.

    Attributes:
        x: (7 n,) the variables.
        errors: largest error of the KKT system before each iteration and at the end.
        met: whether it is below the tolerance.
    """

    x: Array
    errors: tuple[float, ...]
    met: bool


def settle(system: System, x: Array, anchor: Array, *, tolerance: float, iterations: int) -> Settled:
    """Move x, which meets the equations or nearly so, to the nearest place to the anchor (both (7 n,)).

    Args:
        system: equations; those with inequalities are not for this iteration.
        x: where to begin.
        anchor: what it is to be near to, by the system's weights.
        tolerance: of every equation of the KKT system.
        iterations: most of them.
    """
    rows, columns, _ = system.curvature(x, np.zeros(system.pattern.height))
    algebra = QuasiDefinite(system.pattern, (rows, columns))
    damping = np.full(system.pattern.height, DAMPING)
    y = np.zeros(system.pattern.height)
    residual, values = system.residual(x), system.values(x)
    errors: list[float] = []
    convexity = 0.0
    trial, found = x, residual
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
            convexity = max(FIRST_CONVEXITY, LESS * convexity) if not algebra.convex() else 0.0
            while convexity and convexity < MOST_CONVEXITY:  # far from the answer: more of D, until there is a way down
                raised = task._replace(weight=(1.0 + convexity) * system.weight)
                step, multiplier = algebra.solve(raised, second)
                if algebra.convex():
                    break
                convexity *= MORE
        except SingularSystemError:
            break
        penalty = PENALTY * float(np.abs(multiplier).max(initial=1.0))
        here = _merit(system, x, anchor, residual, penalty)
        promised = float(gradient @ step) - penalty * float(np.abs(residual).sum())
        length = 1.0
        for _ in range(HALVINGS):
            trial = x + length * step
            found = system.residual(trial)
            gain = here - _merit(system, trial, anchor, found, penalty)
            if gain >= -DECREASE * length * promised:
                break
            if length == 1.0:  # the equations bend: the same step, brought back to them, may serve
                task = LinearSystem(values, system.weight, damping, np.zeros(len(x)), found)
                back, _ = algebra.solve(task, np.zeros(len(second)))
                bent = system.residual(trial + back)
                if here - _merit(system, trial + back, anchor, bent, penalty) >= -DECREASE * promised:
                    trial, found = trial + back, bent
                    break
            length *= 0.5
        x, y, residual, values = trial, multiplier, found, system.values(trial)
    return Settled(x, tuple(errors), errors[-1] <= tolerance)


def _merit(system: System, x: Array, anchor: Array, residual: Array, penalty: float) -> float:
    way = x - anchor
    return float(0.5 * (system.weight * way) @ way + penalty * np.abs(residual).sum())
