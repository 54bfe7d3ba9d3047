"""What no posture can give is found at once, and both sides of it are named; what some posture gives is not blamed."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.needs import each
from wholebody.bench.suite.problem_sets import robots
from wholebody.bench.suite.problem_sets.registry import SETS
from wholebody.bench.suite.problem_sets.things import coal_distance, turned
from wholebody.figures.state import State
from wholebody.methods.contradictions import contradictions
from wholebody.tasks.range_of_motion import Coordinate, CoupledRow

METHODS = {
    "qp": lambda: wb.methods.QP(restarts=0),
    "ccd": wb.methods.CCD,
    "newton": lambda: wb.methods.Newton(restarts=0, iterations=4),
    "placo": wb.methods.Placo,
    "dls": wb.methods.DampedLeastSquares,
}


def found(problem):
    with problem.borrow() as workspace:
        return contradictions(problem, workspace)


@pytest.fixture
def standing():
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")

    def make(*things, goals=(), constraints=(), clearance=0.0):
        for number, (shape, at) in enumerate(things):
            scene.add(shape, name=f"thing{number}", at=at)
        return wb.Problem(scene, goals=goals, constraints=constraints, clearance=clearance)

    return make


def test_a_held_foot_inside_a_thing(standing):
    problem = standing((wb.Box((0.5, 0.5, 0.5)), (0.0, 0.1, 0.1)), constraints=[wb.Hold("left_foot")])
    (only,) = found(problem)
    assert only.status == "infeasible"
    assert "left_foot (kept by constraints[0], Hold('left_foot'))" in only.text
    assert "inside thing0 (kept by the world)" in only.text


def test_a_frozen_arm_inside_a_thing(standing):
    arm = ("right_arm", "spine", "root")
    problem = standing((wb.Sphere(0.1), (0.0, -0.22, 1.12)), constraints=[wb.Freeze(*arm)])
    assert [entry.status for entry in found(problem)] == ["infeasible"]
    free = standing(constraints=[wb.Freeze("right_arm", "root")])  # the trunk can still take the arm away
    assert found(free) == ()


def test_two_holds_of_one_frame_and_of_one_frozen_part(standing):
    here = wb.Hold("left_foot")
    there = wb.Hold("left_foot", at=(0.0, 0.1, 0.5))
    (only,) = found(standing(constraints=[here, there]))
    assert "constraints[1]" in only.text
    assert "constraints[0]" in only.text
    elbow = wb.Hold("right_hand", at=(0.3, -0.3, 1.2))
    shoulder = wb.Hold("right_upper_arm", at=(0.0, -0.2, 1.3))
    assert found(standing(constraints=[elbow, shoulder])) == ()
    assert len(found(standing(constraints=[elbow, shoulder, wb.Freeze("right_arm")]))) == 1


def test_goals_against_holds_and_against_each_other(standing):
    foot, tip = wb.Hold("left_foot"), (0.3, -0.2, 1.6)
    (only,) = found(standing(goals=[wb.Point("left_heel", (1.0, 0.0, 0.0))], constraints=[foot]))
    assert only.status == "unreachable"
    goals = [wb.Point("right_index_tip", tip), wb.Point("right_index_tip", (0.3, -0.2, 1.7))]
    (only,) = found(standing(goals=goals))
    assert "100 mm" in only.text
    offset = wb.Point("right_index_tip", (0.3, -0.2, 1.7), offset=(0.0, 0.0, 0.1))
    assert found(standing(goals=[goals[0], offset])) == ()


def test_unreachable_says_that_everything_holds(standing):
    """One of two goals is missed for certain; whether the hold is kept is another question."""
    foot = wb.Hold("left_foot", (0.6, 0.3, 2.9), orientation=False)
    goals = [wb.Point("right_index_tip", (0.3, -0.2, 1.6)), wb.Point("right_index_tip", (0.3, -0.2, 1.7))]
    problem = standing(goals=goals, constraints=[foot])
    assert [entry.status for entry in found(problem)] == ["unreachable"]
    answer = wb.methods.QP(iterations=1, budget=0, restarts=0).solve(problem)
    assert not answer.assessment.holds(1e-4)
    assert answer.status in ("stalled", "infeasible")


def test_an_arm_without_joints_to_move():
    """The world itself is a rigid group: what a frozen fixed arm should reach is told where it is."""
    figure = wb.load("avatar")
    scene = wb.Scene(figure)
    problem = wb.Problem(
        scene, goals=[wb.Point("right_index_tip", (0.5, 0.0, 1.0))], constraints=[wb.Freeze(*figure.groups, "root")]
    )
    assert [entry.status for entry in found(problem)] == ["unreachable"]


@pytest.mark.parametrize("name", each([name for name in METHODS if name != "newton"]))  # which looks for seconds
def test_every_method_names_both_sides(name):
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.5, 0.5, 0.5)), name="block", at=(0.0, 0.1, 0.1))
    goals = [wb.Point("right_index_tip", (0.4, -0.3, 1.2))]
    problem = wb.Problem(scene, goals=goals, constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")])
    if name == "ccd":  # which holds no feet
        problem = wb.Problem(scene, goals=goals, constraints=[wb.Freeze("left_leg", "root")])
    answer = METHODS[name]().solve(problem)
    assert answer.status in ("infeasible", "stalled")
    assert "the problem contradicts itself: left_" in answer.message
    assert "block" in answer.message


@pytest.mark.parametrize("name", [name for name in SETS if not SETS[name].moving])
def test_problems_with_a_witness_contradict_nothing(name):
    assert found(SETS[name].make(0, 5).problem) == ()


@pytest.mark.parametrize(("deep", "turned"), [(0.02, 0.0), (0.1, 0.6)])
def test_a_tip_asked_into_a_wall_misses_by_its_depth_and_the_clearance(standing, deep, turned):
    """The wall is all that is in reach; the way out of it is known, and so is the least that is left."""
    normal = np.array([-np.cos(turned), -np.sin(turned), 0.0])
    wall = np.array([0.45, -0.2, 1.2])  # a point of its face
    problem = standing(goals=[wb.Point("right_index_tip", wall - deep * normal)], clearance=0.005)
    problem.scene.add(wb.HalfSpace(), name="wall", at=pin.SE3(_facing(normal), wall))
    problem = wb.Problem(problem.scene, goals=problem.goals, constraints=[wb.Hold("left_foot")], clearance=0.005)
    entries = found(problem)
    assert len(entries) == 1, [entry.text for entry in entries]
    (only,) = entries
    assert only.least == pytest.approx(deep + 0.005, abs=1e-5)
    assert "goals[0], Point('right_index_tip'), is in wall" in only.text
    answer = wb.methods.QP().solve(problem)
    assert answer.status == "unreachable"
    assert only.least - 1e-5 < answer.assessment.goal_error < 1.02 * only.least
    assert answer.iterations < 300


def test_a_point_off_its_own_piece_may_be_inside(standing):
    """A tool's tip that has no shape of its own can be anywhere."""
    goal = wb.Point("right_index_tip", (0.4, -0.3, 0.5), offset=(0.0, 0.0, -0.6))
    problem = standing((wb.Box((0.2, 0.2, 0.2)), (0.4, -0.3, 0.5)), goals=[goal])
    assert found(problem) == ()


