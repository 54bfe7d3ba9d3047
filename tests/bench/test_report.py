"""What templates are filled in with, and that every template of the package can be read."""

from __future__ import annotations

from itertools import pairwise
from math import inf, nan
from pathlib import Path

import jinja2
import pytest

from wholebody.bench import tables
from wholebody.bench.tables import TEMPLATES, formatted, render, strong, upfirst, words


@pytest.mark.parametrize("path", sorted(TEMPLATES.iterdir()), ids=lambda path: path.name)
def test_every_template_can_be_read(path: Path) -> None:
    assert tables._environment(TEMPLATES).get_template(path.name).name == path.name


@pytest.mark.parametrize("path", sorted(TEMPLATES.glob("*.md.jinja")), ids=lambda path: path.name)
def test_a_table_has_a_rule_for_every_column(path: Path) -> None:
    lines = path.read_text().splitlines()
    for head, rule in pairwise(lines):
        if rule.startswith("| ---") and "{" not in head + rule:
            assert head.count("|") == rule.count("|"), head


def test_empty_lines_beside_each_other_become_one(tmp_path: Path) -> None:
    (tmp_path / "some.md.jinja").write_text(
        "\n\n{% for k in counts %}\n- {{ k }}\n{% endfor %}\n\n\n\n{{ text }}  \n\n"
    )
    assert render("some.md", tmp_path, counts=[1, 2], text="end") == "- 1\n- 2\n\nend"


def test_a_name_without_a_value_is_an_error_and_pages_are_escaped(tmp_path: Path) -> None:
    (tmp_path / "some.html.jinja").write_text("<p>{{ text }}</p>")
    assert render("some.html", tmp_path, text="<goals>") == "<p>&lt;goals&gt;</p>"
    with pytest.raises(jinja2.UndefinedError, match="text"):
        render("some.html", tmp_path)


def test_numbers_that_are_not_finite_are_left_out() -> None:
    assert formatted(1.234, ".1f", " %") == "1.2 %"
    assert formatted(nan, ".1f", " %") == ""
    assert formatted(inf, ".1f", none="never") == "never"
    large = [formatted(value, ".2g") for value in (99.4, 99.7, 113.0, 1e-7)]
    assert large == ["99", "100", "113", "1e-07"]  # 99.7 rounds up to three digits
    assert (strong(0), strong(2), upfirst("a b"), words("a_b")) == ("0", "**2**", "A b", "a b")
