"""The table of robots: every description is listed, what is refused with its reason, and reaches are possible."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from tests.audits.robots import descriptions, examine, measure, robots_report, tip_targets
from wholebody.base.errors import InputError

ROBOT = """<robot name="r"><link name="a"/>
<link name="b"><collision><origin xyz="0 0 0.2"/><geometry><cylinder radius="0.02" length="0.3"/></geometry>
</collision></link>
<link name="c"><collision><origin xyz="0 0 0.2"/><geometry><sphere radius="0.03"/></geometry></collision></link>
<link name="d"><collision><geometry><sphere radius="0.03"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="k" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0 0 0.4"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="l" type="revolute"><parent link="c"/><child link="d"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "good").mkdir()
    (tmp_path / "good" / "robot.urdf").write_text(ROBOT)
    (tmp_path / "bad.urdf").write_text("<robot name='r'/>")
    (tmp_path / "package.xml").write_text("<package/>")
    return tmp_path


def test_every_description_is_loaded_twice_or_refused(folder: Path) -> None:
    bad, good = sorted(measure(folder, 3), key=lambda row: row.case)
    assert bad.tool == "refused"
    assert "there are no links in it" in bad["refused"]
    assert (good["freedoms"], good["pieces"], good["pairs"]) == (3, 3, 1)
    assert good["free mm"] > 0.0
    assert (good["solved"], good["reaches"]) == (3, 3)
    text = robots_report([bad, good], {"wholebody": "1"}, 3)
    assert "1 of 2 descriptions load" in text
    assert "| `good/robot.urdf` | URDF |" in text
    assert "- refused: bad.urdf: there are no links in it" in text


def test_a_mujoco_file_is_a_description_and_a_package_file_is_none(folder: Path) -> None:
    (folder / "arm.xml").write_text("<mujoco/>")
    assert [path.name for path in descriptions(folder)] == ["bad.urdf", "robot.urdf", "arm.xml"]
    with pytest.raises(InputError, match="no such folder"):
        descriptions(folder / "nowhere")
    (folder / "empty").mkdir()
    with pytest.raises(InputError, match=r"no \.urdf files"):
        descriptions(folder / "empty")


def test_targets_are_where_free_postures_have_the_tip(folder: Path) -> None:
    figure = wb.load(folder / "good" / "robot.urdf")
    scene = wb.Scene(figure)
    first, again = (tip_targets(figure, scene, 5) for _ in range(2))
    assert [tip for tip, _ in first] == ["d"] * 5
    for (_, a), (_, b) in zip(first, again, strict=True):
        assert np.array_equal(a, b)
        assert np.linalg.norm(a) < 0.8
    assert "solved" not in examine(str(folder / "good" / "robot.urdf"), 0)
