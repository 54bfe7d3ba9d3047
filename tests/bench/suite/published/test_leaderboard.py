"""A folder of answers becomes a page whose sentences follow from its figures."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from published_helpers import answers

from wholebody.base.errors import InputError
from wholebody.bench.plot_style import method_style
from wholebody.bench.statistics import NOTHING, share
from wholebody.bench.suite.published.judging import NONE, Judged, set_score
from wholebody.bench.suite.published.leaderboard import Board, boards, judge_folder, publish, sentences, styles, summary
from wholebody.cli import main


def judged(number: int, solved: bool, seconds: float) -> Judged:
    return Judged(f"s/{number:04d}", "near", "answered", "", NONE, solved, solved, 0.0, seconds)


def test_nobody_wins_within_the_noise() -> None:
    """19 and 20 of 20 are not told apart, 5 of 20 is."""
    rows = [
        (name, set_score("s", "near", [judged(k, k < solved, 0.1) for k in range(20)]))
        for name, solved in (("a", 20), ("b", 19), ("c", 5))
    ]
    board = Board("s", "near", tuple(rows), ("a", "b"))
    assert rows[0][1].share == share([True] * 20)
    assert rows[2][1].effort_above.value == 0.0
    assert rows[0][1].seconds != NOTHING
    said = sentences(board, [])
    assert said == [
        "**a** solves 100 % [84, 100].",
        "b cannot be told apart from it by what they solve.",
        "c solves fewer.",
    ]


def test_a_folder_of_answers_becomes_a_page(folder: Path, tmp_path: Path, names: list[str]) -> None:
    place = tmp_path / "answers"
    place.mkdir()
    arms = [name for name in names if name.startswith("robot_arm")]
    (place / "a.json").write_text(json.dumps(answers(folder, arms, method="good", kernel_seconds=0.005)))
    poor = answers(folder, arms[:1], method="poor <b>", about="it stops early")
    (place / "b.json").write_text(json.dumps(poor))
    verdicts = judge_folder(place, folder)
    (board,) = boards(verdicts, ["robot_arm", "clutter"])
    assert [name for name, _ in board.rows] == ["good", "poor <b>"]
    publish(verdicts, folder, tmp_path / "out")
    page = (tmp_path / "out" / "leaderboard.html").read_text()
    assert "<strong>good</strong> solves 100 % [34, 100]." in page
    assert "poor &lt;b&gt;" in page
    assert "<b>" not in page
    assert "Without an answer, and so not solved: 1, robot_arm/0001 first." in page
    assert "median time 1e+02 reference kernels" in page
    assert page.count("<svg") == 1
    assert not re.search(r'(?:src|href)="https?:', page)
    assert main(["bench", "judge", str(place), "--problems", str(folder), "--out", str(tmp_path / "o")]) == 0


def test_methods_that_are_not_known_have_colours_of_their_own() -> None:
    names = [f"solver {number}" for number in range(8)]
    found = styles(["qp", *names])
    assert len({style.color for style in found.values()}) == 9
    assert found["qp"] == method_style("qp")


def test_folders_without_answers_and_methods_of_one_name_are_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has no files of answers"):
        judge_folder(tmp_path, folder)
    for name in ("a", "b"):
        (tmp_path / f"{name}.json").write_text(json.dumps(answers(folder, ["robot_arm/0000"])))
    with pytest.raises(InputError, match="both have the method 'witness'"):
        judge_folder(tmp_path, folder)


def test_nobody_leads_where_nothing_is_solved(folder: Path, tmp_path: Path, names: list[str]) -> None:
    arms = [name for name in names if name.startswith("robot_arm")]
    content = answers(folder, arms)
    for item in content["answers"]:
        item["posture"] = json.loads((folder / "problems" / f"{item['problem']}.json").read_text())["seeds"]["near"]
    (tmp_path / "a.json").write_text(json.dumps(content))
    verdicts = judge_folder(tmp_path, folder)
    (board,) = boards(verdicts, ["robot_arm"])
    assert board.leading == ()
    assert summary([board]) == {"robot arm, near": "nobody"}
    assert sentences(board, verdicts) == ["Nobody took every problem and solved one."]
