"""Assemblies whose answers are known: linkages, rings, stars, redundant and impossible loops."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.methods.newton.test_linear_algebra import jacobian_of
from wholebody.base.arrays import Array
from wholebody.methods.newton.assembly import Assembly
from wholebody.methods.newton.linear_algebra import Gram
from wholebody.tracking.drag import Drag

Y = (0.0, 1.0, 0.0)


def _four_bar(coupler: float = 0.9, rocker: float = 0.7) -> Assembly:
    """Ground 1, crank 0.3; all in the plane y = 0, crank upright at the start. Not closed yet."""
    made = Assembly()
    made.body("crank", (0, 0, 0)).body("coupler", (0, 0, 0.3)).body("rocker", (1, 0, 0))
    made.revolute("world", "crank", at=(0, 0, 0), axis=Y)
    made.revolute("crank", "coupler", at=(0, 0, 0.3), axis=Y)
    made.revolute("coupler", "rocker", at_first=(coupler, 0, 0), at_second=(0, 0, rocker), axis=Y, axis_second=Y)
    made.revolute("world", "rocker", at=(1, 0, 0), axis=Y)
    return made


def _chain(count: int, limits: tuple[float, float] | None = None) -> Assembly:
    made = Assembly()
    for k in range(count):
        made.body(f"link{k}", (0.2 * k, 0, 0), size=0.1)
    for k in range(count):
        base = f"link{k - 1}" if k else "world"
        made.revolute(base, f"link{k}", at=(0.2 * k, 0, 0), axis=((0, 1, 0), (0, 0, 1))[k % 2], limits=limits)
    return made


@pytest.mark.parametrize("algebra", ["auto", "kkt"])
def test_a_four_bar_closes_where_geometry_says(algebra: str) -> None:
    # four revolute joints in a plane are three equations too many in space: redundant, and tolerated
    made = _four_bar()
    made.frame_goal("crank", (0, 0, 0))
    answer = made.solve(algebra=algebra, tolerance=1e-10)
    assert answer.status == "solved"
    pin_joint = answer.placements["coupler"].act(np.array((0.9, 0.0, 0.0)))
    # circles of 0.9 about (0, 0.3) and of 0.7 about (1, 0)
    assert np.hypot(pin_joint[0], pin_joint[2] - 0.3) == pytest.approx(0.9, abs=1e-9)
    assert np.hypot(pin_joint[0] - 1.0, pin_joint[2]) == pytest.approx(0.7, abs=1e-9)
    base = np.hypot(1.0, 0.3)
    along = (base**2 + 0.9**2 - 0.7**2) / (2.0 * base)
    across = np.sqrt(0.9**2 - along**2)
    direction = np.array((1.0, -0.3)) / base
    wanted = np.array((0.0, 0.3)) + along * direction + across * np.array((-direction[1], direction[0]))
    assert pin_joint[[0, 2]] == pytest.approx(wanted, abs=1e-8)
    assert abs(pin_joint[1]) < 1e-9


def test_convergence_is_quadratic() -> None:
    residuals = np.array(_four_bar().solve(tolerance=1e-12).residuals)
    near = residuals[(residuals < 0.1) & (residuals > 1e-9)]
    assert len(near) >= 3
    assert (near[1:] <= 3.0 * near[:-1] ** 2 + 1e-10).all()


def test_a_loop_that_cannot_close_is_infeasible_with_the_least_residual() -> None:
    answer = _four_bar(coupler=0.2, rocker=0.2).solve()  # 0.3 + 0.2 + 0.2 < 1
    assert answer.status == "infeasible"
    assert 0.01 < answer.joint_error < 0.3
    assert "joint of" in answer.message
    placed = np.array([place.homogeneous for place in answer.placements.values()])
    assert np.isfinite(placed).all()


def test_a_ring_is_a_regular_polygon_when_opened() -> None:
    count, made = 6, Assembly()
    rng = np.random.default_rng(0)
    for k in range(count):
        angle = 2.0 * np.pi * k / count
        turn = pin.SE3(pin.utils.rotate("z", angle + np.pi / 2), np.array((np.cos(angle), np.sin(angle), 0.0)))
        made.body(f"b{k}", turn * pin.SE3(pin.exp6(0.1 * rng.normal(size=6))), size=0.5)
    for k in range(count):
        made.spherical(f"b{k}", f"b{(k + 1) % count}", at_first=(1.0, 0, 0), at_second=(0, 0, 0))
    answer = made.solve(tolerance=1e-10)
    assert answer.status == "solved"
    corners = [answer.placements[f"b{k}"].translation for k in range(count)]
    sides = [np.linalg.norm(corners[k] - corners[k - 1]) for k in range(count)]
    assert sides == pytest.approx([1.0] * count, abs=1e-9)


def test_a_star_with_a_hundred_arms_is_solved_by_splitting_its_hub_off() -> None:
    made = Assembly().body("hub", size=0.2)
    for k in range(100):
        angle = 2.0 * np.pi * k / 100
        place = np.array((0.2 * np.cos(angle), 0.2 * np.sin(angle), 0.0))
        made.body(f"arm{k}", place, size=0.2)
        made.revolute("hub", f"arm{k}", at=place, axis=(0, 0, 1))
    made.frame_goal("hub", (0.1, 0.2, 0.3, 0.0, 0.0, np.sin(0.2), np.cos(0.2)))
    answer = made.solve(tolerance=1e-9)
    assert (answer.status, answer.algebra) == ("solved", "normal/schur")
    hub = answer.placements["hub"]
    for k in (0, 33, 99):
        angle = 2.0 * np.pi * k / 100
        there = hub.act(np.array((0.2 * np.cos(angle), 0.2 * np.sin(angle), 0.0)))
        assert answer.placements[f"arm{k}"].translation == pytest.approx(there, abs=1e-8)


def test_conflicting_goals_end_in_their_least_squares() -> None:
    made = Assembly().body("ball")
    for place in ((1.0, 0, 0), (0, 1.0, 0), (0, 0, 2.0)):
        made.point_goal("ball", place)
    answer = made.solve()
    assert answer.status == "unreachable"
    assert answer.placements["ball"].translation == pytest.approx([1 / 3, 1 / 3, 2 / 3], abs=1e-3)


def test_a_goal_out_of_reach_is_approached_with_joints_held() -> None:
    made = _chain(5)
    made.point_goal("link4", (0.0, 0.5, 2.0), place=(0.2, 0, 0))
    answer = made.solve()
    assert answer.status == "unreachable"
    assert answer.joint_error < 1e-5
    tip = answer.placements["link4"].act(np.array((0.2, 0.0, 0.0)))
    assert np.linalg.norm(tip) <= 1.0 + 1e-4


@pytest.mark.parametrize("goal", [(1.0, 0.3, 0.5), (1.6, 0.4, 0.3)])
def test_a_slack_and_a_barrier_find_the_same_nearest_point(goal: tuple[float, float, float]) -> None:
    left = []
    for kind in ("slack", "barrier"):
        made = _chain(10, limits=(-0.4, 0.4))
        made.point_goal("link9", goal, place=(0.2, 0, 0))
        answer = made.solve(inequalities=kind)
        assert answer.joint_error < 1e-5
        left.append(answer.goal_error)
        turns = [answer.placements[f"link{k}"] for k in range(10)]
        for base, link in zip([pin.SE3.Identity(), *turns], turns, strict=False):
            assert np.linalg.norm(pin.log3((base.actInv(link)).rotation)) < 0.4 + 1e-4
    assert left[0] == pytest.approx(left[1], abs=3e-3)


def test_a_joint_that_begins_at_its_limit_leaves_it() -> None:
    # the squared slack of the limit is exactly zero at the start
    made = Assembly().body("arm", size=0.5)
    made.revolute("world", "arm", at=(0, 0, 0), axis=(0, 0, 1), limits=(0.0, 1.0))
    made.point_goal("arm", (np.cos(0.6), np.sin(0.6), 0), place=(1, 0, 0))
    answer = made.solve(tolerance=1e-9)
    assert answer.status == "solved"
    assert pin.log3(answer.placements["arm"].rotation)[2] == pytest.approx(0.6, abs=1e-8)


def test_points_slide_on_planes_and_along_axes() -> None:
    made = Assembly().body("table", (0, 0, 0.5)).body("cup", (0.1, 0, 0.7)).body("drawer", (0, 0, 0.3))
    made.fixed("world", "table")
    made.on_plane("cup", (0, 0, -0.1), normal=(0, 0, 1), through=(0, 0, 0), of="table")
    made.prismatic("table", "drawer", axis=(1, 0, 0))
    made.point_goal("cup", (0.4, 0.2, 0.9)).point_goal("drawer", (0.5, 0.3, 0.0))
    answer = made.solve()
    assert answer.status == "unreachable"
    assert answer.placements["cup"].act(np.array((0, 0, -0.1)))[2] == pytest.approx(0.5, abs=1e-5)
    assert answer.placements["drawer"].translation == pytest.approx([0.5, 0.0, 0.3], abs=2e-3)
    assert answer.placements["drawer"].rotation == pytest.approx(np.eye(3), abs=1e-4)


def test_the_nearest_place_is_found() -> None:
    # a point on a rod about the origin goes to the plane z = 0.6: of the circle there, the nearest one
    made = Assembly().body("bob", (1.0, 0.2, 0.0), size=1e-3)
    made.spherical("world", "bob", at=(0, 0, 0))
    made.on_plane("bob", (0, 0, 0), normal=(0, 0, 1), through=(0, 0, 0.6))
    before = np.array((1.0, 0.2, 0.0))
    answer = made.solve(tolerance=1e-9, nearest=True)
    radius = np.sqrt(before @ before - 0.36)
    wanted = np.array((*(radius * before[:2] / np.linalg.norm(before)), 0.6))
    assert answer.status == "solved"
    assert answer.placements["bob"].translation == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_the_nearest_place_of_a_chain_is_found_from_far(seed: int) -> None:
    rng = np.random.default_rng(seed)
    made = _chain(10)
    goal = rng.normal(size=3)
    made.point_goal("link9", goal * rng.uniform(0.4, 1.7) / np.linalg.norm(goal), place=(0.2, 0, 0))
    start, system = made.variables(), made.system()
    answer = made.solve(tolerance=1e-7, nearest=True)
    assert answer.status == "solved"
    assert "not reached" not in answer.message
    # no way along the equations is left: the gradient is a combination of their gradients
    x = made.variables()
    gradient = system.weight * (x - start)
    jacobian = jacobian_of(system.pattern, system.values(x))
    left = gradient - jacobian.T @ np.linalg.lstsq(jacobian.T, gradient, rcond=1e-9)[0]
    assert np.abs(left).max() < 1e-5


def test_a_nearest_place_that_is_not_reached_is_said() -> None:
    made = _chain(10).point_goal("link9", (0.5, 0.6, 0.4), place=(0.2, 0, 0))
    answer = made.solve(tolerance=1e-7, nearest=True, iterations=12)
    assert answer.status == "solved"
    assert "nearest placements were not reached" in answer.message


def test_the_nearest_ring_is_nearer_than_what_least_steps_find() -> None:
    count = 12

    def ring() -> Assembly:
        made, radius = Assembly(), count / (2.0 * np.pi)
        corners = [radius * np.array((np.cos(a), np.sin(a), 0.0)) for a in 2.0 * np.pi * np.arange(count) / count]
        for k, corner in enumerate(corners):
            made.body(f"b{k}", corner, size=0.5)
        for k, corner in enumerate(corners):
            made.spherical(f"b{k - 1}" if k else f"b{count - 1}", f"b{k}", at=corner)
        return made.point_goal("b0", corners[0] + (-0.3, 0.2, 0.5))

    def way(made: Assembly, start: np.ndarray) -> float:
        step = made.variables() - start
        return float((made.system().weight * step) @ step)

    stepped, nearest = ring(), ring()
    start = stepped.variables()
    stepped.solve(tolerance=1e-9)
    assert nearest.solve(tolerance=1e-9, nearest=True).status == "solved"
    assert way(nearest, start) < way(stepped, start) - 1e-6


def test_the_nearest_place_keeps_to_limits_and_shapes() -> None:
    made = Assembly().body("bob", (1.0, 0.2, 0.0), size=1e-3, shape=wb.Sphere(0.05))
    made.spherical("world", "bob", at=(0, 0, 0))
    made.on_plane("bob", (0, 0, 0), normal=(0, 0, 1), through=(0, 0, 0.6), side="above")
    made.add(wb.Box((3.0, 1.0, 3.0)), name="wall", at=(0.0, -0.25, 0.0))  # its face is at y = 0.25
    answer = made.solve(tolerance=1e-9, nearest=True)
    x, y, z = answer.placements["bob"].translation
    assert (y, z) == pytest.approx((0.3, 0.6), abs=1e-6)
    assert x == pytest.approx(np.sqrt(1.04 - 0.09 - 0.36), abs=1e-6)


def _bar(x: float, z: float, angle: float) -> pin.SE3:
    """Placement of a bar that begins at (x, z) and rises from x by an angle; turns about y lower z."""
    return pin.SE3(pin.rpy.rpyToMatrix(0.0, -angle, 0.0), np.array((x, 0.0, z)))


def _scissor_lift(stages: int, angle: float, length: float) -> Assembly:
    """Crossed bars on crossed bars; one foot is pinned, one rolls on the ground, the platform lies on the last two."""
    wide, high, made = length * np.cos(angle), length * np.sin(angle), Assembly()
    for k in range(stages):
        made.body(f"up{k}", _bar(0.0, k * high, angle), size=length)
        made.body(f"down{k}", _bar(wide, k * high, np.pi - angle), size=length)
        made.revolute(f"up{k}", f"down{k}", at=(wide / 2.0, 0.0, (k + 0.5) * high), axis=Y)
        if k:
            made.revolute(f"down{k - 1}", f"up{k}", at=(0.0, 0.0, k * high), axis=Y)
            made.revolute(f"up{k - 1}", f"down{k}", at=(wide, 0.0, k * high), axis=Y)
    top = stages * high
    made.body("platform", (0.0, 0.0, top), size=length).revolute("world", "up0", at=(0.0, 0.0, 0.0), axis=Y)
    made.on_plane("down0", (0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), through=(0.0, 0.0, 0.0))
    made.revolute(f"down{stages - 1}", "platform", at=(0.0, 0.0, top), axis=Y)
    here = {"normal": (0.0, 0.0, 1.0), "through": (0.0, 0.0, 0.0)}
    return made.on_plane(f"up{stages - 1}", (length, 0.0, 0.0), of="platform", **here)


def test_a_scissor_lift_rises_level_with_all_its_bars_alike() -> None:
    """One degree of freedom and many redundant loops: the height says how steep every bar is."""
    stages = 12
    length = 0.5
    made = _scissor_lift(stages, 0.3, length)
    for angle in (0.5, 1.1, 0.2):
        height = stages * length * np.sin(angle)
        answer = made.drop_goals().point_goal("platform", (0.0, 0.0, height)).solve(tolerance=1e-9)
        assert answer.status == "solved", answer.message
        assert pin.log3(answer.placements["platform"].rotation) == pytest.approx(np.zeros(3), abs=1e-8)
        for k in range(stages):
            ends = (answer.placements[f"up{k}"].act(np.array((x, 0.0, 0.0))) for x in (0.0, length))
            low, high = (k * length * np.sin(angle), (k + 1) * length * np.sin(angle))
            for end, wanted in zip(ends, ((0.0, 0.0, low), (length * np.cos(angle), 0.0, high)), strict=True):
                assert end == pytest.approx(np.array(wanted), abs=1e-7)
    beyond = made.drop_goals().point_goal("platform", (0.0, 0.0, stages * length + 0.1)).solve()
    assert beyond.status == "unreachable"
    assert beyond.placements["platform"].translation[2] == pytest.approx(stages * length, abs=2e-3)


def _dragged_chain() -> tuple[Assembly, Array]:
    """A chain of eight bodies, and the place of its last one."""
    made, places = Assembly(), np.array([(0.3 * k, 0.1 * (k % 2), 0.05 * (k % 3)) for k in range(8)])
    for k, place in enumerate(places):
        made.body(f"b{k}", place)
        made.spherical("world" if k == 0 else f"b{k - 1}", f"b{k}", at=place - (0.15, 0.0, 0.0))
    return made, places[-1]


@pytest.mark.parametrize("nearest", [False, True])
def test_a_drag_analyses_its_pattern_once(nearest: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Moves of a goal alone lay out and analyse nothing, and end where an assembly that is stated anew ends."""
    made, end = _dragged_chain()
    laid: list[str] = []

    whole = Gram.__init__

    def init(self: Gram, *arguments: Any) -> None:
        laid.append("Gram")
        whole(self, *arguments)

    monkeypatch.setattr(Gram, "__init__", init)
    for k in range(12):
        target = end - np.array((0.3, 0.0, 0.0)) + 0.1 * np.array((np.cos(k), np.sin(k), np.sin(0.5 * k)))
        anew = _dragged_chain()[0].place(made.variables())
        answer = made.drop_goals().point_goal("b7", target).solve(tolerance=1e-9, nearest=nearest)
        before = len(laid)
        expected = anew.point_goal("b7", target).solve(tolerance=1e-9, nearest=nearest)
        assert laid[:before] == ["Gram"]
        del laid[before:]
        assert answer.status == expected.status == "solved"
        for name, placement in answer.placements.items():
            assert np.abs(placement.homogeneous - expected.placements[name].homogeneous).max() < 1e-9
    assert made.structures == 1


