"""Scenes for the frame loop, in which the tracked posture penetrates walls, tables and the figure itself.

After the experiments of Schmidl and Lin, "Real-time physically-based interaction between avatars and virtual
environments" (table 2, figures 2, 5, 7 and 8), without their balls.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import known
from wholebody.figures.figure import Figure
from wholebody.figures.joined import one_figure
from wholebody.geometry.shapes import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Sphere, Torus
from wholebody.scene.scene import Scene
from wholebody.tracking.frame import FRAME
from wholebody.tracking.scripts import Keys, Place, ScenePlan, standing_at
from wholebody.tracking.tracks import Track

Color = tuple[float, float, float, float]

WALL: Color = (0.86, 0.85, 0.82, 1.0)
OAK: Color = (0.60, 0.48, 0.36, 1.0)
STONE: Color = (0.72, 0.72, 0.70, 1.0)
BRONZE: Color = (0.55, 0.42, 0.26, 1.0)
BLUE: Color = (0.30, 0.42, 0.58, 1.0)

HALF_WIDTH = 2.5  # m: of a room, along y
LENGTH = 5.0  # m: of a room, along x; the rooms meet at x = 0
HEIGHT = 2.6
DOOR_WIDTH, DOOR_HEIGHT = 1.0, 2.1

TABLE: Place = (-2.5, 1.2, 0.74)  # m: middle of the top of the long table
TABLE_SIZE = (1.6, 0.8, 0.04)


@dataclass(frozen=True)
class InteractionScene:
    """A scene with a tracker.

    Attributes:
        name, about: its name on the command line, and one sentence.
        scene, track: figure and things, and the tracked postures.
        rigid: whether the figure is displaced as a whole, such as a hand.
        eye, target: position of the camera, and the point in the middle of the picture, metres.
        see_through: things to draw transparent.
    """

    name: str
    about: str
    scene: Scene
    track: Track
    rigid: bool
    eye: Place
    target: Place
    see_through: tuple[str, ...] = ()


def build_scene(name: str, *, frames: int | None = None, seed: int = 0, dt: float = FRAME) -> InteractionScene:
    """Build a scene of `SCENES`.

    Args:
        name: of the scene.
        frames: number of frames; the script is cut, or repeated. By default the whole script once: at least 600.
        seed: of the tracked person's tremor.
        dt: seconds from frame to frame.

    Raises:
        UnknownNameError, InputError: there is no such scene; fewer than one frame.
    """
    known(name, _PLANS, "scene")
    plan = _PLANS[name]
    figure, track = plan.played(name, frames=frames, seed=seed, dt=dt)
    scene = gallery(figure)
    return InteractionScene(
        name, plan.about, scene, track, plan.figure == "hand", plan.eye, plan.target, plan.see_through
    )


def gallery(figure: Figure) -> Scene:
    """A scene with a figure in a gallery: a west room (x from -5 to 0), an east room (0 to 5), and a door between them.

    Walls, a door with a lintel, a niche in the east room, tables, a bench, pedestals, and sculptures on them: a torus,
    a sphere, an egg, an obelisk and a column. All of them are fixed.
    """
    scene = Scene(one_figure(figure, "gallery: figure"))
    scene.add(HalfSpace(), name="floor")
    _walls(scene)
    _furniture(scene)
    _sculptures(scene)
    return scene


def _walls(scene: Scene) -> None:
    t, h, middle = 0.15, HEIGHT, 0.5 * HEIGHT  # thickness
    outside = 2.0 * (LENGTH + t)
    scene.add(Box((t, 2.0 * HALF_WIDTH, h)), name="west wall", at=(-LENGTH - 0.5 * t, 0.0, middle), color=WALL)
    scene.add(Box((t, 2.0 * HALF_WIDTH, h)), name="east wall", at=(LENGTH + 0.5 * t, 0.0, middle), color=WALL)
    scene.add(Box((outside, t, h)), name="north wall", at=(0.0, HALF_WIDTH + 0.5 * t, middle), color=WALL)
    scene.add(Box((outside, t, h)), name="south wall", at=(0.0, -HALF_WIDTH - 0.5 * t, middle), color=WALL)
    side = HALF_WIDTH - 0.5 * DOOR_WIDTH
    for name, sign in (("wall left of the door", 1.0), ("wall right of the door", -1.0)):
        scene.add(Box((t, side, h)), name=name, at=(0.0, sign * (0.5 * DOOR_WIDTH + 0.5 * side), middle), color=WALL)
    lintel = h - DOOR_HEIGHT
    scene.add(Box((t, DOOR_WIDTH, lintel)), name="lintel", at=(0.0, 0.0, DOOR_HEIGHT + 0.5 * lintel), color=WALL)
    scene.add(Box((1.2, t, h)), name="niche", at=(LENGTH - 0.6, -0.9, middle), color=WALL)


def _furniture(scene: Scene) -> None:
    x, y, top = TABLE
    length, width, thick = TABLE_SIZE
    scene.add(Box(TABLE_SIZE), name="table", at=(x, y, top - 0.5 * thick), color=OAK)
    leg = top - thick
    for name, sign in (("table's west leg", -1.0), ("table's east leg", 1.0)):
        at = (x + sign * (0.5 * length - 0.1), y, 0.5 * leg)
        scene.add(Box((0.06, 0.8 * width, leg)), name=name, at=at, color=OAK)
    scene.add(Cylinder(0.45, 0.03), name="round table", at=(2.2, 1.4, 0.735), color=OAK)
    scene.add(Cylinder(0.06, 0.72), name="round table's foot", at=(2.2, 1.4, 0.36), color=OAK)
    scene.add(Box((1.4, 0.4, 0.45)), name="bench", at=(-2.5, -1.4, 0.225), color=OAK)


def _sculptures(scene: Scene) -> None:
    for name, x, y, height in (
        ("torus's pedestal", -0.9, 1.9, 0.9),
        ("sphere's pedestal", -4.3, -1.8, 1.0),
        ("egg's pedestal", 1.2, -1.8, 1.0),
    ):
        scene.add(Box((0.4, 0.4, height)), name=name, at=(x, y, 0.5 * height), color=STONE)
    upright = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    scene.add(Torus(0.28, 0.09), name="torus", at=(-0.9, 1.9, 0.9 + 0.37, *upright), color=BRONZE)
    scene.add(Sphere(0.2), name="sphere", at=(-4.3, -1.8, 1.2), color=BLUE)
    scene.add(Ellipsoid((0.14, 0.14, 0.24)), name="egg", at=(1.2, -1.8, 1.24), color=BLUE)
    obelisk = [(s * a, t * a, z) for a, z in ((0.2, 0.0), (0.12, 1.7)) for s in (-1, 1) for t in (-1, 1)]
    scene.add(Hull(np.array([*obelisk, (0.0, 0.0, 1.9)])), name="obelisk", at=(3.2, -1.8, 0.0), color=STONE)
    scene.add(Capsule(radius=0.12, length=1.2), name="column", at=(4.4, 1.9, 0.72), color=STONE)


# ---- the hand: position of the wrist, and the glove


def _hand(figure: Figure, at: Place, yaw: float, glove: str) -> Array:
    q = figure.posture(glove)
    turn = pin.utils.rotate("z", yaw) @ pin.Quaternion(q[3:7]).toRotationMatrix()
    q[:3], q[3:7] = at, pin.Quaternion(turn).coeffs()
    return q


def _hand_on_table(figure: Figure) -> Keys:
    x, y, top = TABLE
    high, deep = top + 0.20, top + 0.01  # the wrist, some 6 cm above the lowest finger

    def at(along: float, height: float, glove: str) -> Array:
        return _hand(figure, (x + along, y - 0.1, height), 0.3, glove)

    return [
        (0.0, at(-0.55, high, "relaxed")),
        (1.0, at(-0.55, high, "open")),
        (1.0, at(-0.50, deep, "relaxed")),
        (2.5, at(0.45, deep, "open")),
        (0.6, at(0.45, deep, "grip")),
        (0.8, at(0.45, high, "relaxed")),
        (0.8, at(0.40, deep, "relaxed")),
        (2.5, at(-0.55, deep, "pointing")),
        (0.8, at(-0.55, high, "relaxed")),
        (1.0, at(-0.55, high, "relaxed")),
    ]


def _hand_in_corner(figure: Figure) -> Keys:
    west, north = -LENGTH, HALF_WIDTH

    def at(dx: float, dy: float, z: float, yaw: float, glove: str = "relaxed") -> Array:
        return _hand(figure, (west + dx, north - dy, z), yaw, glove)

    facing, corner, along = math.pi, 0.75 * math.pi, 0.5 * math.pi
    return [
        (0.0, at(0.60, 1.2, 1.2, facing, "open")),
        (1.0, at(0.10, 1.2, 1.2, facing)),
        (2.5, at(0.05, 0.10, 1.3, corner)),
        (1.5, at(0.00, 0.00, 1.6, corner, "open")),
        (1.5, at(0.00, 0.00, 1.1, corner)),
        (2.0, at(1.00, 0.08, 1.2, along, "grip")),
        (1.0, at(1.00, 0.60, 1.2, along)),
        (1.0, at(0.60, 1.20, 1.2, facing, "open")),
    ]


# ---- the avatar: its position, and the motion of its limbs


_READY = {"shoulder_flexion": 35.0, "elbow_flexion": 60.0, "shoulder_abduction": 14.0}
_REACHING = {"shoulder_flexion": 85.0, "elbow_flexion": 12.0, "shoulder_abduction": 10.0, "wrist_flexion": -35.0}


def _two_arms(figure: Figure) -> Keys:
    wall = -LENGTH

    def at(distance: float, arms: Mapping[str, float], y: float = 0.2) -> Array:
        return standing_at(figure, wall + distance, y, math.pi, arms)

    high = {**_REACHING, "shoulder_flexion": 105.0, "neck1_rotation": 25.0}
    low = {**_REACHING, "shoulder_flexion": 60.0, "neck1_flexion": 20.0}
    return [
        (0.0, at(1.20, _READY)),
        (1.0, at(1.00, _REACHING)),
        (1.2, at(0.45, _REACHING)),
        (0.8, at(0.45, high, 0.35)),
        (0.8, at(1.00, _REACHING)),
        (0.8, at(0.50, low)),
        (0.8, at(0.50, high, 0.0)),
        (0.8, at(1.00, _REACHING)),
        (0.7, at(0.42, _REACHING, 0.1)),
        (1.5, at(0.42, _REACHING, 0.1)),
        (0.8, at(1.00, _REACHING)),
        (1.0, at(1.20, _READY)),
        (0.8, at(1.20, _READY)),
    ]


def _self_collision(figure: Figure) -> Keys:
    def at(degrees: Mapping[str, float]) -> Array:
        return standing_at(figure, -2.5, -0.3, math.pi, degrees)

    aside = {"shoulder_flexion": 40.0, "elbow_flexion": 85.0, "shoulder_abduction": 25.0}
    hand_in = {**aside, "right_shoulder_rotation": 65.0, "right_shoulder_flexion": 15.0, "right_elbow_flexion": 95.0}
    left_in = {**aside, "left_shoulder_rotation": 65.0, "left_shoulder_flexion": 10.0, "left_elbow_flexion": 100.0}
    fore = {"shoulder_flexion": 60.0, "elbow_flexion": 70.0, "shoulder_abduction": 10.0}
    crossed = {**fore, "shoulder_rotation": 50.0}
    chest = {"shoulder_flexion": 45.0, "elbow_flexion": 110.0, "shoulder_abduction": 5.0, "shoulder_rotation": 60.0}
    return [
        (0.0, at(aside)),
        (1.0, at(hand_in)),
        (0.8, at(hand_in)),
        (0.8, at(aside)),
        (1.0, at(left_in)),
        (0.8, at(aside)),
        (0.6, at(fore)),
        (1.0, at(crossed)),
        (0.6, at(crossed)),
        (0.8, at(fore)),
        (1.0, at(chest)),
        (0.6, at(chest)),
        (0.8, at(fore)),
        (0.8, at(aside)),
        (0.8, at(aside)),
    ]


def _two_arms_and_leg(figure: Figure) -> Keys:
    wall = -LENGTH

    def at(distance: float, degrees: Mapping[str, float], y: float = -0.3) -> Array:
        return standing_at(figure, wall + distance, y, math.pi, degrees)

    step = {**_REACHING, "right_hip_flexion": 75.0, "right_knee_flexion": 35.0}
    kick = {**_REACHING, "shoulder_flexion": 75.0, "right_hip_flexion": 60.0, "right_knee_flexion": 5.0}
    return [
        (0.0, at(1.30, _READY)),
        (1.0, at(1.15, step)),
        (1.2, at(0.50, step)),
        (1.0, at(0.50, kick)),
        (0.8, at(1.25, step)),
        (0.8, at(0.60, kick, -0.15)),
        (1.0, at(0.48, step)),
        (0.8, at(1.25, step)),
        (0.8, at(0.55, step, -0.4)),
        (1.2, at(0.55, kick, -0.4)),
        (0.8, at(1.30, step)),
        (1.0, at(1.30, _READY)),
        (0.8, at(1.30, _READY)),
    ]


def _arm_in_corner(figure: Figure) -> Keys:
    def at(x: float, y: float, flexion: float, abduction: float, elbow: float) -> Array:
        arm = {
            "right_shoulder_flexion": flexion, "right_shoulder_abduction": abduction, "right_elbow_flexion": elbow,
            "right_wrist_flexion": 10.0,
        }  # fmt: skip
        return standing_at(figure, LENGTH + x, y, 0.0, arm)

    return [
        (0.0, at(-1.20, -0.25, 30.0, 12.0, 50.0)),
        (1.0, at(-1.00, -0.30, 80.0, 15.0, 15.0)),
        (1.2, at(-0.50, -0.40, 80.0, 15.0, 15.0)),
        (1.2, at(-0.50, -0.50, 80.0, 35.0, 10.0)),
        (1.0, at(-0.45, -0.50, 105.0, 30.0, 10.0)),
        (1.0, at(-0.45, -0.50, 60.0, 30.0, 20.0)),
        (1.0, at(-1.00, -0.30, 80.0, 15.0, 15.0)),
        (1.0, at(-0.50, -0.50, 85.0, 40.0, 10.0)),
        (1.2, at(-0.42, -0.55, 70.0, 25.0, 30.0)),
        (1.0, at(-1.00, -0.30, 80.0, 15.0, 15.0)),
        (1.0, at(-1.20, -0.25, 30.0, 12.0, 50.0)),
        (0.8, at(-1.20, -0.25, 30.0, 12.0, 50.0)),
    ]


_PLANS: dict[str, ScenePlan] = {
    "hand_on_table": ScenePlan(
        "a hand is moved along a table to and fro, pressed into it, with moving fingers",
        "hand", _hand_on_table, (-2.75, 0.25, 1.25), (-2.5, 1.1, 0.76), ("table",),
    ),
    "hand_in_corner": ScenePlan(
        "a hand is pressed along one wall, into the corner with another, and along that one",
        "hand", _hand_in_corner, (-3.9, 1.1, 1.9), (-4.8, 2.2, 1.35), ("west wall", "north wall"),
    ),
    "two_arms": ScenePlan(
        "an avatar walks into a wall with both arms ahead, three times",
        "avatar", _two_arms, (-2.7, -2.2, 1.9), (-4.5, 0.2, 1.0), ("west wall",),
    ),
    "self_collision": ScenePlan(
        "an avatar's hands are moved through its torso, and its arms through each other",
        "avatar", _self_collision, (-5.0, -1.3, 1.9), (-2.6, -0.3, 1.1), ("west wall",),
    ),
    "two_arms_and_leg": ScenePlan(
        "an avatar steps into a wall with both arms and a leg ahead",
        "avatar", _two_arms_and_leg, (-2.4, -2.2, 1.8), (-4.5, -0.3, 0.95), ("west wall",),
    ),
    "arm_in_corner": ScenePlan(
        "an avatar stretches an arm into the corner of two walls",
        "avatar", _arm_in_corner, (2.9, 1.3, 2.1), (4.6, -0.5, 1.1), ("east wall", "niche"),
    ),
}  # fmt: skip

SCENES: Mapping[str, str] = {name: plan.about for name, plan in _PLANS.items()}
"""Descriptions of the scenes, by name."""
