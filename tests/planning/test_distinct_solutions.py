"""All answers of a goal against closed forms: an arm of three hinges has four postures for a point, two of them up."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.bench.suite.problem_sets.robots import known_arm
from wholebody.planning.distinct_solutions import all_found

UPPER, FORE, HIGH = 0.5, 0.4, 0.3  # m: lengths of an arm that turns on a post, lifts and bends

ARM = f"""<robot name="arm"><link name="post"/><link name="turret"/>
<link name="upper"><collision><origin xyz="{0.5 * UPPER} 0 0" rpy="0 1.5707963 0"/>
  <geometry><cylinder radius="0.02" length="{UPPER - 0.1}"/></geometry></collision></link>
<link name="fore"><collision><origin xyz="{0.5 * FORE} 0 0" rpy="0 1.5707963 0"/>
  <geometry><cylinder radius="0.02" length="{FORE - 0.1}"/></geometry></collision></link><link name="tip"/>
<joint name="turn" type="revolute"><parent link="post"/><child link="turret"/><origin xyz="0 0 {HIGH}"/>
  <axis xyz="0 0 1"/>
  <limit lower="-3.1" upper="3.1" effort="1" velocity="1"/></joint>
<joint name="lift" type="revolute"><parent link="turret"/><child link="upper"/><axis xyz="0 -1 0"/>
  <limit lower="-3.1" upper="3.1" effort="1" velocity="1"/></joint>
<joint name="bend" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="{UPPER} 0 0"/>
  <axis xyz="0 -1 0"/>
  <limit lower="-2.9" upper="2.9" effort="1" velocity="1"/></joint>
