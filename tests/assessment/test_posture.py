"""The judgement, on postures whose faults are known by construction."""

from __future__ import annotations

import pickle

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.flesh import settle
from wholebody.assessment.all_pairs import AllPairs
from wholebody.assessment.posture import violations
from wholebody.geometry.pieces import Piece
from wholebody.geometry.proximity import Proximity

LENGTHS = (0.5, 0.4)


def test_depth_and_lack_of_clearance(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1))).add(wb.Sphere(0.2), name="ball").add(wb.HalfSpace(), name="floor")
    start = scene.figure.neutral
    start[:3] = 3.0, 0.0, 3.0
    problem = wb.Problem(scene, start, clearance=0.01)
    for distance in (0.02, 0.004, -0.03, -0.299):
        q = start.copy()
        q[:3] = 0.0, 0.3 + distance, 1.0
        scene.move("ball", at=(0.0, 0.0, 1.0))
        found = wb.assess(problem, q)
        assert found.least_distance == pytest.approx(distance, abs=1e-9)
        assert found.penetration == pytest.approx(max(-distance, 0.0), abs=1e-9)
        assert found.clearance_violation == pytest.approx(max(0.01 - distance, 0.0), abs=1e-9)
        assert found.holds(1e-6) is (distance >= 0.01)
    assert "deepest overlap 299 mm, distances short by 309 mm" in str(found)
    q[:3] = 1.5, 0.0, 1.0
    assert str(wb.assess(wb.Problem(scene, start, goals=[wb.Point("body0", (3.46, 0.0, 1.0))]), q)).startswith(
        "goals missed by 1960 mm and"
    )


def test_it_does_not_use_what_methods_use(free_bodies, monkeypatch):
    """With the culled distances broken it still sees everything."""
    scene = wb.Scene(free_bodies(wb.Sphere(0.1))).add(wb.Sphere(0.2), name="ball", at=(0.25, 0.0, 0.0))
    problem = wb.Problem(scene)

    def nothing(self, data, within):
        raise AssertionError("the assessment asked the culled distances")

    monkeypatch.setattr(Proximity, "query", nothing)
    assert wb.assess(problem, problem.start).penetration == pytest.approx(0.05)


def test_limits(planar_arm):
    problem = wb.Problem(wb.Scene(planar_arm(LENGTHS, limit=1.0)))
    assert wb.assess(problem, np.array([1.0, -1.0])).limit_violation == 0.0
    assert wb.assess(problem, np.array([0.5, -1.3])).limit_violation == pytest.approx(0.3)
    assert wb.assess(problem, np.array([1.7, -1.3])).limit_violation == pytest.approx(0.7)


def test_goal_errors_in_metres_and_radians(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1)))
    turn = pin.exp3(np.array([0.0, 0.0, 0.3]))
    frame = wb.Frame("body0", pin.SE3(turn, np.array([0.03, 0.04, 0.0])))
    problem = wb.Problem(scene, goals=[wb.Point("body0", (0.0, 0.0, 0.02)), frame])
    found = wb.assess(problem, problem.start)
    assert found.goal_error == pytest.approx(0.05)
    assert found.goal_angle == pytest.approx(0.3)
    assert found.goal_errors == pytest.approx((0.02, 0.3))
    assert not found.met(0.29)
    assert found.met(0.31)


def test_constraints_and_measures(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1), wb.Sphere(0.1)))
    q = scene.figure.neutral
    q[7] = 1.0
    problem = wb.Problem(
        scene, q,
        constraints=[wb.Hold("body0"), wb.Plane("body1", (0.0, 0.0, 1.0), side="above")],
        measures=[wb.tasks.Displacement(2.0), wb.Effort(3.0)],
    )  # fmt: skip
    moved = q.copy()
    moved[7:10] = 1.0, 0.2, 0.1
    found = wb.assess(problem, moved)
    assert found.constraint_violation == pytest.approx(0.0, abs=1e-12)  # above its plane, which is allowed
    assert found.measure == pytest.approx(2.0 * 1.05 + 3.0 * 0.05)
    moved[9] = -0.07
    assert wb.assess(problem, moved).constraint_violation == pytest.approx(0.07)
    moved[0] = 0.3
    assert wb.assess(problem, moved).constraint_violation == pytest.approx(0.3)


