"""Weights of a person's effort and how arms rest, fitted to one half of the published postures; the other judges."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tests.audits.human_postures import PostureRow, measure, median_man
from wholebody.figures.tables import named_angles, table
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
}
"""Joints, by the ends of their names, whose weights are multiplied by one factor. That of elbows is the unit. Necks are
left out: no angle of the table is theirs.
"""

SHARES = {"lumbar spine's share": "lumbar_weight", "knee's share": "knee_weight"}
"""Weights of `Rhythm` that are multiplied by one factor each."""

RESTS = {"resting forearm": "elbow_pronation", "resting wrist": "wrist_flexion"}
"""Joints whose angles in the named postures are fitted too, where the table has them."""

TEN = 10.0  # degrees that count as much as a logarithm of 1

STEPS = (np.log(2.0), np.log(1.4))  # of a factor's logarithm, one after the other
PRIOR = 0.02  # of the square of each logarithm: a factor that nothing asks for stays 1
FAR = 3.0  # standard deviations: what is further off counts hardly more, since its task is stated otherwise than it was


HELD = ("fingers' flexion", "fingers' abduction")
"""Groups that stay: typing asks for twice the weights of fingers, with which fewer grasps are found."""


class Fitted(NamedTuple):
    """What to change of present weights and angles by group, and the rows of both halves with it."""

    factors: dict[str, str]
    rows: list[PostureRow]


def fit(told: Callable[[str], None], held: Collection[str] = HELD) -> Fitted:
    """Change the factor that brings the postures of half "fit" nearest to people's, one after the other; say which.

    Args:
        told: takes a sentence.
        held: groups whose weights or angles stay.
    """
    free = rhythm.STYLES["free"]
    rests = [row for row in table("postures") if row["of"] == "human" and row["joint"] in RESTS.values()]
    present = [float(row["degrees"]) for row in rests]
    logs = {group: 0.0 for group in (*RESTS, *GROUPS, *SHARES) if group not in held}

    def people(logs: Mapping[str, float]) -> dict[str, Figure]:
        """The median man with these weights and resting angles."""
        turned = {joint: TEN * logs[group] for group, joint in RESTS.items() if group in logs}
        for row, degrees in zip(rests, present, strict=True):
            row["degrees"] = str(degrees + turned.get(row["joint"], 0.0))
        named_angles.cache_clear()
        shares = {name: getattr(free, name) * np.exp(logs[group]) for group, name in SHARES.items() if group in logs}
        rhythm.STYLES["free"] = free._replace(**shares)
        figures = median_man()
        for figure in figures.values():
            for joint in figure.joints:
                for group, ends in GROUPS.items():
                    if group in logs and joint.endswith(ends) and "thumb" not in joint:  # thumbs are on no key
                        figure.effort_weights[figure.dofs([joint])] *= np.exp(logs[group])
        return figures

    def cost(logs: Mapping[str, float]) -> float:
        return error(list(measure(people(logs), "fit"))) + PRIOR * sum(value**2 for value in logs.values())

    least = cost(logs)
    for step in STEPS:
        while True:
            tried = [{**logs, group: logs[group] + change} for group in logs for change in (step, -step)]
            costs = [cost(each) for each in tried]
            if min(costs) >= least - 1e-3:
                break
            least, found = min(costs), tried[int(np.argmin(costs))]
            group = next(group for group in logs if found[group] != logs[group])
            logs = found
            told(f"{group} {factor(group, logs[group])}: {least:.3f}")
    rows = list(measure(people(logs)))
    return Fitted({group: factor(group, value) for group, value in logs.items()}, rows)


def factor(group: str, log: float) -> str:
    """What a logarithm does: the factor on a weight, or degrees that are added to an angle."""
    return f"{TEN * log:+.0f} degrees" if group in RESTS else f"times {np.exp(log):.2f}"


def error(rows: Sequence[PostureRow]) -> float:
    """Mean of the squared distances from people in standard deviations, which grows hardly beyond `FAR`."""
    off = np.array([row.off for row in rows])
    return float(np.mean(off**2 / (1.0 + off**2 / FAR**2)))
