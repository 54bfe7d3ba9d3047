"""A file of another ending than its format's is refused before anything is computed, by every writer."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.cli.main import main
from wholebody.figures.anthropometry import make_person
from wholebody.figures.packaged_urdf import write_human
from wholebody.studies.records import Records
from wholebody.view.side_by_side import write_filmstrip

TASK = Path(__file__).parent.parent / "examples" / "tasks" / "shelf.toml"


@cache
def hand() -> wb.Figure:
    return wb.load("hand")


def postures() -> Any:
    return np.array([hand().neutral] * 3)


@cache
def shown() -> wb.Viewer:
    viewer = wb.Viewer(wb.Scene(hand()))
    viewer.play(postures(), 0.1)
    return viewer


def reached() -> wb.studies.ReachMap:
    axis = np.array([0.0, 0.1])
    empty = np.zeros((2, 2, 2))
    problem, verdict, q = wb.Problem(wb.Scene(hand())), empty.astype(np.int8), np.zeros((2, 2, 2, hand().model.nq))
    return wb.studies.ReachMap(problem, "right_palm", axis, axis, axis, verdict, empty, empty, q, 8)


def solved(path: Path) -> Path:
    task = wb.read_task(TASK)
    return wb.taskfile.write_result(task, wb.Solution.__new__(wb.Solution), path)


WRITERS: dict[str, tuple[Callable[[Path], Any], tuple[str, ...]]] = {
    "Viewer.save": (lambda path: shown().save(path), (".glb", ".htm", ".html", ".png")),
    "Viewer.picture": (lambda path: shown().picture(path), (".png",)),
    "Viewer.movie": (lambda path: shown().movie(path), (".gif", ".mp4")),
    "write_filmstrip": (lambda path: write_filmstrip(shown(), list(postures()), path), (".png",)),
    "Records.chart": (lambda path: Records([]).chart(path), (".png",)),
    "Records.to_csv": (lambda path: Records([]).to_csv(path), (".csv",)),
    "ReachMap.save": (lambda path: reached().save(path), (".npz",)),
    "ReachMap.to_vtk": (lambda path: reached().to_vtk(path), (".vtk",)),
    "ReachMap.picture": (lambda path: reached().picture(path), (".png",)),
    "ReachMap.html": (lambda path: reached().html(path), (".htm", ".html")),
    "write_task": (lambda path: wb.taskfile.write_task(wb.Scene(hand()), path), (".toml",)),
    "write_result": (solved, (".json",)),
    "Clip.write": (
        lambda path: wb.Clip(hand(), postures(), 0.1).write(path),
        (".bvh", ".csv", ".glb", ".npz", ".txt"),
    ),
    "write_human": (lambda path: write_human(path, make_person()), (".urdf",)),
}
NAMES = ("x.jpg", "x.gif", "x", "x.html.zip", ".html")


@pytest.mark.parametrize("name", WRITERS)
def test_what_cannot_be_written_is_refused_with_what_can(name: str, tmp_path: Path) -> None:
    write, endings = WRITERS[name]
    for given in NAMES:
        if Path(given).suffix in endings:
            continue
        with pytest.raises(wb.WholebodyError, match="cannot be written as") as told:
            write(tmp_path / given)
        assert all(ending in str(told.value) for ending in endings)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["Viewer.save", "ReachMap.save", "write_task", "Clip.write"])
def test_what_can_is_written_whatever_the_case(name: str, tmp_path: Path) -> None:
    write, endings = WRITERS[name]
    for ending in set(endings) - {".png"}:
        for case in (ending, ending.upper()):
            write(tmp_path / f"x{case}")
            assert (tmp_path / f"x{case}").stat().st_size


@pytest.mark.parametrize(
    "command",
    [
        ["show", "hand", "--save"],
        ["figure", "human", "--out"],
        ["clip", "play", "absent.npz", "--out"],
        ["clip", "check", "absent.npz", "--html"],
        ["clip", "convert", "absent.npz"],
    ],
    ids=lambda command: " ".join(command[:2]),
)
def test_commands_refuse_it_before_they_read_anything(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("x.jpg", "x.pdf", "x"):
        assert main([*command, str(tmp_path / name)]) != 0
        assert "cannot be written as" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
