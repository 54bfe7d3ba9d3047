"""The page of a live drag without a browser: every method, configured ones, and assemblies."""

from __future__ import annotations

import asyncio
import time
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.dynamics.live_world import LiveWorld
from wholebody.tracking.frame import FRAME
from wholebody.tracking.live import LiveDrag
from wholebody.view.live_page import LivePage

pytest.importorskip("viser")


def opened(drag: LiveDrag | LiveWorld, folder: Path) -> LivePage:
    return LivePage(drag, folder / "posture.toml", 8393)


def problem() -> wb.Problem:
    return wb.Problem(wb.Scene(wb.load("avatar")), constraints=[wb.Hold("left_foot")])


@pytest.mark.parametrize("method", ["ccd", wb.methods.Newton(algebra="kkt")], ids=str)
def test_the_page_opens_with_every_method_and_changes_to_every_other(
    method: str | wb.methods.QP, tmp_path: Path
) -> None:
    drag = LiveDrag(problem(), method)
    page = opened(drag, tmp_path)
    try:
        name = method if isinstance(method, str) else method.name
        assert page._method.value == drag.chosen == name
        assert page._method.options == tuple(drag.methods)
        for other in page._method.options:
            page._method.value = other
            page._choose(SimpleNamespace())
            assert drag.chosen == other
        page._method.value = name
        page._choose(SimpleNamespace())
        assert drag.method == (method if not isinstance(method, str) else LiveDrag(problem(), method).method)
    finally:
        page.stop()


def test_an_assembly_has_a_page(tmp_path: Path) -> None:
    made = wb.Assembly().body("block", (0, 0, 1), shape=wb.Box((0.1, 0.1, 0.1)), color="red")
    made.body("lamp", (1, 0, 1), shape=wb.Sphere(0.1))
    drag = LiveDrag(made.add(wb.HalfSpace(), name="floor"))
    page = opened(drag, tmp_path)
    try:
        drag.take("block")
        for share in np.linspace(0.0, 1.0, 10)[1:]:
            frame = page.follow(np.array((0.1 * share, 0.0, 1.0)))
        assert frame.error < 1e-3
        assert page._method.options == ("newton",)
        red, bare = (page._pieces[drag.scene.piece_owner.index(name)].color for name in ("block", "lamp"))
        assert (red, bare == red) == ((255, 0, 0), False)  # as the assembly paints its bodies
    finally:
        page.stop()


