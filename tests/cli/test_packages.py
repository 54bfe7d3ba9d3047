from __future__ import annotations

import os
import re
import sys
from pathlib import Path

from wholebody.cli.examination import (
    EXTRAS,
    MODULES,
    Conflict,
    Distribution,
    conflicts,
    installed,
    loader_folders,
    python_fault,
    shadow,
    shadowing_folders,
)

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PLACO = Distribution("0.10.2", ("cmeel", "pin==3.8.0", "cmeel-urdfdom==4.0.1", "meshcat", "extra-one==1; extra == 'x'"))
URDFDOM = Distribution("4.0.1")


def test_versions_that_fit_are_no_conflict() -> None:
    assert conflicts({"placo": PLACO, "pin": Distribution("3.8.0"), "cmeel-urdfdom": URDFDOM}) == []


def test_placo_beside_another_pin_is_named_with_its_mend() -> None:
    (found,) = conflicts({"placo": PLACO, "pin": Distribution("4.1.0"), "cmeel-urdfdom": URDFDOM})
    assert found == Conflict("placo", "pin==3.8.0", "4.1.0")
    assert str(found) == "placo needs pin==3.8.0, and 4.1.0 is installed"
    assert found.repair == "pip install 'placo' 'pin==3.8.0'"


def test_an_old_placo_contradicts_wholebody_itself() -> None:
    (found,) = conflicts({"wholebody": Distribution("1", ("placo==0.10.2",)), "placo": Distribution("0.6.2")})
    assert (found.who, found.found, found.repair) == ("wholebody", "0.6.2", "pip install 'placo==0.10.2'")


def test_what_is_missing_is_said_to_be_missing() -> None:
    (found,) = conflicts({"pin": Distribution("3.8.0", ("libpinocchio == 3.8.0", "coal >= 3.0.2, < 4"))})
    assert str(found) == "pin needs libpinocchio==3.8.0, and it is not installed"


def test_a_module_from_elsewhere_is_noticed(tmp_path: Path) -> None:
    right, wrong = tmp_path / "site" / "pinocchio" / "__init__.py", tmp_path / "ros" / "pinocchio" / "__init__.py"
    package = Distribution("3.8.0", files=frozenset({os.path.realpath(right)}))
    assert shadow(package, str(right)) is None
    assert shadow(package, str(wrong)) == str(tmp_path / "ros")
    assert shadow(Distribution("3.8.0"), str(wrong)) is None, "metadata that lists no files proves nothing"


def test_the_examined_packages_are_those_of_the_project() -> None:
    """Read from the project's own file; what tests, builds and documentation need is no part of an installation."""
    text = (Path(__file__).parents[2] / "pyproject.toml").read_text()
    project = tomllib.loads(text)["project"]

    def names(requirements: list[str]) -> set[str]:
        return {re.split(r"[<>=!~;\[ ]", each)[0] for each in requirements}

    assert names(project["dependencies"]) - {"tomli"} == {*MODULES}  # tomli is needed on Python 3.10 alone
    of_users = {name: each for name, each in project["optional-dependencies"].items()
                if name not in ("test", "build", "docs")}  # fmt: skip
    assert set().union(*map(names, of_users.values())) - {"pin"} == {*EXTRAS}
    assert all(name in names(of_users[extra]) for name, extra in EXTRAS.items())


def test_what_is_needed_is_installed_here() -> None:
    found = installed([*MODULES, "placo", "no-such-distribution"])
    assert {"placo", "pin", "libpinocchio", "cmeel-urdfdom"} <= set(found)  # in an exact version, of others
    assert conflicts(found) == []
    assert "no-such-distribution" not in found
    for name in MODULES:
        assert found[name].version[0].isdigit()
        assert any(os.path.isfile(file) for file in found[name].files)


def test_pythons_without_packages_are_a_fault() -> None:
    assert [python_fault(version) for version in ((3, 10), (3, 11), (3, 12), (3, 13), (3, 14))] == [None] * 5
    for version in ((2, 7), (3, 9), (3, 15)):
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
