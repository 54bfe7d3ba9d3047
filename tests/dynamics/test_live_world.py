"""A world that is dragged by hand: handles reach places, bodies are lifted and thrown, lost trackers ease back."""

from __future__ import annotations

import json
import socket
import time
from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.dynamics.live_world import LiveWorld
from wholebody.tracking.receiver import Receiver
from wholebody.view.live_page import LivePage

DT = 1.0 / 60.0


@pytest.fixture
def live() -> LiveWorld:
    scene = wb.Scene(wb.load("avatar")).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.4, 0.6, 0.04)), name="shelf", at=(0.9, 0.0, 1.0))
    scene.add(wb.Sphere(0.1), name="ball", at=(0.9, -0.1, 1.1205), body=wb.Body(mass=0.5))
    return LiveWorld(scene, scene.figure.posture("standing"))


def test_a_hand_is_dragged_and_pushes_a_ball_off_its_shelf(live: LiveWorld) -> None:
    live.take("right_palm")
    began, feet = live.place("ball"), np.array([live.place(name) for name in ("left_sole", "right_sole")])
    way = np.linspace(live.place("right_palm"), began + [0.0, -0.25, 0.05], 40)
    for place in [*way, *np.linspace(way[-1], began + [0.0, 0.15, 0.05], 40)]:
        assert live.move(place).overlap < 2e-4
    for _ in range(60):
        live.move()
    assert live.place("ball")[2] < 0.2  # on the floor
    assert np.array([live.place(name) for name in ("left_sole", "right_sole")]) == pytest.approx(feet, abs=2e-3)
    assert live.undo()
    assert live.place("ball") == pytest.approx(began, abs=1e-3)


def test_a_body_follows_the_mouse_and_flies_on_when_it_is_let_go(live: LiveWorld) -> None:
    live.take("ball")
    began = live.place("ball")
    for number in range(70):
        live.move(began + [0.0, 0.0, min(0.4, 0.02 * number)])
    assert live.place("ball") == pytest.approx(began + [0.0, 0.0, 0.4], abs=2e-3)  # against its weight
    for number in range(12):
        live.move(began + [0.04 * number, 0.0, 0.4])
    live.let_go()
    place, speed = live.place("ball"), live.world.engine.twist("ball")[:3]  # type: ignore[union-attr]
    assert speed[0] > 0.8
    for _ in range(12):
        live.move()
    # free flight, by steps of 1/240 s
    assert live.place("ball") == pytest.approx(place + 0.2 * speed + [0.0, 0.0, -0.5 * 9.81 * 0.2**2], abs=0.01)


def test_a_lost_tracker_holds_then_eases_back_and_a_jump_is_followed_at_a_bounded_speed(live: LiveWorld) -> None:
    began = live.place("left_palm")
    places = [began]
    for _ in range(30):
        live.follow({"left_palm": began + [0.0, 0.15, 0.3]})
        live.move()
        places.append(live.place("left_palm"))
    assert places[-1] == pytest.approx(began + [0.0, 0.15, 0.3], abs=0.01)
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 3.5 * DT
    for _ in range(12):  # 0.2 s without a word
        live.move()
    assert live.place("left_palm") == pytest.approx(places[-1], abs=0.01)
    assert "eases back" not in live.report().status
    for _ in range(60):
        live.move()
    assert live.place("left_palm") == pytest.approx(began, abs=0.02)
    assert "no place of left_palm arrives any more; it eases back" in live.report().status
    live.follow({"left_palm": began})
    assert "eases back" not in live.report().status
    with pytest.raises(wb.UnknownNameError, match="left_palm"):
        live.follow({"left_pal": began})
    with pytest.raises(wb.InputError, match="place of left_palm"):
        live.follow({"left_palm": [np.nan, 0.0, 0.0]})


def test_what_a_lost_tracker_left_is_free_again_when_it_is_back_and_a_sole_is_held_again(live: LiveWorld) -> None:
    home = {name: live.place(name) for name in ("left_palm", "left_sole")}
    for _ in range(30):
        live.follow({name: place + [0.05, 0.05, 0.15] for name, place in home.items()})
        live.move()
    said = [live.move().status for _ in range(300)]
    assert any("no place of left_palm, left_sole arrives any more" in status for status in said)
    assert "arrives" not in said[-1]
    for name, place in home.items():
        assert live.place(name) == pytest.approx(place, abs=3e-3)
    frame, turn = live.scene.figure.frame_id("left_sole"), live.scene.state(live.q).frame
    before, hand = turn(frame).rotation.copy(), live.place("left_palm")
    live.take("pelvis")
    for share in np.linspace(0.0, 1.0, 40):
        live.move(live.place("pelvis") * (1.0 - share) + share * (live.place("pelvis") + [0.0, 0.01, -0.01]))
    after = live.scene.state(live.q).frame(frame).rotation
    np.testing.assert_allclose(after, before, atol=2e-3)  # of the hold; a place alone leaves turns free
    assert np.linalg.norm(live.place("left_palm") - hand) > 0.02  # it goes with the body


