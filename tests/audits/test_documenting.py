"""Reports come into the documentation with their charts, and pages change only between their markers."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.audits.__main__ import main
from tests.audits.documenting import put

PAGE = "# Results\n\nbefore\n\n<!-- bench:step -->\nold\n<!-- /bench:step -->\n\nafter\n"
REPORT = "About.\n\n| | ms |\n|---|---:|\n| a | 1 |\n\nMeasured with wholebody.\n\n![A chart](step.svg)\n"


@pytest.fixture
def docs(tmp_path: Path) -> Path:
    folder = tmp_path / "docs"
    folder.mkdir()
    (folder / "other.md").write_text("another page")
    (folder / "results.md").write_text(PAGE)
    (tmp_path / "step.svg").write_text("<svg/>")
    (tmp_path / "step.md").write_text(REPORT)
    return folder


def test_a_section_is_replaced_and_the_rest_of_the_page_stays(tmp_path: Path, docs: Path) -> None:
    assert main(["docs", str(tmp_path / "step.md"), "--docs", str(docs)]) == 0
    once = (docs / "results.md").read_text()
    part = (
        "![A chart](assets/bench/step.svg)\n\n| | ms |\n|---|---:|\n| a | 1 |\n\nMeasured with wholebody. "
        "[Everything measured](assets/bench/step.txt)."
    )
    assert once == PAGE.replace("\nold\n", f"\n\n{part}\n\n")
    assert (docs / "assets/bench/step.svg").read_text() == "<svg/>"
    assert (docs / "assets/bench/step.txt").read_text() == REPORT
    put(tmp_path / "step.md", docs)
    assert (docs / "results.md").read_text() == once, "twice is as good as once"


def test_what_no_page_has_a_section_for_is_a_text(tmp_path: Path, docs: Path) -> None:
    (tmp_path / "lock.json").write_text("{}")
    assert put(tmp_path / "step.md", docs, "held-out") == docs / "assets/bench/held-out.txt"
    assert (docs / "results.md").read_text() == PAGE
    assert (docs / "assets/bench/held-out-lock.json").read_text() == "{}"


def test_of_a_comparison_the_charts_of_all_sets_are_on_the_page(tmp_path: Path, docs: Path) -> None:
    (docs / "results.md").write_text(PAGE.replace("step", "compare"))
    (tmp_path / "charts").mkdir()
    names = ("compare-overview.svg", "compare-arm.svg")
    for name in names:
        (tmp_path / "charts" / name).write_text("<svg/>")
    (tmp_path / "compare.md").write_text("\n".join(f"![{name}](charts/{name})" for name in names))
    page = put(tmp_path / "compare.md", docs).read_text()
    assert "](assets/bench/compare-overview.svg)" in page
    assert "compare-arm" not in page
    assert (docs / "assets/bench/compare-arm.svg").is_file()
    assert "(compare-arm.svg)" in (docs / "assets/bench/compare.txt").read_text()