def test_what_changes_the_pattern_is_laid_out_anew() -> None:
    made, end = _dragged_chain()
    target = end - np.array((0.2, 0.1, 0.0))
    steps = [
        lambda: made.point_goal("b7", target),
        lambda: made.drop_goals().point_goal("b5", target - np.array((0.6, 0.0, 0.0))),
        lambda: made.drop_goals().frame_goal("b7", (*target, 0.0, 0.0, 0.0, 1.0)),
        lambda: made.drop_goals(),
        lambda: made.on_plane("b3", (0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), through=(0.0, 0.0, 0.0)),
        lambda: made.body("loose", (0.0, 3.0, 0.0)),
    ]
    for number, step in enumerate(steps, start=1):
        step()
        assert made.solve().status == "solved"
        assert made.solve().iterations == 0
        assert made.structures == number
    assert made.point_goal("loose", (0.0, 2.0, 0.0)).solve().placements["loose"].translation[1] == pytest.approx(2.0)


def test_a_residual_is_that_of_the_numbers_now() -> None:
    """The same variables are asked before and after a goal moved."""
    made, end = _dragged_chain()
    system, x = made.point_goal("b7", end).system(), made.variables()
    assert np.abs(system.residual(x)).max() < 1e-12
    moved = made.drop_goals().point_goal("b7", end + np.array((0.0, 0.0, 0.4))).system()
    system.renew(moved.batches)
    assert np.abs(system.residual(x)).max() == pytest.approx(0.4)
    with pytest.raises(ValueError, match="read-only"):
        system.residual(x)[:] = 0.0


