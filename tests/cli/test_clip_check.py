"""The command `wholebody clip check`: its tables, JSON, page and exit codes."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.cli import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two clips of a person: one free, and one whose hand goes into a thigh."""
    made = tmp_path_factory.mktemp("clips")
    figure = wb.load("human")
    free = [figure.posture("a_pose")] * 5
    wb.Clip(figure, free, 0.1, "free").write(made / "free.npz")  # type: ignore[arg-type]
    standing = figure.posture("standing")
    inside = figure.with_joints(standing, {"right_shoulder_abduction": -0.3})
    path = [pin.interpolate(figure.model, standing, inside, s) for s in np.linspace(0.0, 1.0, 6)]
    wb.Clip(figure, path, 0.1, "into <thigh>").write(made / "inside.npz")  # type: ignore[arg-type]
    return made


def test_a_free_clip(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["clip", "check", str(folder / "free.npz")]) == 0
    out = capsys.readouterr().out
    assert "free at a depth of 0.1 mm" in out
    assert "0 of 5" in out


def test_tables_of_a_clip_that_overlaps(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["clip", "check", str(folder / "inside.npz")]) == 1
    out = capsys.readouterr().out
    assert "of the figure with itself" in out
    assert re.search(r"right_(fore)?arm|right_hand", out)


def test_json(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["clip", "check", str(folder / "inside.npz"), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    clip = wb.read_clip(folder / "inside.npz", wb.load("human"))
    expected = wb.check(clip)
    assert found["deepest"] == expected.deepest > 0.001
    assert len(found["depth"]) == 6
    assert len(found["between"]) == 5
    assert [each["first"] for each in found["contacts"]] == [each.first for each in expected.contacts]


def test_a_deeper_tolerance(folder: Path) -> None:
    assert main(["clip", "check", str(folder / "inside.npz"), "--depth", "300"]) == 0


def test_the_page_is_whole_and_shows_the_pairs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = folder / "page.html"
    assert main(["clip", "check", str(folder / "inside.npz"), "--html", str(page)]) == 1
    assert f"wrote {page}" in capsys.readouterr().out.replace("\n", "")
    text = page.read_text(encoding="utf-8")
    assert not re.search(r'(src|href)="(?!data:,)', text)  # nothing is fetched
    assert "into &lt;thigh&gt;" in text
    assert "into <thigh>" not in text
    data = json.loads(re.search(r"const data = (\{.*\});", text).group(1))  # type: ignore[union-attr]
    found = wb.check(wb.read_clip(folder / "inside.npz", wb.load("human")))
    assert [row["name"] for row in data["rows"]] == [contact.names for contact in found.contacts]
    first = data["rows"][0]
    cells = dict(zip(first["at"], first["depth"], strict=True))
    for frame, depth in enumerate(found.contacts[0].depth):
        assert cells.get(2 * frame, 0.0) == pytest.approx(1e3 * depth, abs=1e-4)


def test_things_of_a_task(folder: Path, root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    task = folder / "room.toml"
    task.write_text(
        'title = "wall"\n[figure]\nname = "human"\n[[goal]]\ntype = "point"\nframe = "right_index_tip"\n'
        "target = [0.5, 0.0, 1.0]\n"
        '[[object]]\nname = "wall"\nshape = "box"\nsize = [0.1, 3.0, 3.0]\nat = [0.1, 0.0, 1.0]\n'
    )
    assert main(["clip", "check", str(folder / "free.npz"), "--scene", str(task)]) == 1
    assert "with things around it" in capsys.readouterr().out


def test_what_is_worn(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["clip", "check", str(folder / "inside.npz"), "--equipment", "side_sphere"]) == 1
    out = capsys.readouterr().out
    assert "with what it carries" in out
    assert "side_sphere" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no.npz"], "no.npz"),
        (["free.npz", "--depth", "0"], "check: depth"),
        (["free.npz", "--html", "no/such/page.html"], "no/such"),
        (["free.npz", "--scene", "no.toml"], "no.toml"),
        (["free.npz", "--figure", "hand"], "free"),
        (["free.npz", "--equipment", "sack"], "did you mean pack"),
    ],
)
def test_wrong_input_is_one_sentence(
    folder: Path, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    name, *others = arguments
    assert main(["clip", "check", str(folder / name), *others]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert message in said[-1]
