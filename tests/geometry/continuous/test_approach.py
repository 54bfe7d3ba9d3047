"""The bound on how much nearer pieces can come, against coal at random ends of random motions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb

SLIDING = (
    '<robot name="r"><link name="a">{ball}</link><link name="b">{ball}</link><link name="c">{ball}</link>'
    '<link name="d">{ball}</link>'
    '<joint name="s" type="prismatic"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>'
    '<limit lower="-0.2" upper="0.3" effort="1" velocity="3"/></joint>'
    '<joint name="t" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="3"/><mimic joint="s" multiplier="2"/></joint>'
    '<joint name="u" type="prismatic"><parent link="c"/><child link="d"/><origin xyz="0.3 0 0"/><axis xyz="1 0 0"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="3"/><mimic joint="s" multiplier="-1.5" offset="0.1"/></joint>'
    "</robot>"
).format(ball='<collision><geometry><box size="0.1 0.2 0.05"/></geometry></collision>')


def asker(scene: wb.Scene) -> Callable[[np.ndarray], np.ndarray]:
    """Distances of all pairs at a posture, by coal."""
    data, placed = scene.model.createData(), pin.GeometryData(scene.geometry)

    def distances(q: np.ndarray) -> np.ndarray:
        pin.computeDistances(scene.model, data, scene.geometry, placed, q)
        return np.array([result.min_distance for result in placed.distanceResults])

    return distances


@pytest.mark.parametrize("name", ["human", "arm", "sliding"])
def test_no_pair_comes_nearer_than_the_bound_says(name: str, root: Path, tmp_path: Path) -> None:
    (tmp_path / "sliding.urdf").write_text(SLIDING)
    files = {"arm": str(root / "tests/data/arm/arm.urdf"), "sliding": str(tmp_path / "sliding.urdf")}
    figure = wb.load(files.get(name, name))
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor", at=(0.0, 0.0, -0.5))
    scene.add(wb.Box((0.1, 0.2, 0.3)), name="box", at=(0.5, 0.4, 1.0))
    rng, model = np.random.default_rng(5), scene.model
    most = rng.uniform(0.01, 0.3, model.nv)
    workspace = scene.workspace()
    bound = workspace.largest_approach(most)
    each = workspace.largest_approach(np.diag(most))  # of a motion of each freedom alone
    assert np.isfinite(bound).all()
    assert (each.sum(axis=1) >= bound - 1e-12).all()
    assert (each <= bound[:, None] + 1e-12).all()
    tightest, distances = np.inf, asker(scene)
    for _ in range(40):
        q = figure.clamp(pin.integrate(model, figure.neutral, 0.5 * rng.normal(size=model.nv)))
        ends = figure.clamp(pin.integrate(model, q, most * rng.choice([-1.0, 0.0, 1.0], model.nv)))
        fallen = distances(q) - distances(ends)
        assert (fallen <= bound + 2e-5).all()
        tightest = min(tightest, float((bound - fallen).min()))
    assert tightest < 0.7 * np.median(bound[np.isfinite(bound)])


def test_nothing_is_known_of_carried_things_and_endless_freedoms(root: Path) -> None:
    figure = wb.load(str(root / "tests/data/arm/arm.urdf"))
    scene = wb.Scene(figure).attach(wb.Sphere(0.05), to=figure.segments[-1], name="cup", at=(0.0, 0.0, 0.3))
    scene.add(wb.Sphere(0.05), name="ball", at=(1.0, 0.0, 0.0))
    workspace = scene.workspace()
    bound = workspace.largest_approach(np.full(figure.model.nv, 0.1))
    carried = np.array(
        [["cup" in (workspace.owners[a], workspace.owners[b])] for a, b in workspace.table.pairs]
    ).ravel()
    assert carried.any()
    assert np.isinf(bound[carried]).all()
    assert np.isfinite(bound[~carried]).all()
    assert not np.isfinite(workspace.largest_approach(np.full(figure.model.nv, np.inf))).any()


def test_rows_that_a_step_leaves_out_cannot_be_missed() -> None:
    """At random postures no pair without a row comes nearer than its clearance by any motion within the bounds."""
    scene = wb.Scene(wb.load("hand"))
    speed, dt, model = 4.0, 0.01, scene.model
    limit = (
        wb.tasks.StepLimit(speed, root_velocity=1.0, root_turn=2.0)
        if scene.figure.root == "free"
        else wb.tasks.StepLimit(speed)
    )
    problem = wb.Problem(scene, constraints=[limit], clearance=0.001)
    lineariser = problem.lineariser(problem.workspace(), dt)
    whole = problem.lineariser(problem.workspace(), None)
    rng, fewer, distances = np.random.default_rng(3), 0, asker(scene)
    for _ in range(20):
        q = scene.figure.clamp(pin.integrate(model, scene.figure.neutral, 0.3 * rng.normal(size=model.nv)))
        at, every = lineariser.at(q, 0.06), whole.at(q, 0.06)
        left = np.setdiff1d(every.contacts.number, at.contacts.number)
        fewer += len(left)
        for _ in range(5):
            dq = np.clip(rng.choice([-1.0, 1.0], model.nv), at.lower, at.upper)
            after = distances(pin.integrate(model, q, dq))
            assert (after[left] >= 0.001).all()
    assert fewer > 0
