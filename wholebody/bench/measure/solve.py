"""`wholebody bench solve`: the shelf task, cold and warm, and the memory that `wholebody pose` takes for it."""

from __future__ import annotations

import gc
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import wholebody as wb
from wholebody.base.errors import WholebodyError
from wholebody.base.files import Scratch
from wholebody.bench.report import render
from wholebody.bench.suite.adapters.base import Adapter
from wholebody.bench.tables import programs_text

TIMEOUT = 300.0  # s
TOLERANCE = 1e-5  # m, rad: what methods are asked for
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


@dataclass(frozen=True)
class SolveRow:
    """Times of one way to solve a task.

    Attributes:
        method: which, such as "qp" or "qp/osqp".
        way: "cold": a problem and a method that have not been used; "warm": the same ones again.
        pairs: of pieces, that could touch.
        status: of all of them, or the worst.
        programs: what closed its quadratic programs, and how many, of one solve.
        median_ms, p95_ms, cpu_median_ms: of a solve, the independent assessment included.
    """

    task: str
    method: str
    way: str
    count: int
    pairs: int
    status: str
    iterations: int
    programs: str
    median_ms: float
    p95_ms: float
    cpu_median_ms: float


@dataclass(frozen=True)
class MemoryRow:
    """Peak memory of a command in a process of its own.

    Attributes:
        peak_mb: greatest resident memory of the process itself [MB of 1e6 bytes].
        children_mb: greatest of any process it started, a browser for the picture, say [MB].
    """

    command: str
    peak_mb: float
    children_mb: float
    seconds: float


def measure(task: Path, adapter: Adapter, count: int) -> list[SolveRow]:
    """Solve a task `count` times cold and as often warm; one solve of each kind is made before and not counted."""
    rows = []
    used = wb.read_task(task).problem
    method = adapter.make(TOLERANCE, None)
    for way in ("cold", "warm"):
        fresh = way == "cold"
        wall, cpu, solutions = [], [], []
        for number in range(count + 1):
            problem = wb.read_task(task).problem if fresh else used
            chosen = adapter.make(TOLERANCE, None) if fresh else method
            gc.collect()
            gc.disable()
            worked, clock = time.thread_time(), time.perf_counter()
            solution = chosen.solve(problem)
            if number:
                wall.append(1e3 * (time.perf_counter() - clock))
                cpu.append(1e3 * (time.thread_time() - worked))
                solutions.append(solution)
            gc.enable()
        unsolved = [solution.status for solution in solutions if not solution.solved]
        rows.append(
            SolveRow(
                task=task.stem,
                method=adapter.name,
                way=way,
                count=count,
                pairs=len(used.scene.geometry.collisionPairs),
                status=unsolved[0] if unsolved else "solved",
                iterations=int(np.median([solution.iterations for solution in solutions])),
                programs=programs_text(solutions[-1].programs),
                median_ms=float(np.median(wall)),
                p95_ms=float(np.quantile(wall, 0.95)),
                cpu_median_ms=float(np.median(cpu)),
            )
        )
    return rows


def memory(task: Path) -> MemoryRow:
    """Run `wholebody pose` on a task in a process of its own and ask the system for its peak.

    Raises:
        WholebodyError: the command failed.
    """
    with Scratch() as folder:
        call = [sys.executable, "-c", PEAKS, str(task), str(folder)]
        began = time.perf_counter()
        done = subprocess.run(call, capture_output=True, text=True, timeout=TIMEOUT, check=False)
        seconds = time.perf_counter() - began
    peaks = [line.split()[1:] for line in done.stderr.splitlines() if line.startswith("PEAKS ")]
    if done.returncode not in (0, 1) or not peaks:
        raise WholebodyError(
            f"`wholebody pose {task}` failed: {done.stderr.strip().splitlines()[-1:]}; correct it first"
        )
    unit = 1.0 if sys.platform == "darwin" else 1024.0  # bytes there, kibibytes on Linux
    own, children = (float(peak) * unit / 1e6 for peak in peaks[0])
    return MemoryRow(f"wholebody pose {task.name}", own, children, seconds)


def measured(task: Path, methods: Sequence[Adapter], count: int, say: Callable[[str], None]) -> list[SolveRow]:
    """Measure with each method; `say` takes a line about each."""
    rows = []
    for adapter in methods:
        rows += measure(task, adapter, count)
        for row in rows[-2:]:
            say(f"{row.task}, {row.method}, {row.way}: {row.median_ms:.1f} ms, p95 {row.p95_ms:.1f} ms, {row.status}")
    return rows


def solve_report(rows: Sequence[SolveRow], peak: MemoryRow, facts: Mapping[str, str]) -> str:
    """Table of the whole solves, and the memory."""
    return render("solve.md", rows=rows, peak=peak, facts=facts)
