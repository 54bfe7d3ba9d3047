"""No NaN, infinity or odd answer of a term of one's own passes a judge, and methods step back from where one is."""

from __future__ import annotations

import pickle
import re
from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.errors import UndefinedTermError
from wholebody.figures.state import Wrench

FAR = 0.15  # m: farther to the front than this the terms below are not defined; the goal is at 0.3


class _Tip:
    """Where the right index finger's tip is, relative to where it was at the start."""

    def __init__(self, scene, start):
        self.index = scene.figure.frame_id("right_index_tip")
        self.joint = scene.model.frames[self.index].parentJoint
        self.start = scene.state(start).frame(self.index).translation.copy()

    def moved(self, state):
        return state.frame(self.index).translation - self.start

    def far(self, state):
        return self.moved(state)[0] > FAR

    def wrench(self, state):
        x, y, z = state.frame(self.index).translation
        return np.array([[1.0, 0, 0, 0, z, -y], [0, 1.0, 0, -z, 0, x], [0, 0, 1.0, y, -x, 0]])


class _Own:
    def __init__(self, part: str, bad: object, tip: _Tip | None = None) -> None:
        self.part, self.bad, self.tip = part, bad, tip

    def resolve(self, scene, start):
        return type(self)(self.part, self.bad, _Tip(scene, start))

    def answer(self, part, state, usual):
        return self.bad if part == self.part and self.tip.far(state) else usual


class Reach(_Own, wb.Goal):
    def error(self, state):
        return self.answer("error", state, self.tip.moved(state) - (0.3, 0.0, 0.2))

    def jacobian(self, state):
        return Wrench(self.answer("jacobian", state, self.tip.wrench(state)), self.tip.joint)


class Keep(_Own, wb.Constraint):
    def value(self, state):
        return self.answer("value", state, np.ones(1))

    def jacobian(self, state):
        return self.answer("jacobian", state, np.zeros((1, state.model.nv)))


class Bend(_Own, wb.Measure):
    def value(self, state):
        return self.answer("value", state, 0.5 * float(np.sum(state.q[7:] ** 2)))

    def gradient(self, state):
        return self.answer("gradient", state, np.concatenate([np.zeros(6), state.q[7:]]))

    def curvature(self, state):
        return self.answer("curvature", state, np.ones(state.model.nv))


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    return wb.Scene(wb.load("human"))


def stated(scene: wb.Scene, term: object) -> wb.Problem:
    start = scene.figure.neutral
    place = scene.state(start).frame(scene.figure.frame_id("right_index_tip")).translation + (0.3, 0.0, 0.2)
    goals = [term] if isinstance(term, wb.Goal) else [wb.Point("right_index_tip", place)]
    held = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    more = [term] if isinstance(term, wb.Constraint) else []
    measures = [term] if isinstance(term, wb.Measure) else None
    return wb.Problem(scene, start, goals=goals, constraints=[*held, *more], measures=measures)


@cache
def reached(scene: wb.Scene) -> np.ndarray:
    return wb.solve(stated(scene, wb.Effort())).q


def rows(count: int, bad: float) -> np.ndarray:
    return np.full((count, 55), bad)


TERMS = [
    *((Reach, "error", np.full(3, bad)) for bad in (np.nan, np.inf)), (Reach, "jacobian", np.full((3, 6), np.nan)),
    *((Keep, "value", np.full(1, bad)) for bad in (np.nan, -np.inf)), (Keep, "jacobian", rows(1, np.nan)),
    *((Bend, "value", bad) for bad in (np.nan, np.inf, -np.inf)), (Bend, "gradient", np.full(55, np.nan)),
    (Bend, "curvature", np.full(55, np.inf)),
]  # fmt: skip
IDS = [f"{kind.__name__} {part} {np.ravel(bad)[0]}" for kind, part, bad in TERMS]


@pytest.mark.parametrize(("kind", "part", "bad"), TERMS, ids=IDS)
def test_the_assessment_names_a_term_that_is_not_finite(scene, kind, part, bad):
    problem, q = stated(scene, kind(part, bad)), reached(scene)

    def judge():
        judged = wb.assess(problem, q)
        return judged.optimality, judged.blockers, problem.lineariser(problem.workspace()).at(q, 0.1)

    with pytest.raises(UndefinedTermError, match=rf"{kind.__name__}.*: its {part} has .*which is not finite"):
        judge()