def arm_reaching(planar_arm, target, start, **options):
    return wb.Problem(wb.Scene(planar_arm(LENGTHS)), np.array(start), goals=[wb.Point("tip", target)], **options)


@pytest.mark.parametrize("most", [0.0, 0.3, 1.2])
def test_violations_of_many_postures_are_those_of_each(human, most):
    """Beyond limits, reach cones and feet, and through the table, that coal is asked for pair by pair."""
    scene = wb.Scene(human).add(wb.Box((0.5, 0.9, 0.03)), name="table", at=(0.5, 0.0, 0.8))
    problem = wb.Problem(scene, "standing", constraints=[wb.Hold("left_foot")], clearance=0.005)
    rng = np.random.default_rng(0)
    q = np.array([pin.integrate(human.model, problem.start, rng.uniform(-most, most, human.model.nv)) for _ in "12345"])
    each = [wb.assess(problem, one) for one in q]
    expected = [max(one.limit_violation, one.constraint_violation, one.clearance_violation) for one in each]
    np.testing.assert_allclose(violations(problem, q), expected, rtol=0.0, atol=1e-12)


def test_optimality_is_zero_where_no_motion_would_help(planar_arm):
    """Straight towards a goal out of reach is the nearest an arm can be; anything else is not."""
    problem = arm_reaching(planar_arm, (2.0 * np.cos(0.7), 2.0 * np.sin(0.7), 0.0), (0.1, 0.4))
    assert wb.assess(problem, np.array([0.7, 0.0])).optimality < 1e-9
    for off in ((0.1, 0.0), (0.0, 0.1), (0.05, -0.1)):
        assert wb.assess(problem, np.array([0.7, 0.0]) + off).optimality > 0.01


def test_optimality_counts_limits_that_push_back(planar_arm):
    figure = planar_arm(LENGTHS, limit=0.5)
    problem = wb.Problem(wb.Scene(figure), np.array([0.1, 0.2]), goals=[wb.Point("tip", (0.0, 2.0, 0.0))])
    assert wb.assess(problem, np.array([0.5, 0.5])).optimality < 1e-9
    assert wb.assess(problem, np.array([0.5, 0.3])).optimality > 0.01
    assert wb.assess(problem, np.array([-0.5, -0.5])).optimality > 0.01  # the limits push the other way


def test_optimality_of_measures_where_goals_are_met(planar_arm):
    """An arm with a joint to spare, at the least effort along its self-motion and beside it."""
    figure = planar_arm((0.5, 0.4, 0.3))
    start = np.array([0.1, 0.4, 0.3])
    problem = wb.Problem(wb.Scene(figure), start, goals=[wb.Point("tip", (0.4, 0.6, 0.0))])
    best, others = None, []
    for last in np.linspace(0.0, 3.0, 3001):
        wrist = np.array([0.4, 0.6]) - 0.3 * np.array([np.cos(last), np.sin(last)])
        reach = (wrist @ wrist - 0.5**2 - 0.4**2) / (2 * 0.5 * 0.4)
        if abs(reach) >= 1.0:
            continue
        bend = np.arccos(reach)
        turn = np.arctan2(wrist[1], wrist[0]) - np.arctan2(0.4 * np.sin(bend), 0.5 + 0.4 * np.cos(bend))
        q = np.array([turn, bend, last - turn - bend])
        others.append(q)
        if best is None or ((q - start) ** 2).sum() < ((best - start) ** 2).sum():
            best = q
    assert wb.assess(problem, best).goal_error < 1e-9
    assert wb.assess(problem, best).optimality < 2e-3  # of a search in steps of 1e-3
    far = max(others, key=lambda q: ((q - best) ** 2).sum())
    assert wb.assess(problem, far).optimality > 0.1


