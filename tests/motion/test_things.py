"""Hands that go with things: a made-up person lifts a box, which figures of other sizes lift too."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.motion.test_retargeting import person
from wholebody.base.errors import InputError
from wholebody.motion.held_points import HeldPoint
from wholebody.motion.holds import Holds
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.standing_ground import NOTHING, Foothold
from wholebody.motion.surfaces import surface_of
from wholebody.motion.thing_contacts import ThingContact, Things, thickness
from wholebody.motion.touching import Touched

SIZE = (0.25, 0.30, 0.2)  # m: of the box, whose sides are 3 cm inwards of the wrists
BOX = coal.Box(*SIZE)


def lifting(frames: int = 18) -> tuple[SkeletonMotion, list[pin.SE3]]:
    """A person of 1.75 m whose arms lift a box between the wrists, and where the box is."""
    motion, turns = person(frames), []
    local = np.tile(np.eye(3), (frames, len(motion.names), 1, 1))
    for k in range(frames):
        turns.append(pin.utils.rotate("y", 1.0 - 0.45 * (1.0 - np.cos(np.pi * k / (frames - 1)))))
        for side, sign in (("left", 1.0), ("right", -1.0)):
            forward = pin.utils.rotate("z", -0.5 * sign * np.pi)
            local[k, motion.names.index(f"{side}_shoulder")] = turns[-1] @ forward
            bent = forward.T @ pin.utils.rotate("y", -0.9) @ forward
            local[k, motion.names.index(f"{side}_elbow")] = bent
    root = np.tile([0.0, 0.0, 0.94], (frames, 1))
    motion = SkeletonMotion.moved(motion.names, motion.parents, motion.offsets, local, root, 1 / 30, "lifting")
    wrists = [motion.positions[:, motion.names.index(f"{side}_wrist")] for side in ("left", "right")]
    return motion, [pin.SE3(turn, place) for turn, place in zip(turns, 0.5 * (wrists[0] + wrists[1]), strict=True)]


def among(figure: wb.Figure, at: pin.SE3) -> wb.Scene:
    return wb.Scene(figure).add(wb.HalfSpace(), name="floor").add(wb.Box(SIZE), name="box", at=at)


def gaps(clip: wb.Clip, side: str, thing: str = "box", shape: coal.ShapeBase = BOX, end: str = "hand") -> np.ndarray:
    """(n,) distance of a hand's pieces to a thing of the clip, by coal; and (n, 3) the wrist in the thing's axes."""
    figure, found = clip.figure, []
    data, placed = figure.model.createData(), figure.geometry.createData()
    joint = figure.model.frames[figure.frame_id(f"{side}_{end}")].parentJoint
    for q, at in zip(clip.q, clip.things[thing], strict=True):
        pin.updateGeometryPlacements(figure.model, data, figure.geometry, placed, q)
        where = pin.XYZQUATToSE3(at)
        apart = [
            coal.distance(
                piece.geometry, coal.Transform3s(own.rotation, own.translation), shape,
                coal.Transform3s(where.rotation, where.translation), coal.DistanceRequest(), coal.DistanceResult(),
            )
            for piece, own in zip(figure.geometry.geometryObjects, placed.oMg, strict=True)
            if joint in figure.model.supports[piece.parentJoint]
        ]  # fmt: skip
        wrist = where.actInv(np.array(data.oMi[joint].translation))
        found.append([min(apart, default=np.inf), *wrist])
    return np.array(found)


def test_hands_stay_at_their_places_of_a_box_that_they_lift() -> None:
    stature, (motion, track) = 1.4, lifting()
    figure = wb.load("human", stature=stature)
    scene = among(figure, track[0])
    clip = wb.retarget(motion, figure, scene, things={"box": track})
    lifted = clip.things["box"][:, 2]
    legs = np.ptp(lifted) / np.ptp([at.translation[2] for at in track])
    assert 0.9 * stature / 1.75 < legs < 1.1 * stature / 1.75  # a smaller person lifts it less high
    for side, sign in (("left", 1.0), ("right", -1.0)):
        off = gaps(clip, side)
        assert off[:, 0].min() > 0.0
        assert off[:, 0].max() < 1e-3
        assert np.ptp(off[:, 1:], axis=0).max() < 1e-3
        assert np.abs(off[:, [1, 3]]).max() < 1e-2
        assert 0.0 < sign * off[0, 2] - 0.5 * SIZE[1] < 0.02  # the wrist is as far from it as half a hand is thick
    assert wb.check(clip, scene).free
    alone = wb.retarget(motion, figure, ground=None)  # without the box the hands are inside it
    assert np.abs(gaps(wb.Clip(figure, alone.q, alone.dt, things=clip.things), "left")[:, 0]).min() > 5e-3


def with_hands(motion: SkeletonMotion, far: float = 0.07) -> SkeletonMotion:
    """The skeleton with hands 7 cm beyond its wrists."""
    wrists = [motion.names.index(f"{side}_wrist") for side in ("left", "right")]
    offsets = np.array([[0.0, far, 0.0], [0.0, -far, 0.0]])
    turns = motion.rotations[:, wrists]
    return SkeletonMotion(
        (*motion.names, "left_hand", "right_hand"), np.append(motion.parents, wrists),
        np.concatenate([motion.offsets, offsets]), np.concatenate([motion.rotations, turns], axis=1),
        np.concatenate([motion.positions, motion.positions[:, wrists] + (turns @ offsets[..., None])[..., 0]], axis=1),
        motion.dt,
    )  # fmt: skip


@pytest.mark.parametrize(("stature", "far"), [(1.5, 0.07), (1.75, 0.2)])
def test_two_hands_stay_on_a_bar(stature: float, far: float) -> None:
    """A bar below the hands, along y: they are as far apart on it as in the recording, `far` from wrist to fingertip.

    It is below the joints of short hands, and halfway from the wrist to those of long ones.
    """
    motion, track = lifting()
    motion = with_hands(motion, far)
    wrists, ends = (
        {side: motion.positions[:, motion.names.index(f"{side}_{part}")] for side in ("left", "right")}
        for part in ("wrist", "hand")
    )
    hands = {side: end if far < 0.1 else 0.5 * (wrists[side] + end) for side, end in ends.items()}
    lying = pin.utils.rotate("x", 0.5 * np.pi)  # a cylinder is along z
    bars = [
        pin.SE3(at.rotation @ lying, middle - 0.03 * at.rotation[:, 2])
        for at, middle in zip(track, 0.5 * (hands["left"] + hands["right"]), strict=True)
    ]
    figure = wb.load("human", stature=stature)
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor").add(wb.Cylinder(0.015, 0.9), name="bar", at=bars[0])
    clip = wb.retarget(motion, figure, scene, things={"bar": bars})
    for side, path in hands.items():
        off = gaps(clip, side, "bar", coal.Cylinder(0.015, 0.9))
        along = [bar.actInv(hand)[2] for bar, hand in zip(bars, path, strict=True)]
        assert off[:, 0].min() > 0.0
        assert off[:, 0].max() < 1e-3
        assert np.ptp(off[:, 1:], axis=0).max() < 1e-3
        assert np.abs(off[:, 3] - along).max() < 1e-2
    assert wb.check(clip, scene).free


@pytest.mark.parametrize("stature", [1.5, 1.7])
def test_hands_that_come_to_a_thin_bar_stay_on_it(stature: float, tmp_path: Path) -> None:
    """Steps that are right for the place of a hand turn it through a bar of 32 mm: hands let go of it, or got stuck."""
    man, postures = wb.load("human", sex="male", stature=1.85), []
    for frame in range(36):
        share = 0.5 - 0.5 * np.cos(np.pi * min(max((frame - 8) / 12, 0.0), 1.0))
        angles = {"shoulder_flexion": 0.9 * share, "elbow_flexion": 0.6 * share}
        named = {f"{side}_{joint}": angle for joint, angle in angles.items() for side in ("left", "right")}
        postures.append(man.with_joints(man.posture("standing"), named))
    wb.Clip(man, np.array(postures), 1 / 30, "bar").write(tmp_path / "bar.bvh")
    data = man.model.createData()
    pin.framesForwardKinematics(man.model, data, postures[-1])
    palms = [data.oMf[man.frame_id(f"{side}_palm")].translation for side in ("left", "right")]
    at = pin.SE3(pin.utils.rotate("x", 0.5 * np.pi), 0.5 * (palms[0] + palms[1]) - [0.0, 0.0, 0.035])
    figure = wb.load("human", stature=stature)
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor").add(wb.Cylinder(0.016, 1.4), name="bar", at=at)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*(does not reach|overlap)")
        clip = wb.retarget(wb.motion.read_skeleton(tmp_path / "bar.bvh"), figure, scene)
    assert wb.check(clip, scene).free
    bar = coal.Cylinder(0.016, 1.4), coal.Transform3s(at.rotation, at.translation)
    placed, joints, geometry = figure.geometry.createData(), figure.model.createData(), figure.geometry
    hands = [[k for k, piece in enumerate(geometry.geometryObjects) if piece.parentJoint == figure.model.frames[
        figure.frame_id(f"{side}_palm")].parentJoint] for side in ("left", "right")]  # fmt: skip
    for q in clip.q[26:]:
        pin.updateGeometryPlacements(figure.model, joints, geometry, placed, q)
        for hand in hands:
            gaps = [
                coal.distance(
                    geometry.geometryObjects[k].geometry,
                    coal.Transform3s(placed.oMg[k].rotation, placed.oMg[k].translation), *bar,
                    coal.DistanceRequest(), coal.DistanceResult(),
                ) for k in hand
            ]  # fmt: skip
            assert 0.0 < min(gaps) < 2e-3


def robot(folder: Path, forearm: float | None = None) -> wb.Figure:
    """A robot of 1.75 m without hands: an arm ends beyond two joints of its wrist, which are 8 cm apart.

    With a radius of its `forearm` that alone has a piece, which goes on for 5 cm beyond the last joint.
    """
    parts = ["<link name='pelvis'/>"]

    def joint(name: str, parent: str, at: str, axis: str, shape: str = "", off: str = "0 0 0") -> str:
        solid = f"<collision><origin xyz='{off}'/><geometry>{shape}</geometry></collision>" if shape else ""
        parts.append(
            f"<link name='{name}'>{solid}</link><joint name='{name}_joint' type='revolute'><parent link='{parent}'/>"
            f"<child link='{name}'/><origin xyz='{at}'/><axis xyz='{axis}'/>"
            "<limit lower='-2.8' upper='2.8' effort='1' velocity='20'/></joint>"
        )
        return name

    for side, y in (("left", 1), ("right", -1)):
        end = joint(f"{side}_hip_roll", "pelvis", f"0 {0.09 * y} 0", "1 0 0")
        end = joint(f"{side}_hip_pitch", end, "0 0 0", "0 1 0")
        end = joint(f"{side}_knee", end, "0 0 -0.42", "0 1 0")
        end = joint(f"{side}_ankle", end, "0 0 -0.42", "0 1 0", "<box size='0.24 0.09 0.04'/>", "0.04 0 -0.06")
        end = joint(f"{side}_shoulder_pitch", "pelvis", f"0 {0.18 * y} 0.5", "0 1 0")
        end = joint(f"{side}_shoulder_roll", end, "0 0 0", "1 0 0")
        end = joint(f"{side}_shoulder_yaw", end, "0 0 0", "0 0 1")
        if forearm is not None:
            long = f"<cylinder radius='{forearm}' length='0.2'/>"
            end = joint(f"{side}_elbow", end, "0 0 -0.28", "0 1 0", long, "0 0 -0.18")
            end = joint(f"{side}_wrist_roll", end, "0 0 -0.15", "0 0 1")
            end = joint(f"{side}_wrist_yaw", end, "0 0 -0.08", "1 0 0")
            continue
        end = joint(f"{side}_elbow", end, "0 0 -0.28", "0 1 0", "<sphere radius='0.03'/>")
        end = joint(f"{side}_wrist_roll", end, "0 0 -0.15", "0 0 1", "<sphere radius='0.03'/>")
        end = joint(f"{side}_wrist_yaw", end, "0 0 -0.08", "1 0 0", "<box size='0.06 0.03 0.1'/>", "0 0 -0.05")
    path = folder / "robot.urdf"
    path.write_text(f"<robot name='robot'>{''.join(parts)}</robot>")
    return wb.load(path, root="free")


def test_a_robot_lifts_a_box_between_the_ends_of_its_arms(tmp_path: Path) -> None:
    motion, track = lifting()
    figure = robot(tmp_path)
    scene = among(figure, track[0])
    clip = wb.retarget(motion, figure, scene, things={"box": track})
    for side in ("left", "right"):
        off = gaps(clip, side, end="wrist_yaw")[:, 0]
        assert off.min() > 0.0
        assert off.max() < 1e-3
    assert wb.check(clip, scene).free


@pytest.mark.parametrize("radius", [0.01, 0.035])
def test_a_robot_without_pieces_at_its_wrists_keeps_these_at_a_box(radius: float, tmp_path: Path) -> None:
    """Wrists are 3 cm from the box in the recording; a forearm that is thicker lies against it."""
    motion, track = lifting()
    figure = robot(tmp_path, radius)
    scene = among(figure, track[0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # "does not reach"
        clip = wb.retarget(motion, figure, scene, things={"box": track})
    for side, sign in (("left", 1.0), ("right", -1.0)):
        wrist = gaps(clip, side, end="wrist_yaw")[:, 1:]
        forearm = gaps(clip, side, end="elbow")[:, 0]
        assert forearm.min() > 0.0
        assert np.ptp(wrist, axis=0).max() < 1e-3
        off = sign * wrist[:, 1] - 0.5 * SIZE[1] - 0.03 if radius < 0.03 else forearm
        assert np.abs(off).max() < 1.5e-3
    assert wb.check(clip, scene).free


def test_the_thickness_of_a_part_whose_pieces_lie_beside_each_other() -> None:
    """A ball about the start, and one beyond it that one way passes at a distance and another one goes through."""
    pieces = [
        pin.GeometryObject("near", 0, pin.SE3.Identity(), coal.Sphere(0.03)),
        pin.GeometryObject("far", 0, pin.SE3(np.eye(3), np.array([0.0, 0.05, 0.12])), coal.Ellipsoid(0.04, 0.04, 0.04)),
    ]
    assert thickness(pieces, np.zeros(3), np.array([0.0, 0.0, 1.0])) == pytest.approx(0.03, abs=1e-3)
    assert thickness(pieces, np.zeros(3), np.array([0.0, 5.0, 12.0]) / 13.0) == pytest.approx(0.17, abs=1e-3)


def test_the_floor_is_below_a_place_right_beside_a_table() -> None:
    scene = among(wb.load("hand"), pin.SE3(np.eye(3), np.array([0.0, 0.0, 1.0])))
    height = surface_of(scene)
    assert height(np.array([0.0, 0.0, 1.6]), 0) == pytest.approx(1.0 + 0.5 * SIZE[2], abs=1e-3)
    assert height(np.array([0.5 * SIZE[0] + 2e-3, 0.0, 1.6]), 0) == pytest.approx(0.0, abs=1e-3)
    assert height(np.array([0.0, 0.0, 1.0]), 0) is None  # inside of the table


def test_what_is_out_of_reach_is_said_and_let_go_of(recwarn: pytest.WarningsRecorder) -> None:
    motion, track = lifting(30)
    figure = wb.load("human", stature=1.3)
    scene = among(figure, track[0]).add(wb.Box((0.1, 0.1, 0.1)), name="post", at=(3.0, 3.0, 0.05))
    clip = wb.retarget(motion, figure, scene, things={"box": track})  # beside the post the box keeps its way
    assert clip.things["box"][:, :3] == pytest.approx(np.array([at.translation for at in track]))
    told = next(str(one.message) for one in recwarn if "does not reach box" in str(one.message))
    for side in ("left", "right"):
        away = gaps(clip, side, end="forearm")[:, 0]  # before it lets go, the forearm may touch the box, not the hand
        first, last, far = map(
            int, re.findall(rf"{side}_wrist does not reach box in frames (\d+) to (\d+) .*? (\d+) mm", told)[0]
        )
        assert first > 15  # the box is in reach for longer than half of the clip
        assert last == len(clip) - 1
        assert away[:first].max() < 5e-3
        assert far == round(1e3 * away.max())
    assert wb.check(clip, scene).colliding == 0
    assert np.abs(clip.q[:, :3] - clip.q[0, :3]).max() < 0.2  # the body leans, and does not go after it
    assert np.abs(clip.q[-1, :3] - clip.q[0, :3]).max() < 0.05


def test_round_things_rise_by_the_scale_of_what_is_below_them() -> None:
    scene = wb.Scene(wb.load("human")).add(wb.Ellipsoid((0.3, 0.2, 0.1)), name="egg", at=(1.0, 0.0, 1.0))
    upright = pin.SE3ToXYZQUAT(pin.SE3(pin.utils.rotate("y", 0.5 * np.pi), np.array([1.0, 0.0, 1.0])))
    track = np.array([[1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], upright])
    scaled = Things(scene, {"egg": track}).scaled("egg", 0.5)
    assert scaled[:, :3] == pytest.approx(np.array([[0.5, 0.0, 0.1 + 0.45], [0.5, 0.0, 0.3 + 0.35]]))


def test_hands_stay_on_a_table_that_stands() -> None:
    motion, track = lifting(2)
    motion = SkeletonMotion(
        motion.names, motion.parents, motion.offsets, np.repeat(motion.rotations[:1], 8, axis=0),
        np.repeat(motion.positions[:1], 8, axis=0), 1 / 30,
    )  # fmt: skip
    figure = wb.load("human", stature=1.65)
    scene = among(figure, track[0])
    held = wb.retarget(motion, figure, scene)
    off = gaps(wb.Clip(figure, held.q, held.dt, things={"box": np.tile(pin.SE3ToXYZQUAT(track[0]), (8, 1))}), "right")
    assert np.abs(off[:, 0]).max() < 2e-3
    loose = wb.retarget(motion, figure, scene, ground=None)  # holds nothing, and is free all the same
    off = gaps(wb.Clip(figure, loose.q, loose.dt, things={"box": np.tile(pin.SE3ToXYZQUAT(track[0]), (8, 1))}), "right")
    assert off[:, 0].min() > 5e-3


def test_a_hand_rests_on_the_ground_before_and_after_it_touches_a_thing() -> None:
    scene = among(wb.load("human"), pin.SE3(np.eye(3), np.array([0.4, 0.0, 1.0])))
    rests = [Foothold("left_hand", *frames, np.zeros(3), 0.0) for frames in ((0, 5), (18, 30), (40, 50))]
    contact = ThingContact("left_hand", 20, 30, "box", np.array([0.0, 0.15, 0.0]), np.array([0.0, 1.0, 0.0]))
    points = [HeldPoint("left_hand", "", 1, np.zeros(3)), HeldPoint("left_hand", "", 1, np.zeros(3), thing=True)]
    ground = replace(NOTHING, footholds=tuple(rests))
    held = Holds(points, ground, 1.0, 1 / 30, None, Touched(scene.figure, Things(scene, {}), [contact]))
    held.begin(dict.fromkeys(range(60), scene.figure.neutral))
    paths = {frame: np.zeros((2, 3)) for frame in range(60)}
    weights = [held.goals(frame, paths, np.zeros(3))[1][:, 0] for frame in (3, 25, 45)]
    assert [(ground > 0.0, thing > 0.0) for ground, thing in weights] == [(True, False), (False, True), (True, False)]


def test_what_is_let_go_of_in_any_run_is_told_frame_by_frame() -> None:
    """A contact of frames 20 to 29 that a run loses in frame 28, and the next one in frame 21."""
    scene = among(wb.load("human"), pin.SE3(np.eye(3), np.array([0.0, 0.0, 1.0])))
    contact = ThingContact("left_hand", 20, 30, "box", np.array([0.0, 0.15, 0.0]), np.array([0.0, 1.0, 0.0]))
    points, q = [HeldPoint("left_hand", "", 1, np.zeros(3), thing=True)], scene.figure.neutral
    held = Holds(points, NOTHING, 1.0, 1 / 30, None, Touched(scene.figure, Things(scene, {}), [contact]))
    held.begin({20: q})
    paths = {frame: np.zeros((1, 3)) for frame in range(40)}
    for lost in (28, 21):
        for frame in range(20, 30):
            goals = held.goals(frame, paths, np.zeros(3))
            assert frame != lost or held.lost(frame, q, goals[0] + (0.1, 0.0, 0.0), goals)
        assert held.give_up()
    assert not held.give_up()
    assert "left_hand does not reach box in frames 20 to 21 and 28 to 29" in held.let_go(np.tile(q, (40, 1)))


def test_a_hand_on_a_seat_is_no_pelvis_on_it() -> None:
    """A ball is beside the left hand of a person who stands; the thigh sits with the pelvis, the hand does not."""
    figure = wb.load("human")
    q, data = figure.posture("standing"), figure.model.createData()
    pin.framesForwardKinematics(figure.model, data, q)
    x, y, z = data.oMf[figure.frame_id("left_hand")].translation
    scene = wb.Scene(figure).add(wb.Sphere(0.1), name="ball", at=(x, y + 0.2, z))
    found, away = scene.contacts(q, within=0.5), dict[str, float]()
    for pair, distance in zip(found.pair, found.distance, strict=True):
        owners = {scene.piece_owner[piece] for piece in pair}
        if "ball" in owners:
            part = next(iter(owners - {"ball"}))
            away[part] = min(away.get(part, np.inf), float(distance))
    contact = ThingContact("pelvis", 0, 1, "ball", np.array([0.0, -0.1, 0.0]), np.array([0.0, -1.0, 0.0]))
    touched, point = Touched(figure, Things(scene, {}), [contact]), HeldPoint("pelvis", "", 1, np.zeros(3))
    gap = touched.gap(contact, point, 0, q, alone=True)
    trunk = (gap for part, gap in away.items() if re.search("pelvis|thigh|lumbar|thorax", part))
    assert gap == pytest.approx(min(trunk), abs=0.02)  # m: by which flesh that spreads only on a seat is wider
    assert gap > away["left_hand"] + 0.03


def test_check_moves_the_things_of_a_clip() -> None:
    figure = wb.load("human")
    q = np.tile(figure.posture("standing"), (3, 1))
    scene = wb.Scene(figure).add(wb.Sphere(0.1), name="ball", at=(3.0, 0.0, 1.2))
    assert wb.check(wb.Clip(figure, q, 0.1), scene).free
    through = wb.Clip(figure, q, 0.1, things={"ball": np.array([(3.0, 0.0, 1.2), (1.0, 0.0, 1.2), (-1.0, 0.0, 1.2)])})
    found = wb.check(through, scene)
    assert found.colliding == 0
    assert found.deepest_between > 0.1
    assert {each.second for each in found.contacts} | {each.first for each in found.contacts} >= {"ball"}
    with pytest.raises(InputError, match="ball of clip moves"):
        wb.avoid(through, scene)


def test_things_go_with_their_clips(tmp_path: Path) -> None:
    figure = wb.load("human")
    q = np.tile(figure.posture("standing"), (3, 1))
    places = np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], (3, 1))
    places[1, 0] = 1.0
    places[2] = pin.SE3ToXYZQUAT(pin.SE3(pin.utils.rotate("z", 1.0), np.array([1.0, 0.5, 0.0])))
    clip = wb.Clip(figure, q, 0.1, "with a ball", {"ball": places})
    half = clip.resampled(0.05).things["ball"]
    assert half[1] == pytest.approx([0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    assert half[3] == pytest.approx([1.0, 0.25, 0.5, 0.0, 0.0, np.sin(0.25), np.cos(0.25)])
    assert clip[1:].things["ball"] == pytest.approx(clip.things["ball"][1:])
    assert clip.joined(clip).things["ball"].shape == (6, 7)
    assert clip.mirrored().things["ball"][2] == pytest.approx([1.0, -0.5, 0.0, 0.0, 0.0, -np.sin(0.5), np.cos(0.5)])
    read = wb.read_clip(clip.write(tmp_path / "ball.npz"), figure)
    assert read.things["ball"] == pytest.approx(clip.things["ball"], abs=0.0)
    with pytest.warns(UserWarning, match="holds postures, without ball"):
        clip.write(tmp_path / "ball.csv")


def test_wrong_things_are_refused_before_anything_is_computed() -> None:
    motion, track = lifting(4)
    figure = wb.load("human")
    scene = among(figure, track[0])
    with pytest.raises(InputError, match="things move in a scene"):
        wb.retarget(motion, figure, things={"box": track})
    with pytest.raises(InputError, match="box has 3 placements for 4 frames"):
        wb.retarget(motion, figure, scene, things={"box": track[:3]})
    with pytest.raises(wb.WholebodyError, match="bux"):
        wb.retarget(motion, figure, scene, things={"bux": track})
    with pytest.raises(InputError, match="floor is a half-space, which stands"):
        wb.retarget(motion, figure, scene, things={"floor": track})
    with pytest.raises(InputError, match="frame 1"):
        wb.retarget(motion, figure, scene, things={"box": [track[0], (0.0, np.nan, 0.0), *track[2:]]})


@pytest.mark.parametrize("stature", [1.5])
def test_people_of_other_sizes_sit_on_the_seat_of_the_recording(stature: float) -> None:
    motion = person(8)
    local = np.tile(np.eye(3), (8, len(motion.names), 1, 1))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        local[:, motion.names.index(f"{side}_hip")] = pin.utils.rotate("y", -0.5 * np.pi)
        local[:, motion.names.index(f"{side}_knee")] = pin.utils.rotate("y", 0.5 * np.pi)
        local[:, motion.names.index(f"{side}_shoulder")] = pin.utils.rotate("x", -1.3 * sign)
    root = np.tile([0.0, 0.0, 0.51], (8, 1))
    motion = SkeletonMotion.moved(motion.names, motion.parents, motion.offsets, local, root, 1 / 30, "sitting")
    figure, top = wb.load("human", stature=stature), 0.37
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.4, 0.45, 0.05)), name="seat", at=(-0.02, 0.0, top - 0.025))
    clip = wb.retarget(motion, figure, scene)
    assert wb.check(clip, scene).free
    seat = [
        each for each in scene.contacts(clip.q[-1], within=2e-3).pair if "seat" in {scene.piece_owner[k] for k in each}
    ]
    assert seat  # the pelvis or the thighs are on it
    assert np.ptp(clip.q[:, :3], axis=0).max() < 1e-3


def test_a_scene_of_several_figures_is_refused_with_what_to_do(human: wb.Figure) -> None:
    scene = wb.Scene({"ann": human, "ben": (human, (1.0, 0.0, 0.0))})
    with pytest.raises(wb.InputError, match=r"retarget: the scene has several figures.*posture\(\{'ann': q"):
        wb.retarget(lifting(4)[0], human, scene)
