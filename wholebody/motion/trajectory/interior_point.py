"""A primal-dual interior-point method (Mehrotra 1992) for programs with one block a frame and bands between.

    minimise    1/2 z' P z + c' z
    subject to  lower <= G z <= upper,   least <= z <= most

With A z >= a for all bounds, slacks s = A z - a and multipliers y, Newton's equations come down to one matrix,

    K = P + A' diag(y / s) A .

An unknown that nothing couples with others but rows, such as the slack of a missed contact, is eliminated: of its rows
the sum of w a a' becomes sum w a a' - v v' / (p + sum w), with v = sum w a and its own diagonal p. What is left is a
band, in the order of the frames. docs/theory/trajectory.md has the reasons.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack
from scipy.sparse import csgraph

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.motion.trajectory.banded_kernel import add_rows, add_sums

FIRST = 0.1  # products of slacks and multipliers at first; more and less take more iterations
LEAST = 1e-3  # room at the beginning to a bound that is missed then, and to one that has none opposite


class BandedQP(NamedTuple):
    """A program; P (n, n) is symmetric and positive definite, with both triangles; G (m, n); both are sparse columns.

    `start` (n,) is where the iteration begins; None for the middle between bounds.
    """

    P: Any
    c: Array
    G: Any
    lower: Array
    upper: Array
    least: Array
    most: Array
    start: Array | None = None


class Answer(NamedTuple):
    """The minimiser (n,) of a program, finite and within `least` and `most`; whether it is optimal; iterations."""

    z: Array
    solved: bool
    iterations: int


def minimise(program: BandedQP, accuracy: float = 1e-5, gap: float = 1e-6) -> Answer:
    """Solve a program to an accuracy of its rows (ten times of it for stationarity) and a gap of its objective."""
    # Less accuracy costs an iteration; a larger gap leaves deviations 3e-4 rad from the optimum.
    z, solved, iterations = _iterated(program, accuracy, gap)
    finite = bool(np.isfinite(z).all())
    return Answer(np.clip(z if finite else 0.0, program.least, program.most), solved and finite, iterations)


def _iterated(program: BandedQP, accuracy: float, gap: float) -> Answer:
    fixed = program.most - program.least <= 1e-9  # an unknown whose bounds are no farther apart stays where it is
    if fixed.any():
        return _without(fixed, program, accuracy, gap)
    matrices, bounds, c = _Matrices(program), _Bounds(program), program.c
    z, s, y = _begun(matrices, bounds, program)
    count, Pz, Az = max(len(s), 1), matrices.P @ z, bounds.times(matrices.G @ z, z)
    for iteration in range(60):
        derivative, missed = Pz + c - bounds.transposed(matrices.transposed, y), Az - bounds.a - s
        mu = float(s @ y) / count
        largest = max(1.0, float(np.abs(Pz).max(initial=0.0)))
        if (
            np.abs(missed).max(initial=0.0) <= accuracy
            and np.abs(derivative).max(initial=0.0) <= 10.0 * accuracy * largest
            and mu * count <= gap * max(1.0, abs(float(z @ (0.5 * Pz + c))))
        ):
            return Answer(z, True, iteration)
        # where a multiplier is more than 1e25 times its slack, rounding is all that is left
        factor = matrices.factor(*bounds.diagonals(y / s)) if (y < 1e25 * s).all() else None
        if factor is None:
            break
        newton = _Newton(matrices, bounds, factor, derivative, missed, s, y)
        _, _, ds, dy = newton.direction(s * y)
        along, across = _share(s, ds), _share(y, dy)
        ahead = float((s + along * ds) @ (y + across * dy)) / count
        centred = ahead * (ahead / mu) ** 2 if mu > 0.0 else 0.0
        dz, change, ds, dy = newton.direction(s * y + ds * dy - centred)
        along, across = 0.995 * _share(s, ds), 0.995 * _share(y, dy)  # of the way to the next bound
        if max(along, across) < 1e-8:  # a step that is a smaller share of Newton's leads nowhere
            break
        z, Az = z + along * dz, Az + along * change
        s, y, Pz = s + along * ds, y + across * dy, matrices.P @ z
    return Answer(z, False, iteration + 1)


def _without(fixed: Mask, program: BandedQP, accuracy: float, gap: float) -> Answer:
    """Solve for the unknowns that are not fixed (n,) alone; rows that have no others hold or not."""
    P, c, G, lower, upper, least, most, start = program
    P, G, free = sp.csc_array(P), sp.csc_array(G), np.flatnonzero(~fixed)
    z = np.zeros(len(fixed))
    z[fixed] = 0.5 * (least[fixed] + most[fixed])
    left = G[:, free]
    asked = np.bincount(left.indices, minlength=len(lower)) > 0
    rows, value = np.flatnonzero(asked), G @ z
    missed = np.maximum(lower - value, value - upper)[~asked].max(initial=0.0)
    holds = bool(missed <= accuracy and (least[fixed] - most[fixed]).max() <= accuracy)
    if not len(free):
        return Answer(z, holds, 0)
    there = value[rows]
    others = BandedQP(
        P[:, free][free], (c + P @ z)[free], sp.csc_array(left[rows]), lower[rows] - there, upper[rows] - there,
        least[free], most[free], None if start is None else start[free],
    )  # fmt: skip
    found = _iterated(others, accuracy, gap)
    z[free] = found.z
    return Answer(z, holds and found.solved, found.iterations)


class _Bounds:
    """All bounds as A z >= a (k,): rows from below and above, and unknowns from below and above."""

    def __init__(self, program: BandedQP) -> None:
        lower, upper, least, most = program.lower, program.upper, program.least, program.most
        self.low, self.high = np.flatnonzero(np.isfinite(lower)), np.flatnonzero(np.isfinite(upper))
        self.under = np.flatnonzero(np.isfinite(least))
        self.over = np.flatnonzero(np.isfinite(most))
        self.a = np.concatenate([lower[self.low], -upper[self.high], least[self.under], -most[self.over]])
        self._ends = np.cumsum([len(self.low), len(self.high), len(self.under)])
        self._rows, self._count = len(lower), len(least)

    def parts(self, values: Array | Indices) -> list[Any]:
        """Values (k,) of the bounds, by their kinds."""
        return list(np.split(values, self._ends))

    def times(self, Gz: Array, z: Array) -> Array:
        """(k,) A z, of z (n,) and G z (m,)."""
        return np.concatenate([Gz[self.low], -Gz[self.high], z[self.under], -z[self.over]])

    def transposed(self, G: Any, values: Array) -> Array:
        """(n,) A' times values (k,); G is transposed."""
        low, high, under, over = self.parts(values)
        rows = np.zeros(self._rows)
        rows[self.low] += low
        rows[self.high] -= high
        found: Array = G @ rows
        found[self.under] += under
        found[self.over] -= over
        return found

    def diagonals(self, values: Array) -> tuple[Array, Array]:
        """(m,) weights of the rows and (n,) of the unknowns in A' diag(values) A."""
        low, high, under, over = self.parts(values)
        rows, unknowns = np.zeros(self._rows), np.zeros(self._count)
        rows[self.low] += low
        rows[self.high] += high
        unknowns[self.under] += under
        unknowns[self.over] += over
        return rows, unknowns


