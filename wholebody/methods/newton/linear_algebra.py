"""Linear systems of Newton steps, by normal equations or the whole KKT matrix.

Every factorisation solves, for the displacement d and the multipliers y,

    D d - J' y = -g,        J d + M y = -c                                            (eqs. 8 to 10 of the paper)

with a positive diagonal D, the sparse Jacobian J and a diagonal M >= 0, which is zero for equations that must hold.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array, Indices
from wholebody.base.checks import known
from wholebody.base.compiled import compiled, with_loops
from wholebody.base.errors import WholebodyError

Places = NDArray[np.int32]
NAMES = ("auto", "normal", "kkt", "schur")


class SingularSystemError(WholebodyError, ArithmeticError):
    """A linear system that the factorisation cannot solve; damp it more, or use a reference method."""


class Pattern(NamedTuple):
    """Structural non-zeros of a sparse Jacobian (height, width): rows and columns (nnz,) of the entries."""

    rows: Indices
    columns: Indices
    height: int
    width: int

    def times(self, values: Array, vector: Array) -> Array:
        """J vector, (height,)."""
        result = np.bincount(self.rows, values * vector[self.columns], self.height)
        return result.astype(np.float64, copy=False)

    def transpose_times(self, values: Array, vector: Array) -> Array:
        """J' vector, (width,)."""
        result = np.bincount(self.columns, values * vector[self.rows], self.width)
        return result.astype(np.float64, copy=False)


class LinearSystem(NamedTuple):
    """One system: values (nnz,) of J, diagonals D (width,) and M (height,), right-hand sides g and c."""

    values: Array
    weight: Array
    damping: Array
    gradient: Array
    residual: Array


class NormalEquations:
    """J D^-1 J' + M by Eigen's SimplicialLDLT with AMD ordering, with dense columns split off (eqs. 10 to 12).

    With A_s the sparse and A_D the dense columns of J D^-1/2, A_s A_s' + M + F F' is factorised sparsely. Each column
    of F has one non-zero, in a row that would be empty without it. A small dense system adds A_D and removes F: the
    modified Schur complement (Andersen 1996, ACM Transactions on Mathematical Software 22). So a hub adds little to the
    cost of its arms.
    """

    def __init__(self, pattern: Pattern, dense: Indices | None = None) -> None:
        """Build and analyse; `dense` are the columns to split off."""
        import eigenpy

        self.name = "normal/ldlt" if dense is None else "normal/schur"
        self.pattern = pattern
        self._dense = np.zeros(0, dtype=np.intp) if dense is None else dense
        is_dense = np.zeros(pattern.width, dtype=bool)
        is_dense[self._dense] = True
        self._split = np.flatnonzero(is_dense[pattern.columns])
        self._rest = np.flatnonzero(~is_dense[pattern.columns])
        place = np.cumsum(is_dense) - 1
        self._dense_at = (pattern.rows[self._split], place[pattern.columns[self._split]])
        sparse = Pattern(pattern.rows[self._rest], pattern.columns[self._rest], pattern.height, pattern.width)
        self._gram = Gram(sparse)
        self._bare = np.zeros(0, dtype=np.intp)
        if len(self._dense):
            self._bare = np.flatnonzero(np.bincount(sparse.rows, minlength=pattern.height) == 0)
        self._success = eigenpy.ComputationInfo.Success
        self._factor = eigenpy.SimplicialLDLT()
        self._factor.analyzePattern(self._gram.matrix)

    @property
    def fill(self) -> int:
        """Non-zeros of the last factor, with the dense columns."""
        columns = len(self._dense) + len(self._bare)
        return int(self._factor.matrixL().nnz) + columns * self.pattern.height

    def solve(self, system: LinearSystem) -> tuple[Array, Array]:
        """Refill, refactorise; eliminate d: (J D^-1 J' + M) y = -c + J D^-1 g, then d = D^-1 (J' y - g)."""
        values, damping = system.values, system.damping
        if len(self._dense):
            values, damping = values[self._rest], damping.copy()
            damping[self._bare] += 1.0
        self._gram.refill(values, system.weight, damping)
        self._factor.factorize(self._gram.matrix)
        if self._factor.info() != self._success:
            raise SingularSystemError("the equations depend on each other; damp them")
        free = system.gradient / system.weight
        y = self._factor.solve(self.pattern.times(system.values, free) - system.residual)
        if len(self._dense):
            y = self._with_dense(system, y)
        if not np.isfinite(y).all():
            raise SingularSystemError("the equations depend on each other; damp them")
        return self.pattern.transpose_times(system.values, y) / system.weight - free, y

    def _with_dense(self, system: LinearSystem, direct: Array) -> Array:
        """The multipliers (height,) of the whole matrix, from those of its sparse part (eq. 11)."""
        wide = len(self._dense)
        border = np.zeros((self.pattern.height, wide + len(self._bare)))
        border[self._dense_at] = system.values[self._split]
        border[:, :wide] /= np.sqrt(system.weight[self._dense])
        border[self._bare, wide + np.arange(len(self._bare))] = 1.0
        through = self._factor.solve(border)
        corner = np.diag(np.concatenate([-np.ones(wide), np.ones(len(self._bare))]))
        try:
            small = np.linalg.solve(corner - border.T @ through, border.T @ direct)
        except np.linalg.LinAlgError:
            raise SingularSystemError("the equations depend on each other; damp them") from None
        result: Array = direct + through @ small
        return result


