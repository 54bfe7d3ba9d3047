"""Joints that follow others, checked by Pinocchio without mimic and with the followers' values put in."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import FileFormatError
from wholebody.figures.state import State, Wrench
from wholebody.methods import installed_methods

BALL = '<collision><geometry><sphere radius="0.02"/></geometry></collision>'
INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'


def joint(name: str, parent: str, child: str, mimic: str = "", kind: str = "revolute", axis: str = "0 0 1") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="0.3 0 0"/>'
        f'<axis xyz="{axis}"/><limit lower="-1" upper="2" effort="1" velocity="3"/>{mimic}</joint>'
    )


def follow(name: str, multiplier: float = 1.0, offset: float = 0.0) -> str:
    return f'<mimic joint="{name}" multiplier="{multiplier}" offset="{offset}"/>'


def text(*joints: str) -> str:
    links = "".join(f'<link name="{name}">{INERTIAL}{BALL}</link>' for name in "abcde")
    return f'<robot name="r">{links}{"".join(joints)}</robot>'


# The leader comes after its followers in Pinocchio's order, one follower slides, and one follows a follower.
HAND = text(
    joint("a_finger", "a", "b", follow("z_leader", -2.0, 0.1)),
    joint("b_slider", "b", "c", follow("a_finger", 0.05), "prismatic", "0 1 0"),
    joint("z_leader", "a", "d"),
    joint("own", "d", "e", axis="0 1 0"),
)


@pytest.fixture
def load(tmp_path: Path) -> Callable[..., wb.Figure]:
    def made(content: str, **options: object) -> wb.Figure:
        path = tmp_path / "robot.urdf"
        path.write_text(content)
        return wb.load(path, **options)

    return made


def whole(figure: wb.Figure, q: np.ndarray, content: str) -> tuple[pin.Model, np.ndarray]:
    """Model without mimic, and the posture (nq,) of it that the figure's is."""
    base = [pin.JointModelFreeFlyer()] if figure.root == "free" else []
    model = pin.buildModelFromXML(content, *base)
    values, full = figure.joint_values(q), pin.neutral(model)
    if base:
        full[:7] = q[:7]
    for name, value in values.items():
        full[model.joints[model.getJointId(name)].idx_q] = value
    return model, full


@pytest.mark.parametrize("root", ["fixed", "free"])
def test_followers_are_where_their_law_puts_them(load: Callable[..., wb.Figure], root: str) -> None:
    figure = load(HAND, root=root)
    assert figure.model.nv == 2 + 6 * (root == "free")
    assert figure.joints == ("a_finger", "b_slider", "z_leader", "own")
    q = pin.integrate(figure.model, figure.neutral, 0.3 * np.arange(1, figure.model.nv + 1) / figure.model.nv)
    values = figure.joint_values(q)
    assert values["a_finger"] == pytest.approx(-2.0 * values["z_leader"] + 0.1)
    assert values["b_slider"] == pytest.approx(0.05 * values["a_finger"])
    model, full = whole(figure, q, HAND)
    ours, theirs = figure.model.createData(), model.createData()
    pin.framesForwardKinematics(figure.model, ours, q)
    pin.framesForwardKinematics(model, theirs, full)
    for link in "abcde":
        assert ours.oMf[figure.frame_id(link)].homogeneous == pytest.approx(
            theirs.oMf[model.getFrameId(link, pin.FrameType.BODY)].homogeneous
        )


