"""A figure that is dragged by hand: handles on it and on the things around it, holds, undo, by any method's tracker.

The page that shows it is elsewhere; this is what happens when a handle is taken, moved and let go.
"""

from __future__ import annotations

import copy
import time
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.arrays import Array
from wholebody.checks import known, numbers
from wholebody.errors import InputError
from wholebody.geometry.shapes import HalfSpace
from wholebody.methods.base import Method
from wholebody.methods.solve import method_for_motions
from wholebody.problem import Problem
from wholebody.tasks import Hold, Point
from wholebody.tracking.drag import Drag
from wholebody.tracking.frame import FRAME

HANDLES = ("left_palm", "right_palm", "left_sole", "right_sole", "pelvis", "head_top")
"""Frames of people with handles: hands, feet, pelvis, head."""

NEAR = 0.002  # m: pairs nearer than this are counted as contacts
FARTHEST_STEP = 0.5  # m: a thing does not jump farther than this in a frame
MOST_UNDONE = 100  # postures that are remembered


class LiveFrame(NamedTuple):
    """What a frame has to say.

    Attributes:
        q: (nq,) the posture.
        error: how far the handle that is held by the mouse is from it, metres; 0 without one.
        contacts: number of pairs that touch.
        overlap: deepest overlap, metres.
        seconds: that the frame took.
        status: one line: what is dragged, by which method, and what is wrong if something is.
    """

    q: Array
    error: float
    contacts: int
    overlap: float
    seconds: float
    status: str


