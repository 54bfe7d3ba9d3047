"""The compiled program of a tracking step against the plain way: rows, numbers and answer, entry by entry."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.bench.measure.track import judge, track
from wholebody.bench.suite.adapters.registry import make_tool
from wholebody.figures.state import State
from wholebody.methods.qp.quadratic_program import StepSize
from wholebody.methods.qp.settings import PROGRAM, STEP
from wholebody.methods.qp.solvers.base import WorkingSet
from wholebody.methods.qp.solvers.registry import make_solver
from wholebody.methods.qp.step_program import StepProgram
from wholebody.methods.qp.subproblem import Subproblem
from wholebody.terms.linearisation import Linearisation, PackedLinearisation

DT = 0.01


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.2, 0.24, 0.2)), name="block", at=(0.44, -0.44, 1.05))
    return scene.add(wb.Sphere(0.1), name="ball", at=(0.3, 0.3, 1.2))


def whole(at: PackedLinearisation) -> Linearisation:
    """The same as what `Lineariser.at` returns."""
    terms, goals = len(at.value), at.goals
    return Linearisation(
        np.array(at.q), at.value[:goals], at.jacobian[:goals], at.value[goals:], at.jacobian[goals:terms], at.contacts,
        at.gap, at.jacobian[terms:], at.gap_contact, at.clearance, float(at.measure[0, -1]), at.measure[0, :-1],
        at.measure[1, :-1], at.box[0], at.box[1],
    )  # fmt: skip


def size(damping: float, gain: float) -> StepSize:
    return StepSize(STEP.radius, PROGRAM.error_clamp * STEP.radius, damping, True, gain)


class Plain:
    """The way of a step in array code: what `StepProgram` does in one call."""

    def __init__(self, problem: wb.Problem) -> None:
        self.subproblem = Subproblem(problem, State(problem.scene.model))
        self.working_set = WorkingSet(make_solver("active_set"))
        self.before: tuple[np.ndarray, np.ndarray, float] | None = None
        self.damped = self.foresaw = 0
        self.problem, self.bend, self.curving = problem, 0.0, False

    def curve(self, q: np.ndarray, rows, displacement: np.ndarray) -> np.ndarray:
        """By how much what is held ends elsewhere than its rows say."""
        state, errors = State(self.problem.scene.model), []
        state.update(pin.integrate(state.model, q, displacement))
        for constraint in self.problem.constraints:
            low, high, value = np.broadcast_arrays(constraint.lower, constraint.upper, constraint.value(state))
            errors.append((value - low)[low == high])
        return np.concatenate(errors) - (rows.soft_error + rows.soft @ displacement)[rows.goals :]

    def solve(self, at: Linearisation, motion):
        rows = self.subproblem.rows(at)
        error, goals = max(float(np.linalg.norm(at.goal_error)), 1e-12), rows.goals
        shift, damping = np.zeros(len(rows.soft_error)), 0.0
        gain = DT / STEP.settling if goals else 1.0
        if self.before is not None and np.array_equal(self.before[0], at.q):
            shift = rows.soft_error - self.before[1]
            shift[goals:] = np.clip(shift[goals:], -STEP.curved, STEP.curved)
            if not np.abs(shift[:goals]).max(initial=0.0) < STEP.resting:
                shift[:goals] = 0.0
            damping = STEP.damping * min(1.0, self.before[2] / error)
        for _ in range(1 + STEP.again):
            program = self.subproblem.program(at, rows, size(damping, gain), shift)
            answer = self.working_set.solve(program, rows.key)
            left = float(np.linalg.norm((rows.soft @ answer.x - program.target)[:goals]))
            asked = STEP.damping * min(1.0, left / error) if left > STEP.resting else 0.0
            if asked <= STEP.worse * max(damping, STEP.little):
                break
            damping = asked
        self.damped += damping > STEP.little
        bend, self.bend = self.bend, float(np.prod(motion(answer.x)))
        if goals < len(shift) and (self.curving or abs(self.bend - bend) > STEP.bent):
            curve = np.clip(self.curve(at.q, rows, answer.x), -STEP.curved, STEP.curved)
            self.curving = np.abs(curve - shift[goals:]).max() > STEP.straight
            if self.curving:
                self.foresaw += 1
                shift[goals:] = curve
                program = self.subproblem.program(at, rows, size(damping, gain), shift)
                answer = self.working_set.solve(program, rows.key)
        return rows, program, answer

    def ended(self, q, rows, program, displacement) -> None:
        gone = rows.soft @ displacement
        self.before = q, rows.soft_error + gone, float(np.linalg.norm((gone - program.target)[: rows.goals]))


PROBLEMS = {
    "into a block": {
        "goals": [wb.Point("right_index_tip", (0.42, -0.44, 1.05))],
        "constraints": [
            wb.Hold("left_foot"),
            wb.Hold("right_foot"),
            wb.tasks.StepLimit(4.0, root_velocity=1.0, root_turn=2.0),
        ],
        "measures": [wb.tasks.Displacement()],
    },
    "inequalities": {
        "goals": [wb.Point("left_index_tip", (0.3, 0.3, 1.1)), wb.Axis("head", (0, 0, 1.0), direction=(0.2, 0, 1.0))],
        "constraints": [wb.Hold("left_foot"), wb.Balance(), wb.Plane("right_elbow", (0.0, 1.0, 0.2))],
        "measures": [wb.tasks.Discomfort(0.1), wb.tasks.Displacement()],
    },
    "no goals": {"constraints": [wb.Hold("left_foot")], "measures": [wb.Effort()]},
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_it_is_the_plain_one_entry_by_entry(scene: wb.Scene, name: str) -> None:
    """Sixty steps, some from elsewhere than where the last ended."""
    problem = wb.Problem(scene, clearance=0.01, **PROBLEMS[name])
    workspace, plain = problem.workspace(), Plain(problem)
    compiled = StepProgram(problem, workspace, WorkingSet(make_solver("active_set")), DT)
    lineariser, rng, q = problem.lineariser(workspace, DT), np.random.default_rng(0), problem.start
    for number in range(60):
        if number % 20 == 19:
            q = problem.scene.figure.clamp(pin.integrate(workspace.model, q, 0.02 * rng.normal(size=len(q) - 1)))
        at = lineariser.packed(q, 0.06)
        answer = compiled.solve(at, measures=True)
        found, found_rows = compiled.program, compiled.rows
        rows, program, wanted = plain.solve(whole(at), partial(compiled.turning.motion, at))
        for field in ("soft", "soft_error", "soft_weight", "elastic", "elastic_violation", "contact", "key"):
            assert np.array_equal(getattr(found_rows, field), getattr(rows, field)), field
        assert (found_rows.goals, found_rows.contacts) == (rows.goals, rows.contacts)
        for field in ("rows", "weight", "elastic", "least", "elastic_weight", "lower", "upper", "linear"):
            assert np.array_equal(getattr(found, field), getattr(program, field)), field
        assert found.target == pytest.approx(program.target, abs=1e-12)
        assert found.diagonal == pytest.approx(program.diagonal, rel=1e-6)
        assert answer.x == pytest.approx(wanted.x, abs=3e-8)
        assert answer.exact
        contacts = slice(len(program.least) - len(at.gap), None)
        room = (program.elastic @ wanted.x - rows.elastic_violation)[contacts].min(initial=np.inf)
        assert answer.spare == pytest.approx(room, abs=1e-8)
        displacement = answer.x.copy() if number % 7 else 0.5 * answer.x
        q = pin.integrate(workspace.model, q, displacement)
        compiled.ended(q, displacement, number % 7 != 0)
        plain.ended(q, rows, program, displacement)
    assert plain.damped > 0 or name != "into a block"
    assert 0 < plain.foresaw < 60


def follow(problem: wb.Problem, targets: np.ndarray, frame: str = "right_index_tip") -> np.ndarray:
    """Postures (steps, nq) of a frame that is asked from place to place."""
    tracker, q, postures = wb.methods.QP().tracker(problem, DT), problem.start, []
    for place in targets:
        problem.retarget([wb.Point(frame, place)])
        q = tracker.step(q).q
        postures.append(q)
    return np.array(postures)


def test_a_body_that_meets_an_obstacle_keeps_its_feet_and_the_order_of_its_speed(scene: wb.Scene) -> None:
    """The goal goes on into the block; limbs do not jump, and feet stay within 2 micrometres."""
    holds = [wb.Hold("left_foot"), wb.Hold("right_foot"), wb.tasks.StepLimit(4.0, root_velocity=1.0, root_turn=2.0)]
    problem = wb.Problem(scene, constraints=holds, measures=[wb.tasks.Displacement()], clearance=0.01)
    tip = scene.state(problem.start).frame(scene.frame_id("right_index_tip")).translation.copy()
    share = np.linspace(0.0, 1.0, 70)[1:, None]
    targets = tip + share * (np.array([0.42, -0.44, 1.05]) - tip)
    postures = follow(problem, targets)
    speed = np.abs(np.diff(postures[:, scene.figure.limits.idx_q], axis=0)).mean(axis=1) / DT
    assert (
        np.linalg.norm(scene.state(postures[-1]).frame(scene.frame_id("right_index_tip")).translation - targets[-1])
        > 0.02
    )
    for earlier, later in itertools.pairwise(speed[10:]):
        assert later < 4.0 * earlier + 0.01
    for foot in problem.constraints[:2]:
        assert max(np.abs(foot.value(scene.state(q))).max() for q in postures) < 2e-6


def test_a_program_that_the_solver_closes_says_what_room_it_leaves(scene: wb.Scene) -> None:
    """Without a hot start the room was unknown, and every step along something was looked at again."""
    problem = wb.Problem(scene, clearance=0.01, **PROBLEMS["into a block"])
    workspace = problem.workspace()
    step = StepProgram(problem, workspace, WorkingSet(make_solver("osqp")), DT)
    at = problem.lineariser(workspace, DT).packed(problem.start, 0.06)
    answer = step.solve(at, measures=True)
    after = step.program.elastic @ answer.x - step.rows.elastic_violation
    assert answer.by != "active set"
    assert answer.spare == pytest.approx(after[len(after) - len(at.gap) :].min(), abs=1e-12)


def test_feet_stay_where_a_body_comes_away_from_an_obstacle() -> None:
    """The reach that every tool makes: into a box, along inside of it, and out, where the hand catches up fast."""
    reach = track("contact")
    tool, postures = make_tool("wholebody", reach), []
    for target in reach.targets:
        tool.step(target)
        postures.append(tool.posture().copy())
    judged = judge(reach, np.array(postures))
    assert judged.foot_drift < 2e-6
    assert judged.least_distance.min() > 0.9999 * reach.clearance


def test_a_fast_goal_within_reach_is_followed_without_lag(planar_arm: Callable[..., wb.Figure]) -> None:
    """Damping makes a step short; that must not be taken for a goal out of reach, which would keep it damped."""
    problem = wb.Problem(
        wb.Scene(planar_arm((0.4, 0.4, 0.3))), start=np.array([0.5, 1.0, 0.3]), goals=[wb.Point("tip", (0.5, 0.6, 0.0))]
    )
    tip = problem.scene.state(problem.start).frame(problem.scene.frame_id("tip")).translation.copy()
    angle = np.linspace(0.0, 2.0, 100)[:, None]
    targets = tip + 0.15 * np.hstack([np.cos(angle) - 1.0, np.sin(angle), 0.0 * angle])
    targets[:10] += [0.05, 0.0, 0.0]  # a jump, which leaves the first steps short
    number = problem.scene.frame_id("tip")
    tips = [problem.scene.state(q).frame(number).translation.copy() for q in follow(problem, targets, "tip")]
    away = np.linalg.norm(np.array(tips) - targets, axis=1)
    assert away[30:].max() < 1e-3  # the goal moves by 3 mm a step


def test_a_goal_that_rests_is_met_while_the_body_settles(scene: wb.Scene) -> None:
    """The measures still move the body; the fingertip stays where it is to 0.1 micrometres."""
    problem = wb.Problem(
        scene,
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")],
        measures=[wb.tasks.Displacement()],
        clearance=0.01,
    )
    place = np.array([0.3, -0.25, 1.25])
    postures = follow(problem, np.array([place] * 60))
    assert np.abs(np.diff(postures[-2:], axis=0)).max() > 1e-5
    for q in postures[-5:]:
        tip = scene.state(q).frame(scene.frame_id("right_index_tip")).translation
        assert np.linalg.norm(tip - place) < 1e-7