class _Matrices:
    """The matrices of a program, split into banded unknowns and slacks.

    Attributes:
        P, G, transposed: (n, n), (m, n) and (n, m) of G.
        slack: indices of the slacks.
        share, rows: (m, slacks) columns of G of the slacks, and the other columns.
        sums, columns: these two transposed.
    """

    def __init__(self, program: BandedQP) -> None:
        P, G = sp.csc_array(program.P), sp.csc_array(program.G, copy=True)  # else zeros would leave the given one too
        G.eliminate_zeros()
        self.P, self.G, self.transposed = sp.csr_array(P), sp.csr_array(G), sp.csr_array(G.T)
        slack = _slacks(P, G, np.isinf(program.most))
        self.slack: Indices = np.flatnonzero(slack).astype(np.intp)
        band = np.flatnonzero(~slack).astype(np.intp)
        self.band: Indices = band[np.argsort(_parts(P, G)[band], kind="stable")]
        self.share = sp.csc_array(G[:, self.slack])
        self.rows = sp.csr_array(G[:, self.band])
        self.rows.sort_indices()
        self.columns, self.sums = sp.csr_array(self.rows.T), sp.csr_array(self.share.T)
        self._own = P.diagonal()[self.slack]
        self._spans()
        self._groups()
        inner = sp.coo_array(P[self.band][:, self.band])
        inner.eliminate_zeros()  # of figures that equalities could couple, and do not
        at, to = inner.coords
        width = max(int((at - to).max(initial=0)), self._widest) + 1
        self._base = np.zeros((len(self.band), width))
        self._base[to[at >= to], (at - to)[at >= to]] = inner.data[at >= to]
        self._K = np.empty_like(self._base)  # one for all iterations: fresh memory of this size costs time

    def factor(self, rows: Array, unknowns: Array) -> _Factor | None:
        """Of K, with weights (m,) of rows and (n,) of unknowns, in the last one's memory; None where singular."""
        own = self._own + unknowns[self.slack]
        shared = self._squares @ rows
        weights = rows.copy()
        single = self._single
        weights[self._alone] *= own[single] / (own[single] + shared[single])
        K = self._K
        K[:] = self._base
        K[:, 0] += unknowns[self.band]
        add_rows(K, self._first, self._begins, self._values, weights)
        if len(self._begun) > 1:
            total = (own + shared)[self._several]
            add_sums(
                K, self._first, self._begins, self._values, rows * self._factors, self._members, self._begun,
                -1.0 / total,
            )  # fmt: skip
        cholesky, failed = lapack.dpbtrf(K.T, lower=1, overwrite_ab=1)
        return None if failed else _Factor(self, cholesky, rows, own + shared)

    def _spans(self) -> None:
        """Each row from its first to its last entry, zeros between them included."""
        rows = self.rows
        some = np.flatnonzero(np.diff(rows.indptr))
        self._first = np.zeros(rows.shape[0], dtype=np.intp)
        lengths = np.zeros(rows.shape[0], dtype=np.intp)
        self._first[some] = rows.indices[rows.indptr[some]]
        lengths[some] = rows.indices[rows.indptr[some + 1] - 1] - self._first[some] + 1
        self._begins = np.concatenate([[0], np.cumsum(lengths)]).astype(np.intp)
        self._values = np.zeros(self._begins[-1])
        row = np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
        self._values[self._begins[row] + rows.indices - self._first[row]] = rows.data
        self._widest = int(lengths.max(initial=1)) - 1

    def _groups(self) -> None:
        share = self.share
        many = np.diff(share.indptr)
        self._squares = sp.csr_array(share.power(2).T)
        self._factors = np.zeros(share.shape[0])
        self._factors[share.indices] = share.data
        self._single, self._several = np.flatnonzero(many == 1), np.flatnonzero(many > 1)
        self._alone = share.indices[share.indptr[self._single]]
        parts = [share.indices[share.indptr[k] : share.indptr[k + 1]] for k in self._several]
        self._members = np.concatenate([np.zeros(0, dtype=np.intp), *parts]).astype(np.intp)
        self._begun = np.concatenate([[0], np.cumsum(many[self._several])]).astype(np.intp)
        if len(self._several):
            lengths = np.diff(self._begins)[self._members]
            first = np.where(lengths > 0, self._first[self._members], len(self.band))
            last = np.where(lengths > 0, self._first[self._members] + lengths, 0)
            spans = np.maximum.reduceat(last, self._begun[:-1]) - np.minimum.reduceat(first, self._begun[:-1])
            self._widest = max(self._widest, int(spans.max()) - 1)