@pytest.mark.parametrize("joint", ["revolute", "spherical"])
@pytest.mark.parametrize("share", [0.3, -0.7])
def test_a_straight_chain_folds_to_a_goal_on_its_own_line(joint: str, share: float) -> None:
    """No motion lowers the error to first order there, and the chain can fold."""
    made = _straight(5, joint)
    made.point_goal("link4", (share, 0, 0), place=(0.2, 0, 0))
    answer = made.solve()
    assert answer.status == "solved", answer.message
    tip = answer.placements["link4"].act(np.array((0.2, 0, 0)))
    assert tip == pytest.approx(np.array((share, 0, 0)), abs=2e-5)


def test_a_straight_chain_with_limits_folds_within_them() -> None:
    made = _straight(4, "planar", limits=(-1.5, 1.5))
    made.point_goal("link3", (0.4, 0, 0), place=(0.2, 0, 0))
    assert made.solve().status == "solved"


def test_a_straight_loop_opens_and_closes() -> None:
    """Three bars of 0.2 m on a line close a loop over 0.3 m: first-order steps alone call that infeasible."""
    made = _straight(3, "spherical")
    made.spherical("link2", "world", at_first=(0.2, 0, 0), at_second=(0.3, 0, 0))
    assert made.solve().status == "solved"


