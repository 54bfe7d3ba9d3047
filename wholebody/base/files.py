"""Files: read with bounds, written whole or not at all, and scratch folders that are removed after a crash."""

from __future__ import annotations

import csv
import fcntl
import io
import math
import os
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wholebody.base import checks
from wholebody.base.errors import FileFormatError, InputError, either, one_line

if TYPE_CHECKING:
    from jinja2 import Environment

LARGEST_TEXT = 10_000_000  # bytes of a file that people write by hand, such as a task
LARGEST = 1_000_000_000  # bytes of any other file, such as a mesh or a recorded track
LONGEST_NAME = 200  # characters of a path in a message
DEEPEST_KEY = 20  # parts of a dotted key of TOML

_DEEP_KEY = re.compile(rf"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){{{DEEPEST_KEY}}}""")
_LONG_NUMBER = re.compile(r"[\d_]{4000}")

PREFIX = "wholebody-scratch-"
LOCK = "in-use"  # a file in each scratch folder that its process keeps locked; the system releases it when it ends
UNLOCKED = 60.0  # s: for which a scratch folder may be without its lock file; making the file takes far less


def read_bytes(path: str | PathLike[str], kind: str = "file", largest: int = LARGEST) -> bytes:
    """Read a regular file of at most `largest` bytes, or raise a FileFormatError that calls it a `kind`."""
    with _opened(path, kind, largest) as descriptor, open(descriptor, "rb", closefd=False) as file:
        try:
            data = file.read(largest + 1)
        except OSError as error:
            raise FileFormatError(f"{kind} {_named(path)}: cannot be read ({error.strerror})") from None
    if len(data) > largest:  # a file whose size is reported as 0, such as those of /proc
        raise _too_large(path, kind, largest)
    return data


def read_text(path: str | PathLike[str], kind: str = "file", largest: int = LARGEST_TEXT) -> str:
    """Read a text file in UTF-8, with or without a byte order mark, as `read_bytes` does; line ends are kept."""
    data = read_bytes(path, kind, largest)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise FileFormatError(f"{kind} {_named(path)}, line {line}: this is not UTF-8 text; save it in UTF-8") from None


def read_foreign_text(path: str | PathLike[str], kind: str = "file", largest: int = LARGEST_TEXT) -> str:
    """A text of another program: UTF-8, UTF-16 with its mark, or else Latin-1, without an end mark of DOS."""
    data = read_bytes(path, kind, largest)
    try:
        if data.startswith((b"\xff\xfe", b"\xfe\xff")):
            return data.decode("utf-16").rstrip("\x1a\0")
        return data.decode("utf-8-sig").rstrip("\x1a\0")
    except UnicodeDecodeError:
        if data.startswith((b"\xff\xfe", b"\xfe\xff")):
            raise FileFormatError(f"{kind} {_named(path)}: its UTF-16 text is truncated; fetch it again") from None
        return data.decode("latin-1").rstrip("\x1a\0")


def packaged_table(path: Path) -> tuple[dict[str, str], ...]:
    """The rows of a CSV file of the package, each a mapping from column to text; a line that begins with # is none."""
    with path.open(encoding="utf-8", newline="") as file:
        return tuple(csv.DictReader(line for line in file if not line.startswith("#")))


def csv_text(rows: Iterable[Mapping[str, Any]]) -> str:
    """Rows as CSV with a column for each name in one of them; cells with line breaks of any kind are quoted."""
    listed, text = list(rows), io.StringIO(newline="")
    names = list(dict.fromkeys(name for row in listed for name in row))
    lines: list[list[Any]] = [names, *([row.get(name) for name in names] for row in listed)]
    for cells in lines:
        line = io.StringIO(newline="")
        csv.writer(line, lineterminator="\r\n").writerow(cells)  # it quotes only what its own lines end with
        text.write(line.getvalue().removesuffix("\r\n") + "\n")
    return text.getvalue()


@cache
def templates(folder: Path) -> Environment:
    """The templates of a folder, which jinja2 fills in; values are escaped in pages (`.html.jinja`)."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape

    made = Environment(
        loader=FileSystemLoader(folder),
        autoescape=select_autoescape(["html.jinja"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.policies["json.dumps_kwargs"] = {"separators": (",", ":")}  # of its filter `tojson`, in the order given
    return made


def parsed_toml(text: str, name: str) -> dict[str, Any]:
    """What a text in TOML says; a FileFormatError names the file if it says nothing, or what a reader does not bear."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib
    name = one_line(name)
    if _DEEP_KEY.search(text):  # the reader's memory grows with the square of a key's parts
        raise FileFormatError(f"{name}: a key has more than {DEEPEST_KEY} parts; two are the most that is needed")
    try:
        data: dict[str, Any] = tomllib.loads(text)
        return data
    except tomllib.TOMLDecodeError as error:
        # Largest number of characters of a message of the TOML reader that our message quotes.
        raise FileFormatError(f"{name}: is not TOML: {one_line(str(error), 300)}") from None
    except RecursionError:
        raise FileFormatError(f"{name}: tables or lists are nested too deeply; use at most three levels") from None
    except ValueError:  # Python reads no whole number of more than 4300 digits
        line = next((n for n, said in enumerate(text.splitlines(), 1) if _LONG_NUMBER.search(said)), 1)
        raise FileFormatError(f"{name}:{line}: a number has thousands of digits; write fewer") from None


