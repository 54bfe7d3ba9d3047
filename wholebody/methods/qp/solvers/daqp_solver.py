"""DAQP (Arnstroem, Bemporad and Axehill 2022): a dual active-set solver, exact by itself and fast at this size."""

from __future__ import annotations

from ctypes import c_int

import daqp
import numpy as np

from wholebody.methods.qp.quadratic_program import SplitForm
from wholebody.methods.qp.solvers.native_solver import NativeAnswer, SplitFormSolver


class DAQPSolver(SplitFormSolver):
    """DAQP with a model that lives on, and begins with the active set of its last answer."""

    name = "daqp"

    def answer(self, form: SplitForm, n: int, m: int) -> NativeAnswer | None:
        """See `SplitFormSolver.answer`."""
        hessian = np.diag(form.diagonal)
        # DAQP's infinity
        upper = np.concatenate([form.box_upper[:n], np.minimum(form.upper, 1e30)])
        lower = np.concatenate([form.box_lower[:n], form.lower])
        if self._workspace is not None:
            flag = self._workspace.update(H=hessian, f=form.linear, A=form.matrix, bupper=upper, blower=lower)
            self._workspace = self._workspace if flag >= 0 else None
        if self._workspace is None:
            sense = np.zeros(len(upper), dtype=c_int)
            # DAQP's mark for a row that is always active
            sense[n : n + m] = 5
            self._workspace = daqp.Model()
            flag, _ = self._workspace.setup(hessian, form.linear, form.matrix, upper, lower, sense)
            if flag < 0:  # it refuses rows whose equalities depend on each other, as those of many frozen joints do
                self._workspace = None
                return None
            # iterations
            # of rows
            self._workspace.settings = {"primal_tol": 1e-9, "iter_limit": 500}
        z, _, _, info = self._workspace.solve()
        multiplier = np.asarray(info["lam"])
        return NativeAnswer(np.asarray(z), multiplier[:n], -multiplier[n + m :], int(info["iterations"]))