@pytest.mark.parametrize(
    ("kind", "part", "bad", "method"),
    [
        (Reach, "jacobian", np.full((3, 6), np.nan), "dls"),
        (Keep, "jacobian", rows(1, np.nan), "qp"),
        *((Reach, "error", np.full(3, np.nan), method) for method in ("qp", "newton", "dls")),
        (Bend, "gradient", np.full(55, np.nan), "qp"),
    ],
)
def test_methods_step_back_and_end_with_the_name(scene, kind, part, bad, method):
    problem = stated(scene, kind(part, bad))
    chosen = {
        "qp": wb.methods.QP(restarts=1, budget=40),
        "newton": wb.methods.Newton(restarts=0, iterations=12),
        "dls": wb.methods.DampedLeastSquares(),
    }
    if chosen[method].accepts(problem) is not None:
        pytest.skip("the method takes no such term")
    solution = wb.solve(problem, chosen[method])
    assert solution.status == "stalled"
    assert not problem.lineariser(problem.workspace()).undefined(solution.q)
    place = {Reach: r"goals\[0\] \(Reach\)", Keep: r"constraints\[2\], Keep", Bend: r"measures\[0\] \(Bend\)"}
    assert np.isfinite(solution.assessment.goal_error)
    assert "of iteration" in solution.message
    assert re.search(rf"{place[kind]}: its {part} has \S+ at a posture of iteration \d+", solution.message)


@pytest.mark.parametrize(
    "method", [wb.methods.QP(), wb.methods.Newton(), wb.methods.DampedLeastSquares()], ids=lambda one: one.name
)
@pytest.mark.parametrize(
    "term", [Reach("error", np.full(3, np.nan)), Bend("gradient", np.full(55, np.nan))], ids=["goal", "measure"]
)
def test_trackers_stay_where_terms_are_finite(scene, method, term):
    problem = stated(scene, term)
    if method.accepts(problem) is not None:
        pytest.skip("the method takes no such term")
    tracker, q = method.tracker(problem, 0.05), problem.start
    notes = set()
    for _ in range(8):
        step = tracker.step(q)
        q = step.q
        notes.add(getattr(step, "note", ""))
        assert problem.lineariser(problem.workspace()).undefined(q) is None
    if method.name == "qp":
        assert any(f"{type(term).__name__}): its {term.part} has nan" in note for note in notes)
    with pytest.raises(UndefinedTermError, match=type(term).__name__):
        wb.methods.QP().tracker(problem, 0.05).step(reached(scene))


def test_an_assessment_with_nan_meets_and_holds_nothing(scene):
    judged = wb.assess(wb.Problem(scene), scene.figure.neutral)
    assert judged.met(1.0)
    assert judged.holds(1.0)
    for name in ("goal_error", "goal_angle"):
        assert not replace(judged, **{name: np.nan}).met(1e9)
    assert not replace(judged, goal_errors=(0.0, np.nan)).met(1e9)
    for name in ("limit_violation", "constraint_violation", "clearance_violation", "penetration"):
        assert not replace(judged, **{name: np.nan}).holds(1e9)


class Odd(_Own, wb.Goal):
    """Answers something else from the fifth time that it is asked."""

    asked = 0

    def error(self, state):
        self.asked += 1
        usual = self.tip.moved(state) - (0.3, 0.0, 0.2)
        return self.bad if self.part == "error" and self.asked > LATE else usual

    def jacobian(self, state):
        odd = self.part == "jacobian" and self.asked > LATE
        return self.bad if odd else Wrench(self.tip.wrench(state), self.tip.joint)


LATE = 4
ODD = ["far", None, np.ones(3) * 1j, np.zeros(2), [[1], [1, 2]]]


