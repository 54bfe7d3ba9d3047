"""The package as a whole: its public names, what importing it costs, and what every module must be."""

from __future__ import annotations

import ast
import copy
import pickle
import re
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import wholebody

PACKAGE = Path(wholebody.__file__).parent
HEAVY = ("pinocchio", "coal", "numpy", "scipy", "osqp", "placo", "meshcat", "trimesh", "matplotlib", "rich")
ROOMS = (
    *("version", "base", "geometry", "figures", "scene", "tasks", "terms", "problem", "assessment", "solution"),
    *(
        "methods",
        "motion",
        "tracking",
        "planning",
        "dynamics",
        "ergonomics",
        "taskfile",
        "view",
        "studies",
        "bench",
        "cli",
    ),
)
"""From the ground up; a room imports only from those before it, also where only type checkers look."""


def test_every_public_name_loads_and_is_documented() -> None:
    for name in wholebody.__all__:
        assert name == "__version__" or getattr(wholebody, name).__doc__, name
        assert name in dir(wholebody)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = wholebody.no_such_name  # type: ignore[attr-defined]
    with pytest.raises(AttributeError, match=r"it is wholebody\.tasks\.Lean$"):
        _ = wholebody.Lean  # type: ignore[attr-defined]


STUBS = sorted(Path(wholebody.__path__[0]).rglob("__init__.pyi"))


@pytest.mark.parametrize("stub", STUBS, ids=lambda stub: stub.parent.name)
def test_names_for_type_checkers_are_the_names_that_load(stub: Path) -> None:
    room = stub.parent.relative_to(wholebody.__path__[0]).parts
    module = import_module(".".join(("wholebody", *room)))
    tree = ast.parse(stub.read_text())
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module != "typing"]
    stated = {alias.name: node.module for node in imports for alias in node.names}
    assert len(STUBS) == 10
    for name in set(module.__all__) & {name for name, home in stated.items() if home != "wholebody"}:
        value = getattr(module, name)
        assert value is getattr(import_module(str(stated[name])), name)
        assert name == "__version__" or value.__doc__
    assert set(module.__all__) <= set(dir(module))


def test_some_sixty_names_stand_on_top() -> None:
    rooms = {name for name in dir(wholebody) if isinstance(getattr(wholebody, name), ModuleType)}
    assert len(rooms) <= 10
    assert len(set(dir(wholebody)) - rooms - {"__version__"}) <= 69


def test_errors_go_from_process_to_process() -> None:
    error = wholebody.UnknownNameError("frame", "plam", ["palm", "heel"], "goals[0]")
    for copied in (copy.copy(error), pickle.loads(pickle.dumps(error))):
        assert str(copied) == str(error)
        assert copied.known == error.known


def test_importing_loads_nothing_heavy() -> None:
    """Nor does what is used most load a library that few of its calls need.

    Solving, following, freeing a clip and a world: scipy.stats alone takes longer to load than many of these.
    """
    rare = ("scipy.stats", "scipy.signal", "scipy.optimize", "scipy.sparse", "scipy.special", "matplotlib", "rich")
    used = ("figures.human.figure", "taskfile", "methods.qp.method", "tracking", "motion.avoidance", "dynamics.world")
    code = f"import sys, wholebody; print(*sys.modules); import {', '.join('wholebody.' + name for name in used)}"
    command = [sys.executable, "-c", f"{code}; print(*sys.modules)"]
    first, later = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    assert not set(HEAVY) & set(first.split())
    assert not set(rare) & set(later.split())


IMPORT = re.compile(r"^ *(?:from (\S+) import (\([^)]*\)|[^#\n]*)|import ([^#\n]*))", re.MULTILINE)


