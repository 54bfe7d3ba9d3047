"""Reach maps: compared with where a planar arm provably reaches, and with whole solves of single places."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.cli.main import main
from wholebody.studies.reach_result import BEYOND, EXCLUDED, INSIDE, REACHED

PLANAR = """<robot name="planar"><link name="base"/>
<link name="upper"><collision><origin xyz="0.2 0 0"/><geometry><sphere radius="0.02"/></geometry></collision></link>
<link name="lower"><collision><origin xyz="0.2 0 0"/><geometry><sphere radius="0.02"/></geometry></collision></link>
<link name="tip"/>
<joint name="first" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
<limit lower="-3.1" upper="3.1" effort="1" velocity="1"/></joint>
<joint name="second" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/>
<axis xyz="0 0 1"/><limit lower="-3.1" upper="3.1" effort="1" velocity="1"/></joint>
<joint name="end" type="fixed"><parent link="lower"/><child link="tip"/><origin xyz="0.3 0 0"/></joint>
</robot>"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("reach")
    (made / "planar.urdf").write_text(PLANAR)
    (made / "task.toml").write_text('[figure]\npath = "planar.urdf"\n')
    return made


@pytest.fixture(scope="module")
def planar(folder: Path) -> wb.Problem:
    figure = wb.load(folder / "planar.urdf")
    return wb.Problem(wb.Scene(figure), figure.with_joints(figure.neutral, {"first": 0.1, "second": 0.4}))


@pytest.fixture(scope="module")
def found(planar: wb.Problem) -> wb.studies.ReachMap:
    return area(planar)


def area(problem: wb.Problem, **options: Any) -> wb.studies.ReachMap:
    return wb.reach_map(problem, "tip", (-0.8, -0.8, 0.0), (0.8, 0.8, 0.0), 0.1, **options)


def test_a_planar_arm_reaches_its_ring(planar: wb.Problem, found: wb.studies.ReachMap) -> None:
    distance = np.hypot(*np.meshgrid(found.x, found.y, indexing="ij"))[..., None]
    ring = (distance > 0.1 + 1e-3) & (distance < 0.7 - 1e-3)  # lengths 0.4 and 0.3
    outside = (distance > 0.7 + 1e-3) | (distance < 0.1 - 1e-3)
    assert not found.reached[outside].any()
    assert found.reached[ring].mean() > 0.97  # places behind the gap of the first joint's limits may be missed
    assert (found.verdict[distance > 0.7 + 1e-3] == BEYOND).all()
    for place in zip(*np.nonzero(found.reached), strict=True):
        there = planar.scene.figure.placement(found.q[place], "tip").translation
        np.testing.assert_allclose(there[:2], (found.x[place[0]], found.y[place[1]]), atol=2e-5)
    assert found.volume == pytest.approx(0.01 * found.reached.sum())  # no place at the edge of the grid is reached
    whole = replace(found, verdict=np.full_like(found.verdict, REACHED))
    assert whole.volume == pytest.approx(1.6**2)


def test_what_is_left_is_the_distance_from_the_ring(found: wb.studies.ReachMap) -> None:
    distance = np.hypot(*np.meshgrid(found.x, found.y, indexing="ij"))[..., None]
    true = distance - 0.7
    assert (found.left[true > 1e-3] <= true[true > 1e-3] + 1e-9).all()
    beyond = found.verdict == BEYOND
    np.testing.assert_allclose(found.left[beyond], true[beyond], atol=1e-6)


def test_the_map_is_the_same_whatever_jobs_is(planar: wb.Problem, found: wb.studies.ReachMap) -> None:
    one, two = found, area(planar, jobs=2)
    np.testing.assert_array_equal(one.verdict, two.verdict)
    np.testing.assert_array_equal(one.q, two.q)


def test_places_inside_of_things_and_behind_them(planar: wb.Problem, folder: Path) -> None:
    figure = wb.load(Path(__file__).resolve().parents[2] / "examples" / "tasks" / "arm.urdf")
    scene = wb.Scene(figure)
    scene.add(wb.Box((0.3, 0.3, 0.3)), name="block", at=(0.5, 0.0, 0.5))
    found = wb.reach_map(wb.Problem(scene), "grip", (0.2, -0.3, 0.2), (0.8, 0.3, 0.8), 0.3)
    x, y, z = np.meshgrid(found.x, found.y, found.z, indexing="ij")
    deep = (abs(x - 0.5) < 0.149) & (abs(y) < 0.149) & (abs(z - 0.5) < 0.149)
    assert not found.reached[deep].any()
    assert found.reached.any()
    solved = agree = 0
    for place in list(zip(*np.nonzero(~deep), strict=True))[::8]:
        whole = wb.solve(wb.Problem(scene, goals=[wb.Point("grip", (x[place], y[place], z[place]))]))
        agree += whole.solved == bool(found.verdict[place] == REACHED)
        solved += 1
    assert agree >= 0.9 * solved
    assert INSIDE not in found.verdict[~deep & (abs(x - 0.5) > 0.2)]


