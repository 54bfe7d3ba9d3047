"""Whether packages, QP solvers and methods work: each is used for real, in another process.

A binary package of the wrong version can crash the process that imports it. So a child tries one name after the other
and reports each; when it dies, the name it was at is what killed it, and a new child goes on with the rest.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

TIMEOUT = 300.0
"""Seconds for one child; a check takes one or two, on a machine that is busy more, and the first compiles the loops."""

_CHILD = "import sys; sys.path[:1] = []; sys.path.append({root!r}); from wholebody.doctor.checks import child; child()"


class Outcome(NamedTuple):
    """What came of a check.

    Attributes:
        works: whether it did what it should.
        detail: what was found, or why it failed, in a few words.
    """

    works: bool
    detail: str


def import_module(name: str) -> str:
    """Import a module; return the file it was found in."""
    from importlib import import_module as load

    return str(load(name).__file__)


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


def list_methods(_: str) -> str:
    """Names of the methods whose packages are installed, separated by spaces."""
    from wholebody.methods import installed_methods

    return " ".join(installed_methods())


CHECKS: dict[str, Callable[[str], str]] = {
    "import": import_module,
    "program": solve_program,
    "pose": pose_person,
    "methods": list_methods,
    "tool": use_tool,
}


def run(kind: str, names: Sequence[str], timeout: float = TIMEOUT) -> dict[str, Outcome]:
    """Try names one after the other.

    Args:
        kind: a key of `CHECKS`.
        names: what to try.
        timeout: seconds after which a child is ended.

    Returns:
        An outcome for every name.
    """
    left = list(dict.fromkeys(names))
    outcomes: dict[str, Outcome] = {}
    while left:
        reported, end = _run_child(kind, left, timeout)
        outcomes.update(reported)
        left = [name for name in left if name not in reported]
        if left:
            outcomes[left.pop(0)] = Outcome(False, end)
    return {name: outcomes[name] for name in names}


def child() -> None:
    """Try what standard input lists, and write a line for each."""
    kind, names = json.load(sys.stdin)
    reports = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever the packages print is not a report
    for name in names:
        try:
            outcome = Outcome(True, CHECKS[kind](name))
        except Exception as error:  # any failure at all is what is being looked for
            outcome = Outcome(False, f"{type(error).__name__}: {error}".strip().splitlines()[0])
        print(json.dumps([name, outcome]), file=reports, flush=True)


def _run_child(kind: str, names: Sequence[str], timeout: float) -> tuple[dict[str, Outcome], str]:
    """Outcomes up to the child's end, and how it ended."""
    command = [sys.executable, "-c", _CHILD.format(root=str(Path(__file__).resolve().parents[2]))]
    try:
        done = subprocess.run(
            command, input=json.dumps([kind, list(names)]), capture_output=True, text=True, timeout=timeout, check=False
        )
        output, errors = done.stdout, done.stderr.strip().splitlines()
        end = f"ended the process (code {done.returncode}){': ' + errors[-1] if errors else ''}"
    except subprocess.TimeoutExpired as expired:
        output = expired.stdout.decode() if isinstance(expired.stdout, bytes) else expired.stdout or ""
        end = f"no answer within {timeout:.0f} s"
    reports = [json.loads(line) for line in output.splitlines() if line.endswith("]]")]
    return {name: Outcome(*outcome) for name, outcome in reports}, end
