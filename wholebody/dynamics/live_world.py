"""A world whose figure and things are dragged by hand, or by a tracker elsewhere, while time goes on.

A handle of the figure moves the posture that the figure follows, by one quadratic program a frame, through things that
stand or move: `World` keeps the figure out of them. A body is drawn to the mouse by a critically damped spring, and
flies on when it is let go.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array
from wholebody.base.checks import choice, instance, known, numbers
from wholebody.base.errors import InputError
from wholebody.dynamics.world import World
from wholebody.methods.qp.method import QP
from wholebody.problem import Problem
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import NotCopyable
from wholebody.tasks import Frame, Hold, Point
from wholebody.tracking.live import LiveFrame
from wholebody.tracking.live_subjects import LiveProblem, handle_frames, things_of
from wholebody.tracking.overlaps import GIVE_WAY

RATE = 12.0  # 1/s: of the spring between the mouse and a body
FASTEST = 3.0  # m/s: a goal that jumps is followed at this speed


class LiveWorld(NotCopyable):
    """The same things to take and move as `LiveDrag`, in a world that does not wait.

    Attributes:
        world: what moves.
        scene: its scene, a copy of the given one.
        handles: names of the frames that can be dragged.
        things: names of the things that can be dragged: those that move by themselves, and those that stand.
        held: frames that the tracked posture keeps where they are.
        taken: the handle that the mouse holds; "" for none.
        give_way: who takes an overlap of the figure with a thing that moves by itself, see `World`.
        give_way_choices: what `give_way` may be.
        methods, chosen: of the tracker: "qp" alone.

    Examples:
        >>> from wholebody.dynamics.live_world import LiveWorld
        >>> live = LiveWorld(wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor"))
        >>> live.follow({"head_top": live.place("head_top")})
        >>> live.move().overlap < 1e-4
        True
    """

    def __repr__(self) -> str:
        return f"LiveWorld({len(self.handles)} handles, {len(self.things)} things)"

    def __init__(self, scene: Scene, start: Array | None = None, *, give_way: str = "figure") -> None:
        """Begin at a start (nq,), with the soles of people held until they are released.

        Raises:
            InputError: the scene is none, or a start that `Problem` or `World` refuses.
        """
        instance(scene, Scene, "LiveWorld: scene", "make one with wb.Scene(figure)")
        self._given = scene
        self.give_way: str = choice(give_way, GIVE_WAY, "LiveWorld: give_way")
        empty = Scene(scene.figure)
        soles = [Hold(name) for name in handle_frames(scene.figure.frames) if name.endswith("_sole")]
        stated = Problem(empty, start, constraints=soles, balance=False)
        self._subject = LiveProblem(stated)
        self.handles, self.held = tuple(self._subject.handles), set(self._subject.held)
        self.things = things_of(scene)
        self.give_way_choices = GIVE_WAY
        self.methods, self.chosen = {"qp": "qp"}, "qp"
        self._begin()
        self.take(self.handles[0])
        self.move(self.place(self.handles[0]))  # what is loaded or set up at the first frame is there then
        self._begin()

    def _begin(self) -> None:
        self.scene, self.taken = copy.copy(self._given), ""
        self.world = World(self.scene, self._subject.q, give_way=self.give_way)
        self._bodies = frozenset(() if self.world.engine is None else self.world.engine.bodies)
        self._state = self.scene.state(self.world.q)
        self._tracked, self._goals, self._renewed = np.array(self.world.q), dict[str, Array](), dict[str, float]()
        self._tracker: Any = None
        self._places = {name: self.place(name) for name in self.handles}
        self._turns = dict[str, Array]()
        self._note = ""

    @property
    def q(self) -> Array:
        """(nq,) the posture that is shown."""
        return self.world.q

    # ---- what the mouse, the buttons and trackers do

    def take(self, name: str) -> None:
        """Take the handle of a frame or a thing; raises UnknownNameError where there is none."""
        known(name, {*self.handles, *self.things}, "handle")
        self.taken = name
        if name in self.handles:
            self._goal(name, self._handle_place(self._tracked, name))
            if self._tracker is None:
                self._prepare()

    def let_go(self) -> None:
        """Let the handle go: a body flies on, a frame of the figure stays."""
        self.taken = ""

    def follow(self, places: Mapping[str, ArrayLike]) -> None:
        """Handles are to follow places (3,) [m] from outside, such as a tracked head and hands, from the next frame on.

        One that is not renewed within 0.25 s is let go; where all are lost, they first ease back to where they began.

        Raises:
            InputError: a place is not three finite numbers.
            UnknownNameError: there is no such handle.
        """
        for name, place in instance(places, Mapping, "places", "give handles with their places").items():
            self._goal(known(name, self.handles, "handle"), numbers(place, (3,), f"the place of {name}"), clamped=True)
            self._renewed[name] = self.world.time

    def move(self, place: ArrayLike | None = None) -> LiveFrame:
        """Make a frame, with what was taken on its way to a place (3,); raises InputError where nothing was taken."""
        began = time.perf_counter()
        target = None if place is None else numbers(place, (3,), "the place of a handle")
        if target is not None:
            if not self.taken:
                raise InputError("no handle was taken; take one first")
            self._pull(target)
        self._ease()
        self.world.give_way = self.give_way
        frame = self.world.step(self._track())
        self._note = frame.note
        error = 0.0 if target is None else float(np.linalg.norm(self.place(self.taken) - target))
        contacts = self.scene.contacts(frame.q, within=0.002)  # m: pairs nearer than this are counted, as in a drag
        seconds = time.perf_counter() - began
        return LiveFrame(frame.q, error, len(contacts.distance), frame.deepest, seconds, self._status())

    def toggle(self, name: str) -> bool:
        """Hold a frame where it is, or release it; whether it is held now. Raises UnknownNameError for other names."""
        known(name, self.handles, "handle")
        self.held ^= {name}
        self._tracker = None
        if name not in self.held:
            self._release(name)
        return name in self.held

    def choose(self, method: object) -> None:
        """Nothing: the tracker is "qp"; raises UnknownNameError for another name."""
        known(method, self.methods, "method")

    def undo(self) -> bool:
        """Begin anew: figure and things are where they were at first."""
        self._begin()
        return True

    # ---- what is seen

    def place(self, name: str) -> Array:
        """Where (3,) [m] the handle of a frame or a thing is; UnknownNameError where there is none."""
        known(name, {*self.handles, *self.things}, "handle")
        if name in self.things:
            return np.array(self.scene.objects[name].placement.translation)
        return self._handle_place(self.q, name)

    def report(self) -> LiveFrame:
        """What there is to say without a frame."""
        return LiveFrame(self.q, 0.0, 0, 0.0, 0.0, self._status())

    def _status(self) -> str:
        doing = (
            f"dragging {self.taken}" if self.taken else "drag a handle or a thing; click a handle to hold or release it"
        )
        lost, known_ones = [name for name in list(self._renewed) if self._lost(name)], len(self._renewed)
        ends = "eases back" if len(lost) == known_ones else "is free"
        notes = [self._note, f"no place of {', '.join(lost)} arrives any more; it {ends}" if lost else ""]
        said = "; ".join(filter(None, notes))
        return f"{doing}: {said}" if said and self.taken else said or doing

    def _lost(self, name: str) -> bool:
        """Whether a tracker has not given the place of a handle for so long that it goes back."""
        # the page's thread may have taken it meanwhile
        return self.world.time - self._renewed.get(name, np.inf) > 0.25  # s

    def _handle_place(self, q: Array, name: str) -> Array:
        return np.array(self._handle_placement(q, name).translation)

    def _handle_placement(self, q: Array, name: str) -> pin.SE3:
        handle = self._subject.handles[name]
        return self._state.update(q).data.oMi[handle.joint] * handle.local

    # ---- a frame

    def _goal(self, name: str, place: Array, clamped: bool = False) -> None:
        """Follow a place with a handle; a place from outside that jumps is followed at a bounded speed."""
        if name not in self._goals:
            self._tracker, self._turns[name] = None, np.array(self._handle_placement(self._tracked, name).rotation)
        if clamped:  # from where the handle is: a goal that ran far out of reach would be long on its way back
            here = self._handle_place(self._tracked, name)
            length = float(np.linalg.norm(place - here))
            place = here + (place - here) * min(1.0, FASTEST * self.world.dt / max(length, 1e-12))
        self._goals[name] = place

    def _pull(self, place: Array) -> None:
        """Bring what was taken towards a place (3,)."""
        name, dt = self.taken, self.world.dt
        if name in self.handles:
            self._renewed.pop(name, None)  # the mouse has it now
            self._goal(name, place, clamped=True)
            return
        way = place - self.place(name)
        engine = self.world.engine
        if name not in self._bodies or engine is None:
            length = float(np.linalg.norm(way))
            at = self.scene.objects[name].placement
            way *= min(1.0, FASTEST * dt / max(length, 1e-12))
            self.scene.move(name, at=pin.SE3(at.rotation, at.translation + way), over=dt)
            return
        mean = engine.twist(name)[:3] - 0.5 * dt * np.asarray(engine.gravity)  # velocity of the last frame, as it fell
        drawn = RATE**2 * way - 2.0 * RATE * mean
        drawn *= min(1.0, 80.0 / max(float(np.linalg.norm(drawn)), 1e-12))  # m/s²: no body is drawn faster
        mass = float(np.linalg.norm(engine.weight(name)) / np.linalg.norm(engine.gravity))
        engine.push(name, dt * (mass * drawn - engine.weight(name)), engine.centre(name))

    def _ease(self) -> None:
        """Let go of handles that a tracker has lost, where others lead the figure; else bring them back first."""
        lost, away = [name for name in list(self._renewed) if self._lost(name)], 0.0
        if len(lost) < len(self._renewed):  # where a lost one began is far from a figure that walked away
            for name in self._goals.keys() & lost:
                self._goals.pop(name, None)
                self._tracker = None
            return
        share = min(1.0, self.world.dt / 0.3)  # it eases back to where its handle began, in about a second
        for name in self._goals.keys() & lost:
            self._goals[name] = self._goals[name] + share * (self._places[name] - self._goals[name])
            there = self._handle_place(self._tracked, name) - self._places[name]
            away = max(away, float(np.linalg.norm(there)))
        for name in lost if away < 1e-3 else ():  # m; all at once, or those that are still on their way pull at it
            self._release(name)

    def _release(self, name: str) -> None:
        """Follow no place with a handle any more."""
        self._goals.pop(name, None)
        self._renewed.pop(name, None)
        self._tracker = None

    def _track(self) -> Array:
        if not self._goals:
            return self._tracked
        if self._tracker is None:
            self._prepare()
        else:
            self._problem.retarget(self._points())
        self._tracked = np.array(self._tracker.step(self._tracked).q)
        return self._tracked

    def _points(self) -> list[Point | Frame]:
        """The goals: places; frames that are held keep their turn, as a sole stays level."""
        return [
            Frame(name, pin.SE3(self._turns[name], place)) if name in self.held else Point(name, place)
            for name, place in self._goals.items()
        ]

    def _prepare(self) -> None:
        """Make a tracker of the present goals and holds: for two people it takes as long as a frame."""
        held = self.held - set(self._goals)
        self._problem = self._subject.stated(self._tracked, self._points(), held)
        self._tracker = QP().tracker(self._problem, dt=self.world.dt)
