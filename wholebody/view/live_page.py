"""The page of a live drag: viser shows the figure and its handles, the mouse moves them. Needs the extra `drag`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.errors import WholebodyError
from wholebody.dynamics.live_world import LiveWorld
from wholebody.geometry.pieces import box_corners
from wholebody.methods.newton.assembly import Assembly
from wholebody.motion.files.gltf import triangles
from wholebody.taskfile.task import View
from wholebody.tracking.frame import FRAME
from wholebody.tracking.live import LiveDrag, LiveFrame
from wholebody.view.style import LOOK, object_color
from wholebody.view.viser_server import viser_server

SETTLING = 90  # frames after the mouse or a key lets go in which the figure still follows to where that was
STILL = 1e-5  # m, rad: what moves less is not sent

KEYS = """<div style="padding: 0 0.75em; font-size: 0.875em">{dots}<br>
arrow keys move the chosen handle, shift with up and down moves it away and back, Escape: {escape}</div>
<img src="data:," hidden onerror="document.documentElement.addEventListener('keydown', event =>
event.key.startsWith('Arrow') && event.stopPropagation())">"""
"""The legend of colours and keys. Its script keeps arrow keys from viser, which would turn the camera by them too."""

FREE, HELD, THING = (70, 130, 220), (225, 90, 40), (90, 170, 90)
"""Colours of handles, bytes."""