@pytest.mark.parametrize("shape", [wb.Box((0.2, 0.2, 0.2)), wb.Sphere(0.1)], ids=["box", "sphere"])
def test_optimality_counts_contacts_that_push_back(free_bodies, shape):
    """A body pressed onto a table by a goal below it can do no better; beside or above the goal it can."""
    scene = wb.Scene(free_bodies(shape)).add(wb.Box((2.0, 2.0, 0.1)), name="table", at=(0.0, 0.0, -0.05))
    start = scene.figure.neutral
    start[2] = 0.5
    problem = wb.Problem(scene, start, goals=[wb.Point("body0", (0.0, 0.0, -0.3))])

    def at(x, z):
        q = start.copy()
        q[0], q[2] = x, z
        return wb.assess(problem, q).optimality

    assert at(0.0, 0.1) < 1e-4
    assert at(0.1, 0.1) > 0.01
    assert at(0.0, 0.2) > 0.01


def test_gradients_of_the_gaps_against_finite_differences(free_bodies):
    """A ball on a ball, and both near a wall, at a chance turn: the gaps' derivatives in every direction."""
    scene = wb.Scene(free_bodies(wb.Sphere(0.1), wb.Sphere(0.07)))
    scene.add(wb.Box((0.1, 2.0, 2.0)), name="wall", at=(-0.15, 0.0, 0.0))
    q = scene.figure.neutral
    for body, place in ((0, (0.0, 0.0, 0.0)), (1, (-0.03, 0.0, 0.17))):
        q[7 * body : 7 * body + 3] = place
        q[7 * body + 3 : 7 * body + 7] = pin.Quaternion(pin.exp3(np.array([0.3, -0.5, 0.7]))).coeffs()
    pairs = AllPairs(scene.built)
    pairs.move(q)
    touching = np.flatnonzero(pairs.distance < 0.01)
    assert len(touching) == 3
    rows, _ = pairs.nearer(np.full(len(pairs.distance), 0.01)).gradients(pairs.state)
    differences = np.zeros((len(touching), scene.model.nv))
    for k in range(scene.model.nv):
        for sign in (1.0, -1.0):
            pairs.move(pin.integrate(scene.model, q, sign * 1e-6 * np.eye(scene.model.nv)[k]))
            differences[:, k] += sign * pairs.distance[touching] / 2e-6
    for expected in differences:
        assert np.abs(rows - expected).max(axis=1).min() < 1e-4
    for row in rows:
        assert np.abs(differences - row).max(axis=1).min() < 1e-2  # corners of patches lie beside the nearest points


@pytest.mark.parametrize("q", [np.zeros(3), np.array([0.0, np.nan]), np.array([[0.0, 0.0]])])
def test_what_is_no_posture_is_refused(planar_arm, q):
    problem = wb.Problem(wb.Scene(planar_arm(LENGTHS)))
    with pytest.raises(wb.InputError, match=r"a posture (has shape|entry)"):
        wb.assess(problem, q)


def test_clearances_are_read_afresh(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1))).add(wb.Sphere(0.1), name="ball", at=(0.25, 0.0, 0.0))
    problem = wb.Problem(scene)
    assert wb.assess(problem, problem.start).clearance_violation == 0.0
    problem.clearances += 0.1
    assert wb.assess(problem, problem.start).clearance_violation == pytest.approx(0.05, abs=1e-6)
    assert wb.solve(problem).q[0] == pytest.approx(-0.05, abs=1e-4)
    problem.clearances = np.zeros(2)
    with pytest.raises(wb.InputError, match="one for each of the 1 pairs"):
        wb.assess(problem, problem.start)
    with pytest.raises(wb.InputError, match="one for each of the 1 pairs"):
        wb.solve(problem)


def test_a_moved_thing_is_judged_where_it_is(free_bodies):
    scene = wb.Scene(free_bodies(wb.Sphere(0.1))).add(wb.Sphere(0.1), name="ball", at=(0.25, 0.0, 0.0))
    problem = wb.Problem(scene)
    for x in (0.15, 0.3, 0.12):
        scene.move("ball", at=(x, 0.0, 0.0))
        assert wb.assess(problem, problem.start).least_distance == pytest.approx(x - 0.2, abs=1e-9)


