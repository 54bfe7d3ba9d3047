"""Pictures of the drawing by one headless browser, which gets only what changed since the last; movies of pictures."""

from __future__ import annotations

import base64
import io
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wholebody.base.checks import listed, number, shown, whole
from wholebody.base.errors import InputError, MissingPackageError, WholebodyError
from wholebody.base.files import Scratch, checked_target
from wholebody.view import commands
from wholebody.view.browser import Browser
from wholebody.view.page import picture_page
from wholebody.view.server import Command, Op, Store, bundle
from wholebody.view.style import LOOK


def check_size(size: Any) -> tuple[int, int]:
    """Width and height of a picture, pixels; raises InputError for what is not two whole numbers in range."""
    given = listed(size, "size", "(960, 720), pixels")
    if len(given) != 2:
        raise InputError(f"size is {shown(size)}; give width and height, pixels")
    most = 8192  # pixels: limit of software renderers
    return whole(given[0], "the width of size", 16, most), whole(given[1], "the height of size", 16, most)


def changes(before: Store, wanted: Sequence[Command]) -> list[Command] | None:
    """The commands that a page with `before` lacks; None where nodes go or bodies change: it is built anew."""
    after = Store()
    for command in wanted:
        after.apply(command)
    for path, node in before.nodes.items():
        now = after.nodes.get(path)
        if now is None or not node.properties.keys() <= now.properties.keys():
            return None
        body = path.startswith((LOOK.figure_node, LOOK.ghost_node))
        if (node.object is not None and (now.object is None or (body and now.object != node.object))) or (
            node.transform is not None and now.transform is None
        ):
            return None
    found = [commands.stop_animation()] if before.animation not in (None, after.animation) else []
    remade = {command.path for command in wanted if command.op == Op.OBJECT and not before.has(command)}
    for command in wanted:
        if command.op == Op.ANIMATION:
            if command.payload != before.animation:
                found.append(command)
        elif command.op == Op.CAMERA or command.path in remade or not before.has(command):
            found.append(command)
    return found


class Screenshots:
    """A headless browser that takes pictures; one can serve several viewers."""

    def __init__(self) -> None:
        self._browser: Browser | None = None
        self._shown: Store | None = None

    def start(self) -> None:
        """Start the browser, if there is a Chromium, without waiting for it."""
        with suppress(MissingPackageError):
            self._started()

    def picture(self, wanted: Sequence[Command], size: Any, *, legend: bool = False) -> Callable[[], bytes]:
        """Begin to draw commands in an empty page, with the panel if wanted; what is returned waits for the PNG."""
        return self._draw(wanted, size).capturing(legend=legend)

    def pictures(self, wanted: Sequence[Command], size: Any, times: Iterable[float]) -> Iterator[bytes]:
        """PNGs at these times of a motion, seconds; raises like `picture`, before the first."""
        browser = self._draw(wanted, size)
        return (browser.capture(f"wholebody.seek({time!r})") for time in times)

    def close(self) -> None:
        """End the browser. Calling it again does nothing."""
        if self._browser is not None:
            self._browser.close()
        self._browser = self._shown = None

    def __enter__(self) -> Screenshots:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _started(self) -> Browser:
        if self._browser is None:
            self._browser, self._shown = Browser(page=picture_page()), Store()
        return self._browser

    def _draw(self, wanted: Sequence[Command], size: Any) -> Browser:
        """Bring the page to what the commands draw."""
        width, height = check_size(size)
        browser, before = self._started(), self._shown
        browser.resize((width, height))
        self._shown = None  # until all is drawn: after an error the next picture is drawn whole
        lacking = None if before is None else changes(before, wanted)
        if lacking is None or before is None:
            browser.open_html(picture_page())
            before, lacking = Store(), list(wanted)
        data = base64.b64encode(bundle([command.payload for command in lacking])).decode("ascii")
        browser.evaluate(f"wholebody.resize({width}, {height}); wholebody.take(wholebody.bytes('{data}')); 0")
        for command in lacking:
            before.apply(command)
        self._shown = before
        return browser


FASTEST = {".gif": 25.0, ".mp4": 30.0}
"""Largest default pictures per second: GIF times are hundredths of a second, and browsers slow down beyond 50."""


