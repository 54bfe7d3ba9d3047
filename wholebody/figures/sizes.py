"""The sizes of the body, joint centres and thicknesses, that give it its dimensions.

The model is upright in all measurements, with right angles at hips, knees and elbows, so each dimension is a sum of
sizes. Those of the legs follow one from the other. The arms have eight sizes and seven dimensions, which contradict
each other by 10 to 35 mm in one person, because people stand, stretch and slump between measurements: of these the most
likely sizes are taken, by least squares in units of the standard deviations of the table "arm_sizes".
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np

from wholebody.figures.tables import keyed

MIDDLE_TIP = 0.991
"""End of the stretched middle finger, in hand lengths from the wrist: the sum of its parts in the table "hand"."""

THUMB_TIP = 0.675
"""End of the thumb, which lies beside the index finger, in hand lengths from the wrist: 0.26 behind that finger's
(estimate)."""

STRETCH = (5.0, 85.0)
"""Degrees by which the clavicle can rise, in the least and the most mobile people. An overhead reach says it."""


class TrunkPart(NamedTuple):
    """A slice of the trunk."""

    segment: str  # that carries it
    # depth and breadth: names of its dimensions
    depth: str
    breadth: str
    share: float  # of the depth that it has
    # (2,) its rear behind the joints of the spine: share of its depth, and of the stature. Who is heavy has most of the
    # depth in front (estimate).
    behind: tuple[float, float]

    def back(self, of: Mapping[str, float]) -> float:
        """Distance of the rear behind the joints of the spine, metres."""
        return self.behind[0] * of[self.depth] + self.behind[1] * of["stature"]


TRUNK = (
    TrunkPart("lower_lumbar", "waist_depth", "waist_breadth", 1.0, (0.3, 0.017)),
    TrunkPart("upper_lumbar", "waist_depth", "waist_breadth", 0.98, (0.3, 0.022)),
    TrunkPart("lower_thorax", "chest_depth", "chest_breadth", 1.0, (0.35, 0.008)),
    TrunkPart("thorax", "chest_depth", "chest_breadth", 0.8, (0.28, 0.006)),
)
"""From the pelvis upwards; the place of the last is the thorax."""


class Skeleton(NamedTuple):
    """What the sizes of the arms depend on, metres."""

    hip_height: float  # of the hip joint above the sole
    girdle: tuple[float, float, float]  # (3,) the clavicle's inner end, from the hip joints' middle
    back: float  # the rearmost point of the trunk behind the hip joint


def leg_sizes(of: Mapping[str, float], ankle: float) -> dict[str, float]:
    """Return the sizes of legs and pelvis for dimensions, metres; `ankle` is the height of the ankle joint."""
    # Behind its centre the knee ends as far as before it.
    high = of["knee_height_sitting"] - of["popliteal_height"]
    knee = min(0.5 * (of["buttock_knee_length"] - of["buttock_popliteal_length"]), 0.6 * high)
    thigh = of["stature"] - of["sitting_height"] - of["popliteal_height"]
    seat = high - knee
    return {
        "thigh": thigh,
        "shank": of["popliteal_height"] + seat - ankle,
        "seat": seat,
        "thigh_top": of["thigh_clearance"] - seat,
        "knee": knee,
        "buttock": of["buttock_knee_length"] - thigh - knee,
        "eye": of["sitting_height"] - of["eye_height_sitting"],
    }


ARM = ("shoulder_top", "upper_arm", "forearm", "elbow_back", "elbow_below", "shoulder_y", "shoulder_x", "rise")
"""Unknowns: acromion above the shoulder joint, lengths between joints, skin behind and below the elbow joint, shoulder
joint beside the middle and before the clavicle's inner end, and by how much it can rise."""


