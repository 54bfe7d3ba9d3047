"""Files of results: what is written is read back, tables keep their shape, pages change only between their markers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wholebody.base.errors import FileFormatError
from wholebody.bench.rows import Row, read_rows
from wholebody.bench.statistics import Interval
from wholebody.bench.tables import machine, replace_section, sentence, write_rows

PAGE = "# Results\n\nbefore\n\n<!-- bench:step -->\nold\n<!-- /bench:step -->\n\nafter\n"


text = st.text(st.characters(blacklist_categories=("Cs",), blacklist_characters="\0"))
figures = st.fixed_dictionaries({"count": st.integers(), "value": st.floats(allow_nan=False)})


@given(st.lists(st.builds(Row, text, text, figures), min_size=1))
def test_rows_come_back_exactly(tmp_path_factory: pytest.TempPathFactory, rows: list[Row]) -> None:
    path = tmp_path_factory.mktemp("rows") / "rows.csv"
    write_rows(path, {"processor": "a: b", "cores": "2"}, rows)
    facts, back = read_rows(path)
    assert facts == {"processor": "a: b", "cores": "2"}
    assert back == rows
    assert list(path.parent.iterdir()) == [path], "nothing else is left beside it"


@pytest.mark.parametrize("said", ["one\r\ntwo", "one\r", "\u2028", "# a: b\n# c: d"])
def test_line_breaks_in_a_cell_come_back(tmp_path: Path, said: str) -> None:
    rows = [Row(said, "", {"count": 1}), Row("last", "", {"count": 2})]
    write_rows(tmp_path / "rows.csv", {"processor": "a"}, rows)
    assert read_rows(tmp_path / "rows.csv")[1] == rows


def test_a_file_whose_lines_end_as_on_windows_is_read(tmp_path: Path) -> None:
    (tmp_path / "rows.csv").write_bytes(b"# cores: 2\r\ncase,tool,count\r\na,qp,1\r\n")
    assert read_rows(tmp_path / "rows.csv") == ({"cores": "2"}, [Row("a", "qp", {"count": 1})])


def test_nan_comes_back(tmp_path: Path) -> None:
    write_rows(tmp_path / "rows.csv", {}, [Row("a", "", {"ms": math.nan})])
    assert math.isnan(read_rows(tmp_path / "rows.csv")[1][0]["ms"])


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("a,b\n1,2\n", "columns are a, b, not case, tool"),
        ("", "is not CSV"),
        ("case,tool,ms\nx,1\n", "row 1 has 2 cells of 3"),
        ("case,tool\n" + "x" * 200_000, "is not CSV"),
    ],
)
def test_files_of_another_kind_are_refused(tmp_path: Path, content: str, said: str) -> None:
    path = tmp_path / "rows.csv"
    path.write_text(content)
    with pytest.raises(FileFormatError, match=said):
        read_rows(path)


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