def check_movie(path: str | os.PathLike[str]) -> Path:
    """The path of a movie, .gif or .mp4, that can be written; MissingPackageError without ffmpeg."""
    path = checked_target(path, "movie: path", "a movie", FASTEST)
    if path.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise MissingPackageError(
            f"{path}: writing MP4 needs ffmpeg; run: apt-get install ffmpeg, or write a .gif, which needs nothing"
        )
    return path


def frame_times(path: Path, count: int, dt: float, fps: float | None) -> tuple[list[float], float]:
    """Times [s] of the pictures of `count` postures, and the rate per second: `fps`, or the motion's own."""
    if fps is None:
        fps = min(1 / dt, FASTEST[path.suffix.lower()])
    fps = number(fps, "fps", 0.01, 100.0, "pictures per second")
    return [number / fps for number in range(math.floor((count - 1) * dt * fps + 1e-9) + 1)], fps


def counted(pictures: Iterable[bytes], total: int, progress: Callable[[int, int], Any] | None) -> Iterator[bytes]:
    """The pictures, and a call with the numbers of drawn and of all ones after each."""
    for drawn, picture in enumerate(pictures, start=1):
        yield picture
        if progress is not None:
            progress(drawn, total)


def movie(suffix: str, pictures: Iterable[bytes], fps: float) -> bytes:
    """Pictures (PNG) as a movie, GIF or MP4 by the ending of its file; raises WholebodyError where ffmpeg failed."""
    return _gif(pictures, fps) if suffix.lower() == ".gif" else _mp4(pictures, fps)


def _gif(pictures: Iterable[bytes], fps: float) -> bytes:
    from PIL import Image

    frames = [Image.open(io.BytesIO(picture)).convert("RGB") for picture in pictures]
    palette = Image.fromarray(_swatch([frames[0], frames[len(frames) // 2], frames[-1]]))
    palette = palette.quantize(256, method=Image.Quantize.MEDIANCUT)
    indexed = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    made, rest = io.BytesIO(), indexed[1:]
    indexed[0].save(
        made, "GIF", save_all=True, append_images=rest, duration=round(1000 / fps), loop=0, optimize=False
    )  # fmt: skip
    return made.getvalue()


def _swatch(frames: Sequence[Any]) -> NDArray[np.uint8]:
    """An image (rows, 64, 3) from which a palette is chosen: half the frames' pixels, half their colours alike."""
    # By the pixels alone nearly all colours would go to sky and floor, and a face would be grey.
    # pixels, of which one counts for the palette: all of them take half a second
    pixels = np.concatenate([np.asarray(frame).reshape(-1, 3)[::7] for frame in frames])
    _, first = np.unique(pixels >> 3, axis=0, return_index=True)
    kinds = np.repeat(pixels[first], len(pixels) // len(first) + 1, axis=0)
    every = np.concatenate([pixels, kinds])
    return np.resize(every, (-(-len(every) // 64), 64, 3))


def _mp4(pictures: Iterable[bytes], fps: float) -> bytes:
    options = (
        f"-y -loglevel error -f image2pipe -c:v png -framerate {fps:g} -i - "
        "-vf pad=ceil(iw/2)*2:ceil(ih/2)*2 -c:v libx264 -crf 20 -pix_fmt yuv420p -movflags +faststart"
    )
    with Scratch() as folder, tempfile.TemporaryFile() as log:
        path = folder / "movie.mp4"  # ffmpeg moves the index to the front at the end, which requires a file
        process = subprocess.Popen(
            ["ffmpeg", *options.split(), str(path)], stdin=subprocess.PIPE, stdout=log, stderr=log
        )
        try:
            assert process.stdin is not None
            for picture in pictures:
                process.stdin.write(picture)
            process.stdin.close()
        except BrokenPipeError:
            pass
        except BaseException:
            process.kill()
            process.wait()
            raise
        if process.wait() != 0:
            log.seek(0)
            said = log.read().decode(errors="replace").strip().splitlines() or ["nothing"]
            raise WholebodyError(f"the movie: ffmpeg failed and said: {said[-1]}")
        return path.read_bytes()
