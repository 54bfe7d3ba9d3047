"""Which entrants there are, and which of them are installed here."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from importlib.util import find_spec
from types import MappingProxyType
from typing import NamedTuple

from wholebody.bench.entrants.base import Entrant
from wholebody.bench.entrants.own import NEWTONS, ccd_entrant, dls_entrant, newton_entrant, placo_entrant, qp_entrant
from wholebody.errors import MissingPackageError, UnknownNameError

SOLVERS = {"quadprog": "quadprog", "proxqp": "proxsuite", "piqp": "piqp"}
"""Further QP solvers that the extra `solvers` installs: their names in qpsolvers -> the modules they need."""


class _Row(NamedTuple):
    """How to build an entrant, the modules it needs, and the extra that installs them."""

    build: Callable[[], Entrant]
    modules: tuple[str, ...] = ()
    extra: str = ""

    def installed(self) -> bool:
        return all(find_spec(module) for module in self.modules)


def entrants(names: Iterable[str] | None = None) -> tuple[Entrant, ...]:
    """The entrants of these names, in the order given; all installed ones where None.

    The name of a method with several entrants, "qp" or "newton", means all of them that are installed.

    Raises:
        UnknownNameError: there is no such entrant.
        MissingPackageError: what it needs is not installed.
    """
    rows = _rows()
    if names is None:
        return tuple(row.build() for row in rows.values() if row.installed())
    families = {name.partition("/")[0] for name in rows}
    chosen: dict[str, None] = {}
    for name in names:
        if name in rows:
            chosen[name] = None
        elif name in families:
            chosen.update(dict.fromkeys(key for key in rows if key.startswith(f"{name}/") and rows[key].installed()))
        else:
            raise UnknownNameError("method", name, {*rows, *families})
    for name in chosen:
        if not rows[name].installed():
            raise MissingPackageError(f"{name} is not installed; install it with: {_command(rows[name])}")
    return tuple(rows[name].build() for name in chosen)


def names() -> tuple[str, ...]:
    """Names of all entrants, installed or not, in the order of reports."""
    return tuple(_rows())


def missing() -> Mapping[str, str]:
    """Entrants whose packages are not installed -> the command that installs them."""
    return MappingProxyType({name: _command(row) for name, row in _rows().items() if not row.installed()})


def _command(row: _Row) -> str:
    return f"pip install 'wholebody[{row.extra}]'"


def _pink() -> Entrant:
    from wholebody.bench.entrants.pink_entrant import pink_entrant

    return pink_entrant()


def _mink() -> Entrant:
    from wholebody.bench.entrants.mink_entrant import mink_entrant

    return mink_entrant()


def _rows() -> dict[str, _Row]:
    from wholebody.methods.qp.solvers.registry import solver_names

    rows = {f"qp/{solver}": _Row(partial(qp_entrant, solver)) for solver in ("osqp", "daqp")}
    for solver, module in SOLVERS.items():
        rows[f"qp/{solver}"] = _Row(partial(qp_entrant, solver, module), (module,), "solvers")
    for solver in solver_names():  # any other that qpsolvers finds on this machine
        rows.setdefault(f"qp/{solver}", _Row(partial(qp_entrant, solver, solver)))
    for way in NEWTONS:
        rows[f"newton/{way}"] = _Row(partial(newton_entrant, way))
    rows["ccd"] = _Row(ccd_entrant)
    rows["dls"] = _Row(dls_entrant)
    rows["placo"] = _Row(placo_entrant, ("placo",), "placo")
    rows["pink"] = _Row(_pink, ("pink", "daqp"), "compare")
    rows["mink"] = _Row(_mink, ("mink", "mujoco", "daqp"), "compare")
    return rows
