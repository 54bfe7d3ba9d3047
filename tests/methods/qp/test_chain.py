"""Compiled descents of plain chains against Pinocchio, the textbook method and scipy, and when an end is taken."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize

import wholebody as wb
from wholebody.bench.suite.problem_sets import robots
from wholebody.bench.suite.stability.bodies import spatial_arm
from wholebody.figures.description import Limits
from wholebody.figures.state import State
from wholebody.methods.control import Control
from wholebody.methods.damped_least_squares import DampedLeastSquares
from wholebody.methods.qp import chain_goals_kernel
from wholebody.methods.qp.chain import from_seeds
from wholebody.methods.qp.chain_problem import Asked, chains_of, goal_entries, how_far
from wholebody.methods.qp.plain_chain import Chains, PlainChain
from wholebody.methods.qp.settings import Settings
from wholebody.tasks.base import Goal
from wholebody.terms.entries import RESIDUAL, Entry

START = np.array([-0.4, 0.5, 0.9, 0.0, 0.5, 0.0])


@pytest.fixture(scope="module")
def arm() -> wb.Figure:
    return spatial_arm()


def found(problem: wb.Problem, tolerance: float = 1e-6, *, measures: bool = False, progress=None):
    settings = Settings(tolerance=tolerance, iterations=60, measures=measures)
    with problem.borrow() as workspace:
        return from_seeds(problem, workspace, settings, Control(progress=progress))


def whole_chain(model: pin.Model, limits: Limits) -> PlainChain:
    return PlainChain(model, limits, tuple(range(1, model.njoints)))


def place_of(figure: wb.Figure, q: np.ndarray, frame: str) -> pin.SE3:
    return pin.SE3(State(figure.model).update(q).frame(figure.frame_id(frame)))


def random_goal(figure: wb.Figure, frame: str, rng: np.random.Generator, turned: bool) -> Goal:
    q = rng.uniform(figure.model.lowerPositionLimit, figure.model.upperPositionLimit)
    place = place_of(figure, q, frame)
    return wb.Frame(frame, place) if turned else wb.Point(frame, place.translation)


def test_joints_are_where_pinocchio_has_them():
    """Axes along and across the frames, slides and branches, each joint turned against the one before."""
    model, rng = pin.Model(), np.random.default_rng(3)
    oblique = np.array([1.0, 2.0, -1.0]) / 6**0.5
    kinds = [
        pin.JointModelRX(), pin.JointModelPZ(), pin.JointModelRevoluteUnaligned(oblique), pin.JointModelRY(),
        pin.JointModelPrismaticUnaligned(oblique), pin.JointModelRZ(),
    ]  # fmt: skip
    for number, (kind, parent) in enumerate(zip(kinds, (0, 1, 2, 2, 4, 5), strict=True)):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        place = pin.SE3(turn * np.sign(np.linalg.det(turn)), rng.normal(size=3))
        model.addJoint(parent, kind, place, f"joint {number}")
    chain = whole_chain(model, Limits(*np.zeros((2, 0), dtype=np.intp), *np.zeros((2, 0))))
    state, room, goals = State(model), chain.room(0), chain.goals([])
    for _ in range(20):
        q = rng.uniform(-3.0, 3.0, model.nq)
        chain_goals_kernel.evaluate(chain.chain, goals, room, q)
        state.update(q)
        np.testing.assert_allclose(room.joints, state.joints, atol=1e-13)
        np.testing.assert_allclose(room.columns, state.columns, atol=1e-13)


def test_rows_of_goals_are_derivatives_of_their_errors(two_arms):
    """By central differences of the errors that the goals themselves compute, one goal relative to the other arm."""
    rng = np.random.default_rng(5)
    start = rng.uniform(-1.0, 1.0, 7)
    axes = [wb.Axis("left", (1, 2, 3), direction=(0, 1, 1)), wb.Axis("right", (1, 0, 0), toward=(0.1, 0.2, 0.9))]
    goals = [random_goal(two_arms, "left", rng, True), *axes, wb.Relative("right", "left", (0.1, 0.2, 0.3))]
    goals.append(wb.CenterOfMass((0.1, 0.2, 0.3)))
    plane = wb.Plane("right", (1.0, -2.0, 0.5), point=(0.1, 0.0, 0.4))
    problem = wb.Problem(wb.Scene(two_arms), start, goals=goals, constraints=[plane])
    chain, kernel = whole_chain(two_arms.model, two_arms.limits), chain_goals_kernel
    entries = chain.goals(goal_entries(problem))
    room = chain.room(20)
    kernel.evaluate(chain.chain, entries, room, start)
    kernel.evaluate_others(chain.chain, entries, room)
    kernel.rows_of(chain.chain, entries, room)
    kernel.rows_of_others(chain.chain, entries, room)
    state = State(two_arms.model)

    def errors(q):
        state.update(q)
        return np.concatenate([*(goal.error(state) for goal in problem.goals), problem.constraints[0].value(state)])

    np.testing.assert_allclose(room.value, errors(start), atol=1e-12)
    step = 1e-6
    for joint, row in enumerate(np.eye(7) * step):
        slope = (errors(start + row) - errors(start - row)) / (2.0 * step)
        np.testing.assert_allclose(room.jacobian[:, joint], slope, atol=1e-6)


def test_what_other_joints_move_is_not_moved_by_the_chain_alone(two_arms):
    """Joints beside the chain are turned at random: what they leave in its place is what the chain alone moves."""
    model, rng = two_arms.model, np.random.default_rng(2)
    joints = [number for number, name in enumerate(model.names) if number and not name.startswith("right")]
    chain = PlainChain(model, two_arms.limits, tuple(joints))
    q = rng.uniform(model.lowerPositionLimit, model.upperPositionLimit)
    other = chain.posture(chain.angles(q), rng.uniform(model.lowerPositionLimit, model.upperPositionLimit))
    first, second = (State(model).update(each).joints.copy() for each in (q, other))
    stays = np.abs(first - second).max(axis=(1, 2)) < 1e-12
    assert stays.sum() == 5
    np.testing.assert_array_equal(chain.alone, stays)


def descended(chain, goals, nearest, asked, seeds):
    """What descents from seeds (k, n), which become where they end, find (k, 4)."""
    return chain.descents(goals.tables[None], goals, nearest[None], asked, seeds[None], len(seeds))[0][0]


def test_scenes_of_a_figure_share_its_chains(arm):
    """What stands around changes the answer and no chain; another figure, here with other limits, has its own."""
    rng = np.random.default_rng(5)
    goal, start = random_goal(arm, "tip", rng, False), np.zeros(arm.model.nq)
    alone = wb.Problem(wb.Scene(arm), start, goals=[goal])
    free = wb.solve(alone)
    elbow = State(arm.model).update(free.q).joints[3, 3]
    among = wb.Problem(wb.Scene(arm).add(wb.Sphere(0.05), name="ball", at=elbow), start, goals=[goal])
    assert wb.solve(among).solved
    assert not np.allclose(wb.solve(among).q, free.q, atol=1e-3)
    assert np.array_equal(wb.solve(alone).q, free.q)
    assert chains_of(alone) is chains_of(among)
    assert chains_of(alone) is not chains_of(wb.Problem(wb.Scene(spatial_arm()), start, goals=[goal]))


@pytest.mark.parametrize("turned", [False, True])
def test_steps_are_those_of_the_textbook_method(arm, two_arms, turned):
    """`DampedLeastSquares` is an array version of the same steps, with kinematics and rows by Pinocchio."""
    rng, stopped = np.random.default_rng(7), 0
    for number in range(20):
        figure, frame = (arm, "tip") if number % 2 else (two_arms, "left")
        start = rng.uniform(figure.model.lowerPositionLimit, figure.model.upperPositionLimit)
        problem = wb.Problem(wb.Scene(figure), start, goals=[random_goal(figure, frame, rng, turned)])
        entries = goal_entries(problem)
        chain = Chains(figure.model, figure.limits).of(frozenset(entry.integers[0] for entry in entries))
        values = chain.angles(start)
        for most in (1, 2, 3):
            seeds, asked = values[None].copy(), np.array([1e-12, 1e-6, most, 1.0, 0.0])
            ends = descended(chain, chain.goals(entries), np.array([values, np.zeros(len(values))]), asked, seeds)
            q = chain.posture(seeds[0], start)
            textbook = DampedLeastSquares(iterations=most, tolerance=1e-9).solve(problem)
            if ends[0, 0] == pytest.approx(max(textbook.assessment.goal_errors), rel=1.0):
                stopped += bool(np.isin(q, (*figure.limits.lower, *figure.limits.upper)).any())
                np.testing.assert_allclose(q, textbook.q, atol=1e-9)
    assert stopped > 0, "some steps end at limits"


def test_inequalities_that_are_met_all_the_way_change_no_descent(arm):
    """Also where joints are stopped at their limits: what these miss is no error of a row that does not count."""
    rng = np.random.default_rng(0)
    lower, upper = arm.model.lowerPositionLimit, arm.model.upperPositionLimit
    ground = wb.Plane("tip", (0, 0, 1), point=(0.0, 0.0, -9.0), side="above")
    for _ in range(40):
        goals, start = [random_goal(arm, "tip", rng, False)], rng.uniform(lower, upper)
        ends = []
        for constraints in ([], [ground]):
            problem = wb.Problem(wb.Scene(arm), start, goals=goals, constraints=constraints)
            entries, end = goal_entries(problem), start[None, None].copy()
            with chains_of(problem).borrow() as chains:
                chain = chains.carrying(entries)
                asked = Asked.by(problem, chain, entries, None)
                assert len(asked.goals.one_sided) == 3 + len(constraints)
                chain.descents(
                    asked.goals.tables[None], asked.goals, np.zeros((1, 2, 6)), how_far(Settings(), 1), end, 1
                )
            ends.append(end[0, 0])
        np.testing.assert_allclose(*ends, atol=1e-9)


def test_what_is_found_is_at_the_goal_to_rounding(arm):
    rng, count = np.random.default_rng(11), 0
    for _ in range(40):
        goal = random_goal(arm, "tip", rng, True)
        met = found(wb.Problem(wb.Scene(arm), START, goals=[goal]))
        if met is not None and not met.near:
            count += 1
            off = pin.log6(place_of(arm, met.q, "tip").actInv(pin.SE3(goal.target))).vector
            assert np.abs(off).max() < 1e-9
            assert (arm.limits.lower <= met.q).all()
            assert (met.q <= arm.limits.upper).all()
            assert met.trace[-1].goal_error < 1e-9
    assert count > 20


def blocked_by_a_ball(arm, radius=0.03):
    """A problem whose answer of least effort has a ball in its forearm; that answer is found without the ball."""
    goal = place_of(arm, np.array([0.4, 0.8, 0.9, 0.0, 0.5, 0.0]), "tip").translation
    met = found(wb.Problem(wb.Scene(arm), START, goals=[wb.Point("tip", goal)]), measures=True)
    assert met is not None
    middle = np.array(State(arm.model).update(met.q).data.oMi[4].translation)
    scene = wb.Scene(arm).add(wb.Sphere(radius), name="ball", at=middle)
    return wb.Problem(scene, START, goals=[wb.Point("tip", goal)]), met


def test_an_end_inside_of_something_is_rejected(arm):
    """Without measures another end is the answer; with them the search begins at the rejected one too."""
    problem, _ = blocked_by_a_ball(arm)
    met = found(problem)
    assert wb.assess(problem, met.q).met(1e-6)
    assert wb.assess(problem, met.q).holds(1e-6)
    measured = found(problem, measures=True)
    if measured.blocked is not None:
        assert wb.assess(problem, measured.blocked).penetration > 1e-4
    solution = wb.methods.QP().solve(problem)
    assert solution.solved, solution.message
    assert solution.assessment.penetration < 1e-5
    end = measured.q if measured.free is None else measured.free
    assert solution.assessment.measure <= wb.assess(problem, end).measure + 1e-6


def test_an_end_that_an_inequality_forbids_is_rejected(arm):
    """A link is below a plane at the end of least effort, and above it at the answer."""
    goal = wb.Point("tip", place_of(arm, np.array([0.4, 0.8, 0.9, 0.0, 0.5, 0.0]), "tip").translation)
    free = wb.solve(wb.Problem(wb.Scene(arm), START, goals=[goal]))
    height = place_of(arm, free.q, "pitch_link").translation[2] + 0.02
    above = wb.Plane("pitch_link", (0, 0, 1), point=(0.0, 0.0, height), side="above")
    problem = wb.Problem(wb.Scene(arm), START, goals=[goal], constraints=[above])
    assert place_of(arm, found(problem).q, "pitch_link").translation[2] >= height - 1e-6
    solution = wb.methods.QP().solve(problem)
    assert solution.solved, solution.message
    assert solution.assessment.measure >= free.assessment.measure


def test_arms_of_seven_joints_turn_out_of_what_an_inequality_rejects():
    """Descents from the start, from a posture that meets all and from random ones end at no less effort."""
    figure, start = robots.known_arm("iiwa7")
    rng, limits = np.random.default_rng(0), (figure.limits.lower, figure.limits.upper)
    for _ in range(12):
        there, others = rng.uniform(*limits), rng.uniform(*limits, (4, 7))
        elbow = tuple(place_of(figure, there, "link4").translation - (0.0, 0.0, 0.005))
        goal = wb.Frame("tool", place_of(figure, there, "tool"))
        above = wb.Plane("link4", (0, 0, 1), point=elbow, side="above")
        problem = wb.Problem(wb.Scene(figure), start, goals=[goal], constraints=[above])
        ends = [end for end in wb.methods.QP().minima(problem, [start, there, *others]) if end.solved]
        if ends:
            least = min(end.assessment.measure for end in ends)
            assert wb.solve(problem).assessment.measure <= 1.1 * least


def test_the_closest_posture_within_an_inequality_is_sought_along_it():
    """A tool is asked for in the middle of a ball: no posture is nearer than 0.1 m, and some hardly farther."""
    figure, start = robots.known_arm("ur5")
    rng = np.random.default_rng(1)
    for _ in range(5):
        there = np.clip(rng.uniform(-2.0, 2.0, 6), figure.limits.lower, figure.limits.upper)
        tool, frame = place_of(figure, there, "tool"), list(figure.frames)[len(figure.frames) // 2]
        scene = wb.Scene(figure).add(wb.Sphere(0.1), name="ball", at=tuple(tool.translation))
        low = tuple(place_of(figure, there, frame).translation - (0.0, 0.0, 0.01))
        above = wb.Plane(frame, (0, 0, 1), point=low, side="above")
        solution = wb.solve(wb.Problem(scene, start, goals=[wb.Frame("tool", tool)], constraints=[above]))
        assert solution.status == "unreachable"
        assert "contradicts itself" in solution.message
        assert 0.0999 <= solution.assessment.goal_errors[0] <= 0.12


def test_rows_that_are_the_same_leave_joints_free():
    """A rotation that is asked for and held too leaves an arm of seven joints as much room as one of them."""
    figure, start = robots.known_arm("panda")
    rng, blocked = np.random.default_rng(0), 0
    for _ in range(29):
        there = rng.uniform(figure.limits.lower, figure.limits.upper)
        tool, elbow = place_of(figure, there, "tool"), place_of(figure, there, "link4").translation
        scene = wb.Scene(figure).add(wb.Sphere(0.05), name="ball", at=tuple(elbow + (0.0, 0.0, 0.25)))
        goals = [wb.Point("tool", tool.translation), wb.Orientation("tool", tool.rotation)]
        once = wb.Problem(scene, start, goals=goals)
        twice = wb.Problem(scene, start, goals=goals, constraints=[wb.Hold("tool", at=tool, orientation=False)])
        met = found(once, measures=True)
        if met is not None and met.through is not None:
            blocked += 1
            assert wb.solve(twice).assessment.measure <= 1.01 * wb.solve(once).assessment.measure
    assert blocked >= 2


def test_ends_with_frozen_joints_are_of_least_effort(arm):
    """No limit holds what is frozen: neither does the effort pull it off, nor are other joints left at theirs."""
    rng, limits = np.random.default_rng(1), arm.limits
    for joint in arm.joints:
        start, there = rng.uniform(limits.lower, limits.upper, (2, len(limits.lower)))
        there[arm.dofs([joint])] = start[arm.dofs([joint])]
        goal = wb.Point("tip", place_of(arm, there, "tip").translation)
        problem = wb.Problem(wb.Scene(arm), start, goals=[goal], constraints=[wb.Freeze(joint)])
        met = found(problem, measures=True)
        assert met.stationary, joint
        assert wb.assess(problem, met.q).optimality < 1e-4, joint


class Root(wb.Constraint):
    """A square root of how far the shoulder is from an angle, no number beyond."""

    lower, upper = np.zeros(1), np.full(1, np.inf)

    def value(self, state):
        return np.array([0.8 - state.q[1]]) ** 0.5

    def jacobian(self, state):
        return np.array([[0.0, -0.5 / max(0.8 - state.q[1], 1e-9) ** 0.5, 0.0, 0.0, 0.0, 0.0]])


class Barrier(wb.Measure):
    """A logarithm of that, no number beyond, and the square of all angles."""

    def value(self, state):
        return float(state.q @ state.q - np.log(0.8 - state.q[1]))

    def gradient(self, state):
        return 2.0 * state.q + np.eye(6)[1] / (0.8 - state.q[1])

    def curvature(self, state):
        return np.full(6, 2.0)


@pytest.mark.filterwarnings("ignore:invalid value")
@pytest.mark.parametrize("terms", [{"constraints": [Root()]}, {"measures": [Barrier()]}])
def test_ends_where_a_term_of_ones_own_is_undefined_are_no_answers(arm, terms):
    """Witnesses are defined; a descent from the start finds about as little effort as from seeds."""
    rng, limits = np.random.default_rng(0), arm.limits
    for _ in range(8):
        there = rng.uniform(limits.lower, limits.upper)
        there[1] = min(there[1], 0.79)
        problem = wb.Problem(
            wb.Scene(arm), START, goals=[wb.Point("tip", place_of(arm, there, "tip").translation)], **terms
        )
        solution = wb.methods.QP().solve(problem)
        assert solution.solved, solution.message
        assert solution.q[1] <= 0.8
        end = next(iter(wb.methods.QP().minima(problem, [START])))
        assert not end.solved or solution.assessment.measure <= 1.2 * end.assessment.measure


def test_where_all_ends_of_least_effort_are_blocked_one_of_more_effort_is_found():
    """Of what reaches into a shelf, ends of least effort come from below, through a board."""
    rng, reached = np.random.default_rng(3), 0
    for _ in range(24):
        problem, _ = robots.into("shelf", 7, rng)
        met = found(problem, measures=True)
        if met is None or met.free is None:
            continue
        reached += 1
        np.testing.assert_array_equal(met.begins, [problem.start, met.free])
        judged = wb.assess(problem, met.free)
        assert judged.met(1e-6)
        assert judged.holds(0.0)
        assert not met.complete
        assert wb.solve(problem).solved
    assert reached >= 2


def test_a_clearance_that_is_missed_counts_as_something_in_the_way(arm):
    goal = place_of(arm, np.array([0.4, 0.8, 0.9, 0.0, 0.5, 0.0]), "tip").translation
    scene = wb.Scene(arm).add(wb.Sphere(0.02), name="ball", at=tuple(goal + (0.0, 0.0, 0.15)))
    for clearance in (0.0, 0.03, 0.06):
        problem = wb.Problem(scene, START, goals=[wb.Point("tip", goal)], clearance=clearance)
        assert wb.assess(problem, found(problem).q).clearance_violation == 0.0


def test_arms_that_hold_each_other_are_brought_to_a_goal(arm):
    scene = wb.Scene({"one": arm, "other": (arm, (0.7, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0))})
    figure, rng = scene.figure, np.random.default_rng(5)
    witnesses = rng.uniform(figure.model.lowerPositionLimit, figure.model.upperPositionLimit, (40, figure.model.nq))
    free = [q for q in witnesses if not scene.penetration(q)]
    assert len(free) > 5
    for q in free:
        goal, held = (place_of(figure, q, f"{name}/tip") for name in ("one", "other"))
        grip = wb.Hold("other/tip", at=goal.inverse() * held, relative_to="one/tip")
        met = found(wb.Problem(scene, goals=[wb.Frame("one/tip", goal)], constraints=[grip]))
        assert met is not None
        for name, place in (("one", goal), ("other", held)):
            assert np.linalg.norm(pin.log6(place.actInv(place_of(figure, met.q, f"{name}/tip"))).vector) < 1e-5


def test_goals_out_of_reach_are_left_to_the_search(arm):
    problem = wb.Problem(wb.Scene(arm), START, goals=[wb.Point("tip", (3.0, 0.0, 0.5))])
    assert found(problem) is None
    assert wb.methods.QP().solve(problem).status == "unreachable"


def test_what_it_does_not_know_it_does_not_take(arm):
    class Own(wb.Point):
        """A goal of one's own."""

    point, scene = wb.Point("tip", (0.4, 0.2, 0.6)), wb.Scene(arm)
    stated = {
        "a point": (True, wb.Problem(scene, START, goals=[point])),
        "two goals": (True, wb.Problem(scene, START, goals=[point, wb.Orientation("tip", np.eye(3))])),
        "no goals": (False, wb.Problem(scene, START)),
        "a hold": (True, wb.Problem(scene, START, goals=[point], constraints=[wb.Hold("tip", orientation=False)])),
        "an axis": (True, wb.Problem(scene, START, goals=[point, wb.Axis("tip", (0, 0, 1), toward=(1.0, 0.0, 0.0))])),
        "a frozen joint": (True, wb.Problem(scene, START, goals=[point], constraints=[wb.Freeze("base")])),
        "a plane": (True, wb.Problem(scene, START, goals=[point], constraints=[wb.Plane("tip", normal=(0, 0, 1))])),
        "a centre of mass": (True, wb.Problem(scene, START, goals=[point, wb.CenterOfMass((0, 0, 0), axes="xy")])),
        "a posture": (False, wb.Problem(scene, START, goals=[point, wb.Posture(START)])),
        "a side of it": (
            True,
            wb.Problem(scene, START, goals=[point], constraints=[wb.Plane("tip", normal=(0, 0, 1), side="above")]),
        ),
        "bounded steps": (False, wb.Problem(scene, START, goals=[point], constraints=[wb.tasks.StepLimit(1.0)])),
        "a goal of one's own": (False, wb.Problem(scene, START, goals=[Own("tip", (0.4, 0.2, 0.6))])),
    }
    for what, (known, problem) in stated.items():
        assert (goal_entries(problem) is not None) == known, what
    avatar = wb.load("avatar")
    free_root = wb.Problem(wb.Scene(avatar), goals=[wb.Point("right_palm", (0.4, -0.2, 1.0))], range_of_motion=False)
    assert found(free_root) is None


