"""People of an assembly are drawn with their surface, things of it as they are."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.view.bodies import Bodies, Skin, scene_glb
from wholebody.view.scene_graph import Keyframe
from wholebody.view.style import LOOK
from wholebody.view.viewed_scene import ViewedAssembly, ViewedScene


@pytest.fixture(scope="module")
def assembly() -> wb.Assembly:
    figure = wb.load("human")
    beside = figure.posture("a_pose")
    beside[1] = 0.9
    made = wb.Assembly().figure("anna", figure).figure("ben", figure, beside, color=(0.0, 1.0, 0.0, 1.0))
    return made.body("ball", shape=wb.Sphere(0.1), at=(0.6, 0.0, 1.0))


def test_the_surface_follows_each_figures_own_joints(assembly: wb.Assembly) -> None:
    viewed = ViewedAssembly(assembly)
    bodies = Bodies(viewed, (), False)
    data = viewed.model.createData()
    pin.forwardKinematics(viewed.model, data, assembly.q)
    keyframe = Keyframe()
    bodies.pose(keyframe, data)
    for name, figure in assembly.figures.items():
        at = wb.Scene(figure).state(assembly.posture(name))
        for joint in ("left_elbow_pronation", "right_knee_flexion", "root_joint"):
            shown = keyframe.transforms[f"{LOOK.figure_node}/{name}/{joint}"]
            assert np.abs(shown - at.data.oMi[figure.model.getJointId(joint)].homogeneous).max() < 1e-9


@pytest.mark.parametrize("pieces", [False, True])
def test_pieces_are_drawn_only_where_they_are_asked_for(assembly: wb.Assembly, pieces: bool) -> None:
    bodies = Bodies(ViewedAssembly(assembly), (), pieces)
    data = bodies.scene.model.createData()
    pin.forwardKinematics(bodies.scene.model, data, assembly.q)
    keyframe = Keyframe()
    bodies.pose(keyframe, data)
    drawn = [body for body in bodies.all if body.path in keyframe.colors]
    people = [body for body in drawn if body.thing != "ball"]
    assert len(drawn) - len(people) == 1
    assert len(people) == (2 * len(assembly.figures["anna"].geometry.geometryObjects) if pieces else 0)


@pytest.mark.parametrize("assembled", [False, True])
def test_a_figure_whose_root_is_fixed_stands_among_others(assembled: bool) -> None:
    human = wb.load("human")
    seated = human.reduced(["right_arm"])
    scene: ViewedScene = wb.Scene({"a": (seated, (1.0, 2.0, 0.0)), "b": human})
    if assembled:
        scene = ViewedAssembly(wb.Assembly().figure("a", seated).figure("b", human))
    at = np.zeros(3) if assembled else np.array([1.0, 2.0, 0.0])
    bodies, data = Bodies(scene, (), False), scene.model.createData()
    q = pin.neutral(scene.model)
    pin.forwardKinematics(scene.model, data, q)
    keyframe = Keyframe()
    bodies.pose(keyframe, data)
    drawn = next(figure for figure in bodies.drawn if figure.prefix == "a/")
    assert isinstance(drawn.visual, Skin)
    alone = seated.model.createData()
    pin.framesForwardKinematics(seated.model, alone, pin.neutral(seated.model))
    for bone, (joint, offset) in zip(drawn.visual.surface.bones, drawn.visual.places, strict=True):
        shown = keyframe.transforms[drawn.nodes[joint]] @ offset
        if bone.parent is None and bone.segment in seated.segments:
            own = alone.oMf[seated.frame_id(bone.segment)].translation
            assert shown[:3, 3] == pytest.approx(at + own, abs=1e-9)
    assert scene_glb(scene, bodies, q[None], 0.1, "two")
