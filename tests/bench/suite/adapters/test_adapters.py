"""Every installed adapter solves a free reach of an arm, and says what it is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import InputError, MissingPackageError, UnknownNameError
from wholebody.bench.suite.adapters.base import FEASIBILITY_ONLY, Adapter
from wholebody.bench.suite.adapters.registry import adapters, missing, names
from wholebody.bench.suite.compare.run import Settings
from wholebody.bench.suite.problem_sets.registry import SETS

INSTALLED = adapters(["all"])
CUBE = 0.05 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


by_name = pytest.mark.parametrize("adapter", INSTALLED, ids=lambda adapter: adapter.name)
FAMILIES = [adapter for adapter in INSTALLED if "/" not in adapter.name]  # variants solve as their family does
of_each = pytest.mark.parametrize("adapter", FAMILIES, ids=lambda adapter: adapter.name)
takes_points = pytest.mark.parametrize(
    "adapter",
    [adapter for adapter in FAMILIES if adapter.name not in ("optik", "tracik", "eaik")],
    ids=lambda adapter: adapter.name,
)


@pytest.fixture(scope="module")
def reach(root: Path) -> wb.Problem:
    """Return a reach of a robot arm that a known posture makes possible."""
    figure = wb.load(root / "tests/data/arm/arm.urdf")
    witness = figure.clamp(pin.integrate(figure.model, figure.neutral, np.full(figure.model.nv, 0.4)))
    state = wb.Scene(figure).state(witness)
    tip = figure.model.names[-1]
    there = pin.SE3(state.frame(figure.frame_id(tip)))
    return wb.Problem(wb.Scene(figure), goals=[wb.Point(tip, there.translation, offset=(0.0, 0.0, 0.1))])


@by_name
def test_it_states_what_it_is_and_its_budgets_are_usable(adapter: Adapter) -> None:
    assert adapter.name in names()
    assert adapter.setup.endswith(".")
    assert all(sentence and not sentence.endswith(".") for sentence in adapter.differences)
    tolerances = [tolerance for tolerance, iterations in adapter.loose if iterations is None]
    assert tolerances == sorted(tolerances, reverse=True)
    for budget in adapter.loose:
        assert adapter.make(*budget) is not adapter.make(*budget)


@takes_points
def test_it_solves_a_free_reach_of_an_arm(adapter: Adapter, reach: wb.Problem) -> None:
    method = adapter.make(1e-4, None)
    adapter.prepare(method, reach)
    solution = method.solve(reach)
    judged = wb.assess(reach, solution.q)
    assert solution.status == "solved", solution.message
    assert judged.met(1.1e-4)
    assert judged.holds(1.1e-4)
    assert solution.assessment.goal_error == pytest.approx(judged.goal_error, abs=1e-12)


@pytest.fixture(scope="module")
def table(standing_before: Callable[..., wb.Problem]) -> wb.Problem:
    """Return a reach of a standing human to a place above a table, by a point of the hand."""
    goal = wb.Point("right_hand", (0.35, -0.2, 0.9), offset=(0.0, 0.0, -0.05))
    return standing_before("table", (0.5, 1.0, 0.04), (0.5, 0.0, 0.75), goal)


@of_each
def test_it_solves_a_reach_of_a_human_or_refuses_or_says_what_is_wrong(adapter: Adapter, table: wb.Problem) -> None:
    method = adapter.make(1e-4, None)
    if method.accepts(table) is not None:
        with pytest.raises(InputError, match=r"free root|Hold|Point"):
            method.solve(table)
        return
    solution = method.solve(table)
    judged = wb.assess(table, solution.q)
    assert np.isfinite(solution.q).all()
    assert table.scene.figure.within_limits(solution.q)
    assert solution.solved == (judged.met(1.1e-4) and judged.holds(1.1e-4))
    # mink's programs with hard holds have no solution on the way here, which its message says
    if adapter.name not in ("ccd", "dls", "drake", "newton/slack", "newton/barrier", "newton/kkt"):
        assert solution.solved, solution.message


@takes_points
def test_out_of_reach_by_a_metre_is_not_called_solved(adapter: Adapter, reach: wb.Problem) -> None:
    figure = reach.scene.figure
    problem = wb.Problem(wb.Scene(figure), goals=[wb.Point(figure.model.names[-1], (0.0, 2.2, 0.3))])
    solution = adapter.make(1e-4, 60).solve(problem)
    assert np.isfinite(solution.q).all()
    assert figure.within_limits(solution.q)
    assert solution.status in ("unreachable", "stalled")
    assert wb.assess(problem, solution.q).goal_error > 0.9


@of_each
def test_what_it_cannot_express_is_refused_by_name(adapter: Adapter, table: wb.Problem) -> None:
    if f"{adapter.name}/".startswith(("qp/", "newton/")):
        pytest.skip("it takes every term that there is")
    refused = [wb.Plane("head", (0, 0, 1), side="above"), wb.tasks.ReachCones()]
    problem = wb.Problem(table.scene, goals=table.goals, constraints=refused)
    with pytest.raises(InputError, match=r"Plane|ReachCones"):
        adapter.make(1e-4, None).solve(problem)
    method = adapter.make(1e-4, None)
    if adapter.name in ("placo", "pink", "mink"):
        with pytest.raises(InputError, match=r"Plane|ReachCones"):
            adapter.prepare(method, problem)


@takes_points
def test_objects_that_moved_are_where_they_are_now(adapter: Adapter, planar_arm: Callable[..., wb.Figure]) -> None:
    if adapter.name == "dls":
        pytest.skip("it sees no objects")
    scene = wb.Scene(planar_arm((0.4, 0.3, 0.2))).add(wb.Hull(CUBE), name="cube", at=(3.0, 0.0, 0.0))
    problem = wb.Problem(scene, np.array([0.3, 0.4, 0.4]), goals=[wb.Point("tip", (0.1, 0.7, 0.0))])
    method = adapter.make(1e-4, None)
    first = method.solve(problem)
    assert first.solved, first.message
    elbow = scene.state(first.q).frame(scene.frame_id("link2")).translation
    scene.move("cube", at=tuple(elbow + (0.06, 0.0, 0.0)))
    assert wb.assess(problem, first.q).penetration > 0.005
    second = method.solve(problem)
    inside = wb.assess(problem, second.q).penetration
    if adapter.name == "mink":  # it drops pairs of the world and the body that hangs on it
        assert inside < 1e-3 or second.status == "infeasible"
    else:
        assert inside < 1e-3


def test_unknown_and_missing_adapters_are_named() -> None:
    with pytest.raises(UnknownNameError, match="qp/osqp"):
        adapters(["qp/osqq"])
    assert [adapter.name for adapter in adapters(["ccd", "qp/osqp"])] == ["ccd", "qp/osqp"]
    assert [adapter.name for adapter in adapters(["newton", "newton/kkt"])] == [
        "newton/slack", "newton/barrier", "newton/kkt",
    ]  # fmt: skip
    assert {adapter.name for adapter in adapters(["all"], starts=True)} | set(missing()) == set(names())
    for name, command in missing().items():
        assert command.startswith("pip install")
        with pytest.raises(MissingPackageError, match="pip install"):
            adapters([name])


def test_budgets_of_feasibility_only_leave_the_measures_out_and_have_no_part_in_drags(table: wb.Problem) -> None:
    (adapter,) = adapters(["qp/osqp"])
    solutions = [adapter.make(1e-4, most).solve(table) for most in (None, FEASIBILITY_ONLY)]
    assert all(solution.solved for solution in solutions)
    assert solutions[1].iterations < solutions[0].iterations
    assert solutions[1].assessment.measure > solutions[0].assessment.measure
    kinds = [level[1] for level in adapter.loose]
    assert FEASIBILITY_ONLY in kinds
    assert FEASIBILITY_ONLY not in kinds[kinds.index(None) :]
    settings = Settings(sets=tuple(SETS.values()), adapters=(adapter,))
    chosen = settings.ladder(adapter)
    for kind in (FEASIBILITY_ONLY, None):
        assert min(level[0] for level in chosen if level[1] == kind) == 1e-8, "the most exact of each kind"
    assert FEASIBILITY_ONLY not in [level[1] for level in settings.ladder(adapter, moving=True)]


def test_pruned_placo_loses_pairs_of_the_figure_alone_and_few_of_them_ever_meet(table: wb.Problem) -> None:
    pytest.importorskip("placo")
    (adapter,) = adapters(["placo/pruned"])
    kept = adapter.make(1e-4, None).pairs(table)  # type: ignore[attr-defined]
    geometry, figure = table.scene.geometry, table.scene.figure
    lost = np.setdiff1d(np.arange(len(geometry.collisionPairs)), kept)
    own = {piece.name for piece in wb.Scene(figure).geometry.geometryObjects}
    names = [
        {geometry.geometryObjects[index].name for index in (pair.first, pair.second)}
        for pair in (geometry.collisionPairs[number] for number in lost.tolist())
    ]
    assert names
    assert all(pair <= own for pair in names)
    rng, q, met = np.random.default_rng(7), figure.posture("standing"), np.zeros(len(geometry.collisionPairs))
    workspace = table.scene.workspace()
    for _ in range(500):  # other postures than those that it was pruned by
        q[figure.limits.idx_q] = rng.uniform(figure.limits.lower, figure.limits.upper)
        met[workspace.near(q, 0.0).number] += 1
    assert met[lost].sum() < 0.001 * met[kept].sum()
