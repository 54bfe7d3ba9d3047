"""Collision groups: maximal runs of frames that collide, widened by a buffer."""

from __future__ import annotations

from typing import NamedTuple

from wholebody.base.arrays import Mask
from wholebody.motion.windows import runs


class Group(NamedTuple):
    """Consecutive frames, the last one included.

    Attributes:
        first: the first frame.
        last: the last frame.
        middle: the frame that bisects what collides.
    """

    first: int
    last: int
    middle: int


def collision_groups(bad: Mask, low: int, high: int, share: float = 0.0, least: int = 1) -> list[Group]:
    """Groups of the frames that collide between two frames that stay.

    Each maximal run is widened on both sides by a share of its number of frames, rounded, and to the least number of
    frames, as far as there is room. Runs whose wider groups overlap, or have no frame in between, become one group.

    Args:
        bad: (n,) which frames collide.
        low: the frame before the first one that may change.
        high: the frame after the last one that may change.
        share: of the number of frames in a run, by which it is widened to each side.
        least: number of frames that a group has at least, where there is room.
    """
    first, last = low + 1, high - 1
    found: list[tuple[int, int, list[tuple[int, int]]]] = []
    for run in runs(bad[first : last + 1]):
        begin, end = first + run.first, first + run.end - 1
        wide = _widened(begin, end, round((end - begin + 1) * share), least, first, last)
        covered = [(begin, end)]
        while found and wide[0] <= found[-1][1] + 1:
            before = found.pop()
            wide = min(before[0], wide[0]), max(before[1], wide[1])
            covered = before[2] + covered
        found.append((*wide, covered))
    return [Group(begin, end, _middle(covered)) for begin, end, covered in found]


def _widened(begin: int, end: int, buffer: int, least: int, first: int, last: int) -> tuple[int, int]:
    begin, end = max(first, begin - buffer), min(last, end + buffer)
    lacking = least - (end - begin + 1)
    if lacking > 0:
        begin = max(first, begin - (lacking + 1) // 2)
        end = min(last, max(end, begin + least - 1))
        begin = max(first, min(begin, end - least + 1))
    return begin, end


def _middle(covered: list[tuple[int, int]]) -> int:
    """The middle one of the frames that collide."""
    frames = [frame for begin, end in covered for frame in range(begin, end + 1)]
    return frames[(len(frames) - 1) // 2]
