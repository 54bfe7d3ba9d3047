"""The person's dimensions, circumferences and ranges of motion beside those of people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from wholebody.base.arrays import Array
from wholebody.figures.anthropometry import Person, design_cases
from wholebody.figures.human.spec import human_spec
from wholebody.figures.measuring import ansur, measure
from wholebody.figures.surface.fields import Field, union
from wholebody.figures.surface.profile import piece_field

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure


@dataclass(frozen=True)
class DimensionRow:
    """One dimension of one design case, metres."""

    name: str
    case: str
    model: float
    ansur: float

    @property
    def residual(self) -> float:
        """Model less ANSUR, metres."""
        return self.model - self.ansur


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


def dimensions(cases: Sequence[str]) -> list[DimensionRow]:
    """Measure the fifteen dimensions of design cases, such as "M50"."""
    from wholebody.figures import load

    rows = []
    for case in cases:
        person = design_cases()[case]
        figure = load("human", sex=person.sex, stature=person.stature, mass=person.mass)
        people = ansur(person.sex, int(case[1:]))
        rows += [DimensionRow(name, case, value, people[name]) for name, value in measure(figure).items()]
    return rows


GIRTHS = {
    "neck": ("neck", "neck", "least"),
    "upper arm, flexed": ("left_upper_arm", "upper_arm", "most"),
    "forearm, flexed": ("left_forearm", "forearm", "most"),
    "wrist": ("left_forearm", "wrist", "least"),
    "thigh": ("left_thigh", "thigh", "most"),
    "lower thigh": ("left_thigh", "thigh_low", "least"),
    "calf": ("left_shank", "calf", "most"),
    "ankle": ("left_shank", "ankle", "least"),
}
"""Circumference to segment, row of ANSUR's radii, and whether it is the segment's greatest or least."""

AROUND = np.linspace(0.0, 2.0 * np.pi, 73)[:-1]


def circumferences(cases: Sequence[str]) -> list[DimensionRow]:
    """Measure circumferences as a tape does, around the pieces; ANSUR's are its fit at the case's stature and mass."""
    rows = []
    for case in cases:
        person = design_cases()[case]
        for name, (segment, part, which) in GIRTHS.items():
            girths = _girths(person, segment)
            model = max(girths) if which == "most" else min(girths)
            rows.append(DimensionRow(name, case, model, 2.0 * np.pi * person.radius(part)))
    return rows


def _girths(person: Person, segment: str) -> list[float]:
    """Circumferences of a segment's pieces, metres, at levels along its pieces."""
    solids = [solid for solid in human_spec(person).solids if solid.segment == segment]
    whole = union([piece_field(solid) for solid in solids])
    ends = [
        float(solid.placement.act(np.array([0.0, 0.0, s * float(solid.geometry.halfLength)]))[2])
        for solid in solids
        for s in (-1.0, 1.0)
    ]
    low, high = min(ends), max(ends)
    levels = np.linspace(low + 0.05 * (high - low), high - 0.05 * (high - low), 25)
    middle = np.mean([solid.placement.translation[:2] for solid in solids], axis=0)
    return [_girth(whole, middle, float(level)) for level in levels]


def _girth(field: Field, middle: Array, level: float) -> float:
    """Perimeter of the hull of a level section."""
    ways = np.column_stack([np.cos(AROUND), np.sin(AROUND)])
    near, far = np.zeros(len(ways)), np.full(len(ways), 0.3)
    for _ in range(24):
        half = 0.5 * (near + far)
        inside = field(np.column_stack([middle + half[:, None] * ways, np.full(len(ways), level)])) < 0.0
        near, far = np.where(inside, half, near), np.where(inside, far, half)
    hull = ConvexHull(middle + near[:, None] * ways)
    return float(hull.area)  # of a plane set it is the perimeter


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
    kept = wb.RangeOfMotion().resolve(scene, figure.posture("standing"))
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