@pytest.mark.parametrize(
    "kind",
    ["point", "placement", "point and axis", "axis towards a place", "frozen", "plane", "sides", "centre of mass"],
)
def test_the_effort_is_as_little_as_scipy_finds_from_many_starts(arm, kind):
    """The posture is stationary too; more starts for the measure find the best of all."""
    rng, state = np.random.default_rng(23), State(arm.model)
    lower, upper = arm.model.lowerPositionLimit.copy(), arm.model.upperPositionLimit.copy()
    for _ in range(1):
        goals, still, there = [random_goal(arm, "tip", rng, kind == "placement")], [], START
        if "axis" in kind:
            way = {"direction": (1.0, 2.0, -1.0)} if kind == "point and axis" else {"toward": (0.1, 0.2, 1.5)}
            goals.append(wb.Axis("tip", (0, 0, 1), **way))
        elif kind == "frozen":
            lower[3] = upper[3] = START[3]
            still.append(wb.Freeze("roll"))
        elif kind in ("plane", "sides", "centre of mass"):
            there = rng.uniform(lower, upper)
            goals, elbow = [wb.Point("tip", place_of(arm, there, "tip").translation)], place_of(arm, there, "roll")
            if kind == "plane":
                still.append(wb.Plane("roll", (1, 2, 3), point=elbow.translation))
            elif kind == "sides":
                ways = (*np.eye(3), *-np.eye(3))  # a box about the elbow
                still += [wb.Plane("roll", n, point=elbow.translation - 0.03 * n, side="above") for n in ways]
            else:
                goals.append(wb.CenterOfMass(state.update(there).center_of_mass(), axes="xy"))
        problem = wb.Problem(wb.Scene(arm), START, goals=goals, constraints=still)
        weights = problem.measures[0].distance.weights

        def errors(at, goals=problem.goals):
            return np.concatenate([goal.error(at) for goal in goals])

        kept = [one for one in problem.constraints if isinstance(one, wb.Plane)]
        asked = [{"type": "eq", "fun": lambda q, e=errors: e(state.update(q))}]
        for one in kept:
            kinds = "eq" if one.side == "on" else "ineq"
            asked.append({"type": kinds, "fun": lambda q, one=one: one.value(state.update(q))})
        least = np.inf
        for start in [START, there, *rng.uniform(lower, upper, (8, len(lower)))]:
            answer = minimize(
                lambda q, w: float(w @ (q - START) ** 2), start, (weights,), jac=lambda q, w: 2.0 * w * (q - START),
                bounds=list(zip(lower, upper, strict=True)), method="SLSQP", options={"ftol": 1e-12},
                constraints=asked,
            )  # fmt: skip
            judged = wb.assess(problem, np.clip(answer.x, lower, upper))
            if judged.met(1e-5) and judged.holds(1e-5):
                least = min(least, judged.measure)
        assert least < np.inf
        solution = wb.methods.QP(restarts_for_measure=9).solve(problem)
        assert not kept or {entry.note for entry in solution.trace} == {"seed"}
        assert solution.assessment.measure <= 1.001 * least
        assert solution.assessment.optimality < 1e-4


