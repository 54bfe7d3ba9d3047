"""Semismooth Newton steps in array code: what `wholebody.methods.qp.active_set.minimise` must do."""

from __future__ import annotations

import numpy as np

from tests.reference.active_set import minimise_on_face
from wholebody.base.arrays import Array
from wholebody.methods.qp.active_set_kernel import STILL, WHOLE
from wholebody.methods.qp.quadratic_program import ActiveSet, QuadraticProgram


def minimise(program: QuadraticProgram, start: Array, iterations: int) -> tuple[Array, ActiveSet, int]:
    """Lower the objective from a start until its minimum, or for so many iterations.

    Args:
        program: what to solve.
        start: (n,) where to begin; it is clipped to the box.
        iterations: most steps.

    Returns:
        x (n,) inside the box, its active set, and the number of iterations used.
    """
    x = np.clip(start, program.lower, program.upper)
    gradient = program.gradient(x)
    lower = (x <= program.lower) & (gradient >= 0.0)
    upper = (x >= program.upper) & (gradient <= 0.0) & ~lower
    used = 0
    while used < iterations:
        used += 1
        active = ActiveSet(lower, upper, program.elastic @ x < program.least)
        point = minimise_on_face(program, active)
        if point is None:
            break
        way = np.where(lower | upper, 0.0, point.x - x)
        met = False
        while True:  # the way bends at bounds, which hold from then on
            before = program.elastic @ x < program.least
            step, hit = _longest(program, x, way)
            best = _line_minimum(program, x, way, step)
            x = np.clip(x + best * way, program.lower, program.upper)
            if best != step or hit < 0:
                break
            lower[hit], upper[hit] = way[hit] < 0.0, way[hit] > 0.0
            way[hit], met = 0.0, True
        whole = best == 1.0 and np.array_equal(program.elastic @ x < program.least, before)
        if met or (best * float(np.abs(way).max(initial=0.0)) > STILL and not whole):
            continue
        # the minimum of the face: let the bounds go that hold on the wrong side
        pull = program.gradient(x) / program.diagonal
        wrong = (lower & (-pull > STILL)) | (upper & (pull > STILL))
        if not wrong.any():
            break
        lower, upper = lower & ~wrong, upper & ~wrong
    return x, ActiveSet(lower, upper, program.elastic @ x < program.least), used


def _longest(program: QuadraticProgram, x: Array, way: Array) -> tuple[float, int]:
    """How far one may go before a bound, in units of the way (inf without one), and which bound that is."""
    room = np.where(way > 0.0, program.upper - x, program.lower - x)
    moving = np.abs(way) > STILL
    share = np.where(moving, room / np.where(moving, way, 1.0), np.inf)
    nearest = int(np.argmin(share))
    return (float(share[nearest]), nearest) if np.isfinite(share[nearest]) else (np.inf, -1)


def _line_minimum(program: QuadraticProgram, x: Array, way: Array, longest: float) -> float:
    """The step in [0, longest] with the least objective along the way.

    The derivative along the way is a(t) = a + b t - sum over pushing rows of v_j s_j (l_j - c_j x - t s_j), with
    s_j = c_j way; rows begin or cease to push where l_j - c_j x = t s_j.
    """
    slope = program.rows @ way
    base = float(
        (program.diagonal * x + program.linear) @ way + (program.weight * slope) @ (program.rows @ x - program.target)
    )
    rise = float((program.diagonal * way) @ way + (program.weight * slope) @ slope)
    violated, speed = program.least - program.elastic @ x, program.elastic @ way
    pushing = violated > 0.0
    base -= float((program.elastic_weight * speed * violated)[pushing].sum())
    rise += float((program.elastic_weight * speed**2)[pushing].sum())
    moving = np.flatnonzero(np.abs(speed) > 0.0)
    at = violated[moving] / speed[moving]
    ahead = at > 0.0
    order = moving[ahead][np.argsort(at[ahead], kind="stable")]
    for j in order.tolist():
        place = violated[j] / speed[j]
        if place >= longest or base + rise * place >= 0.0:
            break
        sign = -1.0 if pushing[j] else 1.0
        base -= sign * program.elastic_weight[j] * speed[j] * violated[j]
        rise += sign * program.elastic_weight[j] * speed[j] ** 2
    if rise <= 0.0:
        return 0.0
    best = min(max(-base / rise, 0.0), longest)
    return 1.0 if abs(best - 1.0) < WHOLE else float(best)
