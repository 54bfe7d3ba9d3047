"""What every figure offers by name: joints, limits, reduction, chains as Denavit-Hartenberg tables."""

import numpy as np
import pinocchio as pin
import pytest

from wholebody.base.errors import InputError, UnknownNameError
from wholebody.figures import Figure, load
from wholebody.figures.denavit_hartenberg import denavit_hartenberg
from wholebody.figures.description import Description

HUMAN = load("human")
BRANCHES = ("right_arm", "left_arm", "right_leg", "left_leg", "spine", "neck")


def place(figure, q, frame):
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, q)
    return data.oMf[figure.frame_id(frame)]


def random_posture(figure, rng):
    q = pin.randomConfiguration(figure.model, np.full(figure.model.nq, -1.0), np.full(figure.model.nq, 1.0))
    q[figure.limits.idx_q] = rng.uniform(figure.limits.lower, figure.limits.upper)
    return q


def test_joint_values_and_with_joints_are_inverse():
    q = random_posture(HUMAN, np.random.default_rng(0))
    values = HUMAN.joint_values(q)
    assert len(values) == 49
    assert HUMAN.with_joints(HUMAN.neutral, values)[7:] == pytest.approx(q[7:])
    assert (
        HUMAN.with_joints(q, {"left_elbow_flexion": 0.5})[
            HUMAN.model.joints[HUMAN.joint_id("left_elbow_flexion")].idx_q
        ]
        == 0.5
    )


def test_with_joints_leaves_its_argument_alone():
    q = HUMAN.posture("standing")
    HUMAN.with_joints(q, {"spine2_rotation": 0.05})
    assert (q == HUMAN.posture("standing")).all()
    HUMAN.posture("standing")[:] = 7.0
    assert (q == HUMAN.posture("standing")).all()


def test_dofs_take_joints_groups_and_the_root():
    assert HUMAN.dofs(["root"]).tolist() == [0, 1, 2, 3, 4, 5]
    assert len(HUMAN.dofs("right_arm")) == 9
    assert len(HUMAN.dofs(["upper_body", "spine", "left_elbow_flexion"])) == 30
    assert len(HUMAN.dofs([])) == 0
    everything = HUMAN.dofs(["root", "spine", "neck", "arms", "legs"])
    assert everything.tolist() == list(range(55))


def test_tangent_bounds_lead_to_the_limits():
    q = random_posture(HUMAN, np.random.default_rng(1))
    low, high = HUMAN.tangent_bounds(q)
    assert np.isinf(low[:6]).all()
    assert np.isinf(high[:6]).all()
    step = np.where(np.isfinite(low), low, 0.0)
    at_limit = pin.integrate(HUMAN.model, q, step)
    assert at_limit[HUMAN.limits.idx_q] == pytest.approx(HUMAN.limits.lower, abs=1e-12)
    assert HUMAN.within_limits(at_limit)
    assert not HUMAN.within_limits(pin.integrate(HUMAN.model, at_limit, np.r_[np.zeros(6), np.full(49, -1e-3)]))


def test_clamp_moves_only_what_is_outside():
    q = HUMAN.with_joints(HUMAN.posture("sitting"), {"left_elbow_flexion": 9.0})
    clamped = HUMAN.clamp(q)
    assert HUMAN.joint_values(clamped)["left_elbow_flexion"] == pytest.approx(np.radians(150))
    assert HUMAN.with_joints(q, {"left_elbow_flexion": 1.0}) == pytest.approx(
        HUMAN.with_joints(clamped, {"left_elbow_flexion": 1.0})
    )


@pytest.mark.parametrize("keep", [("root", "right_arm"), ("left_wrist_flexion",)])
@pytest.mark.parametrize("posture", ["standing", "sitting"])
def test_reduced_figure_moves_as_the_whole_one(keep, posture):
    part = HUMAN.reduced(keep, posture=posture)
    rng = np.random.default_rng(4)
    assert part.root == ("free" if "root" in keep else "fixed")
    whole = HUMAN.posture(posture)
    q = part.posture(posture)
    values = {name: rng.uniform(-0.2, 0.2) for name in part.joints}
    whole, q = HUMAN.with_joints(whole, values), part.with_joints(q, values)
    for frame in (*HUMAN.frames, *HUMAN.segments):
        expected = place(HUMAN, whole, frame).homogeneous
        assert place(part, q, frame).homogeneous == pytest.approx(expected, abs=1e-12)
    assert part.effort_weights.shape == (part.model.nv,)
    ours, theirs = pin.GeometryData(part.geometry), pin.GeometryData(HUMAN.geometry)
    pin.updateGeometryPlacements(part.model, part.model.createData(), part.geometry, ours, q)
    pin.updateGeometryPlacements(HUMAN.model, HUMAN.model.createData(), HUMAN.geometry, theirs, whole)
    for a, b in zip(ours.oMg, theirs.oMg, strict=True):
        assert a.homogeneous == pytest.approx(b.homogeneous, abs=1e-12)


