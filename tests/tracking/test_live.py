"""Dragging by hand without a page: handles, holds, things, undo, and what is saved."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.geometry.continuous.sweep import Sweep
from wholebody.methods.ccd.chain import ChainResolver
from wholebody.scene.moving_obstacles import MovingScene
from wholebody.tracking import live_subjects
from wholebody.tracking.live import LiveDrag


def standing(who: str) -> LiveDrag:
    scene = wb.Scene(wb.load(who)).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.4, 0.8, 0.04)), name="table", at=(0.6, 0.0, 0.75))
    return LiveDrag(wb.Problem(scene, constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")]))


@pytest.fixture
def drag(monkeypatch: pytest.MonkeyPatch) -> LiveDrag:
    monkeypatch.setattr(live_subjects, "BUDGET", 1.0)  # so that no answer depends on the machine's speed
    return standing("avatar")


def along(drag: LiveDrag, name: str, way: Any, frames: int = 30) -> Any:
    start = drag.place(name)
    drag.take(name)
    for share in np.linspace(0.0, 1.0, frames)[1:]:
        before, frame = drag.q, drag.move(start + share * np.array(way))
        if frame.path:  # where a thing moved
            assert frame.path[0][1] == pytest.approx(before)
            assert frame.path[-1][1] == pytest.approx(frame.q)
    stood = 0
    while stood < 10 and frame.error > (1e-9 if name in drag.things else 1e-3):
        before, frame = frame, drag.move(start + np.array(way))  # slow frames, as on a busy machine, leave some way
        stood = 0 if frame.error < before.error - 1e-6 else stood + 1
    drag.let_go()
    return frame


@pytest.mark.parametrize("method", ["qp", "newton"])
def test_the_hand_follows_and_the_feet_stay(drag: LiveDrag, method: str) -> None:
    drag.choose(method)
    before = drag.place("right_palm"), drag.place("left_sole")
    frame = along(drag, "right_palm", (0.15, -0.05, 0.2))
    np.testing.assert_allclose(drag.place("right_palm"), before[0] + (0.15, -0.05, 0.2), atol=2e-3)
    np.testing.assert_allclose(drag.place("left_sole"), before[1], atol=1e-3)
    assert frame.overlap < 1e-4
    assert frame.status == f"dragging right_palm by {drag.method.name}"


def test_holds_are_those_of_the_problem_and_can_be_released(drag: LiveDrag) -> None:
    assert drag.held == {"left_sole", "right_sole"}
    before = drag.place("left_sole")
    along(drag, "left_sole", (0.0, 0.1, 0.1))  # a held handle that is taken is free while it is dragged
    np.testing.assert_allclose(drag.place("left_sole"), before + (0.0, 0.1, 0.1), atol=3e-3)
    assert drag.toggle("left_palm")
    palm = drag.place("left_palm")
    along(drag, "pelvis", (0.0, 0.05, -0.1))
    np.testing.assert_allclose(drag.place("left_palm"), palm, atol=2e-3)
    assert not drag.toggle("left_palm")


def test_a_thing_pushes_the_hand_away_and_undo_brings_both_back(drag: LiveDrag) -> None:
    q = drag.q.copy()
    assert along(drag, "table", (-0.5, 0.0, 0.0), 40).path
    assert drag.scene.objects["table"].placement.translation[0] == pytest.approx(0.1, abs=1e-9)
    assert drag.report().overlap < 2e-3
    assert not np.allclose(drag.q, q)
    assert drag.problem.scene.objects["table"].placement.translation[0] == pytest.approx(0.6)  # the caller's own stays
    assert drag.undo()
    np.testing.assert_array_equal(drag.q, q)
    assert drag.scene.objects["table"].placement.translation[0] == pytest.approx(0.6)
    assert not drag.undo()


@pytest.mark.parametrize("method", ["qp", "assembly"])
def test_a_thing_that_is_thrown_at_what_is_held_stays_before_it(drag: LiveDrag, method: str) -> None:
    if method == "assembly":
        drag, thing, aim = LiveDrag(jointed()), "block", np.array((-0.4, 0.0, 0.5))
        assert drag.toggle("rod")
    else:
        drag = standing("human")
        drag.choose(method)
        drag.toggle("pelvis")
        thing, aim = "table", drag.place("pelvis")
    drag.take(thing)
    stays = 0
    for _ in range(40):
        before = drag.q, drag.place(thing)
        frame = drag.move(aim)
        assert np.linalg.norm(drag.place(thing) - before[1]) < 0.05 + 1e-9
        assert frame.error == pytest.approx(np.linalg.norm(drag.place(thing) - aim), abs=1e-12)
        assert frame.overlap <= 5e-4  # m
        if f"{thing} stays: " in frame.status:
            stays += 1
            assert np.array_equal(drag.place(thing), before[1])
            np.testing.assert_allclose(frame.q, before[0], atol=1e-12)
    assert stays
    assert frame.error > 0.05
    assert "stays" not in drag.move(drag.place(thing)).status


def test_the_posture_is_a_task(drag: LiveDrag, tmp_path: Any) -> None:
    along(drag, "right_palm", (0.1, 0.0, 0.2))
    task = wb.read_task(wb.taskfile.write_task(drag.stated(), tmp_path / "posture.toml"))
    np.testing.assert_allclose(task.problem.start, drag.q, atol=1e-12)
    assert len(task.problem.constraints) - len(task.problem.defaults) == 2


def test_a_figure_that_need_not_keep_its_ranges_is_dragged_without_them() -> None:
    problem = wb.Problem(wb.Scene(wb.load("human")), range_of_motion=False, balance=False)
    assert not LiveDrag(problem).stated().constraints


def test_mistakes_are_named(drag: LiveDrag) -> None:
    with pytest.raises(wb.UnknownNameError, match="right_palm"):
        drag.take("right_plam")
    with pytest.raises(wb.InputError, match="take one first"):
        drag.move((0.0, 0.0, 0.0))
    drag.choose("ccd")
    drag.problem.scene.figure  # noqa: B018
    frame_with_trouble = LiveDrag(
        wb.Problem(drag.scene, goals=[wb.tasks.Lean("table")], constraints=[wb.Hold("left_foot")]), "ccd"
    )
    frame_with_trouble.take("right_palm")
    assert "cannot take" in frame_with_trouble.move(frame_with_trouble.place("right_palm")).status


def jointed() -> wb.Assembly:
    """A rod on a spherical joint at the origin, and a ball on its end, above a table."""
    made = wb.Assembly().body("rod", (0, 0, 0.5), shape=wb.Capsule(0.03, 0.6))
    made.body("ball", (0, 0, 1.0), shape=wb.Sphere(0.08))
    made.spherical("world", "rod", at=(0, 0, 0.1)).spherical("rod", "ball", at=(0, 0, 0.9))
    return made.add(wb.HalfSpace(), name="floor").add(wb.Box((0.2, 0.2, 0.2)), name="block", at=(0.8, 0, 0.5))


def test_an_assembly_is_dragged_by_its_bodies() -> None:
    made = jointed()
    before = made.q
    drag = LiveDrag(made)
    assert drag.handles == ("rod", "ball")
    assert drag.things == ("block",)
    np.testing.assert_allclose(drag.place("ball"), (0, 0, 1.0), atol=1e-12)
    frame = along(drag, "ball", (0.3, 0.2, -0.1), 16)
    np.testing.assert_allclose(drag.place("ball"), (0.3, 0.2, 0.9), atol=2e-3)
    assert np.linalg.norm(drag.place("rod") - (0, 0, 0.1)) == pytest.approx(0.4, abs=1e-4)  # on its joint still
    assert frame.overlap < 1e-4
    assert frame.status == "dragging ball by newton/auto"
    np.testing.assert_array_equal(made.q, before)  # the caller's own stays
    assert drag.toggle("rod")
    rod = drag.place("rod")
    along(drag, "ball", (0.0, 0.05, 0.05))
    np.testing.assert_allclose(drag.place("rod"), rod, atol=1e-4)
    assert not drag.toggle("rod")
    assert drag.undo()
    np.testing.assert_allclose(drag.place("ball"), (0.3, 0.2, 0.9), atol=2e-3)
    assert drag.undo()
    np.testing.assert_allclose(drag.q, before, atol=1e-12)
    with pytest.raises(wb.InputError, match="no task file"):
        drag.stated()


def test_an_assembly_is_opened_closed_and_turned_by_hand() -> None:
    drag = LiveDrag(jointed())
    joint = "spherical joint of 'rod' and 'ball'"
    drag.constrain(joint, False)
    along(drag, "ball", (0.3, 0.0, 0.0))
    np.testing.assert_allclose(drag.place("rod"), (0, 0, 0.5), atol=1e-6)  # it no longer follows
    drag.constrain(joint, True)
    along(drag, "ball", (0.05, 0.0, -0.15))
    assert np.linalg.norm(drag.place("rod") - drag.place("ball")) < 0.5 + 1e-3  # closed again: 0.4 and 0.1 m
    for _ in range(4):
        assert drag.undo()
    assert drag.constraints[joint]
    np.testing.assert_allclose(drag.place("ball"), (0, 0, 1.0), atol=1e-9)
    drag.take("rod", turn=True)
    assert "length 2" in drag.move((0, 0, 0, 2)).status
    assert drag.move((0, 0, 0, 1)).status == f"turning rod by {drag.method.name}"  # the next frame is right again
    for turn in np.linspace(0.0, 0.5, 30):
        frame = drag.move((0, np.sin(0.5 * turn), 0, np.cos(0.5 * turn)))
    assert frame.error < 1e-3
    assert frame.status == "turning rod by newton/auto"
    np.testing.assert_allclose(drag.place("rod"), (0.4 * np.sin(0.5), 0, 0.1 + 0.4 * np.cos(0.5)), atol=1e-3)


def test_a_hand_is_turned(drag: LiveDrag) -> None:
    before = pin.Quaternion(drag.orientation("right_palm"))
    drag.take("right_palm", turn=True)
    for turn in np.linspace(0.0, 0.4, 20):
        wanted = pin.Quaternion(pin.exp3(np.array((turn, 0.0, 0.0)))) * before
        frame = drag.move(wanted.coeffs())
    assert frame.error < 5e-3
    assert np.linalg.norm(drag.place("left_sole") - drag.place_at(drag.problem.start, "left_sole")) < 2e-3


def test_a_thing_pushes_an_assembly() -> None:
    drag = LiveDrag(jointed())
    frame = along(drag, "block", (-0.75, 0.0, 0.0), 30)
    assert drag.scene.objects["block"].placement.translation[0] == pytest.approx(0.05, abs=1e-9)
    assert np.linalg.norm(drag.place("rod") - (0, 0, 0.5)) > 0.03
    assert frame.overlap < 1e-3
    assert drag.undo()
    np.testing.assert_allclose(drag.place("rod"), (0, 0, 0.5), atol=1e-12)


def test_a_person_in_an_assembly_has_hands_and_feet() -> None:
    scene = wb.Scene(wb.load("avatar"))
    start = scene.figure.posture(scene.figure.postures[0])
    made = wb.Assembly().figure("anna", scene.figure, start)
    made.body("crate", (2, 0, 0.5), shape=wb.Box((0.3, 0.3, 0.3)))
    drag = LiveDrag(made)
    assert {"crate", "anna/right_palm", "anna/left_sole"} <= set(drag.handles)
    expected = scene.state(start).frame(scene.figure.frame_id("right_palm"))
    np.testing.assert_allclose(drag.place("anna/right_palm"), expected.translation, atol=1e-9)
    before = drag.place("anna/right_palm")
    along(drag, "anna/right_palm", (0.1, 0.0, 0.1), 12)
    np.testing.assert_allclose(drag.place("anna/right_palm"), before + (0.1, 0.0, 0.1), atol=3e-3)


def test_a_robot_has_the_ends_of_its_chains_in_an_assembly_and_beside_a_person(root: Path) -> None:
    arm = wb.load(root / "examples" / "tasks" / "arm.urdf")
    ends = {f"arm/{chain.tip}" for chain in arm.chains.values()}
    alone = LiveDrag(wb.Assembly().figure("arm", arm))
    assert set(alone.handles) == ends
    beside = LiveDrag(wb.Problem(wb.Scene({"anna": wb.load("avatar"), "arm": (arm, (1.5, 0, 0))})))
    assert ends < set(beside.handles)
    assert "anna/right_palm" in beside.handles
    assert {"anna/left_index_tip", "anna/right_index_tip"} <= set(beside.handles)  # to push and point with
    assert not any("spine" in name or "toe" in name for name in beside.handles)
    before = alone.place("arm/grip")
    along(alone, "arm/grip", (0.0, 0.02, 0.0), 10)
    np.testing.assert_allclose(alone.place("arm/grip"), before + (0.0, 0.02, 0.0), atol=2e-3)


def test_what_is_dragged_moves_on_a_machine_that_is_slow(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A frame's time is a seventh: no step is complete in it."""
    monkeypatch.setattr("wholebody.tracking.live_subjects.BUDGET", 1e-3)
    drag = LiveDrag(wb.Assembly().figure("arm", wb.load(root / "examples" / "tasks" / "arm.urdf")))
    drag.take("arm/grip")
    before = drag.place("arm/grip")
    for _ in range(40):
        drag.move(before + (0.0, 0.02, 0.0))
    np.testing.assert_allclose(drag.place("arm/grip"), before + (0.0, 0.02, 0.0), atol=2e-3)


