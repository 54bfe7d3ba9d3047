"""The documentation of task files, written from the tables that the reader uses.

``python -m wholebody.taskfile.page`` prints it; docs/taskfile.md is its output.
"""

from __future__ import annotations

import sys

from wholebody.taskfile.schema import TABLES, TOP
from wholebody.taskfile.tables import Form, Key, Table

INTRODUCTION = """\
# Task files

<!-- Written by `python -m wholebody.taskfile.page`; change the tables in wholebody/taskfile, not this page. -->

A task file states one problem in [TOML](https://toml.io): the figure, the things around it, goals, constraints and
measures. `wholebody pose TASK.toml` solves it, `wholebody show TASK.toml` shows its start, and
`wholebody.read_task("TASK.toml")` gives the same problem to a script.

Units are metres, radians, kilograms and seconds; z is up, x forward, y left; quaternions are x, y, z, w. Paths are
relative to the task file. An unknown key, a name that the figure does not have, or a value out of range is refused
before anything is computed. The message names file, line, key and the correction.

```toml
title = "Touch a point over a table"
clearance = 0.005

[figure]
name = "human"
sex = "female"
stature = 1.62

[[object]]
name = "table"
shape = "box"
size = [0.7, 1.2, 0.04]
at = [0.65, 0.0, 0.74]

[[goal]]
type = "point"
frame = "right_index_tip"
target = [0.55, -0.20, 0.85]

[[constraint]]
type = "hold"
frame = "left_foot"

[[constraint]]
type = "hold"
frame = "right_foot"
```
"""


def page() -> str:
    """Return the page, in Markdown."""
    parts = [INTRODUCTION, "## Top of the file\n", _keys(TOP)]
    for name, table in TABLES.items():
        parts += [f"## {_brackets(name, table)}\n", f"{table.says}\n"]
        shared = _chooser(table) + _rows(table.keys)
        if shared:
            parts.append(_header() + shared)
        for form_name, form in (table.forms or {}).items():
            parts.append(_form(table.chooser, form_name, form))
    return "\n".join(parts)


def _brackets(name: str, table: Table) -> str:
    return f"`[[{name}]]`, any number" if table.many else f"`[{name}]`"


def _chooser(table: Table) -> str:
    if table.forms is None:
        return ""
    implied = "".join(f"; may be left out beside `{key}`" for key, _ in table.implied)
    options = ", ".join(f'`"{name}"`' for name in table.forms)
    return f"| `{table.chooser}` | {options} | one of the types below{implied} | yes |\n"


def _form(chooser: str, name: str, form: Form) -> str:
    heading = f'### {chooser} = "{name}"\n\n{form.says}\n'
    return f"{heading}\n{_keys(form.keys)}" if form.keys else heading


def _keys(keys: tuple[Key, ...]) -> str:
    return _header() + _rows(keys)


def _header() -> str:
    return "| key | value | meaning | needed |\n|---|---|---|---|\n"


def _rows(keys: tuple[Key, ...]) -> str:
    rows = (f"| `{key.name}` | {key.kind.words} | {key.says} | {'yes' if key.required else ''} |\n" for key in keys)
    return "".join(rows).replace("|  |", "| |")


if __name__ == "__main__":
    sys.stdout.write(page())
