"""Joint strength of people: the largest torques that muscles exert, by joint, direction, sex and percentile."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure

PERCENTILES = (5.0, 50.0, 95.0)

MALE = {
    "elbow flexion": (42, 77, 111),
    "elbow extension": (31, 46, 67),
    "shoulder flexion": (44, 92, 119),
    "shoulder extension": (43, 67, 103),
    "shoulder abduction": (43, 71, 101),
    "shoulder adduction": (35, 67, 115),
    "shoulder medial rotation": (28, 52, 83),
    "shoulder lateral rotation": (23, 33, 51),
    "ankle plantarflexion": (69, 126, 237),
    "knee extension": (84, 168, 318),
    "knee flexion": (58, 100, 157),
    "hip extension": (94, 190, 309),
    "hip flexion": (113, 185, 342),
    "torso extension": (164, 234, 503),
    "torso flexion": (89, 143, 216),
    "torso lateral bending": (95, 159, 261),
}
"""Static strength of 25 men, N m, at the percentiles 5, 50 and 95: T. J. Stobbe (1982), "The development of a practical
strength testing program for industry", University of Michigan; as D. B. Chaffin, G. B. J. Andersson and B. J. Martin,
"Occupational biomechanics", tabulate it. Six medians were compared with a second publication of them, the rest was not.
Shoulder flexion and extension are its horizontal ones."""

FEMALE = {
    "elbow flexion": (16, 41, 55),
    "elbow extension": (9, 27, 39),
    "shoulder flexion": (12, 40, 60),
    "shoulder extension": (19, 33, 57),
    "shoulder abduction": (15, 37, 57),
    "shoulder adduction": (13, 30, 54),
    "shoulder medial rotation": (9, 21, 33),
    "shoulder lateral rotation": (13, 19, 28),
    "ankle plantarflexion": (31, 81, 130),
    "knee extension": (52, 106, 219),
    "knee flexion": (22, 62, 104),
    "hip extension": (38, 97, 180),
    "hip flexion": (57, 126, 177),
    "torso extension": (71, 184, 287),
    "torso flexion": (49, 75, 161),
    "torso lateral bending": (50, 94, 162),
}
"""As `MALE`, of 22 women."""

LARGEST_EFFORT = 1e9
"""N m, N: an effort limit beyond it stands for none."""

SEXES = {"male": MALE, "female": FEMALE}

DIRECTIONS: Mapping[str, tuple[str | None, str | None]] = {
    "elbow_flexion": ("elbow extension", "elbow flexion"),
    "shoulder_flexion": ("shoulder extension", "shoulder flexion"),
    "shoulder_abduction": ("shoulder adduction", "shoulder abduction"),
    "shoulder_rotation": ("shoulder lateral rotation", "shoulder medial rotation"),
    "ankle_dorsiflexion": ("ankle plantarflexion", None),
    "knee_flexion": ("knee extension", "knee flexion"),
    "hip_flexion": ("hip extension", "hip flexion"),
    "spine_flexion": ("torso extension", "torso flexion"),
    "spine_lateral": ("torso lateral bending", "torso lateral bending"),
}
"""End of a joint's name, without its side and number -> strengths towards negative and positive angles."""


@dataclass(frozen=True)
class Strength:
    """Strength of a person, from measurements of static strength.

    Joints without a published value (clavicles, neck, wrists, toes, rotation of the hip, ...) have no limit. Strength
    between the tabulated percentiles is interpolated as if its logarithm were normally distributed.

    Attributes:
        percentile: share of people of this sex who are weaker, 5 to 95.
        sex: "male" or "female".

    Raises:
        InputError: a percentile beyond what was measured.
        UnknownNameError: another sex.
    """

    percentile: float = 50.0
    sex: str = "male"

    def __post_init__(self) -> None:
        """Check the values."""
        checks.settle(
            self, "percentile", checks.number(self.percentile, "Strength: percentile", PERCENTILES[0], PERCENTILES[-1])
        )
        checks.known(self.sex, SEXES, "sex", "Strength")

    def limits(self, figure: Figure) -> tuple[Array, Array]:
        """Least and largest torques (nv,) of a figure's joints, N m; infinite where none is published.

        The free root, if any, has infinite ones: the ground moves it, not a muscle.

        Raises:
            InputError: something else than a figure.
        """
        checks.instance(figure, Figure, "Strength.limits: figure", "load one with wb.load('human')")
        lower = np.full(figure.model.nv, -np.inf)
        upper = np.full(figure.model.nv, np.inf)
        for name in figure.joints:
            sides = DIRECTIONS.get(_kind(name), (None, None))
            joint = figure.model.joints[figure.joint_id(name)]
            if joint.nv == 1:
                lower[joint.idx_v] = -self._torque(sides[0])
                upper[joint.idx_v] = self._torque(sides[1])
        return lower, upper

    def _torque(self, name: str | None) -> float:
        if name is None:
            return np.inf
        from scipy.special import ndtri

        logs = np.log(SEXES[self.sex][name])
        return float(np.exp(np.interp(ndtri(self.percentile / 100.0), ndtri(np.array(PERCENTILES) / 100.0), logs)))


def torque_limits(figure: Figure, strength: Strength) -> tuple[Array, Array]:
    """Least and largest torques (nv,) of a figure's joints, N m; infinite where none is known.

    Those of a person are published strength; those of a figure whose joints have none are the effort limits of its
    description.
    """
    lower, upper = strength.limits(figure)
    if np.isfinite(lower).any() or np.isfinite(upper).any():
        return lower, upper
    effort = np.array(figure.model.effortLimit, dtype=float).reshape(-1)
    known = (effort > 0.0) & (effort < LARGEST_EFFORT)
    known[[joint.nq != joint.nv for joint in list(figure.model.joints)[1:] for _ in range(joint.nv)]] = False
    return np.where(known, -effort, -np.inf), np.where(known, effort, np.inf)


def _kind(joint: str) -> str:
    """A joint's name without its side and number: "left_knee_flexion" -> "knee_flexion"."""
    words = joint.removeprefix("left_").removeprefix("right_").split("_")
    return "_".join([words[0].rstrip("0123456789"), *words[1:]])
