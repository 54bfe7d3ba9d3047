"""Odd arguments to public callables: each has to be taken, or refused by a WholebodyError."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wholebody.bench.attack.case import Written

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

CALLS: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    ("wb.Box", (("size", "(1, 1, 1)"),)),
    ("wb.Sphere", (("radius", "1.0"),)),
    ("wb.Capsule", (("radius", "0.1"), ("length", "1.0"))),
    ("wb.Ellipsoid", (("semi_axes", "(1, 1, 1)"),)),
    ("wb.HalfSpace", (("normal", "(0, 0, 1)"), ("offset", "0.0"))),
    ("wb.Hull", (("points", "np.eye(4, 3)"),)),
    ("wb.Mesh", (("source", "(np.eye(4, 3), [(0, 1, 2), (0, 3, 1), (1, 3, 2), (0, 2, 3)])"), ("scale", "1.0"),
                 ("up", "'z'"), ("max_vertices", "32"), ("threshold", "0.05"))),
    ("wb.Point", (("frame", "'link2'"), ("target", "(0, 0, 1)"), ("offset", "(0, 0, 0)"), ("weight", "1.0"))),
    ("wb.Frame", (("frame", "'link2'"), ("target", "(0, 0, 1)"), ("weight", "1.0"))),
    ("wb.Orientation", (("frame", "'link2'"), ("target", "(0, 0, 0, 1)"), ("weight", "1.0"))),
    ("wb.Axis", (("frame", "'link2'"), ("axis", "(0, 0, 1)"), ("direction", "(0, 1, 0)"), ("weight", "1.0"))),
    ("wb.Axis", (("frame", "'link2'"), ("axis", "(0, 0, 1)"), ("toward", "(0, 1, 0)"))),
    ("wb.CenterOfMass", (("target", "(0, 0, 1)"), ("axes", "'xyz'"), ("weight", "1.0"))),
    ("wb.Relative", (("frame", "'link2'"), ("to", "'link0'"), ("placement", "(0, 0, 1)"), ("orientation", "True"),
                     ("weight", "1.0"))),
    ("wb.Posture", (("target", "'neutral'"), ("joints", "['joint1']"), ("weight", "1.0"))),
    ("wb.Hold", (("frame", "'link2'"), ("at", "(0, 0, 1)"), ("orientation", "True"), ("relative_to", "'link0'"))),
    ("wb.Plane", (("frame", "'link2'"), ("normal", "(0, 0, 1)"), ("point", "(0, 0, 1)"), ("side", "'on'"))),
    ("wb.Balance", (("feet", "['link1']"), ("margin", "0.0"))),
    ("wb.Freeze", (("*joints", "'joint1'"),)),
    ("wb.StepLimit", (("velocity", "1.0"), ("joints", "{'joint1': 1.0}"))),
    ("wb.ReachCones", (("names", "['right_shoulder']"),)),
    ("wb.Effort", (("weight", "1.0"),)),
    ("wb.Discomfort", (("weight", "1.0"),)),
    ("wb.Displacement", (("weight", "1.0"),)),
    ("wb.PotentialEnergy", (("weight", "1.0"),)),
    ("wb.load", (("spec", "'hand'"), ("side", "'left'"), ("sex", "'male'"), ("stature", "1.75"), ("mass", "70.0"))),
    ("wb.load", (("spec", "'avatar'"), ("sex", "'male'"), ("stature", "1.75"), ("mass", "70.0"), ("detail",
         "'capsules'"))),
    ("wb.load", (("spec", "robot"), ("root", "'fixed'"), ("package_dirs", "()"), ("concavity", "0.2"))),
    ("wb.Scene", (("figure", "figure"),)),
    ("wb.Problem", (("scene", "scene"), ("start", "'neutral'"), ("goals", "[wb.Point('link2', (0, 0, 1))]"),
                    ("constraints", "[]"), ("measures", "[]"), ("clearance", "0.0"), ("touching", "()"))),
    ("wb.QP", (("solver", "'osqp'"), ("tolerance", "1e-5"), ("iterations", "50"), ("budget", "20"), ("restarts", "2"),
               ("seed", "0"), ("measures", "True"), ("time_limit", "2.0"))),
    ("wb.CCD", (("tolerance", "1e-4"), ("iterations", "50"), ("seed", "0"), ("time_limit", "2.0"))),
    ("wb.Newton", (("tolerance", "1e-5"), ("iterations", "50"), ("seed", "0"), ("time_limit", "2.0"))),
    ("wb.Placo", (("tolerance", "1e-5"), ("iterations", "50"), ("time_limit", "2.0"))),
    ("wb.DampedLeastSquares", (("tolerance", "1e-5"), ("iterations", "50"), ("time_limit", "2.0"))),
    ("wb.solve", (("problem", "problem"), ("method", "'qp'"))),
    ("wb.assess", (("problem", "problem"), ("q", "figure.neutral"))),
    ("wb.pull", (("problem", "problem"), ("path", "[(0, 0, 1.0), (0, 0.02, 1.0)]"), ("method", "'qp'"), ("goal", "0"),
                 ("spacing", "0.05"))),
    ("wb.Drag", (("problem", "problem"), ("method", "'qp'"), ("goal", "0"), ("dt", "0.02"))),
    ("wb.Drag(problem).to", (("target", "(0, 0, 1)"),)),
    ("wb.read_task", (("path", "task_paths()['shelf']"),)),
    ("wb.QP().tracker", (("problem", "problem"), ("dt", "0.02"))),
    ("wb.QP().tracker(problem, 0.02).step", (("q", "figure.neutral"), ("measures", "True"))),
    ("wb.QP().solve", (("problem", "problem"),)),
    ("wb.CCD().solve", (("problem", "problem"),)),
    ("wb.Newton().solve", (("problem", "problem"),)),
    ("wb.Placo().solve", (("problem", "problem"),)),
    ("wb.DampedLeastSquares().solve", (("problem", "problem"),)),
    ("wb.Newton().tracker", (("problem", "problem"), ("dt", "0.02"))),
    ("wb.Newton().tracker(problem, 0.02).step", (("q", "figure.neutral"),)),
    ("problem.retarget", (("goals", "[wb.Point('link2', (0, 0, 1))]"),)),
    ("scene.add", (("shape", "wb.Sphere(0.1)"), ("name", "'new'"), ("at", "(5, 0, 0)"), ("color", "(1, 0, 0, 1)"))),
    ("scene.attach", (("shape", "wb.Sphere(0.1)"), ("to", "'link2'"), ("name", "'new'"), ("at", "(0, 0, 1)"),
                      ("rests_on", "['link1']"), ("color", "(1, 0, 0, 1)"))),
    ("scene.move", (("name", "'ball'"), ("at", "(5, 0, 0)"))),
    ("scene.remove", (("name", "'ball'"),)),
    ("scene.contacts", (("q", "figure.neutral"), ("within", "0.1"))),
    ("scene.penetration", (("q", "figure.neutral"),)),
    ("scene.sweep", (("q0", "figure.neutral"), ("q1", "figure.neutral"))),
    ("wb.simplify", (("problem", "problem"), ("lock", "True"))),
    ("scene.frame_id", (("name", "'link2'"),)),
    ("figure.posture", (("name", "'neutral'"),)),
    ("figure.frame_id", (("name", "'link2'"),)),
    ("figure.joint_id", (("name", "'joint1'"),)),
    ("figure.joint_names", (("names", "['joint1']"),)),
    ("figure.dofs", (("names", "['joint1']"),)),
    ("figure.joint_values", (("q", "figure.neutral"),)),
    ("figure.with_joints", (("q", "figure.neutral"), ("values", "{'joint1': 0.1}"))),
    ("figure.tangent_bounds", (("q", "figure.neutral"),)),
    ("figure.within_limits", (("q", "figure.neutral"), ("tolerance", "1e-9"))),
    ("figure.clamp", (("q", "figure.neutral"),)),
    ("figure.reduced", (("joints", "['joint1']"), ("posture", "None"))),
)  # fmt: skip
"""Public callables with arguments that are right."""

SCRIPT = '''"""{title}"""

from pathlib import Path

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.bench.attack import files
from wholebody.bench.attack.case import Verdict
from wholebody.figures.shipped import task_paths

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
ROBOT = """\
<?xml version="1.0"?>
<robot name="two joints">
  <link name="link0"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="link1">
    <collision><origin xyz="0 0 0.2"/><geometry><box size="0.06 0.06 0.26"/></geometry></collision>
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="link2">
    <collision><origin xyz="0 0 0.2"/><geometry><capsule radius="0.03" length="0.2"/></geometry></collision>
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="joint1" type="revolute"><parent link="link0"/><child link="link1"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="joint2" type="revolute"><parent link="link1"/><child link="link2"/><origin xyz="0 0 0.4"/>
    <axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
