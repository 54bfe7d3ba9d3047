from __future__ import annotations

import os
from pathlib import Path

import pytest

from wholebody.doctor.environment import loader_folders, python_fault, shadowing_folders


@pytest.mark.parametrize("version", [(3, 10), (3, 11), (3, 12), (3, 13)])
def test_supported_pythons_are_no_fault(version: tuple[int, int]) -> None:
    assert python_fault(version) is None


@pytest.mark.parametrize("version", [(2, 7), (3, 9), (3, 14)])
def test_other_pythons_are(version: tuple[int, int]) -> None:
    assert f"{version[0]}.{version[1]}" in (python_fault(version) or "")


def test_a_workspace_on_pythonpath_that_brings_its_own_pinocchio_is_named(tmp_path: Path) -> None:
    ros, plain = tmp_path / "ros", tmp_path / "plain"
    (ros / "pinocchio").mkdir(parents=True)
    (ros / "numpy.py").touch()
    plain.mkdir()
    path = os.pathsep.join([str(plain), "", str(tmp_path / "absent"), str(ros)])
    assert shadowing_folders({"PYTHONPATH": path}, ["pinocchio", "numpy", "coal"]) == {str(ros): ["numpy", "pinocchio"]}
    assert shadowing_folders({}, ["pinocchio"]) == {}


def test_libraries_that_replace_the_wheels_own_are_named(tmp_path: Path) -> None:
    (tmp_path / "libpinocchio_default.so.3").touch()
    (tmp_path / "libsomething.so").touch()
    assert loader_folders({"LD_LIBRARY_PATH": str(tmp_path)}) == {str(tmp_path): ["libpinocchio"]}
    assert loader_folders({"LD_LIBRARY_PATH": ""}) == {}
