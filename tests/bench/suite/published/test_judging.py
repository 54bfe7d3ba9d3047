"""Answers of anybody: read, refused where they are malformed, and scored."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.bench.suite.published.published_helpers import answers
from wholebody.base.errors import FileFormatError, InputError, WholebodyError
from wholebody.bench.suite.published.answers import read_answers
from wholebody.bench.suite.published.judging import TIMEOUT, as_json, judge, left_out
from wholebody.bench.suite.published.rebuilt import Score, worst_of
from wholebody.cli import main


def written(tmp_path: Path, content: Any) -> Path:
    path = tmp_path / "answers.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_witnesses_solve_everything(folder: Path, names: list[str], tmp_path: Path) -> None:
    first = [name for name in names if name.endswith("/0000")]
    verdict = judge(read_answers(written(tmp_path, answers(folder, first)), folder), folder)
    assert [row.seed for row in verdict.sets] == ["near"] * len(verdict.sets)
    assert all(row.solved == row.problems - row.unanswered == 1 for row in verdict.sets)
    answered = [one for one in verdict.judged if one.outcome == "answered"]
    assert all(one.score.worst < 1e-6 for one in answered)
    assert all(one.effort_above >= -1e-6 for one in answered if not one.frames)


def test_starts_solve_nothing(folder: Path, names: list[str], tmp_path: Path) -> None:
    still = [name for name in names if not name.startswith("drag")]
    content = answers(folder, still)
    for item in content["answers"]:
        item["posture"] = json.loads((folder / "problems" / f"{item['problem']}.json").read_text())["seeds"]["near"]
    verdict = judge(read_answers(written(tmp_path, content), folder), folder)
    assert sum(row.solved for row in verdict.sets) == 0
    assert all(row.mean_seconds.value == pytest.approx(TIMEOUT) for row in verdict.sets)


def test_a_hand_in_a_thing_is_measured(folder: Path, tmp_path: Path) -> None:
    """A posture that is moved down by 3 cm has its soles 3 cm in the floor."""
    content = answers(folder, ["free_reach/0000"])
    content["answers"][0]["posture"][2] -= 0.03
    [one, _] = judge(read_answers(written(tmp_path, content), folder), folder).judged
    assert one.score.overlap == pytest.approx(0.03, abs=1e-6)
    assert one.score.holds == pytest.approx(0.03, abs=1e-6)
    assert one.score.goal_error == pytest.approx(0.03, abs=1e-6)
    assert not one.solved


def test_what_is_left_out_is_not_solved_and_what_is_refused_is_not_counted(
    folder: Path, tmp_path: Path, names: list[str]
) -> None:
    content = answers(folder, ["clutter/0001", "passage/0000"])
    content["answers"].append({"problem": "passage/0001", "refused": "no boards"})
    verdict = judge(read_answers(written(tmp_path, content), folder), folder)
    clutter, passage = verdict.sets
    assert (clutter.problems, clutter.unanswered, clutter.refused, clutter.solved) == (2, 1, 0, 1)
    assert clutter.share[:3] == pytest.approx((0.5, 0.0945, 0.9055), abs=1e-3)  # Wilson's, from its textbook formula
    assert (passage.problems, passage.unanswered, passage.refused, passage.solved) == (2, 0, 1, 1)
    assert passage.share.value == 1.0


def test_the_effort_is_compared_with_the_best_known(folder: Path, tmp_path: Path) -> None:
    content = answers(folder, ["robot_arm/0000"])
    best = json.loads((folder / "difficulty" / "robot_arm.json").read_text())["best_known_effort"]["robot_arm/0000"]
    [one, _] = judge(read_answers(written(tmp_path, content), folder), folder).judged
    start = json.loads((folder / "problems" / "robot_arm" / "0000.json").read_text())["effort_from"]
    own = sum((a - b) ** 2 for a, b in zip(content["answers"][0]["posture"], start, strict=True))
    assert one.effort_above == pytest.approx(own / best - 1.0, rel=1e-6)


def test_postures_in_degrees_are_told(folder: Path, tmp_path: Path) -> None:
    content = answers(folder, ["robot_arm/0000", "robot_arm/0001"])
    right = judge(read_answers(written(tmp_path, content), folder), folder)
    assert not any("radians" in line for line in left_out(right))
    content["answers"][1]["posture"] = [180.0 / 3.141592653589793 * value for value in content["answers"][1]["posture"]]
    told = left_out(judge(read_answers(written(tmp_path, content), folder), folder))
    assert any(line.startswith("Far out of the joint limits: 1, robot_arm/0001 first") for line in told)
    assert "Answered and not solved: 1; what is worst of each: joint limits 1." in told


def mangled(content: dict[str, Any], **changes: Any) -> dict[str, Any]:
    item = {**content["answers"][0], **changes}
    return {**content, "answers": [{key: value for key, value in item.items() if value is not None}]}


def malformed(content: dict[str, Any]) -> list[tuple[Any, str]]:
    posture = content["answers"][0]["posture"]
    return [
        ("{", "line 1: is not JSON"),
        ('{"format": NaN}', "has the number NaN"),
        ([1], "holds a list"),
        ({**content, "version": "2.0"}, 'version is \'2.0\'; write "version": "1.0"'),
        ({**content, "metod": "x"}, "no entry is called 'metod'; did you mean method"),
        ({**content, "method": ""}, "name your solver"),
        ({**content, "answers": {}}, "answers is an object; give a list"),
        ({**content, "answers": []}, "answers is empty; give an object for each problem"),
        ({**content, "answers": [3]}, "answers[0] is a number"),
        ({**content, "answers": content["answers"] * 2}, "answers[1] answers free_reach/0000 from the near seed a"),
        (mangled(content, problem="free_reach/9"), "answers[0]: no problem is called 'free_reach/9'; did you mean"),
        (mangled(content, seed="mid"), "answers[0].seed is 'mid'; give 'near' or 'far'"),
        (mangled(content, posture=None), "answers[0] has no posture"),
        (mangled(content, posture={"left_knee_flexion": 0.1}), "numbers, in the order of coordinates in bodies/human"),
        (mangled(content, posture=posture[1:]), f"answers[0].posture has {len(posture) - 1} numbers"),
        (mangled(content, posture=[*posture[:-1], "a"]), f"answers[0].posture[{len(posture) - 1}] is 'a'"),
        (mangled(content, posture=[*posture[:-1], 1e9]), "give finite radians"),
        (mangled(content, posture=[*posture[:3], 1, 1, 1, 1, *posture[7:]]), "quaternion (numbers 3 to 6: x, y, z, w)"),
        (mangled(content, seconds=-1.0), "answers[0].seconds is -1.0; give seconds, 0 or more"),
        (mangled(content, posture=None, postures=[posture]), "takes posture: one list of numbers"),
    ]


def test_malformed_answers_are_refused_with_one_sentence(folder: Path, tmp_path: Path) -> None:
    for content, said in malformed(answers(folder, ["free_reach/0000"])):
        with pytest.raises(WholebodyError) as caught:
            read_answers(written(tmp_path, content), folder)
        assert said in str(caught.value)
        assert "\n" not in str(caught.value)
    moving = answers(folder, ["drag/0000"])
    moving["answers"][0]["postures"] = moving["answers"][0]["postures"][1:]
    with pytest.raises(FileFormatError, match=r"entries; drag/0000 has \d+ frames"):
        read_answers(written(tmp_path, moving), folder)
    with pytest.raises(InputError, match="there is no such folder; make one with"):
        read_answers(written(tmp_path, answers(folder, [])), tmp_path / "none")


def test_the_command_prints_a_table_and_writes_every_figure(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, answers(folder, ["robot_arm/0000", "robot_arm/0001"]))
    assert main(["bench", "judge", str(path), "--problems", str(folder)]) == 0
    assert "robot" in capsys.readouterr().out
    found = json.loads((tmp_path / "answers.verdict.json").read_text())
    assert found["sets"][0]["solved"] == 2
    assert found["answers"][0]["problem"] == "robot_arm/0000"
    assert found["fingerprint"] == json.loads((folder / "index.json").read_text())["fingerprint"]
    assert found == as_json(judge(read_answers(path, folder), folder))
    path.write_text("{}")
    assert main(["bench", "judge", str(path), "--problems", str(folder)]) != 0
    assert "format is None" in capsys.readouterr().err


@pytest.mark.parametrize("name", [name for name in Score.__dataclass_fields__ if name != "effort"])
@pytest.mark.parametrize("frame", [0, 1, 2])
def test_a_score_with_nan_is_not_solved(name: str, frame: int) -> None:
    scores = [Score(*[0.0] * 7) for _ in range(3)]
    scores[frame] = replace(scores[frame], **{name: math.nan})
    assert math.isnan(worst_of(scores).worst)