class _Factor(NamedTuple):
    """K as its Cholesky factor, and what eliminates the slacks."""

    matrices: _Matrices
    cholesky: Array
    weights: Array
    slack: Array

    def solve(self, right: Array) -> Array:
        """(n,) the solution of K z = right (n,), slacks included."""
        matrices = self.matrices
        found = np.zeros(len(right))
        own = right[matrices.slack]
        rest = right[matrices.band] - matrices.columns @ (self.weights * (matrices.share @ (own / self.slack)))
        inner, _ = lapack.dpbtrs(self.cholesky, rest, lower=1)
        found[matrices.band] = inner
        found[matrices.slack] = (own - matrices.sums @ (self.weights * (matrices.rows @ inner))) / self.slack
        return found


class _Newton(NamedTuple):
    """Newton's equations at slacks s and multipliers y (k,): the Lagrangian's derivative (n,), and A z - a - s (k,)."""

    matrices: _Matrices
    bounds: _Bounds
    factor: _Factor
    derivative: Array
    missed: Array
    s: Array
    y: Array

    def direction(self, products: Array) -> tuple[Array, Array, Array, Array]:
        """Changes of z, A z, s and y that take away these products (k,) of slacks and multipliers, to first order."""
        matrices, bounds, s, y = self.matrices, self.bounds, self.s, self.y
        pull = -self.derivative - bounds.transposed(matrices.transposed, (products + y * self.missed) / s)
        dz = self.factor.solve(pull)
        change = bounds.times(matrices.G @ dz, dz)
        ds = change + self.missed
        return dz, change, ds, -(products + y * ds) / s