class LivePage:
    """Shows a live drag, or a live world, in browsers until it is stopped.

    Attributes:
        drag: what is dragged. Frames of a world are made whether something is dragged or not.
        url: where browsers find the page.
        server: the viser.ViserServer.
        frames: frames that were made.
    """

    def __init__(
        self,
        drag: LiveDrag | LiveWorld,
        save_to: Path,
        port: int = 8080,
        save: Callable[[Path], Path] | None = None,
        places: Callable[[], Mapping[str, Array]] | None = None,
        view: View | None = None,
    ) -> None:
        """Open the page at the port, or the next free one; its button "save" writes the posture to `save_to`."""
        # `places` are asked for before every frame of a world: where handles are to follow from outside.
        self.drag, self.frames, self._places, view = drag, 0, places, view or View()
        self._save_to, self._save = save_to, save
        self._lock = threading.RLock()
        self._target: Any = None
        self._reached: Any = None
        self._settling = 0  # frames that are left after the mouse let go
        self._mouse = -1  # the browser whose mouse has the handle
        self._sent = np.full((len(drag.scene.piece_owner), 7), np.nan)  # placements that were sent, x y z and x y z w
        self._state = drag.scene.state(drag.q)
        self._constraints: dict[str, Any] = {}
        self._rings: Any = None
        self._stopped = threading.Event()
        self.server = viser_server(port, "wholebody world" if isinstance(drag, LiveWorld) else "wholebody drag")
        self.url = f"http://127.0.0.1:{self.server.get_port()}"
        self.server.scene.set_up_direction("+z")
        self.server.scene.configure_default_lights(cast_shadow=False)  # shadows cost most of a frame without a GPU
        self._look(view)
        self._pieces = self._draw(view.see_through)
        self._handles = {name: self._handle(name) for name in (*drag.handles, *drag.things)}
        self._panel()
        self._show(drag.report())
        self._loop = threading.Thread(target=self._run, name="wholebody drag", daemon=True)
        self._loop.start()

    def stop(self) -> None:
        """End the page and its thread."""
        self._stopped.set()
        self._loop.join(timeout=5.0)
        ending = threading.Thread(target=self.server.stop, name="wholebody drag ends", daemon=True)
        ending.start()
        ending.join(timeout=1.0)  # s: open tabs keep the server for 6 s, in threads that end with the process

    def serve(self) -> None:
        """Wait until the page is stopped or Ctrl-C, then end it."""
        try:
            while not self._stopped.wait(0.2):
                pass
        except KeyboardInterrupt:
            pass
        finally:
            self.stop()

    def _look(self, view: View) -> None:
        """Place the camera where a view says, or to the front right, as far away as it takes to see all handles."""
        places, camera = np.array([self.drag.place(name) for name in self.drag.handles]), self.server.initial_camera
        target = places.mean(axis=0) if view.target is None else np.array(view.target)
        away = np.array((2.2, -1.6, 0.6)) if view.eye is None else np.array(view.eye) - target
        length = float(np.linalg.norm(away))
        away, half = away / length, np.tan(np.radians(0.5 * LOOK.field_of_view))
        nearer = (places - target) @ away
        aside = np.linalg.norm(places - target - nearer[:, None] * away, axis=1)
        fits = float((aside / (0.7 * half) + nearer).max())  # the handles within 0.7 of the picture's height
        distance = max(fits, 0.6 if view.eye is None else length)  # m
        camera.position, camera.look_at = target + distance * away, target
        camera.fov = np.radians(LOOK.field_of_view)

    def _draw(self, see_through: Collection[str]) -> list[Any]:
        scene = self.drag.scene
        problem = getattr(self.drag, "problem", None)
        painted = problem.colors if isinstance(problem, Assembly) else {}
        pieces = list[Any]()
        for owner, piece in zip(scene.piece_owner, scene.geometry.geometryObjects, strict=True):
            thing, ground = scene.objects.get(owner), type(piece.geometry).__name__ == "Halfspace"
            own = tuple(piece.meshColor) if piece.overrideMaterial else LOOK.figure  # as a robot's file says
            color = painted.get(owner.partition("/")[0], own)
            if thing is not None:
                color = thing.color or (LOOK.floor if ground else object_color(len(pieces)))
            # opacity of the figure, so that the handles in it are seen
            opacity = 0.7 if thing is None else None if thing.color is None else thing.color[3]
            if thing is not None and thing.name in see_through:
                opacity = LOOK.see_through
            mesh, rgb = triangles(piece.geometry), tuple(round(255 * part) for part in color[:3])
            pieces.append(
                self.server.scene.add_mesh_simple(
                    f"/pieces/{len(pieces)}", np.asarray(mesh.vertices), np.asarray(mesh.faces),
                    color=rgb, opacity=opacity, cast_shadow=False, receive_shadow=False,
                    visible=thing is not None or piece.meshColor[3] > 0.0,
                )
            )  # fmt: skip
        return pieces

    def _handle(self, name: str) -> Any:
        color = THING if name in self.drag.things else HELD if name in self.drag.held else FREE
        ball = self.server.scene.add_icosphere(
            f"/handles/{name}", self._radius(name), color=color, position=self.drag.place(name), cast_shadow=False
        )
        offset = np.zeros(3)

        async def dragged(event: Any) -> None:
            nonlocal offset
            with self._lock:
                if event.phase == "start":
                    self._settling, self._mouse = 0, event.client_id
                    self.drag.take(name)
                    self._choice.value = name
                if self.drag.taken != name or self._mouse != event.client_id:
                    return  # undone meanwhile, or taken by another page or the keys
                if event.phase == "start":
                    offset = self.drag.place(name) - np.array(event.start_position)
                self._target = np.array(event.end_position) + offset
                if event.phase == "end" and isinstance(self.drag, LiveWorld):
                    self.drag.let_go()  # it keeps its velocity
                    self._target = None
                elif event.phase == "end":
                    self._settling = SETTLING

        async def clicked(_: Any) -> None:
            self._choice.value = name
            if name in self.drag.handles:
                self.toggle(name)

        owners = self.drag.scene.piece_owner  # the ball of a thing is inside of it: the mouse takes the thing itself
        of_thing = [piece for piece, owner in zip(self._pieces, owners, strict=True) if owner == name]
        for taken in (ball, *(of_thing if name in self.drag.things else ())):
            taken.on_drag(dragged)
            taken.on_click(clicked)
        return ball

    def _radius(self, name: str) -> float:
        """Of the ball of a handle, metres: small where others are near, as fingertips are, and smaller than a thing."""
        here, scene = self.drag.place(name), self.drag.scene
        pieces = zip(scene.piece_owner, scene.geometry.geometryObjects, strict=True)
        sizes = [float(np.ptp(box_corners(piece.geometry), axis=0).max()) for owner, piece in pieces if owner == name]
        others = (*self.drag.handles, *self.drag.things)
        apart = [float(np.linalg.norm(self.drag.place(other) - here)) for other in others]
        least = min((length for length in apart if length > 2e-3), default=1.0)
        return min(0.04, 0.25 * min(least, *sizes, 1.0))

    def toggle(self, name: str) -> None:
        """Hold or release a frame."""
        with self._lock:
            held = self.drag.toggle(name)
            self._handles[name].color = HELD if held else FREE
            self._boxes[name].value = held

    def _panel(self) -> None:
        gui = self.server.gui
        self._status, self._numbers = gui.add_markdown(""), gui.add_markdown("")
        self._method = gui.add_dropdown("method", tuple(self.drag.methods), initial_value=self.drag.chosen)
        self._method.on_update(self._choose)
        names = (*self.drag.handles, *self.drag.things)
        self._choice = gui.add_dropdown("handle", names, initial_value=names[0])
        self._choice.on_update(self._locked(self._show_rings))
        self._boxes: dict[str, Any] = {}
        for name in self.drag.handles:
            self._boxes[name] = gui.add_checkbox(f"hold {name}", name in self.drag.held)
            self._boxes[name].on_update(partial(self._ticked, name))
        again = "start again"
        if isinstance(self.drag, LiveWorld):
            self._give_way = gui.add_dropdown("gives way", self.drag.give_way_choices, initial_value=self.drag.give_way)
            self._give_way.on_update(self._locked(partial(self._share, self.drag)))
        if isinstance(self.drag, LiveDrag):
            again = "undo"
            self._add_rings(self.drag)
            for name, holds in self.drag.constraints.items():
                self._constraints[name] = gui.add_checkbox(name, holds)
                self._constraints[name].on_update(partial(self._constrained, self.drag, name))
        gui.add_button(again).on_click(self._undo)
        meanings = {"free": FREE, "held": HELD, **({"thing": THING} if self.drag.things else {})}
        dots = " ".join(f'<span style="color: rgb{color}">&#9679;</span> {word}' for word, color in meanings.items())
        gui.add_html(KEYS.format(dots=dots, escape=again))
        gui.add_command(again, hotkey="escape").on_trigger(self._undo)
        for label, key, shift, way in (
            ("left", "arrowleft", None, (-1, 0, 0)), ("right", "arrowright", None, (1, 0, 0)),
            ("up", "arrowup", None, (0, 0, 1)), ("down", "arrowdown", None, (0, 0, -1)),
            ("away", "arrowup", "shift", (0, 1, 0)), ("back", "arrowdown", "shift", (0, -1, 0)),
        ):  # fmt: skip
            command = gui.add_command(f"move the chosen handle {label}", hotkey=key, modifier=shift)
            command.on_trigger(partial(self._pressed, np.array(way)))
        if self._save is not None:
            gui.add_button(f"save as {self._save_to.name}").on_click(self._locked(self._write))

    def _add_rings(self, drag: LiveDrag) -> None:
        self._rings = self.server.scene.add_transform_controls("/turn", 0.2, disable_axes=True, disable_sliders=True)

        async def turned(event: Any) -> None:
            with self._lock:
                name = self._choice.value
                if event.phase == "start":
                    self._settling, self._mouse = 0, event.client_id
                    drag.take(name, turn=True)
                if drag.taken == name and self._mouse == event.client_id:
                    self._target = np.roll(event.target.wxyz, -1)
                    self._settling = SETTLING if event.phase == "end" else 0

        self._rings.on_update(turned)

    def _locked(self, act: Callable[[], None]) -> Callable[[Any], None]:
        def called(_: Any) -> None:
            with self._lock:
                act()

        return called

    def _show_rings(self) -> None:
        """Put the rings around the chosen handle, unless the mouse has them."""
        name = self._choice.value
        if self._rings is None or not isinstance(self.drag, LiveDrag):
            return
        self._rings.visible = name in self.drag.handles
        if name in self.drag.handles:
            self._rings.position = self.drag.place(name)
            if self.drag.taken != name:
                self._rings.wxyz = np.roll(self.drag.orientation(name), 1)

    def _pressed(self, way: Array, event: Any) -> None:
        """Move the chosen handle to the right, away or up, as this browser sees it."""
        with self._lock:
            name, self._mouse = self._choice.value, -1
            if self.drag.taken != name or self._target is None or len(self._target) != 3:
                self.drag.take(name)
                self._target = self.drag.place(name)
            camera = event.client.camera
            away = np.array(camera.look_at - camera.position)
            away[2] = 0.0
            away /= max(float(np.linalg.norm(away)), 1e-9)
            right = np.array((away[1], -away[0], 0.0))
            # m: a press of an arrow key; a key that stays down repeats some 30 times a second
            self._target = self._target + 0.01 * (np.array((right, away, (0.0, 0.0, 1.0))).T @ way)
            self._settling = SETTLING

    def _constrained(self, drag: LiveDrag, name: str, _: Any) -> None:
        with self._lock:
            if self._constraints[name].value != drag.constraints[name]:
                drag.constrain(name, self._constraints[name].value)
                if self._target is None:  # frames close what is to hold now
                    self._target, self._settling = drag.place(drag.taken), SETTLING

    def _share(self, world: LiveWorld) -> None:
        world.give_way = self._give_way.value

    def _choose(self, _: Any) -> None:
        with self._lock:
            self.drag.choose(self.drag.methods[self._method.value])

    def _ticked(self, name: str, _: Any) -> None:
        if self._boxes[name].value != (name in self.drag.held):
            self.toggle(name)

    def _undo(self, _: Any) -> None:
        with self._lock:
            self.drag.undo()
            self._target, self._settling = None, 0
            if isinstance(self.drag, LiveDrag):
                for name, holds in self.drag.constraints.items():
                    self._constraints[name].value = holds
            self._show(self.drag.report())

    def _write(self) -> None:
        assert self._save is not None
        try:
            self._status.content = f"wrote {self._save(self._save_to)}"
        except WholebodyError as error:
            self._status.content = str(error)

    def _run(self) -> None:
        due = time.perf_counter()
        while not self._stopped.is_set():
            with self._lock:
                if isinstance(self.drag, LiveWorld):
                    self.go_on(self.drag)
                elif self._target is not None and (self._target is not self._reached):
                    self.follow(self._target)
            # a frame that was late is made up for by the next two, so that a world keeps time
            due = max(due + FRAME, (now := time.perf_counter()) - 2.0 * FRAME)
            self._stopped.wait(max(due - now, 0.001))

    def go_on(self, world: LiveWorld) -> None:
        """Make one frame of a world and show it."""
        if self._places is not None:
            world.follow(self._places())
        frame = world.move(self._target)
        self.frames += 1
        if self._settling:
            self._settling -= 1
            if not self._settling:
                world.let_go()
                self._target = None
        self._show(frame)

    def follow(self, target: Any) -> LiveFrame:
        """Make one frame towards a place (3,) of the mouse, and show it, with the path within it."""
        name, before, drag = self.drag.taken, self.drag.q, self.drag
        place, things = drag.place(name), drag.scene.objects
        began = things[name].placement if name in things else None
        frame = drag.move(target)
        self.frames += 1
        moved = max(np.abs(frame.q - before).max(), np.abs(drag.place(name) - place).max())
        still = moved < STILL
        if still:
            self._reached = target  # nothing to send until the mouse moves on
        last = 0.0
        for share, q in frame.path[1:-1]:
            here = {} if began is None else {name: pin.SE3.Interpolate(began, things[name].placement, share)}
            self._place(q, here)
            self._stopped.wait((share - last) * FRAME)
            last = share
        if self._settling:
            self._settling = 0 if still else self._settling - 1
            if not self._settling:
                drag.let_go()
                self._target, frame = None, drag.report()
        self._show(frame)
        return frame

    def _show(self, frame: LiveFrame) -> None:
        unit = "mm" if self._target is None or len(self._target) == 3 else "mrad"
        with self.server.atomic():  # one message for all: each wakes the thread that sends
            self._place(frame.q, {})
            for name, ball in self._handles.items():
                place = self.drag.place(name)
                if np.abs(place - ball.position).max() > STILL:
                    ball.position = place
            self._show_rings()
            self._status.content = f"**{frame.status}**"
            self._numbers.content = (
                f"{frame.contacts} contacts, deepest overlap {1e3 * frame.overlap:.2f} mm  \n"
                f"handle off by {1e3 * frame.error:.1f} {unit}; frame {1e3 * frame.seconds:.1f} ms"
            )

    def _place(self, q: Array, at: Mapping[str, pin.SE3]) -> None:
        """Put the pieces where they are at a posture (nq,), and those of some things at other placements."""
        scene = self.drag.scene
        owners, placed = scene.piece_owner, self._state.update(q).data.oMi
        values = np.empty_like(self._sent)
        for number, piece in enumerate(scene.geometry.geometryObjects):
            place, owner = placed[piece.parentJoint] * piece.placement, owners[number]
            if owner in at:
                place = at[owner] * scene.objects[owner].placement.actInv(place)
            values[number] = pin.SE3ToXYZQUAT(place)
        with self.server.atomic():
            moved = ~(np.abs(values - self._sent) <= STILL)  # each costs viser more than the physics of a piece
            for number in np.flatnonzero(moved[:, :3].any(axis=1)).tolist():
                self._pieces[number].position = self._sent[number, :3] = values[number, :3]
            for number in np.flatnonzero(moved[:, 3:].any(axis=1)).tolist():
                self._sent[number, 3:] = values[number, 3:]
                self._pieces[number].wxyz = values[number, [6, 3, 4, 5]]