def test_an_end_by_the_caller_leaves_places_untried(planar: wb.Problem) -> None:
    found = area(planar, progress=lambda done, total: True)
    assert set(found.counts()) <= {"not tried", "beyond"}


@pytest.mark.parametrize("stop", [1, 6])
def test_a_caller_who_ends_the_search_is_not_asked_again(planar: wb.Problem, stop: int) -> None:
    """Also at the last answer of a wave, as the 6th is."""
    told: list[int] = []

    def ends(settled: int, _: int) -> bool:
        told.append(settled)
        return len(told) == stop

    area(planar, progress=ends)
    assert len(told) == stop
    assert told == sorted(told)


def test_files(found: wb.studies.ReachMap, tmp_path: Path) -> None:
    loaded = np.load(found.save(tmp_path / "a.npz"))
    np.testing.assert_array_equal(loaded["verdict"], found.verdict)
    lines = found.to_vtk(tmp_path / "a.vtk").read_text().splitlines()
    assert "DIMENSIONS 17 17 1" in lines
    first = lines.index("LOOKUP_TABLE default") + 1
    values = np.array(lines[first : first + 289], dtype=int).reshape((17, 17, 1), order="F")
    np.testing.assert_array_equal(values, found.verdict)
    assert found.picture(tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    page = found.html(tmp_path / "a.html").read_text()
    assert page.count("<img") == 1
    assert "http" not in page


def test_the_command_writes_all_files(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    grid = ["--frame", "tip", "--low=-0.4,-0.4,0", "--high", "0.4,0.4,0", "--step", "0.2"]
    assert main(["reach", str(folder / "task.toml"), *grid, "--out", str(tmp_path)]) == 0
    assert "m^2" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {"reach.png", "reach.html", "reach.npz", "reach.vtk"}
    for wrong in (["--step", "x"], ["--step", "-1"], ["--low", "1,2"], ["--frame", "tap"], ["--low", "9,9,9"]):
        assert main(["reach", str(folder / "task.toml"), *grid, *wrong, "--out", str(tmp_path)]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_what_one_of_the_two_branches_reaches_is_reached(planar: wb.Problem) -> None:
    # The links' balls are at the elbow's and the forearm's middle: both closed forms of each place, judged by coal.
    figure, scene = planar.scene.figure, wb.Scene(planar.scene.figure)
    for number, at in enumerate(np.random.default_rng(1).uniform(-0.5, 0.5, (5, 2))):
        scene.add(wb.Sphere(0.05), name=f"ball {number}", at=(*at, 0.0))
    found = area(wb.Problem(scene, planar.start))
    for place in np.argwhere(found.verdict >= 0).tolist():
        x, y = found.x[place[0]], found.y[place[1]]
        cosine = (x * x + y * y - 0.4**2 - 0.3**2) / (2.0 * 0.4 * 0.3)
        if abs(abs(cosine) - 1.0) < 1e-3:  # at the very edge of the reach
            continue
        free = False
        for second in (np.arccos(cosine), -np.arccos(cosine)) if abs(cosine) < 1.0 else ():
            first = np.arctan2(y, x) - np.arctan2(0.3 * np.sin(second), 0.4 + 0.3 * np.cos(second))
            q = np.array([(first + np.pi) % (2.0 * np.pi) - np.pi, second])
            free |= bool(figure.within_limits(q)) and not scene.penetration(q)
        assert found.reached[tuple(place)] == free, (x, y)


def test_no_place_is_left_out_that_is_reached(root: Path) -> None:
    # A descent to a place beside missed it by 0.5 m, and places within that distance were left out.
    arm, rng = wb.load(str(root / "tests/data/arm/arm.urdf")), np.random.default_rng(0)
    scene = wb.Scene(arm)
    for number in range(6):
        size, at = rng.uniform(0.2, 0.5, 3), rng.uniform((-0.9, -0.9, 0.0), (0.9, 0.9, 1.2))
        scene.add(wb.Box(tuple(size)), name=f"box {number}", at=tuple(at))
    start = arm.neutral
    while scene.penetration(start):
        start = arm.clamp(pin.integrate(arm.model, arm.neutral, rng.uniform(-1.5, 1.5, arm.model.nv)))
    found = wb.reach_map(wb.Problem(scene, start), "tool", (-1.0, -1.0, 0.1), (1.0, 1.0, 1.3), 0.25)
    for place in np.argwhere(found.verdict == EXCLUDED).tolist():
        at = found.x[place[0]], found.y[place[1]], found.z[place[2]]
        assert not wb.solve(wb.Problem(scene, start, goals=[wb.Point("tool", at)]), "qp").solved, at
