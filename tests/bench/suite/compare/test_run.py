"""Runs of a comparison: whatever a method does is recorded, a killed run goes on, the same seed gives the same."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from math import inf
from pathlib import Path
from types import ModuleType

import pytest

from wholebody.base.errors import InputError, WholebodyError
from wholebody.bench.suite.compare.results import FAILED, NAME, OVERTIME, REFUSED, Record, Store
from wholebody.bench.suite.compare.run import Settings, run

TIMES = ("seconds", "cpu_seconds", "setup_seconds", "frame_p95")
CAP = 1.0  # s of the processor: much more than a solve takes
SHORT = 0.1  # s of the processor: of a method that does not come back; by the clock it is ten times as much


def settings(fakes: ModuleType, *does: str, cases: int = 1, sweep: int = 1, cap: float = 5.0) -> Settings:
    return Settings((fakes.SET,), tuple(fakes.adapter(name) for name in does), cases, sweep, cap=cap, minutes=3.0)


def timeless(records: list[Record]) -> list[dict[str, object]]:
    return [{key: value for key, value in vars(record).items() if key not in TIMES} for record in records]


@pytest.fixture(scope="module")
def misbehaved(fakes: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Record]]:
    """Return records by method of runs with every fault there is."""
    found: dict[str, list[Record]] = {}
    for cap, does in ((CAP, ("solves", "raises", "refuses", "dies", "nan", "lies")), (SHORT, ("spins",))):
        store = run(settings(fakes, *does, cap=cap), tmp_path_factory.mktemp("run"))
        found |= {name: [record for record in store.records if record.method == name] for name in does}
    return found


@pytest.fixture(scope="module")
def once(fakes: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> tuple[Settings, Path, list[Record]]:
    """Return the settings, the folder and the records of a run."""
    asked, folder = settings(fakes, "solves", sweep=0), tmp_path_factory.mktemp("once")
    return asked, folder, run(asked, folder).records


def test_a_method_that_solves_is_judged_at_every_budget(misbehaved: dict[str, list[Record]]) -> None:
    records = misbehaved["solves"]
    assert sorted(record.tolerance for record in records) == [1e-6, 1e-4, 1e-2]
    for record in records:
        assert record.success(max(1e-3, 1.1 * record.tolerance))
        assert 0.0 < record.cpu_seconds < CAP
        assert record.best > 0.0
    assert min(record.worst for record in records) < 2e-6


def test_what_goes_wrong_is_recorded_in_its_own_words(misbehaved: dict[str, list[Record]]) -> None:
    raised = misbehaved["raises"][0]
    assert (raised.outcome, raised.said) == (FAILED, "ZeroDivisionError: by nothing")
    died = misbehaved["dies"][0]
    assert died.outcome == FAILED
    assert "exit code 3" in died.said
    nan = misbehaved["nan"][0]
    assert (nan.outcome, nan.said) == (FAILED, "the answer is not finite")
    for record in (raised, died, nan):
        assert record.worst == inf
        assert not record.success(1.0)


def test_a_refusal_is_one_record_with_its_sentence(misbehaved: dict[str, list[Record]]) -> None:
    (record,) = misbehaved["refuses"]
    assert record.outcome == REFUSED
    assert record.said == "it cannot take goals[0], Point; leave it out"


def test_a_solve_that_takes_too_long_is_ended_in_compiled_code_too(misbehaved: dict[str, list[Record]]) -> None:
    records = misbehaved["spins"]
    assert len(records) == 3  # further budgets count as what they would have been
    assert {record.outcome for record in records} == {OVERTIME}
    assert records[0].said == f"ended after {SHORT:g} s"


def test_a_false_claim_is_seen(misbehaved: dict[str, list[Record]]) -> None:
    assert all(record.status == "solved" and record.false_claim for record in misbehaved["lies"])
    assert not any(record.false_claim for record in misbehaved["solves"])


def test_the_same_seed_gives_the_same_and_another_gives_others(
    once: tuple[Settings, Path, list[Record]], tmp_path: Path
) -> None:
    asked, _, first = once
    assert timeless(run(asked, tmp_path / "again").records) == timeless(first)
    other = Settings(asked.sets, asked.adapters, 1, 0, seed=1, minutes=3.0)
    assert timeless(run(other, tmp_path / "other").records) != timeless(first)


def test_goals_that_move_are_followed_frame_by_frame(fakes: ModuleType, tmp_path: Path) -> None:
    asked = Settings((fakes.MOVING,), (fakes.adapter("solves"),), 1, 0, minutes=3.0)
    (record,) = run(asked, tmp_path).records
    assert record.frames == 5
    assert record.worst < 1e-3
    assert record.frame_p95 >= record.seconds > 0.0


def run_slowly(asked: Settings, folder: Path) -> None:
    """Run in a group of processes of its own, slowly, or it may be over before it is killed."""
    os.setsid()
    os.environ["FAKES_SLEEP"] = "0.15"
    run(asked, folder)


def test_a_killed_run_goes_on_where_it_was(fakes: ModuleType, tmp_path: Path) -> None:
    asked = settings(fakes, "solves", "sleeps", cases=3)
    folder = tmp_path / "killed"
    process = multiprocessing.get_context("fork").Process(target=run_slowly, args=(asked, folder))
    process.start()
    lines = folder / NAME
    end = time.monotonic() + 200.0
    while not lines.exists() or lines.read_bytes().count(b"\n") < 2:
        assert process.is_alive()
        assert time.monotonic() < end
        time.sleep(0.02)
    assert process.pid is not None
    os.killpg(process.pid, signal.SIGKILL)
    process.join()
    kept = lines.read_bytes()
    assert kept.count(b"\n") < 4, "it was over before it was killed"
    resumed = run(asked, folder)
    assert lines.read_bytes().startswith(kept[: kept.rfind(b"\n") + 1])  # what was finished is not done again
    assert len(resumed.chunks) == len({chunk.number for chunk in resumed.chunks}) == 3
    by_method = sorted(timeless(resumed.records), key=str)
    assert by_method == sorted(timeless(run(asked, tmp_path / "whole").records), key=str)


def test_a_finished_run_is_not_run_again(fakes: ModuleType, once: tuple[Settings, Path, list[Record]]) -> None:
    asked, folder, records = once
    assert run(asked, folder).records == records
    with pytest.raises(InputError, match=r"holds a run with cases = 1, and 2 is asked for"):
        Store(folder, settings(fakes, "solves", cases=2, sweep=0).described())


def test_a_set_that_cannot_be_built_is_an_error_with_its_reason(fakes: ModuleType, tmp_path: Path) -> None:
    asked = Settings((fakes.BROKEN,), (fakes.adapter("solves"),), 1, 0, minutes=3.0)
    with pytest.raises(WholebodyError, match="RuntimeError: the set is broken"):
        run(asked, tmp_path)


def test_a_cluster_that_is_not_there_is_one_sentence() -> None:
    pytest.importorskip("distributed")
    from wholebody.base.batches import threads

    with pytest.raises(WholebodyError, match="no dask scheduler answers"):
        threads("not an address")
