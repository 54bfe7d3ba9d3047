"""Nothing but our own reaches standard output: what compiled libraries print there counts too."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.cli.main import main

TEXTURED = """<mujoco model="block">{compiler}<asset>
  <texture name="floor" type="2d" builtin="checker" rgb1="1 1 1" rgb2="0 0 0" width="8" height="8"/>
  <texture type="skybox" builtin="gradient" rgb1="1 1 1" rgb2="0 0 0" width="8" height="8"/>
  <material name="painted" texture="floor" rgba="1 0 0 1"/><mesh name="wedge" file="{file}"/></asset>
<worldbody><body name="base"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="turn" axis="0 0 1"/>
  <geom type="mesh" mesh="wedge" material="painted"/><geom type="sphere" size="0.1" pos="0 0 1" material="painted"/>
</body></worldbody></mujoco>"""
WEDGE = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


@pytest.mark.parametrize(
    ("compiler", "file"),
    [
        ("", "parts/wedge.obj"),
        ('<compiler meshdir="parts"/>', "wedge.obj"),
        ('<compiler assetdir="parts" angle="radian"/>', "wedge.obj"),
        ('<compiler meshdir="FOLDER/parts"/>', "wedge.obj"),
        ('<compiler meshdir="parts" strippath="true"/>', "elsewhere/wedge.obj"),
    ],
)
def test_textures_without_a_file(compiler: str, file: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The figure is that of the same file without textures."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "wedge.obj").write_text(WEDGE)
    text = TEXTURED.format(compiler=compiler.replace("FOLDER", str(tmp_path)), file=file)
    (tmp_path / "painted.xml").write_text(text)
    lines = [line for line in text.replace(' texture="floor"', "").splitlines() if "<texture" not in line]
    (tmp_path / "plain.xml").write_text("\n".join(lines))
    painted, plain = wb.load(tmp_path / "painted.xml"), wb.load(tmp_path / "plain.xml")
    assert painted.model == plain.model
    assert painted.geometry.ngeoms == plain.geometry.ngeoms == 2
    for one, other in zip(painted.geometry.geometryObjects, plain.geometry.geometryObjects, strict=True):
        assert one.placement == other.placement
    assert main(["figure", str(tmp_path / "painted.xml")]) == 0
    assert "Warning" not in capfd.readouterr().out
    (tmp_path / "parts" / "wedge.obj").unlink()
    with pytest.raises(wb.FileFormatError, match="wedge") as told:
        wb.load(tmp_path / "painted.xml")
    assert "scratch" not in str(told.value)


class Odd(wb.Goal):
    """The palm's x, which is something else beyond a plane."""

    size = 1

    def __init__(self, value: float, where: str) -> None:
        self._value, self._where = value, where

    def _here(self, state: Any) -> tuple[float, Any, bool]:
        frame = state.model.getFrameId("right_palm")
        x = float(state.frame(frame).translation[0])
        rows = pin.getFrameJacobian(state.model, state.data, frame, pin.LOCAL_WORLD_ALIGNED)[:1]
        return x, rows, x > 0.1

    def error(self, state: Any) -> Any:
        x, _, beyond = self._here(state)
        return np.array([self._value if beyond and self._where == "error" else x - 0.3])

    def jacobian(self, state: Any) -> Any:
        _, rows, beyond = self._here(state)
        return rows * self._value if beyond and self._where == "jacobian" else rows


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("where", ["error", "jacobian"])
@pytest.mark.parametrize("method", ["qp", "dls"])
def test_terms_of_ones_own_that_no_solver_can_take(method: str, where: str, capfd: pytest.CaptureFixture[str]) -> None:
    scene = wb.Scene(wb.load("avatar"))
    problem = wb.Problem(scene, goals=[Odd(np.nan, where)])
    with suppress(wb.WholebodyError):
        wb.solve(problem, method=method)
    assert capfd.readouterr().out == ""
