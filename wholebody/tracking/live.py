"""A figure that is dragged by hand: handles on it and on the things around it, holds, undo, by any method's tracker.

The page that shows it is elsewhere; this is what happens when a handle is taken, moved and let go.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array, with_values
from wholebody.base.checks import known, numbers, shown
from wholebody.base.errors import InputError, WholebodyError
from wholebody.geometry.continuous.passing_through import GRAZE
from wholebody.geometry.proximity import Contacts
from wholebody.methods import installed_methods
from wholebody.methods.base import Method
from wholebody.methods.newton.assembly import Assembly
from wholebody.methods.solve import method_for_motions
from wholebody.problem import Problem
from wholebody.tracking.drag import Drag, DragFrame
from wholebody.tracking.frame import FRAME
from wholebody.tracking.live_subjects import LiveFrame, LiveSubject, live_subject, things_of

FARTHEST_STEP = 0.05  # m: a thing does not move farther than this in a frame, 3 m/s


class LiveDrag:
    """A problem whose figure and things are dragged, or an assembly whose bodies and things are.

    Constraints of the problem that are not holds stay. Goals of the problem are met again and again while a handle is
    dragged; the handle is one more goal. Bodies of an assembly are dragged by their origins, by Newton steps alone; the
    given assembly stays as it is.

    Attributes:
        problem: what was given.
        scene: a copy of its scene; its things are moved.
        q: (nq,) the present posture.
        handles: names of the frames, or bodies, that can be dragged.
        things: names of the things that can be dragged.
        held: frames that stay where they are.
        taken: the handle that the mouse holds; "" for none.
        methods: what can be chosen: names of methods, and the configured one that was given.
        method: what follows the handles.
        chosen: its name among them.
        goes_on: False: nothing moves without the mouse.
    """

    goes_on = False

    def __init__(self, problem: Problem | Assembly, method: str | Method = "qp") -> None:
        """Begin at the problem's start, or where the assembly's bodies are.

        Raises:
            InputError: the scene changed, the assembly has no bodies or another method than Newton's, or it is neither.
            UnknownNameError: there is no such method.
        """
        self._subject: LiveSubject = live_subject(problem)
        self.problem = problem
        self.scene, self.q = self._subject.scene, self._subject.q
        self.handles = tuple(self._subject.handles)
        self.things = things_of(self.scene)
        self.held = set(self._subject.held)
        self.methods: dict[str, str | Method] = {name: name for name in installed_methods()}
        if isinstance(problem, Assembly):
            self.methods = {"newton": "newton"}
            method = "newton" if method == "qp" else method
        self._undo: list[Any] = []
        self._deepest = 0.0
        self.let_go()
        self._state = self.scene.state(self.q)
        self.choose(method)

    # ---- what the mouse and the buttons do

    def take(self, name: str) -> None:
        """Take the handle of a frame or a thing; raises UnknownNameError where there is none."""
        known(name, {*self.handles, *self.things}, "handle")
        self._undo.append(self._subject.remembered(self.q))
        del self._undo[:-100]  # postures that are remembered
        self.taken = name
        self._restart()

    def let_go(self) -> None:
        """Let the handle go; the figure stays."""
        self.taken, self._trouble, self._stopped = "", "", ""
        self._drag: Drag[Any] | None = None

    def move(self, place: ArrayLike | None) -> LiveFrame:
        """Move the handle that was taken to a place (3,), and make one frame; raises InputError where none was taken.

        A frame has a budget of the processor's time, see `Drag`; moved to the same place again, figure and thing go on.
        A figure that cannot follow keeps its posture, and the status says why. A thing moves by 50 mm at most. Where
        the figure does not get out of its way, which the status says, it stays and tries half as far in the next frame.
        """
        if not self.taken:
            raise InputError("no handle was taken; take one first")
        place = numbers(place, (3,), "the place of a handle")
        began, path = time.perf_counter(), tuple[tuple[float, Array], ...]()
        if self._drag is not None:
            try:
                frame = self._pushed(self._drag, place) if self.taken in self.things else self._drag.to(place)
                if frame is not None:
                    self.q, path = np.array(frame.q), frame.path
                    self._subject.arrived()
            except WholebodyError as trouble:
                self._trouble = str(trouble)
        error = float(np.linalg.norm(self.place(self.taken) - place))
        return with_values(self._report(error, time.perf_counter() - began), path=path)

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
        self.q = self._subject.restore(self._undo.pop())
        return True

    # ---- what is seen

    def place(self, name: str) -> Array:
        """Where (3,) the handle of a frame or a thing is."""
        return self.place_at(self.q, name)

    def place_at(self, q: Array, name: str) -> Array:
        """The same at a posture (nq,)."""
        if name in self.things:
            return np.array(self._at(name).translation)
        handle = self._subject.handles[name]
        return np.array(self._state.update(q).data.oMi[handle.joint].act(handle.local.translation))

    def _at(self, thing: str) -> pin.SE3:
        return self.scene.objects[thing].placement

    def report(self) -> LiveFrame:
        """What there is to say without a frame."""
        return self._report(0.0, 0.0)

    def stated(self, goals: object = ()) -> Problem:
        """The problem with the present posture as its start, and the holds; raises InputError for an assembly."""
        return self._subject.stated(self.q, goals, self.held - {self.taken})

    def _restart(self) -> None:
        """Begin to follow anew: holds, handle or method are others."""
        self._trouble, self._stopped, self._reach = "", "", FARTHEST_STEP
        followed = self.taken if self.taken in self.handles else next(iter(self.handles))
        held = self.held - {self.taken}
        try:
            self._drag = self._subject.drag(self.q, followed, self.place(followed), held, self.method)
            workspace = self._drag.workspace
            if workspace is not None:  # what later frames need is made now
                workspace.sweep.first_contact(self.q, self.q, None, FARTHEST_STEP)
                if self.taken in self.things:
                    workspace.frame({self.taken: (workspace.where(self.taken),) * 2})
        except WholebodyError as trouble:
            self._drag, self._trouble = None, str(trouble)

    def _rehearse(self) -> None:
        """Make frames that are forgotten: what is loaded or set up at the first of a kind is there then.

        A handle stays where it is, and a thing moves by a micrometre.
        """
        q, remembered = self.q, self._subject.remembered(self.q)
        name = next(iter(self.handles))
        place = self.place(name)
        try:
            drag = self._subject.drag(q, name, place, self.held - {name}, self.method)
            drag.to(place)
            for thing in self.things[:1]:
                at = self._at(thing)
                self._subject.move(thing, pin.SE3(at.rotation, at.translation + 1e-6), FRAME)
                drag.to(place)
            self.report()
        except WholebodyError:
            pass  # it is told when a handle is taken
        finally:
            self._subject.restore(remembered)

    def _pushed(self, drag: Drag[Any], place: Array) -> DragFrame | None:
        """A frame in which the thing that was taken comes nearer to a place (3,); None where it has to stay."""
        at, before, deep = self._at(self.taken), self._subject.remembered(self.q), self._deepest
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
        # m: a thing tries to move at least so far
        self._reach = max(0.5 * self._reach, 0.002)
        return None

    def _contacts(self, q: Array) -> Contacts:
        # m: pairs nearer than this are counted as contacts
        return self.scene.contacts(q, within=0.002)

    def _report(self, error: float, seconds: float) -> LiveFrame:
        contacts = self._contacts(self.q)
        overlap = self._deepest = float(-contacts.distance.min(initial=0.0))
        doing = f"dragging {self.taken}" if self.taken else "take a handle and drag it; click one to hold it"
        status = f"{doing}, by {self.method.name}"
        if self._trouble or self._stopped:
            status = f"{status}: {self._trouble or self._stopped}"
        return LiveFrame(self.q, error, len(contacts.distance), overlap, seconds, status)
