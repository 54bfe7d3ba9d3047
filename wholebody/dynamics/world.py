"""A scene in time: a driven figure among fixed things, and things that move by themselves.

After figure 3 of Schmidl and Lin. In every frame the spring between tracker and figure says where the figure wants to
be; its overlap with everything is removed; what it then still pushes gets its impulse; at last the things that move by
themselves go on, while the figure moves from the posture before to the one that is shown.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array, brief
from wholebody.base.checks import array, choice, instance, posture, time_step, whole
from wholebody.base.errors import InputError
from wholebody.dynamics.articulated import Articulated
from wholebody.dynamics.coupling import Actuated, Coupling, Moved, PushedContacts, Spring
from wholebody.dynamics.frame import EngineFrame, one_frame
from wholebody.dynamics.pieces import segment_placements, surface_of
from wholebody.dynamics.rigid_bodies import RigidBodies
from wholebody.geometry.continuous.passing_through import INSIDE
from wholebody.geometry.proximity import Contacts
from wholebody.methods.newton.assembly_bodies import AssemblyBodies
from wholebody.motion.clip import MOST_FRAMES, Clip
from wholebody.scene.moving_obstacles import Collision
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import NotCopyable
from wholebody.tracking.frame import FRAME, Frame
from wholebody.tracking.loop import FrameLoop, invalid_reason
from wholebody.tracking.overlaps import GIVE_WAY, Overlap, overlaps
from wholebody.tracking.scenes import FILE, InteractionScene, SceneFile

Advance = tuple[Array, Frame, Mapping[str, Array], EngineFrame | None]
"""The posture that was wanted, the frame, impulses on things, and what the things did."""


class WorldFrame(NamedTuple):
    """One frame of a world.

    Attributes:
        time: seconds since the start, at the end of the frame.
        q: (nq,) the posture that is shown.
        wanted: (nq,) where the spring would have brought the figure.
        placements: thing that moves by itself to where it is.
        impulses: thing to the impulse (3,) that the figure gave it, N s.
        loop: how the figure's overlap was removed, and in what time.
        engine: what the things did; None if none moves by itself.
        collisions: what could not be avoided, such as a thing that the user moved too fast, or one that moves by itself
            and is squeezed between two others; empty if nothing.
        overlaps: every two objects of which pieces overlap at the end, with what would part them, two fixed things
            too; empty if none do by more than 0.1 mm.
        deepest: greatest depth of any pair at the end, metres, also of two things; 0 if there is none. See
            `Scene.overlapping` for the pairs.
        seconds: wall time, without drawing.
        note: "" or a report of unusual events.
    """

    time: float
    q: Array
    wanted: Array
    placements: Mapping[str, pin.SE3]
    impulses: Mapping[str, Array]
    loop: Frame
    engine: EngineFrame | None
    collisions: tuple[Collision, ...]
    overlaps: tuple[Overlap, ...]
    deepest: float
    seconds: float
    note: str

    def __repr__(self) -> str:
        return brief(self)


class World(NotCopyable):
    """A figure that follows a tracker among things, some of which move by themselves.

    Things without a `wb.Body` are fixed; the user may move them between frames (`Scene.move` with `over=world.dt`), and
    put bodies elsewhere, which keep their velocities. The scene has the present placements of all things, so each world
    needs a scene of its own, such as `copy.copy(scene)`.

    Attributes:
        scene: figure and things.
        dt: seconds a frame.
        time: seconds since the start.
        engine: the things that move by themselves; None if there are none.

    Raises:
        InputError: a value of the wrong kind or range, or a figure that penetrates something and cannot leave it.

    Examples:
        >>> room = wb.Scene(human).add(wb.HalfSpace(), name="floor")
        >>> _ = room.add(wb.Sphere(0.1), name="ball", at=(0.5, 0.0, 1.0), body=wb.Body(mass=0.5))
        >>> frame = wb.World(room).step()
        >>> bool(frame.placements["ball"].translation[2] < 1.0)
        True
    """

    def __init__(
        self,
        scene: Scene,
        start: ArrayLike | None = None,
        *,
        dt: float = FRAME,
        overlap: str = "qp",
        seed: int = 0,
        spring: Spring | Actuated | None = None,
        give_way: str = "figure",
    ) -> None:
        """Begin.

        Args:
            scene: figure and things.
            start: (nq,) first posture; the figure's first one by default.
            dt: seconds a frame.
            overlap: how the figure's overlap is removed, "qp" or "ccd"; see `FrameLoop`.
            seed: of all random orders; the same seed gives the same motion.
            spring: between tracker and figure, K 1000, R 40 and 0.4 kg by default; or a `wb.Actuated` of the figure,
                whose joints then yield to what they meet.
            give_way: who takes an overlap of the figure with a thing that moves by itself, "figure" or "both", half and
                half; see `FrameLoop`. A `wb.Actuated` figure yields by its springs, and takes "figure" alone.

        Raises:
            InputError: no posture near the start is free, a thing that moves by itself overlaps another thing at the
                start, or the figure there, or a value of the wrong kind, shape or range.
            UnknownNameError: another overlap, or a joint names a thing that is not there.
        """
        self.scene, self.dt = instance(scene, Scene, "World: scene", _scene_instead(scene)), time_step(dt, "dt")
        instead = "give wb.dynamics.Spring(mass=0.4) or wb.Actuated(figure), or leave it out"
        instance(spring, (Spring, Actuated, type(None)), "World: spring", instead)
        self._bodies = tuple(name for name, thing in scene.objects.items() if thing.body is not None)
        first = scene.figure.posture(scene.figure.postures[0]) if start is None else start
        self._loop = FrameLoop(
            scene, first, overlap=overlap, dt=self.dt, seed=seed, touching=self._bodies, give_way=give_way
        )  # fmt: skip
        _check_yielding(spring, give_way)
        self.engine = RigidBodies(scene, start=self._loop.shown) if self._bodies else None
        self._articulated, self._spring = None, spring
        if isinstance(spring, Actuated):
            self._articulated, spring = Articulated(scene, self._loop.shown, spring, self.engine), None
        self._coupling = Coupling(scene.model, self._loop.shown, spring)
        self._tracked: Array = self._loop.shown
        self._workspace, self.time = scene.workspace(), 0.0
        self._revision = scene.revision
        names = () if self.engine is None else self.engine.names  # links without pieces touch nothing
        segments = (name for name in segment_placements(scene, self._loop.shown) if name in names)
        self._frames = {name: scene.frame_id(name) for name in segments}
        self._before = self._segments(self._loop.shown)
        self._placed = {name: thing.placement for name, thing in scene.objects.items() if thing.segment is None}
        owners = self._workspace.owners
        self._owner_of = {piece: name for piece, name in enumerate(owners) if name in self._bodies}
        self._surfaces = {
            (piece, name): surface_of(scene, owner, name)
            for piece, owner in enumerate(owners)
            for name in self._bodies
            if owner != name
        }

    def __repr__(self) -> str:
        return f"World of {self.scene.figure.name!r} and {len(self._bodies)} bodies, {1e3 * self.dt:g} ms a frame"

    @property
    def q(self) -> Array:
        """(nq,) the posture that is shown."""
        return self._loop.shown if self._articulated is None else self._articulated.q

    @property
    def give_way(self) -> str:
        """Who takes an overlap of the figure with a thing that moves by itself; it can be set."""
        return self._loop.give_way

    @give_way.setter
    def give_way(self, give_way: str) -> None:
        _check_yielding(self._spring, give_way)
        self._loop.give_way = choice(give_way, GIVE_WAY, "World: give_way")

    @property
    def velocity(self) -> Array:
        """(nv,) of the figure, rad/s and m/s."""
        return np.array((self._coupling if self._articulated is None else self._articulated).velocity)

    @property
    def energy(self) -> float:
        """Kinetic and potential energy of what moves by itself, joules; a figure is among it if it yields."""
        figure = 0.0 if self._articulated is None else self._articulated.energy()
        return figure + (0.0 if self.engine is None else self.engine.energy())

    def step(self, tracked: ArrayLike | None = None) -> WorldFrame:
        """Make one frame.

        If the tracked posture is invalid (a sensor that failed), the one before counts, and the note says so.

        Args:
            tracked: (nq,) where the tracker is at the end of the frame; None for where it was.

        Raises:
            InputError: objects were added to or removed from the scene, or tracked consists of no numbers.
        """
        if self.scene.revision != self._revision:
            raise InputError("objects of the scene were added or removed; make a new world")
        began, note = time.perf_counter(), ""
        if tracked is not None:
            goal = array(tracked, "tracked", f"{self.scene.model.nq} numbers")
            note = invalid_reason(self.scene, goal)
            self._tracked = self._tracked if note else np.array(pin.normalize(self.scene.model, goal))
        moved = self._user_moves()
        self._put_bodies()
        advance = self._advance if self._articulated is None else self._yield
        wanted, frame, impulses, engine = advance(moved)
        if self.engine is not None:
            for name in self._bodies:
                place = self.engine.placement(name)
                if place != self._placed[name]:
                    self.scene.move(name, at=place)
        self.time += self.dt
        for name in self._placed:
            self._placed[name] = self.scene.objects[name].placement
        self._workspace.refresh()
        near = self.scene.overlapping(frame.q, self._workspace)
        deepest = max(0.0, -float(near.distance.min(initial=0.0)))
        found = overlaps(self.scene, frame.q, self.give_way) if deepest > INSIDE else ()
        squeezed = self._squeezed(near, {*self._bodies, *moved})
        note = f"{note}; the one before counts" if note else ""
        note = "; ".join(part for part in (note, frame.note, *map(str, squeezed)) if part)
        return WorldFrame(
            self.time, frame.q, wanted, {name: self._placed[name] for name in self._bodies}, impulses, frame,
            engine, (*frame.collisions, *squeezed), found, deepest, time.perf_counter() - began, note,
        )  # fmt: skip

    def _advance(self, moved: Moved) -> Advance:
        """Go on by a frame with a figure that goes where it wants to, as far as contact allows."""
        wanted = self._coupling.toward(self._tracked, self.dt)
        frame = self._loop.frame(wanted)
        impulses, engine = dict[str, Array](), None
        if self.engine is not None:
            self._put_bodies()  # those that gave way
            impulses = self._push(frame.q)
            after = self._segments(frame.q)
            given = {name: (self._before[name], place) for name, place in after.items()}
            engine = self.engine.advance(self.dt, {**given, **moved})
            self._before = after
        self._coupling.stopped(frame.q, wanted, self.dt)
        return wanted, frame, impulses, engine

    def _yield(self, moved: Moved) -> Advance:
        """The same with a figure that yields."""
        figure = self._articulated
        assert figure is not None
        began, cpu = time.perf_counter(), time.thread_time()
        figure.advance(self._tracked, self.dt, moved, self._frames)
        spent = time.perf_counter() - began, time.thread_time() - cpu
        frame = Frame(figure.q, *spent, 0.0, 0.0, len(figure.ends), 0, figure.points, "")
        return self._tracked, frame, figure.impulses, one_frame(figure.frames, figure.ends)

    def _segments(self, q: Array) -> dict[str, pin.SE3]:
        """Where every segment is at a posture (nq,)."""
        state = self._workspace.state.update(q)
        return {name: pin.SE3(state.frame(number)) for name, number in self._frames.items()}

    def _push(self, q: Array) -> dict[str, Array]:
        """Give things the impulses of the figure that was stopped at the posture q (nq,)."""
        assert self.engine is not None
        self._workspace.refresh()
        near = self._workspace.near(q, 1.5e-3)  # m: the figure stops short of things by less
        contacts = PushedContacts(self.engine, self._workspace.state, self._workspace.table, near, self._owner_of)
        return contacts.push(self._coupling.velocity, self._surfaces)

    def _user_moves(self) -> dict[str, tuple[pin.SE3, pin.SE3]]:
        """Things without a body that the user moved since the last frame, with both placements."""
        objects = self.scene.objects
        moved = {}
        for name, before in self._placed.items():
            thing = objects[name]
            if thing.body is None and thing.placement != before:
                moved[name] = (thing.placement if thing.motion is None else before, thing.placement)
        return moved

    def _put_bodies(self) -> None:
        """Put bodies where the scene has them, if the user moved them; they keep their velocities."""
        for name in self._bodies:
            if self.scene.objects[name].placement != self._placed[name]:
                self.engine.put(name, self.scene.objects[name].placement)  # type: ignore[union-attr]
                self._placed[name] = self.scene.objects[name].placement

    def _squeezed(self, near: Contacts, moving: Collection[str]) -> tuple[Collision, ...]:
        """Things in each other, of which one moves by itself or was moved, the deepest first; `near` has pairs."""
        owners, standing = self._workspace.owners, set(self._placed)
        deepest: dict[tuple[str, str], float] = {}
        for row in np.flatnonzero(near.distance < -INSIDE).tolist():
            both = owners[near.pair[row, 0]], owners[near.pair[row, 1]]
            if standing.issuperset(both) and not set(moving).isdisjoint(both):
                deepest.setdefault(both, -float(near.distance[row]))
        return tuple(Collision(*both, depth, True) for both, depth in deepest.items())


def _check_yielding(spring: Spring | Actuated | None, give_way: str) -> None:
    if isinstance(spring, Actuated) and give_way == "both":
        raise InputError(
            'World: give_way "both" is for a figure without wb.Actuated, whose springs say how much it yields'
        )


def _scene_instead(given: object) -> str:
    """What to do where no scene was given."""
    correction = "make one with wb.Scene(figure)"
    if isinstance(given, AssemblyBodies):
        correction += "; an assembly has no motion of its own: add its bodies as things with wb.Body(joints=...)"
    return correction


_FILE = SceneFile(Path(__file__).with_name("scenes.toml"), FILE)

WORLD_SCENES = _FILE.scenes  # descriptions of the scenes, by name

build_world_scene = _FILE.build


def standing_scene(name: str, scene: Scene, q: Array, *, frames: int) -> InteractionScene:
    """A scene of one's own, in which the figure keeps the posture q (nq,) for a number of frames."""
    frames = whole(frames, "frames", 1, MOST_FRAMES)
    track = Clip(scene.figure, np.tile(posture(q, scene.model.nq), (frames, 1)), FRAME, name)
    return InteractionScene(name, "things move around a figure that stands", scene, track)