@pytest.mark.parametrize("off", [0.0, 0.03])
def test_no_turn_of_its_piece_brings_a_point_nearer_than_its_bound(standing, off):
    """A finger's end, or a place beyond it, in a box: what is nearer is too near to it however the finger turns."""
    box, at, rng = wb.Box((0.2, 0.2, 0.2)), np.array([0.4, -0.3, 1.0]), np.random.default_rng(2)
    goal = wb.Point("right_index_tip", at + [0.02, 0.03, 0.04], offset=(0.0, 0.0, -off))
    problem = standing((box, at), goals=[goal], clearance=0.005)
    (only,) = found(problem)
    (asked,), (piece,) = problem.goals, box.pieces()
    here = asked.place.placement.act(asked.resolved_offset)
    own = [each for each in problem.scene.figure.geometry.geometryObjects if each.parentJoint == asked.place.joint]
    assert own
    for _ in range(300):
        turn, way = pin.Quaternion(*turned(rng)).matrix(), rng.normal(size=3)
        way *= 0.999 * only.least / np.linalg.norm(way)
        joint = pin.SE3(turn, asked.resolved_target + way - turn @ here)
        there = pin.SE3(np.eye(3), at)
        gaps = [coal_distance(each.geometry, joint * each.placement, piece.geometry, there) for each in own]
        assert min(gaps) < 0.005


