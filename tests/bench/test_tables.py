"""Files of results: what is written is read back, tables keep their shape, pages change only between their markers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.csv_rows import csv_rows
from wholebody.base.errors import FileFormatError
from wholebody.bench.rows import Row
from wholebody.bench.statistics import Interval
from wholebody.bench.tables import machine, replace_section, sentence, write_rows

PAGE = "# Results\n\nbefore\n\n<!-- bench:step -->\nold\n<!-- /bench:step -->\n\nafter\n"


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


def test_what_a_row_lacks_is_empty(tmp_path: Path) -> None:
    rows = [Row("a", "qp", {"ms": math.nan, "pairs": 3, "status": "solved"}), Row("b", "ccd", {"pairs": 5})]
    write_rows(tmp_path / "rows.csv", {}, rows)
    found = [[row["ms"], row["pairs"], row["status"]] for row in csv_rows(tmp_path / "rows.csv")]
    assert found == [["nan", "3", "solved"], ["", "5", ""]]


def test_a_section_is_replaced_and_the_rest_of_the_page_stays(tmp_path: Path) -> None:
    page = tmp_path / "results.md"
    page.write_text(PAGE)
    replace_section(page, "step", "new\n")
    once = page.read_text()
    assert once == PAGE.replace("\nold\n", "\n\nnew\n\n")
    replace_section(page, "step", "new\n")
    assert page.read_text() == once, "twice is as good as once"
    with pytest.raises(FileFormatError, match="bench:solve"):
        replace_section(page, "solve", "new")
    assert page.read_text() == once
    with pytest.raises(FileFormatError, match="no such page"):
        replace_section(tmp_path / "none.md", "step", "new")


def test_the_machine_is_described() -> None:
    facts = machine()
    assert {"wholebody", "processor", "cores", "python", "OMP_NUM_THREADS", "pin", "coal", "numpy"} <= set(facts)
    assert all(value and "\n" not in value for value in facts.values())
    assert facts["processor"] in sentence(facts)


@dataclass(frozen=True)
class Spanned:
    name: str
    share: Interval
    count: int


def test_an_interval_has_three_columns(tmp_path: Path) -> None:
    rows = [Spanned("qp", Interval(0.5, 0.25, math.inf), 3), Spanned("ccd", Interval(0.1, 0.0, 0.2), 4)]
    write_rows(tmp_path / "rows.csv", {}, rows)
    first, second, _ = (tmp_path / "rows.csv").read_text().splitlines()
    assert (first, second) == ("name,share,share_low,share_high,count", "qp,0.5,0.25,inf,3")


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
