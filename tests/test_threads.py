"""Threads that share a method, a problem, a scene: each has the answers that one thread alone has, bit for bit."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.needs import each
from wholebody.base.pool import OneAtATime, Pool
from wholebody.figures.state import State

THREADS = 2
FEET = ("left_foot", "right_foot")


@pytest.fixture(autouse=True)
def frequent_switching() -> Iterator[None]:
    """Let threads take turns a hundred times as often as they do by themselves."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(5e-5)
    yield
    sys.setswitchinterval(before)


@pytest.fixture(scope="module")
def scene() -> wb.Scene:
    """Return an avatar before a board and a hull."""
    made = wb.Scene(wb.load("avatar")).add(wb.HalfSpace(), name="floor")
    made.add(wb.Box((0.3, 0.8, 0.03)), name="board", at=(0.45, -0.2, 1.05))
    corners = np.random.default_rng(0).normal(size=(20, 3)) * 0.05
    return made.add(wb.Hull(corners), name="stone", at=(0.4, -0.25, 1.2))


def reaching(scene: wb.Scene, place: tuple[float, float, float], *constraints: wb.Constraint) -> wb.Problem:
    return wb.Problem(scene, goals=[wb.Point("right_index_tip", place)], constraints=constraints, clearance=0.003)


def problems(scene: wb.Scene) -> list[wb.Problem]:
    holds = [wb.Hold(foot) for foot in FEET]
    places = ((0.45, -0.25, 1.15), (0.4, -0.2, 0.95))
    return [reaching(scene, place, *holds) for place in places]


