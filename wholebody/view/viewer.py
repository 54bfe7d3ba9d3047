"""The viewer: a scene in Meshcat, live in the browser, as a file that opens offline, as a picture or a movie."""

from __future__ import annotations

import math
import os
import sys
import webbrowser
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from wholebody.assessment.posture import assess
from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.base.fields import Range
from wholebody.base.files import checked_target, write
from wholebody.geometry.placement import FARTHEST
from wholebody.problem import Problem
from wholebody.view import commands
from wholebody.view.bodies import scene_glb
from wholebody.view.composition import Composition, panel, timed
from wholebody.view.markers import checked_overlaps
from wholebody.view.page import live_page, notebook_frame, static_page
from wholebody.view.scene_graph import SceneGraph
from wholebody.view.screenshot import Screenshots, check_movie, counted, frame_times, movie
from wholebody.view.server import Command, Op, Server, seconds
from wholebody.view.style import LOOK, Color
from wholebody.view.viewed_scene import ViewedScene, checked_scene

if TYPE_CHECKING:
    from wholebody.methods.newton.assembly import Assembly
    from wholebody.tracking.overlaps import Overlap

SAVED = (".glb", ".htm", ".html", ".png")  # endings of the files that `Viewer.save` writes


class Viewer:
    """Shows a scene: the posture, ghosts, contacts and penetrations, goals and their errors.

    Nothing is started until it is needed: `open` or `url` start the live page, `picture` and `movie` a headless
    Chromium, `save` neither. The page tells its title, what is shown, and what the colours mean. In its controls every
    folder (figure, objects, contacts, goals, names, ghosts) can be switched off.

    Pieces nearer than `contact_distance` to each other are orange, and penetrating pieces red; things are tinted,
    half-spaces keep their colour. A blue arrow is a contact's normal, from the first piece to the second; a dark red
    one is the vector that resolves a penetration.

    Example:
        >>> with Viewer(scene) as viewer:          # doctest: +SKIP
        ...     viewer.show(q, problem=problem)
        ...     viewer.picture("scene.png")
    """

    def __init__(
        self,
        scene: ViewedScene | Assembly,
        *,
        contact_distance: float = 0.005,
        see_through: Collection[str] = (),
        names: bool = False,
        title: str = "wholebody",
        host: str = "127.0.0.1",
        port: int = 0,
        screenshots: Screenshots | None = None,
    ) -> None:
        """Prepare to show a scene.

        Args:
            scene: a `wholebody.Scene`, or an assembly whose bodies have shapes; its posture is `assembly.q`.
            contact_distance: pieces nearer than this are shown as touching, metres; negative: those deeper than it.
            see_through: names of things to draw transparent, so that they do not hide the figure.
            names: whether to write the names of things beside them.
            title: of the browser's tab.
            host: name or address of this machine at which the live page is served. Any other than 127.0.0.1 allows
                access from other machines.
            port: port of the live page; 0 for the first free one from 7000.
            screenshots: a browser for the pictures of several viewers, which `close` leaves open; its own if left out.

        Raises:
            InputError: not a scene, or a value of the wrong kind or out of range.
            UnknownNameError: there is no thing of a name in `see_through`.
        """
        viewed = checked_scene(scene)
        contact_distance = checks.number(contact_distance, "contact_distance", -FARTHEST, FARTHEST, "m")
        see_through = checks.listed(see_through, "see_through", "['table']")
        for name in see_through:
            checks.known(name, viewed.objects, "object", "see_through")
        names = checks.flag(names, "names")
        checks.text(title, "title")
        self._host, self._port = checks.text(host, "host"), checks.whole(port, "port", 0, 65535)
        self.title = title
        self._graph = SceneGraph()
        self._composition = Composition(viewed, self._graph, contact_distance, tuple(see_through), names)
        self._screenshots, self._shares = screenshots or Screenshots(), screenshots is not None
        self._server: Server | None = None
        self._camera: Command | None = None
        self._seen: list[Array] = []
        self._ghosts: list[Array] = []
        self._motion: tuple[Array, float] | None = None
        self._shown: tuple[Array, Any, Sequence[Overlap]] | None = None

    def show(
        self, q: ArrayLike, *, problem: Any = None, pieces: bool = False, overlaps: Sequence[Overlap] = ()
    ) -> None:
        """Show a posture. Only changes are sent to the live page; it can be called sixty times a second.

        Args:
            q: (nq,) posture.
            problem: a `wholebody.Problem`, whose goals are drawn with their remaining errors and their
                blockers.
            pieces: draw the figure's pieces, with which contacts are measured, instead of its body's surface.
            overlaps: of whole objects, as `WorldFrame.overlaps` has them; drawn by what would part the two.

        Raises:
            InputError: q has the wrong shape or is not finite, or overlaps are none.
        """
        self._composition.pieces = checks.flag(pieces, "pieces")
        marked = checked_overlaps(overlaps, "overlaps")
        posture = self._composition.checked(q)
        found = assess(problem, posture) if isinstance(problem, Problem) else None
        keyframe = self._composition.keyframe(posture, problem, found.blockers if found else (), marked)
        self._seen, self._motion, self._shown = [posture], None, (posture, problem, marked)
        if self._graph.store.camera is None:
            self._graph.do(self._camera_command())
        self._graph.do(panel(self.title, [keyframe], 1, 1 / 30, found))
        self._graph.show(keyframe)

    def play(
        self, motion: Any, dt: float | None = None, *, problem: Any = None, ghost: Any = None, repeat: float = 1,
        pieces: bool = False, overlaps: Sequence[Sequence[Overlap]] | None = None,
    ) -> None:  # fmt: skip
        """Let the page play a motion; returns at once. The page has a bar to pause and scrub.

        Args:
            motion: postures, (n, nq) or a list of (nq,), or a clip with `q` and `dt`, and maybe `paths` within frames.
            dt: seconds from posture to posture; by default the clip's own, or 1/30.
            problem: a `wholebody.Problem` whose goals are drawn.
            ghost: the same number of postures, shown transparent; they replace earlier ghosts.
            repeat: number of times it is played; `math.inf` for ever.
            pieces: draw the figure's pieces instead of its body's surface.
            overlaps: overlaps of whole objects at each posture; see `show`.

        Raises:
            InputError: no posture, one of a wrong shape, a time step or repeats that are not positive, or other counts.
        """
        self._composition.pieces = checks.flag(pieces, "pieces")
        given = checks.listed(getattr(motion, "q", motion), "motion", "postures, each of shape (nq,)")
        postures = [self._composition.checked(q) for q in given]
        if not postures:
            raise InputError("a motion has at least one posture; give a list of postures, each of shape (nq,)")
        step = checks.time_step(getattr(motion, "dt", 1 / 30) if dt is None else dt, "dt")
        repeat = Range(1e-3, 1e9, "times", endless=True)(repeat, "repeat")
        marked = [()] * len(postures) if overlaps is None else checks.listed(overlaps, "overlaps", "[frame.overlaps]")
        if len(marked) != len(postures):
            raise InputError(
                f"overlaps has {len(marked)} entries and the motion {len(postures)} postures; give as many"
            )
        marked = [checked_overlaps(one, f"overlaps[{number}]") for number, one in enumerate(marked)]

        made, played = self._composition.keyframe, timed(postures, getattr(motion, "paths", ()), step)
        keyframes = [made(q, problem, overlaps=marked[k]) for q, k in zip(played.q, played.frames, strict=True)]
        if ghost is not None:
            followed = checks.listed(getattr(ghost, "q", ghost), "ghost", "postures, each of shape (nq,)")
            self._ghosts = self._composition.moving_ghost(keyframes, followed, LOOK.ghost, played)
        self._motion, self._shown = (np.array(postures), step), None
        # number of postures of a motion that the camera takes into account
        chosen = np.unique(np.linspace(0, len(postures) - 1, 24).astype(int))
        self._seen = [postures[index] for index in chosen]
        self._graph.do(self._camera_command())
        self._graph.do(panel(self.title, keyframes, len(postures), step))
        self._graph.play(keyframes, played.times, repeat)

    def ghosts(self, postures: Sequence[ArrayLike], *, color: Color = LOOK.ghost) -> None:
        """Show more postures of the figure, transparent; they replace earlier ghosts.

        Args:
            postures: each (nq,); none removes the ghosts.
            color: red, green, blue and, if wanted, alpha, each from 0 to 1.

        Raises:
            InputError: a posture has the wrong shape or is not finite.
        """
        given = checks.listed(postures, "postures", "[q], each of shape (nq,)")
        painted = checks.color(color, "color")
        self._ghosts = [self._composition.checked(q) for q in given]
        self._composition.ghosts(self._ghosts, painted)
        self._graph.flush()

    def frames(self, names: Sequence[str] | None = None, *, length: float = LOOK.axes_length) -> None:
        """Show the axes of frames of the figure, with their names: x red, y green, z blue.

        They are drawn at the posture that is shown, and at all that are shown or played after this call.

        Args:
            names: frames, segments or joints; by default all of the figure's frames for goals; none removes the axes.
            length: of the axes, metres.

        Raises:
            UnknownNameError: there is no frame of a name.
            InputError: the scene has no figure, or a value of the wrong kind or out of range.
        """
        figure = self._composition.figure
        given = figure.frames if names is None else checks.listed(names, "names", "['right_palm']")
        for name in given:
            figure.frame_id(name)
        self._composition.frames(given, checks.number(length, "length", 1e-3, FARTHEST, "m"))
        self._show_again()

    def color(self, segments: Mapping[str, Any]) -> None:
        """Draw the pieces of segments in colours, at the posture that is shown and at all after this call.

        Args:
            segments: segment -> red, green, blue and, if given, alpha, each 0 to 1; none takes the colours away.

        Raises:
            UnknownNameError: there is no such segment.
            InputError: the scene has no figure, or a value is no colour.
        """
        known = self._composition.figure.segments
        if not isinstance(segments, Mapping):
            raise InputError(
                f"color: segments is {checks.shown(segments)}; give colours, such as {{'head': (1, 0, 0)}}"
            )
        for name in segments:
            checks.known(name, known, "segment", "color")
        colors = {name: checks.color(given, f"color: {name}") for name, given in segments.items()}
        self._composition.segment_colors = colors
        self._show_again()

    def _show_again(self) -> None:
        if self._shown is not None:
            q, problem, overlaps = self._shown
            self.show(q, problem=problem, pieces=self._composition.pieces, overlaps=overlaps)

    def look(self, eye: ArrayLike | None = None, target: ArrayLike | None = None) -> None:
        """Set the camera; without arguments it looks at the figure.

        Args:
            eye: (3,) position of the camera, metres.
            target: (3,) the point in the middle of the picture, metres.

        Raises:
            InputError: only one of the two is given, one is not three finite numbers, or they are the same place.
        """
        if (eye is None) != (target is None):
            raise InputError("look takes an eye and a target, or neither; give both")
        camera = None
        if eye is not None and target is not None:
            here, there = checks.numbers(eye, (3,), "eye"), checks.numbers(target, (3,), "target")
            if max(np.abs(here).max(), np.abs(there).max()) > FARTHEST or np.linalg.norm(here - there) < 1e-6:
                raise InputError("look takes two different places; give an eye and a target, metres")
            camera = commands.look_from(here, there)
        self._camera = camera
        if self._seen:
            self._graph.do(self._camera_command())
            self._graph.flush()

    @property
    def url(self) -> str:
        """Address of the live page; the first call starts its server.

        Raises:
            InputError: the port is taken, or the host is no address of this machine.
        """
        return self._live().url

    def open(self) -> Viewer:
        """Show the live page in the user's browser; without a browser print its address."""
        if not webbrowser.open(self.url):
            sys.stdout.write(f"open {self.url} in a browser to see the scene\n")
        return self

    def wait(self, timeout: float = 60.0) -> bool:
        """Wait up to `timeout` seconds (`math.inf` for ever) until a browser shows the page; return whether so."""
        return self._live().wait(seconds(timeout))

    def wait_until_closed(self, timeout: float = math.inf) -> bool:
        """Wait up to `timeout` seconds until no browser shows the live page any more; return whether that is so."""
        return self._live().wait_until_closed(seconds(timeout))

    def sync(self, timeout: float = 10.0) -> bool:
        """Wait up to `timeout` seconds until every open tab has drawn everything; return whether it has."""
        return self._live().sync(seconds(timeout))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the scene as one HTML file that opens in any browser without a network, FILE.glb as glTF.

        Both have the motion that is played. glTF has the body as one skinned mesh, and all things. FILE.png is
        `picture`, which raises the same; other endings are refused. Returns the path.
        """
        place, drawn = checked_target(path, "save: path", "a scene", SAVED), self._commands()
        if place.suffix.lower() == ".png":
            return self.picture(place)
        if place.suffix.lower() == ".glb":
            postures, dt = self._motion or (np.array(self._seen[:1]), 1.0)
            return write(place, scene_glb(self._composition.scene, self._composition.bodies, postures, dt, self.title))
        return write(place, static_page(drawn, self.title))

    def __repr__(self) -> str:
        return f"Viewer({self.title!r}), which shows {len(self._seen)} postures"

    def _repr_html_(self) -> str:
        """The scene as a frame in a notebook; a sentence if nothing is shown yet."""
        if not self._seen:
            return "<p>nothing is shown yet; call show(q) or play(motion) first</p>"
        return notebook_frame(self._commands(), self.title)

    def picture(self, path: str | os.PathLike[str], size: tuple[int, int] = (960, 720), *, legend: bool = True) -> Path:
        """Write the scene as a PNG, drawn by a headless Chromium. A motion is shown at its beginning.

        Args:
            path: of the file.
            size: width and height, pixels.
            legend: whether the page's panel stands in the corner where it hides least of the figure. It is left out
                where it would be wider or higher than 45 % of the picture.

        Raises:
            InputError: nothing is shown yet, the size is out of range, or the file is no .png or cannot be written.
            MissingPackageError: there is no Chromium.
        """
        return self.begin_picture(path, size, legend=legend)()

    def begin_picture(
        self, path: str | os.PathLike[str], size: tuple[int, int] = (960, 720), *, legend: bool = True
    ) -> Callable[[], Path]:
        """Begin a `picture`, and return the function that waits for Chromium, writes it and returns the path."""
        legend = checks.flag(legend, "legend")
        place = checked_target(path, "picture: path", "a picture", (".png",))
        wanted = [command for command in self._commands() if command.op != Op.ANIMATION]
        drawn = self._screenshots.picture(wanted, size, legend=legend)
        return lambda: write(place, drawn())

    def movie(
        self, path: str | os.PathLike[str], size: tuple[int, int] = (640, 480), fps: float | None = None, *,
        progress: Callable[[int, int], Any] | None = None,
    ) -> Path:  # fmt: skip
        """Write the last played motion as a GIF or an MP4, by the ending of the path.

        Args:
            path: of the file.
            size: width and height, pixels.
            fps: pictures per second; by default the motion's own, at most 25 in a GIF and 30 in an MP4.
            progress: called after each picture with the numbers of drawn and of all pictures.

        Raises:
            InputError: no motion is shown, the ending is another, or a number is out of range.
            MissingPackageError: there is no Chromium, or no ffmpeg for an MP4.
        """
        wanted, report = self._commands(), checks.function(progress, "movie: progress")
        if self._motion is None:
            raise InputError("a movie needs a motion; call play() before movie()")
        (postures, dt), place = self._motion, check_movie(path)
        times, fps = frame_times(place, len(postures), dt, fps)
        drawn = counted(self._screenshots.pictures(wanted, size, times), len(times), report)
        return write(place, movie(place.suffix, drawn, fps))

    def close(self) -> None:
        """End the live page's server and the headless browser. Calling it again does nothing."""
        self._graph.disconnect()
        if self._server is not None:
            self._server.close()
        self._server = None
        if not self._shares:
            self._screenshots.close()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _live(self) -> Server:
        if self._server is None:
            self._server = Server(live_page(self.title), self._host, self._port)
            self._graph.connect(self._server)
        return self._server

    def _camera_command(self) -> Command:
        """The chosen camera, otherwise one that looks at the figure in its last postures."""
        return self._camera or self._composition.camera([*self._seen, *self._ghosts])

    def _commands(self) -> list[Command]:
        """Commands that draw the whole picture, with the camera on the present figure."""
        if not self._seen:
            raise InputError("nothing is shown yet; call show(q) or play(motion) first")
        camera = self._camera_command()
        return [camera if command.op == Op.CAMERA else command for command in self._graph.store.commands()]