def test_reduced_figure_keeps_the_pairs_that_can_move_and_says_which_it_dropped():
    part = HUMAN.reduced(["root", "right_arm"])
    pieces = part.geometry.geometryObjects
    assert all(pieces[p.first].parentJoint != pieces[p.second].parentJoint for p in part.geometry.collisionPairs)
    dropped = len(HUMAN.geometry.collisionPairs) - len(part.geometry.collisionPairs)
    assert dropped > 0
    assert sum(entry.reason == "locked together" for entry in part.excluded_pairs) == dropped
    assert set(part.chains) == {"right_arm"}
    assert part.groups["right_arm"] == HUMAN.groups["right_arm"]
    assert set(part.cones) == {"right_shoulder"}


def test_reduction_can_be_repeated():
    part = HUMAN.reduced(["root", "arms"]).reduced(["right_elbow_flexion"])
    assert part.joints == ("right_elbow_flexion",)
    q = part.with_joints(part.neutral, {"right_elbow_flexion": 1.0})
    expected = place(HUMAN, HUMAN.with_joints(HUMAN.neutral, {"right_elbow_flexion": 1.0}), "right_palm")
    assert place(part, q, "right_palm").homogeneous == pytest.approx(expected.homogeneous, abs=1e-12)


def test_a_model_by_hand_has_the_frames_of_its_joints():
    model = pin.Model()
    first = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "first")
    model.addJoint(first, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.3])), "second")
    named = Description({}, {}, (), (), {"zero": lambda figure: pin.neutral(figure.model)})
    made = Figure("made", model, pin.GeometryModel(), "own", named)
    assert model.nframes == 1  # the user's own model stays as it is
    assert made.placement(made.neutral, "second").translation == pytest.approx((0.0, 0.0, 0.3))
    assert made.reduced(["second"]).joints == ("second",)
    assert made.mounted(made, on="second", name="more").joints == ("first", "second", "more/first", "more/second")


@pytest.mark.parametrize("branch", BRANCHES)
@pytest.mark.parametrize("case", ["whole", "avatar"])
def test_denavit_hartenberg_gives_pinocchios_kinematics(branch, case):
    figure = HUMAN if case == "whole" else load("avatar", sex="female")
    if branch not in figure.chains:
        pytest.skip("the avatar has no spine")
    dh, rng = denavit_hartenberg(figure, branch), np.random.default_rng(6)
    assert dh.joints == figure.chains[branch].joints
    for _ in range(10):
        q = random_posture(figure, rng)
        values = figure.joint_values(q)
        expected = place(figure, q, dh.reference).inverse() * place(figure, q, dh.tip)
        found = dh.forward([values[name] for name in dh.joints])
        assert found.homogeneous == pytest.approx(expected.homogeneous, abs=1e-12)
    assert "alpha" in str(dh)
    assert (dh.a >= -1e-12).all()