def cluttered(human, seed=0):
    """A person among boxes, some of which it is inside of, and postures about the start."""
    random, scene = np.random.default_rng(seed), wb.Scene(human)
    for number in range(12):
        at = random.uniform((-0.6, -0.6, 0.2), (0.6, 0.6, 1.6))
        scene.add(wb.Box(random.uniform(0.05, 0.3, 3)), name=f"box{number}", at=at)
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (0.4, -0.3, 1.0))], clearance=0.005)
    moved = [0.2 * random.standard_normal(human.model.nv) for _ in range(4)]
    return problem, [human.clamp(pin.integrate(human.model, problem.start, way)) for way in moved]


def test_all_distances_are_those_of_coal_pair_by_pair(human):
    problem, postures = cluttered(human)
    geometry, pairs = problem.scene.geometry, AllPairs(problem.scene.built)
    data, placed = human.model.createData(), pin.GeometryData(geometry)
    for q in postures:
        pairs.move(q)
        pin.forwardKinematics(human.model, data, q)
        pin.updateGeometryPlacements(human.model, data, geometry, placed)
        settle(geometry, placed)
        for number, pair in enumerate(geometry.collisionPairs):
            sides = [
                part
                for k in (pair.first, pair.second)
                for part in (
                    geometry.geometryObjects[k].geometry,
                    coal.Transform3s(placed.oMg[k].rotation, placed.oMg[k].translation),
                )
            ]
            found = coal.distance(*sides, coal.DistanceRequest(), coal.DistanceResult())
            assert pairs.distance[number] == pytest.approx(found, abs=2e-6)
        assert pairs.least == pairs.distance.min()


class Unmeasured(wb.Shape):
    """A shape of one's own that is broken: its radius is not a number."""

    def pieces(self):
        return (Piece(coal.Sphere(np.nan), pin.SE3.Identity(), 1.0),)


@pytest.mark.parametrize("many", [0, 3000])
def test_a_distance_that_is_not_a_number_is_refused(free_bodies, monkeypatch, many):
    """Also where most pairs are never asked for: where there are many."""
    monkeypatch.setattr("wholebody.assessment.all_pairs.MANY", many)
    scene = wb.Scene(free_bodies(wb.Sphere(0.1))).add(wb.Sphere(0.1), name="ball", at=(0.15, 0.0, 0.0))
    problem = wb.Problem(scene.add(Unmeasured(), name="broken", at=(0.0, 0.0, 2.0)))
    with pytest.raises(wb.InputError, match="a distance is not a number"):
        wb.assess(problem, problem.start)


def everything(found):
    """An assessment with what it computes when asked for."""
    return found, found.optimality, found.blockers


def test_a_judgement_does_not_depend_on_those_before_it(human):
    problem, postures = cluttered(human)
    alone = [wb.assess(cluttered(human)[0], q) for q in postures]
    for q, expected in reversed(list(zip(postures, alone, strict=True))):
        found = wb.assess(problem, q)
        assert everything(found) == everything(expected)


def test_optimality_and_blockers_are_of_the_moment_of_the_judgement(human):
    """Whatever moves or is changed before they are asked for; a pickled judgement has them too."""
    problem, postures = cluttered(human)
    q = postures[0]
    now, later = wb.assess(problem, q), wb.assess(problem, q)
    expected = now.optimality, now.blockers
    nearer = now.first_order.nearer
    assert expected[1]
    wb.assess(problem, postures[1])
    for number in range(12):
        problem.scene.move(f"box{number}", at=(5.0, 5.0, 5.0))
    problem.clearances += 0.1
    problem.retarget([wb.Point("left_index_tip", (0.0, 0.0, 0.0))])
    assert (later.optimality, later.blockers) == expected
    assert later.first_order.nearer == nearer
    restored = pickle.loads(pickle.dumps(now))
    assert restored == now
    assert (restored.optimality, restored.blockers) == expected
    assert restored.first_order.nearer == nearer
    assert restored.summary() == now.summary()
    assert now.summary()["blockers"][0]["names"] == expected[1][0].names
