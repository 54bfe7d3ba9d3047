"""Static joint torques of a posture against published strength."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wholebody.base import checks
from wholebody.base.arrays import Array, brief, with_values
from wholebody.ergonomics.angles import SIDES, check_person
from wholebody.ergonomics.exertion import Exertion, statics_of
from wholebody.ergonomics.work import LOAD
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.motion.strength import Strength
from wholebody.scene.scene import Scene
from wholebody.tasks.forces import GRAVITY, Force

RAISED = 0.03  # m: a sole higher than this over the lower one bears nothing


@dataclass(frozen=True)
class StaticTorques:
    """Torques that hold a posture.

    Attributes:
        torque: joint -> torque, N m; positive towards positive angles.
        share: joint -> share of the strength in its direction, of the joints with published strength; more than 1 is
            more than the person can.
        compression: of the disc L5/S1, N, as `back_compression` has it.

    Examples:
        >>> held = wb.ergonomics.static_torques(human, standing, load=5.0)
        >>> max(held.share.values()) < 1.0
        True
    """

    torque: Mapping[str, float]
    share: Mapping[str, float]
    compression: float

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
    """Torques that hold a posture and a load, as of `Exertion`.

    The weight of the body and of the load rests on the soles of the feet that are lowest. Of somebody seated it rests
    on the seat, so joints of the legs are left out.

    Args:
        figure: a person.
        q: (nq,) posture.
        load: mass in both hands together, half in each palm, kg.
        seated: whether a seat bears the weight.
        strength: of the person; the median of its sex and age if left out.

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
    held = [Force(f"{side}_palm", (0.0, 0.0, -0.5 * GRAVITY * load)) for side in SIDES if load]
    statics = statics_of(Scene(person), Exertion(held, strength=strength, standing=not seated))
    state = State(person.model).update(q)
    low = min((state.frame(one.frame).translation[2] for one in statics.feet), default=0.0)
    bearing = tuple(one for one in statics.feet if state.frame(one.frame).translation[2] <= low + RAISED)
    statics = with_values(statics, feet=bearing)
    legs = person.groups["legs"] if seated else ()
    joints = {name: person.model.joints[person.joint_id(name)] for name in person.joints if name not in legs}
    names = {joint.idx_v: name for name, joint in joints.items() if joint.nv == 1}
    columns = np.array(list(names), dtype=np.intp)
    torque, _ = statics.torques(state, columns, state.column_joint[columns])
    share, _ = statics.efforts(state)
    return StaticTorques(
        dict(zip(names.values(), torque.tolist(), strict=True)),
        {names[column]: one for column, one in zip(statics.joints.tolist(), np.abs(share).tolist(), strict=True)},
        statics.compression(state)[0],
    )