def test_flesh_that_spreads_on_a_seat_is_in_the_thigh_of_who_stands():
    """A wall between the thigh and where its flesh would be on a seat: held or asked to stay, she stays."""
    figure = wb.load("human", sex="female", stature=1.6, mass=95.0)
    scene, q = wb.Scene(figure), figure.neutral
    (flesh,) = (piece for piece in figure.geometry.geometryObjects if piece.name == "left_thigh:3")
    joint = scene.state(q).data.oMi[flesh.parentJoint]
    wall = joint.act(flesh.placement.translation)[1] + flesh.geometry.radius - 0.009
    scene.add(wb.Box((1.0, 0.5, 0.2)), name="wall", at=(0.0, wall + 0.25, 0.73))
    thigh = figure.placement(q, "left_thigh")
    place = joint.act(flesh.placement.translation + [0.0, flesh.geometry.radius - 0.001, 0.0])
    asked = [wb.Frame("left_thigh", thigh), wb.Point("left_thigh", place, offset=thigh.actInv(place))]
    for problem in (
        wb.Problem(scene, q, constraints=[wb.Hold("left_thigh")]),
        *(wb.Problem(scene, q, goals=[goal]) for goal in asked),
    ):
        assert wb.solve(problem).status == "solved"
        assert found(problem) == ()


def test_a_tip_may_be_asked_onto_a_face(standing):
    goal = wb.Point("right_index_tip", (0.4, -0.3, 1.0))
    assert found(standing((wb.Box((0.2, 0.2, 0.2)), (0.4, -0.3, 0.9)), goals=[goal])) == ()


@pytest.mark.parametrize("slide", [0.0, 0.3])
def test_a_goal_beyond_an_arm_in_one_line_misses_by_what_is_beyond(tmp_path, slide):
    """Two bars of 0.5 and 0.4 m, and a slide: no posture is nearer, and the nearest one is in line."""
    kind = f'"prismatic"><limit lower="-0.1" upper="{slide}" effort="1" velocity="1"/>' if slide else '"fixed">'
    links = "".join(f'<link name="{name}"/>' for name in ("base", "upper", "fore", "tip"))
    (tmp_path / "arm.urdf").write_text(
        f"""<robot name="arm">{links}
        <joint name="a" type="continuous"><parent link="base"/><child link="upper"/><origin xyz="0 0 1"/>
        <axis xyz="0 1 0"/></joint>
        <joint name="b" type="continuous"><parent link="upper"/><child link="fore"/><origin xyz="0.5 0 0"/>
        <axis xyz="0 1 0"/></joint>
        <joint name="c" type={kind}<parent link="fore"/><child link="tip"/><origin xyz="0.4 0 0"/></joint></robot>"""
    )
    arm = wb.load(tmp_path / "arm.urdf")
    tip = arm.model.getFrameId("tip")
    places = (wb.Scene(arm).state(q).frame(tip).translation for q in _postures(arm, 400))
    assert max(np.linalg.norm(place - [0.0, 0.0, 1.0]) for place in places) < 0.9 + slide
    beyond = wb.Problem(wb.Scene(arm), goals=[wb.Point("tip", (1.5, 0.0, 1.0))])
    (only,) = found(beyond)
    assert (only.status, only.least) == ("unreachable", pytest.approx(0.6 - slide, abs=1e-9))
    for name in ("qp", "newton", "ccd"):
        answer = wb.solve(beyond, METHODS[name]())
        assert (answer.status, answer.assessment.goal_error) == ("unreachable", pytest.approx(0.6 - slide, rel=0.02))
        assert "goals[0], Point('tip'), is" in answer.message
    assert found(wb.Problem(wb.Scene(arm), goals=[wb.Point("tip", (0.899 + slide, 0.0, 1.0))])) == ()


def test_only_what_is_fixed_bounds_the_reach(standing):
    """A person who stands where they like gets everywhere; a frozen pelvis bounds an arm from there."""
    goal = wb.Point("right_wrist", (5.0, 0.0, 1.0))
    assert found(standing(goals=[goal])) == ()
    (only,) = found(standing(goals=[goal], constraints=[wb.Hold("pelvis")]))
    assert 3.5 < only.least < 4.5