def test_ends_at_limits_and_along_bent_goals_are_stationary(arm):
    """Joints that stop a step and are pulled off their limits again, and steps that swing; the assessment tells."""
    rng, limits = np.random.default_rng(0), arm.limits
    for number in range(185):
        start, there = rng.uniform(limits.lower, limits.upper, (2, len(limits.lower)))
        if number in (152, 177, 184):
            goal = wb.Point("tip", place_of(arm, there, "tip").translation)
            problem = wb.Problem(wb.Scene(arm), start, goals=[goal])
            met = found(problem, measures=True)
            assert met.stationary, number
            assert wb.assess(problem, met.q).optimality < 1e-4, number


def test_wide_joints_end_the_shorter_way_round():
    """A joint with two turns of range goes to the place that is nearer to where it begins."""
    model = pin.Model()
    for number, axis in enumerate((pin.JointModelRZ(), pin.JointModelRY(), pin.JointModelRY())):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.3 if number else 0.1]))
        model.addJoint(number, axis, place, f"joint {number}")
    limits = Limits(np.arange(3), np.arange(3), np.full(3, -2.0 * np.pi), np.full(3, 2.0 * np.pi))
    chain, rng = whole_chain(model, limits), np.random.default_rng(2)
    entry = Entry(RESIDUAL, (3, 0, 1, 0, 0), np.concatenate([np.eye(3).ravel(), (0, 0, 0.3), np.zeros(24)]), 3)
    for _ in range(10):
        start = rng.uniform(-2.0 * np.pi, 2.0 * np.pi, 3)
        state = State(model).update(rng.uniform(-1.0, 1.0, 3))
        entry.floats[24:27] = pin.SE3(state.data.oMi[3]).act(np.array([0.0, 0.0, 0.3]))
        seeds = np.concatenate([*itertools.islice(chain.seeds(start, 0, 12), 2)])
        asked = np.array([1e-9, 1e-6, 60.0, 24.0, 0.0])
        ends = descended(chain, chain.goals([entry]), np.array([start, np.ones(3)]), asked, seeds)
        best = seeds[ends[:, 1].argmin()]
        assert np.isfinite(ends[:, 1].min())
        for turns in itertools.product((-1, 0, 1), repeat=3):
            other = best + 2.0 * np.pi * np.array(turns)
            if (np.abs(other) <= 2.0 * np.pi).all():
                assert np.sum((best - start) ** 2) <= np.sum((other - start) ** 2) + 1e-9


