"""The whole examination: installed parts, working parts, and every fault with its repair.

A binary package of the wrong version can crash the process that imports it. So a child process tries one name after the
other. If it crashes, the present name caused the crash, and a new child process continues with the others.
"""

from __future__ import annotations

import csv
import os
import re
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module, metadata
from pathlib import Path
from typing import Literal, NamedTuple

from wholebody.base.runner import Child, EndedError
from wholebody.methods import EXTRAS as OF_METHODS
from wholebody.methods import installed_methods

with Path(__file__).with_name("packages.csv").open(encoding="utf-8", newline="") as _file:
    _ROWS = list(csv.DictReader(_file))

MODULES = {row["name"]: row["module"] for row in _ROWS if row["module"]}
"""Required packages: distribution -> its module."""

EXTRAS = {row["name"]: row["extra"] for row in _ROWS if row["extra"]}
"""Optional packages: distribution -> the extra that installs it."""

LIBRARIES = ("libpinocchio", "libcoal", "libhpp-fcl", "libeigenpy", "libboost_python", "liburdfdom", "libassimp")
"""Shared libraries of which other versions break those of the wheels."""

_EXACT = re.compile(r"^\s*(?P<name>[\w.-]+)\s*==\s*(?P<version>[\w.+!-]+)\s*$")


class Distribution(NamedTuple):
    """An installed distribution."""

    version: str  # its version
    requires: tuple[str, ...] = ()  # its requirements, as its metadata states them
    files: frozenset[str] = frozenset()  # absolute paths of its files; empty if its metadata does not list them


class Conflict(NamedTuple):
    """Two incompatible packages."""

    who: str  # the one with the requirement
    needs: str  # its requirement, such as ``pin==3.8.0``
    found: str | None  # the installed version; None if there is none

    @property
    def repair(self) -> str:
        """The command that repairs it."""
        return f"pip install '{self.needs}'" if self.who == "wholebody" else f"pip install '{self.who}' '{self.needs}'"

    def __str__(self) -> str:
        """Return one sentence."""
        found = f"{self.found} is installed" if self.found else "it is not installed"
        return f"{self.who} needs {self.needs}, and {found}"


def normal(name: str) -> str:
    """Spell a distribution's name as indexes do (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def installed(names: Iterable[str]) -> dict[str, Distribution]:
    """The installed ones of the named distributions, and the distributions that they require in an exact version."""
    found: dict[str, Distribution] = {}
    left = [normal(name) for name in names]
    seen = set(left)
    while left:
        name = left.pop()
        try:
            distribution = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            continue
        files = frozenset(os.path.realpath(str(file.locate())) for file in distribution.files or ())
        found[name] = Distribution(distribution.version, tuple(distribution.requires or ()), files)
        needed = {other for other, _ in exact_needs(found[name])} - seen
        seen |= needed
        left += needed
    return found


def exact_needs(distribution: Distribution) -> list[tuple[str, str]]:
    """Requirements of the form ``name==version`` without a condition: (name, version)."""
    matches = (_EXACT.match(requirement) for requirement in distribution.requires)
    return [(normal(match["name"]), match["version"]) for match in matches if match]


def conflicts(have: Mapping[str, Distribution]) -> list[Conflict]:
    """Exact versions that an installed package requires and that are not installed: pin, coal, placo are so built."""
    found = []
    for who, distribution in sorted(have.items()):
        for name, version in exact_needs(distribution):
            other = have.get(name)
            if other is None or other.version != version:
                found.append(Conflict(who, f"{name}=={version}", other.version if other else None))
    return found


def shadow(distribution: Distribution, file: str) -> str | None:
    """Folder from which another package of the same name was imported, or None if the right one was imported."""
    if not distribution.files or os.path.realpath(file) in distribution.files:
        return None
    return os.path.dirname(os.path.dirname(file))


def python_fault(version: tuple[int, int] = sys.version_info[:2]) -> str | None:
    """Say what is wrong with the interpreter's version, if anything."""
    if (3, 10) <= version <= (3, 14):
        return None
    return f"Python {version[0]}.{version[1]} is not one of 3.10 to 3.14, for which the required packages exist"