def _postures(figure, count):
    rng, limits = np.random.default_rng(0), figure.limits
    for _ in range(count):
        q = np.asarray(pin.integrate(figure.model, figure.neutral, rng.uniform(-np.pi, np.pi, figure.model.nv)))
        q[limits.idx_q] = rng.uniform(limits.lower, limits.upper)
        yield q


def _facing(normal):
    """A rotation that turns z to a normal (3,)."""
    aside = np.cross(normal, [0.0, 0.0, 1.0])
    return np.column_stack([aside, np.cross(normal, aside), normal])


def upper_limit(scene, name, sign=1.0):
    """Upper limit of a joint of one degree of freedom, radians; with sign -1 the negative of the lower one."""
    place = scene.model.joints[scene.figure.joint_id(name)].idx_q
    return float(scene.model.upperPositionLimit[place] if sign > 0.0 else -scene.model.lowerPositionLimit[place])


def cone_texts(problem):
    return [entry.text for entry in found(problem) if "'right_shoulder' is violated" in entry.text]


def bent(figure, **angles):
    q = figure.posture("standing")
    for name, degrees in angles.items():
        joint = figure.model.joints[figure.joint_id(name)]
        q[joint.idx_q] = np.radians(degrees)
    return q


def test_a_frozen_leg_that_its_hamstrings_do_not_allow(standing):
    """Hip - 0.9 knee <= 62 degrees: at 110 degrees of the hip a straight knee is 48 degrees beyond it."""
    scene = standing().scene
    start = bent(scene.figure, left_hip_flexion=110.0, left_knee_flexion=0.0)
    (only,) = found(wb.Problem(scene, start, constraints=[wb.Freeze("left_leg")]))
    assert only.status == "infeasible"
    assert "RangeOfMotion (by default), 'left_hamstrings' is violated by 48 degrees" in only.text
    assert "Freeze('left_leg')" in only.text
    apart = [wb.Freeze("left_hip_flexion"), wb.Freeze("left_knee_flexion")]
    (only,) = found(wb.Problem(scene, start, constraints=apart))
    assert "Freeze('left_hip_flexion') and Freeze('left_knee_flexion')" in only.text
    assert found(wb.Problem(scene, start, constraints=[wb.Freeze("left_hip_flexion")])) == ()  # the knee can bend
    assert found(wb.Problem(scene, start, constraints=[wb.Freeze("right_leg")])) == ()
    assert found(wb.Problem(scene, start)) == ()


def test_a_frozen_joint_that_no_angle_of_the_other_allows():
    """A range of a frozen and of a free joint is violated for good where the free joint's limit does not suffice."""
    row = CoupledRow((Coordinate(0, 0, 1.0), Coordinate(1, 1, -0.5)), 0.2)
    least, most = np.array([0.8, -1.0]), np.array([0.8, 1.0])
    assert row.largest(least, most) == pytest.approx(0.2 - (0.8 - 0.5))


def test_a_frozen_neck_beyond_its_ellipse(standing):
    """Two of its angles at their limits are more than the neck does, whether the third is free or not."""
    scene, names = standing().scene, ("neck1_lateral", "neck1_rotation", "neck2_rotation")
    ends = {name: np.degrees(upper_limit(scene, name)) for name in names}
    start = bent(scene.figure, **ends)
    for frozen in (("neck",), names):
        texts = [entry.text for entry in found(wb.Problem(scene, start, constraints=[wb.Freeze(*frozen)]))]
        assert len(texts) == 1
        assert "'neck' is violated" in texts[0]
    assert found(wb.Problem(scene, start, constraints=[wb.Freeze("neck1_lateral", "neck1_rotation")])) == ()


def test_the_largest_value_of_a_range_is_that_of_the_best_posture(standing):
    scene = standing().scene
    term = next(term for term in standing().constraints if isinstance(term, wb.tasks.RangeOfMotion))
    row, state, rng = term.rows[term.row_names.index("neck")], State(scene.model), np.random.default_rng(1)
    for _ in range(6):
        ends = np.sort(rng.uniform(-1.5, 1.5, (2, scene.model.nq)), axis=0)
        ends[:, :7] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0  # the root
        values = [row.value(state.update(rng.uniform(*ends))) for _ in range(2000)]
        assert max(values) <= row.largest(*ends)
        assert max(values) == pytest.approx(row.largest(*ends), abs=0.2)


