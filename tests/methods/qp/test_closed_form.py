"""Closed forms of arms of random lengths, against Pinocchio's kinematics and against themselves."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
import scipy.optimize

import wholebody as wb
from wholebody.bench.suite.problem_sets.robots import known_arm
from wholebody.figures.description import Limits
from wholebody.methods.qp.chain import closed_form_postures
from wholebody.methods.qp.chain_goals_kernel import Goals
from wholebody.methods.qp.chain_problem import goal_entries
from wholebody.methods.qp.closed_form import compiled_kernel
from wholebody.methods.qp.closed_form_kernel import BRANCHES
from wholebody.methods.qp.plain_chain import WIDTHS, Chains, PlainChain
from wholebody.methods.qp.settings import SEEDS
from wholebody.terms.entries import placement_floats

X, Y, Z = np.eye(3)
TILTED = np.array([0.6, 0.0, 0.8])
# Axes at zero, and steps to each joint from the one before: 0 none, a free one, or along an axis.
ARMS = {
    "wrist, two parallel": ([Z, Y, Y, X, TILTED, X], ["free", "free", "free", "free", 0, 0]),
    "wrist, shoulder crossing": ([Z, Y, X, Z, TILTED, X], ["free", 0, "free", "free", 0, 0]),
    "three parallel": ([Z, Y, Y, -Y, Z, TILTED], ["free", "free", "free", "free", "free", Z]),
    "wrist at the base": ([X, TILTED, Z, Y, Y, X], ["free", 0, 0, "free", "free", "free"]),
    "straight wrist": ([Z, Y, X, X, Y, X], ["free", 0, "free", "free", 0, 0]),
    "straight wrist at the base": ([X, Y, X, Y, Y, Z], ["free", 0, 0, "free", "free", "free"]),
    "shoulder, elbow and wrist": ([Z, Y, Z, -Y, Z, Y, Z], ["free", 0, Z, Z, Z, 0, 0]),
    "elbow and end beside": ([Z, Y, Z, -Y, Z, Y, Z], ["free", 0, Z, "free", Z, 0, "free"]),
    "no shoulder": ([Z, Y, X, Y, X, Y, X], ["free", "free", X, X, X, 0, X]),
}


def placed(table: np.ndarray) -> Goals:
    """One placement with such floats (36,)."""
    nothing = [
        np.zeros((0, width), kind)
        for widths in [*WIDTHS.values()][1:]
        for width, kind in zip(widths, (float, np.int64), strict=True)
    ]
    return Goals(table[None], np.array([[0, 0, 0, 1, 1, 0]]), *nothing, np.zeros((1, 4)), np.zeros(6, dtype=bool))


def arm(name: str, rng: np.random.Generator, most: float = 2.0 * np.pi) -> tuple[pin.Model, PlainChain]:
    """An arm, in a base that is turned and moved."""
    model, parent = pin.Model(), 0
    for axis, step in zip(*ARMS[name], strict=True):
        free = rng.uniform(0.1, 0.5, 3)
        shift = free if isinstance(step, str) else free[0] * np.asarray(step) * np.ones(3)
        place = pin.SE3(pin.exp3(rng.normal(size=3)) if not parent else np.eye(3), shift)
        parent = model.addJoint(parent, pin.JointModelRevoluteUnaligned(axis), place, f"axis{parent}")
    index = np.arange(model.nq)
    limits = Limits(index, index, np.full(model.nq, -most), np.full(model.nq, most))
    return model, PlainChain(model, limits, tuple(range(1, model.nq + 1)))


def branches(figure: wb.Figure, frame: str, placement: pin.SE3, at: np.ndarray) -> np.ndarray:
    """Postures (k, nq) with a frame at a placement, by the closed form of its arm, the nearest to `at` (nq,) first."""
    # All with six joints, samples with seven, some off by what limits take away. None where it has no closed form.
    model = figure.model
    known = model.frames[figure.frame_id(frame)]
    chain = Chains(model, figure.limits).of(frozenset((known.parentJoint,)))
    if chain is None or chain.arm is None:
        return np.zeros((0, model.nq))
    floats = [placement_floats(known.placement), np.zeros(12), placement.translation, placement.rotation.ravel()]
    goals = placed(np.concatenate(floats))
    near = chain.angles(at)
    found = chain.branches(goals, np.array([near, np.zeros_like(near)]))
    order = found.effort.argsort()[: np.count_nonzero(found.effort < np.inf)]
    return np.array([chain.posture(values, at) for values in found.values[order]]).reshape(-1, model.nq)


def angles_of(chain: PlainChain, goal: np.ndarray, held: np.ndarray | None = None) -> np.ndarray:
    """Values (8 v, n) of all branches for a goal (36,), NaN for none, with (v,) values of a joint that is held."""
    values = np.ones(1) if held is None else held
    found = np.empty((len(values), BRANCHES, len(chain.idx_v)))
    compiled_kernel().branches(chain.arm, goal, values, found)
    return found.reshape(-1, len(chain.idx_v))


def goal_of(chain: PlainChain, place: pin.SE3, frame: pin.SE3) -> np.ndarray:
    """The goal that a frame in the last joint is at a placement, as the loops take it."""
    return np.array([*frame.rotation.T.ravel(), *frame.translation, *np.zeros(12), *place.translation,
                     *place.rotation.ravel()])  # fmt: skip


@pytest.mark.parametrize("name", ARMS)
def test_every_branch_is_a_posture_of_the_placement_and_the_known_one_is_among_them(name):
    rng = np.random.default_rng(7)
    for _ in range(3):
        model, chain = arm(name, rng)
        assert chain.arm is not None
        data = model.createData()

        def end(q: np.ndarray, frame: pin.SE3, model=model, data=data) -> pin.SE3:
            pin.forwardKinematics(model, data, q)
            return data.oMi[model.nq] * frame

        for _ in range(20):
            known, frame = rng.uniform(-3.0, 3.0, model.nq), pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
            place = end(known, frame)
            found = angles_of(chain, goal_of(chain, place, frame), known[[chain.held]] if chain.held >= 0 else None)
            real = found[np.isfinite(found).all(axis=1)]
            for q in real:
                np.testing.assert_allclose(end(q, frame).homogeneous, place.homogeneous, atol=1e-6)
            away = np.abs(np.angle(np.exp(1j * (real - known)))).max(axis=1)
            assert away.min() < 1e-5
            apart = np.abs(np.angle(np.exp(1j * (real[:, None] - real)))).max(axis=2)
            assert (apart[~np.eye(len(real), dtype=bool)] > 1e-5).all()  # and they differ


def test_an_arm_whose_axes_miss_each_other_has_none():
    figure, _ = known_arm("gen3")
    assert len(branches(figure, "tool", figure.placement(figure.neutral, "tool"), figure.neutral)) == 0


def test_branches_of_a_figure_are_within_limits_and_near_to_a_posture():
    figure, start = known_arm("ur5")
    place = figure.placement(start + 0.3, "tool")
    found = branches(figure, "tool", place, start)
    assert len(found) == 8
    for q in found:
        np.testing.assert_allclose(figure.placement(q, "tool").homogeneous, place.homogeneous, atol=1e-9)
        assert (figure.clamp(q) == q).all()
    far = np.abs(found - start)
    assert (far[:, [0, 1, 3, 4, 5]] <= np.pi + 1e-9).all()  # these could turn farther
    assert (np.diff(((found - start) ** 2).sum(axis=1)) >= 0.0).all()


def test_the_answer_of_six_joints_is_the_least_of_all_branches():
    figure, start = known_arm("ur10")
    rng, scene, free = np.random.default_rng(3), wb.Scene(figure), 0
    for _ in range(8):
        place = figure.placement(rng.uniform(-2.0, 2.0, 6), "tool")
        problem = wb.Problem(scene, start, goals=[wb.Frame("tool", place)], measures=[wb.tasks.Displacement()])
        judged = [wb.assess(problem, q) for q in branches(figure, "tool", place, figure.neutral)]
        if holding := [each.measure for each in judged if each.holds(1e-6)]:
            free += 1
            answer = wb.solve(problem)
            assert answer.solved
            assert answer.assessment.measure == pytest.approx(min(holding), rel=1e-5)
    assert free >= 4


def test_no_posture_of_seven_joints_that_is_free_takes_less_effort():
    """Against ten thousand values of the joint that the closed form holds; elbows at their limits are among them."""
    figure, rng = known_arm("panda")[0], np.random.default_rng(5)
    scene, least = wb.Scene(figure), []
    lower, upper = figure.limits.lower, figure.limits.upper
    chain = PlainChain(figure.model, figure.limits, tuple(range(1, 8)))
    for _ in range(25):
        start = rng.uniform(lower, upper)
        place = figure.placement(rng.uniform(lower, upper), "tool")
        problem = wb.Problem(scene, start, goals=[wb.Frame("tool", place)])
        solution = wb.solve(problem)
        assert solution.solved, solution.message
        weights = problem.measures[0].distance.weights
        values = np.linspace(lower[chain.held], upper[chain.held], 10_000)
        found = angles_of(chain, chain.goals(goal_entries(problem)).tables[0], values)
        found += 2.0 * np.pi * np.round((start - found) / (2.0 * np.pi))
        inside = ((found >= lower) & (found <= upper)).all(axis=1)
        effort = np.where(inside, (found - start) ** 2 @ weights, np.inf)
        for k in effort.argsort()[: min(2000, inside.sum())]:
            if wb.assess(problem, found[k]).holds(1e-6):
                least.append(solution.assessment.measure / effort[k])
                break
    assert len(least) > 20
    assert np.median(least) < 1.0001
    assert np.quantile(least, 0.9) < 1.01


def test_no_known_posture_of_a_stretched_arm_takes_much_less_effort():
    """A closed form that is only near lacks postures of an elbow that is nearly straight, alone and in a batch."""
    figure, rng = known_arm("gen3")[0], np.random.default_rng(0)
    scene, start, problems, known = wb.Scene(figure), figure.neutral + 0.3, list[wb.Problem](), list[float]()
    for _ in range(40):
        q = rng.uniform(-1.2, 1.2, 7)
        q[3] = rng.uniform(-0.1, 0.1)
        problem = wb.Problem(scene, start, goals=[wb.Frame("tool", figure.placement(q, "tool"))])
        if (judged := wb.assess(problem, q)).holds(1e-6):
            problems.append(problem)
            known.append(judged.measure)
    assert len(known) > 30
    answers, batch = [wb.solve(problem) for problem in problems], wb.solve_many(problems, jobs=1)
    assert all(answer.solved for answer in answers)
    ratios = np.array([answer.assessment.measure for answer in answers]) / known
    assert ratios.max() < 1.1
    for answer, record in zip(answers, batch, strict=True):
        np.testing.assert_array_equal(answer.q, record.q)


def test_goals_that_a_posture_reaches_are_never_proven_out_of_reach():
    """Postures at limits and where axes line up are among them; what is moved away is proven, and no search is made."""
    rng, proven = np.random.default_rng(8), 0
    for name in ("ur10", "z1"):
        figure = known_arm(name)[0]
        lower, upper = figure.limits.lower, figure.limits.upper
        chain, scene = PlainChain(figure.model, figure.limits, tuple(range(1, 7))), wb.Scene(figure)
        for number in range(60):
            q = rng.uniform(lower, upper)
            at = rng.integers(6)
            q[at] = (q[at], lower[at], upper[at], np.clip(0.0, lower[at], upper[at]))[number % 4]
            place = pin.SE3(figure.placement(q, "tool"))
            goals = chain.goals(goal_entries(wb.Problem(scene, goals=[wb.Frame("tool", place)])))
            found = chain.loosely_met(goals, 0)
            off = [np.abs(pin.log6(figure.placement(np.clip(each, lower, upper), "tool").actInv(place)).vector).max()
                   for each in found]  # fmt: skip
            assert min(off) < 0.05
            if number % 12 == 0:
                place.translation = 4.0 * place.translation / np.linalg.norm(place.translation)
                solution = wb.solve(wb.Problem(scene, goals=[wb.Frame("tool", place)]))
                proven += solution.status == "unreachable" and solution.iterations < 60
    assert proven == 10


@pytest.mark.parametrize("name", [name for name, (axes, _) in ARMS.items() if len(axes) == 6])
def test_joints_without_limits_are_not_out_of_reach(name):
    rng = np.random.default_rng(9)
    model, chain = arm(name, rng, np.inf)
    q, data = rng.uniform(-np.pi, np.pi, 6), model.createData()
    pin.forwardKinematics(model, data, q)
    table = goal_of(chain, data.oMi[6], pin.SE3.Identity())
    found = chain.loosely_met(placed(table), 0)
    assert np.abs(np.exp(1j * found) - np.exp(1j * q)).max(axis=1).min() < 1e-6


def test_a_goal_whose_every_posture_is_inside_of_a_thing_is_out_of_reach():
    figure = known_arm("ur10")[0]
    place = pin.SE3(figure.placement(np.array([0.3, -1.0, 1.2, -0.5, 1.3, 0.2]), "tool"))
    free = wb.Scene(figure)
    around = wb.Scene(figure).add(wb.Sphere(0.08), name="ball", at=place.translation)
    for scene, status in ((free, "solved"), (around, "unreachable")):
        solution = wb.solve(wb.Problem(scene, goals=[wb.Frame("tool", place)]))
        assert solution.status == status, solution.message
        assert solution.assessment.penetration < 1e-5
        assert solution.iterations < 100


def test_singular_placements_take_hardly_ever_more_effort_than_a_posture_that_is_known():
    """Of a wrist that is straight, whose last axis is parallel to three others: of 60 five or six did, one does."""
    for name in ("ur5", "ur10"):
        figure, start = known_arm(name)
        scene, rng, more = wb.Scene(figure), np.random.default_rng(5), list[bool]()
        for known in rng.uniform(-2.5, 2.5, (60, 6)) * (1, 1, 1, 1, 0, 1):
            problem = wb.Problem(scene, start, goals=[wb.Frame("tool", figure.placement(known, "tool"))])
            if not len(scene.contacts(known, 0.0).number):
                more.append(wb.solve(problem).assessment.measure > 1.001 * wb.assess(problem, known).measure)
        assert len(more) > 30
        assert sum(more) <= 1


def singular_posture(name: str, model: pin.Model, rng: np.random.Generator) -> np.ndarray:
    """A posture (6,) with a straight wrist, or of "z1" with the crossing of its last axes above the first one."""
    q, data = rng.uniform(-2.5, 2.5, 6), model.createData()
    if name != "z1":
        q[1 if "base" in name else 4] = 0.0
        return q

    def away(second: float) -> float:
        pin.forwardKinematics(model, data, np.array([0.0, second, *q[2:]]))
        return float(data.oMi[5].translation[0])

    q = rng.uniform(model.lowerPositionLimit, model.upperPositionLimit)
    q[2] = rng.uniform(-1.5, -1.0)
    q[1] = scipy.optimize.brentq(away, 0.0, 2.9, xtol=1e-14)
    return q


@pytest.mark.parametrize("name", ["wrist, two parallel", "straight wrist", "straight wrist at the base", "ur5", "z1"])
def test_samples_of_a_singular_placement_are_postures_of_it_all_the_way_to_the_one_that_is_known(name):
    rng = np.random.default_rng(3)
    for _ in range(5):
        if name in ARMS:
            model, chain = arm(name, rng, np.pi)
        else:
            model = (figure := known_arm(name)[0]).model
            chain = PlainChain(model, figure.limits, tuple(range(1, 7)))
        known, data, away = singular_posture(name, model, rng), model.createData(), np.inf
        pin.forwardKinematics(model, data, known)
        place = pin.SE3(data.oMi[6])
        found = chain.singular(placed(goal_of(chain, place, pin.SE3.Identity())), np.array([known, np.ones(6)]))
        for q in found:
            pin.forwardKinematics(model, data, q)
            away = min(away, np.abs(np.angle(np.exp(1j * (q - known)))).max())
            assert np.abs(pin.log6(data.oMi[6].actInv(place)).vector).max() < 1e-7
        assert away < 0.1, name
        assert len(found) > 15


def test_no_singular_placement_that_is_known_to_be_free_is_out_of_reach():
    """Random boxes leave the known posture free: of 1,000 such placements of an arm 24 and 37 were called so."""
    for name, seeds in (("ur10", (2, 5, 17, 95, 114, 138)), ("ur5", (138, 169, 209))):
        figure, start = known_arm(name)
        for seed in seeds:
            rng, scene = np.random.default_rng(seed), wb.Scene(figure)
            known = rng.uniform(-2.5, 2.5, 6) * (1, 1, 1, 1, 0, 1)
            places = [np.asarray(figure.placement(known, joint).translation) for joint in figure.joints]
            for number in range(int(rng.integers(15, 40))):
                at = places[int(rng.integers(0, 6))] + rng.normal(0.0, 0.15, 3)
                trial, box = wb.Scene(figure), wb.Box(tuple(rng.uniform(0.05, 0.3, 3)))
                if not len(trial.add(box, name="box", at=at).contacts(known, 0.0).number):
                    scene.add(box, name=f"box {number}", at=at)
            problem = wb.Problem(scene, start, goals=[wb.Frame("tool", figure.placement(known, "tool"))])
            assert wb.assess(problem, known).holds(1e-6)
            assert wb.solve(problem).solved


def test_goals_that_hardly_overlap_are_out_of_reach_and_missed_by_no_more_than_what_is_free_beside_them():
    """Random goals whose postures overlap themselves, one by 4 to 6 mm; what is free beside them is sampled."""
    figure, start = known_arm("ur5")
    scene, rng = wb.Scene(figure), np.random.default_rng(0)
    known = rng.uniform(-np.pi, np.pi, (2500, 6))
    for number in (51, 854, 2400, 2478):
        problem = wb.Problem(scene, start, goals=[wb.Frame("tool", figure.placement(known[number], "tool"))])
        solution = wb.solve(problem)
        assert solution.status == "unreachable"
        assert solution.iterations < 120
        assert solution.assessment.penetration < 1e-5
        branches = closed_form_postures(problem, 8)[0]
        near = branches[:, None] + rng.normal(0.0, 0.03, (len(branches), 200, 6))
        free = [q for q in near.reshape(-1, 6) if not len(scene.contacts(q, 0.0).number)]
        assert len(free) > 50
        assert solution.assessment.goal_error <= min(wb.assess(problem, q).goal_error for q in free)


@pytest.mark.parametrize("name", ["panda", "xarm7", "gen3"])
def test_a_goal_that_seven_joints_meet_nowhere_free_is_missed_by_no_more_than_from_random_starts(name):
    """A random goal whose known posture overlaps the arm; a search from forty starts solved none of such either."""
    figure, start = known_arm(name)
    scene, rng = wb.Scene(figure), np.random.default_rng(4)
    lower, upper = np.maximum(figure.limits.lower, -np.pi), np.minimum(figure.limits.upper, np.pi)
    solved = True
    while solved:
        place = figure.placement(rng.uniform(lower, upper), "tool")
        problem = wb.Problem(scene, start, goals=[wb.Frame("tool", place)])
        solved = (solution := wb.solve(problem)).solved
    assert solution.assessment.holds(1e-5)
    assert solution.iterations < 400
    alone = wb.methods.QP(restarts=0, measures=False)
    others = [wb.solve(problem.with_start(q), alone).assessment for q in rng.uniform(lower, upper, (8, 7))]
    assert solution.assessment.goal_error <= 1.1 * min(each.goal_error for each in others if each.holds(1e-5))


def test_the_nearest_of_a_goal_inside_of_a_thing_is_chosen_among_all_ends(monkeypatch):
    """Also where the first of them meets the goal, inside of the thing: the others would be what memory held before."""
    figure, counted = known_arm("ur10")[0], []
    place = pin.SE3(figure.placement(np.array([0.3, -1.0, 1.2, -0.5, 1.3, 0.2]), "tool"))
    descents = PlainChain.descents

    def told(self, *given):
        found = descents(self, *given)
        counted.append((len(given[4][0]), int(found[1][0])))
        return found

    monkeypatch.setattr(PlainChain, "descents", told)
    around = wb.Scene(figure).add(wb.Sphere(0.08), name="ball", at=place.translation)
    assert wb.solve(wb.Problem(around, goals=[wb.Frame("tool", place)])).status == "unreachable"
    assert counted[-1] == (SEEDS.together, SEEDS.together)


def test_descents_of_an_arm_whose_axes_nearly_cross_begin_near_all_its_postures():
    figure, start = known_arm("gen3")
    chain, rng = PlainChain(figure.model, figure.limits, tuple(range(1, 8))), np.random.default_rng(2)
    assert chain.arm is None
    near = 0
    for _ in range(20):
        known = rng.uniform(-1.5, 1.5, 7)
        place = figure.placement(known, "tool")
        problem = wb.Problem(wb.Scene(figure), start, goals=[wb.Frame("tool", place)])
        goals, found = chain.goals(goal_entries(problem)), np.empty((1, BRANCHES, 7))
        compiled_kernel().branches(chain.guide, goals.tables[0], known[[chain.held]], found)
        away = np.abs(np.angle(np.exp(1j * (found[0] - known)))).max(axis=1)
        near += bool(np.nanmin(away, initial=9.0) < 0.2)
        end = figure.placement(wb.solve(problem).q, "tool")
        np.testing.assert_allclose(end.homogeneous, place.homogeneous, atol=2e-5)
    assert near >= 15


@pytest.mark.parametrize("name", ["panda", "gen3"])
def test_where_an_end_is_blocked_nothing_free_beside_the_answer_takes_less_effort(name):
    """Of an arm with a closed form, and of one that is only near to it: along the curve on which the tool rests."""
    figure, start = known_arm(name)
    rng, among, followed = np.random.default_rng(7), wb.Scene(figure), 0
    among.add(wb.Box((0.5, 0.9, 0.03)), name="table", at=(0.55, 0.0, 0.35))
    lower, upper, tool = *np.clip([figure.limits.lower, figure.limits.upper], -2.0, 2.0), figure.frame_id("tool")
    for _ in range(80):
        place = figure.placement(rng.uniform(lower, upper), "tool")
        goals = [wb.Frame("tool", place)]
        alone = wb.solve(wb.Problem(wb.Scene(figure), start, goals=goals)).assessment.measure
        answer = wb.solve(problem := wb.Problem(among, start, goals=goals))
        if not answer.solved or answer.assessment.measure < 1.01 * alone:
            continue  # nothing blocks it
        followed += 1
        for sign in (1.0, -1.0):
            q, before = answer.q, None
            for _ in range(15):
                jacobian = pin.computeFrameJacobian(figure.model, figure.model.createData(), q, tool, pin.LOCAL)
                along = np.linalg.svd(jacobian)[2][-1]
                along = sign * along if before is None else along * np.sign(before @ along)
                before = along

                def off(x, q=q, along=along, place=place):
                    away = pin.log6(figure.placement(x, "tool").actInv(place)).vector
                    return [*away, along @ (x - q) - 0.02]

                q = scipy.optimize.root(off, q + 0.02 * along).x
                judged = wb.assess(problem, q)
                if not judged.holds(1e-6):
                    break
                assert judged.measure > answer.assessment.measure * (1.0 - 1e-4)
        if followed == 2:
            break
    assert followed == 2
