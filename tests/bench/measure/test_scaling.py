"""`wholebody bench scaling`: exponents of known powers, chains that are what they say, and the command end to end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from tests.csv_rows import csv_rows
from wholebody.base.errors import InputError
from wholebody.bench.measure import scaling
from wholebody.bench.measure.scaling import (
    LENGTH,
    ROOM,
    SIMPLIFIED,
    TIP,
    assembly_rows,
    chain,
    exponent,
    exponents,
    rows,
    task,
)
from wholebody.cli import main
from wholebody.figures.state import State


@pytest.mark.parametrize("power", [0.0, 1.0, 2.5])
def test_the_exponent_of_a_power_is_found(power: float) -> None:
    sizes = [1, 3, 10, 30, 100, 300, 1000]
    found, first = exponent(sizes, [0.7 * size**power for size in sizes])
    assert found == pytest.approx(power, abs=1e-9)
    assert first == 100


def test_what_does_not_grow_counts_in_the_lower_range_only() -> None:
    sizes = [1, 10, 100, 1000, 10000]
    found, _ = exponent(sizes, [5.0 + 0.1 * size for size in sizes])
    assert 0.7 < found < 1.0  # three sizes at least, the first of them still half constant


@pytest.mark.parametrize(("joints", "pieces", "segments"), [(1, 2, None), (7, 3, None), (40, 1, 10)])
def test_a_chain_has_its_joints_its_pieces_and_its_length(joints: int, pieces: int, segments: int | None) -> None:
    figure = chain(joints, pieces, segments)
    assert figure.model.nv == joints
    assert figure.geometry.ngeoms == pieces * (segments or joints)
    tip = State(figure.model).update(figure.neutral).frame(figure.frame_id(TIP)).translation
    np.testing.assert_allclose(tip, (LENGTH, 0.0, 0.0), atol=1e-6)


def test_a_chain_that_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match="1 to 3"):
        chain(3, 1, 4)


def test_a_task_is_the_same_for_a_seed_and_leaves_its_start_free() -> None:
    figure = chain(6, 1)
    scene, target = task(figure, 30, 1)
    again, same = task(figure, 30, 1)
    assert np.array_equal(target, same)
    assert [thing.placement for thing in scene.objects.values()] == [
        thing.placement for thing in again.objects.values()
    ]
    assert scene.contacts(figure.neutral, within=1.0).distance.min() > 0.9 * ROOM
    assert wb.solve(wb.Problem(scene, goals=[wb.Point(TIP, target)])).solved


def test_rows_say_what_was_measured() -> None:
    said: list[str] = []
    found = list(rows({"things around": (5, 10)}, ("qp",), 1, said.append))
    assert [(row.case, row.tool) for row in found] == [
        (f"{size} things around", method) for size in (5, 10) for method in ("qp", SIMPLIFIED)
    ]
    assert len(said) == 4
    for whole, part in zip(found[::2], found[1::2], strict=True):
        assert whole["status"] == part["status"] == "solved"
        assert part["pairs"] < whole["pairs"]
        assert whole["a solve ms"] > 0.0
        assert whole["a step ms"] > 0.0
    (bodies,) = assembly_rows((5,), 1)
    assert bodies["a solve ms"] > 0.0
    assert [row.case for row in exponents([*found, bodies])] == ["things around", "things around", "joints"]


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    sizes = {"things around": (4,)}
    monkeypatch.setattr(scaling, "SIZES", sizes)
    words = ["bench", "scaling", "--quick", "--methods", "ccd", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    found = csv_rows(tmp_path / "out" / "scaling.csv")
    assert {row["case"].partition(" ")[2] for row in found} == {*sizes}
    report = (tmp_path / "out" / "scaling.md").read_text()
    assert "(scaling.svg)" in report
    assert "| things around | ccd |" in report
    assert "Measured with" in capsys.readouterr().out
