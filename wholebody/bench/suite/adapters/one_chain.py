"""optik, TRAC-IK and EAIK, solvers of the chain that carries one frame, as methods."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.files import Scratch
from wholebody.bench.suite.adapters.base import OneCall
from wholebody.bench.suite.adapters.urdf import axis_of
from wholebody.figures.urdf.joints import add_model_joint
from wholebody.methods.differential import TOOL
from wholebody.problem import Problem


class Chain:
    """The chain of a frame."""

    solver: Any = None  # what a tool made of it; None before

    def __init__(self, model: pin.Model, frame: int) -> None:
        self.model = model  # Pinocchio's
        self.joints = list(model.supports[model.frames[frame].parentJoint])[1:]  # in the model, from the base on
        # places: (n,) of their values in a posture
        self.places = np.array([model.joints[joint].idx_q for joint in self.joints])
        self.end = model.frames[frame].placement  # placement of the frame in the last joint

    @contextmanager
    def written(self) -> Iterator[tuple[Path, str, str]]:
        """The chain as a URDF file, and its first and its last link."""
        root = ElementTree.Element("robot", name="chain")
        ElementTree.SubElement(root, "link", name="link 0")
        for number, joint in enumerate(self.joints, 1):
            ElementTree.SubElement(root, "link", name=f"link {number}")
            axis_of(self.model, joint, "URDF is written for turning and sliding joints")
            add_model_joint(root, self.model, joint, f"joint {joint}", f"link {number - 1}", f"link {number}")
        with Scratch() as folder:
            path = folder / "chain.urdf"
            path.write_bytes(ElementTree.tostring(root))
            yield path, "link 0", f"link {len(self.joints)}"


class OneChain(OneCall[Chain], ABC):
    """A solver of one frame's placement as a method. It has no count of iterations."""

    loose = tuple((tolerance, None) for tolerance in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8))
    kinds = (wb.tasks.Displacement, wb.Effort, wb.Frame)
    blind = True

    @abstractmethod
    def values(self, chain: Chain, start: Array, target: pin.SE3) -> Any:
        """Values (n,) of the joints that bring the last one to where the frame is at its target; None for none."""

    def depends_on(self, problem: Problem) -> tuple[Any, ...]:
        """The model, and the frame at the end of the chain."""
        return problem.scene.model, _goal(problem).residual.place.frame

    def build(self, problem: Problem) -> Chain:
        """Make the chain."""
        return Chain(problem.scene.model, _goal(problem).residual.place.frame)

    def found(self, built: Chain, problem: Problem) -> tuple[Array | None, bool]:
        """The solver's posture."""
        start = problem.scene.figure.clamp(problem.start)
        with TOOL:
            answer = self.values(built, start[built.places], _goal(problem).resolved_target * built.end.inverse())
        if answer is None:
            return None, False
        q: Array = start.copy()
        q[built.places] = answer
        return q, True

    def unsupported(self, problem: Problem) -> list[str]:
        """Names of what it cannot express."""
        refused = super().unsupported(problem)
        if refused:
            return refused
        if len(problem.goals) != 1:
            return ["several goals"]
        joints = _joints(problem)
        if not joints or not all(joint.shortname().startswith(("JointModelR", "JointModelP")) for joint in joints):
            return ["a free root" if problem.scene.figure.root == "free" else "a joint of several axes"]
        return ["a joint without limits"] if any(joint.nq != 1 for joint in joints) else []


def _goal(problem: Problem) -> Any:
    (goal,) = problem.goals
    return goal


def _joints(problem: Problem) -> list[Any]:
    """The joints of the chain that carries the goal's frame."""
    model = problem.scene.model
    return [model.joints[joint] for joint in list(model.supports[_goal(problem).residual.place.joint])[1:]]


class Optik(OneChain):
    """optik: random restarts of a bounded quasi-Newton method (SLSQP) on the error of the frame."""

    name = "optik"
    way = "by its restarts"
    failure = "optik found no posture in its time"

    def build(self, problem: Problem) -> Chain:
        """Make the chain and the robot."""
        import optik

        chain = super().build(problem)
        with chain.written() as (path, first, last):
            chain.solver = optik.Robot.from_urdf_file(str(path), first, last)
        chain.solver.set_parallelism(1)
        return chain

    def values(self, chain: Chain, start: Array, target: pin.SE3) -> Any:
        """As `OneChain` says."""
        import optik

        # optik bounds the squared error, here of the frame itself; its restarts end after 1 s.
        settings = optik.SolverConfig(solution_mode="speed", max_time=1.0, tol_f=(0.5 * self.tolerance) ** 2)
        answer: Any = chain.solver.ik(settings, (target * chain.end).homogeneous, start, chain.end.homogeneous)
        return None if answer is None else answer[0]


class Tracik(OneChain):
    """TRAC-IK: Newton's method with restarts and a quadratic program on the frame's error, beside each other."""

    name = "tracik"
    way = "by its restarts"
    failure = "TRAC-IK found no posture in its time"

    def values(self, chain: Chain, start: Array, target: pin.SE3) -> Any:
        """As `OneChain` says."""
        if chain.solver is None:
            from trac_ik import TracIK

            with chain.written() as (path, first, last):
                chain.solver = TracIK(first, last, str(path), timeout=0.05, epsilon=0.3 * self.tolerance)
        return chain.solver.ik(target.translation, target.rotation, start)


class Eaik(OneChain):
    """EAIK: all branches of arms of six turning joints in closed form, of which the nearest within limits is taken."""

    name = "eaik"
    way = "in closed form"
    failure = "EAIK found no branch within limits"

    def build(self, problem: Problem) -> Chain:
        """Make the chain, and its axes where it is at zero."""
        from eaik.IK_HP import HPRobot

        chain = super().build(problem)
        model, data = chain.model, chain.model.createData()
        pin.computeJointJacobians(model, data, pin.neutral(model))
        places = [data.oMi[joint] for joint in chain.joints]
        axes = np.array([data.J[3:, model.joints[joint].idx_v] for joint in chain.joints])
        points = np.array([np.zeros(3), *(place.translation for place in places), places[-1].translation])
        chain.solver = HPRobot(axes, np.diff(points, axis=0)), places[-1].rotation
        return chain

    def values(self, chain: Chain, start: Array, target: pin.SE3) -> Any:
        """As `OneChain` says."""
        robot, turned = chain.solver
        found, turn = robot.IK(pin.SE3(target.rotation @ turned.T, target.translation).homogeneous), 2.0 * np.pi
        lower, upper = (
            limit[chain.places] for limit in (chain.model.lowerPositionLimit, chain.model.upperPositionLimit)
        )
        exact = np.atleast_2d(found.Q)[~np.asarray(found.is_LS, dtype=bool)]
        near = exact + turn * np.round((start - exact) / turn)
        near -= turn * np.ceil((near - upper) / turn).clip(0.0)
        near += turn * np.ceil((lower - near) / turn).clip(0.0)
        near = near[(near <= upper).all(axis=1)]
        return near[((near - start) ** 2).sum(axis=1).argmin()] if len(near) else None

    def unsupported(self, problem: Problem) -> list[str]:
        """Names of what EAIK cannot express."""
        refused = super().unsupported(problem)
        turning = [] if refused else [joint.shortname().startswith("JointModelR") for joint in _joints(problem)]
        return refused if refused or turning == [True] * 6 else ["an arm of other than six turning joints"]
