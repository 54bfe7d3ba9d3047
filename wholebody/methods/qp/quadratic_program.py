"""The quadratic program of one step, in a form that always has exactly one answer.

    minimise    1/2 x' D x + g' x  +  1/2 sum_i w_i (t_i x - e_i)^2  +  1/2 sum_j v_j max(0, l_j - c_j x)^2
    subject to  lower <= x <= upper

D is diagonal and positive. The soft rows t carry goals and equalities, the elastic rows c what must stay apart or
within bounds. Only the box is hard, so a start in penetration, a goal out of reach or constraints that contradict
each other are ordinary programs and none is infeasible. Large weights order the rows: what has the larger weight
gives way last.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask


class QuadraticProgram(NamedTuple):
    """Data of one program in n variables; compiled loops take it as it is."""

    diagonal: Array  # (n,) D, positive
    linear: Array  # (n,) g
    rows: Array  # (m, n) soft rows t
    target: Array  # (m,) their targets e
    weight: Array  # (m,) their weights w, positive
    elastic: Array  # (k, n) elastic rows c
    least: Array  # (k,) their least values l
    elastic_weight: Array  # (k,) their weights v, positive
    lower: Array  # (n,) the box, finite, lower <= upper
    upper: Array

    def check_shapes(self, active: ActiveSet) -> None:
        """Raise ValueError where sizes do not fit together: compiled loops do not look, and read beyond an end."""
        n, m, k = len(self.diagonal), len(self.target), len(self.least)
        if not (
            len(self.linear) == len(self.lower) == len(self.upper) == len(active.lower) == len(active.upper) == n
            and self.rows.shape == (m, n)
            and len(self.weight) == m
            and self.elastic.shape == (k, n)
            and len(self.elastic_weight) == len(active.elastic) == k
        ):
            raise ValueError(f"a program of {n} variables, {m} soft and {k} elastic rows has parts of other sizes")

    def packed(self) -> QuadraticProgram:
        """The program in arrays without gaps, as compiled loops take it."""
        return self if all(part.flags.c_contiguous for part in self) else type(self)(*map(np.ascontiguousarray, self))

    @property
    def is_computable(self) -> bool:
        """Whether numbers and squares are finite, weights positive and bounds ordered; user terms may give NaN."""
        with np.errstate(all="ignore"):
            curvature = self.diagonal + self.weight @ self.rows**2 + self.elastic_weight @ self.elastic**2
            targets = self.weight @ self.target**2 + self.elastic_weight @ self.least**2
            bounds = np.concatenate([self.lower, self.upper])
            bounds = bounds[~np.isinf(bounds)]  # one of these may be missing
            largest = curvature.sum() + targets + self.linear @ self.linear + bounds @ bounds
            least = min(part.min(initial=np.inf) for part in (self.diagonal, self.weight, self.elastic_weight))
            # sum of the squares in a program from which on it is not solved: solvers take 1e30 for infinite.
            return bool(largest < 1e30 and least > 0.0 and (self.lower <= self.upper).all())

    @property
    def size(self) -> int:
        """Number of variables n."""
        return len(self.diagonal)

    def gradient(self, x: Array) -> Array:
        """Derivative of the objective at x, shape (n,); it is continuous."""
        residual = self.rows @ x - self.target
        violated = np.maximum(self.least - self.elastic @ x, 0.0)
        result: Array = (
            self.diagonal * x
            + self.linear
            + (self.weight * residual) @ self.rows
            - (self.elastic_weight * violated) @ self.elastic
        )
        return result

    def optimality(self, x: Array) -> float:
        """Largest entry of x - clip(x - gradient / scale), in units of x; the scale is the curvature there."""
        violated = self.least - self.elastic @ x > 0.0
        scale = self.diagonal + self.weight @ self.rows**2 + (self.elastic_weight * violated) @ self.elastic**2
        moved = np.clip(x - self.gradient(x) / scale, self.lower, self.upper)
        return float(np.abs(moved - x).max(initial=0.0))


class ActiveSet(NamedTuple):
    """Which bounds hold x and which elastic rows push."""

    lower: Mask
    upper: Mask
    elastic: Mask


class Room(NamedTuple):
    """Room of the compiled loops for a program with k elastic rows."""

    work: Array  # see `work_size`
    places: Indices  # (2 k or more,)
    chosen: Mask  # (k or more,)


def work_size(variables: int, soft: int, elastic: int) -> int:
    """Floats that `face_kernel.face` lays out for a program of so many variables, soft rows and elastic rows."""
    rows = soft + elastic
    return 2 * rows * variables + rows * rows + 3 * rows + elastic + 3 * variables


class QPSolution(NamedTuple):
    """Answer to a program."""

    x: Array  # (n,) the minimiser
    active: ActiveSet  # the active set it was found with
    exact: bool  # whether the optimality conditions hold to rounding; otherwise x is the best found
    iterations: int  # iterations of the solver that was used; 0 where none was
    # what closed the program: "active set" where one that was known led to the answer, the solver's name, "semismooth
    # newton" where the solver's answer did not lead to an exact one, or "not exact"
    by: str = ""