def test_a_goal_beyond_a_straight_chain_stays_unreachable() -> None:
    made = _straight(5, "spherical")
    made.point_goal("link4", (1.3, 0, 0), place=(0.2, 0, 0))
    answer = made.solve()
    assert answer.status == "unreachable"
    assert answer.goal_error == pytest.approx(0.3, abs=1e-3)
    assert made.q == pytest.approx(answer.path[-1])


def test_a_drag_folds_a_straight_chain() -> None:
    made = _straight(5, "revolute")
    made.point_goal("link4", (1, 0, 0), place=(0.2, 0, 0))
    drag = Drag(made)
    assert max(drag.to((x, 0, 0)).error for x in np.linspace(1.0, 0.6, 15)) < 1e-3


def test_a_drag_whose_time_is_spent_looks_no_further_for_a_way_out() -> None:
    made = _straight(5, "spherical").point_goal("link4", (0, 0, 9.0), place=(0.2, 0, 0))
    drag = Drag(made, budget=1e-9)
    # a step towards the goal out of reach, and one that closes the joints
    assert max(drag.to((0, 0, 9.0)).iterations for _ in range(4)) <= 2


def _straight(count: int, joint: str, limits: tuple[float, float] | None = None) -> Assembly:
    if joint == "revolute":
        return _chain(count, limits)
    made = Assembly()
    for k in range(count):
        base, place = f"link{k - 1}" if k else "world", (0.2 * k, 0, 0)
        made.body(f"link{k}", place, size=0.1)
        if joint == "spherical":
            made.spherical(base, f"link{k}", at=place)
        else:
            made.revolute(base, f"link{k}", at=place, axis=Y, limits=limits)
    return made


