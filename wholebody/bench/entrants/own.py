"""Our own methods as they take part: qp with every QP solver, newton in three ways, ccd, dls and placo."""

from __future__ import annotations

from functools import partial
from typing import Any

from wholebody.bench.entrants.base import FIRST_FIT, LADDER, Budget, Entrant
from wholebody.methods.base import Method

_QP_BUDGETS: tuple[Budget, ...] = (
    *((tolerance, FIRST_FIT) for tolerance in (3e-2, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8)),
    *LADDER[1:],
)

NEWTONS: dict[str, dict[str, Any]] = {
    "slack": {"inequalities": "slack"},
    "barrier": {"inequalities": "barrier"},
    "kkt": {"inequalities": "slack", "algebra": "kkt"},
}
"""The ways of newton, as arguments of `Newton`."""

_NEWTON_SETUPS = {
    "slack": "squared slacks, and the factorisation that it chooses itself",
    "barrier": "a logarithmic barrier, and the factorisation that it chooses itself",
    "kkt": "squared slacks, and LDL^T of the symmetric saddle-point system in place of the normal equations",
}


def qp_entrant(solver: str, package: str | None = None) -> Entrant:
    """The QP method with one of its solvers."""
    return Entrant(
        name=f"qp/{solver}",
        make=partial(_qp, solver),
        loose=_QP_BUDGETS,
        setup=f"wb.QP(solver={solver!r}), all else as it comes: stages and seeded starts follow where the first "
        "descent does not reach the goals. Budgets of first fit are wb.QP(measures=False), those of "
        "few iterations have one descent only.",
        package=package,
    )


def ccd_entrant() -> Entrant:
    """Cyclic coordinate descent."""
    return Entrant(
        name="ccd",
        make=_ccd,
        loose=(*_few(2, 5, 20), *LADDER[:8]),
        setup="wb.CCD(), all else as it comes: 400 sweeps from one start and at most 12 further starts. A budget of "
        "few iterations has no further starts.",
        differences=(
            "ccd minimises nothing: it stops at the first posture that serves",
            "ccd takes Point, Frame and Orientation goals, holds that the reaching joints do not move, Freeze and "
            "ReachCones; the root of the figure stays",
        ),
    )


def dls_entrant() -> Entrant:
    """Damped least squares, the textbook baseline."""
    return Entrant(
        name="dls",
        make=_dls,
        loose=(*_few(2, 3, 4, 6), *LADDER),
        setup="wb.DampedLeastSquares(), all else as it comes: one start, at most 300 steps, damping by Sugihara 2011.",
        differences=(
            "dls knows no contacts: it passes through things and may end inside of them",
            "dls minimises no measure: each step is the least motion",
            "dls takes equalities only: Balance, ReachCones and Plane with side 'above' are refused",
        ),
    )


def placo_entrant() -> Entrant:
    """The adapter to placo's kinematics solver."""
    return Entrant(
        name="placo",
        make=_placo,
        loose=(*_few(5, 10, 20), *LADDER),
        setup="wb.Placo(), all else as it comes: goals as soft tasks, holds and the self-collision constraint hard, "
        "joint limits, at most 0.05 rad or m a program, joints tasks for the measures with a weight that fades; one "
        "start, at most 200 programs. The objects are added to its collision model, with the clearance of each pair. "
        "Building its robot is set-up.",
        differences=(
            "placo has no class for objects in the world: they are added to its collision model as parts of the robot",
            "placo minimises Effort and Displacement only",
            "placo has no reach cones, no half-spaces for frames and no axis toward a place",
            "placo has one row a pair, between the two nearest points",
            "placo finds no solution where hard tasks repeat each other, as in a redundant closed loop",
        ),
        package="placo",
    )


def newton_entrant(way: str) -> Entrant:
    """Sparse Newton in full coordinates, in one of the ways of `NEWTONS`."""
    return Entrant(
        name=f"newton/{way}",
        make=partial(_newton, way),
        loose=(*_few(3, 6, 12, 25), *LADDER[1:]),
        setup=f"wb.Newton() with {_NEWTON_SETUPS[way]}; all else as it comes. A budget of few iterations has one "
        "start.",
        differences=(
            "newton minimises measures up to what the stopping of its iteration leaves, and PotentialEnergy not at all",
        ),
    )


def _few(*iterations: int) -> tuple[Budget, ...]:
    return tuple((1e-3, count) for count in iterations)


def _qp(solver: str, tolerance: float, iterations: int | None) -> Method:
    from wholebody.methods.qp.method import QP

    if iterations is None or iterations == FIRST_FIT:
        return QP(solver=solver, tolerance=tolerance, measures=iterations is None)
    return QP(solver=solver, tolerance=tolerance, iterations=iterations, budget=0, restarts=0)


def _ccd(tolerance: float, iterations: int | None) -> Method:
    from wholebody.methods.ccd.method import CCD

    if iterations is None:
        return CCD(tolerance=tolerance)
    return CCD(tolerance=tolerance, iterations=iterations, restarts=0)


def _newton(way: str, tolerance: float, iterations: int | None) -> Method:
    from wholebody.methods.newton.method import Newton

    if iterations is None:
        return Newton(tolerance=tolerance, **NEWTONS[way])
    return Newton(tolerance=tolerance, iterations=iterations, restarts=0, **NEWTONS[way])


def _dls(tolerance: float, iterations: int | None) -> Method:
    from wholebody.methods.damped_least_squares import DampedLeastSquares

    if iterations is None:
        return DampedLeastSquares(tolerance=tolerance)
    return DampedLeastSquares(tolerance=tolerance, iterations=iterations)


def _placo(tolerance: float, iterations: int | None) -> Method:
    from wholebody.methods.placo.method import Placo

    return Placo(tolerance=tolerance) if iterations is None else Placo(tolerance=tolerance, iterations=iterations)
