"""Names of a package that are loaded when they are first used (PEP 562)."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path


def exported(package: str, file: str) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """Return a package's `__getattr__`, `__dir__` and `__all__`: the names that its stub imports."""
    folder = Path(file).parent
    home = _listed(folder)

    def load(name: str) -> object:
        if name not in home:
            rooms = [one for one, where in home.items() if where == package and not name.startswith("_")]
            found = (one for one in rooms if name in _listed(folder / one))
            message = f"module {package!r} has no attribute {name!r}"
            message += "".join(f"; it is {package}.{one}.{name}" for one in found)
            raise AttributeError(message, name=name, obj=sys.modules[package])  # Python names the nearest
        room = home[name] == package
        value = import_module(f"{package}.{name}") if room else getattr(import_module(home[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    return load, lambda: sorted(home), sorted(home)


def _listed(folder: Path) -> dict[str, str]:
    """The names that the stub of a package in a folder imports, and the modules that they come from."""
    home, module, stub = dict[str, str](), "", folder / "__init__.pyi"
    for line in stub.read_text(encoding="utf-8").splitlines() if stub.is_file() else ():
        module = line.split()[1] if line.startswith("from ") else module
        home.update({part.split(",")[0].strip(): module for part in line.split(" as ")[1:]})
    return home
