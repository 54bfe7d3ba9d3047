"""Dense references: sparse factorisations are compared with them, and they solve rank-deficient systems."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array
from wholebody.methods.newton.linear_algebra.base import LinearSystem, Pattern, SingularSystemError, by_normal_equations


class Dense:
    """The whole KKT matrix by LAPACK's LU factorisation."""

    name = "dense"

    def __init__(self, pattern: Pattern) -> None:
        """Store the pattern."""
        self.pattern = pattern

    @property
    def fill(self) -> int:
        """Entries of the dense triangle."""
        size = self.pattern.height + self.pattern.width
        return size * (size + 1) // 2

    def solve(self, system: LinearSystem) -> tuple[Array, Array]:
        """Fill and solve."""
        jacobian = self.pattern.dense(system.values)
        matrix = np.block([[np.diag(system.weight), -jacobian.T], [-jacobian, -np.diag(system.damping)]])
        try:
            found = np.linalg.solve(matrix, np.concatenate([-system.gradient, system.residual]))
        except np.linalg.LinAlgError:
            raise SingularSystemError("the equations depend on each other; damp them") from None
        return found[: self.pattern.width], found[self.pattern.width :]


class SingularValues:
    """Normal equations by singular values: least squares over conflicting equations, any redundancy."""

    name = "svd"

    def __init__(self, pattern: Pattern) -> None:
        """Store the pattern."""
        self.pattern = pattern

    @property
    def fill(self) -> int:
        """Entries of the dense matrix."""
        return self.pattern.height**2

    def solve(self, system: LinearSystem) -> tuple[Array, Array]:
        """Fill and solve; never singular."""
        scaled = self.pattern.dense(system.values) / np.sqrt(system.weight)
        gram = scaled @ scaled.T + np.diag(system.damping)

        def solve(right: Array) -> Array:
            result: Array = np.linalg.lstsq(gram, right, rcond=1e-12)[0]
            return result

        return by_normal_equations(self.pattern, system, solve)
