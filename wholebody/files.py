"""Files of people: read with bounds, written whole or not at all, and scratch folders that do not outlive a crash.

Everything that reads a file somebody else wrote begins here, so that devices, pipes, folders, huge files and other
encodings are one sentence each. Everything that writes one ends here.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path

from wholebody.errors import FileFormatError, InputError, one_line

LARGEST_TEXT = 10_000_000
"""Bytes of a file that people write by hand, such as a task."""

LARGEST = 1_000_000_000
"""Bytes of any other file, such as a mesh or a recorded track."""

LONGEST_NAME = 200
"""Characters of a path that a sentence repeats."""

PREFIX = "wholebody-scratch-"
"""What the names of our scratch folders begin with."""

LOCK = "in-use"
"""A file in each scratch folder that its process keeps locked: the system gives the lock back however it ends."""

UNLOCKED = 60.0
"""Seconds for which a scratch folder may be without its lock file: the time to make it, with a lot to spare."""


def read_bytes(path: str | PathLike[str], kind: str = "file", largest: int = LARGEST) -> bytes:
    """Read a regular file.

    Args:
        path: the file.
        kind: what the sentence calls it: "task file", "mesh".
        largest: bytes beyond which it is refused.

    Raises:
        FileFormatError: there is no such file, it is no regular file (a folder, a device, a pipe), it is larger than
            that, or it cannot be read.
    """
    with _opened(path, kind, largest) as descriptor, open(descriptor, "rb", closefd=False) as file:
        try:
            data = file.read(largest + 1)
        except OSError as error:
            raise FileFormatError(f"{kind} {_named(path)}: cannot be read ({error.strerror})") from None
    if len(data) > largest:  # one that says it is empty, as those of /proc do
        raise _too_large(path, kind, largest)
    return data


def read_text(path: str | PathLike[str], kind: str = "file", largest: int = LARGEST_TEXT) -> str:
    """Read a text file in UTF-8, with or without a byte order mark; raises like `read_bytes`, and for other encodings.

    Line ends are kept as they are.
    """
    data = read_bytes(path, kind, largest)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise FileFormatError(f"{kind} {_named(path)}, line {line}: is no UTF-8 text; save it in UTF-8") from None


def check_file(path: str | PathLike[str], kind: str = "file", largest: int = LARGEST) -> None:
    """See that a library can be given a path: raises like `read_bytes`, without reading."""
    with _opened(path, kind, largest):
        pass


def is_file(path: str | PathLike[str]) -> bool:
    """Whether there is a regular file; false, and no error, for a path that no file system takes."""
    try:
        return stat.S_ISREG(os.stat(path).st_mode)
    except (OSError, ValueError):
        return False


def is_folder(path: str | PathLike[str]) -> bool:
    """Whether there is a folder; false, and no error, for a path that no file system takes."""
    try:
        return stat.S_ISDIR(os.stat(path).st_mode)
    except (OSError, ValueError):
        return False


@contextmanager
def _opened(path: str | PathLike[str], kind: str, largest: int) -> Iterator[int]:
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)  # a pipe would wait for its writer
    except FileNotFoundError:
        raise FileFormatError(f"{kind} {_named(path)}: there is no such file") from None
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else "no file system takes the name"
        raise FileFormatError(f"{kind} {_named(path)}: cannot be opened ({why}); give another file") from None
    try:
        found = os.fstat(descriptor)
        if not stat.S_ISREG(found.st_mode):
            what = "a folder" if stat.S_ISDIR(found.st_mode) else "a device or a pipe"
            raise FileFormatError(f"{kind} {_named(path)}: is {what}; give a file")
        if found.st_size > largest:
            raise _too_large(path, kind, largest)
        yield descriptor
    finally:
        os.close(descriptor)


def _too_large(path: str | PathLike[str], kind: str, largest: int) -> FileFormatError:
    return FileFormatError(f"{kind} {_named(path)}: is larger than {largest / 1e6:g} MB; give a smaller one")


def _named(path: str | PathLike[str]) -> str:
    """The path as sentences have it: in one line, and the end of it where it is long."""
    text = str(path)
    return one_line(text if len(text) <= LONGEST_NAME else f"...{text[-LONGEST_NAME:]}", 2 * LONGEST_NAME)


# ---- writing


def write(path: str | PathLike[str], content: str | bytes) -> Path:
    """Write a file whole or not at all; text as UTF-8.

    What a process that was killed in between has left in the folder is removed by the next one that writes there.

    Returns:
        The path.

    Raises:
        InputError: the file cannot be written.
    """
    target = Path(path)
    data = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    try:
        _remove_left_behind(target.parent)
        descriptor, name = tempfile.mkstemp(prefix=f".{PREFIX}", suffix=".part", dir=target.parent)
    except (OSError, ValueError) as error:
        raise _unwritable(path, error) from None
    try:
        with open(descriptor, "wb") as file:
            with suppress(OSError):  # a network's file system may have no locks
                fcntl.flock(file, fcntl.LOCK_EX)  # held until the file has its own name
            file.write(data)
            file.flush()
            mask = os.umask(0)
            os.umask(mask)
            os.fchmod(file.fileno(), 0o666 & ~mask)
            os.replace(name, target)
    except BaseException as error:
        with suppress(OSError):
            os.unlink(name)
        if isinstance(error, (OSError, ValueError)):
            raise _unwritable(path, error) from None
        raise
    return target


def check_writable(path: Path) -> Path:
    """The path of a file whose folder can be written, to be asked before long work.

    Raises:
        InputError: it cannot.
    """
    if not is_folder(path.parent):
        raise _unwritable(path, FileNotFoundError())
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError(f"{_named(path)} cannot be written: its folder may not be written to; give another place")
    return path


def make_folder(path: Path) -> None:
    """Make a folder and those above it, where they are not there already.

    Raises:
        InputError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else "no file system takes the name"
        raise InputError(f"the folder {_named(path)} cannot be made ({why}); give another place") from None