class Products(NamedTuple):
    """Pairs of entries of J that share a column, from an entry on, one row of the Jacobian after the other."""

    by_row: Places  # (nnz,) the entries, row after row and in each row by column
    row_start: Places  # (height + 1,) where those of each row begin
    by_column: Places  # (nnz,) the entries, column after column and in each column by row
    place: Places  # (nnz,) where each entry is in `by_column`
    column_end: Places  # (nnz,) where the column of each entry ends there


class Gram:
    """Lower triangle of J D^-1 J' + M as scipy's csc_matrix, whose data `refill` overwrites."""

    def __init__(self, pattern: Pattern) -> None:
        from scipy.sparse import csc_matrix

        self.pattern = pattern
        compiled_kernel()
        rows, columns = (part.astype(np.int32) for part in (pattern.rows, pattern.columns))
        self._products = _paired(rows, columns, pattern.height, pattern.width)
        self._target, inner, pointer = _laid_products(self._products, rows)
        shape = (pattern.height, pattern.height)
        self.matrix = csc_matrix((np.zeros(len(inner)), inner, pointer), shape=shape)

    def refill(self, values: Array, weight: Array, damping: Array) -> None:
        """Compute the matrix for values (nnz,) of J, diagonals D and M."""
        data = self.matrix.data
        data[:] = 0.0
        _sum_products(values / weight[self.pattern.columns], values, self._products, self._target, data)
        data[self.matrix.indptr[:-1]] += damping


@compiled()
def _paired(rows: Places, columns: Places, height: int, width: int) -> Products:
    """The pairs of the entries (nnz,) of a Jacobian."""
    by_row, row_start = _sorted(rows, np.arange(len(rows)).astype(np.int32), height)
    by_column, column_start = _sorted(columns, by_row, width)
    place, column_end = np.empty_like(rows), np.empty_like(rows)
    for k in range(len(by_column)):
        place[by_column[k]] = k
    for entry in range(len(rows)):
        column_end[entry] = column_start[columns[entry] + 1]
    return Products(by_row, row_start, by_column, place, column_end)


@compiled(inner=True)
def _sorted(keys: Places, order: Places, count: int) -> tuple[Places, Places]:
    """Entries by their keys below `count`, those of one key as in `order`; and where those of each key begin."""
    start, result = np.zeros(count + 2, np.int32), np.empty_like(order)
    for key in keys:
        start[key + 2] += 1
    for key in range(count + 1):  # array functions such as `cumsum` would load scipy.linalg with the kept loop
        start[key + 1] += start[key]
    for entry in order:
        result[start[keys[entry] + 1]] = entry
        start[keys[entry] + 1] += 1
    return result, start[:-1]


@compiled()
def _laid_products(products: Products, rows: Places) -> tuple[Places, Places, Places]:
    """Lower triangle of J J' by columns: places (pairs,) of products, rows ascending, and where columns begin."""
    by_row, row_start, by_column, place, column_end = products
    height, pairs = len(row_start) - 1, 0
    for k in range(len(place)):  # a sum of an array would load scipy.linalg with the kept loop
        pairs += column_end[k] - place[k]
    target, inner = np.empty(pairs, np.int32), np.empty(pairs + height, np.int32)
    pointer = np.zeros(height + 1, np.int32)
    seen, where, count, pair = np.zeros(height, np.int32), np.zeros(height, np.int32), 0, 0
    for row in range(height):
        begin = count
        seen[row], inner[count] = row + 1, row
        count += 1
        for k in range(row_start[row], row_start[row + 1]):
            for p in range(place[by_row[k]], column_end[by_row[k]]):
                other = rows[by_column[p]]
                if seen[other] != row + 1:
                    seen[other], inner[count] = row + 1, other
                    count += 1
        inner[begin:count].sort()
        for p in range(begin, count):
            where[inner[p]] = p
        for k in range(row_start[row], row_start[row + 1]):
            for p in range(place[by_row[k]], column_end[by_row[k]]):
                target[pair] = where[rows[by_column[p]]]
                pair += 1
        pointer[row + 1] = count
    return target, inner[:count], pointer