def test_joints_without_limits_and_joints_that_follow_elsewhere(tmp_path):
    """A continuous joint in the chain, and a gripper of a driven and a following finger behind it."""
    names = ("base", "upper", "fore", "hand", "left", "right")
    links = "".join(f'<link name="{name}"/>' for name in names)
    joints = "".join(
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>'
        f'<axis xyz="{axis}"/>{more}</joint>'
        for name, kind, parent, child, at, axis, more in (
            ("turn", "continuous", "base", "upper", "0 0 0.2", "0 0 1", ""),
            ("lift", "revolute", "upper", "fore", "0 0 0.3", "0 1 0", LIMIT),
            ("bend", "revolute", "fore", "hand", "0 0 0.4", "0 1 0", LIMIT),
            ("grip", "prismatic", "hand", "left", "0 0.02 0.2", "0 1 0", LIMIT),
            ("follow", "prismatic", "hand", "right", "0 -0.02 0.2", "0 -1 0", LIMIT + '<mimic joint="grip"/>'),
        )
    )
    path = tmp_path / "gripper.urdf"
    path.write_text(f'<robot name="gripper">{links}{joints}</robot>', encoding="utf-8")
    figure, rng = wb.load(path), np.random.default_rng(1)
    for _ in range(10):
        q = figure.with_joints(
            figure.neutral, {"turn": rng.uniform(-9, 9), "lift": rng.uniform(0.2, 1), "bend": rng.uniform(0.2, 1)}
        )
        goal = wb.Point("hand", figure.placement(q, "hand").act(np.array((0.0, 0.0, 0.2))), offset=(0.0, 0.0, 0.2))
        solution = wb.solve(wb.Problem(wb.Scene(figure), goals=[goal]))
        assert solution.solved, solution.message
        assert {entry.note for entry in solution.trace} == {"seed"}


