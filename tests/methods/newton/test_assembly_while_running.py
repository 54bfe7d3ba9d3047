"""What changes while an assembly runs: constraints, orientations that are dragged, measures, the metric."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar

import wholebody as wb
from wholebody.base.arrays import Array

Y = (0.0, 1.0, 0.0)
CLOSING = "revolute joint of 'coupler' and 'rocker'"


def _four_bar() -> wb.Assembly:
    """Ground 1, crank 0.3, coupler 0.9, rocker 0.7, in the plane y = 0."""
    made = wb.Assembly().body("crank").body("coupler", (0, 0, 0.3)).body("rocker", (1, 0, 0))
    made.revolute("world", "crank", at=(0, 0, 0), axis=Y).revolute("crank", "coupler", at=(0, 0, 0.3), axis=Y)
    made.revolute("world", "rocker", at=(1, 0, 0), axis=Y)
    return made.revolute("coupler", "rocker", at_first=(0.9, 0, 0), at_second=(0, 0, 0.7), axis=Y, axis_second=Y)


class Near(wb.Measure):
    """Squared distance of a point of a body from a place in the world [m^2]."""

    def __init__(self, body: str, point: Any, place: Any, slope: float = 2.0) -> None:
        self.body, self.point, self.place, self.slope = body, np.array(point), np.array(place), slope

    def _way(self, state: Any) -> tuple[Any, Array]:
        here = state.data.oMi[state.model.getJointId(self.body)]
        return here, here.act(self.point) - self.place

    def value(self, state: Any) -> float:
        _, way = self._way(state)
        return float(way @ way)

    def gradient(self, state: Any) -> Array:
        here, way = self._way(state)
        first, force = state.model.joints[state.model.getJointId(self.body)].idx_v, self.slope * here.rotation.T @ way
        result = np.zeros(state.model.nv)
        result[first : first + 6] = *force, *np.cross(self.point, force)
        return result


def _missed(angle: float) -> float:
    """What `Near` is of the coupler's middle and (0.3, 1), where the crank is turned by an angle from upright."""
    crank, base = 0.3 * np.array((np.sin(angle), np.cos(angle))), np.array((1.0, 0.0))
    span = np.linalg.norm(base - crank)
    along = (span**2 + 0.9**2 - 0.7**2) / (2.0 * span)
    unit = (base - crank) / span
    joint = crank + along * unit + np.sqrt(0.9**2 - along**2) * np.array((-unit[1], unit[0]))
    return float(np.sum((0.5 * (crank + joint) - (0.3, 1.0)) ** 2))


def test_a_chain_that_was_opened_and_closed_ends_where_a_fresh_one_ends() -> None:
    fresh = _four_bar().frame_goal("crank", (0, 0, 0))
    assert fresh.solve(tolerance=1e-10).status == "solved"
    made = _four_bar()
    made.solve()
    made.point_goal("rocker", (1, 0, 0.7), place=(0, 0, 0.7))
    drag = wb.tracking.Drag(made)
    made.release(CLOSING)  # while the drag runs
    assert not made.constraints[CLOSING]
    for turn in np.linspace(0.0, 0.6, 20):
        assert drag.to((1 + 0.7 * np.sin(turn), 0, 0.7 * np.cos(turn))).error < 1e-3
    apart = made.placement("coupler").act(np.array((0.9, 0, 0))) - made.placement("rocker").act(np.array((0, 0, 0.7)))
    assert np.linalg.norm(apart) > 0.1
    made = pickle.loads(pickle.dumps(made)).hold(CLOSING).drop_goals().frame_goal("crank", (0, 0, 0))
    assert made.solve(tolerance=1e-10).status == "solved"
    assert made.variables() == pytest.approx(fresh.variables(), abs=1e-8)


def test_a_joint_that_was_released_lets_shapes_touch_and_makes_room_for_another() -> None:
    made = wb.Assembly().body("a", shape=wb.Sphere(0.1)).body("b", (0.15, 0, 0), shape=wb.Sphere(0.1))
    made.fixed("a", "b").fixed("world", "a")
    assert made.solve().penetration == 0.0  # not tested: they are as one
    made.release("fixed joint of 'a' and 'b'")
    assert made.solve().penetration < 1e-5
    assert made.placement("b").translation[0] == pytest.approx(0.2, abs=1e-4)
    made.fixed("a", "b")
    with pytest.raises(wb.InputError, match="already"):
        made.fixed("a", "b")
    assert list(made.constraints) == ["fixed joint of 'a' and 'b'", "fixed joint of 'world' and 'a'"]
    with pytest.raises(wb.UnknownNameError, match="fixed joint"):
        made.release("fixed joint of 'a' and 'c'")


def test_a_lever_that_is_turned_is_where_its_angle_says() -> None:
    made = wb.Assembly().body("lever", (0.5, 0, 0)).revolute("world", "lever", at=(0, 0, 0), axis=Y)
    drag = wb.tracking.Drag(made.orientation_goal("lever", (0, 0, 0, 1)))
    for turn in np.linspace(0.0, 1.2, 30):
        frame = drag.to((0, np.sin(0.5 * turn), 0, np.cos(0.5 * turn)))
    assert frame.error < 1e-3
    assert drag.finish().status == "solved"
    assert made.placement("lever").translation == pytest.approx((0.5 * np.cos(1.2), 0, -0.5 * np.sin(1.2)), abs=1e-5)


