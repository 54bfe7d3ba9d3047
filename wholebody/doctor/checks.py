"""Checks of packages, QP solvers and methods: each is really used, in a child process.

A binary package of the wrong version can crash the process that imports it. So a child process tries one name after the
other. If it crashes, the present name caused the crash, and a new child process continues with the others.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import NamedTuple

from wholebody.base.runner import Child, EndedError

TIMEOUT = 300.0
"""Time limit of a check, seconds; a check takes one or two, more on a busy machine; the first compiles the loops."""


class Outcome(NamedTuple):
    """The outcome of a check."""

    works: bool  # whether the check succeeded
    detail: str  # the finding, or the reason of the failure, in a few words


def solve_program(name: str) -> str:
    """Solve ``min (x^2 + y^2) / 2 - x - y`` with ``x + y <= 1`` by a solver of qpsolvers: x = y = 1/2."""
    import numpy as np
    from qpsolvers import solve_qp
    from scipy import sparse

    matrix, row = sparse.eye_array(2, format="csc"), sparse.csc_array([[1.0, 1.0]])
    if name in ("daqp", "quadprog"):
        matrix, row = matrix.toarray(), row.toarray()
    x = solve_qp(matrix, -np.ones(2), row, np.ones(1), lb=-np.ones(2), ub=np.ones(2), solver=name)
    if x is None or not np.abs(x - 0.5).max() < 1e-2:
        raise ArithmeticError(f"a program of two variables gave {x}, not [0.5, 0.5]")
    return f"off by {np.abs(x - 0.5).max():.0e}"


def pose_person(method: str) -> str:
    """Reach 5 cm forward by a method."""
    import wholebody as wb
    from wholebody.figures.state import State

    figure = wb.load("human", detail="spheres")
    state = State(figure.model).update(figure.posture("standing"))
    target = state.frame(figure.frame_id("right_index_tip")).translation + (0.05, 0.0, 0.0)
    solution = wb.solve(wb.Problem(wb.Scene(figure), "standing", goals=[wb.Point("right_index_tip", target)]), method)
    if not solution.solved:
        raise ArithmeticError(f"a reach of 5 cm ended {solution.status}")
    return f"{1e3 * solution.seconds:.0f} ms for a small reach"


def use_tool(name: str) -> str:
    """Draw an empty page with Chromium, or find ffmpeg."""
    if name == "ffmpeg":
        path: str | None = shutil.which(name)
        if path is None:
            raise FileNotFoundError("not found")
        return str(path)
    from wholebody.view.browser import Browser, find_chromium
    from wholebody.view.page import static_page

    path = find_chromium()
    if path is None:
        raise FileNotFoundError("not found")
    with Browser((64, 64)) as browser:
        browser.open_html(static_page([]))
        browser.capture()
    return path


def look_at_cache(_: str) -> str:
    """Say what the cache of mesh pieces holds."""
    from wholebody.geometry.mesh_cache import LARGEST_CACHE, cache_state

    state = cache_state()
    size, most = state.size / 2**20, LARGEST_CACHE // 2**20
    held = f"{state.entries} meshes, {size:.1f} of at most {most} MB, in {state.folder}"
    if not state.writable:
        raise PermissionError(f"{held}, which cannot be written: pieces of meshes are made anew each time")
    return held


CHECKS: dict[str, Callable[[str], str]] = {
    "import": lambda name: str(import_module(name).__file__),
    "program": solve_program,
    "pose": pose_person,
    "tool": use_tool,
    "cache": look_at_cache,
}


def run(kind: str, names: Sequence[str], timeout: float = TIMEOUT) -> dict[str, Outcome]:
    """Try names one after the other."""
    child, outcomes = Child(), dict[str, Outcome]()
    try:
        for name in names:
            try:
                outcomes[name] = Outcome(*child.call(attempt, kind, name, seconds=timeout))
            except EndedError as error:
                said = f": {error.said}" if error.said else ""
                late = f"no answer within {timeout:.0f} s"
                outcomes[name] = Outcome(False, late if error.overtime else f"ended the process ({error.how}){said}")
    finally:
        child.close()
    return outcomes


def attempt(kind: str, name: str) -> tuple[bool, str]:
    """Try a name in this process: whether it works, and the finding or the reason of the failure."""
    try:
        return True, CHECKS[kind](name)
    except Exception as error:  # the check reports every failure
        return False, f"{type(error).__name__}: {error}".strip().splitlines()[0]