@pytest.mark.parametrize("method", ["qp", "newton", "ccd"])
def test_no_joint_jumps_where_the_mouse_goes_out_of_reach(drag: LiveDrag, method: str) -> None:
    """The nearest postures to two targets beside each other may be far apart, as those of an arm that is stretched."""
    drag.choose(method)
    begin = drag.place("right_palm")
    drag.take("right_palm")
    for turn in np.linspace(0.0, 2.0 * np.pi, 90):
        before = drag.q
        frame = drag.move(begin + (0.2 * np.sin(turn), -0.15 * (1.0 - np.cos(turn)), 0.2 * np.sin(2.0 * turn)))
        assert np.abs(pin.difference(drag.scene.model, before, frame.q)[6:]).max() < 8.5 / 60.0  # rad
    assert frame.overlap < 1e-4


@pytest.mark.parametrize("method", ["newton", "ccd"])
def test_a_fast_mouse_leads_into_nothing(drag: LiveDrag, method: str) -> None:
    """Parts of motions that joints would turn too fast in ended up to 0.66 mm in the table beside their ends."""
    drag.choose(method)
    first, rng = drag.q, np.random.default_rng(1)
    for side in 3 * ("right_palm", "left_palm"):
        drag.let_go()
        drag.q = first
        drag.take(side)
        begin = drag.place(side)
        for target in begin + rng.uniform((-0.2, -0.5, -0.3), (0.6, 0.5, 0.7), (2, 3)):
            assert max(drag.move(target).overlap for _ in range(20)) < 1.05e-4


