"""Results as files: CSV with the machine at its head, texts of its cells, sections of pages between two markers."""

from __future__ import annotations

import csv
import dataclasses
import io
import os
import platform
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import date
from functools import cache
from importlib import metadata
from math import isfinite
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from wholebody.base.errors import FileFormatError
from wholebody.base.files import make_folder, write
from wholebody.bench.statistics import Interval
from wholebody.version import __version__


def machine() -> dict[str, str]:
    """Return what a reader has to know of the machine and of the versions, in the order in which it is written."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    facts = {
        "wholebody": __version__,
        "date": date.today().isoformat(),
        "processor": _processor(),
        "cores": str(usable),
        "load": f"{os.getloadavg()[0]:.1f} in the minute before",
        "system": f"{platform.system()} {platform.release()}, {platform.libc_ver()[1] or 'unknown libc'}",
        "python": platform.python_version(),
        "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "not set"),
    }
    facts["numba"] = _version("numba") or "not installed"  # our own linearisation is faster with it
    packages = (
        "pin", "coal", "numpy", "scipy", "osqp", "daqp", "quadprog", "proxsuite", "piqp", "qpsolvers",
        "placo", "pin-pink", "mink", "mujoco", "rapier3d", "matplotlib",
    )  # fmt: skip
    installed = {name: _version(name) for name in packages}
    return facts | {name: version for name, version in installed.items() if version}


def sentence(facts: Mapping[str, str]) -> str:
    """The facts in one sentence of Markdown, without the system and the versions of packages: CSV files have these."""
    kept = "wholebody", "date", "processor", "cores", "load", "OMP_NUM_THREADS"
    told = [f"{name} {value}" for name, value in facts.items() if name in kept]
    return f"Measured with {'; '.join(told)}."


def formatted(value: float, spec: str, unit: str = "", none: str = "") -> str:
    """A number by a format, with its unit, without exponents of large ones; `none` for one that is not finite."""
    if not isfinite(value):
        return none
    text = f"{value:{spec}}"
    return (f"{value:.0f}" if "e+" in text and spec.endswith("g") else text) + unit


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


_R = TypeVar("_R")


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    make_folder(path.parent)
    write(path, text)


def write_rows(path: Path, facts: Mapping[str, str], rows: Sequence[Any]) -> None:
    """Write dataclass instances, one a line, an interval in three columns; the facts stand above as comments."""
    text = io.StringIO()
    for name, value in facts.items():
        text.write(f"# {name}: {value}\n")
    cells = [flat(row) for row in rows]
    names = list(dict.fromkeys(name for each in cells for name in each))
    text.write(_line(names))
    for each in cells:
        values = [each.get(name, "") for name in names]
        text.write(_line([repr(value) if isinstance(value, float) else str(value) for value in values]))
    write_text(path, text.getvalue())


def flat(row: Any) -> dict[str, Any]:
    """The fields of a row by name, the ends of those that are intervals, and the entries of those that are mappings."""
    given = {field.name: getattr(row, field.name) for field in dataclasses.fields(row)}
    cells: dict[str, Any] = {}
    for field, value in given.items():
        for name, each in value.items() if isinstance(value, Mapping) else [(field, value)]:
            cells[name] = each
            if isinstance(each, Interval):
                cells |= {name: each.value, f"{name}_low": each.low, f"{name}_high": each.high}
    return cells


def of(compute: Callable[..., Any]) -> dict[str, Callable[..., Any]]:
    """What computes a field of a row from the sources of the row, as `metadata` of the field; see `filled`."""
    return {"of": compute}


def filled(kind: type[_R], *sources: Any, **values: Any) -> _R:
    """A row of a kind: fields by name, or as `of` computes them, or from the first source with such an attribute."""
    for name, as_type, compute in _columns(kind):  # type: ignore[arg-type]
        if name not in values and compute is not None:
            found = compute(*sources)
            values[name] = found if as_type is Interval else as_type(found)
        elif name not in values:
            values[name] = next(getattr(source, name) for source in sources if hasattr(source, name))
    return kind(**values)


@cache
def _columns(kind: Any) -> list[tuple[str, Any, Callable[..., Any] | None]]:
    """Name and type of each field of a kind of rows, and what computes it."""
    types = get_type_hints(kind)
    return [(field.name, types[field.name], field.metadata.get("of")) for field in dataclasses.fields(kind)]


def programs_text(programs: Mapping[str, int]) -> str:
    """How many programs each solver closed, most first, such as "active set 7, osqp 1"; empty where there were none."""
    return ", ".join(f"{by} {count}" for by, count in sorted(programs.items(), key=lambda entry: (-entry[1], entry[0])))


def summed_programs(texts: Iterable[str]) -> str:
    """Several texts of `programs_text` as one."""
    total: Counter[str] = Counter()
    for text in filter(None, texts):
        for part in text.split(", "):
            by, _, count = part.rpartition(" ")
            total[by] += int(count)
    return programs_text(total)


def publish_text(docs: Path, name: str, report: str, page: str | None, pictures: Sequence[str] = ()) -> Path:
    """Write a report to ``assets/bench/NAME.txt`` of the documentation, its pictures and first table to a page."""
    whole = docs / "assets" / "bench" / f"{name}.txt"
    if page is not None:
        table = re.search(r"^\|.*(?:\n\|.*)*", report, re.MULTILINE)
        measured = re.search(r"^Measured (?:with|on) .*", report, re.MULTILINE)
        parts = [*pictures, *(found[0] for found in (table, measured) if found)]
        replace_section(docs / page, name, "\n\n".join(parts) + f" [Everything measured](assets/bench/{whole.name}).")
    write_text(whole, report + "\n")
    return whole if page is None else docs / page


def replace_section(path: Path, name: str, text: str) -> None:
    """Put text between the markers ``<!-- bench:NAME -->`` and ``<!-- /bench:NAME -->`` of a page."""
    first, last = f"<!-- bench:{name} -->", f"<!-- /bench:{name} -->"
    if not path.is_file():
        raise FileFormatError(f"{path}: there is no such page; give the folder that holds results.md")
    page = path.read_text(encoding="utf-8")
    head, opened, rest = page.partition(first)
    _, closed, tail = rest.partition(last)
    if not opened or not closed:
        raise FileFormatError(
            f"{path}: the markers {first} and {last} are not in it; put them where the result belongs"
        )
    write_text(path, f"{head}{first}\n\n{text.strip()}\n\n{last}{tail}")


def _line(cells: Iterable[str]) -> str:
    """A line of CSV; cells with line breaks of any kind are quoted."""
    line = io.StringIO(newline="")
    csv.writer(line, lineterminator="\r\n").writerow(cells)  # it quotes only what its own lines end with
    return line.getvalue().removesuffix("\r\n") + "\n"
