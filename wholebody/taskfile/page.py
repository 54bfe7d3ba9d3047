"""The documentation of task files, written from the tables that the reader uses.

``python -m wholebody.taskfile.page`` prints it; docs/taskfile.md is its output.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping

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
before anything is computed. The message names file, line, key and the correction. Keys in bold are needed.

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
    parts = [INTRODUCTION, "## Top of the file\n", _rows(TOP)]
    for name, table in TABLES.items():
        parts += [f"## {_brackets(name, table)}\n", f"{table.says}\n"]
        shared = _chooser(table) + _rows(table.keys)
        if shared:
            parts.append(shared)
        known: dict[str, Form] = {}
        for form_name, form in (table.forms or {}).items():
            parts.append(_form(table.chooser, form_name, form, known))
            known[form_name] = form
    return "\n".join(parts)


def _brackets(name: str, table: Table) -> str:
    return f"`[[{name}]]`, any number" if table.many else f"`[{name}]`"


def _chooser(table: Table) -> str:
    if table.forms is None:
        return ""
    implied = "".join(f"; may be left out beside `{key}`" for key, _ in table.implied)
    options = ", ".join(f'`"{name}"`' for name in table.forms)
    return f"- **`{table.chooser}`** ({options}): one of the types below{implied}\n"


def _form(chooser: str, name: str, form: Form, known: Mapping[str, Form]) -> str:
    """A type with its keys; three or more that an earlier type has are only named."""
    heading = f'### {chooser} = "{name}"\n\n{form.says}\n'
    own, said = form.keys, ""
    for earlier, other in known.items():
        shared = [key for key in own if key in other.keys]
        if len(shared) >= 3 and not said:
            said = f"- {', '.join(f'`{key.name}`' for key in shared)}: as of `{earlier}`\n"
            own = tuple(key for key in own if key not in shared)
    return f"{heading}\n{said}{_rows(own)}" if form.keys else heading


def _rows(keys: tuple[Key, ...]) -> str:
    names = [f"**`{key.name}`**" if key.required else f"`{key.name}`" for key in keys]
    said = [re.sub(r"(^|; )([^;,]*) if left out$", r"\1default: \2", key.says) for key in keys]
    return "".join(f"- {name} ({key.kind.words}): {text}\n" for name, key, text in zip(names, keys, said, strict=True))


if __name__ == "__main__":
    sys.stdout.write(page())