@compiled()
def _sum_products(scaled: Array, values: Array, products: Products, target: Places, data: Array) -> None:
    """Add the products of pairs of entries, one scaled and the other not, to data, at the places `target`."""
    by_row, _, by_column, place, column_end = products
    pair = 0
    for k in range(len(by_row)):
        value = values[by_row[k]]
        for p in range(place[by_row[k]], column_end[by_row[k]]):
            data[target[pair]] += scaled[by_column[p]] * value
            pair += 1


@with_loops(__name__)
def compiled_kernel(_: Any) -> None:
    """This module, after its loops are compiled or loaded from the cache, before a solve."""
    none, places = np.zeros(0), np.zeros(0, dtype=np.int32)
    products = _paired(places, places, 0, 0)
    _laid_products(products, places)
    _sum_products(none, none, products, places, none)


class QuasiDefinite:
    """L D L' of [D, -J'; -J, -M] with AMD ordering (Vanderbei 1995, quasi-definite matrices)."""

    name = "kkt/ldlt"

    def __init__(self, pattern: Pattern) -> None:
        """Build and analyse."""
        import eigenpy
        from scipy.sparse import csc_matrix

        size = pattern.width + pattern.height
        rows = np.concatenate([np.arange(size), pattern.width + pattern.rows])
        columns = np.concatenate([np.arange(size), pattern.columns])
        places, index = np.unique(columns * size + rows, return_inverse=True)
        pointer = np.searchsorted(places // size, np.arange(size + 1)).astype(np.int32)
        self.pattern, self._index = pattern, index
        self._matrix = csc_matrix((np.zeros(len(places)), (places % size).astype(np.int32), pointer), (size, size))
        self._success = eigenpy.ComputationInfo.Success
        self._factor: Any = eigenpy.SimplicialLDLT()
        self._factor.analyzePattern(self._matrix)

    @property
    def fill(self) -> int:
        """Non-zeros of the last factor."""
        return int(self._factor.matrixL().nnz)

    def solve(self, system: LinearSystem) -> tuple[Array, Array]:
        """Refill, refactorise, solve."""
        n, values = self.pattern.width, system.values
        least = 1e-10 / system.weight.min(initial=1.0)  # makes the matrix quasi-definite; smaller = less stable
        data = np.concatenate([system.weight, -np.maximum(system.damping, least), -values])
        self._matrix.data[:] = np.bincount(self._index, data, len(self._matrix.data))
        self._factor.factorize(self._matrix)
        if self._factor.info() != self._success:
            raise SingularSystemError("the KKT matrix has no factor; damp it")
        wanted = np.concatenate([-system.gradient, system.residual])
        found = self._factor.solve(wanted)
        slack = np.maximum(least - system.damping, 0.0)
        lower = self._matrix
        for _ in range(2):  # iterative refinement by the matrix without the least damping, which differs by -slack y
            error = wanted - (lower @ found + lower.T @ found - lower.diagonal() * found)
            error[n:] -= slack * found[n:]
            found = found + self._factor.solve(error)
        if not np.isfinite(found).all():
            raise SingularSystemError("the equations depend on each other; damp them")
        return found[:n], found[n:]


LinearAlgebra = NormalEquations | QuasiDefinite
"""A factorisation for one pattern."""


def dense_columns(pattern: Pattern) -> Indices:
    """Columns that would fill the normal equations, such as a hub's: of more than sixty rows; fewer = more splits."""
    return np.flatnonzero(np.bincount(pattern.columns, minlength=pattern.width) > 60)


def linear_algebra(pattern: Pattern, name: str = "auto") -> LinearAlgebra:
    """The factorisation of this name for a pattern; "auto" splits off the dense columns of up to two bodies."""
    # Each takes a solve: of two people, with 32 of them, splits took 8 ms and "kkt" 2, with hundreds splits took 2 s.
    known(name, NAMES, "linear algebra")
    dense = dense_columns(pattern)
    if name == "schur" or (name == "auto" and 0 < len(dense) <= 14):
        return NormalEquations(pattern, dense)
    if name == "kkt" or (name == "auto" and len(dense)):
        return QuasiDefinite(pattern)
    return NormalEquations(pattern)
