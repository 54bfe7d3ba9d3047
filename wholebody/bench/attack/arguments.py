"""Odd arguments to public callables: each has to be taken, or refused by a WholebodyError."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.bench.attack.case import CORPUS, Verdict
from wholebody.bench.attack.files import refused
from wholebody.figures.packaged_urdf import task_paths


def case(rng: np.random.Generator, folder: Path) -> Verdict:
    """A call with one odd argument, seldom two."""
    calls, odd = calls_that_are_right(), _lines("odd.txt")
    name, arguments = calls[int(rng.integers(len(calls)))]
    given = dict(arguments)
    for key in rng.permutation(list(arguments))[: 1 if rng.random() < 0.85 else 2]:
        given[str(key)] = odd[int(rng.integers(len(odd)))]
    return called(name, given, folder)


def called(name: str, given: dict[str, str], folder: Path) -> Verdict:
    """Call a public callable with arguments, as Python by their names; "*" for one without.

    What the call makes is used: what is refused late is refused too.
    """
    (folder / "robot.urdf").write_bytes((CORPUS / "two-links.urdf").read_bytes())
    robot = folder / "robot.urdf"
    figure = wb.load(robot)
    scene = wb.Scene(figure).add(wb.Sphere(0.1), name="ball", at=(0.5, 0.5, 0.5))
    problem = wb.Problem(scene, goals=[wb.Point("link2", (0.1, 0.0, 0.5))])
    known = {"np": np, "pin": pin, "wb": wb, "Path": Path, "task_paths": task_paths}
    known |= {"robot": robot, "figure": figure, "scene": scene, "problem": problem}
    call = f"{name}({', '.join(f'*({v},)' if key == '*' else f'{key}={v}' for key, v in given.items())})"
    try:
        _use(eval(call, known), problem)
    except wb.WholebodyError as error:
        return refused(error)
    return Verdict("right", f"{call[:200]} was taken")


def _use(made: Any, problem: wb.Problem) -> None:
    """Use what a call has made, by itself."""
    scene, qp = problem.scene, wb.QP(budget=5)
    if isinstance(made, wb.Goal):
        wb.solve(wb.Problem(scene, goals=[made]), method=qp)
    elif isinstance(made, wb.Constraint):
        wb.solve(wb.Problem(scene, constraints=[made]), method=qp)
    elif isinstance(made, wb.Measure):
        wb.solve(wb.Problem(scene, measures=[made]), method=qp)
    elif isinstance(made, wb.Shape):
        scene.add(made, name="made", at=(3, 0, 0)).contacts(scene.figure.neutral)
    elif isinstance(made, wb.Problem):
        wb.solve(made, method=qp)
    elif hasattr(made, "solve"):
        wb.solve(problem, method=made)


@cache
def calls_that_are_right() -> list[tuple[str, dict[str, str]]]:
    """Public callables with arguments that are right, both as Python."""
    return [_call(line) for line in _lines("calls.txt")]


def _call(line: str) -> tuple[str, dict[str, str]]:
    node = ast.parse(line, mode="eval").body
    assert isinstance(node, ast.Call)
    given = {str(each.arg): ast.get_source_segment(line, each.value) or "" for each in node.keywords}
    if node.args:
        given["*"] = ast.get_source_segment(line, node.args[0]) or ""
    return ast.get_source_segment(line, node.func) or "", given


def _lines(name: str) -> list[str]:
    return (CORPUS / name).read_text(encoding="utf-8").splitlines()
