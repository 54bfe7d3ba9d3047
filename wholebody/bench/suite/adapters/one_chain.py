"""Solvers of the chain that carries one frame as methods: what they take, and the chain as they read it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar
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


class Chain(ABC):
    """The chain of a frame in a solver.

    Attributes:
        joints: in the model, from the base on.
        places: (n,) of their values in a posture.
        end: placement of the frame in the last joint.
    """

    def __init__(self, model: pin.Model, frame: int) -> None:
        """Look the joints up."""
        self.joints = list(model.supports[model.frames[frame].parentJoint])[1:]
        self.places = np.array([model.joints[joint].idx_q for joint in self.joints])
        self.end = model.frames[frame].placement

    @contextmanager
    def written(self, model: pin.Model) -> Iterator[tuple[Path, str, str]]:
        """The chain as a URDF file, and its first and its last link."""
        root = ElementTree.Element("robot", name="chain")
        ElementTree.SubElement(root, "link", name="link 0")
        for number, joint in enumerate(self.joints, 1):
            ElementTree.SubElement(root, "link", name=f"link {number}")
            add_model_joint(root, model, joint, f"link {number - 1}", f"link {number}")
        with Scratch() as folder:
            path = folder / "chain.urdf"
            path.write_bytes(ElementTree.tostring(root))
            yield path, "link 0", f"link {len(self.joints)}"

    @abstractmethod
    def values(self, start: Array, target: pin.SE3, tolerance: float) -> Any:
        """Values (n,) of the joints that bring the last one to where the frame is at its target; None for none."""


class OneChain(OneCall[Chain], ABC):
    """A solver of one frame's placement as a method. It has no count of iterations."""

    loose = tuple((tolerance, None) for tolerance in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8))
    kinds = (wb.Displacement, wb.Effort, wb.Frame)
    chain: ClassVar[type[Chain]]

    def depends_on(self, problem: Problem) -> tuple[Any, ...]:
        """The model, and the frame at the end of the chain."""
        return problem.scene.model, _goal(problem).residual.place.frame

    def build(self, problem: Problem) -> Chain:
        """Make the chain."""
        return self.chain(problem.scene.model, _goal(problem).residual.place.frame)

    def found(self, built: Chain, problem: Problem) -> tuple[Array | None, bool]:
        """The solver's posture."""
        start = problem.scene.figure.clamp(problem.start)
        with TOOL:
            answer = built.values(
                start[built.places], _goal(problem).resolved_target * built.end.inverse(), self.tolerance
            )
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
