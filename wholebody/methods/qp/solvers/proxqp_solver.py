"""ProxQP (Bambade, El-Kazdadi, Taylor and Carpentier 2022): a proximal augmented Lagrangian method."""

from __future__ import annotations

import numpy as np
from proxsuite import proxqp

from wholebody.methods.qp.quadratic_program import SplitForm
from wholebody.methods.qp.solvers.native_solver import NativeAnswer, SplitFormSolver

FAR = 1e20  # ProxQP's infinity


class ProxQPSolver(SplitFormSolver):
    """ProxQP with a workspace that lives on, and begins with its last answer."""

    name = "proxqp"

    def answer(self, form: SplitForm, n: int, m: int) -> NativeAnswer:
        """See `SplitFormSolver.answer`."""
        size, slots = len(form.linear), len(form.lower) - m
        data = (
            np.diag(form.diagonal), form.linear, form.matrix[:m], form.lower[:m], form.matrix[m:], form.lower[m:],
            np.full(slots, FAR), np.maximum(form.box_lower, -FAR), np.minimum(form.box_upper, FAR),
        )  # fmt: skip
        if self._workspace is None:
            solver = proxqp.dense.QP(size, m, slots, True, proxqp.dense.HessianType.Diagonal)
            # of the optimality conditions; the active set is then corrected
            solver.settings.eps_abs, solver.settings.eps_rel = 1e-6, 0.0
            # outer iterations
            solver.settings.max_iter = 200
            solver.settings.initial_guess = proxqp.InitialGuess.NO_INITIAL_GUESS
            solver.init(*data)
        else:
            solver = self._workspace
            solver.settings.initial_guess = proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
            solver.update(*data)
        solver.solve()
        self._workspace, found = solver, solver.results
        z = np.asarray(found.z)
        return NativeAnswer(np.array(found.x), z[slots : slots + n].copy(), -z[:slots], max(int(found.info.iter), 1))
