"""Scenes for the frame loop, in which the tracked posture penetrates walls, tables and the figure itself.

After the experiments of Schmidl and Lin, "Real-time physically-based interaction between avatars and virtual
environments" (table 2, figures 2, 5, 7 and 8), without their balls.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import known
from wholebody.figures.figure import Figure
from wholebody.scene.scene import Scene
from wholebody.tracking import rooms
from wholebody.tracking.frame import FRAME
from wholebody.tracking.scripts import Keys, Place, ScenePlan, standing_at
from wholebody.tracking.tracks import Track


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
    scene = rooms.gallery(figure)
    return InteractionScene(
        name, plan.about, scene, track, plan.figure == "hand", plan.eye, plan.target, plan.see_through
    )


# ---- the hand: position of the wrist, and the glove


def _hand(figure: Figure, at: Place, yaw: float, glove: str) -> Array:
    q = figure.posture(glove)
    turn = pin.utils.rotate("z", yaw) @ pin.Quaternion(q[3:7]).toRotationMatrix()
    q[:3], q[3:7] = at, pin.Quaternion(turn).coeffs()
    return q


def _hand_on_table(figure: Figure) -> Keys:
    x, y, top = rooms.TABLE
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
    west, north = -rooms.LENGTH, rooms.HALF_WIDTH

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
    wall = -rooms.LENGTH

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
    wall = -rooms.LENGTH

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
        return standing_at(figure, rooms.LENGTH + x, y, 0.0, arm)

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