def together(work: Callable[[int], None]) -> None:
    """Run `work(number)` in threads that begin at once; raise what the first of them raised."""
    failed: list[BaseException] = []
    gate = threading.Barrier(THREADS)

    def run(number: int) -> None:
        gate.wait()
        try:
            work(number)
        except BaseException as error:
            failed.append(error)

    threads = [threading.Thread(target=run, args=(number,)) for number in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if failed:
        raise failed[0]


def same(one: wb.Solution, other: wb.Solution) -> bool:
    return bool(np.array_equal(one.q, other.q)) and (one.status, one.assessment) == (other.status, other.assessment)


METHODS = {  # and how often the problems are solved again
    "qp": (wb.methods.QP(budget=20, restarts=1, time_limit=None), 1),
    "dls": (wb.methods.DampedLeastSquares(iterations=40, time_limit=None), 3),
    "newton": (wb.methods.Newton(restarts=0, iterations=2, time_limit=None), 0),
    "placo": (wb.methods.Placo(iterations=20, time_limit=None), 0),
    "ccd": (wb.methods.CCD(restarts=0, iterations=40, time_limit=None), 1),
}


@pytest.mark.parametrize("name", each(METHODS))
def test_threads_with_one_method_problem_and_scene_answer_as_one_alone(scene: wb.Scene, name: str) -> None:
    method, repeats = METHODS[name]
    asked = problems(scene)
    if name == "ccd":  # whose chains do not reach the ground
        asked = [wb.Problem(scene, goals=problem.goals) for problem in asked]
    alone = [method.solve(problem) for problem in asked]
    order = [0, 1] * (1 + repeats)

    def work(number: int) -> None:
        for turn in range(len(order)):
            k = order[(number + turn) % len(order)]
            assert same(method.solve(asked[k]), alone[k])

    together(work)


def test_trackers_of_one_method_and_problem_step_as_one_alone(scene: wb.Scene) -> None:
    problem, method = problems(scene)[0], wb.methods.QP(time_limit=None)

    def way(wait: Callable[[], object] = lambda: None) -> list[np.ndarray]:
        tracker, q, found = method.tracker(problem, 0.02), problem.start, []
        for _ in range(25):
            q = tracker.step(q).q
            found.append(q)
            wait()
        return found

    alone = way()
    together(lambda number: np.testing.assert_array_equal(way(), alone))


def test_questions_to_one_scene_are_answered_as_to_one_thread(scene: wb.Scene) -> None:
    figure, rng = scene.figure, np.random.default_rng(5)
    postures = [
        figure.clamp(pin.integrate(figure.model, figure.neutral, 0.3 * rng.normal(size=figure.model.nv)))
        for _ in range(THREADS)
    ]
    problem = problems(scene)[0]

    def asked(k: int) -> tuple[object, ...]:
        contacts, met = scene.contacts(postures[k], 0.1), scene.sweep(postures[k], postures[k - 1])
        return (
            *(part.tolist() for part in contacts),
            None if met is None else (met.fraction, met.q.tolist(), met.pair),
            wb.assess(problem, postures[k]),
            scene.state(postures[k]).frame(scene.frame_id("head")).homogeneous.tolist(),
            [(one.a, one.b, one.global_depth.tolist()) for one in scene.penetration(postures[k])],
        )

    alone = [asked(k) for k in range(len(postures))]

    def work(number: int) -> None:
        for turn in range(2):
            k = (number + turn) % len(postures)
            assert asked(k) == alone[k]

    together(work)


def test_a_simplified_problem_is_solved_by_threads_as_by_one(scene: wb.Scene) -> None:
    whole = wb.Problem(
        scene, goals=[wb.Point("right_index_tip", (0.45, -0.25, 1.15))], constraints=[wb.Hold(foot) for foot in FEET],
        measures=[wb.tasks.PotentialEnergy(), wb.tasks.Displacement()],
    )  # fmt: skip
    small, method = wb.simplify(whole).problem, wb.methods.QP(budget=0, time_limit=None)
    alone = method.solve(small)

    def work(number: int) -> None:
        assert same(method.solve(small), alone)

    together(work)


def test_a_solve_sees_things_where_they_were_when_it_began(scene: wb.Scene) -> None:
    """A board is moved to and fro all the time: every posture is one of two, as if nobody had moved it meanwhile."""
    moving = wb.Scene(scene.figure).add(wb.Box((0.3, 0.8, 0.03)), name="board", at=(0.45, -0.2, 1.05))
    places = ((0.45, -0.2, 1.05), (0.45, -0.2, 1.3))
    problem, method = reaching(moving, (0.45, -0.25, 1.15)), wb.methods.QP(budget=0, time_limit=None)
    alone = []
    for place in places:
        moving.move("board", at=place)
        alone.append(method.solve(problem).q)
    assert not np.array_equal(alone[0], alone[1])
    done = threading.Event()

    def move() -> None:
        turn = 0
        while not done.wait(1e-3):
            moving.move("board", at=places[turn % 2])
            turn += 1

    mover = threading.Thread(target=move)
    mover.start()
    try:
        for _ in range(8):
            q = method.solve(problem).q
            assert any(np.array_equal(q, other) for other in alone)
    finally:
        done.set()
        mover.join()


def test_things_that_come_during_a_solve_are_refused_by_one_sentence(scene: wb.Scene) -> None:
    """The solve ends with an answer to what was asked, or says that the scene changed; nothing else happens."""
    growing = wb.Scene(scene.figure).add(wb.HalfSpace(), name="floor")
    for number in range(6):
        problem = reaching(growing, (0.45, -0.25, 1.15))
        adder = threading.Timer(
            0.004 * number, lambda k=number: growing.add(wb.Sphere(0.1), name=f"ball{k}", at=(2, 0, k))
        )
        adder.start()
        said = ""
        try:
            said = wb.solve(problem).status
        except wb.InputError as error:
            said = str(error)
        adder.join()
        assert said == "solved" or "state the problem anew" in said


def test_a_tracker_refuses_a_second_thread(scene: wb.Scene) -> None:
    """A goal that asks the tracker for a step, within a step of it: what a second thread would do."""
    problem = problems(scene)[0]
    tracker = wb.methods.QP(time_limit=None).tracker(problem, 0.02)

    class Asking(wb.tasks.Displacement):
        def value(self, state: State) -> float:
            tracker.step(problem.start)
            return 0.0

    problem.measures = (Asking().resolve(scene, problem.start),)
    with pytest.raises(wb.InputError, match="one tracker for each thread"):
        tracker.step(problem.start)
    problem.measures = (wb.tasks.Displacement().resolve(scene, problem.start),)
    tracker.step(problem.start)  # and is free again


def test_an_assembly_and_a_drag_refuse_a_second_thread() -> None:
    alone = OneAtATime("drag")
    with alone, pytest.raises(wb.InputError, match="one drag for each thread"), alone:
        pass
    with alone:
        pass


def test_a_pool_lends_nothing_twice_and_forgets_what_broke() -> None:
    made: list[object] = []

    def make() -> object:
        made.append(object())
        return made[-1]

    pool = Pool(make)
    with pool.borrow() as one, pool.borrow() as other:
        assert one is not other
    with pool.borrow() as again:
        assert again in (one, other)
    with pytest.raises(ZeroDivisionError), pool.borrow() as broken:
        _ = 1 / 0
    with pool.borrow() as first, pool.borrow() as second:
        assert broken not in (first, second)
    assert len(made) == 3


def test_a_pool_keeps_no_more_than_it_is_allowed() -> None:
    pool = Pool(object, at_most=1)
    with pool.borrow() as one, pool.borrow() as other:
        pass
    with pool.borrow() as kept, pool.borrow() as made:
        assert kept in (one, other)
        assert made not in (one, other)


@pytest.mark.parametrize(
    "method",
    [
        wb.methods.QP(time_limit=None),
        wb.methods.CCD(time_limit=None),
        wb.methods.Newton(time_limit=None),
        wb.methods.Placo(time_limit=None),
        wb.methods.DampedLeastSquares(time_limit=None),
    ],
)
def test_settings_of_methods_cannot_be_changed_and_hold_no_run(method: Any, scene: wb.Scene) -> None:
    before = dict(vars(method))
    with pytest.raises(AttributeError):
        method.tolerance = 1.0
    method.solve(wb.Problem(wb.Scene(scene.figure)))
    assert vars(method) == before