<joint name="end" type="fixed"><parent link="fore"/><child link="tip"/><origin xyz="{FORE} 0 0"/></joint></robot>"""


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> wb.Figure:
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(ARM)
    return wb.load(path)


def postures(target: tuple[float, float, float]) -> np.ndarray:
    """All (k, 3) postures whose tip is at a place: to the front or over the back, elbow up or down."""
    x, y, z = target
    reach, height = np.hypot(x, y), z - HIGH
    cosine = (reach**2 + height**2 - UPPER**2 - FORE**2) / (2.0 * UPPER * FORE)
    found = []
    for turn, out in ((np.arctan2(y, x), reach), (np.arctan2(-y, -x), -reach)):
        for bend in (np.arccos(cosine), -np.arccos(cosine)):
            lift = np.arctan2(height, out) - np.arctan2(FORE * np.sin(bend), UPPER + FORE * np.cos(bend))
            found.append((turn, (lift + np.pi) % (2.0 * np.pi) - np.pi, bend))
    return np.array(found)


def same(found: list[np.ndarray], expected: np.ndarray) -> bool:
    """Whether two sets of postures are the same."""
    return len(found) == len(expected) and all(min(np.abs(q - other).max() for q in found) < 1e-4 for other in expected)


TARGET = (0.45, 0.3, 0.55)


def test_an_arm_has_all_of_its_postures(arm: wb.Figure) -> None:
    expected = postures(TARGET)
    for q in expected:
        assert arm.placement(q, "tip").translation == pytest.approx(TARGET, abs=1e-9)
    problem = wb.Problem(wb.Scene(arm), np.array((0.2, 0.1, 0.3)), goals=[wb.Point("tip", TARGET)])
    found = wb.solutions(problem)
    assert same([answer.q for answer in found], expected)
    assert found.complete
    assert found.found == 4
    measures = [answer.assessment.measure for answer in found]
    weights = arm.effort_weights
    assert measures == pytest.approx(sorted(weights @ (q - problem.start) ** 2 for q in expected), rel=1e-4)
    assert "4 distinct answers" in str(found)
    best = wb.solutions(problem, most=1)
    assert len(best) == 1
    assert best[0].assessment.measure == pytest.approx(measures[0], rel=1e-6)
    again = wb.solutions(problem)
    assert [tuple(answer.q) for answer in again] == [tuple(answer.q) for answer in found]


def test_a_posture_at_a_limit_that_few_starts_lead_to_is_found(planar_arm: Callable[..., wb.Figure]) -> None:
    """The third hinge rests at its limit; the two others follow from two sides and an angle of a triangle."""
    start = np.array((1.60794338, -0.56728906, -0.83738104))
    tip, (first, second, third), limit = np.array((0.24102766, 0.67877338)), (0.5, 0.4, 0.3), 2.5

    def at(end: float) -> np.ndarray:
        """The posture with this angle of the third hinge whose second one bends to the left."""
        outer = np.hypot(second + third * np.cos(end), third * np.sin(end))
        aside = np.arctan2(third * np.sin(end), second + third * np.cos(end))
        inner = np.arccos((tip @ tip - first**2 - outer**2) / (2.0 * first * outer))
        turn = np.arctan2(tip[1], tip[0]) - np.arctan2(outer * np.sin(inner), first + outer * np.cos(inner))
        return np.array((turn, inner - aside, end))

    figure = planar_arm((first, second, third), limit=limit)
    weights = figure.effort_weights
    here, inwards = (float(weights @ (at(end) - start) ** 2) for end in (-limit, -limit + 0.01))
    assert here < inwards
    problem = wb.Problem(wb.Scene(figure), start, goals=[wb.Point("tip", (*tip, 0.0))])
    assert figure.placement(at(-limit), "tip").translation[:2] == pytest.approx(tip, abs=1e-7)
    found = wb.solutions(problem)
    assert not found.complete  # two coordinates leave one of the three hinges free
    assert min(np.abs(answer.q - at(-limit)).max() for answer in found) < 1e-4


def test_what_is_in_the_way_leaves_the_others(arm: wb.Figure) -> None:
    expected = postures(TARGET)
    up = max(expected, key=lambda q: arm.placement(q, "fore").translation[2])
    elbow = arm.placement(up, "fore").translation
    scene = wb.Scene(arm).add(wb.Sphere(0.06), name="ball", at=tuple(0.5 * (elbow + (0.0, 0.0, HIGH))))
    problem = wb.Problem(scene, np.array((0.2, -0.5, 0.3)), goals=[wb.Point("tip", TARGET)])
    free = [q for q in expected if not len(scene.contacts(q, 0.0).distance)]
    assert 0 < len(free) < 4
    assert same([answer.q for answer in wb.solutions(problem)], np.array(free))


def test_an_arm_with_a_closed_form_has_all_of_its_branches() -> None:
    """A UR5 with joints of two turns has up to eight branches (Hawkins 2013); each is found once, and no other is."""
    figure, ready = known_arm("ur5")
    tool = figure.placement(np.array((0.4, -1.2, 1.4, -1.1, -1.3, 0.2)), "tool")
    problem = wb.Problem(wb.Scene(figure), ready, goals=[wb.Frame("tool", tool)])
    found = wb.solutions(problem, most=100)
    assert len(found) == found.starts == 8
    assert found.complete

    def apart(one: np.ndarray, other: np.ndarray) -> float:
        return float(np.abs((one - other + np.pi) % (2.0 * np.pi) - np.pi).max())

    assert all(apart(one.q, other.q) > 0.2 for k, one in enumerate(found) for other in found[:k])
    for answer in wb.methods.QP().minima(problem, np.random.default_rng(2).uniform(-6.2, 6.2, (30, 6))):
        assert not answer.solved or min(apart(answer.q, one.q) for one in found) < 1e-3
    assert not wb.solutions(problem, starts=5).complete


def test_descents_of_seven_joints_begin_at_the_least_effort_of_each_branch() -> None:
    """A Panda's elbow is free to turn: where random postures lead to a minimum, one of few descents did before."""
    figure, ready = known_arm("panda")
    low, high = figure.limits.lower, figure.limits.upper
    rng = np.random.default_rng(0)
    tool = figure.placement(low + (high - low) * rng.uniform(0.2, 0.8, 7), "tool")
    problem = wb.Problem(wb.Scene(figure), ready, goals=[wb.Frame("tool", tool)])
    found = wb.solutions(problem, most=100, starts=12)
    assert not found.complete
    ends = [one for one in wb.methods.QP().minima(problem, rng.uniform(low, high, (40, 7))) if one.solved]
    assert len(ends) > 20
    for end in ends:  # valleys are flat: some descents end beside a minimum
        assert min(abs(end.assessment.measure / one.assessment.measure - 1.0) for one in found) < 0.01


