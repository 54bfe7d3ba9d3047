from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from wholebody.cli import examination
from wholebody.cli.examination import EXTRAS, MODULES, Distribution, Outcome

Fake = Callable[..., None]


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Fake:
    """An installation in which everything works, but for what the test says."""

    def arrange(
        have: dict[str, Distribution] | None = None, fails: dict[str, str] | None = None, absent: Sequence[str] = ()
    ) -> None:
        everything = {examination.normal(name): Distribution("1.0") for name in (*MODULES, *EXTRAS)} | (have or {})
        for name in absent:
            del everything[name]
        failing = {MODULES.get(name, name): "ModuleNotFoundError: absent" for name in absent} | (fails or {})

        def run(kind: str, names: Sequence[str]) -> dict[str, Outcome]:
            return {name: Outcome(name not in failing, failing.get(name, "fine")) for name in names}

        monkeypatch.setattr(examination, "installed", lambda names: everything)
        monkeypatch.setattr(examination, "run", run)

    return arrange


def test_a_sound_installation_has_no_faults(fake: Fake) -> None:
    fake()
    report = examination.examine({})
    assert report.healthy
    assert {entry.kind for entry in report.entries} == {"package", "QP solver", "method", "tool", "cache"}
    assert all(entry.state == "works" for entry in report.entries)


def test_what_is_absent_but_not_needed_is_no_fault_and_says_how_it_is_had(fake: Fake) -> None:
    fake(absent=["mujoco", "piqp"], fails={"chromium": "FileNotFoundError: not found"})
    report = examination.examine({})
    assert report.healthy
    mends = {
        entry.name: entry.repair for entry in report.entries if entry.state == "absent" and entry.kind != "QP solver"
    }
    assert mends == {
        "mujoco": "pip install 'wholebody[compare]'",
        "piqp": "pip install 'wholebody[solvers]'",
        "chromium": "apt-get install chromium-headless-shell",
    }


@pytest.mark.parametrize(
    ("arranged", "environ", "sentence", "repair"),
    [
        (
            {"have": {"placo": Distribution("0.10.2", ("pin==3.8.0",)), "pin": Distribution("4.1.0")}},
            {},
            "placo needs pin==3.8.0, and 4.1.0 is installed",
            "pip install 'placo' 'pin==3.8.0'",
        ),
        ({"fails": {"coal": "ImportError: undefined symbol"}}, {}, "undefined symbol", examination.AGAIN),
        ({"absent": ["coal"]}, {}, "the package coal is absent", examination.AGAIN),
        ({"fails": {"osqp": "ended the process (SIGSEGV)"}}, {}, "SIGSEGV", examination.AGAIN),
        ({"fails": {"qp": "ArithmeticError: a reach of 5 cm ended stalled"}}, {}, "stalled", examination.AGAIN),
        (
            {"have": {"numpy": Distribution("2.0", files=frozenset({"/right/numpy/__init__.py"}))}},
            {},
            "2.0 is installed, but",
            "unset PYTHONPATH",
        ),
    ],
)
def test_faults_come_with_their_mend(
    fake: Fake, arranged: dict[str, object], environ: dict[str, str], sentence: str, repair: str
) -> None:
    fake(**arranged)
    report = examination.examine(environ)
    assert not report.healthy
    assert any(sentence in said and repair == told for said, told in report.faults), report.faults


def test_a_ros_workspace_on_the_paths_is_a_fault(fake: Fake, tmp_path: Path) -> None:
    (tmp_path / "pinocchio").mkdir()
    (tmp_path / "libboost_python311.so").touch()
    fake()
    report = examination.examine({"PYTHONPATH": str(tmp_path), "LD_LIBRARY_PATH": str(tmp_path)})
    assert [repair for _, repair in report.faults] == ["unset PYTHONPATH", "unset LD_LIBRARY_PATH"]


def test_the_examination_loads_nothing_that_it_may_find_broken() -> None:
    code = "import sys, wholebody.cli.doctor; print(*{'pinocchio', 'coal', 'osqp'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not done.stdout.split()
