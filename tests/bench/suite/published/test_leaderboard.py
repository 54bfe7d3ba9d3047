"""A folder of answers becomes a page whose sentences follow from its figures."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tests.bench.suite.published.published_helpers import answers
from wholebody.base.errors import InputError
from wholebody.bench.suite.published.leaderboard import judge_folder, publish, results
from wholebody.cli import main


@pytest.fixture
def arms(names: list[str]) -> list[str]:
    return [name for name in names if name.startswith("robot_arm")]


def test_a_folder_of_answers_becomes_a_page(folder: Path, tmp_path: Path, arms: list[str]) -> None:
    place = tmp_path / "answers"
    place.mkdir()
    (place / "a.json").write_text(json.dumps(answers(folder, arms, method="good", kernel_seconds=0.005)))
    poor = answers(folder, arms[:1], method="poor <b>", about="it stops early")
    (place / "b.json").write_text(json.dumps(poor))
    publish(judge_folder(place, folder), folder, tmp_path / "out")
    page = (tmp_path / "out" / "leaderboard.html").read_text()
    assert "<strong>Robot arm, near:</strong> fastest <code>good</code>, 500 ms." in page
    assert "poor &lt;b&gt;" in page
    assert "<b>" not in page
    assert "Without an answer, and so not solved: 1, robot_arm/0001 first." in page
    assert "median time 100 reference kernels" in page
    assert page.count("<svg") == 1
    assert not re.search(r'(?:src|href)="https?:', page)
    table = (tmp_path / "out" / "summary.tex").read_text()
    assert "robot arm, near & good & 100.0 [" in table
    assert "& poor <b> & " in table
    assert table.count("{") == table.count("}")
    assert len((tmp_path / "out" / "summary.csv").read_text().splitlines()) == 4  # what was asked, names, two methods
    assert main(["bench", "judge", str(place), "--problems", str(folder), "--out", str(tmp_path / "o")]) == 0


def test_folders_without_answers_and_methods_of_one_name_are_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has no files of answers"):
        judge_folder(tmp_path, folder)
    for name in ("a", "b"):
        (tmp_path / f"{name}.json").write_text(json.dumps(answers(folder, ["robot_arm/0000"])))
    with pytest.raises(InputError, match="both have the method 'witness'"):
        judge_folder(tmp_path, folder)


def test_nobody_leads_where_nothing_is_solved_and_times_may_be_missing(
    folder: Path, tmp_path: Path, arms: list[str]
) -> None:
    content = answers(folder, arms)
    for item in content["answers"]:
        item["posture"] = json.loads((folder / "problems" / f"{item['problem']}.json").read_text())["seeds"]["near"]
        del item["seconds"]
    (tmp_path / "a.json").write_text(json.dumps(content))
    verdicts = judge_folder(tmp_path, folder)
    assert results(verdicts).sets == ("robot_arm, near",)
    said = publish(verdicts, folder, tmp_path / "out")
    assert said[0].startswith("**No method solves 98 % of any set.**")


def test_the_best_known_effort_is_the_least_of_all_exact_answers(folder: Path, tmp_path: Path, arms: list[str]) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.json").write_text(json.dumps(answers(folder, arms, method=name)))
    found = results(judge_folder(tmp_path, folder))
    for one in found.default("robot_arm, near", "a"):
        assert found.best(one) <= one.measure