@pytest.mark.parametrize("given", [wb.Assembly(), wb.Assembly().body("block", (0, 0, 0))], ids=["empty", "no shapes"])
def test_an_assembly_without_bodies_is_refused_and_one_without_shapes_is_dragged(given: wb.Assembly) -> None:
    if not given.bodies:
        with pytest.raises(wb.InputError, match="no bodies"):
            LiveDrag(given)
        return
    drag = LiveDrag(given)
    along(drag, "block", (0.2, 0.0, 0.0))
    np.testing.assert_allclose(drag.place("block"), (0.2, 0.0, 0.0), atol=1e-3)
    with pytest.raises(wb.InputError, match="Newton steps"):
        drag.choose("ccd")


@pytest.mark.parametrize("method", ["qp", "ccd", "assembly"])
def test_what_frames_need_is_made_before_them(drag: LiveDrag, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sweeps, chains and the scene of what moves take as long as ten frames; of two people, twenty."""

    def made(*_: object, **__: object) -> None:
        raise AssertionError("made in a frame")

    ways = {"right_palm": (0.2, 0.1, -0.3), "table": (-0.3, 0.0, 0.1)}
    if method == "assembly":
        drag, ways = LiveDrag(jointed()), {"ball": (0.3, 0.2, -0.1), "block": (-0.75, 0.0, 0.0)}
    else:
        drag.choose(method)
    for name, way in ways.items():
        with monkeypatch.context() as patched:
            drag.take(name)
            for kind in (Sweep, MovingScene, ChainResolver):
                patched.setattr(kind, "__init__", made)
            start = drag.place(name)
            for share in np.linspace(0.0, 1.0, 12):
                drag.move(start + share * np.array(way))
        assert np.linalg.norm(drag.place(name) - start) > 0.02
        drag.let_go()
