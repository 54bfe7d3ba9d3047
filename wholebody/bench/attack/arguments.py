"""Odd arguments to public callables: each has to be taken, or refused by a WholebodyError."""

from __future__ import annotations

import ast
from collections.abc import Mapping

import numpy as np

from wholebody.bench.attack.case import CORPUS, Written

ODD = (
    "None", "True", "3", "-1", "0", "0.5", "1e300", "-1e300", "1e-300", "10**400", "float('nan')", "float('inf')",
    "'x'",
    "''", "'human'", "b'x'", "'a' * 10_000", "[]", "()", "{}", "set()", "object()", "(1, 2)", "(1, 2, 3)", "[None]",
    "[[1], [2, 3]]", "(1, 2, 3, 0, 0, 0, 0)", "(float('nan'), 0, 0)", "('a', 'b', 'c')", "{'turn': 1.0}", "{1: 2}",
    "np.zeros(0)", "np.zeros(3)", "np.zeros((2, 2))", "np.full(3, np.nan)", "np.array('x')", "np.array([1j, 0, 0])",
    "np.array([None, None, None])", "np.eye(4)", "np.zeros((4, 4))", "np.float32(2)", "1j", "lambda *a, **k: None",
    "range(3)",
    "(x for x in 'ab')", "int", "wb", "wb.Box", "np.datetime64('2020-01-01')", "Ellipsis", "slice(2)", "figure",
    "scene",
    "problem", "wb.Sphere(0.1)", "wb.Effort()", "wb.Hold('link2')", "pin.SE3.Random()", "Path('x')",
    "memoryview(b'abc')",
)  # fmt: skip
"""What an argument becomes."""


def _call(line: str) -> tuple[str, dict[str, str]]:
    """A call in Python: what is called, and its arguments as Python by their names; "*" for one without."""
    node = ast.parse(line, mode="eval").body
    assert isinstance(node, ast.Call)
    given = {str(each.arg): ast.get_source_segment(line, each.value) or "" for each in node.keywords}
    if node.args:
        given["*"] = ast.get_source_segment(line, node.args[0]) or ""
    return ast.get_source_segment(line, node.func) or "", given


CALLS = tuple(_call(line) for line in (CORPUS / "calls.txt").read_text(encoding="utf-8").splitlines())
"""Public callables with arguments that are right."""

SCRIPT = '''"""{title}"""

from pathlib import Path

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.bench.attack import files
from wholebody.bench.attack.case import Verdict
from wholebody.figures.packaged_urdf import task_paths

robot = Path(__file__).with_name("robot.urdf")
figure = wb.load(robot)
scene = wb.Scene(figure).add(wb.Sphere(0.1), name="ball", at=(0.5, 0.5, 0.5))
problem = wb.Problem(scene, goals=[wb.Point("link2", (0.1, 0.0, 0.5))])
try:
    {call}
    verdict = Verdict("right", "taken")
except wb.WholebodyError as error:
    verdict = files.refused(error)
print(verdict)
'''
TERMS = {"wb.Point", "wb.Frame", "wb.Orientation", "wb.Axis", "wb.CenterOfMass", "wb.Relative", "wb.Posture"}
CONSTRAINTS = {"wb.Hold", "wb.Plane", "wb.Balance", "wb.Freeze", "wb.StepLimit", "wb.ReachCones"}
MEASURES = {"wb.Effort", "wb.RotationEffort", "wb.Discomfort", "wb.Displacement", "wb.PotentialEnergy"}
SHAPES = {"wb.Box", "wb.Sphere", "wb.Capsule", "wb.Ellipsoid", "wb.HalfSpace", "wb.Hull", "wb.Mesh"}


def written(rng: np.random.Generator) -> Written:
    """Write a call with one odd argument, seldom two."""
    name, arguments = CALLS[int(rng.integers(len(CALLS)))]
    given = dict(arguments)
    for key in rng.permutation(list(arguments))[: 1 if rng.random() < 0.85 else 2]:
        given[str(key)] = ODD[int(rng.integers(len(ODD)))]
    return called(name, given)


def called(name: str, given: Mapping[str, str]) -> Written:
    """Write a call of a public callable with arguments, both as Python."""
    call = f"{name}({', '.join(_argument(key, value) for key, value in given.items())})"
    script = SCRIPT.format(title=f"an odd argument of {name}", call=_used(name, call))
    return Written(script, {"robot.urdf": (CORPUS / "two-links.urdf").read_bytes()})


def _argument(key: str, value: str) -> str:
    return f"*({value},)" if key.startswith("*") else f"{key}={value}"


def _used(name: str, call: str) -> str:
    """The call, and where it makes something, a use of it: what is refused late is refused too."""
    if name in TERMS:
        return f"wb.solve(wb.Problem(scene, goals=[{call}]), method=wb.QP(budget=5))"
    if name in CONSTRAINTS:
        return f"wb.solve(wb.Problem(scene, constraints=[{call}]), method=wb.QP(budget=5))"
    if name in MEASURES:
        return f"wb.solve(wb.Problem(scene, measures=[{call}]), method=wb.QP(budget=5))"
    if name in SHAPES:
        return f"scene.add({call}, name='made', at=(3, 0, 0)).contacts(figure.neutral)"
    if name in ("wb.QP", "wb.methods.CCD", "wb.Newton", "wb.methods.Placo", "wb.methods.DampedLeastSquares"):
        return f"wb.solve(problem, method={call})"
    if name == "wb.Problem":
        return f"wb.solve({call}, method=wb.QP(budget=5))"
    return call