def test_errors_are_distances_and_angles() -> None:
    """Of a goal, a spherical joint, a prismatic joint and a frame: norms of vectors and angles of rotations."""
    goal = Assembly().body("a").fixed("world", "a").point_goal("a", (1, 1, 1))
    found = goal.solve()
    assert found.goal_error == pytest.approx(np.sqrt(3.0), abs=1e-5)
    assert f"{found.goal_error:.3g} m" in found.message
    assert goal.goal_error(0) == pytest.approx(found.goal_error, abs=1e-9)
    assert goal.step().goal_error == pytest.approx(np.sqrt(3.0), abs=1e-5)

    joint = Assembly().body("a").body("b").fixed("world", "a").fixed("world", "b")
    joint.spherical("a", "b", at_first=(0.3, 0.3, 0.3), at_second=(0, 0, 0))
    open_by = joint.solve()
    assert open_by.status == "infeasible"
    a, b = open_by.placements["a"], open_by.placements["b"]
    gaps = [
        np.linalg.norm(a.act(np.full(3, 0.3)) - b.translation),
        *map(np.linalg.norm, (a.translation, b.translation)),
    ]
    assert open_by.joint_error == pytest.approx(max(gaps), abs=1e-6)

    slide = Assembly().body("a").prismatic("world", "a", axis=(0, 0, 1))
    moved = slide.variables()
    moved[:3] = 3.0, 4.0, 2.0
    assert slide.system().largest_errors(slide.system().residual(moved))[0] == pytest.approx(5.0)

    turned = (
        Assembly()
        .body("a")
        .fixed("world", "a")
        .frame_goal("a", pin.SE3(pin.exp3(np.array((1.0, 1.0, 1.0))), np.zeros(3)))
    )
    said = turned.solve()
    assert said.goal_error == pytest.approx(np.sqrt(3.0), abs=1e-5)
    assert turned.goal_error(0) == pytest.approx(said.goal_error, abs=1e-9)


