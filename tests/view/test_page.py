"""The page in a real Chromium: all is where Pinocchio says, in the colour of its state, without a network."""

from __future__ import annotations

import io
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
from PIL import Image

from wholebody.base.errors import UnknownNameError
from wholebody.figures import load
from wholebody.scene.scene import Scene
from wholebody.tasks import Axis, CenterOfMass, Frame, Orientation, Point
from wholebody.view import Viewer
from wholebody.view.browser import Browser
from wholebody.view.style import LOOK

pytestmark = pytest.mark.browser


def pixels(browser: Browser) -> Any:
    return np.asarray(Image.open(io.BytesIO(browser.capture())).convert("RGB")).astype(int)


def project(place: Any, eye: Any, target: Any, width: int, height: int) -> tuple[int, int]:
    """Column and row of a place in the picture of a pinhole camera that has z upright."""
    eye, target = np.array(eye, dtype=float), np.array(target, dtype=float)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    away = np.asarray(place) - eye
    scale = height / 2 / np.tan(np.radians(LOOK.field_of_view) / 2) / (away @ forward)
    return round(width / 2 + scale * (away @ right)), round(height / 2 - scale * (away @ up))


def goals(scene: Any, q: Any, *terms: Any) -> Any:
    return SimpleNamespace(goals=[term.resolve(scene, q) for term in terms])


def test_the_saved_page_needs_no_network_and_is_where_pinocchio_says(
    exhibit: Any, browser: Browser, as_pinocchio_says: Any, piece_nodes: Any, tmp_path: Path
) -> None:
    viewer = Viewer(exhibit)
    viewer.show(exhibit.posture(1))
    exhibit.geometry.geometryObjects[-4].placement = pin.SE3(
        pin.exp3(np.array([0.3, 1.0, -0.5])), np.array([0.5, -0.7, 0.9])
    )  # a thing is moved
    q = exhibit.posture(2)
    viewer.show(q)
    browser.open(viewer.save(tmp_path / "scene.html").as_uri())
    assert [url for url in browser.requests if not url.startswith(("data:", "file://"))] == []
    as_pinocchio_says(exhibit, q)
    assert all(entry["seen"] for entry in piece_nodes(exhibit))
    assert pixels(browser).std() > 15
    capsule = browser.evaluate(
        "(() => { const node = viewer.scene_tree.find(['objects', 'hat', 'head2_joint', 'hat:0', '<object>']);"
        " const g = node.object.geometry;"
        " g.computeBoundingBox(); return [...g.boundingBox.min.toArray(), ...g.boundingBox.max.toArray()] })()"
    )
    np.testing.assert_allclose(capsule, [-0.05, -0.05, -0.15, 0.05, 0.05, 0.15], atol=1e-6)


def test_the_live_page_follows_and_a_late_one_catches_up(
    exhibit: Any, browser: Browser, as_pinocchio_says: Any, nodes: Any
) -> None:
    with Viewer(exhibit, names=True) as viewer:
        viewer.show(exhibit.posture(1))
        browser.open(viewer.url)
        assert viewer.wait(10.0)
        for seed in range(2, 12):
            viewer.show(exhibit.posture(seed))
        assert viewer.sync(10.0)
        as_pinocchio_says(exhibit, exhibit.posture(11))
        exhibit.geometry.geometryObjects[-4].placement = pin.SE3(
            pin.exp3(np.array([0.3, 1.0, -0.5])), np.array([0.5, -0.7, 0.9])
        )
        viewer.show(exhibit.posture(40))
        assert viewer.sync(10.0)
        as_pinocchio_says(exhibit, exhibit.posture(40))
        browser.open(viewer.url)  # the same picture in a fresh tab
        assert viewer.sync(10.0)
        as_pinocchio_says(exhibit, exhibit.posture(40))
        assert [entry["text"] for entry in nodes(["/names/table", "/names/egg"])] == ["table", "egg"]
        assert nodes(["/names/floor"]) == [None]
        exhibit.add("crate", coal.Box(0.3, 0.3, 0.3), (1.0, 1.0, 0.0))  # things come and go
        viewer.show(exhibit.posture(2))
        assert viewer.sync(10.0)
        as_pinocchio_says(exhibit, exhibit.posture(2))
        exhibit.geometry.removeGeometryObject("crate:0")
        exhibit.piece_owner.pop()
        del exhibit.objects["crate"]
        exhibit.revision += 1
        viewer.show(exhibit.posture(3))
        assert viewer.sync(10.0)
        as_pinocchio_says(exhibit, exhibit.posture(3))
        assert nodes(["/objects/crate"]) == [None]


