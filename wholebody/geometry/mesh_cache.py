"""Cache of convex pieces of meshes, and of what else takes seconds to make, on disk: loading takes milliseconds.

An entry is one file, named by a hash of the mesh and the settings. It is written under a temporary name and renamed, so
any number of processes may read and write at once. It begins with its checksum; an entry whose checksum does not match
is discarded. If the folder is not writable, nothing is cached.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wholebody.base.records import with_values
from wholebody.geometry.hull import coal_convex
from wholebody.geometry.pieces import Piece
from wholebody.version import __version__

T = TypeVar("T")

VARIABLE = "WHOLEBODY_CACHE"
"""Environment variable that names another folder for the cache."""

LARGEST_CACHE = 256 * 2**20
"""Largest size of the cache, bytes; a mesh as hull takes 3 kB, a decomposition 20 kB."""


LOOKED_AT_EVERY = 64
"""Number of writes of a process between checks of the cache's size; the first write checks it too."""


_SUFFIX = ".pieces"
_OTHER = ".made"
_PART = ".part"
_CHECKSUM = hashlib.sha256().digest_size

_writes = 0


class ConvexPieces(NamedTuple):
    """A mesh as a union of convex pieces.

    Attributes:
        pieces: at least one.
        added_volume: volume of all pieces over the volume of the mesh, minus one; parts that are not closed do not
            count, since they have no volume of their own.
        notes: one sentence for each part that was changed.
    """

    pieces: tuple[Piece, ...]
    added_volume: float
    notes: tuple[str, ...]


class CacheState(NamedTuple):
    """The state of the cache.

    Attributes:
        folder: its folder.
        entries: number of cached meshes and surfaces.
        size: bytes.
        writable: whether this process can write there.
    """

    folder: Path
    entries: int
    size: int
    writable: bool


def cache_folder() -> Path:
    """Return the folder of the cache, which need not exist: the user's cache folder, or that of `VARIABLE`."""
    import platformdirs

    named = os.environ.get(VARIABLE)
    if named:
        return Path(named)
    return Path(platformdirs.user_cache_path("wholebody", appauthor=False)) / "convex-pieces"


def cached(content: tuple[bytes, ...], settings: str, what: str, make: Callable[[], ConvexPieces]) -> ConvexPieces:
    """Return pieces from the cache, or make and cache them.

    Args:
        content: the data that the pieces are made from.
        settings: the settings, with the versions of the libraries.
        what: name of the mesh, with which all notes begin; the cache does not depend on it.
        make: makes the pieces.
    """
    digest = hashlib.sha256("\0".join(("1", __version__, settings)).encode())
    for part in content:
        digest.update(hashlib.sha256(part).digest())
    path = cache_folder() / f"{digest.hexdigest()}{_SUFFIX}"
    found = _read(path, _unpacked)
    if found is not None:
        return with_values(found, notes=tuple(what + note for note in found.notes))
    made = make()
    _write(path, _packed(with_values(made, notes=tuple(note.removeprefix(what) for note in made.notes))))
    return made


def cached_entry(key: str, make: Callable[[], T], packed: Callable[[T], bytes], unpacked: Callable[[bytes], T]) -> T:
    """Return something from the cache, or make and cache it; both times it is what `unpacked` reads.

    Args:
        key: hexadecimal digest of what it is made from, and of the way it is made.
        make: makes it.
        packed: its bytes.
        unpacked: what the bytes say.
    """
    path = cache_folder() / f"{key}{_OTHER}"
    found = _read(path, unpacked)
    if found is not None:
        return found
    data = packed(make())
    _write(path, data)
    return unpacked(data)


def cache_state() -> CacheState:
    """Look at the cache."""
    folder = cache_folder()
    files = _entries(folder)
    place = folder
    while not place.exists() and place != place.parent:
        place = place.parent
    return CacheState(folder, len(files), sum(size for _, size, _ in files), os.access(place, os.W_OK | os.X_OK))


def clear_cache() -> CacheState:
    """Remove all entries; return the state before."""
    state = cache_state()
    for file in [file for ending in (_SUFFIX, _OTHER, _PART) for file in state.folder.glob(f"*{ending}")]:
        file.unlink(missing_ok=True)
    return state