def _parts(P: Any, G: Any) -> Indices:
    """(n,) the part of each unknown; parts share no row: of two figures that do not meet, the band is half as wide."""
    coupled = sp.block_array([[P, G.T], [G, None]], format="csr")
    coupled.eliminate_zeros()
    labels: Indices = csgraph.connected_components(coupled, directed=False)[1][: P.shape[0]]
    return labels


def _slacks(P: Any, G: Any, unbounded: Mask) -> Mask:
    """(n,) unknowns, unbounded above, that P does not couple with others, of each row the last."""
    alone: Mask = (np.diff(P.indptr) == 1) & (P.diagonal() != 0.0) & (np.diff(G.indptr) > 0) & unbounded
    found = np.flatnonzero(alone)
    shares = sp.coo_array(G[:, found])
    row, column = shares.coords
    last = np.full(shares.shape[0], -1)
    np.maximum.at(last, row, column)
    alone[found[column[column < last[row]]]] = False
    return alone


def _begun(matrices: _Matrices, bounds: _Bounds, program: BandedQP) -> tuple[Array, Array, Array]:
    """Unknowns (n,), slacks (k,) and multipliers (k,) to begin with."""
    c, least, most, start = program.c, program.least, program.most, program.start
    both, slack = np.isfinite(least) & np.isfinite(most), matrices.slack
    middle = np.clip(0.0, least, most)
    middle[both] = 0.5 * (least[both] + most[both])
    z = middle if start is None else start.copy()
    z = np.where(both, z, np.clip(z, least + LEAST, most - LEAST))
    room = 0.05 * (most[both] - least[both])  # from both bounds
    z[both] = np.clip(z[both], least[both] + room, most[both] - room)
    largest = np.full(matrices.G.shape[0], np.inf)
    price = np.maximum(c[slack], 1.0)
    if len(slack):
        z[slack] = np.where(np.isfinite(least[slack]), least[slack], 0.0)
    away = bounds.times(matrices.G @ z, z) - bounds.a
    share = matrices.share
    if len(slack):
        short = np.zeros(len(largest))
        short[bounds.low] = np.maximum(-bounds.parts(away)[0], 0.0)
        z[slack] += np.maximum.reduceat(short[share.indices], share.indptr[:-1]) + 2.0 * FIRST / price
        largest[share.indices] = np.repeat(0.5 * price / np.diff(share.indptr), np.diff(share.indptr))
        away = bounds.times(matrices.G @ z, z) - bounds.a
    own = bounds.parts(np.arange(len(away)))
    s = away
    for part in own[:2]:
        s[part] = np.maximum(s[part], LEAST)
    y = FIRST / s
    y[own[0]] = np.minimum(y[own[0]], largest[bounds.low])
    if len(slack):
        pulled, is_slack = np.zeros(len(largest)), np.isin(bounds.under, slack)
        pulled[bounds.low] = y[own[0]]
        left = np.zeros(len(z))
        left[slack] = np.maximum(price - share.T @ pulled, 0.5 * price)
        y[own[2][is_slack]] = left[bounds.under[is_slack]]
    return z, s, y


def _share(values: Array, change: Array) -> float:
    """The largest share of a change, at most 1, that keeps values positive."""
    less = change < 0.0
    return min(1.0, float((-values[less] / change[less]).min(initial=1.0)))
