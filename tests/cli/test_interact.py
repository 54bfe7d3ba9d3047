"""`wholebody interact` as people use it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.csv_rows import csv_rows
from tests.saved_page import unpacked
from wholebody.cli import main
from wholebody.tracking.scenes import SCENES


def test_lists_the_scenes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["interact", "--list"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in SCENES)
    assert main(["interact"]) == 2
    assert "name a scene: hand_on_table" in capsys.readouterr().err


def test_a_run_prints_a_table_and_writes_numbers_chart_and_animation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["interact", "hand_on_table", "--frames", "100", "--out", str(out)]) == 0
    assert "hand_on_table" in capsys.readouterr().out
    assert {path.suffix for path in out.iterdir()} == {".csv", ".html", ".md", ".png", ".svg"}
    rows = csv_rows(out / "hand_on_table-qp.csv")
    assert [int(row["frame"]) for row in rows] == list(range(100))
    assert max(float(row["tracked deepest mm"]) for row in rows) > 5.0
    assert max(float(row["deepest mm"]) for row in rows) < 0.1
    page = unpacked(out / "hand_on_table-qp.html")
    assert "ghosts" in page
    page = (out / "hand_on_table-qp.md").read_text()
    assert "| hand_on_table | qp | 100 |" in page
    assert "| arm in corner | paper | 2146 | 20.5 |" in page


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["hand_on_tabel"], "no scene is called 'hand_on_tabel'; did you mean hand_on_table"),
        (["two_arms", "--overlap", "springs"], "--overlap: no way to remove overlap is called 'springs'"),
        (["two_arms", "--frames", "0"], "frames is 0; give a whole number between 1"),
        (["two_arms", "--out", "/dev/null/pictures"], "/dev/null/pictures"),
    ],
)
def test_mistakes_are_said_in_one_sentence(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["interact", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_the_ghost_moves(tmp_path: Path) -> None:
    import wholebody as wb
    from wholebody.view.style import LOOK

    hand = wb.load("hand")
    scene = wb.Scene(hand)
    shown = np.tile(hand.neutral, (3, 1))
    ghost = shown.copy()
    ghost[:, 0] = 0.0, 0.1, 0.2
    with wb.Viewer(scene) as viewer:
        viewer.play(shown, 0.1, ghost=ghost)
        tracks = viewer._graph.store.animation
        assert LOOK.ghost_node in str(tracks)
        with pytest.raises(wb.InputError, match="the ghost has 2 postures and the motion 3"):
            viewer.play(shown, 0.1, ghost=ghost[:2])
