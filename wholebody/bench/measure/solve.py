"""`wholebody bench solve`: a task with new and with used workspaces, and the memory that it takes."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

import wholebody as wb
from wholebody.base.errors import WholebodyError
from wholebody.base.files import Scratch
from wholebody.bench.rows import Figure, Row, measured_ms, quiet, times
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.tables import programs_text

TOLERANCE = 1e-5  # m, rad: what methods are asked for


def task_rows(path: Path, methods: Sequence[Adapter], count: int) -> Iterator[Row]:
    """Solve a task `count` times with new problems and methods, and as often with the same ones again."""
    for adapter in methods:
        used, method = wb.read_task(path).problem, adapter.make(TOLERANCE, None)
        for fresh in (True, False):
            wall, cpu, solutions = [], [], []
            for number in range(count + 1):
                problem = wb.read_task(path).problem if fresh else used
                chosen = adapter.make(TOLERANCE, None) if fresh else method
                with quiet():
                    worked, spent, solution = measured_ms(lambda: chosen.solve(problem))  # noqa: B023
                if number:
                    wall.append(spent)
                    cpu.append(worked)
                    solutions.append(solution)
            unsolved = [solution.status for solution in solutions if not solution.solved]
            yield Row(
                path.stem,
                adapter.name,
                {
                    "problem and method": "new" if fresh else "used before",
                    "solves": count,
                    "pairs": len(used.scene.geometry.collisionPairs),
                    "status": unsolved[0] if unsolved else "solved",
                    "iterations": int(np.median([solution.iterations for solution in solutions])),
                    "programs closed by": programs_text(solutions[-1].programs),
                    **times(wall),
                    "CPU median ms": float(np.median(cpu)),
                },
            )


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
