"""Reaches of figures from files, and the tools that take them or say why not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.bench.following import followed
from wholebody.base.errors import InputError
from wholebody.bench.measure.step import taking
from wholebody.bench.measure.track import SETTING, Track, figure_tracks, judge
from wholebody.bench.suite.adapters.registry import chosen_tools, make_tool

TOOLS = [name for name in ("wholebody", "placo", "placo/pruned", "pink", "mink") if name in chosen_tools()]
LINK = '<link name="{}"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>'
JOINT = (
    '<joint name="{1}" type="revolute"><parent link="{0}"/><child link="{1}"/><origin xyz="0.3 0 0"/>'
    '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="3"/>{2}</joint>'
)


@pytest.fixture(scope="module")
def arm(root: Path) -> list[Track]:
    return figure_tracks(str(root / "tests/data/arm/arm.urdf"), 100)


def test_the_reaches_are_those_of_the_human_for_another_figure(arm: list[Track]) -> None:
    assert [track.name for track in arm] == ["arm, free", "arm, contact", "arm, alone"]
    assert [len(track.scene.objects) for track in arm] == [20, 20, 0]
    for track in arm:
        tip = track.scene.state(track.start).frame(track.scene.figure.frame_id(track.tip)).translation
        assert np.linalg.norm(track.targets[0] - tip) < 1e-3
        assert track.feet == ()
        assert 0.0 < track.clearance <= SETTING.clearance
        assert not len(track.scene.contacts(track.start, within=track.clearance).distance)
    contact = arm[1]
    place = contact.scene.objects["block"].placement.translation
    assert np.linalg.norm(contact.targets - place, axis=1).min() < 1e-9
    assert np.linalg.norm(contact.targets[0] - place) > 0.05


@pytest.mark.parametrize("name", TOOLS)
def test_tools_follow_an_arm_whose_root_is_fixed(name: str, arm: list[Track]) -> None:
    """Its first joint turns for ever; nothing is in the way."""
    alone = arm[2]
    _, verdict = followed(name, alone)
    assert verdict.limit_violation < 1e-4
    assert verdict.fastest_root == verdict.foot_drift == 0.0
    assert verdict.error[-1] < 0.2 * np.linalg.norm(alone.targets[-1] - alone.targets[0])


def test_joints_that_mimic_others_are_coupled_in_placo_and_refused_by_mink(tmp_path: Path) -> None:
    mimic = '<mimic joint="c" multiplier="-2"/>'
    joints = [JOINT.format("a", "b", ""), JOINT.format("b", "c", ""), JOINT.format("c", "d", mimic)]
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r">{"".join(map(LINK.format, "abcd"))}{"".join(joints)}</robot>')
    alone = figure_tracks(str(path), 200)[2]
    taken, refused = taking(alone, TOOLS)
    assert set(taken) | set(refused) == set(TOOLS)
    assert "wholebody" in taken
    if "mink" in TOOLS:
        assert "JointModelMimic" in refused["mink"]
    if "placo" in TOOLS:
        tool = make_tool("placo", alone)
        for target in alone.targets:
            tool.step(target)
        assert judge(replace(alone, targets=alone.targets[-1:]), tool.posture()[None]).error[-1] < 1e-4


def test_a_figure_that_cannot_reach_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "stone.urdf"
    path.write_text(f'<robot name="stone">{LINK.format("a")}</robot>')
    with pytest.raises(InputError, match="no chain"):
        figure_tracks(str(path))
