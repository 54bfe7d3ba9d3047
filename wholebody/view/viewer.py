"""The viewer: a scene in Meshcat, live in the browser, as a file that opens offline, as a picture or a movie."""

from __future__ import annotations

import math
import os
import sys
import webbrowser
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wholebody.assessment import assess
from wholebody.errors import InputError, UnknownNameError
from wholebody.view import style
from wholebody.view.commands import look
from wholebody.view.composition import Composition
from wholebody.view.movie import check_movie, frame_times, replacing, write_movie
from wholebody.view.page import live_page, static_page
from wholebody.view.sender import Sender
from wholebody.view.server import ANIMATION, CAMERA, Command
from wholebody.view.stage import Stage
from wholebody.view.studio import Studio
from wholebody.view.subject import Subject

Array = NDArray[np.float64]

DEFAULT_DT = 1 / 30  # s: postures without a time step
AIMED_AT = 24  # postures of a motion that the camera takes into account


class Viewer:
    """Shows a scene: the posture, ghosts, contacts and penetrations, goals and their errors.

    Nothing is started until it is needed: `open` or `url` start the live page, `picture` and `movie` a headless
    Chromium, `save` neither. In the page's controls every folder (figure, objects, contacts, goals, names, ghosts) can
    be switched off.

    Pieces turn orange where they come nearer than `contact_distance` to each other, and red where they are inside each
    other; things are tinted, half-spaces keep their colour. A blue arrow is a contact's normal, from the first piece to
    the second; a dark red one is the way out of a penetration.

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
            InputError: the distance is not a finite number.
            UnknownNameError: there is no thing of a name in `see_through`.
        """
        if not math.isfinite(contact_distance):
            raise InputError(f"contact_distance is a finite distance in metres, not {contact_distance}")
        for name in see_through:
            if name not in scene.objects:
                raise UnknownNameError("object", name, scene.objects, "see_through")
        self.title = title
        self._stage = Stage()
        self._composition = Composition(scene, self._stage, contact_distance, tuple(see_through), names)
        self._studio = Studio()
        self._sender: Sender | None = None
        self._camera: Command | None = None
        self._seen: list[Array] = []
        self._ghosts: list[Array] = []
        self._motion: tuple[int, float] | None = None

    # ---- what is shown

    def show(self, q: ArrayLike, *, problem: Any = None) -> None:
        """Show a posture. Only what changed is sent to the live page; it can be called sixty times a second.

        Args:
            q: (nq,) posture.
            problem: a `wholebody.Problem` whose goals are drawn with what is left of them, and what stands in their
                way.

        Raises:
            InputError: q has the wrong shape or is not finite.
        """
        posture = self._composition.checked(q)
        blockers = () if problem is None else assess(problem, posture).blockers
        moment = self._composition.moment(posture, problem, blockers)
        self._seen, self._motion = [posture], None
        if self._stage.store.camera is None:
            self._stage.do(self._aim())
        self._stage.show(moment)

    def play(
        self, motion: Any, dt: float | None = None, *, problem: Any = None, ghost: Any = None, repeat: float = 1
    ) -> None:
        """Let the page play a motion; returns at once. The page has a bar to pause and scrub.

        Args:
            motion: postures, (n, nq) or a list of (nq,), or a clip with `q` and `dt`.
            dt: seconds from posture to posture; the clip's own, or 1/30, when left out.
            problem: a `wholebody.Problem` whose goals are drawn.
            ghost: as many postures more, shown transparent beside them; in place of the ghosts that were there.
            repeat: how often it is played; `math.inf` for ever.

        Raises:
            InputError: there is no posture, one has the wrong shape, or the time step or the repeats are not positive.
        """
        postures = [self._composition.checked(q) for q in getattr(motion, "q", motion)]
        step = float(getattr(motion, "dt", DEFAULT_DT) if dt is None else dt)
        if not postures:
            raise InputError("a motion has at least one posture; give a list of postures, each of shape (nq,)")
        if not (math.isfinite(step) and step > 0 and repeat > 0):
            raise InputError(f"dt and repeat are positive, not {step} s and {repeat}")
        moments = [self._composition.moment(q, problem) for q in postures]
        if ghost is not None:
            self._ghosts = self._composition.moving_ghost(moments, getattr(ghost, "q", ghost), style.GHOST)
        self._motion = (len(postures), step)
        chosen = np.unique(np.linspace(0, len(postures) - 1, AIMED_AT).astype(int))
        self._seen = [postures[index] for index in chosen]
        self._stage.do(self._aim())
        self._stage.play(moments, step, repeat)

    def ghosts(self, postures: Sequence[ArrayLike], *, color: style.Color = style.GHOST) -> None:
        """Show more postures of the figure, transparent; in place of the ghosts that were there.

        Args:
            postures: each (nq,); none removes the ghosts.
            color: red, green, blue, alpha from 0 to 1.

        Raises:
            InputError: a posture has the wrong shape or is not finite.
        """
        self._ghosts = [self._composition.checked(q) for q in postures]
        self._composition.ghosts(self._ghosts, color)
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
        self._camera = None
        if eye is not None and target is not None:
            here, there = np.asarray(eye, dtype=float), np.asarray(target, dtype=float)
            if not (here.shape == there.shape == (3,) and 1e-6 < np.linalg.norm(here - there) < math.inf):
                raise InputError(f"look takes two different places of three finite numbers, not {eye} and {target}")
            self._camera = look(there, style.FIELD_OF_VIEW, eye=here)
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
        return self._live().url

    def open(self) -> Viewer:
        """Show the live page in the user's browser; where there is none, say its address."""
        if not webbrowser.open(self.url):
            sys.stdout.write(f"open {self.url} in a browser to see the scene\n")
        return self

    def wait(self, timeout: float = 60.0) -> bool:
        """Wait up to `timeout` seconds until a browser shows the live page; return whether one does."""
        return self._live().wait(timeout)

    def wait_until_closed(self, timeout: float = math.inf) -> bool:
        """Wait up to `timeout` seconds until no browser shows the live page any more; return whether that is so."""
        return self._live().wait_until_closed(timeout)

    def sync(self, timeout: float = 10.0) -> bool:
        """Wait up to `timeout` seconds until every open tab has drawn all that was shown; return whether they have."""
        return self._live().sync(timeout)

    # ---- files

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write what is shown as one HTML file that opens in any browser without a network, motion included.

        Returns:
            The path.

        Raises:
            InputError: nothing is shown yet, or the file cannot be written.
        """
        page = static_page(self._commands(), self.title)
        with replacing(Path(path)) as temporary:
            temporary.write_text(page, encoding="utf-8")
        return Path(path)

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
        page = static_page([command for command in self._commands() if command.op != ANIMATION])
        with replacing(Path(path)) as temporary:
            temporary.write_bytes(self._studio.picture(page, size))
        return Path(path)

    def movie(self, path: str | os.PathLike[str], size: tuple[int, int] = (640, 480), fps: float | None = None) -> Path:
        """Write the motion that was played last as a GIF or an MP4, by the ending of the path.

        Args:
            path: of the file.
            size: width and height, pixels.
            fps: pictures per second; when left out the motion's own, at most 25 in a GIF and 30 in an MP4.

        Returns:
            The path.

        Raises:
            InputError: no motion is shown, the ending is another, or a number is out of range.
            MissingPackageError: there is no Chromium, or no ffmpeg for an MP4.
        """
        page = static_page(self._commands())
        if self._motion is None:
            raise InputError("a movie needs a motion; call play() before movie()")
        count, dt = self._motion
        path = check_movie(path)
        times, fps = frame_times(path, count, dt, fps)
        with replacing(path) as temporary:
            write_movie(temporary, self._studio.pictures(page, size, times), fps)
        return path

    def close(self) -> None:
        """End the live page's server and the headless browser. Doing it again does nothing."""
        self._stage.disconnect()
        if self._sender is not None:
            self._sender.close()
        self._sender = None
        self._studio.close()

    def __enter__(self) -> Viewer:
        """Return the viewer."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    # ---- inside

    def _live(self) -> Sender:
        if self._sender is None:
            self._sender = Sender(live_page(self.title))
            self._stage.connect(self._sender)
        return self._sender

    def _aim(self) -> Command:
        """The camera that was asked for, else one that looks at the figure in what was shown last."""
        return self._camera or self._composition.aim([*self._seen, *self._ghosts])

    def _commands(self) -> list[Command]:
        """What draws the picture anew, with the camera on the figure as it is now."""
        if not self._seen:
            raise InputError("nothing is shown yet; call show(q) or play(motion) first")
        return [self._aim() if command.op == CAMERA else command for command in self._stage.store.commands()]
