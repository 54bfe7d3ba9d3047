"""A primal-dual interior-point method (Mehrotra 1992) for programs with one block a frame and bands between.

    minimise    1/2 z' P z + c' z
    subject to  lower <= G z <= upper,   least <= z <= most

With A z >= a for all bounds, slacks s = A z - a and multipliers y, Newton's equations come down to one matrix,

    K = P + A' diag(y / s) A ,

which is a band, in the order of the frames. docs/theory/trajectory.md has the reasons.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack
from scipy.sparse import csgraph

from wholebody.base.arrays import Array, Indices, Mask
from wholebody.motion.trajectory.banded_kernel import add_rows

FIRST = 0.1  # products of slacks and multipliers at first; more and less take more iterations
LEAST = 1e-3  # room at the beginning to a bound that is missed then, and to one that has none opposite


class BandedQP(NamedTuple):
    """A program with sparse P (n, n), positive definite, and G (m, n); `start` (n,) or the middle between bounds."""

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
    order = _by_parts(program)
    found, solved, iterations = _iterated(_ordered(program, order), accuracy, gap)
    finite, z = bool(np.isfinite(found).all()), np.empty_like(found)
    z[order] = found
    return Answer(np.clip(z if finite else 0.0, program.least, program.most), solved and finite, iterations)


def _by_parts(program: BandedQP) -> Indices:
    """The order (n,) of the unknowns by parts that share no row: two figures that do not meet have half the band."""
    P, G = sp.csr_array(program.P, copy=True), sp.csr_array(program.G, copy=True)
    coupled = sp.block_array([[P, G.T], [G, None]], format="csr")
    coupled.eliminate_zeros()
    part = csgraph.connected_components(coupled, directed=False)[1][: len(program.c)]
    return np.argsort(part, kind="stable").astype(np.intp)


def _ordered(program: BandedQP, order: Indices) -> BandedQP:
    P, G = sp.csr_array(program.P)[order][:, order], sp.csr_array(program.G)[:, order]
    start = None if program.start is None else program.start[order]
    return BandedQP(
        P, program.c[order], G, program.lower, program.upper, program.least[order], program.most[order], start
    )


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
        # where a multiplier is more than 1e25 times its slack, only rounding remains
        factor = matrices.factor(*bounds.diagonals(y / s)) if (y < 1e25 * s).all() else None
        if factor is None:
            break
        newton = _Newton(matrices, bounds, factor, derivative, missed, s, y)
        _, _, ds, dy = newton.direction(s * y)
        along, across = _share(s, ds), _share(y, dy)
        ahead = float((s + along * ds) @ (y + across * dy)) / count
        centred = ahead * (ahead / mu) ** 2 if mu > 0.0 else 0.0
        dz, change, ds, dy = newton.direction(s * y + ds * dy - centred)
        along, across = 0.995 * _share(s, ds), 0.995 * _share(y, dy)  # of the distance to the next bound
        if max(along, across) < 1e-8:  # a step that is a smaller share of Newton's leads nowhere
            break
        z, Az = z + along * dz, Az + along * change
        s, y, Pz = s + along * ds, y + across * dy, matrices.P @ z
    return Answer(z, False, iteration + 1)


def _without(fixed: Mask, program: BandedQP, accuracy: float, gap: float) -> Answer:
    """Solve for the unknowns that are not fixed (n,) alone; rows that have no others hold or not."""
    P, c, G, lower, upper, least, most, start = program
    P, G, free = sp.csr_array(P), sp.csr_array(G), np.flatnonzero(~fixed)
    z = np.zeros(len(fixed))
    z[fixed] = 0.5 * (least[fixed] + most[fixed])
    left = G[:, free]
    asked = np.diff(left.indptr) > 0
    rows, value = np.flatnonzero(asked), G @ z
    missed = np.maximum(lower - value, value - upper)[~asked].max(initial=0.0)
    holds = bool(missed <= accuracy and (least[fixed] - most[fixed]).max() <= accuracy)
    if not len(free):
        return Answer(z, holds, 0)
    there = value[rows]
    others = BandedQP(
        P[free][:, free], (c + P @ z)[free], left[rows], lower[rows] - there, upper[rows] - there,
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
        ends = np.cumsum([0, len(self.low), len(self.high), len(self.under), len(self.over)])
        self._kinds = [slice(*each) for each in pairwise(ends)]
        self._rows, self._count = len(lower), len(least)

    def parts(self, values: Array | Indices) -> list[Any]:
        """Values (k,) of the bounds, by their kinds."""
        return [values[kind] for kind in self._kinds]

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
    """The matrices P (n, n), G (m, n) and `transposed` (n, m) of a program, and K as a band of its lower triangle."""

    def __init__(self, program: BandedQP) -> None:
        self.P, G = sp.csr_array(program.P), sp.csr_array(program.G)
        G.eliminate_zeros()
        G.sort_indices()
        self.G, self.transposed = G, sp.csr_array(G.T)
        # each row from its first to its last entry, zeros between them included
        some = np.flatnonzero(np.diff(G.indptr))
        self._first, lengths = np.zeros((2, G.shape[0]), dtype=np.intp)
        self._first[some] = G.indices[G.indptr[some]]
        lengths[some] = G.indices[G.indptr[some + 1] - 1] - self._first[some] + 1
        self._begins = np.concatenate([[0], np.cumsum(lengths)]).astype(np.intp)
        self._values = np.zeros(self._begins[-1])
        row = np.repeat(np.arange(G.shape[0]), np.diff(G.indptr))
        self._values[self._begins[row] + G.indices - self._first[row]] = G.data
        inner = sp.coo_array(self.P)
        inner.eliminate_zeros()  # of figures that equalities could couple, and do not
        at, to = inner.coords
        width = max(int((at - to).max(initial=0)) + 1, int(lengths.max(initial=1)))
        self._base = np.zeros((len(program.c), width))
        self._base[to[at >= to], (at - to)[at >= to]] = inner.data[at >= to]
        self._K = np.empty_like(self._base)  # one for all iterations: fresh memory of this size costs time

    def factor(self, rows: Array, unknowns: Array) -> Array | None:
        """Cholesky's of K with weights (m,) of rows and (n,) of unknowns, until the next one; None where singular."""
        K = self._K
        K[:] = self._base
        K[:, 0] += unknowns
        add_rows(K, self._first, self._begins, self._values, rows)
        cholesky, failed = lapack.dpbtrf(K.T, lower=1, overwrite_ab=1)
        return None if failed else cholesky


