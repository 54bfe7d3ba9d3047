"""Static joint torques of a posture against published strength."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array, brief
from wholebody.ergonomics.angles import SIDES, check_person
from wholebody.ergonomics.work import LOAD
from wholebody.figures.figure import Figure
from wholebody.motion.clip import Clip
from wholebody.motion.clip_torques import clip_torques
from wholebody.motion.stance import standing_feet
from wholebody.motion.strength import Strength

LEGS = ("hip", "knee", "ankle", "toe")


@dataclass(frozen=True)
class StaticTorques:
    """Torques that hold a posture.

    Attributes:
        torque: joint -> torque, N m; positive towards positive angles.
        share: joint -> share of the strength in its direction, of the joints with published strength; more than 1 is
            more than the person can.

    Examples:
        >>> held = wb.ergonomics.static_torques(human, standing, load=5.0)
        >>> max(held.share.values()) < 1.0
        True
    """

    torque: Mapping[str, float]
    share: Mapping[str, float]

    __repr__ = brief

    @property
    def worst(self) -> tuple[str, float]:
        """The joint nearest to its strength, and its share; ("", 0) without any."""
        return max(self.share.items(), key=lambda item: item[1], default=("", 0.0))

    def of_side(self, side: str) -> tuple[str, float]:
        """The same of the arm and the leg of "left" or "right"."""
        checks.choice(side, SIDES, "side")
        mine = {name: share for name, share in self.share.items() if name.startswith(f"{side}_")}
        return max(mine.items(), key=lambda item: item[1], default=("", 0.0))


def static_torques(
    figure: Figure, q: Array, *, load: float = 0.0, seated: bool = False, strength: Strength | None = None
) -> StaticTorques:
    """Torques that hold a posture and a load, by inverse dynamics (`pin.rnea`) without motion.

    The weight of the body and of the load rests on the soles of the feet that are lowest. Of somebody seated it rests
    on the seat, so joints of the legs are left out.

    Args:
        figure: a person.
        q: (nq,) posture.
        load: mass in both hands together, half in each palm, kg.
        seated: whether a seat bears the weight.
        strength: of the person; a man of median strength if left out.

    Raises:
        InputError: no person, no posture, or a value out of range.

    Examples:
        >>> round(wb.ergonomics.static_torques(human, standing, load=10.0).torque["left_elbow_flexion"], 1)
        4.9
    """
    person = check_person(figure, "static_torques: figure")
    q = checks.posture(q, person.model.nq, "static_torques: q")
    person.warn_of_angles(q, "static_torques: q")
    load = LOAD(load, "static_torques: load")
    seated = checks.flag(seated, "static_torques: seated")
    strength = Strength() if strength is None else checks.instance(
        strength, Strength, "static_torques: strength", "give wb.motion.Strength(percentile=50, sex='female')"
    )  # fmt: skip
    carrying = with_load(person, load)
    clip = Clip(carrying, np.array([q, q]), 1.0, "posture")
    stands = standing_feet(clip, [f"{side}_foot" for side in SIDES])
    # coefficient between soles and ground, as for `wb.motion.torques`
    found = clip_torques(clip, stands, strength, 0.8, None)
    torques, shares = {}, {}
    for name in person.joints:
        joint = person.model.joints[person.joint_id(name)]
        if joint.nv != 1 or (seated and name.split("_")[1] in LEGS):
            continue
        torques[name] = float(found.torque[0, joint.idx_v])
        if np.isfinite(found.lower[joint.idx_v]) or np.isfinite(found.upper[joint.idx_v]):
            shares[name] = float(found.share[0, joint.idx_v])
    return StaticTorques(torques, shares)


def with_load(figure: Figure, load: float) -> Figure:
    """The figure with half of a mass, kg, in each palm."""
    if load == 0.0:
        return figure
    model = figure.model.copy()
    for side in SIDES:
        palm = model.frames[figure.frame_id(f"{side}_palm")]
        held = pin.Inertia(0.5 * load, palm.placement.translation, np.zeros((3, 3)))
        model.inertias[palm.parentJoint] = model.inertias[palm.parentJoint] + held
    return Figure(figure.name, model, figure.geometry, figure.detail, figure.describe(), figure.visual)