def test_denavit_hartenberg_of_a_textbook_arm(tmp_path):
    # Two parallel axes and one across: a planar arm of links 0.5 m and 0.3 m that turns about the vertical first.
    (tmp_path / "arm.urdf").write_text(
        """<robot name="arm"><link name="base"/><link name="a"/><link name="b"/><link name="c"/><link name="tip"/>
        <joint name="j1" type="continuous">
        <parent link="base"/><child link="a"/><origin xyz="0 0 0.2"/><axis xyz="0 0 1"/></joint>
        <joint name="j2" type="continuous">
        <parent link="a"/><child link="b"/><origin xyz="0 0.2 0.1"/><axis xyz="0 1 0"/></joint>
        <joint name="j3" type="continuous">
        <parent link="b"/><child link="c"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/></joint>
        <joint name="end" type="fixed"><parent link="c"/><child link="tip"/><origin xyz="0.3 0 0"/></joint></robot>"""
    )
    figure = load(tmp_path / "arm.urdf")
    dh = denavit_hartenberg(figure, "tip")
    assert np.abs(dh.alpha) == pytest.approx([np.pi / 2, 0, 0], abs=1e-12)
    assert dh.a == pytest.approx([0, 0.5, 0], abs=1e-12)
    # The second axis meets the first 0.1 m above its joint; of all normals of parallel axes the one without d is taken.
    assert dh.d == pytest.approx([0.1, 0, 0], abs=1e-12)
    rng = np.random.default_rng(2)
    angles = rng.uniform(-3, 3, 3)
    q = figure.with_joints(figure.neutral, dict(zip(("j1", "j2", "j3"), angles, strict=True)))
    assert dh.forward(angles).homogeneous == pytest.approx(place(figure, q, "tip").homogeneous, abs=1e-12)
    assert figure.joint_values(q)["j2"] == pytest.approx(angles[1])


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda model: setattr(model.inertias[2], "mass", np.nan), "mass of nan kg"),
        (lambda model: setattr(model.inertias[2], "mass", -1.0), "mass of -1 kg"),
        (lambda model: setattr(model.inertias[2], "mass", 2e9), r"mass of 2e\+09 kg"),
        (lambda model: setattr(model.inertias[2], "lever", np.full(3, np.inf)), "centre of mass .* not finite"),
        (lambda model: setattr(model.jointPlacements[2], "translation", np.full(3, np.nan)), "origin is not finite"),
        (lambda model: setattr(model.jointPlacements[2], "translation", np.full(3, 1e300)), "origin is not finite"),
        (lambda model: model.lowerPositionLimit.__setitem__(1, 9.0), "limits are 9 and 3"),
        (lambda model: model.upperPositionLimit.__setitem__(1, np.nan), "limits are -3 and nan"),
        (lambda model: model.velocityLimit.__setitem__(1, -1.0), "velocity limit is -1"),
    ],
)
def test_a_model_with_numbers_that_no_body_has_is_refused(planar_arm, spoil, said):
    arm = planar_arm((0.3, 0.3))
    model = arm.model.copy()
    spoil(model)
    with pytest.raises(InputError, match=f"^arm, joint 'turn1': .*{said}"):
        Figure("arm", model, arm.geometry, "own", arm.describe())


def test_a_placement_is_that_of_the_frame_the_segment_or_the_joint() -> None:
    q = random_posture(HUMAN, np.random.default_rng(4))
    for name in ("left_palm", "right_shank", "left_elbow_flexion"):
        np.testing.assert_allclose(HUMAN.placement(q, name).homogeneous, place(HUMAN, q, name).homogeneous, atol=1e-12)
    standing = HUMAN.posture("standing")
    # hanging hands: fingers point down, palms to the thighs
    assert HUMAN.placement(standing, "left_palm").rotation[2, 0] < -0.9
    assert HUMAN.placement(standing, "left_palm").rotation[1, 2] < -0.9
    with pytest.raises(UnknownNameError, match="left_palm"):
        HUMAN.placement(standing, "left_plam")
    with pytest.raises(InputError):
        HUMAN.placement(standing[1:], "left_palm")


def test_a_placement_is_right_where_another_thread_asks_for_one_in_the_middle_of_it(monkeypatch):
    """What a figure computes in is used again; two calls never share it."""
    rng = np.random.default_rng(7)
    first, second, third = (random_posture(HUMAN, rng) for _ in range(3))
    forward, between = pin.computeJointJacobians, []

    def interrupted(*given):
        forward(*given)
        if not between:
            between.append(None)
            between[0] = HUMAN.placement(second, "left_palm")

    monkeypatch.setattr(pin, "computeJointJacobians", interrupted)
    found = [HUMAN.placement(first, "left_palm"), *between, HUMAN.placement(third, "left_palm")]
    monkeypatch.undo()
    for q, one in zip((first, second, third), found, strict=True):
        np.testing.assert_allclose(one.homogeneous, place(HUMAN, q, "left_palm").homogeneous, atol=1e-12)


def test_a_placement_is_kept_when_the_next_one_is_asked_for():
    figure = load("human")
    standing, sitting = (figure.posture(name) for name in ("standing", "sitting"))
    first = figure.placement(standing, "left_knee_flexion")
    before = first.homogeneous.copy()
    later = figure.placement(sitting, "left_knee_flexion")
    data = figure.model.createData()
    pin.forwardKinematics(figure.model, data, sitting)
    assert np.array_equal(first.homogeneous, before)
    assert np.array_equal(later.homogeneous, data.oMi[figure.joint_id("left_knee_flexion")].homogeneous)


def test_a_person_of_whom_no_pair_is_tested_stands_as_its_joints_say() -> None:
    person = load("human")
    geometry = person.geometry.copy()
    geometry.removeAllCollisionPairs()
    alone = Figure("alone", person.model, geometry, person.detail, person.describe(), person.visual)
    np.testing.assert_array_equal(alone.posture("standing"), person.posture("standing"))
