"""What is left of a headless browser whose program was killed: nothing, once the next one starts."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from wholebody.view.browser import Browser

BROWSING = """
import time
from wholebody.view.browser import Browser
browser = Browser((64, 64))
browser.evaluate('0')
print(browser._pid, browser._folder, flush=True)
time.sleep(60)
"""


@pytest.fixture
def short() -> Iterator[Path]:
    """Return a folder with a short name: Chromium's socket in it may have 107 characters, which tmp_path can use up."""
    with tempfile.TemporaryDirectory(prefix="wb-") as folder:
        yield Path(folder)


@pytest.mark.browser
@pytest.mark.usefixtures("chromium")
def test_a_killed_programs_browser_ends_and_its_folder_goes(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(short))
    environment = {**os.environ, "TMPDIR": str(short)}
    program = subprocess.Popen([sys.executable, "-c", BROWSING], stdout=subprocess.PIPE, text=True, env=environment)
    try:
        assert program.stdout is not None
        pid, _, folder = program.stdout.readline().strip().partition(" ")
        with Browser((64, 64)):
            assert (Path(folder) / "profile").is_dir()  # of a program that lives
        program.kill()
        program.wait()
        end = time.monotonic() + 20.0
        while time.monotonic() < end and running(int(pid)):
            time.sleep(0.1)
        assert not running(int(pid))
        with Browser((64, 64)):
            assert not Path(folder).exists()
        assert not list(short.glob("wholebody-*"))
    finally:
        program.kill()
        program.wait()
        if program.stdout is not None:
            program.stdout.close()


def running(pid: int) -> bool:
    """Whether a process runs; one that nobody has waited for has ended."""
    try:
        return ") Z " not in Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False


@pytest.mark.browser
@pytest.mark.usefixtures("chromium")
def test_a_browser_ends_by_itself_while_a_forked_process_holds_its_pipes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Such as those of `multiprocessing`: Chromium does not see that its pipe ends, so it is told."""
    started = Browser((64, 64))
    forked = os.fork()
    if forked == 0:
        time.sleep(60)
        os._exit(0)
    killed: list[int] = []
    try:
        with monkeypatch.context() as patch:
            patch.setattr(os, "killpg", lambda group, _: killed.append(group))
            started.close()
    finally:
        os.kill(forked, signal.SIGKILL)
        os.waitpid(forked, 0)
    assert not killed
