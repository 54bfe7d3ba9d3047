"""The solvers of programs with one block a frame and bands between.

The package's own interior-point method factorises them as one band, in a time that is linear in the frames. PIQP's
multistage backend finds the blocks by itself and factorises from block to block, linear too. OSQP takes the same
program by its general sparse factorisation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.util import find_spec
from types import MappingProxyType
from typing import Any

import numpy as np

from wholebody.base.checks import shown
from wholebody.base.errors import InputError, MissingPackageError, UnknownNameError
from wholebody.motion.trajectory.banded_program import Answer, BandedQP

ACCURACY = 1e-5  # of the optimality conditions: a tenth of what a step is judged by; smaller costs an iteration
GAP = 1e-6  # of the duality gap; smaller costs iterations, larger leaves deviations 3e-4 rad from the optimum


def solve_by_bands(program: BandedQP) -> Answer:
    """Solve by an interior-point method whose factor is one band; see `interior_point`."""
    from wholebody.motion.trajectory import interior_point

    return _answer(*interior_point.minimise(program, ACCURACY, GAP), program)


def solve_by_piqp(program: BandedQP) -> Answer:
    """Solve by PIQP's interior-point method with its multistage backend."""
    import piqp
    import scipy.sparse as sp

    solver = piqp.SparseSolver()
    settings = solver.settings
    settings.kkt_solver = piqp.KKTSolver.sparse_multistage
    settings.eps_abs, settings.eps_rel, settings.verbose = ACCURACY, ACCURACY, False
    settings.eps_duality_gap_abs, settings.eps_duality_gap_rel = GAP, GAP
    n = len(program.c)
    none = sp.csc_matrix((0, n))
    solver.setup(
        sp.csc_matrix(program.P), program.c, none, np.zeros(0), sp.csc_matrix(program.G), program.lower, program.upper,
        program.least, program.most,
    )  # fmt: skip
    status = solver.solve()
    return _answer(solver.result.x, status == piqp.PIQP_SOLVED, int(solver.result.info.iter), program)


def solve_by_osqp(program: BandedQP) -> Answer:
    """Solve by OSQP, polished."""
    import osqp
    import scipy.sparse as sp

    n = len(program.c)
    rows = sp.csc_matrix(sp.vstack([program.G, sp.eye(n)]))
    solver = osqp.OSQP()
    solver.setup(
        sp.csc_matrix(sp.triu(program.P)), program.c, rows, np.concatenate([program.lower, program.least]),
        np.concatenate([program.upper, program.most]), verbose=False, eps_abs=1e-6, eps_rel=1e-6,
        max_iter=8000, polishing=True, polish_refine_iter=5,
    )  # fmt: skip
    found = solver.solve(raise_error=False)
    return _answer(found.x, found.info.status == "solved", int(found.info.iter), program)


SOLVERS: Mapping[str, tuple[str, Callable[[BandedQP], Answer]]] = MappingProxyType(
    {"banded": ("scipy", solve_by_bands), "piqp": ("piqp", solve_by_piqp), "osqp": ("osqp", solve_by_osqp)}
)
"""Name of a solver -> the module that it needs, and the function that asks it."""


def banded_solver(name: str | None) -> tuple[str, Callable[[BandedQP], Answer]]:
    """A solver by name, and its name; for None the package's own.

    Raises:
        InputError: not a text.
        UnknownNameError: there is no such solver.
        MissingPackageError: its package is not installed.
    """
    name = next(iter(SOLVERS)) if name is None else name
    if not isinstance(name, str):
        raise InputError(f"solver is {shown(name)}; give 'banded', 'piqp' or 'osqp'")
    if name not in SOLVERS:
        raise UnknownNameError("solver of trajectories", name, SOLVERS)
    module, solve = SOLVERS[name]
    if find_spec(module) is None:
        raise MissingPackageError(f"the solver {name} is not installed; install it with: pip install {module}")
    return name, solve


def _answer(z: Any, solved: bool, iterations: int, program: BandedQP) -> Answer:
    found = np.asarray(z, dtype=float)
    if found.shape != program.c.shape or not np.isfinite(found).all():
        return Answer(np.clip(0.0, program.least, program.most), False, iterations)
    return Answer(np.clip(found, program.least, program.most), solved, iterations)
