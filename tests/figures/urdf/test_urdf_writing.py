"""Joints written as URDF are the joints that Pinocchio reads from it."""

from __future__ import annotations

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin
import pytest

from wholebody.figures.urdf.joints import ANY_LIMIT, add_joint, urdf_axis

OBLIQUE = np.array([1.0, -2.0, 2.0]) / 3.0
KINDS = {
    "revolute": pin.JointModelRevoluteUnaligned(*OBLIQUE),
    "continuous": pin.JointModelRUBY(),  # Python has no constructor of an oblique one
    "prismatic": pin.JointModelPrismaticUnaligned(*OBLIQUE),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_joint_comes_back_as_it_was(kind: str) -> None:
    """Its placement and its axis have all digits, and its kind is the one that was built."""
    model = pin.Model()
    place = pin.SE3(pin.exp3(np.array([0.3, -0.7, 1.1])), np.array([0.1, 0.2, -0.3]))
    model.addJoint(0, KINDS[kind], place, "one")
    known = urdf_axis(model, 1)
    assert known is not None
    assert known.kind == kind
    robot = Element("robot", name="written")
    for link in ("base", "tip"):
        SubElement(robot, "link", name=link)
    limit = None if kind == "continuous" else ANY_LIMIT
    add_joint(robot, "one", known.kind, "base", "tip", origin=place, axis=known.axis, limit=limit)
    read = pin.buildModelFromXML(ElementTree.tostring(robot, encoding="unicode"))
    assert read.joints[1].shortname() == model.joints[1].shortname()
    q = pin.integrate(model, pin.neutral(model), np.array([0.4]))
    found = []
    for one in (model, read):
        data = one.createData()
        pin.forwardKinematics(one, data, q)
        found.append(data.oMi[1].homogeneous)
    np.testing.assert_allclose(found[1], found[0], atol=1e-14)


def test_a_follower_has_its_own_axis() -> None:
    """The factor by which a joint follows is not part of its axis."""
    text = """<robot name="two"><link name="a"/><link name="b"/><link name="c"/>
    <joint name="leads" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
      <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
    <joint name="slides" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="0 1 0"/>
      <limit lower="-1" upper="1" effort="1" velocity="1"/><mimic joint="leads" multiplier="-0.25"/></joint></robot>"""
    model = pin.buildModelFromXML(text, mimic=True)
    known = urdf_axis(model, model.getJointId("slides"))
    assert known is not None
    assert known.kind == "prismatic"
    np.testing.assert_allclose(known.axis, [0.0, 1.0, 0.0], atol=1e-15)


@pytest.mark.parametrize("joint", [pin.JointModelFreeFlyer(), pin.JointModelSpherical(), pin.JointModelPlanar()])
def test_a_joint_of_several_degrees_of_freedom_has_no_axis(joint: pin.JointModel) -> None:
    """URDF has no one axis for it."""
    model = pin.Model()
    model.addJoint(0, joint, pin.SE3.Identity(), "one")
    assert urdf_axis(model, 1) is None
