"""Pose people, avatars, hands and robots among objects, in contact and without penetration.

The public names are loaded when they are first used, so that ``import wholebody`` is fast::

    import wholebody as wb

    scene = wb.Scene(wb.load("human"))
    scene.add(wb.Box((1.2, 0.7, 0.04)), name="table", at=(0.9, 0.0, 0.72))
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.55, -0.25, 0.95))])
    solution = wb.solve(problem, method="qp")

What fewer programs need stands in `wb.dynamics`, `wb.ergonomics`, `wb.figures`, `wb.methods`, `wb.motion`,
`wb.planning`, `wb.studies`, `wb.taskfile`, `wb.tasks` and `wb.tracking`.
"""

from __future__ import annotations

from wholebody.base.imports import exported

__getattr__, __dir__, __all__ = exported(__name__, __file__)