LIMIT = '<limit lower="-1.5" upper="1.5" effort="1" velocity="1"/>'


@pytest.mark.parametrize("far", [0.3, 5.0])
def test_joints_that_slide_without_limits(tmp_path, far):
    pytest.importorskip("mujoco")
    path = tmp_path / "cart.xml"
    path.write_text(
        '<mujoco><worldbody><body name="cart"><joint name="slide" type="slide" axis="1 0 0" limited="false"/>'
        '<geom type="sphere" size="0.05"/><body name="arm" pos="0 0 0.2"><joint name="turn" axis="0 1 0" '
        'range="-100 100"/><geom type="capsule" fromto="0 0 0.1 0 0 0.4" size="0.02"/></body></body></worldbody>'
        "</mujoco>",
        encoding="utf-8",
    )
    scene = wb.Scene(wb.load(path))
    for measures in (True, False):
        problem = wb.Problem(scene, goals=[wb.Point("arm", (far, 0.0, 0.5), offset=(0.0, 0.0, 0.4))])
        assert wb.methods.QP(measures=measures).solve(problem).solved


def test_every_descent_is_told_and_counted(arm):
    goal = place_of(arm, np.array([0.4, 0.8, 0.9, 0.0, 0.5, 0.0]), "tip").translation
    problem, told = wb.Problem(wb.Scene(arm), START, goals=[wb.Point("tip", goal)]), []
    solution = wb.methods.QP(measures=False).solve(problem, told.append)
    assert solution.solved
    assert solution.programs == {}
    assert solution.iterations == len(solution.trace) == len(told) > 0
    with_measures = wb.methods.QP().solve(problem)
    assert with_measures.assessment.measure <= solution.assessment.measure + 1e-9


