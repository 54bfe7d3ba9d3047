"""optik: random restarts of a bounded quasi-Newton method (SLSQP) on the error of one frame at the end of a chain."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.files import Scratch
from wholebody.bench.suite.adapters.base import OneCall
from wholebody.bench.suite.adapters.urdf import add_model_joint
from wholebody.methods.differential import TOOL
from wholebody.problem import Problem


class Optik(OneCall["_Chain"]):
    """optik as a method. It has no count of iterations."""

    name = "optik"
    loose = tuple((tolerance, None) for tolerance in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8))
    kinds = (wb.Displacement, wb.Effort, wb.Frame)
    way = "by its restarts"
    failure = "optik found no posture in its time"

    def depends_on(self, problem: Problem) -> tuple[Any, ...]:
        """The model, and the frame at the end of the chain."""
        return problem.scene.model, _goal(problem).residual.place.frame

    def build(self, problem: Problem) -> _Chain:
        """Write and read the chain."""
        return _Chain(problem.scene.model, _goal(problem).residual.place.frame)

    def found(self, built: _Chain, problem: Problem) -> tuple[Array | None, bool]:
        """The first posture of its restarts."""
        start = problem.scene.figure.clamp(problem.start)
        q = built.solved(start, _goal(problem).resolved_target, self.tolerance)
        return q, q is not None

    def unsupported(self, problem: Problem) -> list[str]:
        """Names of what optik cannot express."""
        refused = super().unsupported(problem)
        if refused:
            return refused
        if len(problem.goals) != 1:
            return ["several goals"]
        model = problem.scene.model
        chain = list(model.supports[_goal(problem).residual.place.joint])[1:]
        kinds = [model.joints[joint].shortname() for joint in chain]
        if not chain or not all(kind.startswith(("JointModelR", "JointModelP")) for kind in kinds):
            return ["a free root" if problem.scene.figure.root == "free" else "a joint of several axes"]
        if any(model.joints[joint].nq != 1 for joint in chain):
            return ["a joint without limits"]
        return []


def _goal(problem: Problem) -> Any:
    (goal,) = problem.goals
    return goal


class _Chain:
    """The chain of a frame in optik, written as URDF."""

    def __init__(self, model: pin.Model, frame: int) -> None:
        import optik

        joints = list(model.supports[model.frames[frame].parentJoint])[1:]
        self._places = np.array([model.joints[joint].idx_q for joint in joints])
        root = ElementTree.Element("robot", name="chain")
        ElementTree.SubElement(root, "link", name="link 0")
        for number, joint in enumerate(joints, 1):
            ElementTree.SubElement(root, "link", name=f"link {number}")
            add_model_joint(root, model, joint, f"link {number - 1}", f"link {number}")
        with Scratch() as folder:
            path = folder / "chain.urdf"
            path.write_bytes(ElementTree.tostring(root))
            self._robot = optik.Robot.from_urdf_file(str(path), "link 0", f"link {len(joints)}")
        self._robot.set_parallelism(1)
        self._tip = model.frames[frame].placement.homogeneous

    def solved(self, q: Array, target: pin.SE3, tolerance: float) -> Array | None:
        """A posture (nq,) whose frame is at a target; None if none is found."""
        import optik

        # optik bounds the squared error; its restarts end after 1 s.
        settings = optik.SolverConfig(solution_mode="speed", max_time=1.0, tol_f=(0.5 * tolerance) ** 2)
        with TOOL:
            answer: Any = self._robot.ik(settings, target.homogeneous, q[self._places], self._tip)
        if answer is None:
            return None
        found: Array = q.copy()
        found[self._places] = answer[0]
        return found