class _Newton(NamedTuple):
    """Newton's equations at slacks s and multipliers y (k,): the Lagrangian's derivative (n,), and A z - a - s (k,)."""

    matrices: _Matrices
    bounds: _Bounds
    factor: Array
    derivative: Array
    missed: Array
    s: Array
    y: Array

    def direction(self, products: Array) -> tuple[Array, Array, Array, Array]:
        """Changes of z, A z, s and y that take away these products (k,) of slacks and multipliers, to first order."""
        matrices, bounds, s, y = self.matrices, self.bounds, self.s, self.y
        pull = -self.derivative - bounds.transposed(matrices.transposed, (products + y * self.missed) / s)
        dz, _ = lapack.dpbtrs(self.factor, pull, lower=1)
        change = bounds.times(matrices.G @ dz, dz)
        ds = change + self.missed
        return dz, change, ds, -(products + y * ds) / s


def _slacks(P: Any, G: Any, unbounded: Mask) -> Indices:
    """The unknowns, unbounded above, that P does not couple with others, of each row the last."""
    alone: Mask = (np.diff(P.indptr) == 1) & (P.diagonal() != 0.0) & unbounded
    found = np.flatnonzero(alone & (np.bincount(G.indices, minlength=G.shape[1]) > 0))
    row, column = sp.coo_array(G[:, found]).coords
    last = np.full(G.shape[0], -1)
    np.maximum.at(last, row, column)
    return np.delete(found, np.unique(column[column < last[row]])).astype(np.intp)


def _begun(matrices: _Matrices, bounds: _Bounds, program: BandedQP) -> tuple[Array, Array, Array]:
    """Unknowns (n,), slacks (k,) and multipliers (k,) to begin with; slacks of rows are as large as they miss them."""
    c, least, most, start = program.c, program.least, program.most, program.start
    slack = _slacks(matrices.P, matrices.G, np.isinf(most))
    share, both = sp.csc_array(matrices.G[:, slack]), np.isfinite(least) & np.isfinite(most)
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