@cache
def modules() -> dict[str, str]:
    """The text of every module, by its name; that of a package ends in `__init__`."""
    paths = sorted(PACKAGE.rglob("*.py"))
    return {".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts): path.read_text() for path in paths}


@cache
def imported(name: str) -> set[str]:
    """What a module imports, also within functions and for type checkers: modules, and each name after its module.

    The text is asked: to read the syntax of all modules takes a second.
    """
    found = set()
    for home, names, plain in IMPORT.findall(modules()[name]):
        each = [one.split()[0] for one in (names or plain).strip("()").replace("\n", " ").split(",") if one.split()]
        found |= {home, *(f"{home}.{one}" for one in each)} if home else set(each)
    return found


def test_a_module_is_one_idea() -> None:
    assert not [name for name, text in modules().items() if len(text.splitlines()) > 400]


def test_modules_import_downwards_only() -> None:
    upwards = []
    for name in modules():
        room = room_of(name)
        rooms = {other for other in map(room_of, imported(name)) if other is not None}
        upwards += [f"{name} imports {other}" for other in rooms if room and ROOMS.index(other) > ROOMS.index(room)]
    assert not upwards


def test_no_modules_import_each_other_in_a_circle() -> None:
    """Imports within functions and for type checkers count; what a package's own `__init__` gathers does not."""
    files = {name for name in modules() if not name.endswith(".__init__")}
    TopologicalSorter(
        {name: imported(name) & (files - {name}) for name in files}
    ).prepare()  # raises CycleError, which names a circle


def private_reads(tree: ast.AST) -> set[str]:
    """Underscored attributes that a module reads of objects whose class it does not define itself."""
    nodes = list(ast.walk(tree))
    own = {node.name for node in nodes if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    own |= {node.target.id for node in nodes if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)}
    reads = [node for node in nodes if isinstance(node, ast.Attribute) and node.attr.startswith("_")]
    own |= {node.attr for node in reads if isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")}
    return {node.attr for node in reads if not node.attr.startswith("__")} - own


def test_a_module_reads_nothing_private_of_another() -> None:
    private = re.compile(r"(?<!\bself)(?<!\bcls)\._(?!_)")  # others are read with their syntax
    found = {name: private_reads(ast.parse(text)) for name, text in modules().items() if private.search(text)}
    assert not {name: reads for name, reads in found.items() if reads}


CONSTANT = re.compile(r"`(?:[a-z_.]*?(\w+)\.)?([A-Z][A-Z0-9_]{2,})`")


def test_constants_that_comments_name_exist() -> None:
    """A number that moved to where it is used leaves its name in the words of others: `NAME`, or `module.NAME`."""
    found = []
    for name, text in modules().items():
        for home, constant in CONSTANT.findall(text):
            own = [other for key, other in modules().items() if key.split(".")[-1] == home] if home else [text]
            used = [one for one in own if re.search(rf"\b{constant}\b", CONSTANT.sub("", one))]
            found += [] if used or home in ("pin", "pinocchio") else [f"{name}: {constant}"]
    assert not found


def room_of(module: str) -> str | None:
    parts = module.split(".")
    return parts[1] if parts[0] == "wholebody" and len(parts) > 1 and parts[1] in ROOMS else None


def test_inner_loops_are_called_by_loops_alone() -> None:
    """Python cannot call them: retargeting called one that had become inner, and every clip failed."""
    files = {".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts): path for path in PACKAGE.rglob("*.py")}
    trees = {name: ast.parse(path.read_text()) for name, path in files.items()}

    def kinds(node: ast.stmt) -> set[bool]:
        """Whether a function is an inner loop, for each time that it is a loop."""
        found = [each for each in getattr(node, "decorator_list", ()) if ast.unparse(each).startswith("compiled(")]
        return {"inner=True" in ast.unparse(each) for each in found}

    inner = {(name, node.name) for name, tree in trees.items() for node in tree.body if True in kinds(node)}
    assert inner
    for name, tree in trees.items():
        known = {function for module, function in inner if module == name}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                known |= {each.asname or each.name for each in node.names if (node.module, each.name) in inner}
        for node in (node for node in tree.body if not kinds(node)):
            calls = [each.func for each in ast.walk(node) if isinstance(each, ast.Call)]
            called = {each.id for each in calls if isinstance(each, ast.Name)}
            assert not called & known, name
