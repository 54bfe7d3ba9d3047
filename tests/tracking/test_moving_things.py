"""Things that move during a frame: nothing passes through anybody silently, and "qp" gets out of their way.

What is true is found by fine subdivision: the thing is put, share by share, into a scene of its own, and all pairs are
asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.audits.throws import DT, SHAPES, Throw, throws
from wholebody import tracking
from wholebody.base.batches import fingerprint
from wholebody.methods.solve import as_method
from wholebody.tracking.loop import FrameLoop
from wholebody.tracking.overlaps import make_room

KINDS = {"plate": "plate of 1 mm", "board": "board", "ball": "ball", "rod": "rod"}
Path = Sequence[tuple[float, np.ndarray]]


class Thrown(Throw):
    """Judged by fine subdivision."""

    def __init__(self, seed: int, kind: str, speed: float, turn: float = 0.0) -> None:
        super().__init__(np.random.default_rng(seed), SHAPES[KINDS[kind]], speed, turn)
        self._judged = wb.Problem(self.scene)

    def deepest(self, path: Path, way: tuple[pin.SE3, pin.SE3], parts: int = 0) -> float:
        """Depth of the thing in the body along a path, metres."""
        depths = [0.0]
        for q in self.instants(path, way, parts or max(4, 120 // len(path))):
            found, owner = self.truth.contacts(q, 0.0), self.truth.piece_owner
            own = [row for row, (a, b) in enumerate(found.pair) if "thing" in (owner[a], owner[b])]
            depths += [-float(distance) for distance in found.distance[own]]
        return max(depths)

    def ends(self, q: np.ndarray) -> float:
        """Deepest overlap of all pairs at a posture, metres."""
        return wb.assess(self._judged, q).penetration


def problem_of(scene: wb.Scene, **more: object) -> wb.Problem:
    start = scene.figure.posture("standing")
    tip = scene.state(start).frame(scene.frame_id("right_index_tip")).translation.copy()
    return wb.Problem(scene, start, goals=[wb.Point("right_index_tip", tip)], clearance=0.001, **more)


@pytest.mark.parametrize(
    ("kind", "speed", "turn"),
    [("plate", 2.5, 3.0)],
)
def test_whoever_is_fast_enough_gets_out_of_the_way(kind: str, speed: float, turn: float) -> None:
    """The body may move by 4 m/s along any axis, so a free posture exists in every frame: it may go with the thing."""
    throw = Thrown(hash_of(kind, speed), kind, speed, turn)
    limits = wb.tasks.StepLimit(12.0, root_velocity=4.0, root_turn=6.0)
    problem = problem_of(throw.scene, constraints=[limits])
    tracker, q, touched = wb.methods.QP().tracker(problem, DT), problem.start, 0
    for _ in range(throw.frames):
        way = throw.next()
        step = tracker.step(q)
        assert not step.collisions
        assert throw.ends(step.q) < 1e-4
        assert np.abs(step.velocity[:3]).max() < 4.1  # of a path whose axes turn
        assert np.abs(step.velocity[6:]).max() < 12.0 + 1e-9
        assert step.path[0][1] == pytest.approx(q)
        assert step.path[-1][0] == 1.0
        touched += np.abs(step.q - q).max() > 0.005
        assert throw.deepest(step.path, way) < 2.5e-4
        q = step.q
    assert touched > 3


def test_nobody_ends_inside_where_the_root_could_have_gone_somewhere_free() -> None:
    """At 20 m/s nobody can go along: but to stay, or to go aside as far as speeds allow, is often free at the end."""
    limits = wb.tasks.StepLimit(12.0, root_velocity=4.0, root_turn=6.0)
    aside = [4.0 * DT * sign * axis for axis in np.eye(3) for sign in (-1.0, 1.0)]
    could = 0
    for seed, kind in enumerate(("board", "plate", "rod")):
        throw = Thrown(seed, kind, 20.0, 3.0)
        problem = problem_of(throw.scene, constraints=[limits])
        tracker, q = wb.methods.QP().tracker(problem, DT), problem.start
        for _ in range(throw.frames):
            throw.next()
            step = tracker.step(q)
            moved = [q, *(np.append(q[:3] + way, q[3:]) for way in aside)]
            if any(throw.ends(posture) < 5e-5 for posture in moved):
                could += bool(step.collisions)
                assert throw.ends(step.q) < 1e-4
            q = step.q
    assert could


def test_nobody_ends_inside_where_another_search_finds_a_free_posture() -> None:
    """The root has to turn and go at once, which programs from where it may go alone do not find."""
    row = throws("board", 20.0, "walks", swift=False, count=2)
    assert row["named"]
    assert row["silent"] == 0


def hash_of(kind: str, speed: float) -> int:
    return 10 * list(KINDS).index(kind) + int(speed)


@pytest.mark.parametrize(("method", "kind"), [("qp", "plate"), ("ccd", "plate")])
def test_what_passes_through_a_dragged_person_is_named(method: str, kind: str) -> None:
    named = free = through = 0
    for seed, speed in enumerate((4.0, 45.0)):
        throw = Thrown(hash_of(kind, 5.0) + seed, kind, speed, turn=2.0)
        drag = wb.tracking.Drag(problem_of(throw.scene), method)
        target, before = np.array(drag.problem.goals[0].target), drag.q
        for frame in range(throw.frames):
            way = throw.next()
            if (frame + 1) * DT * speed < 0.1:
                continue  # nothing is near yet
            answer = drag.to(target + (0.0, 0.0, 0.002 * frame))
            began, ends = (throw.deepest(((s, q), (s, q)), way, 1) for s, q in ((0.0, before), (1.0, answer.q)))
            names = {name for one in answer.collisions for name in (one.first, one.second)}
            if ends > 1.2e-4:
                assert "thing" in names
                assert any(one.inside and one.depth == pytest.approx(ends, abs=1e-4) for one in answer.collisions)
            if method != "qp" and began < 1e-5:  # others go straight
                assert "thing" in names or throw.deepest(((0.0, before), (1.0, answer.q)), way, 100) < 3e-4
            named += bool(names)
            free += not names
            through += any(not one.inside for one in answer.collisions)
            before = answer.q
            if speed < 10.0 and named:
                break
    assert free
    assert through or method == "qp"


@pytest.mark.parametrize("overlap", ["qp", "ccd"])
def test_the_frame_loop_names_what_it_cannot_avoid(overlap: str) -> None:
    """A person who stands, and one who walks."""
    for seed, kind, speed, walks in ((1, "ball", 1.5, 0.0), (3, "plate", 12.0, 1.3)):
        throw = Thrown(seed, kind, speed)
        q = throw.scene.figure.posture("standing")
        loop = FrameLoop(throw.scene, q, overlap=overlap)
        named = parts = 0
        for _ in range(min(throw.frames, 15)):
            before, way = loop.shown, throw.next()
            q = q.copy()
            q[0] += walks * DT
            frame = loop.frame(q)
            ends = throw.deepest(((1.0, frame.q), (1.0, frame.q)), way, 2)
            if ends > 1.2e-4:
                assert frame.collisions
            began = throw.deepest(((0.0, before), (0.0, before)), way, 1)
            assert frame.path[0][1] == pytest.approx(before)
            assert frame.path[-1][1] == pytest.approx(frame.q)
            parts = max(parts, len(frame.path) - 1)
            if not frame.collisions and began < 1e-5:  # what was in before was named then
                assert throw.deepest(frame.path, way, 30 if len(frame.path) < 4 else 0) < 4e-4
            for one in frame.collisions:
                assert str(one) in frame.note
            named += bool(frame.collisions)
        assert (parts > 1) == (overlap == "qp")
        if speed > 10.0:
            assert named
        elif overlap == "qp":
            assert not named


def test_what_was_put_somewhere_did_not_move(planar_arm) -> None:
    """A thing that is put on the other side of an arm passed through nothing; one that moved there did."""
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3))).add(wb.Sphere(0.02), name="ball", at=(0.7, 0.3, 0.0))
    problem = wb.Problem(scene, np.array([0.1, 0.2, 0.2]), constraints=[wb.tasks.StepLimit(0.1)])
    tracker = wb.methods.QP().tracker(problem, DT)
    q = tracker.step(problem.start).q
    scene.move("ball", at=(0.7, -0.3, 0.0))
    assert tracker.step(q).collisions == ()
    scene.move("ball", at=(0.7, 0.3, 0.0), over=DT)
    first = tracker.step(q)
    assert [one.second for one in first.collisions][:1] == ["ball"]
    assert not first.collisions[0].inside
    assert "ball" in str(first.collisions[0])
    assert tracker.step(first.q).collisions == ()  # it is out, and stays where it is


def test_room_that_is_made_in_a_scene_leaves_others_as_they_are() -> None:
    """Things of one size share their shapes, and what is not done again is known by the pickle of its scene."""
    hand = wb.load("hand")

    def scene() -> wb.Scene:
        return wb.Scene(hand).add(wb.Cylinder(0.03, 0.2), name="can", at=hand.neutral[:3], body=wb.Body(density=500.0))

    asked = fingerprint(scene())
    moved = scene()
    make_room(moved, hand.neutral)
    assert not np.allclose(moved.objects["can"].placement.translation, hand.neutral[:3])
    assert fingerprint(scene()) == asked


def test_what_stays_inside_is_named_until_it_is_out(planar_arm) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3))).add(wb.Sphere(0.05), name="ball", at=(0.7, 0.6, 0.0))
    start = np.array([0.1, 0.2, 0.2])
    problem = wb.Problem(scene, start, constraints=[wb.tasks.StepLimit(0.5)])
    tracker = wb.methods.QP().tracker(problem, DT)
    q = start
    elbow = scene.state(start).frame(scene.frame_id("tip")).translation
    scene.move("ball", at=elbow + (-0.05, 0.02, 0.0), over=DT)
    frames = 0
    while frames < 60:
        step = tracker.step(q)
        q, inside = step.q, -scene.contacts(step.q, 0.0).distance.min(initial=0.0)
        assert bool(step.collisions) == (inside > 1e-4)
        if not step.collisions:
            break
        frames += 1
    assert 0 < frames < 60


def test_a_sweep_may_have_things_that_move(planar_arm) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3))).add(wb.Box((0.3, 0.001, 0.3)), name="plate", at=(0.6, 0.5, 0.0))
    q = np.array([0.0, 0.0, 0.0])
    assert scene.sweep(q, q) is None
    found = scene.sweep(q, q, moves={"plate": ((0.6, 0.5, 0.0), (0.6, -0.5, 0.0))})
    assert found is not None
    assert found.q.shape == q.shape
    there = (0.6, 0.5 - found.fraction, 0.0)
    touching = scene.move("plate", at=there).contacts(q, 0.01)
    assert touching.distance[0] == pytest.approx(found.distance, abs=1e-6)
    assert -1e-4 <= found.distance <= 0.0
    assert scene.sweep(q, q, moves={"plate": ((0.6, 0.5, 0.0), (0.6, 0.3, 0.0))}) is None
    # moving along with the arm, it meets nothing
    turned = pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.1])), np.zeros(3))
    first = pin.SE3(np.eye(3), np.array([0.6, 0.2, 0.0]))
    assert scene.sweep(q, np.array([0.1, 0.0, 0.0]), moves={"plate": (first, turned * first)}) is None


def test_wrong_motions_are_one_sentence(planar_arm) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3))).add(wb.Sphere(0.02), name="ball", at=(0.7, 0.3, 0.0))
    for over in (0.0, -1.0, np.inf, "fast"):
        with pytest.raises(wb.InputError, match="over"):
            scene.move("ball", at=(0.0, 1.0, 0.0), over=over)
    assert scene.objects["ball"].motion is None
    scene.move("ball", at=(0.0, 1.0, 0.0), over=0.5)
    assert scene.objects["ball"].motion.seconds == 0.5
    assert scene.objects["ball"].motion.start.translation == pytest.approx([0.7, 0.3, 0.0])
    assert scene.move("ball", at=(0.0, 2.0, 0.0)).objects["ball"].motion is None
    q = np.zeros(3)
    with pytest.raises(wb.UnknownNameError, match="ball"):
        scene.sweep(q, q, moves={"bal": ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))})
    with pytest.raises(wb.InputError, match="two placements"):
        scene.sweep(q, q, moves={"ball": (0.0, 0.0, 0.0)})
    with pytest.raises(wb.InputError, match="end"):
        scene.sweep(q, q, moves={"ball": ((0.0, 0.0, 0.0), (np.nan, 0.0, 0.0))})


def test_a_whole_track_with_a_thing_that_moves_is_judged_with_it(planar_arm) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3))).add(wb.Sphere(0.05), name="ball", at=(0.7, 0.5, 0.0))
    q = np.array([0.1, 0.2, 0.2])
    ys = np.concatenate([np.linspace(0.5, 0.1, 30), np.linspace(0.1, 0.5, 20)])
    places = [(0.7, float(y), 0.0) for y in ys]
    track = wb.Clip(scene.figure, np.tile(q, (50, 1)), DT)
    recording = tracking.follow(scene, track, moves={"ball": places})
    assert scene.objects["ball"].placement.translation == pytest.approx([0.7, 0.5, 0.0])
    assert np.abs(recording.q - q).max() > 0.1  # it gave way
    carried = wb.Clip(scene.figure, track.q, DT, things={"ball": places})
    np.testing.assert_allclose(tracking.follow(scene, carried).q, recording.q, atol=1e-9)
    judged = tracking.judge(scene, recording)
    deepest = []
    for shown, tracked, place in zip(recording.q, recording.tracked, places, strict=True):
        scene.move("ball", at=place)
        deepest.append([-scene.contacts(one, 0.0).distance.min(initial=0.0) for one in (shown, tracked)])
    assert pytest.approx(np.array(deepest), abs=1e-9) == np.array([judged.depth, judged.tracked_depth]).T
    assert judged.depth.max() < 1e-4
    assert judged.tracked_depth.max() > 0.02
    assert judged.passed == ()
    held = replace(recording, q=recording.tracked)
    assert tracking.judge(scene, held).passed  # who stays is passed through
    for wrong in ({"ball": places[1:]}, {"ball": 3}, 4):
        with pytest.raises(wb.InputError, match="moves"):
            tracking.follow(scene, track, moves=wrong)
    with pytest.raises(wb.UnknownNameError, match="ball"):
        tracking.follow(scene, track, moves={"bell": places})


@pytest.mark.parametrize("method", ["qp", "newton", "ccd"])
def test_the_steps_of_every_tracker_name_what_passed(planar_arm, method: str) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3))).add(wb.Sphere(0.02), name="ball", at=(0.7, 0.8, 0.0))
    q = np.array([0.1, 0.2, 0.2])
    tip = scene.state(q).frame(scene.frame_id("tip")).translation.copy()
    problem = wb.Problem(scene, q, goals=[wb.Point("tip", tip)], constraints=[wb.tasks.StepLimit(0.5)])
    tracker = as_method(method).tracker(problem, DT)
    q = tracker.step(q).q
    assert tracker.step(q).collisions == ()
    scene.move("ball", at=(0.7, -0.8, 0.0), over=DT)
    named = tracker.step(q).collisions
    assert [(one.second, one.inside) for one in named][:1] == [("ball", False)]


def test_an_overlap_that_an_escape_leaves_is_named_until_it_is_gone():
    """A plate at 12 m/s: limb by limb the arm gives way late, and is freed some frames later."""
    turn, way = pin.exp3(np.array([0.0, 0.0, 1.97178])), np.array([-0.10439, 0.17285, 0.0])
    at = pin.SE3(turn, np.array([0.25848, -0.428, 1.38009]))
    scene = wb.Scene(wb.load("human")).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.001, 0.27728, 0.10526)), name="plate", at=at)
    start = scene.figure.posture("standing")
    loop, overlapping = FrameLoop(scene, start, overlap="ccd"), 0
    for _ in range(8):
        at = pin.SE3(turn, at.translation + way)
        scene.move("plate", at=at, over=DT)
        frame = loop.frame(start)
        if wb.assess(wb.Problem(scene, frame.q), frame.q).penetration > 1e-4:
            assert "inside" in frame.note or "overlap" in frame.note
            overlapping += 1
    assert overlapping
    assert not frame.note


@pytest.mark.parametrize("overlap", ["qp", "ccd"])
def test_a_frame_says_so_where_a_thing_was_put_into_the_figure(overlap: str) -> None:
    """The board jumps over the figure and into it; what is true is asked of all pairs of the scene."""
    scene = wb.Scene(wb.load("human")).add(wb.Box((0.02, 0.5, 0.5)), name="board", at=(2.0, 0.0, 1.2))
    q = scene.figure.posture("standing")
    loop, rng, inside, free = FrameLoop(scene, q, overlap=overlap), np.random.default_rng(0), 0, 0
    for number in range(16):
        if number % 4 == 0:
            scene.move("board", at=rng.uniform((-0.15, -0.3, 0.9), (0.15, 0.3, 1.4)))
        frame = loop.frame(q)
        overlaps = scene.contacts(frame.q, within=-1.2e-4)
        assert not len(overlaps.distance) or "board" in frame.note
        assert bool(frame.note) <= bool(len(scene.contacts(frame.q, within=-1e-5).distance) or frame.collisions)
        inside, free = inside + bool(len(overlaps.distance)), free + (not len(overlaps.distance))
    assert inside
    assert free


@pytest.mark.parametrize("method", ["qp", "newton", "ccd"])
def test_a_step_names_what_was_put_into_the_figure(planar_arm, method: str) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3))).add(wb.Sphere(0.1), name="ball", at=(0.7, 2.0, 0.0))
    start = np.array([0.1, 0.2, 0.2])
    tip = scene.state(start).frame(scene.frame_id("tip")).translation.copy()
    problem = wb.Problem(scene, start, goals=[wb.Point("tip", tip)], constraints=[wb.tasks.StepLimit(0.05)])
    for moved in (as_method(method).tracker(problem, DT).step, wb.tracking.Drag(problem, method, dt=DT).to):
        scene.move("ball", at=(0.7, 2.0, 0.0))
        drags = moved.__name__ == "to"
        assert not moved(tip if drags else start).collisions
        scene.move("ball", at=tip + (-0.15, 0.02, 0.0))
        answer = moved(tip if drags else start)
        assert [one.second for one in answer.collisions] == ["ball"]
        assert answer.collisions[0].inside
        assert answer.collisions[0].depth == pytest.approx(-scene.contacts(answer.q, 0.0).distance[0], abs=1e-5)


def test_a_frame_of_a_drag_shows_the_way_that_was_found_free() -> None:
    """Straight between its frames the figure goes through the board; along the paths it does not."""
    straight = inner = 0.0
    for seed in range(1):
        throw = Thrown(seed, "board", 2.5, 3.0)
        limits = wb.tasks.StepLimit(12.0, root_velocity=4.0, root_turn=6.0)
        problem = problem_of(throw.scene, constraints=[limits])
        drag = wb.tracking.Drag(problem, "qp", dt=DT)
        for _ in range(throw.frames):
            before, way = drag.q, throw.next()
            frame = drag.to(problem.goals[0].target)
            assert frame.path[0] == (0.0, pytest.approx(before))
            assert frame.path[-1] == (1.0, pytest.approx(frame.q))
            if not frame.collisions and len(frame.path) > 2:
                inner = max(inner, throw.deepest(frame.path, way))
                straight = max(straight, throw.deepest(((0.0, before), (1.0, frame.q)), way, 40))
    assert inner < 4e-4
    assert straight > 2.0 * inner


@pytest.mark.parametrize("method", ["qp", "newton", "ccd"])
def test_drags_by_all_methods_have_paths_where_things_moved(planar_arm, method: str) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3))).add(wb.Sphere(0.1), name="ball", at=(0.7, 2.0, 0.0))
    start = np.array([0.1, 0.2, 0.2])
    tip = scene.state(start).frame(scene.frame_id("tip")).translation.copy()
    drag = wb.tracking.Drag(wb.Problem(scene, start, goals=[wb.Point("tip", tip)]), method, dt=DT)
    assert drag.to(tip).path == ()
    before = drag.q
    scene.move("ball", at=(0.7, 1.5, 0.0), over=DT)
    frame = drag.to(tip)
    assert frame.path[0][1] == pytest.approx(before)
    assert frame.path[-1][1] == pytest.approx(frame.q)
    assert [share for share, _ in frame.path] == sorted(share for share, _ in frame.path)
