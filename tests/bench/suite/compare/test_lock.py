"""A comparison leaves what is needed to do it again, and says what differs when it is."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import pytest

from wholebody.base.errors import FileFormatError, InputError, UnknownNameError
from wholebody.bench.statistics import Interval
from wholebody.bench.suite.compare import run as running
from wholebody.bench.suite.compare.lock import Locked, differences, in_words, locked, read_lock, shares, write_lock
from wholebody.bench.suite.compare.results import Chunk, Record, Results
from wholebody.bench.suite.compare.solving import JUDGED
from wholebody.bench.suite.compare.summary import Material, summaries
from wholebody.cli import main

AMOUNTS = {"cases": 2, "sweep": 0, "levels": 1, "seed": 5, "cap": 5.0, "minutes": 1.0}
FIGURES = {
    ("robot_arm", "qp", "solved"): Interval(0.98, 0.95, 0.99),
    ("robot_arm", "qp", "median time"): Interval(3.0, 2.5, 3.5),
    ("robot_arm", "dls", "solved"): Interval(0.5, 0.4, 0.6),
}
PUBLISHED = Locked(("robot_arm",), ("dls",), AMOUNTS, {"wholebody": "0.1", "load": "3"}, FIGURES)


def changed(key: tuple[str, str, str], figure: Interval) -> Locked:
    return replace(PUBLISHED, figures={**FIGURES, key: figure})


def test_a_lock_file_comes_back(tmp_path: Path) -> None:
    write_lock(tmp_path / "lock.json", PUBLISHED)
    assert read_lock(tmp_path / "lock.json") == PUBLISHED
    settings = read_lock(tmp_path / "lock.json").settings()
    assert (settings.cases, settings.seed, [one.name for one in settings.adapters]) == (2, 5, ["dls"])


def test_only_what_is_beyond_both_intervals_differs() -> None:
    key = ("robot_arm", "dls", "solved")
    assert differences(PUBLISHED, PUBLISHED) == []
    assert differences(PUBLISHED, changed(key, Interval(0.62, 0.45, 0.75))) == []  # which holds what was published
    assert differences(PUBLISHED, changed(key, Interval(0.58, 0.55, 0.61))) == []  # within what was published
    (one,) = differences(PUBLISHED, changed(key, Interval(0.7, 0.65, 0.75)))
    assert (one.method, one.what) == ("dls", "solved")
    slower = differences(PUBLISHED, changed(("robot_arm", "qp", "median time"), Interval(9.0, 8.0, 10.0)))
    assert len(slower) == 1
    assert shares(slower) == []


def test_other_files_and_unknown_methods_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "lock.json"
    path.write_text("{}")
    with pytest.raises(FileFormatError, match="no lock file"):
        read_lock(path)
    with pytest.raises(UnknownNameError, match="dlss"):
        replace(PUBLISHED, methods=("dlss",)).settings()
    with pytest.raises(InputError, match="no figure in common"):
        differences(PUBLISHED, replace(PUBLISHED, figures={("a", "b", "c"): Interval(1.0, 1.0, 1.0)}))


def test_another_share_ends_with_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The run itself is made up: what it found is what was published, but for a figure."""
    path = tmp_path / "lock.json"
    write_lock(path, changed(("robot_arm", "dls", "solved"), Interval(0.7, 0.65, 0.75)))
    monkeypatch.setattr(running, "run", lambda *given: argparse.Namespace(chunks=[], records=[]))
    monkeypatch.setattr("wholebody.cli.bench.comparing.publish", lambda *given: None)
    for found, code in ((PUBLISHED, 1), (read_lock(path), 0)):
        monkeypatch.setattr("wholebody.cli.bench.comparing.locked", lambda given, found=found: found)
        assert main(["bench", "compare", "--again", str(path), "--out", str(tmp_path / "out")]) == code
        assert f"{code} differ" in capsys.readouterr().out


def test_a_time_in_kernels_is_as_uncertain_as_the_kernel() -> None:
    chunks, records = [], []
    for number in range(9):
        record = Record(
            "robot_arm", number, "dls", 1e-4, 0, "answered", seconds=0.6, cpu_seconds=0.06, **dict.fromkeys(JUDGED, 0.0)
        )  # by the clock it waited for other work, which is no matter
        records.append(record)
        chunks.append(Chunk("robot_arm", number, (record,), kernel=0.02 if number % 2 else 0.03))
    settings = PUBLISHED.settings()
    results = Results(records, ["robot_arm"], ["dls"])
    found = locked(Material(settings, chunks, results, summaries(results, chunks), {}, {}))
    time = found.figures["robot_arm", "dls", "median time"]
    assert time.value == pytest.approx(2.0)
    assert summaries(results, chunks)[0].kernels == pytest.approx(2.0)
    assert (time.low, time.high) == pytest.approx((2.0, 3.0))  # each solve took the same, the kernel did not


def test_the_published_lock_is_of_this_version_and_a_changed_figure_is_told(root: Path) -> None:
    published = read_lock(root / "docs" / "assets" / "bench" / "small-lock.json")
    assert published.settings().described()["cases"] == 12
    said = f"{len(published.figures)} figures compared; 0 differ by more than their intervals."
    assert in_words(published, published) == [said]
    key = next(key for key in published.figures if key[2] == "solved" and published.figures[key].value > 0.9)
    other = replace(published, figures={**published.figures, key: Interval(0.1, 0.05, 0.2)})
    assert [one[:3] for one in differences(other, published)] == [key]
