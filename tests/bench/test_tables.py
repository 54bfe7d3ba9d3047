"""Files of results: what is written is read back, tables keep their shape, pages change only between their markers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import jinja2
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.csv_rows import csv_rows
from wholebody.bench.rows import Row
from wholebody.bench.statistics import Interval
from wholebody.bench.tables import machine, render, sentence, write_rows

text = st.text(st.characters(blacklist_categories=("Cs",), blacklist_characters="\0"))
figures = st.fixed_dictionaries({"count": st.integers(), "value": st.floats(allow_nan=False)})


@given(st.lists(st.builds(Row, text, text, figures), min_size=1))
def test_rows_come_back_exactly(tmp_path_factory: pytest.TempPathFactory, rows: list[Row]) -> None:
    path = tmp_path_factory.mktemp("rows") / "rows.csv"
    write_rows(path, {"processor": "a: b", "cores": "2"}, rows)
    assert path.read_text(encoding="utf-8").startswith("# processor: a: b\n# cores: 2\n")
    back = [(row["case"], row["tool"], int(row["count"]), float(row["value"])) for row in csv_rows(path)]
    assert back == [(row.case, row.tool, row["count"], row["value"]) for row in rows]
    assert list(path.parent.iterdir()) == [path], "nothing else is left beside it"


@pytest.mark.parametrize("said", ["one\r\ntwo", "one\r", "\u2028", "# a: b\n# c: d"])
def test_line_breaks_in_a_cell_come_back(tmp_path: Path, said: str) -> None:
    write_rows(tmp_path / "rows.csv", {"processor": "a"}, [Row(said, "", {"count": 1}), Row("last", "", {"count": 2})])
    assert [row["case"] for row in csv_rows(tmp_path / "rows.csv")] == [said, "last"]


def test_the_machine_is_described() -> None:
    facts = machine()
    assert {"wholebody", "processor", "cores", "python", "OMP_NUM_THREADS", "pin", "coal", "numpy"} <= set(facts)
    assert all(value and "\n" not in value for value in facts.values())
    assert facts["processor"] in sentence(facts)


@dataclass(frozen=True)
class Mapped:
    name: str
    figures: dict[str, object]


def test_a_mapping_has_a_column_an_entry_and_what_a_row_lacks_is_empty(tmp_path: Path) -> None:
    rows = [Mapped("a", {"ms": 1.0}), Mapped("b", {"ms": Interval(2.0, 1.0, 3.0), "said": "no"})]
    write_rows(tmp_path / "rows.csv", {}, rows)
    assert (tmp_path / "rows.csv").read_text().splitlines() == [
        "name,ms,ms_low,ms_high,said",
        "a,1.0,,,",
        "b,2.0,1.0,3.0,no",
    ]


def test_a_name_without_a_value_is_an_error_and_pages_are_escaped(tmp_path: Path) -> None:
    (tmp_path / "some.html.jinja").write_text("<p>{{ text }}</p>")
    assert render("some.html", tmp_path, text="<goals>") == "<p>&lt;goals&gt;</p>"
    with pytest.raises(jinja2.UndefinedError, match="text"):
        render("some.html", tmp_path)
