"""What a measurement was made on: written at the head of every result, for a time means nothing without it."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

from wholebody.version import __version__

PACKAGES = (
    "pin", "coal", "numpy", "scipy", "osqp", "daqp", "quadprog", "proxsuite", "piqp", "qpsolvers",
    "placo", "pin-pink", "mink", "mujoco", "rapier3d", "matplotlib",
)  # fmt: skip
THREADS = "OMP_NUM_THREADS"


def machine() -> dict[str, str]:
    """Return what a reader has to know of the machine and of the versions, in the order in which it is written."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    facts = {
        "wholebody": __version__,
        "processor": _processor(),
        "cores": str(usable),
        "load": f"{os.getloadavg()[0]:.1f} in the minute before",
        "system": f"{platform.system()} {platform.release()}, {platform.libc_ver()[1] or 'unknown libc'}",
        "python": platform.python_version(),
        THREADS: os.environ.get(THREADS, "not set"),
    }
    facts["numba"] = _version("numba") or "not installed"  # our own linearisation is faster with it
    installed = {name: _version(name) for name in PACKAGES}
    return facts | {name: version for name, version in installed.items() if version}


def sentence(facts: Mapping[str, str]) -> str:
    """Say the facts in one paragraph of Markdown."""
    return "Measured with " + "; ".join(f"{name} {value}" for name, value in facts.items()) + "."


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""
