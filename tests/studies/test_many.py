"""Many problems at once: the answers do not depend on how many run, and what fails has a record."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import wholebody as wb
from wholebody.studies.solving import Sender

ARM = Path(__file__).resolve().parents[2] / "examples" / "tasks" / "arm.urdf"
PLACES = [(0.4, 0.1 * k, 0.5) for k in range(-2, 3)]


@pytest.fixture(scope="module")
def arm() -> wb.Figure:
    return wb.load(ARM)


def problem(arm: wb.Figure, target: Any, **terms: Any) -> wb.Problem:
    return wb.Problem(wb.Scene(arm), goals=[wb.Point("hand", target)], **terms)


class Fatal(wb.Measure):
    """A measure that ends the process of a solve."""

    weight = 1.0

    def __init__(self, parent: int) -> None:
        self.parent = parent

    def value(self, state: Any) -> float:
        if os.getpid() != self.parent:
            os.kill(os.getpid(), signal.SIGKILL)
        return 0.0

    def gradient(self, state: Any) -> Any:
        return np.zeros(state.model.nv)

    def curvature(self, state: Any) -> Any:
        return np.ones(state.model.nv)


def test_answers_are_those_of_single_solves_whatever_jobs_is(arm: wb.Figure) -> None:
    problems = [problem(arm, place) for place in PLACES]
    alone = [wb.solve(one).q for one in problems]
    for jobs in (1, 2):
        for record, q in zip(wb.solve_many(problems, jobs=jobs), alone, strict=True):
            assert record.outcome == "solved"
            np.testing.assert_array_equal(record.q, q)


def test_a_cluster_answers_many_goals_of_a_scene_at_once_as_this_process_does(arm: wb.Figure) -> None:
    distributed = pytest.importorskip("distributed")
    scene = wb.Scene(arm)
    problems = [wb.Problem(scene, goals=[wb.Point("hand", place)]) for place in PLACES]
    here = wb.solve_many(problems)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None
    ) as cluster:
        there = wb.solve_many(problems, jobs=2, cluster=cluster.scheduler_address)
    assert len({record.seconds for record in there}) == 1  # each has its share of the time of all
    for one, other in zip(here, there, strict=True):
        np.testing.assert_array_equal(one.q, other.q)


def test_runs_that_were_ended_and_go_on_answer_as_those_that_were_not(arm: wb.Figure, tmp_path: Path) -> None:
    """Among the first cases of three runs, of which the second is out of reach."""
    places = [(0.4, 0.01 * k - 0.2, 0.5) if k != 16 else (3.0, 0.0, 0.5) for k in range(34)]
    problems = [problem(arm, place, measures=[wb.Effort()]) for place in places]
    whole = wb.solve_many(problems, warm_start=True)
    some = wb.solve_many(problems, warm_start=True, folder=tmp_path, progress=lambda told: told.done >= 1)
    assert 0 < sum(one.q is not None for one in some) < len(problems)
    for one, other in zip(wb.solve_many(problems, warm_start=True, folder=tmp_path), whole, strict=True):
        np.testing.assert_array_equal(one.q, other.q)


def test_a_problem_that_was_solved_is_found_in_its_folder(tmp_path: Path) -> None:
    scene = wb.Scene(wb.load("human"))
    given = [wb.Problem(scene, goals=[wb.Point("right_palm", (0.4, side, 1.2))]) for side in (-0.3, -0.2)]
    wb.solve(given[0])
    wb.solve_many(given, folder=tmp_path)
    wb.solve(given[1])
    done: list[int] = []
    wb.solve_many(given, folder=tmp_path, progress=lambda told: done.append(told.done))
    assert done == [2]


def test_warm_starts_are_the_same_whatever_jobs_is_and_solve_each_goal(arm: wb.Figure) -> None:
    problems = [problem(arm, (0.4, 0.02 * k - 0.2, 0.5)) for k in range(10)]
    one, two = (wb.solve_many(problems, jobs=jobs, warm_start=True) for jobs in (1, 2))
    for k, (a, b) in enumerate(zip(one, two, strict=True)):
        assert a.solved
        np.testing.assert_array_equal(a.q, b.q)
        there = arm.placement(a.q, "hand").translation
        np.testing.assert_allclose(there, (0.4, 0.02 * k - 0.2, 0.5), atol=2e-5)


def test_a_process_that_ends_costs_its_own_problem_alone(arm: wb.Figure) -> None:
    mine = [Fatal(os.getpid())]
    problems = [problem(arm, PLACES[k % 5], measures=mine if k == 1 else None) for k in range(9)]  # two in a job
    for warm in (True,):
        first, fatal, *others = wb.solve_many(problems, warm_start=warm)
        assert all(each.solved for each in (first, *others))
        assert (fatal.outcome, fatal.q) == ("ended", None)
        assert "SIGKILL" in fatal.message
    told = repr(wb.studies.Records([fatal]))
    assert "first ended: 1, the process ended with SIGKILL" in told
    assert "goal missed most: none" in told


class Failing(Fatal):
    """A measure with a mistake that shows in the process of a solve."""

    def value(self, state: Any) -> float:
        if os.getpid() != self.parent:
            raise ZeroDivisionError("nothing to divide by")
        return 0.0


def test_a_term_that_fails_is_a_record(arm: wb.Figure) -> None:
    failing = problem(arm, PLACES[1], measures=[Failing(os.getpid())])
    record, other = wb.solve_many([failing, problem(arm, PLACES[0])])
    assert (record.outcome, record.q) == ("refused", None)
    assert "nothing to divide by" in record.message
    assert other.solved


def test_a_folder_keeps_what_is_done(arm: wb.Figure, tmp_path: Path) -> None:
    problems = [problem(arm, place) for place in PLACES]
    done: list[int] = []

    def stop(told: wb.studies.SolveProgress) -> bool:
        done.append(told.done)
        return told.done == 2

    first = wb.solve_many(problems, folder=tmp_path, progress=stop)
    assert first.counts() == {"solved": 2, "cancelled": 3}
    begun: list[int] = []
    second = wb.solve_many(problems, folder=tmp_path, progress=lambda told: begun.append(told.done))
    assert begun == [2, 3, 4, 5]
    assert second.counts() == {"solved": 5}
    np.testing.assert_array_equal(first[0].q, second[0].q)
    other = wb.solve_many([problem(arm, (0.3, 0.0, 0.6))], folder=tmp_path)
    np.testing.assert_allclose(arm.placement(other[0].q, "hand").translation, (0.3, 0.0, 0.6), atol=2e-5)


def test_a_folder_of_something_else_is_refused(arm: wb.Figure, tmp_path: Path) -> None:
    (tmp_path / "records.jsonl").write_text("{}\n")
    with pytest.raises(wb.FileFormatError, match="another folder"):
        wb.solve_many([problem(arm, PLACES[0])], folder=tmp_path)


def test_records_are_written_as_a_table(arm: wb.Figure, tmp_path: Path) -> None:
    records = wb.solve_many({"near": problem(arm, PLACES[0]), "far": problem(arm, (9.0, 0.0, 0.0))})
    lines = records.to_csv(tmp_path / "a.csv").read_text().splitlines()
    assert lines[0].startswith("name,outcome,message,seconds")
    assert [line.split(",")[:2] for line in lines[1:]] == [["near", "solved"], ["far", "unreachable"]]
    assert records.solved == 0.5
    assert "1 solved, 1 unreachable" in repr(records)


def test_what_is_not_solved_from_its_own_start_is_tried_from_the_answers_of_neighbours(arm: wb.Figure) -> None:
    places = [(0.4 - 0.06 * k, 0.1 * k - 0.2, 0.5) for k in range(8)]
    problems, method = [problem(arm, place) for place in places], wb.methods.DampedLeastSquares(iterations=8)
    alone = [wb.solve(one, method).solved for one in problems]
    assert alone == [True] * 3 + [False] * 5
    records = wb.solve_many(problems, method, jobs=2)
    assert [one.neighbour for one in records] == ["", "", "", "2", "2", "2", "2", "2"]
    assert records.from_neighbours == 5
    assert "5 solved from the answer of a neighbour" in repr(records)
    for record, place in zip(records, places, strict=True):
        assert record.solved
        np.testing.assert_allclose(arm.placement(record.q, "hand").translation, place, atol=2e-5)


def test_the_nearest_answer_is_tried_first_and_kept(arm: wb.Figure, tmp_path: Path) -> None:
    turns = np.linspace(-0.6, 2.4, 9)
    given = [problem(arm, (0.45 * np.cos(turn), 0.45 * np.sin(turn), 0.5)) for turn in turns]
    method = wb.methods.DampedLeastSquares(iterations=7)
    first = wb.solve_many(given, method, folder=tmp_path)
    assert [one.neighbour for one in first] == ["", "", "", "", "3", "3", "8", "8", ""]
    assert first.solved == 1.0
    again = wb.solve_many(given, method, folder=tmp_path)  # what was found is kept
    assert [one.neighbour for one in again] == [one.neighbour for one in first]


@dataclass(frozen=True)
class Tries:
    """A method of a user, with a number of restarts that is no setting, or a budget that may not be zero."""

    name: ClassVar[str] = "tries"
    restarts: ClassVar[int] = 3
    budget: float = 2.0

    def __post_init__(self) -> None:
        if self.budget <= 0.0:
            raise ValueError("no budget")

    def accepts(self, problem: wb.Problem) -> None:
        return None

    def solve(self, problem: wb.Problem, progress: Any = None) -> wb.Solution:
        return wb.solve(problem, progress=progress)

    def tracker(self, problem: wb.Problem, dt: float) -> Any:
        return wb.methods.QP().tracker(problem, dt)


@dataclass(frozen=True)
class Restarts(Tries):
    restarts: int = 3  # type: ignore[misc]


@pytest.mark.parametrize("method", [Tries(), Restarts()])
def test_a_method_of_a_user_keeps_its_settings_where_it_has_to(arm: wb.Figure, method: Any) -> None:
    places = [*PLACES[:3], (5.0, 0.0, 0.5)]
    records = wb.solve_many([problem(arm, place) for place in places], method, warm_start=True)
    assert [one.outcome for one in records] == ["solved"] * 3 + ["unreachable"]


def test_a_method_derived_from_qp_solves_each_problem(arm: wb.Figure) -> None:
    solved = []

    class Counted(wb.methods.QP):
        def solve(self, problem: wb.Problem, progress: Any = None) -> wb.Solution:
            solved.append(problem)
            return super().solve(problem, progress)

    wb.solve_many([problem(arm, place) for place in PLACES], Counted())
    assert len(solved) == len(PLACES)


def test_after_a_miss_the_last_solved_answer_is_the_start(arm: wb.Figure) -> None:
    begun = []

    class Noted(wb.methods.QP):
        def solve(self, problem: wb.Problem, progress: Any = None) -> wb.Solution:
            begun.append(problem.start)
            return super().solve(problem, progress)

    places = [PLACES[0], (5.0, 0.0, 0.5), PLACES[1]]
    first, far, last = wb.solve_many([problem(arm, place) for place in places], Noted(), warm_start=True)
    assert (first.solved, far.solved, last.solved) == (True, False, True)
    # the first's own start; the second from the first's answer, and its own start; the third from the first's answer
    np.testing.assert_array_equal(begun[3], first.q)


def test_the_middle_of_a_run_leads_out_of_a_family_that_the_first_own_start_began(
    planar_arm: Callable[..., wb.Figure],
) -> None:
    """Elbows that all but the first case have on their own start's side; from the first's answer they stay."""
    scene = wb.Scene(planar_arm((0.5, 0.4)))
    places = [(0.6, 0.02 * k, 0.0) for k in range(16)]
    starts = [np.array((-0.6, 1.4)), *[np.array((0.8, -1.4))] * 15]
    problems = [
        wb.Problem(scene, start, goals=[wb.Point("tip", place)]) for start, place in zip(starts, places, strict=True)
    ]
    records = wb.solve_many(problems, "newton", warm_start=True)
    assert [float(np.sign(one.q[1])) for one in records] == [1.0] + [-1.0] * 15  # type: ignore[index]


def test_what_a_method_leaves_out_of_any_problem_is_said_once(arm: wb.Figure) -> None:
    """An arm has nothing by default; of a person who stands ccd does not look at the balance."""
    human = wb.load("human")
    there = human.placement(human.posture("standing"), "right_palm").translation
    goals = [wb.Point("right_palm", there)]
    person = wb.Problem(wb.Scene(human), "standing", goals=goals, balance=True)
    with pytest.warns(UserWarning, match="leaves out") as told:
        wb.solve_many([problem(arm, PLACES[0]), person, person], "ccd")
    assert [str(one.message).split(",")[0] for one in told] == ["method 'ccd' leaves out Balance (by default)"]


@pytest.mark.parametrize("method", ["newton", "dls"])
def test_what_a_method_leaves_out_is_said_of_what_it_takes_alone(
    method: str, arm: wb.Figure, recwarn: pytest.WarningsRecorder
) -> None:
    """A problem whose scene changed after it was stated, or with terms that a method refuses, is a record."""
    scene = wb.Scene(arm).add(wb.Box((0.1, 0.1, 0.1)), name="box", at=(2.0, 0.0, 1.0))
    stale = wb.Problem(scene, goals=[wb.Point("hand", PLACES[0])], measures=[wb.Effort()])
    scene.add(wb.Box((0.1, 0.1, 0.1)), name="other", at=(3.0, 0.0, 1.0))
    above = wb.tasks.Plane("hand", (0, 0, 1), side="above")
    refused = wb.Problem(wb.Scene(arm), goals=[wb.Point("hand", PLACES[0])], constraints=[above])
    given = [stale] if method == "newton" else [stale, refused]  # newton takes the latter
    assert {one.outcome for one in wb.solve_many(given, method)} == {"refused"}
    assert not [one for one in recwarn if "leaves out" in str(one.message)]


def test_a_place_that_no_neighbour_reaches_stays_out_of_reach(arm: wb.Figure) -> None:
    reached, far = wb.solve_many([problem(arm, PLACES[0]), problem(arm, (5.0, 0.0, 0.5))])
    assert (reached.solved, far.outcome, far.neighbour) == (True, "unreachable", "")


def test_a_scene_is_sent_once_and_again_when_something_moved():
    """Problems that another process reads share the scene that it has seen; a thing that moved is where it is now."""
    scene = wb.Scene(wb.load("human")).add(wb.Box((0.2, 0.2, 0.2)), name="box", at=(0.6, 0.0, 0.5))
    first, second = (wb.Problem(scene, goals=[wb.Point("head", (0.1, 0.0, z))]) for z in (1.5, 1.6))
    known = Sender()
    one, two = known.sent(first), known.sent(second)
    assert len(one.value) < 0.2 * sum(map(len, one.scenes.values()))
    read = one.read()
    assert read.scene is two.read().scene is not scene
    scene.move("box", at=(0.7, 0.0, 0.5))
    moved = known.sent(first).read()
    assert moved.scene is not read.scene
    assert moved.scene.objects["box"].placement.translation[0] == 0.7
    np.testing.assert_allclose(wb.solve(moved).q, wb.solve(first).q, atol=1e-12)


class Hit(Tries):
    """A method during whose first solve Ctrl-C is hit."""

    def solve(self, problem: wb.Problem, progress: Any = None) -> wb.Solution:
        return wb.solve(problem, progress=lambda entry: signal.raise_signal(signal.SIGINT))


def test_ctrl_c_ends_all_and_not_one_solve(arm: wb.Figure) -> None:
    with pytest.raises(KeyboardInterrupt):
        wb.solve_many([problem(arm, (5.0, 0.0, 0.5))], Hit())
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
