"""Answers of methods to an export: judged as anybody's answers are."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from wholebody.base.errors import FileFormatError, UnknownNameError
from wholebody.bench.suite.adapters.registry import adapters
from wholebody.bench.suite.published.answers import read_answers
from wholebody.bench.suite.published.judging import judge
from wholebody.bench.suite.published.problems import Answering, chosen_problems
from wholebody.cli import main


def test_the_answers_of_a_method_are_judged(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "qp.json"
    assert main(["bench", "answer", str(folder), "--sets", "robot_arm", "--out", str(out)]) == 0
    assert f"bench judge {out}" in " ".join(capsys.readouterr().out.split())
    verdict = judge(read_answers(out, folder), folder)
    solved = [(row.set, row.seed, row.solved) for row in verdict.sets]
    assert solved == [("robot_arm", seed, 2) for seed in ("near", "far")]
    assert all(one.seconds > 0.0 for one in verdict.judged)


def test_what_a_method_refuses_is_written_with_the_reason(folder: Path) -> None:
    answering = Answering(folder, adapters(["ccd"])[0])
    answering.answer("balance", 0)
    assert all("Balance" in one["refused"] for one in answering.content()["answers"])


def test_files_that_hold_another_problem_are_refused(folder: Path, tmp_path: Path) -> None:
    changed = shutil.copytree(folder, tmp_path / "changed")
    path = changed / "problems" / "free_reach" / "0000.json"
    content = json.loads(path.read_text())
    content["goals"][0]["position"][0] += 0.01
    path.write_text(json.dumps(content))
    with pytest.raises(FileFormatError, match="free_reach/0000 is another problem in the files"):
        Answering(changed, adapters(["qp"])[0]).answer("free_reach", 0)
    with pytest.raises(UnknownNameError, match="free_reach"):
        chosen_problems(folder, ["free_reech"])


@pytest.mark.parametrize("command", ["answer", "judge"])
def test_no_file_of_the_export_is_written_over(
    command: str, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    problem = folder / "problems" / "free_reach" / "0001.json"
    before = problem.read_bytes()
    (tmp_path / "a.json").write_text("{}")
    asked = [str(folder)] if command == "answer" else [str(tmp_path / "a.json"), "--problems", str(folder)]
    assert main(["bench", command, *asked, "--out", str(problem)]) == 2
    assert "is a file that is read" in capsys.readouterr().err
    assert problem.read_bytes() == before
