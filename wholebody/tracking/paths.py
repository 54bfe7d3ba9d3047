"""Paths of dragged goals: lines, circles, and points from a file."""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import ArrayLike

from wholebody.base.arrays import Array
from wholebody.base.checks import array, is_number, number, shown, time_step, whole
from wholebody.base.checks import path as checked_path
from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.files import read_text
from wholebody.motion.clip import MOST_FRAMES
from wholebody.tasks.inputs import direction, point
from wholebody.tracking.frame import FRAME

SPEED = 0.5  # m/s: of the goal, if the number of frames is not given
LARGEST = 100.0  # m: a point farther from the origin is refused as a wrong unit


def circle(center: ArrayLike, radius: float, normal: ArrayLike = (1.0, 0.0, 0.0)) -> Array:
    """Corners (k, 3) of a closed circle, which begins and ends at its lowest point.

    Args:
        center: (3,) metres.
        radius: metres.
        normal: (3,) of its plane; x faces the figure. With a vertical normal the circle begins in front.

    Raises:
        InputError: the radius is not positive, or a value is not finite.

    Examples:
        >>> wholebody.tracking.circle((0.5, 0.0, 1.0), 0.1)[0].round(3)
        array([0.5, 0. , 0.9])
    """
    middle, axis = point(center, "circle: center"), direction(normal, "circle: normal")
    radius = number(radius, "circle: radius", 1e-6, LARGEST, "m")  # m: smallest circle
    down = np.array((0.0, 0.0, -1.0)) if abs(axis[2]) < 0.99 else np.array((1.0, 0.0, 0.0))
    first = down - (down @ axis) * axis
    first /= np.linalg.norm(first)
    angle = np.linspace(0.0, 2.0 * np.pi, 73)[:, None]  # a polygon of 72 sides
    corners: Array = middle + radius * (np.cos(angle) * first + np.sin(angle) * np.cross(axis, first))
    return corners


def read_path(path: str | os.PathLike[str]) -> Array:
    """Read points (k, 3) from a text file: x, y and z in metres, one point a line, separated by commas or spaces.

    Empty lines, comments after #, and a first line of names are ignored. Raises FileFormatError for a file without
    points, or a line that is none and is named.

    Examples:
        >>> _ = (folder / "corners.csv").write_text("0.4, 0, 1")
        >>> wholebody.tracking.read_path(folder / "corners.csv")
        array([[0.4, 0. , 1. ]])
    """
    path = checked_path(path, "path")
    text = read_text(path, "path")
    lines = {number: said.partition("#")[0].strip() for number, said in enumerate(text.splitlines(), start=1)}
    told = [(f"{path}, line {number}", said) for number, said in lines.items() if said]
    if told and not any(is_number(word) for word in _words(told[0][1])):
        told = told[1:]
    places = [_place(*line) for line in told]
    if not places:
        raise FileFormatError(f"{path}: it holds no places; give x y z in metres, one place a line")
    return np.array(places)


def spread(corners: ArrayLike, frames: int | None = None, dt: float = FRAME) -> Array:
    """Evenly spaced points (n, 3) of a path, with its end and without its beginning.

    Args:
        corners: (k, 3) of the path, metres.
        frames: number of points; by default as many as give half a metre a second.
        dt: seconds a frame.

    Raises:
        InputError: the corners are no path, or frames is not positive.

    Examples:
        >>> wholebody.tracking.spread([(0.0, 0.0, 0.0), (0.0, 0.0, 0.1)], frames=2)[:, 2]
        array([0.05, 0.1 ])
    """
    given = array(corners, "path", "at least two corners, shape (k, 3), metres")
    if given.ndim != 2 or given.shape[1] != 3 or len(given) < 2:
        raise InputError(f"a path has shape {given.shape}; give at least two corners, shape (k, 3), metres")
    places = np.array([point(corner, f"corners[{place}]") for place, corner in enumerate(given)])
    if frames is not None:
        frames = whole(frames, "frames", 1, MOST_FRAMES)
    dt = time_step(dt, "dt")
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    if frames is None and way[-1] / (SPEED * dt) > MOST_FRAMES:
        raise InputError(f"dt of {dt:g} s makes more than {MOST_FRAMES} frames of this path; make it larger")
    count = frames if frames is not None else max(1, int(np.ceil(way[-1] / (SPEED * dt))))
    at = way[-1] * np.arange(1, count + 1) / count
    return np.stack([np.interp(at, way, places[:, axis]) for axis in range(3)], axis=1)


def _words(text: str) -> list[str]:
    return text.replace(",", " ").replace(";", " ").split()


def _place(where: str, text: str) -> list[float]:
    words = _words(text)
    if len(words) != 3 or not all(map(is_number, words)):
        raise FileFormatError(f"{where}: {shown(text)} is not a place; give x y z in metres")
    values = [float(word) for word in words]
    if not all(abs(value) <= LARGEST for value in values):
        raise FileFormatError(f"{where}: {shown(text)} is not within {LARGEST:g} m of the origin; give metres")
    return values