def test_answers_of_seven_joints_are_minima() -> None:
    """Motions that keep the tool of a Gen3 in place form curves; beside each answer there is more effort on its own."""
    figure, ready = known_arm("gen3")
    model, data = figure.model, figure.model.createData()
    frame, kind = model.getFrameId("tool"), pin.ReferenceFrame.LOCAL

    def jacobian(q: np.ndarray) -> np.ndarray:
        return np.asarray(pin.computeFrameJacobian(model, data, q, frame, kind))

    def beside(q: np.ndarray, step: float) -> np.ndarray:
        """A posture at the other end of a small motion of the joints that keeps the tool in place."""
        tool, motion = figure.placement(q, "tool"), np.linalg.svd(jacobian(q))[2][-1]
        found = pin.integrate(model, q, step * motion)
        for _ in range(10):
            apart = pin.log6(figure.placement(found, "tool").actInv(tool)).vector
            found = pin.integrate(model, found, np.linalg.pinv(jacobian(found)) @ apart)
        assert np.linalg.norm(apart) < 1e-6
        return np.asarray(found)

    def effort(q: np.ndarray) -> float:
        return float(figure.effort_weights @ pin.difference(model, ready, q) ** 2)

    known = pin.integrate(model, pin.neutral(model), np.array((0.3, 1.1, -0.5, 1.4, 0.6, -0.9, 0.4)))
    tool = figure.placement(known, "tool")
    found = wb.solutions(wb.Problem(wb.Scene(figure), ready, goals=[wb.Frame("tool", tool)]), most=100, starts=60)
    assert len(found) > 5
    assert not found.complete
    for answer in found:
        assert min(effort(beside(answer.q, step)) for step in (-0.1, 0.1)) > effort(answer.q) - 1e-4


def test_parallel_axes_of_a_wrist_leave_postures_between_the_branches() -> None:
    """With the fifth joint at 0 the fourth and the sixth turn about parallel lines, so postures form a curve."""
    figure, ready = known_arm("ur5")
    tool = figure.placement(np.array((0.4, -1.2, 1.4, -1.1, 0.0, 0.2)), "tool")
    found = wb.solutions(wb.Problem(wb.Scene(figure), ready, goals=[wb.Frame("tool", tool)]), starts=24)
    assert found.starts == 24
    assert not found.complete


def test_out_of_reach_there_are_none(arm: wb.Figure) -> None:
    length = sum(np.linalg.norm(place.translation) for place in list(arm.model.jointPlacements)[2:])
    tip = arm.model.frames[arm.model.getFrameId("tip")]
    length += np.linalg.norm(tip.placement.translation)
    shoulder = np.asarray(arm.model.jointPlacements[1].translation)
    near, far = (shoulder + share * length * np.array([0.6, 0.0, 0.8]) for share in (0.999, 1.001))
    assert len(wb.solutions(wb.Problem(wb.Scene(arm), goals=[wb.Point("tip", near)]), starts=10)) >= 1
    found = wb.solutions(wb.Problem(wb.Scene(arm), goals=[wb.Point("tip", far)]))
    assert (len(found), found.descents, found.starts, found.complete) == (0, 0, 0, True)


def test_a_person_has_distinct_answers() -> None:
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    problem = wb.Problem(
        scene, goals=[wb.Point("right_palm", (0.45, -0.25, 1.2))],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")],
    )  # fmt: skip
    found = wb.solutions(problem, starts=6)
    assert len(found) >= 1
    assert all(wb.assess(problem, answer.q).holds(1e-4) for answer in found)
    assert found[0].assessment.measure <= wb.solve(problem).assessment.measure * 1.01


def test_the_first_descent_begins_however_little_time_is_left(arm: wb.Figure) -> None:
    problem = wb.Problem(wb.Scene(arm), goals=[wb.Point("tip", (0.5, 0.2, 0.5))])
    found = wb.solutions(problem, time_limit=1e-9)
    assert found.starts == 1


def test_a_search_tells_how_far_it_is_and_can_be_ended(arm: wb.Figure, capsys: pytest.CaptureFixture[str]) -> None:
    problem = wb.Problem(wb.Scene(arm), goals=[wb.Point("tip", (0.4, 0.3, 0.5))])
    calls = list[tuple[int, int]]()

    def third(begun: int, most: int) -> bool:
        calls.append((begun, most))
        return begun == 3

    assert wb.solutions(problem, starts=20, progress=third).starts == 3
    assert calls == [(1, 20), (2, 20), (3, 20)]
    wb.solutions(problem, starts=2, progress=True)
    assert "2 of 2" in capsys.readouterr().err
    with pytest.raises(wb.InputError, match="solutions: progress"):
        wb.solutions(problem, progress=3)  # type: ignore[arg-type]


