"""Output that cannot be written, letters that cannot be encoded, and Ctrl-C while the command loads."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import wholebody

FROM_SCRATCH = True
COMMAND = [sys.executable, "-m", "wholebody"]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(wholebody.__file__).parents[1])}


def run(*words: str, **options) -> subprocess.CompletedProcess:
    environment = {**ENVIRONMENT, **options.pop("environment", {})}
    options = {"stdout": subprocess.PIPE, **options}
    return subprocess.run([*COMMAND, *words], stderr=subprocess.PIPE, text=True, env=environment, **options)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_a_full_stdout_is_one_sentence():
    with open("/dev/full", "w") as full:
        found = run("figure", "hand", stdout=full)
    assert found.returncode == 2
    assert found.stderr == "wholebody: the output cannot be written: No space left on device\n"


def test_a_stdout_that_cannot_be_written_is_said_before_anything_is_computed(tmp_path):
    with open(os.devnull) as unwritable:
        found = run("pose", str(tmp_path / "none.toml"), stdout=unwritable)
    assert found.returncode == 2
    assert found.stderr == "wholebody: the output cannot be written: Bad file descriptor\n"


def test_a_closed_stdout_is_said_before_anything_is_computed(tmp_path):
    found = run("pose", str(tmp_path / "none.toml"), preexec_fn=lambda: os.close(1))
    assert found.returncode == 2
    assert found.stderr.startswith("wholebody: stdout is closed")


def test_letters_that_stdout_lacks_are_written_as_escapes(tmp_path):
    folder = tmp_path / "\u00fcn\u00ef"
    folder.mkdir()
    out = folder / "hand.urdf"
    found = run("figure", "human", "--out", str(out), environment={"PYTHONIOENCODING": "ascii"})
    assert found.returncode == 0, found.stderr
    assert out.exists()
    assert "\\xfcn\\xef" in found.stdout + found.stderr


def test_ctrl_c_while_modules_are_loaded_shows_no_traceback():
    command = "import sys, wholebody; print('loaded', flush=True); from wholebody.cli import main; sys.exit(main())"
    words = [sys.executable, "-c", command, "figure", "human"]
    child = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT)
    assert child.stdout is not None
    assert child.stdout.readline() == "loaded\n"
    time.sleep(0.05)  # in the middle of numpy, or soon before it
    child.send_signal(signal.SIGINT)
    _, said = child.communicate()
    assert child.returncode in (-signal.SIGINT, 130)
    assert said == ""