def test_a_goal_far_out_of_reach_of_a_chain_stretches_it_and_does_not_pull_it_open() -> None:
    links = 6
    along = np.array((1.0, 2.0, -1.0)) / np.sqrt(6.0)
    made, last = Assembly(), "world"
    for k in range(links):
        made.body(f"link{k}", 0.3 * (k + 0.5) * along).spherical(last, f"link{k}", at=0.3 * k * along)
        last = f"link{k}"
    made.body("end", 0.3 * links * along).fixed(last, "end").point_goal("end", 0.15 * links * along)
    assert made.solve().status == "solved"  # folded
    for far in (6.0, 19.0):
        answer = made.retarget(0, far * along).solve()
        assert answer.status == "unreachable", answer.message
        assert answer.goal_error == pytest.approx(far - 0.3 * links, abs=0.02)
        assert answer.joint_error < 1e-5


def test_a_figure_behind_other_bodies_keeps_its_balance_and_its_ranges() -> None:
    human = wb.load("human")
    scene = wb.Scene(human).add(wb.HalfSpace(), name="floor")
    start = human.grounded(human.posture("standing"), scene)
    kept = [wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Balance(), wb.tasks.ReachCones(), wb.tasks.RangeOfMotion()]
    made = Assembly().body("ball", (3.0, 0.0, 1.0)).body("post", (4.0, 0.0, 1.0))
    made.figure("anna", human, start, constraints=kept).point_goal("anna/right_palm", (0.6, -0.3, 0.6))
    assert made.solve().status == "solved"
    q = made.posture("anna")
    assert scene.state(q).frame(scene.frame_id("right_palm")).translation == pytest.approx((0.6, -0.3, 0.6), abs=1e-4)
    assert wb.assess(wb.Problem(scene, start, constraints=kept), q).constraint_violation < 1e-4


