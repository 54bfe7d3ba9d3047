"""Which adapters there are, and which of them are installed here: those that solve, and those that follow a reach."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from inspect import signature
from pathlib import Path
from typing import Any, NamedTuple

from wholebody.base.arrays import with_values
from wholebody.base.errors import MissingPackageError, UnknownNameError
from wholebody.base.files import packaged_toml
from wholebody.bench.measure.track import Track
from wholebody.bench.suite.adapters.base import LADDER, Adapter, Outside, Tool, made
from wholebody.bench.suite.adapters.own import (
    NEWTONS,
    RETARGET,
    ccd_adapter,
    dls_adapter,
    newton_adapter,
    one_start,
    qp_adapter,
)
from wholebody.bench.suite.adapters.starts import ONE, STARTS, restarted
from wholebody.methods.base import Method
from wholebody.methods.solve import imported


class _Row(NamedTuple):
    """How to build an adapter, the modules it needs, and the extra that installs them."""

    build: Callable[[], Adapter]
    modules: Sequence[str] = ()
    extra: str = ""

    def installed(self) -> bool:
        return all(find_spec(module) for module in self.modules)

    def command(self) -> str:
        return f"pip install 'wholebody[{self.extra}]'"

    def check(self, name: str) -> None:
        if not self.installed():
            raise MissingPackageError(f"{name} is not installed; install it with: {self.command()}")


def adapters(names: Iterable[str] | None = None, starts: bool = False) -> tuple[Adapter, ...]:
    """The adapters of these names ("all", "newton" for several, "module:Class"); None: of each algorithm installed."""
    # methods that differ from another in their starts alone are among several only if `starts`
    rows = _rows()
    if names is None:
        listed = _texts()["taking_part"]
        usual = (*listed["usual"], *(listed["further"] if starts else ()))
        return tuple(rows[name].build() for name in usual if rows[name].installed())
    families = {name.partition("/")[0] for name in rows}
    several = [
        name
        for name, row in rows.items()
        if row.installed() and (starts or not name.endswith((f"/{ONE}", f"/{STARTS}")))
    ]
    chosen: list[str] = []
    for name in names:
        if ":" in name:
            rows[name] = _Row(partial(_own, name))
        if name in rows:
            chosen.append(name)
        elif name == "all" or name in families:
            chosen += [key for key in several if name in ("all", key.partition("/")[0])]
        else:
            raise UnknownNameError("method", name, {*rows, *families, "all"})
    for name in chosen:
        rows[name].check(name)
    return tuple(rows[name].build() for name in dict.fromkeys(chosen))


def names() -> tuple[str, ...]:
    """Names of all adapters, installed or not, in the order of reports."""
    return tuple(_rows())


def installed(name: str) -> bool:
    """Whether what an adapter needs is installed."""
    return _rows()[name].installed()


def missing() -> Mapping[str, str]:
    """Adapters whose packages are not installed -> the command that installs them."""
    return {name: row.command() for name, row in _rows().items() if not row.installed()}


def _rows() -> dict[str, _Row]:
    rows = {"qp": _Row(qp_adapter), "qp/osqp": _Row(partial(qp_adapter, "osqp"))}
    rows |= {f"newton/{way}": _Row(partial(newton_adapter, way)) for way in NEWTONS}
    rows |= {"ccd": _Row(ccd_adapter), "dls": _Row(dls_adapter)}
    outside = {name: said for name, said in _texts().items() if "extra" in said}
    rows |= {name: _Row(partial(_outside, name), said["modules"], said["extra"]) for name, said in outside.items()}
    rows |= {f"{family}/{ONE}": _Row(partial(one_start, family)) for family in ("qp", "newton", "ccd")}
    rows = {name: with_values(row, build=partial(_described, name, row.build)) for name, row in rows.items()}
    for family in ("qp", "newton", "ccd", "dls", "placo", "mink", "pink", "drake"):
        row = rows[f"{family}/{ONE}" if f"{family}/{ONE}" in rows else family]
        rows[f"{family}/{STARTS}"] = with_values(row, build=lambda build=row.build: restarted(build()))
    return rows


def _class_of(name: str, end: str = "") -> Any:
    """The class of an adapter's module, such as Placo, PrunedPlaco or PlacoTool."""
    family, _, variant = name.partition("/")
    file = _texts().get(family, {}).get("file", family)
    module = import_module(f"wholebody.bench.suite.adapters.{file}")
    return getattr(module, f"{variant.capitalize()}{family.capitalize()}{end}")


def _outside(name: str) -> Adapter:
    kind = _class_of(name)
    return Adapter(name, partial(made, kind, {}), getattr(kind, "loose", Outside.loose), kind.prepare)


def _own(name: str) -> Adapter:
    """A method of one's own; it gets a budget as far as its class has arguments for it."""
    kind = imported(name)
    known = signature(kind).parameters
    loose = LADDER if "tolerance" in known else ((1e-3, None),)
    return Adapter(name, partial(_made, kind, frozenset(known)), loose, setup="A method of one's own.")


def _made(kind: Callable[..., Method], known: frozenset[str], tolerance: float, iterations: int | None) -> Method:
    asked = {"tolerance": tolerance, "iterations": iterations}
    return kind(**{name: value for name, value in asked.items() if name in known and value is not None})


def _described(name: str, build: Callable[[], Adapter]) -> Adapter:
    """An adapter with its texts."""
    said = _texts()[name]
    return replace(build(), setup=said["setup"], differences=tuple(said.get("differences", ())))


def _texts() -> dict[str, Any]:
    return packaged_toml(Path(__file__).with_name("adapters.toml"))


STEPPING = ("wholebody", f"wholebody/{RETARGET}", "placo", "placo/pruned", "pink", "mink")
"""Every tool that follows reaches: an adapter, of which qp is called wholebody here."""


def chosen_tools(names: Iterable[str] | None = None) -> tuple[str, ...]:
    """Names of tools, all installed ones where None; UnknownNameError or MissingPackageError for one that is not."""
    known = _rows()
    rows = {name: known[name.replace("wholebody", "qp").removesuffix(f"/{RETARGET}")] for name in STEPPING}
    if names is None:
        return tuple(name for name, row in rows.items() if row.installed())
    chosen = tuple(names)
    for name in chosen:
        if name not in rows:
            raise UnknownNameError("tool", name, rows)
        rows[name].check(name)
    return chosen


def make_tool(name: str, track: Track) -> Tool:
    """Set a tool up for a reach; errors as in `chosen_tools`."""
    (name,) = chosen_tools([name])
    ours = name.startswith("wholebody")
    tool: Tool = _class_of("own", "Tool")(track, name) if ours else _class_of(name, "Tool")(track)
    return tool


def tool_differences(name: str) -> tuple[str, ...]:
    """What a tool cannot express of a reach, or does otherwise; one sentence each."""
    return tuple(_texts()["steps"].get(name, ()))