def test_a_frozen_arm_out_of_its_reach_cone(standing):
    """All the joints between the trunk and the upper arm are frozen; with one of them free nothing is said."""
    scene = standing().scene
    figure, rng, state = scene.figure, np.random.default_rng(3), State(scene.model)
    joints = [name for name in figure.model.names if name.startswith(("right_clavicle", "right_shoulder"))]
    cones = next(term for term in standing().constraints if isinstance(term, wb.tasks.ReachCones))
    row, seen = list(figure.cones).index("right_shoulder"), set()
    for _ in range(30):
        ends = [(-upper_limit(scene, name, -1.0), upper_limit(scene, name)) for name in joints]
        angles = {name: np.degrees(rng.uniform(*pair)) for name, pair in zip(joints, ends, strict=True)}
        start = bent(figure, **angles)
        value = float(cones.value(state.update(start))[row])
        said = cone_texts(wb.Problem(scene, start, constraints=[wb.Freeze(*joints)]))
        assert bool(said) == (value < -1e-4)
        assert all("Freeze('right_clavicle" in text for text in said)
        assert cone_texts(wb.Problem(scene, start, constraints=[wb.Freeze(*joints[:-1])])) == []
        seen.add(bool(said))
    assert seen == {True, False}


def test_a_hold_where_the_start_is_not_is_taken_at_its_word(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1))).add(wb.Sphere(0.1), name="ball", at=(1.0, 0.0, 0.0))
    into = wb.Hold("body0", at=pin.SE3(np.eye(3), np.array([0.9, 0.0, 0.0])))
    beside = wb.Hold("body0", at=pin.SE3(np.eye(3), np.array([0.7, 0.0, 0.0])))
    assert len(found(wb.Problem(scene, constraints=[into]))) == 1
    assert found(wb.Problem(scene, constraints=[beside])) == ()


def test_a_piece_that_a_placement_puts_into_a_thing_is_a_proof():
    """No displacement of less than the bound frees it, by coal on random ones; free postures contradict nothing."""
    figure, start = robots.known_arm("ur5")
    rng, proven, joint = np.random.default_rng(6), 0, figure.model.frames[figure.frame_id("tool")].parentJoint
    own = [k for k, body in enumerate(figure.geometry.geometryObjects) if body.parentJoint == joint]
    for number in range(40):
        there = rng.uniform(figure.limits.lower, figure.limits.upper)
        place = figure.placement(there, "tool")
        at = place.act(rng.uniform(-0.08, 0.08, 3))
        size = rng.uniform(0.02, 0.15, 3)
        scene = wb.Scene(figure).add(wb.Box(size), name="box", at=at)
        clearance = 0.004 * (number % 2)
        problem = wb.Problem(scene, start, goals=[wb.Frame("tool", place)], clearance=clearance)
        free = not any("box" in (pair.a, pair.b) for pair in scene.penetration(there))
        entries = [one for one in found(problem) if "into box" in one.text]
        assert not (entries and free and not clearance)
        for one in entries:
            proven += 1
            assert one.status == "unreachable"
            box = coal.Box(*size)
            for _ in range(60):
                move = rng.normal(size=6)
                move *= 0.999 * one.least / np.linalg.norm(move)
                moved = pin.SE3(place.rotation @ pin.exp3(move[3:]), place.translation + move[:3])
                joint_at = moved * figure.model.frames[figure.frame_id("tool")].placement.inverse()
                gaps = []
                for body in (figure.geometry.geometryObjects[k] for k in own):
                    piece = joint_at * body.placement
                    gaps.append(
                        coal.distance(
                            body.geometry, coal.Transform3s(piece.rotation, piece.translation), box,
                            coal.Transform3s(np.eye(3), at), coal.DistanceRequest(), coal.DistanceResult(),
                        )
                    )  # fmt: skip
                assert min(gaps) < clearance + 1e-5
    assert proven > 5


def test_six_joints_inside_a_thing_say_so():
    """What a closed form knows to be blocked names the contradiction, as other arms do."""
    figure, start = robots.known_arm("ur5")
    place = figure.placement(np.array([0.3, -1.0, 1.2, -0.4, 0.6, 0.2]), "tool")
    scene = wb.Scene(figure).add(wb.Box((0.4, 0.4, 0.4)), name="box", at=place.translation)
    solution = wb.solve(wb.Problem(scene, start, goals=[wb.Frame("tool", place)]))
    assert solution.status == "unreachable"
    assert "contradicts itself" in solution.message