def test_the_way_within_a_frame_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a thing moves the figure does not go straight: the thing and it are shown on the way too."""
    given = problem()
    given.scene.add(wb.Sphere(0.1), name="ball", at=(2.0, 0.0, 1.0))
    drag = LiveDrag(wb.Problem(given.scene))
    page = opened(drag, tmp_path)
    try:
        drag.take("ball")
        move, aside = drag.move, drag.q + 0.0
        aside[0] += 0.5
        ball = next(n for n, owner in enumerate(drag.scene.piece_owner) if owner == "ball")
        seen, show = [], page._place

        def noted(q: np.ndarray, at: dict) -> None:
            show(q, at)
            seen.append((q[0], page._pieces[ball].position[0]))

        monkeypatch.setattr(page, "_place", noted)
        way = ((0.0, drag.q), (0.25, aside), (1.0, drag.q))
        monkeypatch.setattr(drag, "move", lambda place: move(place)._replace(path=way))
        page.follow(np.array((1.6, 0.0, 1.0)))
        assert seen == [(aside[0], pytest.approx(1.9875)), (drag.q[0], pytest.approx(1.95))]
    finally:
        page.stop()


def test_a_thing_is_taken_where_the_mouse_sees_it(tmp_path: Path) -> None:
    """The handle of a ball is inside of it, so the ball itself is one: it is lifted, falls and lies on the floor."""
    scene = wb.Scene(wb.load("avatar")).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Sphere(0.1), name="ball", at=(0.7, -0.6, 0.1001), body=wb.Body(mass=0.4))
    live = LiveWorld(scene)
    page = opened(live, tmp_path)
    try:
        page._stopped.set()  # frames are made here
        page._loop.join()
        ball = page._pieces[live.scene.piece_owner.index("ball")]
        (entry,) = ball._impl.drag_cb

        def drag(phase: str, z: float) -> None:
            start, end = (0.7, -0.7, 0.1), (0.7, -0.7, z)  # on its side
            asyncio.run(
                entry.callback(SimpleNamespace(phase=phase, start_position=start, end_position=end, client_id=1))
            )

        drag("start", 0.1)
        assert live.taken == "ball"
        drag("update", 0.6)
        for _ in range(60):
            page.go_on(live)
        assert live.place("ball") == pytest.approx((0.7, -0.6, 0.6), abs=0.02)
        assert ball.position == pytest.approx(live.place("ball"), abs=1e-5)
        drag("end", 0.6)
        assert not live.taken
        for _ in range(60):
            page.go_on(live)
        assert live.place("ball")[2] == pytest.approx(0.1, abs=1e-3)
        foot = page._pieces[live.scene.piece_owner.index("left_foot")]
        assert not foot._impl.drag_cb
    finally:
        page.stop()


def test_the_page_that_took_a_handle_last_has_it(tmp_path: Path) -> None:
    """Two pages drag the same hand; the first lets go, and the second goes on; so it is with rings and keys."""
    drag = LiveDrag(problem())
    page = opened(drag, tmp_path)
    try:
        page._stopped.set()  # frames are made here
        page._loop.join()
        (entry,), begin = page._handles["right_palm"]._impl.drag_cb, drag.place("right_palm")

        def moved(client: int, phase: str, shift: float) -> None:
            place = {"start_position": begin, "end_position": begin + [0.0, 0.0, shift]}
            asyncio.run(entry.callback(SimpleNamespace(phase=phase, client_id=client, **place)))

        moved(1, "start", 0.0)
        moved(1, "update", 0.1)
        moved(2, "start", 0.0)
        moved(2, "update", 0.02)
        moved(1, "update", 0.2)
        moved(1, "end", 0.2)
        assert not page._settling
        assert page._target == pytest.approx(begin + [0.0, 0.0, 0.02])
        moved(2, "end", 0.03)
        assert page._settling
        for _ in range(100):
            if page._target is not None:
                page.follow(page._target)
        assert not drag.taken
        assert drag.place("right_palm") == pytest.approx(begin + [0.0, 0.0, 0.03], abs=2e-3)
    finally:
        page.stop()


@pytest.mark.parametrize("figure", ["human", "hand"])
def test_every_handle_is_in_the_picture_and_none_hides_the_next(figure: str, tmp_path: Path) -> None:
    live = LiveWorld(wb.Scene(wb.load(figure)))
    page = opened(live, tmp_path)
    try:
        camera = page.server.initial_camera
        places = np.array([live.place(name) for name in live.handles])
        forward = np.array(camera.look_at) - camera.position
        forward /= np.linalg.norm(forward)
        depth = (places - camera.position) @ forward
        height = (places - camera.position)[:, 2] - depth * forward[2]
        up = np.sqrt(1.0 - forward[2] ** 2)  # of the picture's vertical, of which that of the world is a part
        assert (np.abs(height / up) < depth * np.tan(0.5 * camera.fov)).all()
        sizes = {name: page._radius(name) for name in live.handles}
        for one in live.handles:
            for other in live.handles:
                if one != other:
                    assert sizes[one] + sizes[other] < 0.6 * np.linalg.norm(live.place(one) - live.place(other))
    finally:
        page.stop()


def test_a_joint_that_is_ticked_closes_and_one_that_cannot_is_told(tmp_path: Path) -> None:
    y, held = (0.0, 1.0, 0.0), "revolute joint of 'rod' and 'ball'"
    made = wb.Assembly().body("rod", shape=wb.Capsule(0.02, 0.3)).body("ball", (0, 0, 1.0), shape=wb.Sphere(0.05))
    made.revolute("world", "rod", at=(0, 0, 0), axis=y).revolute("rod", "ball", at=(0, 0, 0.9), axis=y)
    drag = LiveDrag(made)
    page = opened(drag, tmp_path)

    def ticked(name: str, holds: bool) -> float:
        """The distance (3,) between the two places of the joint after all frames."""
        page._constraints[name].value = holds
        page._constrained(drag, name, None)
        while page._target is not None:
            page.follow(page._target)
        rod, ball = (drag._placement(drag.q, body) for body in ("rod", "ball"))
        return float(np.linalg.norm(rod.act(np.array((0, 0, 0.9))) - ball.act(np.array((0, 0, -0.1)))))

    try:
        page._stopped.set()  # frames are made here
        page._loop.join()
        assert ticked(held, False) == pytest.approx(0.0, abs=1e-6)
        drag.take("ball")
        for share in np.linspace(0.0, 1.0, 30):
            drag.move(np.array((0.5 * share, 0.0, 1.0)))
        drag.let_go()
        assert ticked(held, True) == pytest.approx(0.0, abs=1e-4)
        assert "do not close" not in drag.report().status
        ticked(held, False)
        drag.take("ball")
        for share in np.linspace(0.0, 1.0, 60):
            drag.move(np.array((0.5 + 2.0 * share, 0.0, 1.0)))
        drag.let_go()
        drag.toggle("ball")
        left = ticked(held, True)
        assert left > 1.0
        assert "joints do not close, by " in drag.report().status
        assert drag.undo()
        assert "do not close" not in drag.report().status
    finally:
        page.stop()


def test_late_frames_of_a_world_are_made_up_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of ten frames one takes twice as long as there is; an hour's break is not made up for."""
    now, made = [0.0], [0]

    def go_on(_: Any) -> None:
        made[0] += 1
        now[0] += 3600.0 if made[0] == 100 else 2.0 * FRAME if made[0] % 10 == 0 else 0.25 * FRAME

    def wait(seconds: float) -> None:
        now[0] += seconds

    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    stopped = SimpleNamespace(is_set=lambda: made[0] == 120, wait=wait)
    world = object.__new__(LiveWorld)
    LivePage._run(SimpleNamespace(_stopped=stopped, _lock=nullcontext(), drag=world, go_on=go_on))  # type: ignore[arg-type]
    assert now[0] == pytest.approx(3600.0 + 118 * FRAME, abs=0.1 * FRAME)