def test_a_lost_head_is_not_drawn_back_from_hands_that_walk_away() -> None:
    live = LiveWorld(wb.Scene(wb.load("avatar")))
    for sole in ("left_sole", "right_sole"):
        live.toggle(sole)
    home = {name: live.place(name) for name in ("left_palm", "right_palm", "head_top")}
    for number in range(150):
        way = np.array([0.01 * number, 0.0, 0.0])
        live.follow({name: place + way for name, place in home.items() if number < 30 or name != "head_top"})
        live.move()
    for name in ("left_palm", "right_palm"):
        assert live.place(name) == pytest.approx(home[name] + way, abs=0.02)  # they lagged by a metre
    assert live.place("head_top")[0] - home["head_top"][0] > 0.5 * way[0]
    assert "no place of head_top arrives any more; it is free" in live.report().status
    live.follow({"head_top": home["head_top"] + way})
    assert "arrives" not in live.report().status


def test_a_tracker_that_comes_back_from_far_away_is_followed_at_once() -> None:
    live = LiveWorld(wb.Scene(wb.load("avatar")))
    began = live.place("left_palm")
    for _ in range(60):  # at 3 m/s it would be 3 m away, and as long on its way back
        live.follow({"left_palm": began + [100.0, 0.0, 0.0]})
        live.move()
    for _ in range(40):
        live.follow({"left_palm": began})
        live.move()
    assert live.place("left_palm") == pytest.approx(began, abs=0.05)


def test_datagrams_move_handles_on_the_page_and_bad_ones_are_told(live: LiveWorld, tmp_path: Path) -> None:
    pytest.importorskip("viser")
    receiver = Receiver(0, live.handles)
    page = LivePage(live, tmp_path, 8391, places=receiver.latest)
    began, sender = live.place("right_palm"), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    wanted = began + [0.05, 0.0, 0.2]
    try:
        for bad in (
            b"hello",
            b'{"nose": [0, 0, 1]}',
            b'{"right_palm": [0, 0, NaN]}',
            b'{"pelvis": [0, 0, 1' + b"0" * 400 + b"]}",
        ):
            sender.sendto(bad, ("127.0.0.1", receiver.port))
        end = time.monotonic() + 60.0
        while np.linalg.norm(live.place("right_palm") - wanted) > 0.01 and time.monotonic() < end:
            sender.sendto(json.dumps({"right_palm": wanted.tolist()}).encode(), ("127.0.0.1", receiver.port))
            time.sleep(0.02)
        assert live.place("right_palm") == pytest.approx(wanted, abs=0.01)
        assert receiver.refused == 4
    finally:
        page.stop()
        sender.close()
        receiver.close()
    assert page.frames > 3
    for port in (-1, 70000, "a"):
        with pytest.raises(wb.InputError, match="port"):
            Receiver(port, live.handles)  # type: ignore[arg-type]
        with pytest.raises(wb.InputError, match="port"):
            LivePage(live, tmp_path, port)  # type: ignore[arg-type]


def test_a_tracker_that_has_lost_a_hand_still_gives_the_head() -> None:
    receiver = Receiver(0, ("head_top", "right_palm"))
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        for lost in (b"[NaN, NaN, NaN]", b"null", b"[Infinity, 0, 0]"):
            sender.sendto(b'{"right_palm": %b, "head_top": [0.1, 0.0, 1.7]}' % lost, ("127.0.0.1", receiver.port))
            found = receiver.latest()
            assert found.keys() == {"head_top"}
            assert found["head_top"].tolist() == [0.1, 0.0, 1.7]
    finally:
        sender.close()
        receiver.close()
    assert receiver.refused == 3
    assert "right_palm" in receiver.note


def test_a_released_handle_moves_with_the_figure_and_the_mouse_takes_one_from_a_tracker() -> None:
    live = LiveWorld(wb.Scene(wb.load("avatar")))
    pelvis, hand = live.place("pelvis"), live.place("right_palm")
    live.follow({"right_palm": hand})
    live.take("right_palm")
    for _ in range(60):  # 1 s: the tracker is lost
        live.move(hand + [0.05, 0.0, 0.1])
    assert live.place("right_palm") == pytest.approx(hand + [0.05, 0.0, 0.1], abs=1e-4)
    live.undo()
    for sole in ("left_sole", "right_sole"):
        live.take(sole)  # as a click does, which takes, lets go, and holds or releases
        live.let_go()
        assert not live.toggle(sole)
    live.take("pelvis")
    for _ in range(60):
        live.move(pelvis + [0.0, 0.0, 0.4])
    assert live.place("pelvis") == pytest.approx(pelvis + [0.0, 0.0, 0.4], abs=1e-3)


def test_the_soles_of_every_one_of_several_people_are_held() -> None:
    legs = wb.load("avatar").reduced(["root", "left_leg", "right_leg"])  # 25 MB are needed for each state of two people
    two = wb.figures.join({"one": legs, "two": legs})
    held = {f"{name}/{side}_sole" for name in ("one", "two") for side in ("left", "right")}
    assert LiveWorld(wb.Scene(two)).held == held


def test_a_finger_is_dragged_while_the_palm_is_held() -> None:
    live = LiveWorld(wb.Scene(wb.load("hand")))
    assert live.toggle("right_palm")
    palm, tip = live.place("right_palm"), live.place("right_index_tip")
    live.take("right_index_tip")
    for number in range(20):
        live.move(tip + np.array((-0.02, 0.0, -0.02)) * min(1.0, number / 12))
    assert live.place("right_palm") == pytest.approx(palm, abs=1e-5)
    assert live.place("right_index_tip") == pytest.approx(tip + (-0.02, 0.0, -0.02), abs=1e-3)
