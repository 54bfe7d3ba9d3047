"""The viewer: a scene in Meshcat, live in the browser, as a file that opens offline, as a picture or a movie."""

from __future__ import annotations

import math
import os
import webbrowser
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wholebody.errors import InputError
from wholebody.figures.state import State
from wholebody.view import style
from wholebody.view.aim import aim
from wholebody.view.bodies import Bodies
from wholebody.view.browser import Browser
from wholebody.view.commands import look
from wholebody.view.goals import Goals
from wholebody.view.movie import GIF_FASTEST, check_movie, replacing, write_movie
from wholebody.view.page import live_page, static_page
from wholebody.view.sender import Sender
from wholebody.view.server import ANIMATION, CAMERA, Command
from wholebody.view.stage import Marker, Moment, Stage
from wholebody.view.subject import Subject
from wholebody.view.touches import color_contacts, mark_contacts

Array = NDArray[np.float64]

DEFAULT_DT = 1 / 30  # s: postures without a time step
MP4_FPS = 30.0
LARGEST_PICTURE = 8192  # pixels: no software renderer goes beyond
AIMED_AT = 24  # postures of a motion that the camera takes into account


class Viewer:
    """Shows a scene: the posture, ghosts, contacts and penetrations, goals and their errors.

    Nothing is started until it is needed: `open` or `url` start the live page, `picture` and `movie` a headless Chromium,
    and `save` neither. In the page's controls every folder (figure, objects, contacts, goals, names, ghosts) can be
    switched off.

    Pieces turn orange where they come nearer than `contact_distance` to each other and red where they are inside each other.

    Example:
        >>> with Viewer(scene) as viewer:          # doctest: +SKIP
        ...     viewer.show(q, problem=problem)
        ...     viewer.picture("scene.png")
    """

    def __init__(
        self,
        scene: Subject,
        *,
        contact_distance: float = 0.005,
        see_through: Collection[str] = (),
        names: bool = False,
        title: str = "wholebody",
    ) -> None:
        """Prepare to show a scene.

        Args:
            scene: a `wholebody.Scene`.
            contact_distance: pieces nearer than this are shown as touching, metres.
            see_through: names of things to draw transparent because they would hide the figure.
            names: write the names of things beside them.
            title: of the browser's tab.

        Raises:
            InputError: the distance is not a finite number, or there is no thing of a name in `see_through`.
        """
        if not math.isfinite(contact_distance):
            raise InputError(f"contact_distance is a finite distance in metres, not {contact_distance}")
        for name in see_through:
            if name not in scene.objects:
                raise InputError(f"see_through: the scene has no thing {name!r}; it has {', '.join(scene.objects) or 'none'}")
        self.scene = scene
        self.contact_distance = contact_distance
        self.names = names
        self.title = title
        self._see_through = tuple(see_through)
        self._stage = Stage()
        self._bodies: Bodies | None = None
        self._state = State(scene.model)
        self._goals: Goals | None = None
        self._camera: Command | None = None
        self._seen: list[Array] = []
        self._motion: tuple[int, float] | None = None
        self._sender: Sender | None = None
        self._browser: Browser | None = None

    # ---- what is shown

    def show(self, q: ArrayLike, *, problem: Any = None) -> None:
        """Show a posture. Only what changed is sent to the live page; it can be called sixty times a second.

        Args:
            q: (nq,) posture.
            problem: a `wholebody.Problem` whose goals are drawn with what is left of them.

        Raises:
            InputError: q has the wrong shape or is not finite.
        """
        moment = self._moment(np.asarray(q, dtype=float), problem)
        self._motion = None
        self._seen = [np.array(q, dtype=float)]
        if self._stage.store.camera is None:
            self._stage.do(self._aim())
        self._stage.show(moment)

    def play(self, motion: Any, dt: float | None = None, *, problem: Any = None, repeat: float = 1) -> None:
        """Let the page play a motion; returns at once. The page has a bar to pause and scrub.

        Args:
            motion: postures, (n, nq) or a list of (nq,), or a clip with `q` and `dt`.
            dt: seconds from posture to posture; the clip's own, or 1/30, when left out.
            problem: a `wholebody.Problem` whose goals are drawn.
            repeat: how often it is played; `math.inf` for ever.

        Raises:
            InputError: there is no posture, one has the wrong shape, or the time step is not positive.
        """
        postures = np.asarray(getattr(motion, "q", motion), dtype=float)
        if postures.ndim != 2 or not len(postures):
            raise InputError(f"a motion is postures of shape (n, nq) with n > 0, not {postures.shape}; give a list of postures")
        step = float(getattr(motion, "dt", DEFAULT_DT) if dt is None else dt)
        if not (math.isfinite(step) and step > 0):
            raise InputError(f"dt is a positive number of seconds, not {step}")
        moments = [self._moment(q, problem) for q in postures]
        chosen = np.unique(np.linspace(0, len(postures) - 1, AIMED_AT).astype(int))
        self._seen = [postures[index] for index in chosen]
        self._motion = (len(postures), step)
        self._stage.do(self._aim())
        self._stage.play(moments, step, repeat)

    def ghosts(
        self, postures: Sequence[ArrayLike], *, color: style.Color = style.GHOST
    ) -> None:
        """Show more postures of the figure, transparent; in place of the ghosts that were there.

        Args:
            postures: each (nq,); none removes the ghosts.
            color: red, green, blue, alpha from 0 to 1.

        Raises:
            InputError: a posture has the wrong shape or is not finite.
        """
        bodies = self._build()
        self._stage.remove(style.GHOST_NODE)
        for number, q in enumerate(postures):
            self._state.update(np.asarray(q, dtype=float))
            bodies.ghost(self._stage, number, self._state.data, color)
        self._stage.flush()

    def look(self, eye: ArrayLike | None = None, target: ArrayLike | None = None) -> None:
        """Aim the camera; without arguments at the figure as it is shown.

        Args:
            eye: (3,) where the camera is, metres.
            target: (3,) what is in the middle of the picture, metres.

        Raises:
            InputError: only one of the two is given, one is not three finite numbers, or they are the same place.
        """
        if (eye is None) != (target is None):
            raise InputError("look takes an eye and a target, or neither; give both")
        if eye is None or target is None:
            self._camera = None
        else:
            places = [np.asarray(place, dtype=float) for place in (eye, target)]
            if any(place.shape != (3,) or not np.isfinite(place).all() for place in places) or np.allclose(*places):
                raise InputError(f"look takes two different places of three finite numbers, not {eye} and {target}")
            self._camera = look(places[1], style.FIELD_OF_VIEW, eye=places[0])
        if self._seen:
            self._stage.do(self._aim())
            self._stage.flush()

    # ---- live

    @property
    def url(self) -> str:
        """Address of the live page, on this machine only; starts its server when first asked for.

        Raises:
            ViewerClosedError: the server could not be started.
        """
        if self._sender is None:
            self._sender = Sender(live_page(self.title))
            self._stage.connect(self._sender)
        return self._sender.url

    def open(self) -> Viewer:
        """Show the live page in the user's browser, and print its address in case there is none."""
        url = self.url
        print(f"the scene is at {url}")
        webbrowser.open(url)
        return self

    def wait(self, timeout: float = 60.0) -> bool:
        """Wait until a browser shows the live page.

        Args:
            timeout: seconds.

        Returns:
            Whether one does.
        """
        return self._live().wait(timeout)

    def wait_until_closed(self, timeout: float = math.inf) -> bool:
        """Wait until the last browser tab with the live page is closed (or Ctrl-C).

        Args:
            timeout: seconds.

        Returns:
            Whether it is closed.
        """
        return self._live().wait_until_closed(timeout)

    def sync(self, timeout: float = 10.0) -> bool:
        """Wait until every open tab has drawn all that was shown.

        Args:
            timeout: seconds.

        Returns:
            Whether they have.
        """
        return self._live().sync(timeout)

    def _live(self) -> Sender:
        _ = self.url
        assert self._sender is not None
        return self._sender

    # ---- files

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write what is shown as one HTML file that opens in any browser without a network, motion included.

        Returns:
            The path.

        Raises:
            InputError: nothing is shown yet, or the file cannot be written.
        """
        self._shown()
        path = Path(path)
        with replacing(path) as temporary:
            temporary.write_text(static_page(self._commands(), self.title), encoding="utf-8")
        return path

    def picture(self, path: str | os.PathLike[str], size: tuple[int, int] = (960, 720)) -> Path:
        """Write what is shown as a PNG, drawn by a headless Chromium. A motion is shown at its beginning.

        Args:
            path: of the file.
            size: width and height, pixels.

        Returns:
            The path.

        Raises:
            InputError: nothing is shown yet, the size is out of range, or the file cannot be written.
            MissingPackageError: there is no Chromium.
        """
        self._shown()
        path = Path(path)
        with replacing(path) as temporary:
            page = static_page([command for command in self._commands() if command.op != ANIMATION])
            temporary.write_bytes(self._opened(page, size).capture())
        return path

    def movie(self, path: str | os.PathLike[str], size: tuple[int, int] = (640, 480), fps: float | None = None) -> Path:
        """Write the motion that was played last as a GIF or an MP4, by the ending of the path.

        Args:
            path: of the file.
            size: width and height, pixels.
            fps: pictures per second; at most 25 for a GIF and 30 for an MP4 when left out.

        Returns:
            The path.

        Raises:
            InputError: no motion is shown, the ending is another, or a number is out of range.
            MissingPackageError: there is no Chromium, or no ffmpeg for an MP4.
        """
        self._shown()
        path = check_movie(path)
        if self._motion is None:
            raise InputError("a movie needs a motion; call play() before movie()")
        count, dt = self._motion
        if fps is None:
            fps = min(1 / dt, GIF_FASTEST if path.suffix.lower() == ".gif" else MP4_FPS)
        if not (math.isfinite(fps) and 0 < fps <= 100):
            raise InputError(f"fps is between 0 and 100 pictures per second, not {fps}")
        browser = self._opened(static_page(self._commands()), size)
        pictures = math.floor((count - 1) * dt * fps + 1e-9) + 1

        def frames() -> Iterator[bytes]:
            for number in range(pictures):
                browser.evaluate(f"wholebody.seek({number / fps!r})")
                yield browser.capture()

        write_movie(path, frames(), fps)
        return path

    def close(self) -> None:
        """End the live page's server and the headless browser. Doing it again does nothing."""
        self._stage.disconnect()
        if self._sender is not None:
            self._sender.close()
        if self._browser is not None:
            self._browser.close()
        self._sender = self._browser = None

    def __enter__(self) -> Viewer:
        """Return the viewer."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    # ---- inside

    def _build(self) -> Bodies:
        """Draw the pieces, anew if things came or went."""
        if self._bodies is None or self._bodies.revision != self.scene.revision:
            self._bodies = Bodies(self.scene, self._see_through)
            self._bodies.build(self._stage)
        return self._bodies

    def _moment(self, q: Array, problem: Any) -> Moment:
        bodies = self._build()
        state = self._state.update(q)
        moment = Moment()
        bodies.pose(moment, state.data)
        contacts = self.scene.contacts(q, within=self.contact_distance)
        color_contacts(moment, bodies, contacts)
        mark_contacts(moment, bodies, contacts)
        self._goals = Goals(self.scene, problem) if problem is not None else None
        if self._goals is not None:
            self._goals.mark(moment, state)
        if self.names:
            for path, (name, top) in bodies.tops(state.data).items():
                matrix = np.eye(4)
                matrix[:3, 3] = top
                moment.markers[path] = (Marker("label", style.LABEL, style.LABEL_SIZE, name), matrix)
        return moment

    def _aim(self) -> Command:
        """The camera that was asked for, else one that looks at the figure in what was shown last."""
        if self._camera is not None:
            return self._camera
        bodies, figure, things = self._build(), [], []
        for q in self._seen:
            state = self._state.update(q)
            figure.append(bodies.corners(state.data, things=False))
            things.append(bodies.corners(state.data, things=True))
            if self._goals is not None:
                figure.append(self._goals.targets(state))
        return aim(np.concatenate(figure), np.concatenate(things))

    def _commands(self) -> list[Command]:
        """What draws the picture anew, with the camera on the figure as it is now."""
        return [self._aim() if command.op == CAMERA else command for command in self._stage.store.commands()]

    def _shown(self) -> None:
        if not self._seen:
            raise InputError("nothing is shown yet; call show(q) or play(motion) first")

    def _opened(self, page: str, size: tuple[int, int]) -> Browser:
        """The headless browser with this page in it."""
        if len(size) != 2 or not all(isinstance(n, (int, np.integer)) and 16 <= n <= LARGEST_PICTURE for n in size):
            raise InputError(f"size is width and height from 16 to {LARGEST_PICTURE} pixels, not {size}")
        if self._browser is None:
            self._browser = Browser()
        self._browser.resize((int(size[0]), int(size[1])))
        self._browser.open_html(page)
        return self._browser