</robot>
"""
TERMS = {"wb.Point", "wb.Frame", "wb.Orientation", "wb.Axis", "wb.CenterOfMass", "wb.Relative", "wb.Posture"}
CONSTRAINTS = {"wb.Hold", "wb.Plane", "wb.Balance", "wb.Freeze", "wb.StepLimit", "wb.ReachCones"}
MEASURES = {"wb.Effort", "wb.Discomfort", "wb.Displacement", "wb.PotentialEnergy"}
SHAPES = {"wb.Box", "wb.Sphere", "wb.Capsule", "wb.Ellipsoid", "wb.HalfSpace", "wb.Hull", "wb.Mesh"}


def written(rng: np.random.Generator) -> Written:
    """Write a call with one odd argument, seldom two."""
    name, arguments = CALLS[int(rng.integers(len(CALLS)))]
    given = dict(arguments)
    for key in rng.permutation([key for key, _ in arguments])[: 1 if rng.random() < 0.85 else 2]:
        given[str(key)] = ODD[int(rng.integers(len(ODD)))]
    return called(name, given)


def called(name: str, given: Mapping[str, str]) -> Written:
    """Write a call of a public callable with arguments, both as Python."""
    call = f"{name}({', '.join(_argument(key, value) for key, value in given.items())})"
    script = SCRIPT.format(title=f"an odd argument of {name}", call=_used(name, call))
    return Written(script, {"robot.urdf": ROBOT.encode()})


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
    if name in ("wb.QP", "wb.CCD", "wb.Newton", "wb.Placo", "wb.DampedLeastSquares"):
        return f"wb.solve(problem, method={call})"
    if name == "wb.Problem":
        return f"wb.solve({call}, method=wb.QP(budget=5))"
    return call
