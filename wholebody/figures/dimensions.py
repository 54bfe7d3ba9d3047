"""Sizes of a body that its pieces and landmarks share, in metres."""

from __future__ import annotations

import math
from typing import NamedTuple

from wholebody.figures.anthropometry import Person
from wholebody.figures.sizes import THUMB_TIP
from wholebody.figures.tables import keyed

RELAXED = 0.93
"""The arm's circumferences were measured flexed; relaxed they are 5 to 8 % less (estimate)."""


class Finger(NamedTuple):
    """A straight finger in the hand's frame: `x` towards the thumb, `tip` from the wrist to the end, `radius`."""

    x: float
    knuckle: float
    tip: float
    radius: float


class Dimensions:
    """Sizes of one `Person`."""

    def __init__(self, person: Person) -> None:
        """Compute the sizes of a person."""
        self.body = person
        self.stature = height = person.stature
        toe = self.joint("left_toe_extension")
        self.toe_joint_x = toe[0]
        self.toe_half_height = person.segment("left_toes", "radius_b") * height
        self.toe_length = person.segment("left_toes", "length") * height
        self.sole = toe[2] - self.toe_half_height
        self.heel_x = toe[0] + self.toe_length - person.size("foot_length")
        self.foot_half_width = 0.5 * person.size("foot_breadth")
        self.hip_height = -self.sole + person.length("left_thigh") + person.length("left_shank")

        self.hand_length = person.length("left_hand")
        self.hand_breadth = person.size("hand_breadth")
        self.palm_length = {"M": 0.603, "F": 0.600}[person.column] * self.hand_length  # ANSUR II
        self.palm_half_thickness = keyed_hand("palm", "depth") * self.hand_breadth
        lateral, distal = FINGER_BASES["index"]
        length = sum(keyed_hand(f"index_{part}", "length") for part in ("pp", "mp", "dp"))
        self.index = Finger(
            lateral * self.hand_breadth,
            distal * self.hand_length,
            (distal + length) * self.hand_length,
            keyed_hand("index_mp", "width") * self.hand_breadth,
        )
        self.thumb = Finger(
            0.58 * self.hand_breadth,
            0.22 * self.hand_length,
            THUMB_TIP * self.hand_length,
            keyed_hand("thumb_dp", "width") * self.hand_breadth,
        )
        # Centre of a rod in the hand, in hand lengths from the wrist: what forearm-hand length leaves of forearm to
        # centre of grip in ANSUR II (481 and 355 mm in 28 men).
        self.grip = 0.31 * self.hand_length

        upward = ("spine1", "spine2", "spine3", "spine4", "neck1", "neck2")
        above = sum(self.joint(f"{name}_flexion")[2] for name in upward)
        self.head_top = height - self.hip_height - above
        self.head_half_breadth = 0.5 * person.size("head_breadth")
        self.head_half_length = 0.5 * person.size("head_length")
        # Fraction of stature (Drillis & Contini, in Winter 2009).
        self.head_bottom = self.head_top - (1.0 - 0.870) * height
        self.head_x = person.center_of_mass("head")[0]
        self.eye_z = self.head_top - person.size("eye")
        # The skull is a capsule from front to back; its front at the height of the eyes.
        below = self.head_top - self.head_half_breadth - self.eye_z
        front = self.head_half_length - self.head_half_breadth
        self.eye_x = self.head_x + front + math.sqrt(max(self.head_half_breadth**2 - below**2, 0.0))

    def joint(self, name: str) -> tuple[float, float, float]:
        """Position of a joint in its parent segment's frame."""
        return self.body.origin(name)


FINGER_BASES = {
    "thumb": (0.27, 0.13),
    "index": (0.207, 0.450),
    "middle": (0.008, 0.447),
    "ring": (-0.158, 0.440),
    "little": (-0.267, 0.396),
}
"""Knuckles, and the root of the thumb: in hand breadths to the thumb's side, in hand lengths from the wrist.
They are MyoHand's, as in the table "hand"."""

_HAND_COLUMNS = {
    "length": "length_frac_of_hand_length",
    "width": "semi_axis_width_frac_of_hand_breadth",
    "depth": "semi_axis_depth_frac_of_hand_breadth",
}


def keyed_hand(part: str, quantity: str) -> float:
    """Return "length" (in hand lengths), "width" or "depth" (semi-axes, in hand breadths) of one part of the hand."""
    return float(keyed("hand", "name")[part][_HAND_COLUMNS[quantity]])