def test_a_motion_is_where_pinocchio_says_at_every_frame(
    exhibit: Any, browser: Browser, as_pinocchio_says: Any, tmp_path: Path
) -> None:
    with Viewer(exhibit) as viewer:
        rest = exhibit.posture(9)
        viewer.show(rest)
        browser.open(viewer.url)
        motion = SimpleNamespace(q=np.array([exhibit.posture(seed) for seed in range(8)]), dt=0.05)
        viewer.play(motion)
        assert viewer.sync(10.0)
        browser.until("viewer.animator.actions.length > 0")
        for number in (5, 2, 0):
            browser.evaluate(f"wholebody.seek({0.05 * number})")
            as_pinocchio_says(exhibit, motion.q[number])
        browser.evaluate("wholebody.play()")
        browser.until("!viewer.animator.playing")
        as_pinocchio_says(exhibit, motion.q[7])
        viewer.play(motion, dt=2.0)
        page = viewer.save(tmp_path / "motion.html").as_uri()
        browser.until("viewer.animator.time > 0.1")
        viewer.show(rest)  # ends the motion
        assert viewer.sync(10.0)
        assert browser.evaluate("viewer.animator.actions.length") == 0
        as_pinocchio_says(exhibit, rest)
        browser.open(page)
        assert browser.evaluate("viewer.animator.duration") == pytest.approx(14.0)
        browser.until("viewer.animator.playing && viewer.animator.time > 0.1")  # it plays by itself
        browser.evaluate("wholebody.seek(6.0)")
        as_pinocchio_says(exhibit, motion.q[3])


def touching(exhibit: Any) -> tuple[Any, Any, Any]:
    """Postures with the humanoid 200 mm above the floor, 2 mm above it, and 30 mm in it."""
    q = pin.neutral(exhibit.model)
    q[:2] = -1.5  # away from the table
    contacts = exhibit.contacts(q, within=9.0)
    height = min(contacts.distance[contacts.pair[:, 1] == exhibit.piece_owner.index("floor")])
    postures = [q.copy(), q.copy(), q.copy()]
    for posture, gap in zip(postures, (0.2, 0.002, -0.03), strict=True):
        posture[2] += gap - height
    return postures[0], postures[1], postures[2]


def test_pieces_take_the_colour_of_their_state(exhibit: Any, browser: Browser, piece_nodes: Any, nodes: Any) -> None:
    free, near, inside = touching(exhibit)
    with Viewer(exhibit) as viewer:
        viewer.show(free)
        browser.open(viewer.url)
        assert not [entry for entry in piece_nodes(exhibit) if np.allclose(entry["color"], LOOK.contact[:3], atol=0.01)]
        for q, color in ((near, LOOK.contact), (inside, LOOK.penetration)):
            viewer.show(q)
            assert viewer.sync(10.0)
            contacts = exhibit.contacts(q, within=0.005)
            assert len(contacts.distance)
            found = piece_nodes(exhibit)
            floor = exhibit.piece_owner.index("floor")
            touching_floor = {int(a) for a, b in contacts.pair if b == floor}
            colored = {i for i, entry in enumerate(found) if np.allclose(entry["color"], color[:3], atol=0.01)}
            assert colored == touching_floor
            assert not np.allclose(found[floor]["color"], color[:3], atol=0.2)
            for row in range(len(contacts.distance)):
                a, b = nodes([f"/contacts/{row}/a", f"/contacts/{row}/b"])
                np.testing.assert_allclose(a["matrix"][:3, 3], contacts.point_a[row], atol=1e-5)
                np.testing.assert_allclose(b["matrix"][:3, 3], contacts.point_b[row], atol=1e-5)
        depth, text, normal = nodes(["/contacts/0/depth", "/contacts/0/text", "/contacts/0/normal"])
        assert text["text"] == f"{-1000 * exhibit.contacts(inside).distance[0]:.1f} mm"
        assert depth["seen"]
        assert not normal["seen"]
        np.testing.assert_allclose(depth["matrix"][:3, 2], [0, 0, LOOK.shortest_depth], atol=1e-5)  # out is up
        viewer.show(near)
        assert viewer.sync(10.0)
        depth, normal = nodes(["/contacts/0/depth", "/contacts/0/normal"])
        assert normal["seen"]
        assert not depth["seen"]
        np.testing.assert_allclose(normal["matrix"][:3, 2] / LOOK.normal_length, [0, 0, -1], atol=1e-5)
        viewer.show(free)
        assert viewer.sync(10.0)
        assert not any(entry["seen"] for entry in nodes(["/contacts/0/a", "/contacts/0/normal"]))


