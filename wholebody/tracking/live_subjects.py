"""What is dragged by hand: a problem's figure, or the bodies of an assembly; where handles are, what follows them."""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping, Set
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import known
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.joining import joint_in
from wholebody.geometry.shapes import HalfSpace
from wholebody.methods.base import Method
from wholebody.methods.newton.assembly import Assembly
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.tasks import Hold, Orientation, Point
from wholebody.tracking.drag import Drag
from wholebody.tracking.frame import FRAME

BUDGET = 0.4 * FRAME  # s of the processor for a frame's search; a last iteration, sweeps and drawing take as much

HANDLES = ("left_palm", "right_palm", "left_sole", "right_sole", "pelvis", "head_top")
"""Frames of people with handles: hands, feet, pelvis, head."""


class Handle(NamedTuple):
    """Where a handle is: the joint of the scene's model that carries it, and its placement there."""

    joint: int
    local: pin.SE3


def things_of(scene: Scene) -> tuple[str, ...]:
    """Names of the things that can be dragged: those that stand around and have an end."""
    return tuple(
        name
        for name, thing in scene.objects.items()
        if thing.segment is None and not isinstance(thing.shape, HalfSpace)
    )


def handle_frames(frames: Collection[str]) -> list[str]:
    """Those of `HANDLES` that a figure has, and each of several figures."""
    bodies = dict.fromkeys(name.rpartition("/")[0] for name in frames)
    named = (f"{body}/{name}".lstrip("/") for body in bodies for name in HANDLES)
    return [name for name in named if name in frames]


def handles_of(figure: Figure) -> list[str]:
    """`handle_frames`, the fingertips of people, and the ends of the chains of other figures, such as robots."""
    names = handle_frames({*figure.frames, *figure.segments})
    people = {name.rpartition("/")[0] for name in names if name.endswith("pelvis")}
    ends = [chain.tip for chain in figure.chains.values()] or figure.segments[-1:]
    fingers = [name for name in ends if name.endswith("_tip") and not name.endswith("_toe_tip")]
    others = [name for name in ends if name.rpartition("/")[0] not in people]
    return list(dict.fromkeys([*names, *fingers, *others]))


class LiveProblem:
    """The figure of a problem. Its holds can be released; its goals and other constraints stay.

    Raises InputError where the problem's scene changed. `LiveAssembly` has the same attributes and methods.

    Attributes:
        scene: a copy of its own; its things are moved.
        q: (nq,) the posture of the scene at the beginning.
        handles: name to place, of what can be dragged.
        held: names of handles that are held at the beginning.
    """

    def __init__(self, problem: Problem) -> None:
        problem.check_fresh()
        self.problem, self.scene = problem, copy.copy(problem.scene)
        self.q: Array = np.array(problem.start)
        figure = self.scene.figure
        frames = {name: figure.model.frames[figure.frame_id(name)] for name in handles_of(figure)}
        self.handles = {name: Handle(int(frame.parentJoint), frame.placement) for name, frame in frames.items()}
        stated = (*problem.stated, *problem.bounds)
        self._fixed: tuple[Any, ...] = tuple(term for term in stated if not _handle_of(term, self.handles))
        self.held: Set[str] = {_handle_of(term, self.handles) for term in problem.constraints} - {""}
        self._drag: Drag[Any] | None = None

    def stated(self, q: Array, goals: object, held: Collection[str]) -> Problem:
        """The problem with the start q (nq,), goals, and holds."""
        holds = [Hold(name) for name in self.handles if name in held]
        problem = self.problem
        return Problem(
            self.scene,
            q,
            goals=goals,  # type: ignore[arg-type]
            constraints=[*self._fixed, *holds],
            measures=problem.measures if problem.measures_given else None,
            clearance=problem.clearance,
            touching=problem.touching,
            range_of_motion=problem.range_of_motion,
            balance=problem.balance,
        )

    @property
    def constraints(self) -> Mapping[str, bool]:
        """Constraints that can be released, and whether they hold: none, as holds are those of handles."""
        return {}

    def constrain(self, name: str, holds: bool) -> None:
        """Let a constraint hold or not; raises UnknownNameError, as there is none."""
        known(name, self.constraints, "constraint")

    def drag(self, q: Array, followed: str, target: Array, held: Collection[str], method: Method) -> Drag[Any]:
        """What follows a handle from q (nq,) to a place (3,) or quaternion (4,), others held where they are."""
        goal = Point(followed, target) if len(target) == 3 else Orientation(followed, target)
        self._drag = Drag(self.stated(q, [goal, *self.problem.goals], held), method, budget=BUDGET)
        return self._drag

    def move(self, name: str, at: pin.SE3, over: float | None = None) -> None:
        """Move a thing."""
        self.scene.move(name, at=at, over=over)

    def arrived(self) -> None:
        """Note that what follows has made a frame: nothing."""

    def remembered(self, q: Array) -> Any:
        """What `restore` goes back to: the placements of the things, and the posture q (nq,)."""
        return {name: self.scene.objects[name].placement for name in things_of(self.scene)}, q.copy()

    def restore(self, remembered: Any) -> Array:
        """Put the things back; returns the posture (nq,), from which what follows goes on."""
        things, q = remembered
        for name, at in things.items():
            self.scene.move(name, at=at)
        if self._drag is not None:
            self._drag.q = q
        return np.array(q)


