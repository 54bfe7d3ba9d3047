"""The person's dimensions and ranges of motion beside those of people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from tests.measuring import measure
from wholebody.figures.population import population

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure


@dataclass(frozen=True)
class DimensionRow:
    """One dimension of one sex, metres.

    Attributes:
        name: of the dimension.
        sex: "male" or "female".
        percentiles: (3,) 5th, 50th and 95th of the people.
        residual: of the bodies of nine builds, 5th, 50th and 95th percentile of stature and of mass, the one that
            differs most from what is likely for the build.
    """

    name: str
    sex: str
    percentiles: tuple[float, ...]
    residual: float


@dataclass(frozen=True)
class RangeRow:
    """One motion, degrees.

    Attributes:
        motion: its name.
        model: how far the person moves, the other joints at zero.
        published: the source's value, both sexes unless the name says otherwise.
        source: of the published value.
    """

    motion: str
    model: float
    published: float
    source: str


PERCENTILES = (5, 50, 95)


def dimensions(sexes: Sequence[str], percentiles: Sequence[int] = PERCENTILES) -> list[DimensionRow]:
    """Measure the bodies of builds: all pairs of percentiles of stature and of mass."""
    from wholebody.figures import load

    rows = []
    for sex in sexes:
        people = population(sex)
        off: dict[str, float] = {}
        for stature, mass in product(percentiles, repeat=2):
            size = {"stature": people.quantile("stature", 0.01 * stature), "mass": people.quantile("mass", 0.01 * mass)}
            found, wanted = measure(load("human", sex=sex, **size)), people.likely(size)
            for name, value in found.items():
                off[name] = max(off.get(name, 0.0), value - wanted[name], key=abs)
        rows += [
            DimensionRow(name, sex, tuple(people.quantile(name, 0.01 * share) for share in PERCENTILES), far)
            for name, far in off.items()
        ]
    return rows


AAOS = "AAOS"
MOTIONS: tuple[tuple[str, tuple[str, ...], float, dict[str, float], float, str], ...] = (
    ("spine, flexion", ("spine_flexion",), 1.0, {}, 80.0, AAOS),
    ("spine, extension", ("spine_flexion",), -1.0, {}, 25.0, AAOS),
    ("spine, to the side", ("spine_lateral",), 1.0, {}, 35.0, AAOS),
    ("spine, rotation", ("spine_rotation",), 1.0, {}, 45.0, AAOS),
    ("neck, flexion", ("neck_flexion",), 1.0, {}, 50.0, AAOS),
    ("neck, extension", ("neck_flexion",), -1.0, {}, 60.0, AAOS),
    ("neck, to the side", ("neck_lateral",), 1.0, {}, 45.0, AAOS),
    ("neck, rotation", ("neck_rotation",), 1.0, {}, 80.0, AAOS),
    ("shoulder, flexion", ("left_shoulder_flexion",), 1.0, {}, 165.0, "Boone & Azen 1979"),
    ("shoulder, extension", ("left_shoulder_flexion",), -1.0, {}, 62.0, "Boone & Azen 1979"),
    (
        "shoulder, abduction, the arm turned outward",
        ("left_shoulder_abduction",),
        1.0,
        {"left_shoulder_rotation": -60.0},
        183.0,
        "Boone & Azen 1979",
    ),
    ("elbow, flexion", ("left_elbow_flexion",), 1.0, {}, 150.0, AAOS),
    ("forearm, pronation", ("left_elbow_pronation",), 1.0, {}, 80.0, AAOS),
    ("forearm, supination", ("left_elbow_pronation",), -1.0, {}, 80.0, AAOS),
    ("wrist, flexion", ("left_wrist_flexion",), 1.0, {}, 80.0, AAOS),
    ("wrist, extension", ("left_wrist_flexion",), -1.0, {}, 70.0, AAOS),
    ("hip, flexion with the knee at 120", ("left_hip_flexion",), 1.0, {"left_knee_flexion": 120.0}, 120.0, AAOS),
    ("hip, straight-leg raise of men", ("left_hip_flexion",), 1.0, {}, 62.0, "Gajdosik et al. 1993"),
    ("hip, extension", ("left_hip_flexion",), -1.0, {}, 19.0, "Roach & Miles 1991, recalled"),
    ("hip, abduction", ("left_hip_abduction",), 1.0, {}, 45.0, AAOS),
    ("knee, flexion with the hip at 90", ("left_knee_flexion",), 1.0, {"left_hip_flexion": 90.0}, 135.0, AAOS),
    ("ankle, dorsiflexion with a straight knee", ("left_ankle_dorsiflexion",), 1.0, {}, 25.0, "Baumbach et al. 2014"),
    ("ankle, plantar flexion", ("left_ankle_dorsiflexion",), -1.0, {}, 50.0, AAOS),
)
"""Motion, joints, direction, other joints in degrees, published degrees, source."""


def ranges(figure: Figure) -> list[RangeRow]:
    """How far each motion goes: to the joints' own limits, or to the first range of motion of several joints."""
    import wholebody as wb
    from wholebody.figures.state import State

    scene = wb.Scene(figure)
    kept = wb.tasks.RangeOfMotion().resolve(scene, figure.posture("standing"))
    state = State(figure.model)
    rows = []
    for motion, names, sign, others, published, source in MOTIONS:
        joints = [joint for name in names for joint in _joints(figure, name)]
        ends = {joint: _limit(figure, joint, sign) for joint in joints}
        held = {joint: float(np.radians(value)) for joint, value in others.items()}
        near, far = 0.0, 1.0
        for step in range(20):
            share = 1.0 if step == 0 else 0.5 * (near + far)
            q = figure.with_joints(pin.neutral(figure.model), held | {j: share * end for j, end in ends.items()})
            if (kept.value(state.update(q)) >= -1e-9).all():
                near = share
                if step == 0:
                    break
            else:
                far = share
        rows.append(RangeRow(motion, float(np.degrees(near * abs(sum(ends.values())))), published, source))
    return rows


def _joints(figure: Figure, name: str) -> list[str]:
    """The joint, or all levels of the spine or the neck, as in "spine_flexion"."""
    if name in figure.joints:
        return [name]
    part, _, motion = name.partition("_")
    return [joint for joint in figure.joints if joint.startswith(part) and joint.endswith(f"_{motion}")]


def _limit(figure: Figure, joint: str, sign: float) -> float:
    place = int(figure.model.joints[figure.joint_id(joint)].idx_q)
    limits = figure.model.upperPositionLimit if sign > 0.0 else figure.model.lowerPositionLimit
    return float(limits[place])
