"""The filling of the sparse split form as compiled loops: see `split_form`."""

from __future__ import annotations

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.base.compiled import compiled
from wholebody.methods.qp.quadratic_program import QuadraticProgram, Scaling, SparseForm


@compiled()
def within(rows: Array, pattern: Mask) -> bool:
    """Whether rows (m, n) are zero outside of a pattern (m, n)."""
    for i in range(rows.shape[0]):
        for c in range(rows.shape[1]):
            if rows[i, c] != 0.0 and not pattern[i, c]:
                return False
    return True


@compiled(error_model="numpy")
def fill_sparse(program: QuadraticProgram, scaling: Scaling, form: SparseForm) -> None:
    """Write a program's numbers into a sparse split form, whose slots are at least the program's elastic rows."""
    n, m, k, scale = len(program.diagonal), len(program.target), len(program.least), scaling.x
    slots = len(form.lower) - n - m
    root, elastic_root = np.empty(m), np.empty(k)
    for i in range(m):
        root[i] = np.sqrt(min(program.weight[i], scaling.heaviest))
        form.lower[n + i] = form.upper[n + i] = root[i] * program.target[i]
        form.hessian[n + i], form.gradient[n + i] = 1.0, 0.0
    for j in range(slots):
        if j < k:
            elastic_root[j] = np.sqrt(min(program.elastic_weight[j], scaling.heaviest))
        form.lower[n + m + j] = elastic_root[j] * program.least[j] if j < k else scaling.inactive
        form.upper[n + m + j] = scaling.infinite
        form.hessian[n + m + j], form.gradient[n + m + j] = 1.0, 0.0
    at = 0
    for c in range(n):
        form.hessian[c], form.gradient[c] = program.diagonal[c] / (scale * scale), program.linear[c] / scale
        form.lower[c], form.upper[c] = scale * program.lower[c], scale * program.upper[c]
        form.values[at] = 1.0
        at += 1
        for place in range(form.starts[c], form.starts[c + 1]):
            i = form.places[place]
            form.values[at] = root[i] / scale * program.rows[i, c]
            at += 1
        for j in range(slots):
            form.values[at + j] = elastic_root[j] / scale * program.elastic[j, c] if j < k else 0.0
        at += slots
    for i in range(m):
        form.values[at + i] = -root[i] / np.sqrt(program.weight[i])
    at += m
    for j in range(slots):
        form.values[at + j] = elastic_root[j] / np.sqrt(program.elastic_weight[j]) if j < k else 1.0
