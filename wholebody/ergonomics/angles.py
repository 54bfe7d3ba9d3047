"""Angles of the body for observation methods, from the placements of segments and joint centres.

Directions of segments are compared, as the joint coordinate systems of the International Society of Biomechanics do
(Wu et al. 2002, 2005), not values of single joints: they mean the same for figures whose joints have other axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, brief
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.loading import one_figure

SIDES = ("left", "right")
NAMES = {"pelvis", "thorax", "neck", "head"}.union(
    f"{side}_{part}"
    for side in SIDES
    for part in ("upper_arm", "forearm", "hand", "shoulder", "elbow", "wrist", "palm", "hip", "knee", "ankle")
)
"""Segments and frames of a person."""


@dataclass(frozen=True)
class SideAngles:
    """Angles of one side of the body, radians."""

    # of the upper arm against the trunk in the sagittal plane: 0 hangs or points straight out sideways, forward is
    # positive, -90 degrees points backward, and whatever points higher is more than 90 degrees, up to 270
    shoulder_flexion: float
    shoulder_abduction: float  # of the upper arm out of the sagittal plane; outward is positive
    shoulder_rise: float  # height of the shoulder's centre above that of the upright body, in the thorax's axes, metres
    elbow_flexion: float  # between upper arm and forearm; 0 is straight
    forearm_outward: float  # of the forearm out of the sagittal plane; outward is positive
    across: bool  # whether the wrist is beyond the middle plane of the trunk
    wrist_flexion: float  # of the hand against the forearm; towards the palm is positive
    wrist_deviation: float  # likewise, towards the thumb
    # of the forearm about its axis against the upper arm; 0 as if to shake hands, inward is positive
    forearm_twist: float
    knee_flexion: float  # between thigh and shank; 0 is straight
    arm_raised: bool  # whether elbow or wrist is at the height of the shoulder or above
    # of the thigh against the vertical; half a right angle and more is horizontal rather than upright
    thigh_slope: float
    foot_height: float  # of the ankle above the lower ankle, metres
    knee_height: float  # of the knee above the lower ankle, metres


@dataclass(frozen=True)
class BodyAngles:
    """Angles of a body, radians.

    Attributes:
        left, right: of the sides.
        trunk_flexion: of the line from the hips to the neck against the vertical; forward is positive.
        trunk_lateral: likewise to the left.
        trunk_twist: of the thorax against the pelvis about its axis.
        neck_flexion: of the head against the thorax; forward is positive.
        neck_lateral: likewise to the left.
        neck_twist: likewise about the axis.
        left_share: share of the weight on the left foot, 0 to 1, from the centre of mass between the ankles.
        center_ahead: of the centre of mass before the middle of the ankles, metres.

    Examples:
        >>> angles = wb.ergonomics.body_angles(human, standing)
        >>> abs(angles.trunk_flexion) < 0.1
        True
    """

    left: SideAngles
    right: SideAngles
    trunk_flexion: float
    trunk_lateral: float
    trunk_twist: float
    neck_flexion: float
    neck_lateral: float
    neck_twist: float
    left_share: float
    center_ahead: float

    __repr__ = brief

    def side(self, name: str) -> SideAngles:
        """The angles of "left" or "right"."""
        return self.left if checks.choice(name, SIDES, "side") == "left" else self.right


def body_angles(figure: Figure, q: Array) -> BodyAngles:
    """Angles of a person in a posture.

    Args:
        figure: a person: its frames and segments have the names of `wb.load("human")`.
        q: (nq,) posture.

    Raises:
        InputError: a figure without these names, or q has the wrong shape or is not finite.

    Examples:
        >>> wb.ergonomics.body_angles(human, standing).left.elbow_flexion < 0.3
        True
    """
    check_person(figure, "body_angles: figure")
    q = checks.posture(q, figure.model.nq, "body_angles: q")
    figure.warn_of_angles(q, "body_angles: q")
    now = _Body(figure, q)
    upright = _Body(figure, pin.neutral(figure.model))
    line, line_upright = now.trunk(), upright.trunk()
    feet = [now.at[f"{side}_ankle"] for side in SIDES]
    lowest = min(feet[0][2], feet[1][2])
    neck = now.turn("thorax", "head")
    return BodyAngles(
        left=_side(now, upright, "left", lowest),
        right=_side(now, upright, "right", lowest),
        trunk_flexion=float(np.arctan2(line[0], line[2]) - np.arctan2(line_upright[0], line_upright[2])),
        trunk_lateral=float(np.arctan2(line[1], np.hypot(line[0], line[2]))),
        trunk_twist=_twist(now.turn("pelvis", "thorax")),
        neck_flexion=float(np.arctan2(neck[0, 2], neck[2, 2])),
        neck_lateral=float(np.arctan2(neck[1, 2], np.hypot(neck[0, 2], neck[2, 2]))),
        neck_twist=_twist(neck),
        left_share=_share(now.center, *feet),
        center_ahead=float((now.center - 0.5 * (feet[0] + feet[1])) @ now.heading()[0]),
    )


def check_person(figure: object, what: str) -> Figure:
    """A figure with the names of a person."""
    person = one_figure(figure, what)
    lacking = sorted(NAMES - {*person.segments, *person.frames})
    if lacking:
        raise InputError(f"{what}: {person.name} has no {checks.some(lacking)}; take a person, the figure 'human'")
    return person


class _Body:
    def __init__(self, figure: Figure, q: Array) -> None:
        model, data = figure.model, figure.model.createData()
        pin.framesForwardKinematics(model, data, q)
        placed = {name: data.oMf[figure.frame_id(name)] for name in NAMES}
        self.at = {name: np.array(place.translation) for name, place in placed.items()}
        self.axes = {name: np.array(place.rotation) for name, place in placed.items()}
        self.center = np.array(pin.centerOfMass(model, data, q))

    def turn(self, base: str, name: str) -> Array:
        """Rotation (3, 3) of a segment in the axes of another."""
        return np.asarray(self.axes[base].T @ self.axes[name])

    def trunk(self) -> Array:
        """The line from the middle of the hips to the neck (3,): forward, left and up, by the heading of the pelvis."""
        line = self.at["neck"] - 0.5 * (self.at["left_hip"] + self.at["right_hip"])
        forward, left = self.heading()
        return np.array((line @ forward, line @ left, line[2]))

    def heading(self) -> tuple[Array, Array]:
        """Horizontal directions (3,) forward and left of the pelvis."""
        left = self.axes["pelvis"][:, 1].copy()
        left[2] = 0.0
        # horizontal part of a direction below which it points up or down
        if np.linalg.norm(left) < 0.1:  # lying on a side
            left = np.cross((0.0, 0.0, 1.0), self.axes["pelvis"][:, 0])
        left /= np.linalg.norm(left)
        return np.cross(left, (0.0, 0.0, 1.0)), left


def _side(now: _Body, upright: _Body, side: str, lowest: float) -> SideAngles:
    out = 1.0 if side == "left" else -1.0
    thorax = now.axes["thorax"]
    shoulder, elbow, wrist, hip, knee, ankle = (
        now.at[f"{side}_{name}"] for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
    )
    upper = thorax.T @ _unit(elbow - shoulder)
    lower = thorax.T @ _unit(wrist - elbow)
    rise = [body.axes["thorax"].T @ (body.at[f"{side}_shoulder"] - body.at["thorax"]) for body in (now, upright)]
    hand = -now.turn(f"{side}_forearm", f"{side}_hand")[:, 2]  # the long axis of a hanging hand points down
    thigh, shank = _unit(knee - hip), _unit(ankle - knee)
    flexion = float(np.arctan2(upper[0], -upper[2]))
    # length in the sagittal plane below which an arm has no flexion, unless it points up by more than 5 degrees
    sideways = np.hypot(upper[0], upper[2]) <= 0.2 and upper[2] <= 0.087
    return SideAngles(
        shoulder_flexion=0.0 if sideways else flexion + (2.0 * np.pi if flexion < -0.5 * np.pi else 0.0),
        shoulder_abduction=float(np.arcsin(np.clip(out * upper[1], -1.0, 1.0))),
        shoulder_rise=float(rise[0][2] - rise[1][2]),
        elbow_flexion=_between(upper, lower),
        forearm_outward=float(np.arcsin(np.clip(out * lower[1], -1.0, 1.0))),
        across=bool(out * (thorax.T @ (wrist - now.at["thorax"]))[1] < 0.0),
        wrist_flexion=float(np.arctan2(-out * hand[1], -hand[2])),
        wrist_deviation=float(np.arctan2(hand[0], np.hypot(hand[1], hand[2]))),
        forearm_twist=-out * _twist(now.turn(f"{side}_upper_arm", f"{side}_forearm")),
        knee_flexion=_between(thigh, shank),
        arm_raised=bool(max(elbow[2], wrist[2]) >= shoulder[2]),
        thigh_slope=_between(thigh, np.array((0.0, 0.0, -1.0))),
        foot_height=float(ankle[2] - lowest),
        knee_height=float(knee[2] - lowest),
    )


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _between(one: Array, other: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))


def _twist(turn: Array) -> float:
    """Angle of a rotation about z, after the rotation that takes z where it goes (swing and twist)."""
    _, _, z, w = pin.Quaternion(turn).coeffs()
    half = np.arctan2(z, w)
    return float(2.0 * (half - np.pi * np.round(half / np.pi)))


def _share(center: Array, left: Array, right: Array) -> float:
    line = (left - right)[:2]
    length = float(line @ line)
    return float(np.clip((center - right)[:2] @ line / length, 0.0, 1.0)) if length > 1e-6 else 0.5