def arm_sizes(
    sex: str, of: Mapping[str, float], stated: Collection[str], frame: Skeleton
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the sizes of the arms on a frame, and the dimensions that follow, metres; stated ones are met first."""
    rows = keyed("arm_sizes")
    usual = np.array([float(rows[name][sex]) for name in ARM]) * of["stature"]
    spread = np.array([float(rows[name]["spread"]) for name in ARM])
    hand, shoulder = of["hand_length"], of["acromial_height"]  # the acromion is where it was measured
    sitting = shoulder - of["stature"] + of["sitting_height"]
    # Sums of sizes, in the order of `ARM`, that are these dimensions less what is known.
    sums = {
        "wrist_height": ((-1, -1, -1, 0, 0, 0, 0, 0), shoulder),
        "forearm_hand_length": ((0, 0, 1, 1, 0, 0, 0, 0), MIDDLE_TIP * hand),
        "elbow_rest_height": ((-1, -1, 0, 0, -1, 0, 0, 0), sitting),
        "span": ((0, 2, 2, 0, 0, 2, 0, 0), 2.0 * MIDDLE_TIP * hand),
        "thumb_tip_reach": ((0, 1, 1, 0, 0, 0, 1, 0), frame.back + frame.girdle[0] + THUMB_TIP * hand),
        "overhead_reach_sitting": ((-1, 1, 1, 0, 0, 0, 0, 1), sitting + MIDDLE_TIP * hand),
    }
    names, terms = list(sums), np.array([row for row, _ in sums.values()], dtype=float)
    known = np.array([constant for _, constant in sums.values()])
    wanted = np.array([of[name] for name in names]) - known
    # m: standard deviations of an overhead reach and of others that follow, and of those that were stated
    free = {"overhead_reach_sitting": 0.010}
    unit = np.array([0.0001 if name in stated else free.get(name, 0.003) for name in names])
    left = np.concatenate([wanted / unit, usual / spread])
    rows_of = np.vstack([terms / unit[:, None], np.diag(1.0 / spread)])
    found = np.linalg.lstsq(rows_of, left, rcond=None)[0]
    for _ in range(6):
        angle = _elevation(found, shoulder, frame)
        if STRETCH[0] <= angle <= STRETCH[1] + 1e-6:
            break
        # The clavicle ends: what is above that is sought in the other sizes.
        angle = min(max(angle, STRETCH[0]), STRETCH[1])
        fixed = _rise(found, shoulder, frame, angle)
        rest = np.delete(rows_of, len(ARM) - 1, axis=1)
        found = np.append(np.linalg.lstsq(rest, left - fixed * rows_of[:, -1], rcond=None)[0], fixed)
        found[-1] = _rise(found, shoulder, frame, angle)
    sizes = dict(zip(ARM, map(float, found), strict=True))
    sizes["shoulder_z"] = shoulder - sizes["shoulder_top"] - frame.hip_height - frame.girdle[2]
    sizes["deltoid"] = 0.5 * of["bideltoid_breadth"] - sizes["shoulder_y"]
    sizes["elevation"] = _elevation(found, shoulder, frame)
    return sizes, dict(zip(names, map(float, terms @ found + known), strict=True))


def _lever(found: np.ndarray, shoulder: float, frame: Skeleton) -> tuple[float, float]:
    """Length of the clavicle seen from the front, and its angle over the horizontal at rest, radians."""
    beside = found[ARM.index("shoulder_y")] - frame.girdle[1]
    above = shoulder - found[ARM.index("shoulder_top")] - frame.hip_height - frame.girdle[2]
    return math.hypot(beside, above), math.atan2(above, beside)


def _elevation(found: np.ndarray, shoulder: float, frame: Skeleton) -> float:
    """Degrees of elevation by which the shoulder joint rises by "rise"."""
    length, rest = _lever(found, shoulder, frame)
    return math.degrees(math.asin(min(max(found[-1] / length + math.sin(rest), -1.0), 1.0)) - rest)


def _rise(found: np.ndarray, shoulder: float, frame: Skeleton, degrees: float) -> float:
    """Metres by which the shoulder joint rises with the clavicle."""
    length, rest = _lever(found, shoulder, frame)
    return length * (math.sin(rest + math.radians(degrees)) - math.sin(rest))
