"""The whole examination: installed parts, working parts, and every fault with its repair."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

from wholebody.doctor import checks, packages
from wholebody.doctor.packages import EXTRAS, MODULES, Distribution
from wholebody.methods import EXTRAS as OF_METHODS
from wholebody.methods import installed_methods

State = Literal["works", "absent", "broken"]

SOLVERS = {"osqp": "osqp", "daqp": "daqp", "quadprog": "quadprog", "proxqp": "proxsuite", "piqp": "piqp"}
"""QP solvers: name -> the distribution that provides it."""

TOOLS = {
    "chromium": ("draws pictures and movies; scenes as HTML need none", "apt-get install chromium-headless-shell"),
    "ffmpeg": ("writes MP4; GIF needs none", "apt-get install ffmpeg"),
}
"""Programs outside Python: name -> its purpose, and its installation on Debian and Ubuntu."""

AGAIN = "pip install --force-reinstall wholebody"


@dataclass(frozen=True)
class Entry:
    """One examined part."""

    kind: str  # "package", "QP solver", "method", "tool" or "cache"
    name: str  # its name
    state: State  # "works", "absent" or "broken"
    detail: str  # version, time, place or reason
    needed: bool = True  # whether wholebody requires it
    repair: str = ""  # the command or action that repairs it; empty if none is needed


@dataclass(frozen=True)
class Report:
    """The result of the examination."""

    python: str  # version and path of the interpreter
    entries: tuple[Entry, ...]  # all examined parts
    faults: tuple[tuple[str, str], ...] = field(default=())  # the faults with their repairs: (sentence, repair)

    @property
    def healthy(self) -> bool:
        """Whether there are no faults; an absent part that is not required is no fault."""
        return not self.faults


def examine(environ: Mapping[str, str] = os.environ) -> Report:
    """Examine everything; this takes about ten seconds, because methods and solvers are really used."""
    have = packages.installed(["wholebody", *MODULES, *EXTRAS])
    entries = [*_packages(have), *_solvers(have), *_methods(), *_tools(), _cache()]
    faults = [*_faults(have, environ)]
    faults += [
        (f"the {entry.kind} {entry.name} is {entry.state}: {entry.detail}", entry.repair)
        for entry in entries
        if entry.state == "broken" or (entry.needed and entry.state == "absent")
    ]
    return Report(f"Python {sys.version.split()[0]}, {sys.executable}", tuple(entries), tuple(faults))


def _packages(have: Mapping[str, Distribution]) -> Iterator[Entry]:
    outcomes = checks.run("import", list(MODULES.values()))
    for name, module in MODULES.items():
        found, outcome = have.get(packages.normal(name)), outcomes[module]
        if found is None and not outcome.works:
            yield Entry("package", name, "absent", "not installed", repair=AGAIN)
        elif not outcome.works:
            version = found.version if found else ""
            yield Entry("package", name, "broken", f"{version}: import fails, {outcome.detail}", repair=AGAIN)
        elif found is None:
            yield Entry("package", name, "works", f"not from a package, {outcome.detail}")
        elif (folder := packages.shadow(found, outcome.detail)) is not None:
            detail = f"{found.version} is installed, but {folder} hides it"
            yield Entry("package", name, "broken", detail, repair="unset PYTHONPATH")
        else:
            yield Entry("package", name, "works", found.version)
    for name, extra in EXTRAS.items():
        if name in have:
            yield Entry("package", name, "works", have[name].version, False)
        else:
            yield Entry("package", name, "absent", "not installed", False, f"pip install 'wholebody[{extra}]'")


def _solvers(have: Mapping[str, Distribution]) -> Iterator[Entry]:
    present = [name for name, package in SOLVERS.items() if package in have]
    outcomes = checks.run("program", present)
    for name, package in SOLVERS.items():
        if name in outcomes:
            repair = "" if outcomes[name].works else f"pip install --force-reinstall {package}"
            state: State = "works" if outcomes[name].works else "broken"
            yield Entry("QP solver", name, state, outcomes[name].detail, name == "osqp", repair)
        else:
            yield Entry("QP solver", name, "absent", "not installed", name == "osqp", f"pip install {package}")


def _methods() -> Iterator[Entry]:
    for name, outcome in checks.run("pose", installed_methods()).items():
        if outcome.works:
            yield Entry("method", name, "works", outcome.detail)
        else:
            repair = f"pip install --force-reinstall 'wholebody[{OF_METHODS[name]}]'" if name in OF_METHODS else AGAIN
            yield Entry("method", name, "broken", outcome.detail, name not in OF_METHODS, repair)


def _tools() -> Iterator[Entry]:
    for name, outcome in checks.run("tool", list(TOOLS)).items():
        use, repair = TOOLS[name]
        if outcome.works:
            yield Entry("tool", name, "works", f"{outcome.detail}, {use}", False)
        elif outcome.detail.endswith("not found"):
            yield Entry("tool", name, "absent", use, False, repair)
        else:
            yield Entry("tool", name, "broken", outcome.detail, False, repair)


def _cache() -> Entry:
    outcome = checks.run("cache", ["convex pieces"])["convex pieces"]
    state: State = "works" if outcome.works else "absent"
    repair = "" if outcome.works else "let WHOLEBODY_CACHE name a folder that can be written"
    return Entry("cache", "convex pieces", state, outcome.detail, False, repair)


def _faults(have: Mapping[str, Distribution], environ: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Faults of the interpreter, of packages that exclude each other, and of search paths."""
    if fault := packages.python_fault():
        yield fault, "make an environment with one of them: python3.12 -m venv .venv"
    for conflict in packages.conflicts(have):
        yield str(conflict), conflict.repair
    for folder, hidden in packages.shadowing_folders(environ, MODULES.values()).items():
        yield f"PYTHONPATH names {folder}, whose {', '.join(hidden)} hide the installed ones", "unset PYTHONPATH"
    for folder, hidden in packages.loader_folders(environ).items():
        sentence = f"LD_LIBRARY_PATH names {folder}, whose {', '.join(hidden)} replace the installed ones"
        yield sentence, "unset LD_LIBRARY_PATH"
