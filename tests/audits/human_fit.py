"""The weights of a person's effort, fitted to one half of the published postures and judged by the other."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tests.audits.human_postures import PostureRow, measure
from wholebody.tasks import rhythm

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure

GROUPS = {
    "shoulder": ("shoulder_flexion", "shoulder_abduction"),
    "upper arm's rotation": ("shoulder_rotation",),
    "pronation": ("elbow_pronation",),
    "wrist's flexion": ("wrist_flexion",),
    "wrist's deviation": ("wrist_deviation",),
    "fingers' flexion": ("mcp_flexion", "pip_flexion", "dip_flexion"),
    "fingers' abduction": ("mcp_abduction",),
    "lumbar spine's flexion": ("spine1_flexion", "spine2_flexion", "spine3_flexion"),
    "hip's flexion": ("hip_flexion",),
    "knee and ankle": ("knee_flexion", "ankle_dorsiflexion"),
    "neck": ("neck1_flexion", "neck2_flexion"),
}
"""Joints, by the ends of their names, whose weights are multiplied by one factor. That of elbows is the unit."""

SHARES = {"lumbar spine's share": "lumbar_weight", "knee's share": "knee_weight"}
"""Weights of `Rhythm` that are multiplied by one factor each."""

STEPS = (np.log(4.0), np.log(2.0), np.log(1.4))  # of a factor's logarithm, one after the other
PRIOR = 0.02  # of the square of each logarithm: a factor that nothing asks for stays 1
FAR = 3.0  # standard deviations: what is further off counts hardly more, since its task is stated otherwise than it was


class Fitted(NamedTuple):
    """Factors on the present weights by group, and the rows of both halves with them."""

    factors: dict[str, float]
    rows: list[PostureRow]


def fit(figures: Mapping[str, Figure], told: Callable[[str], None], held: Collection[str] = ()) -> Fitted:
    """Change one factor at a time while that brings the postures of half "fit" nearer to people's; say what is found.

    Args:
        figures: as for `measure`; their weights are changed, and are those of the answer at the end.
        told: takes a sentence.
        held: groups whose weights stay.
    """
    present = {kind: figure.effort_weights.copy() for kind, figure in figures.items()}
    free = rhythm.STYLES["free"]
    logs = {group: 0.0 for group in (*GROUPS, *SHARES) if group not in held}

    def cost(logs: Mapping[str, float]) -> float:
        changed = {SHARES[group]: np.exp(log) for group, log in logs.items() if group in SHARES}
        shares = {name: getattr(free, name) * factor for name, factor in changed.items()}
        rhythm.STYLES["free"] = free._replace(**shares)
        for kind, figure in figures.items():
            figure.effort_weights[:] = present[kind]
            for joint in figure.joints:
                for group, ends in GROUPS.items():
                    if group in logs and joint.endswith(ends) and "thumb" not in joint:  # thumbs are on no key
                        figure.effort_weights[figure.dofs([joint])] *= np.exp(logs[group])
        return error(list(measure(figures, "fit"))) + PRIOR * sum(value**2 for value in logs.values())

    least = cost(logs)
    for step in STEPS:
        moved = True
        while moved:
            moved = False
            for group in logs:
                for change in (step, -step):
                    tried = {**logs, group: logs[group] + change}
                    if (found := cost(tried)) < least - 1e-3:
                        least, logs, moved = found, tried, True
                        told(f"{group} times {np.exp(logs[group]):.2f}: {least:.3f}")
                        break
    cost(logs)
    return Fitted({group: float(np.exp(value)) for group, value in logs.items()}, list(measure(figures)))


def error(rows: Sequence[PostureRow]) -> float:
    """Mean of the squared distances from people in standard deviations, which grows hardly beyond `FAR`."""
    off = np.array([row.off for row in rows])
    return float(np.mean(off**2 / (1.0 + off**2 / FAR**2)))
