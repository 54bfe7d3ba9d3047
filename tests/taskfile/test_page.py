"""docs/taskfile.md has every table, type and key that files can have, with the values that it takes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import wholebody as wb
from wholebody.taskfile.kinds import Key
from wholebody.taskfile.schema import TABLES, TOP


@pytest.fixture(scope="module")
def page(root: Path) -> str:
    return (root / "docs/taskfile.md").read_text()


def rows(page: str, keys: tuple[Key, ...]) -> list[str]:
    """The keys without a row that has their values; a key in bold is needed."""
    bold = {True: "**", False: ""}
    wanted = {key.name: f"- {bold[key.required]}`{key.name}`{bold[key.required]} ({key.kind.words}): " for key in keys}
    return [name for name, row in wanted.items() if row not in page]


def test_the_page_has_every_key_of_every_table(page: str) -> None:
    assert rows(page, TOP) == []
    sections = {re.match(r"`\[+(\w+)", part)[1]: part for part in page.split("\n## ")[2:]}  # type: ignore[index]
    assert list(sections) == list(TABLES)
    read = ""
    for name, table in TABLES.items():
        section = sections[name]
        read += section  # keys and types that an earlier table has are named there
        assert rows(read, table.keys) == [], name
        assert all(f"`{key.name}`" in section for key in table.keys), name
        for form_name, form in (table.forms or {}).items():
            assert f'{table.chooser} = "{form_name}"' in section or f"`{form_name}`" in section, (name, form_name)
            assert rows(read, tuple(key for key in form.keys if key.name != "weight")) == [], (name, form_name)


def test_the_page_names_no_key_that_files_do_not_have(page: str) -> None:
    tables = TABLES.values()
    forms = [form for table in tables for form in (table.forms or {}).values()]
    known = {
        key.name for keys in (TOP, *(table.keys for table in tables), *(form.keys for form in forms)) for key in keys
    }
    known |= {table.chooser for table in tables} | {name for table in tables for name in table.forms or {}}
    assert set(re.findall(r"^- \**`(\w+)`", page, re.MULTILINE)) <= known


def test_the_example_on_the_page_is_solved(page: str, tmp_path: Path) -> None:
    example = re.search(r"```toml\n(.*?)```", page, re.DOTALL)
    assert example
    (tmp_path / "example.toml").write_text(example[1])
    task = wb.read_task(tmp_path / "example.toml")
    assert wb.solve(task.problem, task.method).solved
