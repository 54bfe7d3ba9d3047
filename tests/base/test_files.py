"""Files of people: what is no file is refused at once, and what a killed process leaves behind goes."""

from __future__ import annotations

import fcntl
import os
import signal
import stat
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest

from wholebody.base import files
from wholebody.base.errors import FileFormatError, InputError


def fifo(folder: Path) -> Path:
    os.mkfifo(folder / "pipe")
    return folder / "pipe"


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda folder: folder / "gone", "there is no such file"),
        (lambda folder: folder, "is a folder"),
        (lambda folder: Path("/dev/zero"), "is a device or a pipe"),
        (fifo, "is a device or a pipe"),
        (lambda folder: folder / ("x" * 5000), "cannot be opened"),
        (lambda folder: folder / "a\0b", "cannot be opened"),
        (lambda folder: folder / "\ud800", "cannot be opened"),
        (lambda folder: folder / "file" / "in a file", "cannot be opened"),
    ],
)
def test_what_is_no_file_is_refused_at_once_in_one_sentence(tmp_path: Path, make: object, said: str) -> None:
    (tmp_path / "file").write_text("1")
    path = make(tmp_path)  # type: ignore[operator]
    for read in (files.read_bytes, files.read_text, files.check_file):
        with pytest.raises(FileFormatError, match=said) as refused:
            read(path, "track")
        assert str(refused.value).startswith("track ")
        assert "\n" not in str(refused.value)
        assert len(str(refused.value)) < 500
    assert not files.is_file(path)


def test_size_and_encoding_are_bounded(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"\xef\xbb\xbfone\r\ntwo")
    assert files.read_text(path) == "one\r\ntwo"
    with pytest.raises(FileFormatError, match="is larger than 5e-06 MB"):
        files.read_bytes(path, "file", 5)
    path.write_bytes(b"one\ntw\xffo")
    with pytest.raises(FileFormatError, match="line 2: this is not UTF-8 text"):
        files.read_text(path)


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="reads a file that says it is empty")
def test_a_file_that_hides_its_size_is_bounded_too() -> None:
    with pytest.raises(FileFormatError, match="is larger"):
        files.read_bytes("/proc/self/maps", "file", 100)


def test_files_are_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = files.write(tmp_path / "file", "old")
    mask = os.umask(0)
    os.umask(mask)
    assert path.stat().st_mode & 0o777 == 0o666 & ~mask
    files.write(path, b"new")
    assert path.read_bytes() == b"new"
    for wrong in (tmp_path, tmp_path / "gone" / "file", tmp_path / "a\0b", tmp_path / ("x" * 500)):
        with pytest.raises(InputError, match="cannot be written"):
            files.write(wrong, "text")
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


WRITING = """
import os, sys, time
from wholebody.base import files
scratch = files.Scratch()
(scratch.path / "large").write_bytes(bytes(1000))
os.replace = lambda *_: (print(scratch.path, flush=True), time.sleep(60))
files.write(sys.argv[1], "text")
"""


def test_what_a_killed_process_leaves_is_removed_by_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "scratch"))
    (tmp_path / "scratch").mkdir()
    (tmp_path / "out").mkdir()
    call = [sys.executable, "-c", WRITING, str(tmp_path / "out" / "file")]
    environment = {**os.environ, "TMPDIR": str(tmp_path / "scratch")}
    process = subprocess.Popen(call, stdout=subprocess.PIPE, text=True, env=environment)
    try:
        assert process.stdout is not None
        abandoned = Path(process.stdout.readline().strip())
        (half,) = (tmp_path / "out").iterdir()
        long_ago = time.time() - 2.0 * files.UNLOCKED
        os.utime(half, (long_ago, long_ago))
        files.write(tmp_path / "out" / "other", "text")
        with files.Scratch():
            assert half.exists()  # as long as somebody is at work on it
            assert abandoned.is_dir()
        process.send_signal(signal.SIGKILL)
        process.wait()
        files.write(tmp_path / "out" / "other", "text")
        with files.Scratch() as mine:
            assert list((tmp_path / "scratch").iterdir()) == [mine]
        assert [entry.name for entry in (tmp_path / "out").iterdir()] == ["other"]
        assert not list((tmp_path / "scratch").iterdir())
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()


def test_a_folder_that_is_being_made_is_not_taken_as_left_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    lock, looked = fcntl.flock, []

    def late(file: object, how: int) -> None:
        if how == fcntl.LOCK_EX and not looked:  # somebody else looks just before the first one locks
            looked.append(file)
            files.Scratch().close()
        lock(file, how)  # type: ignore[arg-type]

    monkeypatch.setattr(fcntl, "flock", late)
    with files.Scratch() as mine:
        assert looked
        assert mine.is_dir()


def test_folders_that_are_not_ours_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "wholebody-scratch-being-made").mkdir()  # its process is about to lock it
    (tmp_path / "other").mkdir()
    (tmp_path / "wholebody-scratch-link").symlink_to(tmp_path / "other")
    files.Scratch().close()
    assert sorted(entry.name for entry in tmp_path.iterdir()) == [
        "other",
        "wholebody-scratch-being-made",
        "wholebody-scratch-link",
    ]


def test_links_are_followed_and_pipes_stay_pipes(tmp_path: Path) -> None:
    """A file that is put in the place of `/dev/null` would take it from the whole machine."""
    pipe, real, link = tmp_path / "pipe", tmp_path / "real.txt", tmp_path / "link.txt"
    os.mkfifo(pipe)
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    files.write(pipe, "through")
    reader.join(5.0)
    assert read == [b"through"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    real.write_text("old")
    link.symlink_to(real)
    assert files.write(link, "new") == link
    assert link.is_symlink()
    assert real.read_text() == "new"
