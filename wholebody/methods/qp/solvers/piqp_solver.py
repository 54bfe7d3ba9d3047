"""PIQP (Schwan, Jiang, Kuhn and Jones 2023): a proximal interior-point method."""

from __future__ import annotations

import numpy as np
import piqp

from wholebody.methods.qp.solvers.native_solver import Native, NativeSolver
from wholebody.methods.qp.solvers.split_form import SplitForm

TOLERANCE = 1e-8  # of the optimality conditions; the active set is then corrected
LIMIT = 100  # iterations
ACTIVE = 1e-6  # multiplier above which a row counts: those of an interior point are never zero


class PIQPSolver(NativeSolver):
    """PIQP with a workspace that lives on; an interior-point method begins anew in each program."""

    name = "piqp"

    def minimise(self, form: SplitForm, n: int, m: int) -> Native:
        """See `NativeSolver.minimise`."""
        data = {
            "P": np.diag(form.diagonal), "c": form.linear, "A": np.asfortranarray(form.matrix[:m]), "b": form.lower[:m],
            "G": np.asfortranarray(form.matrix[m:]), "h_l": form.lower[m:], "x_l": form.box_lower,
            "x_u": form.box_upper,
        }  # fmt: skip
        if self._workspace is None:
            self._workspace = piqp.DenseSolver()
            settings = self._workspace.settings
            settings.eps_abs, settings.eps_rel, settings.max_iter = TOLERANCE, 0.0, LIMIT
            self._workspace.setup(**data)
        else:
            self._workspace.update(**data)
        self._workspace.solve()
        found = self._workspace.result
        box = np.asarray(found.z_bu)[:n] - np.asarray(found.z_bl)[:n]
        push = np.asarray(found.z_l)
        box, push = (np.where(np.abs(one) > ACTIVE, one, 0.0) for one in (box, push))
        return Native(np.array(found.x), box, push, max(int(found.info.iter), 1))