def test_colours_and_markers_change_in_the_course_of_a_motion(
    exhibit: Any, browser: Browser, piece_nodes: Any, nodes: Any, tmp_path: Path
) -> None:
    free, near, inside = touching(exhibit)
    viewer = Viewer(exhibit)
    viewer.play([free, near, inside, free], dt=0.1)
    browser.open(viewer.save(tmp_path / "motion.html").as_uri())
    piece = int(exhibit.contacts(inside).pair[0, 0])
    for time, color, seen in (
        (0.05, LOOK.figure, (False, False)),
        (0.1, LOOK.contact, (True, False)),
        (0.2, LOOK.penetration, (False, True)),
        (0.3, LOOK.figure, (False, False)),
    ):
        browser.evaluate(f"wholebody.seek({time} + 1e-6)")
        np.testing.assert_allclose(piece_nodes(exhibit)[piece]["color"], color[:3], atol=0.01)
        shown = nodes(["/contacts/0/normal", "/contacts/0/depth"])
        assert tuple(entry["seen"] for entry in shown) == seen


def test_a_marker_that_comes_later_and_never_changes_is_where_it_belongs(
    exhibit: Any, browser: Browser, nodes: Any, tmp_path: Path
) -> None:
    free, near, _ = touching(exhibit)
    viewer = Viewer(exhibit)
    viewer.play([free, near, near], dt=0.1)
    browser.open(viewer.save(tmp_path / "motion.html").as_uri())
    browser.evaluate("wholebody.seek(0.15)")
    point, normal = nodes(["/contacts/0/a", "/contacts/0/normal"])
    contacts = exhibit.contacts(near, within=0.005)
    np.testing.assert_allclose(point["matrix"][:3, 3], contacts.point_a[0], atol=1e-5)
    np.testing.assert_allclose(normal["matrix"][:3, 2] / LOOK.normal_length, contacts.normal[0], atol=1e-5)


def test_goals_are_at_their_targets_with_what_is_left_and_ghosts_are_transparent(
    exhibit: Any, browser: Browser, nodes: Any
) -> None:
    q = exhibit.posture(1)
    data = exhibit.model.createData()
    pin.framesForwardKinematics(exhibit.model, data, q)
    hand = data.oMf[exhibit.model.getFrameId("rarm_wrist2_joint")]
    head = data.oMf[exhibit.model.getFrameId("head2_joint")]
    wish = hand * pin.SE3(pin.exp3(np.array([0, 0, 0.5])), np.zeros(3))
    target = hand.translation + (0.03, -0.04, 0.12)
    problem = goals(
        exhibit,
        q,
        Point("rarm_wrist2_joint", target),
        Frame("rarm_wrist2_joint", wish),
        Orientation("head2_joint", pin.Quaternion(head.rotation).coeffs()),
        Axis("head2_joint", (1, 0, 0), toward=(2.0, 1.0, 0.0)),
        CenterOfMass((0.1, 0.0, 0.0), axes="xy"),
        Axis("head2_joint", (1, 0, 0), direction=(0.0, 0.0, 3.0)),
    )
    with Viewer(exhibit) as viewer:
        viewer.show(q, problem=problem)
        browser.open(viewer.url)
        assert viewer.sync(10.0)
        point, line, words = nodes(["/goals/0/target", "/goals/0/line", "/goals/0/text"])
        np.testing.assert_allclose(point["matrix"][:3, 3], target, atol=1e-5)
        np.testing.assert_allclose(line["matrix"] @ (0, 0, 1, 1), [*target, 1], atol=1e-5)
        np.testing.assert_allclose(line["matrix"] @ (0, 0, 0, 1), [*hand.translation, 1], atol=1e-5)
        assert words["text"] == "rarm_wrist2_joint  130.0 mm"
        axes = nodes([f"/goals/1/axes/{name}" for name in "xyz"])
        found = np.column_stack([entry["matrix"][:3, 2] / LOOK.axes_length for entry in axes])
        np.testing.assert_allclose(found, wish.rotation, atol=1e-5)
        assert nodes(["/goals/1/text"])[0]["text"] == "rarm_wrist2_joint  0.0 mm  28.6°"
        assert nodes(["/goals/2/text"])[0]["text"] == "head2_joint  0.0°"
        wanted = nodes(["/goals/3/wanted"])[0]["matrix"][:3, 2]
        np.testing.assert_allclose(np.cross(wanted, (2.0, 1.0, 0.0) - head.translation), 0.0, atol=1e-5)
        np.testing.assert_allclose(nodes(["/goals/4/target"])[0]["matrix"][:3, 3], [0.1, 0.0, 0.0], atol=1e-5)
        tip = head.translation + (0.0, 0.0, 2.5 * LOOK.axes_length)  # of the arrow: the head itself is not hidden
        np.testing.assert_allclose(nodes(["/goals/5/text"])[0]["matrix"][:3, 3], tip, atol=1e-5)
        viewer.show(q)
        viewer.ghosts([exhibit.posture(4), ghost := exhibit.posture(5)])
        assert viewer.sync(10.0)
        assert not nodes(["/goals/0/target"])[0]["seen"]
        pin.forwardKinematics(exhibit.model, data, ghost)
        hat = exhibit.geometry.geometryObjects[exhibit.geometry.getGeometryId("hat:0")]
        path = "/ghosts/1/objects/hat/head2_joint/hat:0"
        (found,) = nodes([path])
        np.testing.assert_allclose(found["matrix"], (data.oMi[hat.parentJoint] * hat.placement).homogeneous, atol=1e-5)
        assert found["opacity"] == pytest.approx(LOOK.ghost[3])
        names = [*path.strip("/").split("/"), "<object>"]
        assert browser.evaluate(f"viewer.scene_tree.find({names}).object.castShadow") is False
        assert nodes(["/ghosts/1/objects/table"]) == [None]
        viewer.ghosts([])
        assert viewer.sync(10.0)
        assert nodes(["/ghosts"]) == [None]


