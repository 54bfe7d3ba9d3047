"""Which adapters there are, and which of them are installed here: those that solve, and those that follow a reach."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from types import MappingProxyType
from typing import Any, NamedTuple

from wholebody.base.errors import MissingPackageError, UnknownNameError
from wholebody.base.records import with_values
from wholebody.bench.measure.track import Track
from wholebody.bench.suite.adapters.base import Adapter, Tool
from wholebody.bench.suite.adapters.own import NEWTONS, ccd_adapter, dls_adapter, newton_adapter, one_start, qp_adapter
from wholebody.bench.suite.adapters.starts import ONE, STARTS, restarted

SOLVERS = {"quadprog": "quadprog", "proxqp": "proxsuite", "piqp": "piqp"}
"""Further QP solvers that the extra `solvers` installs: their names in qpsolvers -> the modules they need."""


VARIANTS = (f"/{ONE}", f"/{STARTS}")

ALL = "all"
"""In place of a name: every method that is installed."""

USUAL = ("qp", "newton/slack", "ccd", "placo", "pink", "mink", "dls", "drake", "optik")
"""Methods where none is named: one of each algorithm. Their other settings take part by name, or with `ALL`."""

USUAL_FURTHER = (
    "placo/pruned",
    *(f"{family}/{STARTS}" for family in ("dls", "placo", "pink", "mink", "drake")),
    *(f"{family}/{ONE}" for family in ("qp", "newton", "ccd")),
)
"""With those, placo takes part with the pairs that a careful user leaves it, and every method but optik, which draws
its own, from one start and from several: qp, newton and ccd have several by default."""


class _Row(NamedTuple):
    """How to build an adapter, the modules it needs, and the extra that installs them."""

    build: Callable[[], Adapter]
    modules: tuple[str, ...] = ()
    extra: str = ""

    def installed(self) -> bool:
        return all(find_spec(module) for module in self.modules)

    def command(self) -> str:
        return f"pip install 'wholebody[{self.extra}]'"

    def check(self, name: str) -> None:
        if not self.installed():
            raise MissingPackageError(f"{name} is not installed; install it with: {self.command()}")


def adapters(names: Iterable[str] | None = None, starts: bool = False) -> tuple[Adapter, ...]:
    """The adapters of these names, in the order given; where None, the installed ones of `USUAL`.

    The name of a method with several adapters and none of that name, such as "newton", means all that are installed;
    "all" means every method that is installed. Methods that differ from another in their starts alone, such as
    "qp/one_start" and "mink/starts", are among several only if `starts` is true.

    Raises:
        UnknownNameError: there is no such adapter.
        MissingPackageError: what it needs is not installed.
    """
    rows = _rows()
    if names is None:
        usual = (*USUAL, *(USUAL_FURTHER if starts else ()))
        return tuple(rows[name].build() for name in usual if rows[name].installed())
    families = {name.partition("/")[0] for name in rows}
    chosen: dict[str, None] = {}
    for name in names:
        if name == ALL:
            several = (key for key in rows if rows[key].installed() and (starts or not key.endswith(VARIANTS)))
            chosen.update(dict.fromkeys(several))
        elif name in rows:
            chosen[name] = None
        elif name in families:
            family = (key for key in rows if key.startswith(f"{name}/") and (starts or not key.endswith(VARIANTS)))
            chosen.update(dict.fromkeys(key for key in family if rows[key].installed()))
        else:
            raise UnknownNameError("method", name, {*rows, *families, ALL})
    for name in chosen:
        rows[name].check(name)
    return tuple(rows[name].build() for name in chosen)


def names() -> tuple[str, ...]:
    """Names of all adapters, installed or not, in the order of reports."""
    return tuple(_rows())


def installed(name: str) -> bool:
    """Whether what an adapter needs is installed; false for a name that is none."""
    row = _rows().get(name)
    return row is not None and row.installed()


def missing() -> Mapping[str, str]:
    """Adapters whose packages are not installed -> the command that installs them."""
    return MappingProxyType({name: row.command() for name, row in _rows().items() if not row.installed()})


def _outside(name: str, variant: str = "") -> Adapter:
    build = getattr(import_module(f"wholebody.bench.suite.adapters.{name}"), f"{name}_adapter")
    made: Adapter = build(variant) if variant else build()
    return made


def _rows() -> dict[str, _Row]:
    from wholebody.methods.qp.solvers.registry import solver_names

    rows = {"qp": _Row(partial(qp_adapter, ""))}
    rows |= {f"qp/{solver}": _Row(partial(qp_adapter, solver)) for solver in ("active_set", "osqp", "daqp")}
    for solver, module in SOLVERS.items():
        rows[f"qp/{solver}"] = _Row(partial(qp_adapter, solver), (module,), "solvers")
    for solver in solver_names():  # any other that qpsolvers finds on this machine
        rows.setdefault(f"qp/{solver}", _Row(partial(qp_adapter, solver)))
    for way in NEWTONS:
        rows[f"newton/{way}"] = _Row(partial(newton_adapter, way))
    rows["ccd"] = _Row(ccd_adapter)
    rows["dls"] = _Row(dls_adapter)
    rows["placo"] = _Row(partial(_outside, "placo"), ("placo",), "placo")
    for variant in ("pruned", "soft"):
        rows[f"placo/{variant}"] = _Row(partial(_outside, "placo", variant), ("placo",), "placo")
    rows["pink"] = _Row(partial(_outside, "pink"), ("pink", "daqp"), "compare")
    mink = ("mink", "mujoco", "daqp"), "compare"
    rows["mink"] = _Row(partial(_outside, "mink"), *mink)
    rows["mink/hard"] = _Row(partial(_outside, "mink", "hard"), *mink)
    rows["drake"] = _Row(partial(_outside, "drake"), ("pydrake",), "drake")
    rows["optik"] = _Row(partial(_outside, "optik"), ("optik",), "optik")
    rows["embodik"] = _Row(partial(_outside, "embodik"), ("embodik",), "embodik")
    for family in ("qp", "newton", "ccd"):
        rows[f"{family}/{ONE}"] = _Row(partial(one_start, family))
    for family in ("qp", "newton", "ccd", "dls", "placo", "mink", "pink", "drake", "embodik"):
        row = rows.get(f"{family}/{ONE}", rows.get(family))
        assert row is not None
        rows[f"{family}/{STARTS}"] = with_values(row, build=partial(_restarted, row))
    return rows


def _restarted(row: _Row) -> Adapter:
    return restarted(row.build())


STEPPING = (
    "wholebody", "wholebody/active_set", "wholebody/osqp", "wholebody/daqp", *(f"wholebody/{name}" for name in SOLVERS),
    "placo", "placo/pruned", "pink", "mink",
)  # fmt: skip
"""Every tool that follows reaches: an adapter, of which qp is called wholebody here."""


def _row_of(tool: str) -> _Row:
    return _rows()[tool.replace("wholebody", "qp")]


def installed_tools() -> tuple[str, ...]:
    """Names of the tools whose packages are installed."""
    return tuple(name for name in STEPPING if _row_of(name).installed())


def chosen_tools(names: Iterable[str] | None) -> tuple[str, ...]:
    """Check names of tools; all installed ones where None.

    Raises:
        UnknownNameError: there is no such tool.
        MissingPackageError: its packages are not installed.
    """
    if names is None:
        return installed_tools()
    chosen = tuple(names)
    for name in chosen:
        if name not in STEPPING:
            raise UnknownNameError("tool", name, STEPPING)
        _row_of(name).check(name)
    return chosen


def make_tool(name: str, track: Track) -> Tool:
    """Set a tool up for a reach.

    Raises:
        UnknownNameError: there is no such tool.
        MissingPackageError: its packages are not installed.
    """
    kind = tool_class(name)
    tool: Tool = kind(track, name.partition("/")[2]) if name.startswith("wholebody/") else kind(track)
    return tool


def tool_class(name: str) -> Any:
    """The class of a tool, which says what it cannot express; the others' packages are not imported for it.

    Raises:
        UnknownNameError: there is no such tool.
        MissingPackageError: its packages are not installed.
    """
    (name,) = chosen_tools([name])
    family = name.partition("/")[0]
    module = "own" if family == "wholebody" else family
    kind = "PrunedPlaco" if name == "placo/pruned" else family.capitalize()
    return getattr(import_module(f"wholebody.bench.suite.adapters.{module}"), f"{kind}Tool")
