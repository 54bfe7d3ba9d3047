"""Curves of motions beside their recording, in a browser: what is drawn, and a film that a click in a chart moves."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.motion.test_retargeting import person
from wholebody.base.errors import InputError
from wholebody.bench.suite.problem_sets.robots import known_arm
from wholebody.bench.suite.stability.bodies import spatial_arm
from wholebody.cli.main import main
from wholebody.view import side_by_side
from wholebody.view.motion_curves import motion_curves
from wholebody.view.viewed_scene import ViewedWorld
from wholebody.view.viewer import Viewer

INSIDE = "document.querySelector('iframe').contentWindow"


@pytest.fixture(scope="module")
def page() -> str:
    """A person that lifts its arms, and an answer whose right elbow is bent by 0.1 rad more."""
    motion = person(12)
    clip = wb.retarget(motion, wb.load("avatar"))
    q = np.array(clip.q)
    q[:, clip.figure.model.joints[clip.figure.joint_id("right_elbow_flexion")].idx_q] += 0.1
    return motion_curves(motion, {"retargeted": clip, "freed": clip.with_q(q)}, wb.Scene(clip.figure))


def lines(page: str, title: str) -> dict[tuple[str, str], list[float]]:
    """Values of the lines of a chart, by name and motion."""
    data = json.loads(re.findall(r"const data = (.*);", page)[-1])
    (chart,) = [each for each in data["charts"] if title in each["title"]]
    return {(line["name"], line["of"]): line["values"] for line in chart["lines"]}


def test_the_lines_are_those_of_the_motions(page: str) -> None:
    joints = lines(page, "joints")
    before, after = (np.array(joints["right_elbow_flexion", name]) for name in ("retargeted", "freed"))
    assert after - before == pytest.approx(0.1, abs=1e-3)
    bones = lines(page, "bones")
    assert {name for name, _ in bones} == {"median", "greatest"}
    assert all(len(values) == 12 for values in bones.values())
    feet = lines(page, "foot")
    assert max(feet["feet", "recording"]) == 0.0  # its feet stand
    assert max(value for value in feet["feet", "retargeted"] if value is not None) < 5.0
    loads = [lines(page, title) for title in ("torque", "force", "zero moment point")]
    assert [{of for _, of in each} for each in loads] == [{"retargeted", "freed"}] * 3
    weight = 9.81 * pin.computeTotalMass(wb.load("avatar").model)
    borne = sum(np.array(values) for (_, of), values in loads[1].items() if of == "retargeted")
    assert np.median(borne) == pytest.approx(weight, rel=0.1)  # it stands, and lifts its arms slowly
    assert "http://" not in re.sub(r"http://www\.w3\.org/\S*", "", page.split("srcdoc=")[0])


def test_a_click_brings_the_film_there_and_charts_follow_the_film(browser: Any, page: str, tmp_path: Path) -> None:
    file = tmp_path / "page.html"
    file.write_text(page, encoding="utf-8")
    browser.open(file.as_uri())
    assert browser.evaluate("document.querySelectorAll('canvas').length") == 8
    browser.evaluate(
        "(() => { const chart = document.querySelector('canvas'), box = chart.getBoundingClientRect();"
        "chart.setPointerCapture = () => {};"
        "const x = box.left + 62 + 0.5 * (box.width - 72);"
        "const at = { clientX: x, clientY: box.top + 30, pointerId: 1 };"
        "chart.dispatchEvent(new PointerEvent('pointerdown', at)); })()"
    )
    assert browser.evaluate(f"{INSIDE}.viewer.animator.actions[0].time") == pytest.approx(0.5 * 11 / 30, abs=1e-3)
    browser.evaluate(f"{INSIDE}.wholebody.seek(4 / 30)")
    browser.until("document.getElementById('time').textContent.startsWith('Frame 4,')")
    left = browser.evaluate("parseFloat(document.querySelector('.cursor').style.left)")
    width = browser.evaluate("document.querySelector('canvas').clientWidth")
    assert left == pytest.approx(62 + (width - 72) * 4 / 11 - 0.75, abs=1.0)


def test_curves_of_long_recordings_are_drawn(browser: Any, page: str, tmp_path: Path) -> None:
    """Two lines of 72,000 frames, more values than a function of a browser takes arguments; the film is left out."""
    (told,) = re.findall(r"const data = (.*);", page)[-1:]
    data = json.loads(told)
    data["frames"] *= 6000
    del data["charts"][1:], data["charts"][0]["lines"][2:]
    for line in data["charts"][0]["lines"]:
        line["values"] *= 6000
    file = tmp_path / "long.html"
    charts = re.sub(r'srcdoc="[^"]*"', "", page.replace(told, json.dumps(data)))
    file.write_text(charts, encoding="utf-8")
    browser.open(file.as_uri(), "document.readyState === 'complete'")
    assert browser.evaluate("document.querySelectorAll('canvas').length") == 1


def test_motions_of_other_lengths_are_refused() -> None:
    motion = person(4)
    clip = wb.retarget(motion, wb.load("avatar"), ground=None)
    with pytest.raises(InputError, match="retargeted 3, the recording 4"):
        motion_curves(motion, {"retargeted": clip[:3]}, wb.Scene(clip.figure))


def test_the_commands_write_pages(tmp_path: Path) -> None:
    figure = wb.load("human")
    clip = wb.Clip(figure, np.tile(figure.posture("standing"), (5, 1)), 0.1, "stands")
    made, out = clip.write(tmp_path / "stands.npz"), tmp_path / "page.html"
    assert main(["clip", "avoid", str(made), "--out", str(tmp_path / "free.npz"), "--html", str(out)]) == 0
    assert lines(out.read_text("utf-8"), "overlap").keys() == {
        ("deepest overlap", "before"),
        ("deepest overlap", "freed"),
    }
    film = tmp_path / "film.html"
    assert main(["clip", "play", str(tmp_path / "free.npz"), "--beside", str(made), "--out", str(film)]) == 0
    assert film.is_file()
    assert main(["clip", "avoid", str(made), "--html", str(out), "--stretch", "2"]) == 2


def test_arms_on_fixed_bases_stand_beside_each_other_in_their_postures(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, worlds, played = spatial_arm(), list[wb.Scene](), list[Any]()

    def viewed(world: wb.Scene, *given: Any, **named: Any) -> ViewedWorld:
        worlds.append(world)
        return ViewedWorld(world, *given, **named)

    monkeypatch.setattr(side_by_side, "ViewedWorld", viewed)
    monkeypatch.setattr(Viewer, "play", lambda viewer, postures, dt: played.extend(postures))
    q = np.linspace(0.1, 0.6, arm.model.nq)
    clip = wb.Clip(arm, np.tile(q, (2, 1)), 0.1, "arm")
    side_by_side.beside(None, {"before": clip, "after": clip}, wb.Scene(arm), "arms")
    own = np.asarray(arm.placement(q, "tip").translation)
    left, right = (
        np.asarray(worlds[0].figure.placement(played[0], f"{k}/tip").translation) for k in ("before", "after")
    )
    assert 0.5 * (left + right) == pytest.approx(own)
    assert right - left == pytest.approx([0.0, side_by_side.APART, 0.0])


def test_motions_of_several_figures_are_beside_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """A person who carries a parcel, and an arm on a fixed base that faces him."""
    (arm, ready), place = known_arm("ur5"), pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 2.0), np.array((0.9, 0.1, 0.7)))
    scene = wb.Scene({"ben": wb.load("avatar"), "arm": (arm, place)})
    rests = ["ben/left_hand", "arm/link6"]
    scene.attach(wb.Sphere(0.05), to="ben/left_palm", name="parcel", at=(0.0, 0.0, 0.06), rests_on=rests)
    figure, drawn = scene.figure, []
    q = figure.posture({"arm": ready})
    bent = figure.with_joints(q, {"ben/left_elbow_flexion": 0.8})
    clip = wb.Clip(figure, np.array([q, bent]), 0.1)

    def viewed(world: wb.Scene, *rest: Any, **options: Any) -> ViewedWorld:
        drawn.append(world)
        return ViewedWorld(world, *rest, **options)

    shown: list[Any] = []
    monkeypatch.setattr(side_by_side, "ViewedWorld", viewed)
    monkeypatch.setattr(Viewer, "play", lambda viewer, postures, dt: shown.extend(postures))
    side_by_side.beside(None, {"before": clip, "after": clip}, scene, "two")
    world, names = drawn[0], ("ben/left_palm", "arm/tool", "ben/head")
    assert set(world.objects) == {"floor", "parcel of before", "parcel of after"}
    for was, now in zip((q, bent), shown, strict=True):
        posture = now[: world.model.nq]
        apart = [
            world.figure.placement(posture, f"after {name}").translation
            - world.figure.placement(posture, f"before {name}").translation
            for name in names
        ]
        assert np.ptp(apart, axis=0) == pytest.approx(np.zeros(3), abs=1e-9)
        assert apart[0][1] >= side_by_side.APART
        for name in names[1:]:
            found = world.figure.placement(posture, f"before {names[0]}").actInv(
                world.figure.placement(posture, f"before {name}")
            )
            own = figure.placement(was, names[0]).actInv(figure.placement(was, name))
            assert found.homogeneous == pytest.approx(own.homogeneous, abs=1e-9)
    monkeypatch.undo()
    page = motion_curves(None, {"before": clip, "after": clip}, scene)
    assert max(lines(page, "joints")["ben/left_elbow_flexion", "before"]) == pytest.approx(0.8, abs=1e-3)


def test_things_that_cannot_be_drawn_are_refused() -> None:
    figure = wb.load("avatar")
    moving = {"box": np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], (2, 1))}
    clip = wb.Clip(figure, np.tile(figure.posture("standing"), (2, 1)), 0.1, "carries", moving)
    with pytest.raises(wb.InputError, match="need to differ"):
        side_by_side.beside(None, {"a/b": clip, "a b": clip}, wb.Scene(figure), "names")
    with pytest.raises(wb.WholebodyError, match="side by side: scene: no thing is called 'box'"):
        side_by_side.beside(None, {"after": clip}, wb.Scene(figure), "without")
    with pytest.raises(InputError, match="box of carries moves; a half-space"):
        side_by_side.beside(None, {"after": clip}, wb.Scene(figure).add(wb.HalfSpace(), name="box"), "floor")
