"""What a run sees: distances of closed forms, and things where they were at its last look, whoever moves them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.scene.moving_obstacles import Collision
from wholebody.scene.workspace import SETS, Workspace

RADIUS = 0.02  # m, of the arm
BALLS = {"near": (0.9, 0.3, 0.05), "far": (0.2, -0.7, 0.02), "high": (0.4, 0.1, 0.4)}  # radius of each: 0.05 m


@pytest.fixture
def scene(planar_arm: Callable[..., wb.Figure]) -> wb.Scene:
    """An arm of two links of half a metre in the plane z = 0, among balls, with a ball 0.1 m beside the last link."""
    scene = wb.Scene(planar_arm((0.5, 0.5)))
    for name, at in BALLS.items():
        scene.add(wb.Sphere(0.05), name=name, at=at)
    return scene.attach(wb.Sphere(0.03), to="link1", name="carried", at=(0.3, 0.1, 0.0))


def at_angles(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The elbow (3,) and the tip (3,)."""
    elbow = 0.5 * np.array((np.cos(q[0]), np.sin(q[0]), 0.0))
    return elbow, elbow + 0.5 * np.array((np.cos(q[0] + q[1]), np.sin(q[0] + q[1]), 0.0))


def gaps(q: np.ndarray, balls: dict[str, tuple[float, float, float]] | None = None) -> dict[frozenset[str], float]:
    """Signed distances of all pairs with a ball."""
    elbow, tip = at_angles(q)
    along = (tip - elbow) / 0.5
    carried = elbow + 0.3 * along + 0.1 * np.cross((0.0, 0.0, 1.0), along)
    found = {frozenset(("link0", "carried")): to_segment(carried, np.zeros(3), elbow) - RADIUS - 0.03}
    for name, at in (balls or BALLS).items():
        found[frozenset((name, "link0"))] = to_segment(np.array(at), np.zeros(3), elbow) - RADIUS - 0.05
        found[frozenset((name, "link1"))] = to_segment(np.array(at), elbow, tip) - RADIUS - 0.05
        found[frozenset((name, "carried"))] = float(np.linalg.norm(carried - at)) - 0.03 - 0.05
    return found