def _read(path: Path, unpacked: Callable[[bytes], T]) -> T | None:
    try:
        data = path.read_bytes()
    except OSError:
        return None
    try:
        if hashlib.sha256(data[_CHECKSUM:]).digest() != data[:_CHECKSUM]:
            raise ValueError("the checksum does not match")
        found = unpacked(data[_CHECKSUM:])
    except Exception:  # another program's file, or a faulty disk: make it anew
        path.unlink(missing_ok=True)
        return None
    try:
        # Least seconds between two updates of an entry's time of use.
        if time.time() - path.stat().st_mtime > 3600.0:
            os.utime(path)
    except OSError:
        pass
    return found


def _write(path: Path, packed: bytes) -> None:
    global _writes
    part: str | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=_PART, delete=False) as file:
            part = file.name
            file.write(hashlib.sha256(packed).digest() + packed)
        os.replace(part, path)
    except OSError:  # a read-only or full disk: nothing is cached
        if part is not None:
            Path(part).unlink(missing_ok=True)
        return
    if _writes % LOOKED_AT_EVERY == 0:
        _evict(path.parent)
    _writes += 1


def _evict(folder: Path) -> None:
    """Remove the least recently used entries if the cache is too large, and the files of killed processes."""
    for file in folder.glob(f"*{_PART}"):
        try:
            # Seconds after which the temporary file of a killed process is removed.
            if time.time() - file.stat().st_mtime > 600.0:
                file.unlink(missing_ok=True)
        except OSError:
            continue
    files = sorted(_entries(folder))
    size = sum(entry[1] for entry in files)
    if size <= LARGEST_CACHE:
        return
    for _, bytes_, file in files:
        # Share of `LARGEST_CACHE` that remains after eviction; the least recently used entries are removed first.
        if size <= 0.75 * LARGEST_CACHE:
            return
        try:
            file.unlink(missing_ok=True)
        except OSError:
            continue
        size -= bytes_


def _entries(folder: Path) -> list[tuple[float, int, Path]]:
    """Time of last use, size and path of every entry; another process may remove some meanwhile."""
    found = []
    for file in [file for ending in (_SUFFIX, _OTHER) for file in folder.glob(f"*{ending}")]:
        try:
            status = file.stat()
        except OSError:
            continue
        found.append((status.st_mtime, status.st_size, file))
    return found


def _packed(found: ConvexPieces) -> bytes:
    corners = [np.array(piece.geometry.points()) for piece in found.pieces]
    faces = [_triangles(piece.geometry) for piece in found.pieces]
    told = json.dumps([found.added_volume, found.notes]).encode()
    buffer = io.BytesIO()
    np.savez(
        buffer,
        corners=np.vstack(corners),
        corner_count=np.array([len(part) for part in corners]),
        faces=np.vstack(faces),
        face_count=np.array([len(part) for part in faces]),
        centre=np.array([piece.placement.translation for piece in found.pieces]),
        volume=np.array([piece.volume for piece in found.pieces]),
        told=np.frombuffer(told, dtype=np.uint8),
    )
    return buffer.getvalue()


def _unpacked(data: bytes) -> ConvexPieces:
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        corners = np.split(arrays["corners"], np.cumsum(arrays["corner_count"])[:-1])
        faces = np.split(arrays["faces"], np.cumsum(arrays["face_count"])[:-1])
        pieces = tuple(
            Piece(coal_convex(points, triangles), pin.SE3(np.eye(3), centre), float(volume))
            for points, triangles, centre, volume in zip(
                corners, faces, arrays["centre"], arrays["volume"], strict=True
            )
        )
        added, notes = json.loads(arrays["told"].tobytes())
    return ConvexPieces(pieces, float(added), tuple(notes))


def _triangles(hull: Any) -> NDArray[np.int64]:
    polygons = (hull.polygons(k) for k in range(hull.num_polygons))
    return np.array([[face[0], face[1], face[2]] for face in polygons], dtype=np.int64).reshape(-1, 3)