def test_two_arms_have_every_combination_of_their_branches() -> None:
    """Each UR5 has up to eight branches (Hawkins 2013); as far apart as they are here, any of one goes with any."""
    figure, ready = known_arm("ur5")
    tools = [
        figure.placement(np.array(q), "tool")
        for q in ((0.4, -1.2, 1.4, -1.1, -1.3, 0.2), (-0.8, -0.9, 1.2, 0.4, 1.1, -0.6))
    ]
    counts = [
        len(wb.solutions(wb.Problem(wb.Scene(figure), ready, goals=[wb.Frame("tool", tool)]), most=100))
        for tool in tools
    ]
    away = pin.SE3(np.eye(3), np.array((4.0, 0.0, 0.0)))
    scene = wb.Scene({"one": figure, "other": (figure, away)})
    goals = [wb.Frame("one/tool", tools[0]), wb.Frame("other/tool", away * tools[1])]
    problem = wb.Problem(scene, np.tile(ready, 2), goals=goals)
    found = wb.solutions(problem, most=100)
    assert found.complete
    assert len(found) == counts[0] * counts[1] > 8
    for answer in found:
        for q, tool in zip((answer.q[:6], answer.q[6:]), tools, strict=True):
            assert figure.placement(q, "tool").homogeneous == pytest.approx(tool.homogeneous, abs=1e-4)
    few = wb.solutions(problem, starts=9)
    assert (few.starts, few.complete) == (9, False)
    # the combinations of least effort come first
    assert [one.assessment.measure for one in few] == pytest.approx([one.assessment.measure for one in found[:8]])


def test_the_search_of_three_figures_ends_where_starts_change_nothing(planar_arm: Callable[..., wb.Figure]) -> None:
    """Answers of figures multiply: here two times two times two curves, of which one answer is asked for."""
    arm = planar_arm((0.5, 0.4, 0.3))
    scene = wb.Scene({name: (arm, (3.0 * k, 0.0, 0.0)) for k, name in enumerate("abc")})
    goals = [wb.Point(f"{name}/tip", (3.0 * k + 0.6, 0.4, 0.0)) for k, name in enumerate("abc")]
    found = wb.solutions(wb.Problem(scene, np.full(9, 0.3), goals=goals), most=1)
    assert 40 < found.starts < 300
    assert not found.complete
    assert "the last 40 starts changed none" in str(found)


def test_without_a_time_limit_a_bound_of_the_processor_ends_it(arm: wb.Figure, monkeypatch: pytest.MonkeyPatch) -> None:
    """A descent of figures in contact takes seconds, and 300 of them would be no answer; infinity is no limit."""
    monkeypatch.setattr("wholebody.planning.distinct_solutions.LONGEST", 1e-9)
    problem = wb.Problem(wb.Scene(arm), goals=[wb.Point("tip", (0.5, 0.2, 0.5))])
    found = wb.solutions(problem)
    assert (found.starts, found.complete) == (1, False)
    assert "time limit" in found.ended
    assert wb.solutions(problem, time_limit=np.inf, starts=3).starts == 3


def test_why_a_search_ended_does_not_contradict_that_there_may_be_more(planar_arm: Callable[..., wb.Figure]) -> None:
    """Without goals the neighbours of the one minimum are answers; to what is behind a wall there is none."""
    scene = wb.Scene(planar_arm((0.5, 0.4)))
    loose = wb.solutions(wb.Problem(scene, np.array((0.2, 0.3))))
    assert (loose.found, loose.complete) == (1, False)
    assert str(loose).splitlines()[0].endswith("there may be more: neighbours of these meet the goals too")
    scene.add(wb.Box((0.1, 4.0, 1.0)), name="wall", at=(0.4, 0.0, 0.0))
    none = wb.solutions(wb.Problem(scene, np.array((2.0, 0.3)), goals=[wb.Point("tip", (0.7, 0.3, 0.0))]))
    assert (none.found, none.starts, none.ended) == (0, 40, "the last 40 starts led to none")


@pytest.mark.parametrize(("found", "needed"), [(1, 40), (3, 40), (4, 46), (5, 67)])
def test_descents_that_it_takes_to_take_all_answers_for_found(found: int, needed: int) -> None:
    """From w (n - 1) / (n - w - 2) <= w + 1/2, by hand n >= 2 w² + 3 w + 2, and from 40."""
    assert next(n for n in range(100) if all_found(found, n)) == needed
