"""What numba's compiler leaves out for our loops: passes that it has, without which results are the same."""

from __future__ import annotations

import numba
import numpy as np
from numba.core import compiler

from wholebody.base.compiled import compiled
from wholebody.base.compiler_passes import needed_passes


def passes_of(kind: type, function: object) -> list[str]:
    class Told(kind):
        def define_pipelines(self):
            (made,) = super().define_pipelines()
            names.extend(step.__name__ for step, _ in made.passes)
            return [made]

    names: list[str] = []
    numba.njit(pipeline_class=Told)(function)(np.ones((3, 3)))
    return names


def walked(rows):
    """Loops, branches, a constant tuple, views and a division."""
    total, (first, last) = 0.0, (0, len(rows))
    for i in range(first, last):
        row = rows[i]
        for k in range(len(row)):
            total += row[k] / (1 + i) if k != i else -row[k]
    for scale, other in ((2.0, 0), (3.0, 1)):
        total += scale * rows[other, 0]
    return total


def test_passes_for_closures_and_literals_are_left_out_and_the_others_keep_their_order():
    whole, needed = passes_of(compiler.Compiler, walked), passes_of(needed_passes(), walked)
    assert len(whole) - len(needed) == 9  # numba has each of those that are named
    assert needed == [name for name in whole if name in needed]
    fast = {
        "InlineInlinables",
        "InlineOverloads",
        "NopythonRewrites",
    }  # without the first, bodies took 1.5 times the time
    assert fast | {"NopythonTypeInference", "DeadBranchPrune", "ReconstructSSA", "NativeLowering"} <= {*needed}


def test_loops_have_the_results_of_python_also_where_calls_are_known_by_other_types():
    rows = np.random.default_rng(1).normal(size=(4, 5))
    loop = compiled()(walked)
    for given in (rows, rows.astype(np.float32), np.arange(20).reshape(4, 5), rows):
        np.testing.assert_allclose(loop(given), walked(given), rtol=1e-5)
    assert len(loop.signatures) == 3