def shadowing_folders(environ: Mapping[str, str], modules: Iterable[str]) -> dict[str, list[str]]:
    """Folders of PYTHONPATH, as after sourcing a workspace of ROS, with modules of these names: folder -> modules."""
    found: dict[str, list[str]] = {}
    for folder in _folders(environ, "PYTHONPATH"):
        hidden = sorted({name for name in modules if (folder / name).is_dir() or (folder / f"{name}.py").is_file()})
        if hidden:
            found[str(folder)] = hidden
    return found


def loader_folders(environ: Mapping[str, str]) -> dict[str, list[str]]:
    """Folders of LD_LIBRARY_PATH with libraries that would replace the wheels' own: folder -> libraries."""
    found: dict[str, list[str]] = {}
    for folder in _folders(environ, "LD_LIBRARY_PATH"):
        hidden = [name for name in LIBRARIES if any(folder.glob(f"{name}*.so*"))]
        if hidden:
            found[str(folder)] = hidden
    return found


def _folders(environ: Mapping[str, str], variable: str) -> list[Path]:
    return [Path(entry) for entry in environ.get(variable, "").split(os.pathsep) if entry and os.path.isdir(entry)]


TIMEOUT = 300.0
"""Time limit of a check, seconds; a check takes one or two, more on a busy machine; the first compiles the loops."""


class Outcome(NamedTuple):
    """The outcome of a check."""

    works: bool  # whether the check succeeded
    detail: str  # the finding, or the reason of the failure, in a few words


def solve_program(name: str) -> str:
    """Solve ``min (x^2 + y^2) / 2 - x - y`` with ``x + y <= 1`` by a solver of qpsolvers: x = y = 1/2."""
    import numpy as np
    from qpsolvers import solve_qp
    from scipy import sparse

    matrix, row = sparse.eye_array(2, format="csc"), sparse.csc_array([[1.0, 1.0]])
    if name in ("daqp", "quadprog"):
        matrix, row = matrix.toarray(), row.toarray()
    x = solve_qp(matrix, -np.ones(2), row, np.ones(1), lb=-np.ones(2), ub=np.ones(2), solver=name)
    if x is None or not np.abs(x - 0.5).max() < 1e-2:
        raise ArithmeticError(f"a program of two variables gave {x}, not [0.5, 0.5]")
    return f"off by {np.abs(x - 0.5).max():.0e}"


def pose_person(method: str) -> str:
    """Reach 5 cm forward by a method."""
    import wholebody as wb
    from wholebody.figures.state import State

    figure = wb.load("human", detail="spheres")
    state = State(figure.model).update(figure.posture("standing"))
    target = state.frame(figure.frame_id("right_index_tip")).translation + (0.05, 0.0, 0.0)
    solution = wb.solve(wb.Problem(wb.Scene(figure), "standing", goals=[wb.Point("right_index_tip", target)]), method)
    if not solution.solved:
        raise ArithmeticError(f"a reach of 5 cm ended {solution.status}")
    return f"{1e3 * solution.seconds:.0f} ms for a small reach"


def use_tool(name: str) -> str:
    """Draw an empty page with Chromium, or find ffmpeg."""
    if name == "ffmpeg":
        path: str | None = shutil.which(name)
        if path is None:
            raise FileNotFoundError("not found")
        return str(path)
    from wholebody.view.browser import Browser, find_chromium
    from wholebody.view.page import static_page

    path = find_chromium()
    if path is None:
        raise FileNotFoundError("not found")
    with Browser((64, 64)) as browser:
        browser.open_html(static_page([]))
        browser.capture()
    return path


def look_at_cache(_: str) -> str:
    """Say what the cache of mesh pieces holds."""
    from wholebody.geometry.mesh_cache import LARGEST_CACHE, cache_state

    state = cache_state()
    size, most = state.size / 2**20, LARGEST_CACHE // 2**20
    held = f"{state.entries} meshes, {size:.1f} of at most {most} MB, in {state.folder}"
    if not state.writable:
        raise PermissionError(f"{held}, which cannot be written: pieces of meshes are made anew each time")
    return held


CHECKS: dict[str, Callable[[str], str]] = {
    "import": lambda name: str(import_module(name).__file__),
    "program": solve_program,
    "pose": pose_person,
    "tool": use_tool,
    "cache": look_at_cache,
}


