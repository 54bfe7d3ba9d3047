"""Assemblies whose bodies have shapes: contacts within and with things, figures, surfaces and own constraints."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import InputError, UnknownNameError
from wholebody.methods.newton import quaternions as quat
from wholebody.methods.newton.assembly_joints import OnSurface

H = 1e-6


def _ball_box_wall() -> wb.Assembly:
    made = wb.Assembly()
    made.body("ball", (0, 0, 0.5), shape=wb.Sphere(0.1)).body("box", (0.5, 0, 0.5), shape=wb.Box((0.2, 0.2, 0.2)))
    made.add(wb.Box((0.02, 2, 2)), name="wall", at=(0.9, 0, 0.5))
    return made.prismatic("world", "box", axis=(1, 0, 0)).point_goal("ball", (0, 0, 0.5))


def test_a_body_stops_at_a_body_and_pushes_it_to_a_wall() -> None:
    made = _ball_box_wall()
    touching = made.retarget(0, (0.3, 0, 0.5)).solve()
    assert touching.status == "solved"
    assert touching.placements["box"].translation[0] == pytest.approx(0.5, abs=1e-6)
    pushed = made.retarget(0, (0.4, 0, 0.5)).solve()
    assert pushed.status == "solved"
    assert pushed.placements["box"].translation[0] == pytest.approx(0.6, abs=1e-4)
    stopped = made.retarget(0, (1.5, 0, 0.5)).solve()  # wall at 0.89, box 0.2 wide, ball of radius 0.1
    assert stopped.status == "unreachable"
    assert "'ball'" in stopped.message
    assert stopped.placements["ball"].translation[0] == pytest.approx(0.59, abs=1e-4)
    assert stopped.placements["box"].translation[0] == pytest.approx(0.79, abs=1e-4)
    assert max(touching.penetration, pushed.penetration, stopped.penetration) < 1e-5


@pytest.mark.parametrize(("algebra", "inequalities"), [("kkt", "slack"), ("schur", "slack"), ("normal", "barrier")])
def test_every_factorisation_and_both_inequalities_stop_there(algebra: str, inequalities: Any) -> None:
    made = _ball_box_wall().retarget(0, (1.5, 0, 0.5))
    stopped = made.solve(algebra=algebra, inequalities=inequalities)
    assert stopped.status == "unreachable"
    assert stopped.placements["ball"].translation[0] == pytest.approx(0.59, abs=1e-4)
    assert stopped.penetration < 1e-5


def test_the_distance_that_is_reported_is_coals() -> None:
    made = _ball_box_wall()
    answer = made.retarget(0, (0.1, 0.05, 0.4)).solve()
    ball, box = (answer.placements[name] for name in ("ball", "box"))
    found = coal.distance(
        coal.Sphere(0.1), coal.Transform3s(ball.rotation, ball.translation),
        coal.Box(0.2, 0.2, 0.2), coal.Transform3s(box.rotation, box.translation),
        coal.DistanceRequest(), coal.DistanceResult(),
    )  # fmt: skip
    assert answer.least_distance == pytest.approx(found, abs=1e-6)
    assert answer.penetration == 0.0


def test_a_clearance_is_kept() -> None:
    made = wb.Assembly(clearance=0.02)
    made.body("ball", (0, 0, 0.5), shape=wb.Sphere(0.1)).add(wb.HalfSpace(), name="floor")
    answer = made.point_goal("ball", (0, 0, -1.0)).solve()
    assert answer.status == "unreachable"
    assert answer.placements["ball"].translation == pytest.approx((0, 0, 0.12), abs=1e-4)


def test_a_body_that_begins_inside_leaves() -> None:
    made = wb.Assembly().body("ball", (0, 0, 0.02), shape=wb.Sphere(0.1)).add(wb.HalfSpace(), name="floor")
    answer = made.solve()
    assert answer.status == "solved"
    assert answer.penetration < 1e-5
    assert answer.placements["ball"].translation == pytest.approx((0, 0, 0.1), abs=1e-4)  # straight out: least motion


def test_nothing_is_jumped_over() -> None:
    made = wb.Assembly().body("ball", (-0.5, 0, 0), shape=wb.Sphere(0.01))
    made.add(wb.Box((0.001, 1.0, 1.0)), name="plate")
    answer = made.point_goal("ball", (0.5, 0, 0)).solve()
    assert answer.status == "unreachable"
    assert answer.placements["ball"].translation[0] == pytest.approx(-0.0105, abs=1e-4)
    for before, after in pairwise(answer.path):  # fine subdivision, by positions alone
        for share in np.linspace(0.0, 1.0, 50):
            assert (before + share * (after - before))[0] < 0.0


def test_pairs_enter_near_and_leave_farther() -> None:
    made = wb.Assembly().body("ball", (0, 0, 0.5), shape=wb.Sphere(0.1)).add(wb.HalfSpace(), name="floor")
    made.point_goal("ball", (0, 0, 0.5))

    def active(height: float) -> bool:
        made.retarget(0, (0, 0, height)).solve()
        assert made._prepared is not None
        assert made._prepared.contacts is not None
        return len(made._prepared.contacts.pairs) > 0

    assert [active(0.1 + gap) for gap in (0.20, 0.045, 0.02, 0.045, 0.07)] == [False, False, True, True, False]


def test_a_goal_that_moves_is_not_analysed_anew_in_contact() -> None:
    made = wb.Assembly().body("ball", (0, 0, 0.11), shape=wb.Sphere(0.1)).add(wb.HalfSpace(), name="floor")
    drag = wb.tracking.Drag(made.point_goal("ball", (0, 0, 0.11)))
    drag.to((0, 0, 0.11))
    structures = made.structures
    for k in range(20):
        frame = drag.to((0.02 * k, 0.0, 0.05))  # slides on the floor, below which the goal is
        assert frame.q[2] == pytest.approx(0.1, abs=1e-4)
    assert made.structures == structures
    made.move("floor", at=(0, 0, -0.01))
    drag.to((0.4, 0.0, 0.05))
    assert made.structures == structures
    assert drag.q[2] == pytest.approx(0.09, abs=1e-3)


def test_joined_fixed_and_ignored_pairs_are_not_tested() -> None:
    made = wb.Assembly()
    for k in range(4):
        made.body(f"b{k}", (0.1 * k, 0, 0), shape=wb.Box((0.2, 0.1, 0.1)))
    made.add(wb.HalfSpace(), name="floor")
    made.revolute("b0", "b1", at=(0.05, 0, 0), axis=(0, 0, 1)).fixed("b1", "b2").fixed("b2", "b3")
    scene = made.scene
    pairs = {tuple(sorted(scene.piece_owner[k] for k in pair)) for pair in scene.pair_table.pairs}
    assert pairs == {("b0", "b2"), ("b0", "b3"), *((f"b{k}", "floor") for k in range(4))}
    made.ignore("b0", "b2").ignore("b3", "floor").fixed("world", "b0")
    scene = made.scene
    pairs = {tuple(sorted(scene.piece_owner[k] for k in pair)) for pair in scene.pair_table.pairs}
    assert pairs == {("b0", "b3"), ("b1", "floor"), ("b2", "floor")}


@pytest.mark.parametrize("shape", [wb.Sphere(0.3), wb.Box((0.3, 0.4, 0.5))])
def test_a_point_stays_on_a_surface(shape: wb.Shape) -> None:
    rng = np.random.default_rng(0)
    made = wb.Assembly().body("rock", (*rng.normal(size=3), *pin.Quaternion(pin.SE3.Random().rotation).coeffs()))
    made = wb.Assembly().body("rock", (0.2, 0.1, 0.3, 0, 0, np.sin(0.4), np.cos(0.4)), shape=shape)
    made.body("probe", (1.0, 0.2, 0.4)).on_surface("probe", (0.05, 0, 0), of="rock").fixed("world", "rock")
    made.point_goal("probe", (0.2, 1.1, 0.4))
    answer = made.solve()
    point = answer.placements["probe"].act(np.array((0.05, 0.0, 0.0)))
    rock = made.scene.geometry.geometryObjects[0]
    place = answer.placements["rock"] * rock.placement
    tiny = 1e-6
    distance = coal.distance(
        rock.geometry, coal.Transform3s(place.rotation, place.translation),
        coal.Sphere(tiny), coal.Transform3s(np.eye(3), point), coal.DistanceRequest(), coal.DistanceResult(),
    )  # fmt: skip
    assert answer.joint_error < 1e-5
    assert abs(distance + tiny) < 2e-5


def test_surfaces_have_the_derivatives_of_differences() -> None:
    rng = np.random.default_rng(1)
    for half, radius in (((0, 0, 0), 0.3), ((0, 0, 0.4), 0.2), ((0.2, 0.3, 0.4), 0.0)):
        for _ in range(6):
            x = rng.normal(size=(3, 7))
            x[:, 3:] /= np.linalg.norm(x[:, 3:], axis=1)[:, None]
            x[1, :3] = x[0, :3] + 0.3 * rng.normal(size=3)  # inside of the box now and then
            turn = pin.Quaternion(quat.axes_with_z(np.array([[0.6, 0.0, 0.8]]))[0]).toRotationMatrix()
            batch = OnSurface(
                np.array([[0, 1]]), [""], turn[None], rng.normal(size=(1, 3)) * 0.05, np.array([half], dtype=float),
                np.array([radius]), rng.normal(size=(1, 3)) * 0.1,
            )  # fmt: skip
            slope = batch.jacobian(x)[0, 0]
            for column in range(14):
                plus, minus = x.copy(), x.copy()
                plus[column // 7, column % 7] += H
                minus[column // 7, column % 7] -= H
                difference = (batch.residual(plus) - batch.residual(minus))[0, 0] / (2 * H)
                assert slope[column] == pytest.approx(difference, abs=1e-6)


class Rope(wb.methods.AssemblyConstraint):
    """The origins of two bodies are at most a length apart, in squares."""

    one_sided = True

    def __init__(self, first: str, second: str, length: float, slope: float = 1.0) -> None:
        self.bodies, self.length, self.slope = (first, second), length, slope

    def residual(self, x: np.ndarray) -> np.ndarray:
        way = x[1, :3] - x[0, :3]
        return np.array([self.length**2 - way @ way])

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        result = np.zeros((1, 2, 7))
        way = x[1, :3] - x[0, :3]
        result[0, 0, :3], result[0, 1, :3] = 2.0 * self.slope * way, -2.0 * way
        return result


def test_a_constraint_of_ones_own_holds() -> None:
    made = wb.Assembly().body("post").body("dog", (0.3, 0, 0)).fixed("world", "post")
    made.constrain(Rope("post", "dog", 0.5)).point_goal("dog", (0.0, 2.0, 0.0))
    answer = made.solve()
    assert answer.status == "unreachable"
    assert answer.placements["dog"].translation == pytest.approx((0, 0.5, 0), abs=2e-3)
    assert np.linalg.norm(answer.placements["dog"].translation) < 0.5 + 1e-5
    made.retarget(0, (0.1, 0.2, 0.0))
    assert made.solve().status == "solved"


def test_a_wrong_derivative_is_named() -> None:
    made = wb.Assembly().body("post").body("dog", (0.3, 0, 0))
    with pytest.raises(InputError, match=r"constraint Rope: jacobian\[0, 0, 0\] is 0.9.*differences.*0.6"):
        made.constrain(Rope("post", "dog", 0.5, slope=1.5))
    with pytest.raises(UnknownNameError, match="no body is called 'cat'"):
        made.constrain(Rope("post", "cat", 0.5))
    with pytest.raises(InputError, match="name at least one body, and each once"):
        made.constrain(Rope("dog", "dog", 0.5))
    with pytest.raises(InputError, match=r"wb\.methods\.AssemblyConstraint"):
        made.constrain("rope")  # type: ignore[arg-type]


@pytest.mark.parametrize(("arm", "room"), [(0.005, 0.004)])
def test_goals_out_of_reach_end_where_the_constraint_is_and_not_before(arm: float, room: float) -> None:
    """A long lever: the goal pulls the constraint open, and what restores it must not end far from the goal."""
    made = wb.Assembly().body("arm", (0, 0, 0), size=1.0).revolute("world", "arm", at=(0, 0, 0), axis=(0, -1, 0))
    made.on_plane("arm", (arm, 0, 0), normal=(0, 0, 1), through=(0, 0, -room), side="above")
    answer = made.point_goal("arm", (0.5, 0, -3.0), place=(1, 0, 0)).solve()
    tip = answer.placements["arm"].act(np.array((1.0, 0.0, 0.0)))
    # the tolerance of 1e-5 m at the short arm is some mrad
    assert np.arctan2(-tip[2], tip[0]) == pytest.approx(np.arcsin(room / arm), abs=4e-3)


def test_a_figure_in_an_assembly_keeps_its_feet_and_limits_and_touches_nothing_deeply() -> None:
    figure = wb.load("human")
    made = wb.Assembly().figure("ann", figure, constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")])
    before = {name: made.placement(f"ann/{name}") for name in ("left_foot", "right_foot")}
    palm = made.placement("ann/right_palm").translation
    made.add(wb.Box((0.5, 0.5, 0.02)), name="board", at=palm + (0.3, 0, 0.12))
    made.point_goal("ann/right_palm", palm + (0.25, 0.0, 0.05))
    answer = made.solve()
    assert answer.status == "solved"
    assert answer.penetration < 1e-5
    for name, place in before.items():
        assert made.placement(f"ann/{name}").isApprox(place, 1e-4)
    q = made.posture("ann")
    assert q == pytest.approx(figure.clamp(q), abs=1e-9)
    data = figure.model.createData()  # the bodies are where forward kinematics has them
    pin.framesForwardKinematics(figure.model, data, q)
    there = data.oMf[figure.model.getFrameId("right_palm")]
    assert made.placement("ann/right_palm").isApprox(there, 1e-7)
    assert there.translation == pytest.approx(palm + (0.25, 0.0, 0.05), abs=1e-4)


def test_two_figures_and_a_thing_make_a_scene_of_moderate_size() -> None:
    made = wb.Assembly().figure("ann", wb.load("human"))
    far = np.array(wb.load("human").posture("standing"))
    far[0] += 2.0
    made.figure("ben", wb.load("human"), far).body("box", (1.0, 0, 1.0), shape=wb.Box((0.2, 0.2, 0.2)))
    model = made.scene.model
    assert model.nv == 2 * wb.load("human").model.nv + 6  # data of a model grow with the cube of this
    assert made.q.shape == (model.nq,)
    data = model.createData()
    pin.forwardKinematics(model, data, made.q)
    for number, name in enumerate(made.bodies):
        assert data.oMi[number + 1].isApprox(made.placement(name), 1e-9)


def test_bad_shapes_and_things_are_named() -> None:
    made = wb.Assembly().body("a", shape=wb.Box((0.1, 0.1, 0.1))).body("b", (1, 0, 0))
    with pytest.raises(InputError, match="body 'c': a body cannot be a half-space"):
        made.body("c", shape=wb.HalfSpace())
    with pytest.raises(InputError, match="body 'c': shape is"):
        made.body("c", shape=["box"])  # type: ignore[list-item]
    with pytest.raises(InputError, match="the name is taken"):
        made.add(wb.Sphere(0.1), name="a")
    with pytest.raises(InputError, match="clearance"):
        wb.Assembly(clearance=-0.1)
    with pytest.raises(UnknownNameError, match="wall"):
        made.move("wall", at=(0, 0, 0))
    with pytest.raises(UnknownNameError, match="'b'"):
        made.on_surface("a", (0, 0, 0), of="b")
    with pytest.raises(InputError, match="no goals"):
        made.retarget(0, (0, 0, 0))
    with pytest.raises(InputError, match="no goals"):
        wb.tracking.Drag(made)
    with pytest.raises(InputError, match="of its own body"):
        made.on_surface("a", (0, 0, 0), of="a")
    assert made.body("c", (2, 0, 0)).bodies == ("a", "b", "c")


def test_things_of_a_scene_come_along() -> None:
    scene = wb.Scene(wb.load("hand"))
    scene.add(wb.HalfSpace(), name="floor").add(wb.Sphere(0.1), name="ball", at=(1, 0, 0.1))
    made = wb.Assembly().body("a", (0, 0, 1), shape=wb.Sphere(0.1)).add_things(scene)
    assert set(made.scene.objects) == {"floor", "ball"}
    assert len(made.scene.pair_table.pairs) == 2
