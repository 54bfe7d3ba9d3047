"""Choice of the factorisation: by name, or by the pattern."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Indices
from wholebody.base.checks import known
from wholebody.methods.newton.linear_algebra.base import LinearAlgebra, Pattern
from wholebody.methods.newton.linear_algebra.dense_columns import DenseColumns
from wholebody.methods.newton.linear_algebra.normal_equations import NormalEquations
from wholebody.methods.newton.linear_algebra.quasi_definite import QuasiDefinite
from wholebody.methods.newton.linear_algebra.reference import Dense, SingularValues

NAMES = ("auto", "normal", "llt", "kkt", "schur", "dense", "svd")
DENSE_ROWS = 60  # least number of rows of a column that is split off, such as a hub's; fewer = more splits
MOST_DENSE = 50  # most dense columns that are split off; with hundreds, as of a body near everything, a step took 2 s


def dense_columns(pattern: Pattern) -> Indices:
    """Columns that would fill the normal equations."""
    return np.flatnonzero(np.bincount(pattern.columns, minlength=pattern.width) > DENSE_ROWS)


def linear_algebra(pattern: Pattern, name: str = "auto") -> LinearAlgebra:
    """The factorisation of this name for a pattern.

    Raises:
        UnknownNameError: there is no such factorisation.
    """
    known(name, NAMES, "linear algebra")
    dense = dense_columns(pattern)
    if name == "schur" or (name == "auto" and 0 < len(dense) <= MOST_DENSE):
        return DenseColumns(pattern, dense)
    if name == "kkt" or (name == "auto" and len(dense)):
        return QuasiDefinite(pattern)
    if name == "dense":
        return Dense(pattern)
    if name == "svd":
        return SingularValues(pattern)
    return NormalEquations(pattern, square_root=name == "llt")