def run(kind: str, names: Sequence[str], timeout: float = TIMEOUT) -> dict[str, Outcome]:
    """Try names one after the other."""
    child, outcomes = Child(), dict[str, Outcome]()
    try:
        for name in names:
            try:
                outcomes[name] = child.call(attempt, kind, name, seconds=timeout)
            except EndedError as error:
                said = f": {error.said}" if error.said else ""
                late = f"no answer within {timeout:.0f} s"
                outcomes[name] = Outcome(False, late if error.overtime else f"ended the process ({error.how}){said}")
    finally:
        child.close()
    return outcomes


def attempt(kind: str, name: str) -> Outcome:
    """Try a name in this process."""
    try:
        return Outcome(True, CHECKS[kind](name))
    except Exception as error:  # the check reports every failure
        return Outcome(False, f"{type(error).__name__}: {error}".strip().splitlines()[0])


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
    have = installed(["wholebody", *MODULES, *EXTRAS])
    entries = [*_packages(have), *_solvers(have), *_methods(), *_tools(), _cache()]
    faults = [*_faults(have, environ)]
    faults += [
        (f"the {entry.kind} {entry.name} is {entry.state}: {entry.detail}", entry.repair)
        for entry in entries
        if entry.state == "broken" or (entry.needed and entry.state == "absent")
    ]
    return Report(f"Python {sys.version.split()[0]}, {sys.executable}", tuple(entries), tuple(faults))


def _packages(have: Mapping[str, Distribution]) -> Iterator[Entry]:
    outcomes = run("import", list(MODULES.values()))
    for name, module in MODULES.items():
        found, outcome = have.get(normal(name)), outcomes[module]
        if found is None and not outcome.works:
            yield Entry("package", name, "absent", "not installed", repair=AGAIN)
        elif not outcome.works:
            version = found.version if found else ""
            yield Entry("package", name, "broken", f"{version}: import fails, {outcome.detail}", repair=AGAIN)
        elif found is None:
            yield Entry("package", name, "works", f"not from a package, {outcome.detail}")
        elif (folder := shadow(found, outcome.detail)) is not None:
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
    outcomes = run("program", present)
    for name, package in SOLVERS.items():
        if name in outcomes:
            repair = "" if outcomes[name].works else f"pip install --force-reinstall {package}"
            state: State = "works" if outcomes[name].works else "broken"
            yield Entry("QP solver", name, state, outcomes[name].detail, name == "osqp", repair)
        else:
            yield Entry("QP solver", name, "absent", "not installed", name == "osqp", f"pip install {package}")


def _methods() -> Iterator[Entry]:
    for name, outcome in run("pose", installed_methods()).items():
        if outcome.works:
            yield Entry("method", name, "works", outcome.detail)
        else:
            repair = f"pip install --force-reinstall 'wholebody[{OF_METHODS[name]}]'" if name in OF_METHODS else AGAIN
            yield Entry("method", name, "broken", outcome.detail, name not in OF_METHODS, repair)


def _tools() -> Iterator[Entry]:
    for name, outcome in run("tool", list(TOOLS)).items():
        use, repair = TOOLS[name]
        if outcome.works:
            yield Entry("tool", name, "works", f"{outcome.detail}, {use}", False)
        elif outcome.detail.endswith("not found"):
            yield Entry("tool", name, "absent", use, False, repair)
        else:
            yield Entry("tool", name, "broken", outcome.detail, False, repair)


def _cache() -> Entry:
    outcome = run("cache", ["convex pieces"])["convex pieces"]
    state: State = "works" if outcome.works else "absent"
    repair = "" if outcome.works else "let WHOLEBODY_CACHE name a folder that can be written"
    return Entry("cache", "convex pieces", state, outcome.detail, False, repair)


def _faults(have: Mapping[str, Distribution], environ: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Faults of the interpreter, of packages that exclude each other, and of search paths."""
    if fault := python_fault():
        yield fault, "make an environment with one of them: python3.12 -m venv .venv"
    for conflict in conflicts(have):
        yield str(conflict), conflict.repair
    for folder, hidden in shadowing_folders(environ, MODULES.values()).items():
        yield f"PYTHONPATH names {folder}, whose {', '.join(hidden)} hide the installed ones", "unset PYTHONPATH"
    for folder, hidden in loader_folders(environ).items():
        sentence = f"LD_LIBRARY_PATH names {folder}, whose {', '.join(hidden)} replace the installed ones"
        yield sentence, "unset LD_LIBRARY_PATH"