def to_segment(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    share = np.clip((point - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
    return float(np.linalg.norm(point - start - share * (end - start)))


def postures(count: int) -> np.ndarray:
    return np.random.default_rng(4).uniform((-1.5, -1.0), (1.0, 1.5), (count, 2))


def named(workspace: Workspace) -> list[frozenset[str]]:
    """Both owners of each pair."""
    return [frozenset(workspace.owners[piece] for piece in pair) for pair in workspace.table.pairs]


def test_the_deepest_overlap_is_that_of_closed_forms(scene: wb.Scene) -> None:
    with scene.borrow() as workspace:
        found = [workspace.deepest(q) for q in postures(60)]
    expected = [max(-min(gaps(q).values()), 0.0) for q in postures(60)]
    assert found == pytest.approx(expected, abs=2e-6)
    assert 4 <= np.count_nonzero(found) < 50


def test_the_least_gap_is_that_of_closed_forms_and_its_sign_is_whatever_was_asked_before(scene: wb.Scene) -> None:
    signs = set()
    with scene.borrow() as workspace:
        clearances = 0.02 + 0.05 * np.arange(len(workspace.table.pairs)) / len(workspace.table.pairs)
        for q in postures(60):
            every = [gaps(q)[pair] - least for pair, least in zip(named(workspace), clearances, strict=True)]
            workspace.least_gap(q, clearances, 0.25)
            found = workspace.least_gap(q, clearances, 0.25)  # as a pair that was too near says
            if min(every) >= 0.0:
                beyond = min(gaps(q).values()) > 0.25
                assert found == (np.inf if beyond else pytest.approx(min(every), abs=2e-6))
            else:  # of any pair that is too near
                assert any(gap < 0.0 and found == pytest.approx(gap, abs=2e-6) for gap in every)
            signs.add(np.sign(found))
        q = next(q for q in postures(60) if min(gaps(q).values()) > 0.07)
        assert workspace.least_gap(q, np.zeros(len(clearances)), 1e-3) == np.inf
    assert signs == {-1.0, 1.0}


def test_no_distance_falls_by_more_than_the_largest_approach(scene: wb.Scene) -> None:
    rng, nearest_bound = np.random.default_rng(5), np.inf
    with scene.borrow() as workspace:
        pairs = named(workspace)
        for q in postures(40):
            most = rng.uniform(0.0, 0.3, 2)
            bounds = workspace.largest_approach(most)
            for _ in range(20):
                there = q + most * rng.choice([-1.0, 1.0, 0.5], 2)
                before, after = gaps(q), gaps(there)
                for pair, bound in zip(pairs, bounds, strict=True):
                    if "carried" not in pair:
                        assert before[pair] - after[pair] <= bound + 1e-9
                        nearest_bound = min(nearest_bound, bound / max(before[pair] - after[pair], 1e-9))
    carried = np.array(["carried" in pair for pair in pairs])
    assert np.isinf(bounds[carried]).all()
    assert np.isfinite(bounds[~carried]).all()
    assert nearest_bound < 1.3  # it is no bound far beyond


def test_a_run_sees_things_where_they_were_until_it_looks_again(scene: wb.Scene) -> None:
    q, there = np.array((0.3, 0.2)), (0.9, 0.45, 0.05)
    workspace, other = scene.workspace(), scene.workspace()
    before = workspace.where("near")
    scene.move("near", at=there)
    assert workspace.deepest(q) == pytest.approx(max(-min(gaps(q).values()), 0.0), abs=2e-6)
    assert not workspace.moved
    workspace.refresh()
    moved = {**BALLS, "near": there}
    assert workspace.near(q, 0.5).distance.min() == pytest.approx(min(gaps(q, moved).values()), abs=2e-6)
    assert workspace.where("near").translation == pytest.approx(there)
    start, end = workspace.moved["near"]  # it was put there, and passed nothing on the way
    assert start.translation == pytest.approx(there)
    assert end.translation == pytest.approx(there)
    scene.move("near", at=BALLS["near"], over=0.1)
    workspace.refresh()
    start, end = workspace.moved["near"]
    assert start.translation == pytest.approx(there)
    assert end.translation == pytest.approx(BALLS["near"])
    assert set(workspace.moved) == {"near"}
    assert other.where("near") == before
    workspace.begin()
    assert not workspace.moved


def test_a_run_places_things_for_itself(scene: wb.Scene) -> None:
    q, there = np.array((0.3, 0.2)), (0.85, 0.4, 0.0)
    workspace = scene.workspace()
    workspace.place({"near": pin.SE3(np.eye(3), np.array(there))})
    expected = min(gaps(q, {**BALLS, "near": there}).values())
    assert expected != pytest.approx(min(gaps(q).values()), abs=1e-3)
    assert workspace.near(q, 0.5).distance.min() == pytest.approx(expected, abs=2e-6)
    assert scene.contacts(q, 0.5).distance.min() == pytest.approx(min(gaps(q).values()), abs=2e-6)
    # so does a frame in which another one moves, of a set that it had before
    far = (workspace.where("far"),) * 2
    straight = np.array((0.0, 0.0))
    assert workspace.frame({"far": far}).first_contact(straight, q, 1e-4) is not None
    workspace.place({"near": pin.SE3(np.eye(3), np.array((0.9, 0.3, 5.0)))})
    assert workspace.frame({"far": far}).first_contact(straight, q, 1e-4) is None


def test_frames_are_of_what_moved_and_of_what_was_put_into_the_figure(scene: wb.Scene) -> None:
    workspace, q = scene.workspace(), np.array((0.3, 0.2))
    assert workspace.next_frame(q) is None
    elbow, tip = at_angles(q)
    scene.move("near", at=tuple(0.5 * (elbow + tip))).move("high", at=(0.0, 0.0, 0.9))
    workspace.refresh()
    frame = workspace.next_frame(q)  # `high` was put where nothing is
    assert frame is not None
    assert set(frame.names) == {"near"}
    assert frame.still
    assert workspace.next_frame(q) is None  # each counts once,
    workspace.keep(frame, [Collision("near", "link1", 0.07, True)])
    again = workspace.next_frame(q)  # unless it could not be kept out
    assert again is not None
    assert set(again.names) == {"near"}
    assert again.placements(0.5)["near"].translation == pytest.approx(0.5 * (elbow + tip))
    scene.move("far", at=(0.0, -0.9, 0.0), over=0.1)
    workspace.refresh()
    both = workspace.next_frame(q)
    assert both is not None
    assert set(both.names) == {"near", "far"}
    assert not both.still
    middle = both.placements(0.5)
    assert middle["far"].translation == pytest.approx(0.5 * (np.array(BALLS["far"]) + (0.0, -0.9, 0.0)))
    assert middle["near"].translation == pytest.approx(0.5 * (elbow + tip))
    workspace.keep(both, [])
    assert workspace.next_frame(q) is None


def test_frames_that_take_turns_are_kept_up_to_a_number(scene: wb.Scene) -> None:
    for number in range(SETS + 1):
        scene.add(wb.Sphere(0.01), name=f"mote {number}", at=(0.0, 0.0, 1.0 + number))
    workspace = scene.workspace()
    frames = [workspace.frame({f"mote {k}": (workspace.where(f"mote {k}"),) * 2}) for k in range(SETS)]
    kept = workspace.frame({"mote 0": (workspace.where("mote 0"),) * 2})
    assert kept._both is frames[0]._both
    workspace.frame({f"mote {SETS}": (workspace.where(f"mote {SETS}"),) * 2})  # the one that moved longest ago goes
    for number, same in ((0, True), (2, True), (1, False)):
        found = workspace.frame({f"mote {number}": (workspace.where(f"mote {number}"),) * 2})
        assert (found._both is frames[number]._both) is same


def test_a_sweep_of_what_is_carried_is_that_of_fine_subdivision(scene: wb.Scene) -> None:
    """A carried ball moves straight in its link's frame while the arm turns; distances by closed forms."""
    rng, hits, free = np.random.default_rng(6), 0, 0
    for _ in range(30):
        q, there = rng.uniform(-1.5, 1.5, (2, 2))
        way = rng.uniform((0.0, 0.1, -0.05), (0.5, 0.25, 0.05), (2, 3))
        if least_on_the_way(q, way[0]) < 1e-3:
            continue
        least = [
            least_on_the_way(q + share * (there - q), way[0] + share * (way[1] - way[0]))
            for share in np.linspace(0.0, 1.0, 300)
        ]
        found = scene.sweep(q, there, moves={"carried": (way[0], way[1])})
        if found is None:
            assert min(least) >= -1e-4
            free += 1
            continue
        assert min(least[: int(299 * found.fraction)], default=0.0) >= -1e-4
        at = least_on_the_way(q + found.fraction * (there - q), way[0] + found.fraction * (way[1] - way[0]))
        assert at == pytest.approx(-0.75e-4, abs=0.27e-4)
        assert found.q == pytest.approx(q + found.fraction * (there - q))
        hits += 1
    assert hits >= 5
    assert free >= 3


def least_on_the_way(q: np.ndarray, local: np.ndarray) -> float:
    """The least distance with the carried ball at a place (3,) of its link."""
    elbow, tip = at_angles(q)
    along = (tip - elbow) / 0.5
    carried = elbow + local[0] * along + local[1] * np.cross((0.0, 0.0, 1.0), along) + (0.0, 0.0, local[2])
    every = [gap for pair, gap in gaps(q).items() if "carried" not in pair]
    every += [float(np.linalg.norm(carried - at)) - 0.03 - 0.05 for at in BALLS.values()]
    return min([*every, to_segment(carried, np.zeros(3), elbow) - RADIUS - 0.03])