@cache
def packaged_toml(path: Path) -> dict[str, Any]:
    """What a TOML file of the package says; whoever reads it changes nothing."""
    return parsed_toml(path.read_text("utf-8"), path.name)


def finite(value: Any) -> Any:
    """Content of a JSON file, in which numbers that are not finite become null, and tuples lists."""
    if isinstance(value, Mapping):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def check_file(path: str | PathLike[str], kind: str) -> None:
    """Check a path before a library reads it: raises like `read_bytes`, without reading."""
    with _opened(path, kind, LARGEST):
        pass


is_file, is_folder = os.path.isfile, os.path.isdir
"""False, and no error, for a path that no file system accepts."""


def title_of(path: str | PathLike[str]) -> str:
    """The name of a file without folder and ending as a title: a line of text, whatever the locale can decode."""
    plain = os.fsencode(Path(path).stem).decode("utf-8", "backslashreplace")
    return one_line(plain, checks.LONGEST) if plain.strip() else repr(plain)


@contextmanager
def _opened(path: str | PathLike[str], kind: str, largest: int) -> Iterator[int]:
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)  # a pipe would wait for its writer
    except FileNotFoundError:
        raise FileFormatError(f"{kind} {_named(path)}: there is no such file{_looked_in(path)}") from None
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


def _looked_in(path: str | PathLike[str]) -> str:
    """The folder in which a relative path was looked for, for a message."""
    with suppress(OSError):  # the folder itself may be gone
        return "" if os.path.isabs(path) else f" in {_named(Path.cwd())}"
    return ""


def _too_large(path: str | PathLike[str], kind: str, largest: int) -> FileFormatError:
    return FileFormatError(f"{kind} {_named(path)}: is larger than {largest / 1e6:g} MB; give a smaller one")


def _named(path: str | PathLike[str]) -> str:
    """A path as messages quote it: in one line; of a long path its end."""
    text = str(path)
    return one_line(text if len(text) <= LONGEST_NAME else f"...{text[-LONGEST_NAME:]}", 2 * LONGEST_NAME)


# ---- writing


def write(path: str | PathLike[str], content: str | bytes) -> Path:
    """Write a file whole or not at all, text as UTF-8, or raise an InputError; links are followed."""
    # A process that is killed may leave a temporary file; the next one that writes to the folder removes it.
    target = Path(path)
    data = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    try:
        target = target.resolve() if target.is_symlink() else target
        if target.exists() and not (target.is_file() or target.is_dir()):  # a file in their place would end them
            target.write_bytes(data)
            return Path(path)
        _remove_left_behind(target.parent)
        descriptor, name = tempfile.mkstemp(prefix=f".{PREFIX}", suffix=".part", dir=target.parent)
    except (OSError, ValueError) as error:
        raise _unwritable(path, error) from None
    try:
        with open(descriptor, "wb") as file:
            with suppress(OSError):  # a network file system may have no locks
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
    return Path(path)


def check_writable(path: Path, read: Iterable[str | PathLike[str] | None] = ()) -> Path:
    """The path of a file to write, checked before long work: an InputError if it cannot be, or is one of those read."""
    for each in read:
        if each is not None and path.exists() and os.path.exists(each) and os.path.samefile(path, each):
            raise InputError(
                f"{_named(path)} is a file that is read, and would be lost; give another place to write to"
            )
    if not is_folder(path.parent):
        raise _unwritable(path, FileNotFoundError())
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError(f"{_named(path)} cannot be written: its folder is not writable; give another place")
    return path


def checked_target(
    path: object,
    what: str,
    content: str,
    endings: Collection[str],
    read: Iterable[str | PathLike[str] | None] = (),
) -> Path:
    """The path of a file to write, checked before long work, as by `checked_ending` and `check_writable`."""
    return check_writable(checked_ending(path, what, content, endings), read)


def checked_ending(path: object, what: str, content: str, endings: Collection[str]) -> Path:
    """The path of a file of some `content`, whose ending is one of `endings`, lower case with the dot."""
    place = checks.path(path, what)
    if place.suffix.lower() not in endings:
        given = one_line(place.suffix) or "a file without ending"
        raise InputError(
            f"{_named(place.name)}: {content} cannot be written as {given}; end the name with {either(sorted(endings))}"
        )
    return place


def make_folder(path: Path) -> None:
    """Make a folder and those above it, if they do not exist; an InputError if it cannot be made."""
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
    """Remove our temporary files in a folder whose processes have ended."""
    for left in folder.glob(f".{PREFIX}*.part"):
        with suppress(OSError), left.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if time.time() - os.fstat(file.fileno()).st_mtime > UNLOCKED:
                left.unlink()


# ---- scratch


class Scratch:
    """A folder for temporary files. `close` removes it; after a crash, the next `Scratch` of any process does."""

    def __init__(self) -> None:
        _remove_abandoned()
        self.path = Path(tempfile.mkdtemp(prefix=PREFIX))
        unseen = self.path / f"{LOCK}.new"  # others take a lock that they see and that is free as left by the dead
        self._lock = unseen.open("wb")
        fcntl.flock(self._lock, fcntl.LOCK_EX)
        unseen.rename(self.path / LOCK)

    def close(self) -> None:
        """Remove the folder. Calling it again does nothing."""
        shutil.rmtree(self.path, ignore_errors=True)
        self._lock.close()

    def __enter__(self) -> Path:
        return self.path

    def __exit__(self, *_: object) -> None:
        self.close()


def _remove_abandoned() -> None:
    """Remove our scratch folders whose lock is free: their processes ended without removing them."""
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
