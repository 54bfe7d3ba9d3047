"""A motion as a file that plays anywhere: GIF by Pillow, MP4 by ffmpeg."""

from __future__ import annotations

import io
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wholebody.base.checks import number
from wholebody.base.errors import MissingPackageError, WholebodyError
from wholebody.base.files import Scratch, checked_target

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