@pytest.mark.parametrize("part", ["error", "jacobian"])
@pytest.mark.parametrize("bad", ODD, ids=lambda bad: repr(bad)[:20])
def test_odd_answers_are_one_sentence(scene, part, bad):
    def assess_often(problem):
        for _ in range(6):
            judged = wb.assess(problem, problem.start)
            judged.optimality, judged.blockers  # noqa: B018

    def track(problem):
        tracker = wb.methods.QP().tracker(problem, 0.05)
        for _ in range(6):
            tracker.step(problem.start)

    for use in (
        wb.solve, lambda problem: wb.solve(problem, "newton"), lambda problem: wb.solve(problem, "dls"),
        lambda problem: wb.check_derivatives(problem.goals[0], scene), assess_often, track,
    ):  # fmt: skip
        problem = wb.Problem(scene, goals=[Odd(part, bad)])
        with pytest.raises(wb.InputError, match="Odd"):
            use(problem)


def test_what_is_told_of_a_term_goes_into_another_process():
    error = pickle.loads(pickle.dumps(UndefinedTermError(object(), "Mine", "its error has nan at a posture")))
    assert str(error) == "Mine: its error has nan at a posture"


def test_fractions_are_numbers(scene):
    figure = scene.figure
    clip = wb.Clip(figure, np.array([figure.neutral] * 4), 0.02)
    third = wb.motion.torques(clip, friction=Fraction(1, 3))
    assert np.array_equal(third.torque, wb.motion.torques(clip, friction=1 / 3).torque)
    problem = wb.Problem(scene, goals=[wb.Point("right_index_tip", (Fraction(2, 5), Fraction(-1, 5), 1))])
    assert wb.methods.QP(tolerance=Fraction(1, 10**5), time_limit=Fraction(3)).solve(problem).status == "solved"


def test_a_figure_is_no_scene_to_stand_on(scene):
    with pytest.raises(wb.InputError, match="give a scene of this figure"):
        scene.figure.grounded(scene.figure.neutral, scene.figure)


def test_a_method_that_is_set_on_an_object_is_checked_too(scene):
    term = Reach("", 0).resolve(scene, scene.figure.neutral)
    term.error = lambda state: np.full(3, np.nan)
    with pytest.raises(UndefinedTermError, match="Reach: its error has nan"):
        term.error(scene.state(scene.figure.neutral))


class Near(_Own, wb.Constraint):
    """Not defined beyond `FAR` of the start in any direction, such as in the neutral configuration of the model."""

    def value(self, state):
        return np.full(1, np.nan if np.linalg.norm(self.tip.moved(state)) > FAR else 1.0)

    def jacobian(self, state):
        return np.zeros((1, state.model.nv))


def bent(scene: wb.Scene) -> np.ndarray:
    return scene.figure.with_joints(scene.figure.neutral, {"right_elbow_flexion": 1.5})


@pytest.mark.parametrize("method", ["qp", "newton"])
def test_terms_are_counted_at_the_start(scene, method):
    """Not where the last run left its state, and not in the neutral configuration."""
    start = bent(scene)
    place = scene.state(start).frame(scene.figure.frame_id("right_index_tip")).translation + (0.1, 0.0, 0.0)
    problem = wb.Problem(scene, start, goals=[wb.Point("right_index_tip", place)], constraints=[Near("", 0)])
    with problem.borrow() as workspace:
        workspace.state.update(scene.figure.neutral)
        assert problem.lineariser(workspace, 0.05).undefined(start) is None
    assert wb.solve(problem, method).solved


class Angle(Reach):
    turned: object = False

    @property
    def angular(self):
        return self.turned


@pytest.mark.parametrize("bad", [np.nan, "yes", None, 2, [[True, True, True]], [1, 0, 0], [[True], [True, False]]])
def test_which_rows_are_angles_is_true_or_false(scene, bad):
    kind = type("Turned", (Angle,), {"turned": bad})
    with pytest.raises(wb.InputError, match=r"goals\[0\] \(Turned\): its angular"):
        wb.Problem(scene, goals=[kind("", 0)])


def test_a_list_tells_which_rows_are_angles(scene):
    kind = type("Turned", (Angle,), {"turned": [True, False, False]})
    judged = wb.assess(wb.Problem(scene, goals=[kind("", 0)]), scene.figure.neutral)
    assert judged.goal_angle == pytest.approx(0.3)
    assert judged.goal_error == pytest.approx(0.2)


def test_what_is_masked_is_no_number(scene):
    with pytest.raises(wb.InputError, match="its error has nan"):
        wb.assess(
            stated(scene, Reach("error", np.ma.masked_array([0.0, 0.0, 0.0], [False, True, False]))), reached(scene)
        )
