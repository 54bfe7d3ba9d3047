"""The package as a whole: its public names, what importing it costs, and what every module must be."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import wholebody

PACKAGE = Path(wholebody.__file__).parent
HEAVY = ("pinocchio", "coal", "numpy", "scipy", "osqp", "placo", "meshcat", "trimesh", "matplotlib", "rich")
ROOMS = (
    *(
        "errors",
        "version",
        "checks",
        "files",
        "compiled",
        "pool",
        "runner",
        "geometry",
        "figures",
        "scene_geometry",
        "workspace",
        "scene",
        "tasks",
        "linearisation",
        "problem",
        "first_order",
        "assessment",
        "motion_assessment",
        "simplification",
        "methods",
    ),
    *("motion", "interaction", "taskfile", "view", "bench", "doctor", "cli"),
)
"""From the ground up; a room imports only from those before it."""
DOORS = {("scene", "wholebody.simplification.simplify")}
"""Methods that only hand on to a room above their own, which they import when they are called: `scene.simplified`."""


@pytest.mark.parametrize("name", wholebody.__all__)
def test_every_public_name_loads_and_is_documented(name: str) -> None:
    value = getattr(wholebody, name)
    assert name == "__version__" or value.__doc__
    assert name in dir(wholebody)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = wholebody.no_such_name  # type: ignore[attr-defined]


def test_names_for_type_checkers_are_the_names_that_load() -> None:
    tree = ast.parse((PACKAGE / "__init__.py").read_text())
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module != "typing"]
    stated = {alias.name: node.module for node in imports for alias in node.names}
    assert {name: stated[name] for name in wholebody._HOME} == wholebody._HOME


def test_importing_loads_nothing_heavy() -> None:
    code = "import sys, json, wholebody; print(json.dumps(sorted(sys.modules)))"
    loaded = json.loads(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
    assert not [name for name in HEAVY if name in loaded]


def modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_module_is_one_idea_and_imports_downwards_only(path: Path) -> None:
    text = path.read_text()
    assert len(text.splitlines()) <= 400
    room = room_of("wholebody." + ".".join(path.relative_to(PACKAGE).with_suffix("").parts))
    for node in running(ast.parse(text)):
        names = [node.module] if isinstance(node, ast.ImportFrom) else []
        names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        for name in names:
            other = room_of(name or "")
            if room is not None and other is not None:
                assert ROOMS.index(other) <= ROOMS.index(room) or (room, name) in DOORS, f"{room} imports {name}"


def running(tree: ast.AST) -> list[ast.AST]:
    """Nodes but for those that only type checkers see."""
    unseen = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    return [node for node in ast.walk(tree) if id(node) not in unseen]


def room_of(module: str) -> str | None:
    parts = module.split(".")
    return parts[1] if parts[0] == "wholebody" and len(parts) > 1 and parts[1] in ROOMS else None