def test_a_measure_of_ones_own_is_least_where_scipy_finds_it() -> None:
    made = _four_bar()
    made.solve()
    made.minimise(Near("coupler", (0.45, 0, 0), (0.3, 0, 1)))
    assert made.solve(tolerance=1e-8).status == "solved"
    least = minimize_scalar(_missed, bounds=(-0.5, 0.5), method="bounded", options={"xatol": 1e-10})
    middle = made.placement("coupler").act(np.array((0.45, 0, 0)))
    assert np.sum((middle - (0.3, 0, 1)) ** 2) == pytest.approx(least.fun, abs=1e-7)
    made.drop_measures().minimise(Near("coupler", (0.45, 0, 0), (1.0, 0, 1.0)))
    before = made.variables()
    drag = wb.tracking.Drag(made.point_goal("rocker", (1, 0, 0)))  # which always holds: frames lower the measure
    assert np.abs([drag.to((1, 0, 0)).q for _ in range(3)][-1] - before).max() > 0.01


@pytest.mark.parametrize(("metric", "turns"), [("rim", 4.0), ("variables", 1.0)])
def test_the_nearest_state_is_that_of_the_metric(metric: Any, turns: float) -> None:
    made = wb.Assembly(metric=metric).body("bar", size=1.0).point_goal("bar", (1.0, 0, 0.8), place=(1, 0, 0))
    assert made.solve(nearest=True, tolerance=1e-9).status == "solved"

    def distance(angle: Array) -> float:  # eq. 1 with the bar turned about y, its tip at the goal
        place = np.array((1.0, 0.8)) - np.array((np.cos(angle[0]), -np.sin(angle[0])))
        return float(place @ place + turns * (2.0 - 2.0 * np.cos(0.5 * angle[0])))

    found = 2.0 * np.arcsin(made.variables()[4])
    assert found == pytest.approx(minimize(distance, [0.0], tol=1e-12).x[0], abs=1e-5)


def test_what_a_solve_has_laid_out_cannot_be_changed_unseen() -> None:
    made = wb.Assembly(clearance=0.01, metric="variables").body("bar")
    for name, value in (("metric", "variables"), ("clearance", 0.01)):
        assert getattr(made, name) == value
        with pytest.raises(AttributeError):
            setattr(made, name, value)


def test_wrong_measures_are_named() -> None:
    made = wb.Assembly().body("bar")
    with pytest.raises(wb.InputError, match="correct the gradient"):
        made.minimise(Near("bar", (1, 0, 0), (0, 0, 1), slope=1.0))
    with pytest.raises(wb.InputError, match="name the figure: there is none"):
        made.minimise(wb.Effort())
    with pytest.raises(wb.InputError, match="nearest"):
        made.minimise(Near("bar", (1, 0, 0), (0, 0, 1))).solve(nearest=True)
    with pytest.raises(wb.InputError, match="metric"):
        wb.Assembly(metric="eq1")  # type: ignore[arg-type]


def test_a_person_holds_a_box_where_a_measure_of_her_own_is_least() -> None:
    human = wb.load("human")
    made = wb.Assembly().body("box", (0.5, 0.0, 1.0)).figure("ann", human, constraints=[wb.Hold("left_foot")])
    with pytest.raises(wb.UnknownNameError, match="called 'ben'"):
        made.minimise(wb.tasks.Hang(), figure="ben")
    for palm, side in (("ann/left_palm", 0.1), ("ann/right_palm", -0.1)):
        made.spherical("box", palm, at_first=(0.0, side, 0.0), at_second=(0.0, 0.0, 0.0))
    assert made.solve().status == "solved"
    measure, scene = wb.tasks.Discomfort(), wb.Scene(human)
    stated = wb.Problem(scene, made.posture("ann"), measures=[measure], balance=False).measures[0]
    before = stated.value(scene.state(made.posture("ann")))
    assert made.minimise(measure).solve().status == "solved"
    assert stated.value(scene.state(made.posture("ann"))) < 0.01 * before
    ends = [made.placement(name).translation for name in ("ann/left_palm", "ann/right_palm")]
    assert np.linalg.norm(ends[0] - ends[1]) == pytest.approx(0.2, abs=2e-5)


class Low(wb.Measure):
    """The height of a body."""

    def __init__(self, body: str) -> None:
        self.body = body

    def value(self, state: Any) -> float:
        return float(state.data.oMi[state.model.getJointId(self.body)].translation[2])

    def gradient(self, state: Any) -> np.ndarray:
        joint, gradient = state.model.getJointId(self.body), np.zeros(state.model.nv)
        first = state.model.joints[joint].idx_v
        gradient[first : first + 3] = state.data.oMi[joint].rotation[2]
        return gradient


@pytest.mark.parametrize("iterations", [200, 5])
def test_a_chain_hangs_straight_down_or_the_answer_says_that_it_does_not_yet(iterations: int) -> None:
    made, at, turned = wb.Assembly(), np.zeros(3), 0.0
    for k, angle in enumerate(np.random.default_rng(1).uniform(-1.0, 1.0, 8)):
        turned += angle
        made.body(f"rod {k}", (*at, 0.0, np.sin(0.5 * turned), 0.0, np.cos(0.5 * turned)))
        at = at + 0.3 * np.array([np.sin(turned), 0.0, np.cos(turned)])
        before = f"rod {k - 1}" if k else "world"
        made.revolute(before, f"rod {k}", at_first=(0, 0, 0.3 * bool(k)), at_second=(0, 0, 0), axis=(0, 1, 0),
                      axis_second=(0, 1, 0))  # fmt: skip
    answer = made.minimise(Low("rod 7")).solve(iterations=iterations)
    hangs = answer.placements["rod 7"].translation[2] < -7 * 0.3 + 1e-4
    assert hangs == (iterations == 200) == ("not lowered to a minimum" not in answer.message)