def test_figures_stand_where_a_scene_has_them(planar_arm) -> None:
    """A fixed root is placed, and a named posture of a free one; the rest is as where the world of both is."""
    arm, hand = planar_arm((0.4, 0.3)), wb.load("hand")
    at = pin.SE3(pin.utils.rotate("x", 0.4) @ pin.utils.rotate("z", 1.0), np.array((0.7, -0.2, 0.4)))
    made = Assembly().figure("arm", arm, (0.3, 0.2), at=at).figure("hand", hand, "open", at=at)
    scene = wb.Scene({"arm": (arm, at), "hand": (hand, at)})
    q = scene.figure.posture({"arm": np.array((0.3, 0.2)), "hand": "open"})
    for frame in ("arm/tip", "hand/right_index_tip"):
        assert made.placement(frame).isApprox(scene.figure.placement(q, frame), 1e-12)
    near, theirs = (np.sort(one.distance) for one in (made.scene.contacts(made.q, 2.0), scene.contacts(q, 2.0)))
    assert near == pytest.approx(theirs, abs=1e-9)
    target = at.act(np.array((0.2, 0.5, 0.0)))
    assert made.point_goal("arm/tip", target).solve().status == "solved"
    assert made.placement("arm/tip").translation == pytest.approx(target, abs=1e-5)