def _unwritable(path: str | PathLike[str], error: Exception) -> InputError:
    if isinstance(error, FileNotFoundError):
        return InputError(f"{_named(path)} cannot be written: there is no such folder; make the folder first")
    why = error.strerror if isinstance(error, OSError) else "no file system takes the name"
    return InputError(f"{_named(path)} cannot be written ({why}); give another place")


def _remove_left_behind(folder: Path) -> None:
    """Remove half-written files of ours in a folder whose writers are gone."""
    for left in folder.glob(f".{PREFIX}*.part"):
        with suppress(OSError), left.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if time.time() - os.fstat(file.fileno()).st_mtime > UNLOCKED:
                left.unlink()


# ---- scratch


class Scratch:
    """A folder of our own for temporary files; it goes with `close`, or with the next one that anybody makes.

    Attributes:
        path: the folder.
    """

    def __init__(self) -> None:
        """Make the folder, and remove those of processes that are gone."""
        _remove_abandoned()
        self.path = Path(tempfile.mkdtemp(prefix=PREFIX))
        self._lock = (self.path / LOCK).open("wb")
        fcntl.flock(self._lock, fcntl.LOCK_EX)

    def close(self) -> None:
        """Remove the folder. Doing it again does nothing."""
        shutil.rmtree(self.path, ignore_errors=True)
        self._lock.close()

    def __enter__(self) -> Path:
        """Return the folder."""
        return self.path

    def __exit__(self, *_: object) -> None:
        """Remove it."""
        self.close()


def _remove_abandoned() -> None:
    """Remove our scratch folders that nobody holds: their processes ended without a chance to."""
    for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        with suppress(OSError):
            if folder.is_symlink() or folder.stat().st_uid != os.getuid():
                continue
            try:
                with (folder / LOCK).open("rb") as lock:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(folder, ignore_errors=True)
            except FileNotFoundError:
                if time.time() - folder.stat().st_mtime > UNLOCKED:
                    shutil.rmtree(folder, ignore_errors=True)
