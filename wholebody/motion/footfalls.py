"""Feet of a recorded skeleton that stand: when, and where the floor is.

They are slow and low by the measures of `StanceFeet`, as the feet of a clip are. But the joints of a skeleton are above
its soles, and a recording drifts: both feet have one floor, a low percentile of what they do while they are slow, and a
foot that stands at several places made steps between them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.base.arrays import Array, Mask
from wholebody.motion.roles import Roles
from wholebody.motion.skeleton import SkeletonMotion
from wholebody.motion.stance import StanceFeet, speeds
from wholebody.motion.windows import Window, long_runs, runs

FLOOR = 10.0
"""Percentile of the heights of slow feet that counts as the height at which they stand: some are lower by error."""

BLEND = 0.15
"""Seconds before and after a foot stands, over which it goes from its own way to where it stands."""

DRIFT = 0.03
"""Metres by which a foot that stands may move in the recording: a foot that moves more has made a step."""

SMALL = 1e-9
"""Metres: shorter ways have no direction."""


class Footfalls(NamedTuple):
    """When parts of the feet stand.

    Attributes:
        stands: role to (n,) whether it stands.
        heights: role to its height while it stands, metres.
    """

    stands: dict[str, Mask]
    heights: dict[str, float]


def footfalls(motion: SkeletonMotion, roles: Roles) -> Footfalls:
    """When the ankles and toes of a skeleton stand."""
    stands, heights, limits = {}, {}, StanceFeet()
    for part in ("ankle", "toe"):
        pair = {
            f"{side}_{part}": motion.names.index(roles.joints[f"{side}_{part}"])
            for side in ("left", "right")
            if f"{side}_{part}" in roles.joints
        }
        places = {role: motion.positions[:, joint] for role, joint in pair.items()}
        speed = {role: speeds(at, motion.dt) for role, at in places.items()}
        slow = [at[speed[role] <= limits.speed, 2] for role, at in places.items()]
        low = np.concatenate(slow) if slow else np.zeros(0)
        if not len(low):
            continue
        height = float(np.percentile(low, FLOOR))
        for role, at in places.items():
            heights[role] = height
            still = _apart(at, (speed[role] <= limits.speed) & (at[:, 2] <= height + limits.height))
            stands[role] = long_runs(still, round(limits.least / motion.dt))
    for side in ("left", "right"):  # a heel stands only while the toes do, so that both keep the length of the foot
        if {f"{side}_toe", f"{side}_ankle"} <= stands.keys():
            stands[f"{side}_ankle"] &= stands[f"{side}_toe"]
    return Footfalls(stands, heights)


def held(
    points: dict[str, Array], steps: Footfalls, places: dict[str, Array], lowest: float, dt: float
) -> dict[str, Array]:
    """The goals of points with feet that stand at one place each, at the height at which the figure's stand.

    Before and after it stands, a foot goes over from its own way to that place and back.

    Args:
        points: role to (n, 3), metres.
        steps: when the feet stand.
        places: role to (3,) place in the figure's neutral posture, which stands.
        lowest: height of the figure's lowest point in it.
        dt: seconds from frame to frame.
    """
    found = dict(points)
    for part in ("toe", "ankle"):
        for side in ("left", "right"):
            role, toe = f"{side}_{part}", f"{side}_toe"
            if role not in steps.stands or role not in points:
                continue
            corrections = []
            for first, last in runs(steps.stands[role]):
                frames = slice(first, last)
                place = points[role][frames].mean(axis=0)
                if part == "ankle" and toe in steps.stands and steps.stands[toe][frames].all():
                    ahead = found[toe][frames].mean(axis=0)  # the toes stand already: keep the length of the foot
                    place = ahead + (points[role][frames] - points[toe][frames]).mean(axis=0)
                    flat = place[:2] - ahead[:2]
                    rise = places[role][2] - places[toe][2]
                    length = np.linalg.norm(places[role] - places[toe])
                    place[:2] = ahead[:2] + flat / max(float(np.linalg.norm(flat)), SMALL) * np.sqrt(
                        max(length**2 - rise**2, 0.0)
                    )
                place[2] = places[role][2] - lowest
                corrections.append((first, last, place))
            found[role] = _blended(points[role], corrections, max(1, round(BLEND / dt)))
    return found


def _blended(way: Array, places: list[tuple[int, int, Array]], over: int) -> Array:
    """A way (n, 3) that rests at places over some frames each, and goes over to and from them."""
    frames = np.arange(len(way))
    total, weights = np.zeros_like(way), np.zeros(len(way))
    for first, last, place in places:
        away = np.maximum(first - frames, frames - (last - 1))
        share = 0.5 + 0.5 * np.cos(np.pi * np.clip(away / over, 0.0, 1.0))
        near = np.clip(frames, first, last - 1)
        total += share[:, None] * np.where((away > 0)[:, None], place - way[near], place - way)
        weights += share
    found: Array = way + total / np.maximum(weights, 1.0)[:, None]
    return found


def _apart(places: Array, mask: Mask) -> Mask:
    """The mask without the fastest frame of each run over which a foot goes on, so that it stands at several places."""
    kept: Mask = np.array(mask)
    waiting = runs(kept)
    moved = speeds(places, 1.0)
    while waiting:
        first, last = waiting.pop()
        if last - first > 2 and np.linalg.norm(np.ptp(places[first:last], axis=0)) > DRIFT:
            cut = first + 1 + int(moved[first + 1 : last - 1].argmax())
            kept[cut] = False
            waiting += [Window(first, cut), Window(cut + 1, last)]
    return kept
