"""The memory that a task takes."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

from wholebody.base.errors import WholebodyError
from wholebody.base.files import Scratch
from wholebody.bench.rows import Figure, Row

PEAKS = """\
import resource, sys
from pathlib import Path
from wholebody.cli import main
code = main(["pose", sys.argv[1], "--out", sys.argv[2]])
own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
status = Path("/proc/self/status")
if status.is_file():  # Linux: ru_maxrss begins with what the parent had
    own = next(int(line.split()[1]) for line in status.read_text().splitlines() if line.startswith("VmHWM"))
print("PEAKS", own, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, file=sys.stderr)
sys.exit(code)
"""
"""Runs the command in a fresh interpreter, and tells its peak and its children's when it is done."""


def memory(path: Path) -> Row:
    """Run `wholebody pose` on a task in a process of its own: the greatest resident memory, MB of 1e6 bytes.

    Raises WholebodyError where the command failed.
    """
    with Scratch() as folder:
        call = [sys.executable, "-c", PEAKS, str(path), str(folder)]
        began = time.perf_counter()
        done = subprocess.run(call, capture_output=True, text=True, timeout=300.0, check=False)
        seconds = time.perf_counter() - began
    peaks = [line.split()[1:] for line in done.stderr.splitlines() if line.startswith("PEAKS ")]
    if done.returncode not in (0, 1) or not peaks:
        raise WholebodyError(
            f"`wholebody pose {path}` failed: {done.stderr.strip().splitlines()[-1:]}; correct it first"
        )
    unit = 1.0 if sys.platform == "darwin" else 1024.0  # bytes there, kibibytes on Linux
    own, children = (float(peak) * unit / 1e6 for peak in peaks[0])
    figures: dict[str, Figure] = {"peak MB": own, "processes that it starts MB": children, "seconds": seconds}
    return Row(path.stem, "wholebody pose", figures)