def test_jacobians_are_the_derivatives(load: Callable[..., wb.Figure]) -> None:
    figure = load(HAND, root="free")
    state, q = State(figure.model), pin.integrate(figure.model, figure.neutral, 0.2 * np.ones(8))
    link = figure.model.frames[figure.frame_id("c")]

    def place(dq: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        state.update(pin.integrate(figure.model, q, dq))
        return state.frame(figure.frame_id("c")).translation.copy(), state.center_of_mass().copy()

    steps = 1e-6 * np.eye(8)
    numeric = [np.subtract(place(step), place(-step)) / 2e-6 for step in steps]
    state.update(q)
    point = state.frame(figure.frame_id("c")).translation
    rows = np.hstack([np.eye(3), np.cross(point, np.eye(3))])
    exact = state.wrench_jacobian(Wrench(rows, link.parentJoint))
    assert exact == pytest.approx(np.array([change[0] for change in numeric]).T, abs=1e-8)
    joints = np.full(3, link.parentJoint)
    assert state.rows(rows, joints, np.zeros(3, dtype=int)) == pytest.approx(exact)
    assert state.center_of_mass_jacobian() == pytest.approx(np.array([change[1] for change in numeric]).T, abs=1e-8)


def test_any_joint_of_those_that_move_together_can_be_set(load: Callable[..., wb.Figure]) -> None:
    figure = load(HAND)
    q = figure.with_joints(figure.neutral, {"z_leader": 0.4})
    assert figure.joint_values(q)["a_finger"] == pytest.approx(-0.7)
    again = figure.with_joints(figure.neutral, {"a_finger": -0.7})
    assert again == pytest.approx(q)
    assert figure.dofs("z_leader").tolist() == figure.dofs("a_finger").tolist()


def test_limits_are_the_leaders_and_the_followers_own(load: Callable[..., wb.Figure]) -> None:
    figure = load(HAND)
    ends = []
    for extreme in (-100.0, 100.0):
        q = figure.clamp(figure.with_joints(figure.neutral, {"a_finger": extreme}))
        ends.append(figure.joint_values(q)["z_leader"])
    assert sorted(ends) == pytest.approx([-0.95, 0.55])  # 0.1 - 2 z from -1 to 2, which is within z from -1 to 2


def test_it_is_solved_swept_tracked_reduced_and_judged(load: Callable[..., wb.Figure]) -> None:
    figure = load(HAND)
    scene = wb.Scene(figure)
    goal_q = figure.with_joints(figure.neutral, {"z_leader": 0.5, "own": -0.4})
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, goal_q)
    goals = [wb.Point(link, data.oMf[figure.frame_id(link)].translation.copy()) for link in ("c", "e")]
    problem = wb.Problem(scene, goals=goals)
    for method in ("qp", "dls", "newton"):
        solution = wb.solve(problem, method=method)
        assert solution.solved, (method, solution)
        assert solution.q[0] == pytest.approx(goal_q[0], abs=1e-3)
    assert scene.sweep(figure.neutral, goal_q) is None
    assert figure.reduced("own").joints == ("own",)
    assert figure.reduced("z_leader").joints == ("a_finger", "b_slider", "z_leader")
    bent = scene.state(figure.with_joints(figure.neutral, {"own": -0.4})).frame(figure.frame_id("e")).translation
    alone = wb.solve(wb.Problem(scene, goals=[wb.Point("e", bent)]), method="ccd")
    assert alone.solved
    assert alone.q[0] == figure.neutral[0]
    with pytest.raises(wb.WholebodyError, match=r"joints that others follow stay"):
        wb.solve(problem, method="ccd")
    if "placo" in installed_methods():
        with pytest.raises(wb.WholebodyError, match="mimics another with an offset"):
            wb.solve(problem, method="placo")


def test_a_follower_that_turns_more_than_once_is_solved_for(load: Callable[..., wb.Figure]) -> None:
    """Its placement tells its angle but for whole turns: newton took a second turn for a contradiction."""
    follower = joint("two", "c", "d", follow("one", 4.0, 0.5), "continuous")
    figure = load(text(joint("one", "a", "b"), joint("own", "b", "c"), follower, joint("last", "d", "e")))
    scene = wb.Scene(figure)
    for value in (1.0, 1.9):  # the follower turns by 4.5 and 8.1 rad
        near, there = (figure.with_joints(figure.neutral, {"one": value, "own": own}) for own in (0.2, 0.3))
        problem = wb.Problem(scene, near, goals=[wb.Frame("d", figure.placement(there, "d"))])
        solution = wb.solve(problem, method="newton")
        assert solution.solved, (value, solution)
        assert figure.placement(solution.q, "d").isApprox(figure.placement(there, "d"), 1e-4)


def test_placo_couples_followers_by_gears(load: Callable[..., wb.Figure]) -> None:
    pytest.importorskip("placo", reason="placo is not installed (the extra placo)")
    figure = load(HAND.replace('offset="0.1"', 'offset="0"'))
    goal_q = figure.with_joints(figure.neutral, {"z_leader": -0.5, "own": -0.4})
    state = wb.Scene(figure).state(goal_q)
    goals = [wb.Point(link, state.frame(figure.frame_id(link)).translation.copy()) for link in ("c", "e")]
    solution = wb.solve(wb.Problem(wb.Scene(figure), goals=goals), method="placo")
    assert solution.solved, solution
    assert figure.joint_values(solution.q)["z_leader"] == pytest.approx(-0.5, abs=1e-3)


