"""Cache of convex pieces of meshes, and of what else takes seconds to make, on disk: loading takes milliseconds.

An entry is one file, named by a hash of the mesh and the settings. It is written whole, so any number
of processes may read and write at once. It begins with its checksum; an entry whose checksum does not match
is discarded. If the folder is not writable, nothing is cached.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import time
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.errors import InputError
from wholebody.base.files import write
from wholebody.geometry.hull import coal_convex, coal_triangles
from wholebody.geometry.pieces import Piece, hull_triangles
from wholebody.version import __version__

VARIABLE = "WHOLEBODY_CACHE"  # environment variable that names another folder for the cache

LARGEST_CACHE = 256 * 2**20  # bytes; a mesh as hull takes 3 kB, a decomposition 20 kB
LOOKED_AT_EVERY = 64  # writes of a process between checks of the cache's size; the first write checks it too

_SUFFIX = ".pieces"
_CHECKSUM = hashlib.sha256().digest_size

_writes = 0


class ConvexPieces(NamedTuple):
    """A mesh as a union of convex pieces."""

    pieces: tuple[Piece, ...]  # at least one
    added_volume: float  # volume of all pieces over that of the closed parts of the mesh, minus one
    notes: tuple[str, ...]  # one sentence for each part that was changed


class CacheState(NamedTuple):
    """Folder of the cache, number of its entries, their size in bytes, and whether this process can write there."""

    folder: Path
    entries: int
    size: int
    writable: bool


def cache_folder() -> Path:
    """The folder of the cache, which need not exist: the user's cache folder, or that of `VARIABLE`."""
    import platformdirs

    named = os.environ.get(VARIABLE)
    if named:
        return Path(named)
    return Path(platformdirs.user_cache_path("wholebody", appauthor=False)) / "convex-pieces"


def cached(content: tuple[bytes, ...], settings: str, what: str, make: Callable[[], ConvexPieces]) -> ConvexPieces:
    """Pieces from the cache, or made and cached, by content, settings and libraries; notes begin with `what`."""
    digest = hashlib.sha256("\0".join(("3", __version__, settings)).encode())
    for part in content:
        digest.update(hashlib.sha256(part).digest())

    def made() -> Any:
        pieces, added, notes = make()
        stored = [
            (np.array(one.geometry.points()), hull_triangles(one.geometry), one.placement.translation, one.volume)
            for one in pieces
        ]
        return stored, added, [note.removeprefix(what) for note in notes]

    stored, added, notes = cached_entry(digest.hexdigest(), made)
    pieces = tuple(
        Piece(coal_convex(points, coal_triangles(triangles)), pin.SE3(np.eye(3), centre), volume)
        for points, triangles, centre, volume in stored
    )
    return ConvexPieces(pieces, added, tuple(what + note for note in notes))


def cached_entry(key: str, make: Callable[[], Any]) -> Any:
    """What a function makes of arrays, texts, numbers, None and tuples of these, cached by its digest."""
    global _writes
    path = cache_folder() / f"{key}{_SUFFIX}"
    found = _read(path)
    if found is not None:
        return found
    data = _packed(make())
    with suppress(OSError, InputError):  # a read-only or full disk: nothing is cached
        path.parent.mkdir(parents=True, exist_ok=True)
        write(path, hashlib.sha256(data).digest() + data)
        if _writes % LOOKED_AT_EVERY == 0:
            _evict(path.parent)
        _writes += 1
    return _unpacked(data)


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
    for _, _, file in _entries(state.folder):
        file.unlink(missing_ok=True)
    return state


def _read(path: Path) -> Any:
    try:
        data = path.read_bytes()
    except OSError:
        return None
    try:
        if hashlib.sha256(data[_CHECKSUM:]).digest() != data[:_CHECKSUM]:
            raise ValueError("the checksum does not match")
        found = _unpacked(data[_CHECKSUM:])
    except Exception:  # another program's file, or a faulty disk: make it anew
        path.unlink(missing_ok=True)
        return None
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > 3600.0:  # least seconds between two updates of an entry's time of use
            os.utime(path)
    return found


def _evict(folder: Path) -> None:
    """Remove the least recently used entries if the cache is too large, until it has 3/4 of its largest size."""
    files = sorted(_entries(folder))
    size = sum(entry[1] for entry in files)
    most = LARGEST_CACHE if size <= LARGEST_CACHE else 0.75 * LARGEST_CACHE
    for _, bytes_, file in files:
        if size <= most:
            return
        with suppress(OSError):
            file.unlink(missing_ok=True)
            size -= bytes_


def _entries(folder: Path) -> list[tuple[float, int, Path]]:
    """Time of last use, size and path of every entry; another process may remove some meanwhile."""
    found = []
    for file in folder.glob(f"*{_SUFFIX}"):
        with suppress(OSError):
            status = file.stat()
            found.append((status.st_mtime, status.st_size, file))
    return found


def _packed(value: Any) -> bytes:
    """A value as bytes: the length of its text in JSON, this text, then the numbers of all arrays."""
    parts: list[bytes] = []

    def plain(one: Any) -> Any:
        if isinstance(one, np.ndarray):
            parts.append(one.tobytes())
            return {"type": one.dtype.str, "shape": one.shape}
        return [plain(each) for each in one] if isinstance(one, (tuple, list)) else one

    text = json.dumps(plain(value)).encode()
    return zlib.compress(b"".join([len(text).to_bytes(8, "little"), text, *parts]), 1)


def _unpacked(packed: bytes) -> Any:
    data = zlib.decompress(packed)
    at = 8 + int.from_bytes(data[:8], "little")

    def made(one: Any) -> Any:
        nonlocal at
        if isinstance(one, dict):
            found = np.frombuffer(data, one["type"], math.prod(one["shape"]), at).reshape(one["shape"]).copy()
            at += found.nbytes
            return found
        return tuple(map(made, one)) if isinstance(one, list) else one

    return made(json.loads(data[8:at]))
