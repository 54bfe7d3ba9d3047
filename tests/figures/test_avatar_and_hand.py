"""The avatar of five chains, and the hand of fifteen ellipsoids."""

import numpy as np
import pinocchio as pin
import pytest

from wholebody.base.errors import InputError
from wholebody.figures import load
from wholebody.figures.anthropometry import make_person


def frames(figure, q):
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, q)
    return {frame.name: data.oMf[index] for index, frame in enumerate(figure.model.frames)}


def test_avatar_has_five_chains_on_a_rigid_torso():
    avatar = load("avatar")
    assert {name: len(chain.joints) for name, chain in avatar.chains.items()} == {
        "neck": 3,
        "left_arm": 7,
        "right_arm": 7,
        "left_leg": 7,
        "right_leg": 7,
    }
    assert avatar.model.nv == 6 + 31
    assert pin.computeTotalMass(avatar.model) == pytest.approx(make_person().mass, abs=1e-8)
    q = pin.randomConfiguration(avatar.model, np.full(38, -1.0), np.full(38, 1.0))
    at = frames(avatar, q)
    assert (at["pelvis"].inverse() * at["thorax"]).rotation == pytest.approx(np.eye(3), abs=1e-12)
    pieces = avatar.geometry.geometryObjects
    assert all(pieces[p.first].parentJoint != pieces[p.second].parentJoint for p in avatar.geometry.collisionPairs)


def test_avatar_is_the_person_with_locked_joints():
    avatar, human = load("avatar"), load("human")
    rng = np.random.default_rng(0)
    values = {name: rng.uniform(0.0, 0.2) for name in avatar.joints}
    a = frames(avatar, avatar.with_joints(avatar.neutral, values))
    b = frames(human, human.with_joints(human.neutral, values))
    for name in human.frames:
        assert a[name].homogeneous == pytest.approx(b[name].homogeneous, abs=1e-12)


@pytest.mark.parametrize("detail", ["spheres", "capsules", "hulls"])
def test_avatar_stands_free(detail):
    avatar = load("avatar", detail=detail)
    data, geometry_data = avatar.model.createData(), pin.GeometryData(avatar.geometry)
    for name in avatar.postures:
        q = avatar.posture(name)
        assert avatar.within_limits(q)
        assert not pin.computeCollisions(avatar.model, data, avatar.geometry, geometry_data, q, True), name


@pytest.mark.parametrize("side", ["left", "right"])
def test_hand_is_fifteen_polyhedra_of_a_hundred_triangles(side):
    hand = load("hand", side=side)
    assert hand.geometry.ngeoms == 15
    for piece in hand.geometry.geometryObjects:
        assert piece.geometry.num_polygons == 100
        # The polyhedron is inscribed in the ellipsoid, and fills most of it.
        points = np.array(piece.geometry.points())
        half = np.ptp(points, axis=0) / 2
        assert piece.geometry.computeVolume() / (4 / 3 * np.pi * half.prod()) == pytest.approx(0.9, abs=0.06)
    assert len(hand.joints) == 20
    assert hand.root == "free"


@pytest.mark.parametrize("side", ["left", "right"])
def test_hand_lies_palm_down_fingers_forward_and_free(side):
    hand = load("hand", side=side, sex="female", stature=1.6)
    data, geometry_data = hand.model.createData(), pin.GeometryData(hand.geometry)
    for name in hand.postures:
        q = hand.posture(name)
        assert hand.within_limits(q)
        assert not pin.computeCollisions(hand.model, data, hand.geometry, geometry_data, q, True), name
        palm = frames(hand, q)[f"{side}_palm"].rotation
        assert palm[:, 0] == pytest.approx([1, 0, 0], abs=1e-9)
        assert palm[:, 2] == pytest.approx([0, 0, -1], abs=1e-9)


def test_hand_has_a_hands_length_mass_and_thumb():
    hand = load("hand", side="right")
    at = frames(hand, hand.posture("open"))
    reach = at["right_middle_tip"].translation[0] - at["right_hand"].translation[0]
    assert reach == pytest.approx(0.99 * 0.1101 * 1.755, rel=5e-3)  # ANSUR II: hand length 0.1101 of the stature
    assert pin.computeTotalMass(hand.model) == pytest.approx(0.0061 * make_person().mass, rel=1e-3)
    # Palm down, fingers forward: the right thumb is on the left, and it hangs below the palm.
    thumb = at["right_thumb_tip"].translation - at["right_hand"].translation
    assert thumb[1] > 0.03
    assert thumb[2] < 0.0


def test_fingers_bend_towards_the_palm():
    for side in ("left", "right"):
        hand = load("hand", side=side)
        q = hand.posture("open")
        tips = frames(hand, q)
        for finger in ("index", "middle", "ring", "little"):
            bent = frames(hand, hand.with_joints(q, {f"{side}_{finger}_pip_flexion": 0.3}))
            assert bent[f"{side}_{finger}_tip"].translation[2] < tips[f"{side}_{finger}_tip"].translation[2] - 0.005
        thumb = frames(hand, hand.with_joints(q, {f"{side}_thumb_ip_flexion": 0.5}))[f"{side}_thumb_tip"]
        little = tips[f"{side}_little_tip"].translation
        moved = np.linalg.norm(thumb.translation - little) - np.linalg.norm(
            tips[f"{side}_thumb_tip"].translation - little
        )
        assert moved < 0.0


def test_hands_are_mirror_images():
    left, right = load("hand", side="left"), load("hand", side="right")
    flip = np.diag([1.0, -1.0, 1.0])
    rng = np.random.default_rng(1)
    values = {name.partition("_")[2]: rng.uniform(0, 0.3) for name in left.joints}
    a = frames(
        left, left.with_joints(pin.neutral(left.model), {f"left_{name}": value for name, value in values.items()})
    )
    b = frames(
        right, right.with_joints(pin.neutral(right.model), {f"right_{name}": value for name, value in values.items()})
    )
    for name in left.frames:
        other = b["right_" + name.partition("_")[2]]
        assert other.translation == pytest.approx(flip @ a[name].translation, abs=1e-12)


def test_finger_tips_lie_on_the_finger():
    hand = load("hand")
    for finger in ("thumb", "index", "middle", "ring", "little"):
        frame = hand.model.frames[hand.frame_id(f"right_{finger}_tip")]
        piece = next(p for p in hand.geometry.geometryObjects if p.name == f"right_{finger}_distal")
        points = np.array(piece.geometry.points()) @ piece.placement.rotation.T + piece.placement.translation
        assert np.linalg.norm(points - frame.placement.translation, axis=1).min() < 1e-9


def test_hand_has_two_sides():
    with pytest.raises(InputError, match="'left' or 'right'"):
        load("hand", side="both")