def test_progress_that_ends_is_not_called_again(arm):
    problem = wb.Problem(wb.Scene(arm), START, goals=[wb.Point("tip", place_of(arm, START + 0.1, "tip").translation)])
    told = []
    solution = wb.solve(problem, wb.methods.QP(measures=False), progress=lambda entry: told.append(entry) or True)
    assert len(told) == 1
    assert solution.solved


@pytest.mark.parametrize("measures", [False, True])
def test_an_end_that_the_assessment_refuses_is_searched_again(arm, monkeypatch, measures):
    """As if a distance had been missed: the descent answers with a posture that is inside of a ball."""
    problem, met = blocked_by_a_ball(arm)
    assert wb.assess(problem, met.q).penetration > 0.01
    monkeypatch.setattr("wholebody.methods.qp.method.from_seeds", lambda *_: met)
    solution = wb.methods.QP(measures=measures).solve(problem)
    assert solution.solved, solution.message
    assert wb.assess(problem, solution.q).penetration < 1e-5
    assert solution.iterations > len(met.trace)


def test_a_joint_may_have_to_turn_by_more_than_half_a_turn():
    """A joint whose range is less than a turn has each angle once, however far from the start that is."""
    figure, ready = robots.known_arm("panda")
    limits = figure.limits
    shares = np.array([0.907, 0.013, 0.604, 0.097, 0.873, 0.96, 0.034])  # of the ranges; the last is 3.5 rad from there
    witness = limits.lower + shares * (limits.upper - limits.lower)
    problem = wb.Problem(wb.Scene(figure), ready, goals=[wb.Frame("tool", figure.placement(witness, "tool"))])
    assert wb.assess(problem, witness).holds(0.0)
    assert wb.solve(problem).solved
    assert wb.solve_many([problem])[0].message == "solved directly"


def test_a_singular_placement_without_a_branch_is_met_with_the_least_effort():
    """Where axes of a straight wrist are parallel, the closed form has no posture: no descent ends lower."""
    figure, start = robots.known_arm("ur5")
    there = figure.placement(np.array([1.75, -0.53, -0.1, -1.77, 0.0, -1.04]), "tool")
    problem = wb.Problem(wb.Scene(figure), start, goals=[wb.Frame("tool", there)])
    ends = wb.methods.QP().minima(problem, np.random.default_rng(0).uniform(-2.5, 2.5, (10, 6)))
    least = min(end.assessment.measure for end in ends if end.status == "solved")
    assert wb.solve(problem).assessment.measure <= 1.001 * least
