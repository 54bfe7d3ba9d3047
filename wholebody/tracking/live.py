"""A figure dragged by hand, without its page: handles on it and on things, holds, undo, by any method's tracker."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import flag, known, numbers, shown
from wholebody.base.errors import InputError, WholebodyError
from wholebody.geometry.continuous.passing_through import GRAZE
from wholebody.geometry.proximity import Contacts
from wholebody.methods import installed_methods
from wholebody.methods.base import Method
from wholebody.methods.newton.assembly import Assembly
from wholebody.methods.solve import method_for_motions, warn_of_left_out
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import NotCopyable
from wholebody.tracking.drag import Drag, DragFrame
from wholebody.tracking.frame import FRAME
from wholebody.tracking.live_subjects import LiveSubject, live_subject, things_of

FARTHEST_STEP = 0.05  # m: a thing does not move farther than this in a frame, 3 m/s


class LiveFrame(NamedTuple):
    """What a frame has to say."""

    q: Array  # (nq,) the posture
    error: float  # how far the handle that was taken is from where it is drawn, metres or radians; 0 without one
    contacts: int  # number of pairs that touch
    overlap: float  # deepest overlap, metres
    seconds: float  # that the frame took
    status: str  # one line: what is dragged, by which method, and what is wrong if something is
    path: tuple[tuple[float, Array], ...] = ()  # as in `DragFrame`: the path within the frame, where a thing was moved


class LiveDrag(NotCopyable):
    """A problem whose figure and things are dragged, or an assembly whose bodies and things are.

    Constraints of the problem that are not holds stay. Goals of the problem are met again and again while a handle is
    dragged; the handle is one more goal. Bodies of an assembly are dragged by their origins, by Newton steps alone; the
    given assembly stays as it is.

    Attributes:
        problem: what was given.
        q: (nq,) the present posture.
        handles: names of the frames, or bodies, that can be dragged.
        things: names of the things that can be dragged.
        held: frames that stay where they are.
        taken: the handle that the mouse holds; "" for none.
        methods: what can be chosen: names of methods, and the configured one that was given.
        method: what follows the handles.
        chosen: its name among them.

    Examples:
        >>> from wholebody.tracking.live import LiveDrag
        >>> drag = LiveDrag(problem)
        >>> drag.take("right_palm")
        >>> frame = drag.move(drag.place("right_palm") + (0.0, 0.0, 0.02))  # metres
        >>> frame.error < 1e-3
        True
    """

    def __repr__(self) -> str:
        return f"LiveDrag({len(self.handles)} handles, {len(self.things)} things, by {self.chosen!r})"

    def __init__(self, problem: Problem | Assembly, method: str | Method = "qp") -> None:
        """Begin at the problem's start, or where the assembly's bodies are.

        Raises:
            InputError: the scene changed, the assembly has no bodies or another method than Newton's, or it is neither.
            UnknownNameError: there is no such method.
        """
        self._subject: LiveSubject = live_subject(problem)
        self.problem = problem
        self.q = self._subject.q
        self.handles = tuple(self._subject.handles)
        self.things = things_of(self.scene)
        self.held = set(self._subject.held)
        self.methods: dict[str, str | Method] = {name: name for name in installed_methods()}
        if isinstance(problem, Assembly):
            self.methods = {"newton": "newton"}
            method = "newton" if method == "qp" else method
        self._undo: list[Any] = []
        self._deepest = self._open = 0.0
        self.let_go()
        self._state = self.scene.state(self.q)
        self.choose(method)

    # ---- what the mouse and the buttons do

    def take(self, name: str, *, turn: bool = False) -> None:
        """Take the handle of a frame or a thing, to move it or, a frame's, to `turn` it.

        Raises UnknownNameError where there is none, InputError if `turn` is neither True nor False.
        """
        known(name, self.handles if flag(turn, "turn") else {*self.handles, *self.things}, "handle")
        self._remember()
        self.taken, self._turns = name, turn
        self._restart()

    def let_go(self) -> None:
        """Let the handle go; the figure stays."""
        self.taken, self._turns, self._trouble, self._stopped = "", False, "", ""
        self._drag: Drag[Any] | None = None

    def move(self, place: Array) -> LiveFrame:
        """Move the handle that was taken to a place (3,), or an orientation (4,) if it is turned, and make one frame.

        An orientation is a quaternion (x, y, z, w). A frame has a budget of the processor's time, see `Drag`; moved to
        the same target again, figure and thing go on. A figure that cannot follow keeps its posture, and the status
        says why. A thing moves by 50 mm at most. Where the figure does not get out of its way, which the status says,
        it stays and tries half as far in the next frame. Raises InputError where no handle was taken.
        """
        if not self.taken:
            raise InputError("no handle was taken; take one first")
        place = numbers(place, (4,) if self._turns else (3,), "the target of a handle")
        began, path = time.perf_counter(), tuple[tuple[float, Array], ...]()
        if self._drag is not None:
            try:
                frame = self._pushed(self._drag, place) if self.taken in self.things else self._drag.to(place)
                if frame is not None:
                    self.q, path, self._open = np.array(frame.q), frame.path, frame.open
                    self._subject.arrived()
                self._trouble = ""
            except WholebodyError as trouble:
                self._trouble = str(trouble)
        return with_values(self._report(self._away(self.q, place), time.perf_counter() - began), path=path)

    @property
    def constraints(self) -> Mapping[str, bool]:
        """Joints and constraints of an assembly, and whether they hold; of a problem none."""
        return self._subject.constraints

    def constrain(self, name: str, holds: bool) -> None:
        """Let one of `constraints` hold, or release it; the next frames close it. `undo` takes it back.

        Where no handle was taken, the first one is, so that there are frames.

        Raises UnknownNameError where there is none, InputError if `holds` is neither True nor False.
        """
        known(name, self.constraints, "constraint")
        flag(holds, "holds")
        self._remember()
        self._open = 0.0
        self._subject.constrain(name, holds)
        self.taken = self.taken or self.handles[0]
        self._restart()

    def toggle(self, name: str) -> bool:
        """Hold a frame where it is, or release it; whether it is held now. Raises UnknownNameError for other names."""
        known(name, self.handles, "handle")
        self.held ^= {name}
        if self.taken:
            self._restart()
        return name in self.held

    def choose(self, method: str | Method) -> None:
        """Follow by another method; its name is one of `methods` then.

        Raises UnknownNameError where there is none, InputError for an assembly and another method than Newton's.
        """
        if isinstance(self.problem, Assembly) and method != "newton":
            raise InputError(f"an assembly is dragged by Newton steps, not by {shown(method)}; leave method out")
        self.method: Method = method_for_motions(method)
        if isinstance(self.problem, Problem):
            warn_of_left_out(self.method, 2, self.problem)
        self.chosen = str(getattr(method, "name", method))
        self.methods.setdefault(self.chosen, method)
        self._rehearse()
        if self.taken:
            self._restart()

    def undo(self) -> bool:
        """Go back to before the last handle was taken; False if there is nothing to go back to."""
        if not self._undo:
            return False
        self.let_go()
        self._open = 0.0
        self.q = self._subject.restore(self._undo.pop())
        return True

    # ---- what is seen

    @property
    def scene(self) -> Scene:
        """A copy of the scene; its things are moved."""
        return self._subject.scene

    def orientation(self, name: str) -> Array:
        """How (4,) the handle of a frame is turned, a quaternion (x, y, z, w); UnknownNameError where there is none."""
        known(name, self.handles, "handle")
        return np.array(pin.SE3ToXYZQUAT(self._placement(self.q, name))[3:])

    def place(self, name: str) -> Array:
        """Where (3,) [m] the handle of a frame or a thing is; UnknownNameError where there is none."""
        return self.place_at(self.q, name)

    def place_at(self, q: Array, name: str) -> Array:
        """The same at a posture (nq,); InputError where it is none of the figure."""
        known(name, {*self.handles, *self.things}, "handle")
        if name in self.things:
            return np.array(self.scene.objects[name].placement.translation)
        return np.array(self._placement(q, name).translation)

    def report(self) -> LiveFrame:
        """What there is to say without a frame."""
        return self._report(0.0, 0.0)

    def stated(self, goals: object = ()) -> Problem:
        """The problem with the present posture as its start, and the holds; raises InputError for an assembly."""
        return self._subject.stated(self.q, goals, self.held - {self.taken})

    def _placement(self, q: Array, name: str) -> pin.SE3:
        handle = self._subject.handles[name]
        return self._state.update(q).data.oMi[handle.joint] * handle.local

    def _away(self, q: Array, target: Array) -> float:
        """How far the handle that was taken is at a posture (nq,) from its target, metres or radians."""
        if self._turns:
            wanted = pin.Quaternion(target).normalized().toRotationMatrix()
            return float(np.linalg.norm(pin.log3(wanted @ self._placement(q, self.taken).rotation.T)))
        return float(np.linalg.norm(self.place_at(q, self.taken) - target))

    def _remember(self) -> None:
        self._undo.append(self._subject.remembered(self.q))
        del self._undo[:-100]  # postures that are remembered

    def _restart(self) -> None:
        """Begin to follow anew: holds, handle or method are others."""
        self._trouble, self._stopped, self._reach = "", "", FARTHEST_STEP
        followed = self.taken if self.taken in self.handles else next(iter(self.handles))
        held = self.held - {self.taken}
        target = self.orientation(followed) if self._turns else self.place(followed)
        try:
            self._drag = self._subject.drag(self.q, followed, target, held, self.method)
            workspace = self._drag.workspace
            if workspace is not None:  # what later frames need is made now
                workspace.sweep.first_contact(self.q, self.q, None, FARTHEST_STEP)
                if self.taken in self.things:
                    workspace.frame({self.taken: (workspace.where(self.taken),) * 2})
        except WholebodyError as trouble:
            self._drag, self._trouble = None, str(trouble)

    def _rehearse(self) -> None:
        """Make frames and discard them, so that everything that a first frame loads or sets up is ready."""
        q, remembered = self.q, self._subject.remembered(self.q)
        name = next(iter(self.handles))
        place = self.place(name)
        try:
            drag = self._subject.drag(q, name, place, self.held - {name}, self.method)
            drag.to(place)
            for thing in self.things[:1]:
                at = self.scene.objects[thing].placement
                self._subject.move(thing, pin.SE3(at.rotation, at.translation + 1e-6), FRAME)
                drag.to(place)
            self.report()
        except WholebodyError:
            pass  # it is told when a handle is taken
        finally:
            self._subject.restore(remembered)

    def _pushed(self, drag: Drag[Any], place: Array) -> DragFrame | None:
        """A frame in which the thing that was taken comes nearer to a place (3,); None where it has to stay."""
        before, deep = self._subject.remembered(self.q), self._deepest
        at = self.scene.objects[self.taken].placement
        way = place - at.translation
        way *= min(1.0, self._reach / max(float(np.linalg.norm(way)), 1e-12))
        self._subject.move(self.taken, pin.SE3(at.rotation, at.translation + way), FRAME)
        frame = drag.to(self.place(next(iter(self.handles))))
        met = [str(one) for one in frame.collisions if one.depth > max(deep, GRAZE)]
        left = self._contacts(np.array(frame.q))
        if -left.distance.min(initial=0.0) > max(deep, GRAZE):  # bodies that are held are not tested in a drag
            first, second = (self.scene.piece_owner[piece] for piece in left.pair[0])
            met.append(f"{first} and {second} would overlap")
        if not met:
            self._stopped, self._reach = "", min(1.25 * self._reach, FARTHEST_STEP)
            return frame
        self._subject.restore(before)
        self._stopped = f"{self.taken} stays: {met[0]}"
        self._reach = max(0.5 * self._reach, 0.002)  # m: a thing tries to move at least so far
        return None

    def _contacts(self, q: Array) -> Contacts:
        return self.scene.contacts(q, within=0.002)  # m: pairs nearer than this are counted as contacts

    def _report(self, error: float, seconds: float) -> LiveFrame:
        contacts = self._contacts(self.q)
        overlap = self._deepest = max(0.0, -float(contacts.distance.min(initial=0.0)))
        verb = "turning" if self._turns else "dragging"
        status = "drag a handle; click one to hold or release it"
        if self.taken:
            status = f"{verb} {self.taken} by {self.method.name}"
        apart = f"joints do not close, by {self._open:.3g} m or rad" if self._open > 1e-3 else ""
        if said := self._trouble or self._stopped or apart:
            status = f"{status}: {said}"
        return LiveFrame(self.q, error, len(contacts.distance), overlap, seconds, status)
