"""Normal equations by sparse Cholesky: symbolic analysis once, numeric refactorisation after."""

from __future__ import annotations

from typing import Any

from wholebody.arrays import Array
from wholebody.methods.newton.linear_algebra.base import LinearSystem, Pattern, SingularSystemError, by_normal_equations
from wholebody.methods.newton.linear_algebra.gram import Gram


class NormalEquations:
    """J D^-1 J' + M by Eigen's SimplicialLDLT or SimplicialLLT with AMD ordering (eq. 10)."""

    def __init__(self, pattern: Pattern, *, square_root: bool = False) -> None:
        """Build and analyse; `square_root` uses L L' in place of L D L'."""
        import eigenpy

        self.name = "normal/llt" if square_root else "normal/ldlt"
        self.pattern = pattern
        self._gram = Gram(pattern)
        self._success = eigenpy.ComputationInfo.Success
        self._factor: Any = eigenpy.SimplicialLLT() if square_root else eigenpy.SimplicialLDLT()
        self._factor.analyzePattern(self._gram.matrix)

    @property
    def fill(self) -> int:
        """Non-zeros of the last factor."""
        return int(self._factor.matrixL().nnz)

    def solve(self, system: LinearSystem) -> tuple[Array, Array]:
        """Refill, refactorise, solve."""
        self._gram.refill(system.values, system.weight, system.damping)
        self._factor.factorize(self._gram.matrix)
        if self._factor.info() != self._success:
            raise SingularSystemError("the equations depend on each other; damp them")
        return by_normal_equations(self.pattern, system, self._factor.solve)
