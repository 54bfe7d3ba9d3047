from __future__ import annotations

import sys
from pathlib import Path

import pytest

from wholebody.cli.examination import run

FROM_SCRATCH = True


def test_what_works_works_and_what_fails_says_why() -> None:
    outcomes = run("import", ["json", "no_such_module"])
    assert outcomes["json"].works
    assert outcomes["json"].detail.endswith("__init__.py")
    assert outcomes["no_such_module"] == (False, "ModuleNotFoundError: No module named 'no_such_module'")


@pytest.fixture
def hostile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Modules that do what broken binary packages do."""
    (tmp_path / "crashes.py").write_text("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    (tmp_path / "talks.py").write_text('print("[[not a report]]")')
    (tmp_path / "hangs.py").write_text("import time; time.sleep(60)")
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


@pytest.mark.usefixtures("hostile")
def test_a_package_that_crashes_is_named_and_the_others_are_still_tried() -> None:
    outcomes = run("import", ["json", "crashes", "talks"])
    assert [outcome.works for outcome in outcomes.values()] == [True, False, True]
    assert "ended the process (SIGSEGV)" in outcomes["crashes"].detail


@pytest.mark.usefixtures("hostile")
def test_a_package_that_hangs_is_ended() -> None:
    outcomes = run("import", ["json", "hangs"], timeout=1)
    assert outcomes["json"].works
    assert outcomes["hangs"] == (False, "no answer within 1 s")


def test_the_current_folder_does_not_hide_packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "json.py").write_text("raise RuntimeError")
    monkeypatch.chdir(tmp_path)
    assert run("import", ["colorsys"])["colorsys"].works


def test_solvers_solve_and_one_that_is_not_there_fails() -> None:
    outcomes = run("program", ["osqp", "no_such_solver", "daqp", "quadprog"])
    works = {name: outcome.works for name, outcome in outcomes.items()}
    assert works == {"osqp": True, "no_such_solver": False, "daqp": True, "quadprog": True}


def test_methods_pose() -> None:
    assert all(outcome.works for outcome in run("pose", ["qp", "ccd"]).values())


def test_children_use_this_interpreter() -> None:
    assert run("import", ["os"])["os"].detail.startswith(sys.base_prefix)
