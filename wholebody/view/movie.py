"""A motion as a file that plays anywhere: GIF by Pillow, MP4 by ffmpeg."""

from __future__ import annotations

import io
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from wholebody.errors import InputError, MissingPackageError, WholebodyError

FASTEST = {".gif": 25.0, ".mp4": 30.0}
"""Pictures per second by default at most: GIF counts hundredths of a second, and browsers slow down beyond 50."""
_COLORS = 96


def check_movie(path: str | os.PathLike[str]) -> Path:
    """Return the path of a movie that can be written.

    Raises:
        InputError: it ends neither in .gif nor in .mp4.
        MissingPackageError: it ends in .mp4 and there is no ffmpeg.
    """
    path = Path(path)
    if path.suffix.lower() not in FASTEST:
        raise InputError(f"{path}: a movie is a .gif or a .mp4; give the file one of these endings")
    if path.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise MissingPackageError(
            f"{path}: writing MP4 needs ffmpeg; run: apt-get install ffmpeg, or write a .gif, which needs nothing"
        )
    return path


def frame_times(path: Path, count: int, dt: float, fps: float | None) -> tuple[list[float], float]:
    """When the pictures of a movie are taken, seconds from the motion's beginning, and how many there are a second.

    Args:
        path: of the movie; its ending limits the default rate.
        count: postures of the motion.
        dt: seconds from one to the next.
        fps: pictures per second, or None for the motion's own where the kind of file allows it.

    Raises:
        InputError: the rate is out of range.
    """
    if fps is None:
        fps = min(1 / dt, FASTEST[path.suffix.lower()])
    if not 0 < fps <= 100:
        raise InputError(f"fps is between 0 and 100 pictures per second, not {fps}")
    return [number / fps for number in range(math.floor((count - 1) * dt * fps + 1e-9) + 1)], fps


def write_movie(path: Path, pictures: Iterable[bytes], fps: float) -> None:
    """Write pictures (PNG) as a movie, GIF or MP4 by the ending of the path.

    Raises:
        WholebodyError: ffmpeg failed.
    """
    if path.suffix.lower() == ".gif":
        _write_gif(path, pictures, fps)
    else:
        _write_mp4(path, pictures, fps)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary file beside `path` that takes its place at the end, or vanishes if there is an error.

    Raises:
        InputError: the folder does not exist or cannot be written.
    """
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
        os.close(handle)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}; make the folder first") from None
    try:
        yield Path(name)
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(name, 0o666 & ~mask)
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise


def _write_gif(path: Path, pictures: Iterable[bytes], fps: float) -> None:
    from PIL import Image

    frames = [Image.open(io.BytesIO(picture)).convert("RGB") for picture in pictures]
    middle = frames[len(frames) // 2].quantize(_COLORS, method=Image.Quantize.MEDIANCUT)
    indexed = [frame.quantize(palette=middle, dither=Image.Dither.NONE) for frame in frames]
    indexed[0].save(path, save_all=True, append_images=indexed[1:], duration=round(1000 / fps), loop=0, optimize=False)


def _write_mp4(path: Path, pictures: Iterable[bytes], fps: float) -> None:
    command = [
        "ffmpeg",
        "-y",
        "-loglevel",
        "error",
        "-f",
        "image2pipe",
        "-c:v",
        "png",
        "-framerate",
        f"{fps:g}",
        "-i",
        "-",
    ]
    command += ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-crf", "20", "-pix_fmt", "yuv420p"]
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(
            [*command, "-movflags", "+faststart", str(path)], stdin=subprocess.PIPE, stdout=log, stderr=log
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
            raise WholebodyError(f"{path}: ffmpeg failed and said: {said[-1]}")