class LiveAssembly:
    """The bodies of an assembly, and the hands, feet and so on of its figures. A body that is held is fixed."""

    def __init__(self, assembly: Assembly) -> None:
        self._still = copy.copy(assembly)  # without holds
        self._dragged: Assembly | None = None
        self.q, self.held = self._still.q, frozenset[str]()
        model, self.handles = self.scene.model, dict[str, Handle]()
        figures = self._still.figures
        for name in self._still.bodies:
            if name.partition("/")[0] not in figures:
                self.handles[name] = Handle(int(model.getJointId(name)), pin.SE3.Identity())
        for name, figure in figures.items():
            for frame in handles_of(figure):
                own = figure.model.frames[figure.frame_id(frame)]
                joint = joint_in(model, f"{name}/", str(figure.model.names[own.parentJoint]))
                self.handles[f"{name}/{frame}"] = Handle(joint, own.placement)

    @property
    def scene(self) -> Scene:
        """The scene of the bodies; another one after a constraint was released or holds again."""
        return self._still.scene

    @property
    def constraints(self) -> Mapping[str, bool]:
        """Joints and constraints, and whether they hold."""
        return self._still.constraints

    def constrain(self, name: str, holds: bool) -> None:
        """Let a joint or constraint hold or not; raises UnknownNameError where there is none."""
        (self._still.hold if holds else self._still.release)(name)

    def drag(self, q: Array, followed: str, target: Array, held: Collection[str], method: Method) -> Drag[Any]:
        """As of a problem; the method is Newton's, whatever is asked."""
        made = self._dragged = copy.copy(self._still)
        for name in held:
            made.fixed("world", name)
        (made.point_goal if len(target) == 3 else made.orientation_goal)(followed, target)
        return Drag(made, goal=len(made.goals) - 1, budget=BUDGET)

    def move(self, name: str, at: pin.SE3, over: float | None = None) -> None:
        """Move a thing."""
        self._still.move(name, at=at)
        if self._dragged is not None:
            self._dragged.move(name, at=at, over=over)

    def arrived(self) -> None:
        """The bodies are where those are that are dragged."""
        if self._dragged is not None:
            self._still.place(self._dragged.variables())

    def remembered(self, q: Array) -> Any:
        """The placements of the things and of the bodies, and what holds."""
        things = {name: self.scene.objects[name].placement for name in things_of(self.scene)}
        return things, self._still.variables(), self.constraints

    def restore(self, remembered: Any) -> Array:
        """Put things, bodies and constraints back."""
        things, variables, constraints = remembered
        for name, holds in constraints.items():
            if holds != self.constraints[name]:
                self.constrain(name, holds)
        for made in (self._still, self._dragged):
            if made is not None:
                made.place(variables)
                for name, at in things.items():
                    made.move(name, at=at)
        return self._still.q

    def stated(self, q: Array, goals: object, held: Collection[str]) -> Problem:
        """Raise InputError."""
        raise InputError("an assembly is not a problem and has no task file; keep assembly.variables() instead")


LiveSubject = LiveProblem | LiveAssembly


def live_subject(given: Problem | Assembly) -> LiveSubject:
    """What a problem or an assembly is when it is dragged; raises InputError for anything else."""
    if isinstance(given, Assembly):
        return LiveAssembly(given)
    if isinstance(given, Problem):
        return LiveProblem(given)
    raise InputError(f"LiveDrag: {type(given).__name__} is not what can be dragged; give a wb.Problem or a wb.Assembly")


def _handle_of(term: object, handles: Collection[str]) -> str:
    """The handle that a hold holds: its frame, or a frame on the same segment of a foot or hand; "" if none."""
    if not isinstance(term, Hold) or term.relative_to is not None:
        return ""
    if term.frame in handles:
        return term.frame
    side, _, part = term.frame.partition("_")
    also = {"foot": "sole", "hand": "palm"}.get(part, "")
    return f"{side}_{also}" if f"{side}_{also}" in handles else ""