class LiveDrag:
    """A problem whose figure and things are dragged.

    Constraints of the problem that are not holds stay. Goals of the problem are met again and again while a handle is
    dragged; the handle is one more goal.

    Attributes:
        scene: a copy of the problem's scene; its things are moved.
        q: (nq,) the present posture.
        handles: frame to the frame's index, of those that can be dragged.
        things: names of the things that can be dragged.
        held: frames that stay where they are.
        taken: the handle that the mouse holds; "" for none.
        method: what follows the handles.
    """

    def __init__(self, problem: Problem, method: str | Method = "qp") -> None:
        """Begin at the problem's start.

        Raises:
            InputError: the problem's scene changed.
            UnknownNameError: there is no such method.
        """
        problem.check_fresh()
        self.problem = problem
        self.scene = copy.copy(problem.scene)
        figure = self.scene.figure
        self.q: Array = np.array(problem.start)
        names = [name for name in HANDLES if name in {*figure.frames, *figure.segments}]
        names = names or list(dict.fromkeys([chain.tip for chain in figure.chains.values()] or figure.segments[-1:]))
        self.handles = {name: figure.frame_id(name) for name in names}
        self.things = tuple(
            name
            for name, thing in self.scene.objects.items()
            if thing.segment is None and not isinstance(thing.shape, HalfSpace)
        )
        self._fixed: tuple[Any, ...] = tuple(
            term for term in (*problem.stated, *problem.bounds) if not _releasable(term, self.handles)
        )
        self.held = {_handle_of(term, self.handles) for term in problem.constraints if _releasable(term, self.handles)}
        self.method: Method = method_for_motions(method)
        self._undo: list[tuple[Array, dict[str, pin.SE3]]] = []
        self.taken = ""
        self._drag: Drag[Any] | None = None
        self._trouble = ""
        self._state = self.scene.state(self.q)

    # ---- what the mouse and the buttons do

    def take(self, name: str) -> None:
        """Take the handle of a frame or a thing.

        Raises:
            UnknownNameError: there is no such handle.
        """
        known(name, {*self.handles, *self.things}, "handle")
        self._undo.append((self.q.copy(), {name: self.scene.objects[name].placement for name in self.things}))
        del self._undo[:-MOST_UNDONE]
        self.taken = name
        self._restart()

    def let_go(self) -> None:
        """Let the handle go; the figure stays."""
        self.taken, self._drag, self._trouble = "", None, ""

    def move(self, place: Array) -> LiveFrame:
        """Move the handle that was taken to a place (3,), and make one frame.

        A figure that cannot follow keeps its posture, and the status says why.

        Raises:
            InputError: no handle was taken, or the place is not three finite numbers.
        """
        if not self.taken:
            raise InputError("no handle was taken; take one first")
        place = numbers(place, (3,), "the place of a handle")
        began = time.perf_counter()
        error = 0.0
        if self._drag is not None:
            try:
                if self.taken in self.things:
                    self._push(place)
                    frame = self._drag.to(self.place(next(iter(self.handles))))
                else:
                    frame = self._drag.to(place)
                    error = float(np.linalg.norm(self.place_at(frame.q, self.taken) - place))
                self.q = np.array(frame.q)
            except InputError as trouble:
                self._trouble = str(trouble)
        return self._report(error, time.perf_counter() - began)

    def toggle(self, name: str) -> bool:
        """Hold a frame where it is, or release it; whether it is held now.

        Raises:
            UnknownNameError: there is no such handle.
        """
        known(name, self.handles, "handle")
        self.held ^= {name}
        if self.taken:
            self._restart()
        return name in self.held

    def choose(self, method: str | Method) -> None:
        """Follow by another method.

        Raises:
            UnknownNameError: there is no such method.
        """
        self.method = method_for_motions(method)
        if self.taken:
            self._restart()

    def undo(self) -> bool:
        """Go back to before the last handle was taken; False if there is nothing to go back to."""
        if not self._undo:
            return False
        self.let_go()
        self.q, places = self._undo.pop()
        for name, at in places.items():
            self.scene.move(name, at=at)
        return True

    # ---- what is seen

    def place(self, name: str) -> Array:
        """Where (3,) the handle of a frame or a thing is."""
        return self.place_at(self.q, name)

    def place_at(self, q: Array, name: str) -> Array:
        """The same at a posture (nq,)."""
        if name in self.things:
            return np.array(self.scene.objects[name].placement.translation)
        return np.array(self._state.update(q).frame(self.handles[name]).translation)

    def report(self) -> LiveFrame:
        """What there is to say without a frame."""
        return self._report(0.0, 0.0)

    def stated(self, goals: object = ()) -> Problem:
        """The problem with the present posture as its start, and the present holds."""
        holds = [Hold(name) for name in self.handles if name in self.held and name != self.taken]
        measures = self.problem.measures if self.problem.measures_given else None
        return Problem(
            self.scene,
            self.q,
            goals=goals,  # type: ignore[arg-type]
            constraints=[*self._fixed, *holds],
            measures=measures,
            clearance=self.problem.clearance,
            touching=self.problem.touching,
            range_of_motion=self.problem.range_of_motion,
            balance=self.problem.balance,
        )

    def _restart(self) -> None:
        """Begin to follow anew: holds, handle or method are others."""
        self._trouble = ""
        followed = self.taken if self.taken in self.handles else next(iter(self.handles))
        goals = [Point(followed, self.place(followed)), *self.problem.goals]
        try:
            self._drag = Drag(self.stated(goals), self.method)
        except InputError as trouble:
            self._drag, self._trouble = None, str(trouble)

    def _push(self, place: Array) -> None:
        at = self.scene.objects[self.taken].placement
        way = place - at.translation
        length = float(np.linalg.norm(way))
        if length > FARTHEST_STEP:
            way *= FARTHEST_STEP / length
        self.scene.move(self.taken, at=pin.SE3(at.rotation, at.translation + way), over=FRAME)

    def _report(self, error: float, seconds: float) -> LiveFrame:
        contacts = self.scene.contacts(self.q, within=NEAR)
        overlap = float(-contacts.distance.min(initial=0.0))
        doing = f"dragging {self.taken}" if self.taken else "take a handle and drag it; click one to hold it"
        status = f"{doing}, by {self.method.name}"
        if self._trouble:
            status = f"{status}: {self._trouble}"
        return LiveFrame(self.q, error, len(contacts.distance), overlap, seconds, status)


def _handle_of(term: object, handles: dict[str, int]) -> str:
    """The handle that a hold holds: its frame, or a frame on the same segment of a foot or hand."""
    if not isinstance(term, Hold) or term.relative_to is not None:
        return ""
    if term.frame in handles:
        return term.frame
    side, _, part = term.frame.partition("_")
    also = {"foot": "sole", "hand": "palm"}.get(part, "")
    return f"{side}_{also}" if f"{side}_{also}" in handles else ""


def _releasable(term: object, handles: dict[str, int]) -> bool:
    return bool(_handle_of(term, handles))
