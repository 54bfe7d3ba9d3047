"""PIQP (Schwan, Jiang, Kuhn and Jones 2023): a proximal interior-point method.

It factorises a matrix of all variables in each iteration. So the residuals of the soft rows are no variables here;
their weights are in the Hessian D + T' W T.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import piqp

from wholebody.base.arrays import Array
from wholebody.methods.qp.quadratic_program import QuadraticProgram
from wholebody.methods.qp.solvers.native_solver import NativeAnswer, NativeSolver
from wholebody.methods.qp.solvers.split_form import SCALING


class PIQPSolver(NativeSolver):
    """PIQP with a workspace that lives on; an interior-point method has no warm start."""

    name = "piqp"

    def minimise(self, program: QuadraticProgram, slots: int) -> NativeAnswer:
        """See `NativeSolver.minimise`."""
        n, k = program.size, len(program.least)
        data = _condensed(program, slots)
        if self._workspace is None:
            self._workspace = piqp.DenseSolver()
            settings = self._workspace.settings
            # of the optimality conditions; the active set is then corrected
            # iterations
            settings.eps_abs, settings.eps_rel, settings.max_iter = 1e-5, 0.0, 100
            # the set is read where it is plain, long before the gap closes; rows have one scale already
            settings.check_duality_gap, settings.preconditioner_iter = False, 0
            self._workspace.setup(**data)
        else:
            self._workspace.update(**data)
        self._workspace.solve()
        found = self._workspace.result
        z, push = np.asarray(found.x), np.asarray(found.z_l)[:k]
        x = z[:n]
        box_lower, box_upper = np.asarray(found.z_bl)[:n], np.asarray(found.z_bu)[:n]
        return NativeAnswer(
            x / SCALING.x,
            _active(box_upper, data["x_u"][:n] - x) - _active(box_lower, x - data["x_l"][:n]),
            _active(push, data["G"][:k] @ z - data["h_l"][:k]),
            max(int(found.info.iter), 1),
        )


def _active(multiplier: Array, room: Array) -> Array:
    """Multipliers of what is active, and zero else: of an interior point none is, but it exceeds the room left."""
    result: Array = np.where(multiplier > np.maximum(room, 0.0), multiplier, 0.0)
    return result


def _condensed(program: QuadraticProgram, slots: int) -> dict[str, Any]:
    """The program over x and its elastic rows' residuals, scaled as the split form is, as PIQP names its parts."""
    n, k = program.size, len(program.least)
    size, root = n + slots, np.sqrt(np.minimum(program.elastic_weight, SCALING.heaviest))
    hessian, linear = np.eye(size), np.zeros(size)
    hessian[:n, :n] = (program.rows.T * (program.weight / SCALING.x**2)) @ program.rows
    hessian.flat[: n * (size + 1) : size + 1] += program.diagonal / SCALING.x**2
    linear[:n] = (program.linear - (program.weight * program.target) @ program.rows) / SCALING.x
    rows, least, places = np.eye(slots, size, n, order="F"), np.full(slots, SCALING.inactive), np.arange(k)
    rows[:k, :n] = program.elastic * (root / SCALING.x)[:, None]
    rows[places, n + places], least[:k] = root / np.sqrt(program.elastic_weight), root * program.least
    lower, upper = np.full(size, -np.inf), np.full(size, np.inf)
    lower[:n], upper[:n] = SCALING.x * program.lower, SCALING.x * program.upper
    return {"P": hessian, "c": linear, "G": rows, "h_l": least, "x_l": lower, "x_u": upper}
