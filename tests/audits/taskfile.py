"""The documentation of task files, written from the tables that the reader uses.

``python -m tests.audits.taskfile`` prints it; docs/taskfile.md is its output.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import replace

from wholebody.taskfile.kinds import Form, Key, Table
from wholebody.taskfile.schema import TABLES, TOP

_UNIT = re.compile(r" \[[^]]*\]")

INTRODUCTION = """\
# Task files

<!-- Written by `python -m tests.audits.taskfile`; change the tables in wholebody/taskfile, not this page. -->

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
    parts, before = [INTRODUCTION, "## Top of the file\n", _rows(TOP)], dict[str, Table]()
    for name, table in TABLES.items():
        parts += [f"## {_brackets(name, table)}\n", f"{table.says}\n", *_types(table, before)]
        before[name] = table
    return "\n".join(parts)


def _types(table: Table, before: Mapping[str, Table]) -> list[str]:
    """The keys and types of a table; types that an earlier table has are only named."""
    forms, shared = dict(table.forms or {}), _chooser(table) + _rows(table.keys)
    for earlier, other in before.items():
        same = [name for name, form in forms.items() if _has(other, name, form)]
        if same:
            lost = any(len(forms[name].keys) < len((other.forms or {})[name].keys) for name in same)
            names, lacks = ", ".join(f"`{name}`" for name in same), ", without `weight`" if lost else ""
            shared += f"- {names}: as of `[[{earlier}]]`{lacks}\n"
            forms = {name: form for name, form in forms.items() if name not in same}
    weights = [key for form in forms.values() for key in form.keys if key.name == "weight"]
    if weights:  # one row for all types, which have the unit alone
        shared += _rows((replace(weights[0], says=_UNIT.sub("", weights[0].says)),))
    parts, known = [shared] if shared else [], dict[str, Form]()
    for name, form in forms.items():
        parts.append(_form(table.chooser, name, form, known))
        known[name] = form
    return parts


def _has(other: Table, name: str, form: Form) -> bool:
    """Whether a table has a type with this name, this meaning and at least these keys."""
    twin = (other.forms or {}).get(name)
    return twin is not None and twin.says == form.says and set(form.keys) <= set(twin.keys)


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
    return f"{heading}\n{said}{_rows(own, weight=False)}" if form.keys else heading


def _rows(keys: tuple[Key, ...], weight: bool = True) -> str:
    """A row a key; of a weight only its unit where the table has its row."""
    rows = ""
    for key in keys:
        name = f"**`{key.name}`**" if key.required else f"`{key.name}`"
        says = re.sub(r"(^|; )([^;,]*) if left out$", r"\1default: \2", key.says)
        unit = _UNIT.search(says) if key.name == "weight" and not weight else None
        rows += f"- {name}{unit[0]}\n" if unit else f"- {name} ({key.kind.words}): {says}\n"
    return rows


if __name__ == "__main__":
    sys.stdout.write(page())