def test_a_follower_of_what_does_not_move_is_fixed_where_it_is(load: Callable[..., wb.Figure]) -> None:
    still = '<joint name="lead" type="fixed"><parent link="a"/><child link="b"/></joint>'
    content = text(
        still,
        joint("j", "b", "c", follow("lead", 1.0, 0.5)),
        joint("k", "c", "d"),
        joint("l", "d", "e", follow("k", 0.0)),
    )
    figure = load(content)
    assert figure.joints == ("k",)
    data = figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, np.zeros(1))
    turned = data.oMf[figure.frame_id("c")].rotation
    assert turned == pytest.approx(pin.utils.rotate("z", 0.5))
    assert sum("does not move it" in note for note in figure.notes) == 2


def test_what_cannot_be_obeyed_is_told(load: Callable[..., wb.Figure]) -> None:
    chain = [joint("j", "a", "b"), joint("k", "b", "c", follow("nobody")), joint("l", "c", "d"), joint("m", "d", "e")]
    figure = load(text(*chain))
    assert any("joint 'k': it mimics 'nobody', which is not in the file" in note for note in figure.notes)
    back = joint("k", "b", "c", follow("j", -1.0)).replace('lower="-1"', 'lower="0"')
    figure = load(text(chain[0].replace('lower="-1"', 'lower="0"'), back, *chain[2:]))
    assert "joint 'k': its limits leave 'j' no room, so they are left out" in figure.notes
    place = figure.model.joints[figure.joint_id("j")].idx_q
    assert (figure.model.lowerPositionLimit[place], figure.model.upperPositionLimit[place]) == (0.0, 2.0)
    circle = [joint("j", "a", "b", follow("k")), joint("k", "b", "c", follow("j")), *chain[2:]]
    with pytest.raises(FileFormatError, match="mimics it in turn"):
        load(text(*circle))
    floating = '<joint name="j" type="floating"><parent link="a"/><child link="b"/></joint>'
    with pytest.raises(FileFormatError, match="'k' mimics 'j', which is floating"):
        load(text(floating, joint("k", "b", "c", follow("j")), *chain[2:]))


@pytest.mark.parametrize("content", [HAND, HAND.replace('axis xyz="0 0 1"', 'axis xyz="0 -0.6 0.8"')])
def test_a_pickled_scene_moves_as_before(load: Callable[..., wb.Figure], content: str) -> None:
    # Pinocchio's own archive of a model forgets how many columns a follower has, and cannot read infinite limits.
    scene = wb.Scene(load(content.replace('velocity="3"', 'velocity="inf"') if content is not HAND else content))
    model, other = scene.built.model, pickle.loads(pickle.dumps(scene)).built.model
    assert other.nvExtended == sum(joint.nvExtended for joint in list(other.joints)[1:])
    for q in np.random.default_rng(3).uniform(-1.0, 1.0, (4, model.nq)):
        data, there = pin.Data(model), pin.Data(other)
        before = pin.computeJointJacobians(model, data, q).copy()
        assert np.array_equal(pin.computeJointJacobians(other, there, q), before)
        for one, two in zip(data.oMi, there.oMi, strict=True):
            assert np.array_equal(one.homogeneous, two.homogeneous)
    assert np.array_equal(other.velocityLimit, model.velocityLimit)


def test_axes_of_joints_beside_followers_are_their_own(load: Callable[..., wb.Figure]) -> None:
    """Columns of Pinocchio's Jacobians have places for followers too, which degrees of freedom have not."""
    figure = load(
        text(
            joint("left_a", "a", "b", axis="0 0 1"),
            joint("left_b", "b", "c", follow("left_a"), axis="0 1 0"),
            joint("right_a", "a", "d", axis="0 0 1"),
            joint("right_b", "d", "e", follow("right_a"), axis="0 1 0"),
        )
    )
    assert wb.Clip(figure, [[0.3, 0.5]], 0.1).mirrored().q == pytest.approx(np.array([[-0.5, -0.3]]))
    arm = load(
        text(
            joint("a_finger", "a", "b", axis="1 0 0"),
            joint("b_finger", "b", "c", follow("a_finger"), axis="1 0 0"),
            joint("hand", "a", "d", axis="0 1 0"),
            joint("nail", "d", "e"),
        )
    )
    table = wb.figures.denavit_hartenberg(arm, "e")
    q = arm.with_joints(arm.neutral, {"hand": 0.4, "nail": -0.7})
    assert table.forward([0.4, -0.7]).homogeneous == pytest.approx(arm.placement(q, "e").homogeneous, abs=1e-12)
