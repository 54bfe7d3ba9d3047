"""The person's bench: its small run, its page, and its own ways of measuring."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.audits.__main__ import main
from tests.audits.human_contacts import distance
from tests.audits.human_sizes import _girth, dimensions, ranges
from wholebody.figures import load
from wholebody.figures.surface.fields import ball, round_cone, union


def test_a_small_run_writes_page_and_numbers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    docs = tmp_path / "docs"
    docs.mkdir()
    assert main(["human", "--quick", "--out", str(tmp_path / "out"), "--update-docs", str(docs)]) == 0
    found = json.loads((tmp_path / "out" / "human.json").read_text())
    assert len(found["dimensions"]) == 15
    assert [row["status"] for row in found["tasks"]] == ["solved"] * 3
    assert all(row["plausible"] for row in found["tasks"])
    reached = {row["contact"] for row in found["contacts"] if row["reached"]}
    assert reached >= {"palms together", "palm flat on a table", "thighs on the seat"}
    text = (docs / "human.md").read_text()
    assert text.startswith("# The person, measured")
    assert "| sitting height |" in text
    assert "![" not in text  # a short run draws nothing
    assert "reach high: solved" in capsys.readouterr().out


def test_a_girth_is_that_of_the_hull() -> None:
    middle = np.zeros(2)
    assert _girth(ball((0.0, 0.0, 0.0), 0.05), middle, 0.03) == pytest.approx(2.0 * np.pi * 0.04, rel=2e-3)
    beside = union([round_cone((x, 0.0, -1.0), (x, 0.0, 1.0), 0.02, 0.02) for x in (-0.03, 0.03)])
    band = 2.0 * np.pi * 0.02 + 2.0 * 0.06  # a tape around two equal rods
    assert _girth(union([beside, ball((0.0, 0.0, 0.0), 0.011)]), middle, 0.0) == pytest.approx(band, rel=0.03)


def test_dimensions_keep_to_what_is_asked() -> None:
    for row in dimensions(["F50", "M50"]):
        assert abs(row.residual) < (0.025 if "overhead" in row.name else 0.015), row


def test_a_straight_leg_ends_before_a_bent_one() -> None:
    found = {row.motion: row.model for row in ranges(load("human"))}
    assert found["hip, straight-leg raise of men"] < found["hip, flexion with the knee at 120"]
    assert found["spine, flexion"] == pytest.approx(80.0, abs=0.5)


def test_distances_are_those_of_the_scene() -> None:
    import wholebody as wb

    figure = load("human")
    q = figure.posture("standing")
    scene = wb.Scene(figure)
    contacts = scene.contacts(q, within=1.0)
    owners = [{scene.piece_owner[int(k)] for k in pair} for pair in contacts.pair]
    tested = min(d for d, pair in zip(contacts.distance, owners, strict=True) if pair == {"left_hand", "left_thigh"})
    assert distance(figure, q, ["left_hand"], ["left_thigh"]) == pytest.approx(tested, abs=1e-6)