def test_colours_at_projected_places(exhibit: Any, browser: Browser, tmp_path: Path) -> None:
    q = pin.neutral(exhibit.model)
    q[1] += 3.0  # out of the way
    target = np.array([0.5, 0.2, 0.7])
    eye, middle = (3.0, -2.0, 1.4), (0.4, 0.0, 0.3)
    viewer = Viewer(exhibit, see_through=["egg"])
    viewer.look(eye, middle)
    viewer.show(q, problem=goals(exhibit, q, Point("head2_joint", target)))
    browser.open(viewer.save(tmp_path / "scene.html").as_uri())
    picture = pixels(browser)
    height, width = picture.shape[:2]
    column, row = project(target, eye, middle, width, height)
    np.testing.assert_allclose(picture[row, column], np.array(LOOK.target) * 255, atol=2)  # unlit: exact
    green = np.argwhere((np.abs(picture - np.array(LOOK.target) * 255) < 3).all(axis=2))
    near = green[np.abs(green - (row, column)).max(axis=1) < 6]
    np.testing.assert_allclose(near.mean(axis=0), (row, column), atol=1.5)
    table = exhibit.geometry.geometryObjects[exhibit.geometry.getGeometryId("table:0")].placement
    column, row = project(table.act(np.array([0.1, -0.3, 0.02])), eye, middle, width, height)
    red, green_, blue = picture[row, column]
    assert blue > 1.3 * red
    assert blue > 1.3 * green_


def test_the_camera_holds_the_figure_and_its_ghosts_in_the_middle(
    exhibit: Any, browser: Browser, piece_nodes: Any, nodes: Any, tmp_path: Path
) -> None:
    viewer = Viewer(exhibit)
    viewer.show(exhibit.posture(1))
    far = exhibit.posture(2)
    far[:3] += (0.5, 6.0, 0.3)
    viewer.ghosts([far])
    browser.resize((160, 320))
    browser.open(viewer.save(tmp_path / "scene.html").as_uri())
    figure = [entry for entry in piece_nodes(exhibit) if entry["path"].startswith("/figure/")]
    shown = [*figure, *nodes([f"/ghosts/0{entry['path']}" for entry in figure])]
    places = [entry["matrix"][:3, 3].tolist() for entry in shown]
    seen = np.array(
        browser.evaluate(
            "(places => { viewer.camera.updateMatrixWorld(); return places.map(([x, y, z]) =>"
            f" new MeshCat.THREE.Vector3(x, z, -y).project(viewer.camera).toArray()) }})({places})"
        )
    )
    assert np.abs(seen[:, :2]).max() < 1.0  # all of it is in the picture,
    assert np.abs(seen[:, :2]).max() > 0.7  # fills it,
    assert np.abs(seen[:, 0].min() + seen[:, 0].max()) < 0.4  # in its middle


def test_axes_of_frames_are_drawn_where_they_are_and_go_when_asked(browser: Browser, nodes: Any) -> None:
    figure = load("hand")
    q, names = figure.neutral, ("right_palm", "right_index_tip")
    with Viewer(Scene(figure)) as viewer:
        viewer.show(q)
        viewer.frames(names, length=0.2)
        browser.open(viewer.url)
        for name in names:
            placement = figure.placement(q, name)
            for axis, direction in zip("xyz", placement.rotation.T, strict=True):
                (found,) = nodes([f"/frames/{name}/{axis}"])
                matrix = np.array(found["matrix"])
                np.testing.assert_allclose(matrix[:3, 3], placement.translation, atol=1e-5)
                along = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
                assert max(along.T @ direction) == pytest.approx(1.0, abs=1e-5)  # the arrow's own axis
        with pytest.raises(UnknownNameError):
            viewer.frames(["nowhere"])
        viewer.frames([])
        assert viewer.sync(10.0)
        assert not any(found["seen"] for found in nodes([f"/frames/{name}/x" for name in names]))
