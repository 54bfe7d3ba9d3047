"""Contacts of a clip: which segments and things overlap, when, how deep and for how long."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from wholebody.base.arrays import Array
from wholebody.geometry.continuous.swept_depth import Depths
from wholebody.motion.windows import runs
from wholebody.scene.scene import Scene

Kind = Literal["self", "equipment", "thing"]


@dataclass(frozen=True, eq=False)
class Contact:
    """Two segments or things that overlap in a clip by more than the tolerance, in frames or in gaps after them.

    Attributes:
        first, second: segments or things.
        kind: "self" for two segments of the figure, "equipment" if an attached thing takes part, otherwise "thing":
            something that stands in the world.
        frames, gaps: number of frames in contact, and of gaps.
        start: the first frame in contact; where the contact begins in a gap, the frame before.
        deepest: greatest depth, metres.
        deepest_frame: the frame in which it is deepest; the one before, where it is deepest in a gap.
        deepest_between: whether it is deepest in a gap.
        longest: first and last frame of the longest contact; frames beside a gap in contact belong to it.
        depth, between: (n,) and (n - 1,) depth in each frame and gap, metres; 0 where the two do not overlap.
    """

    first: str
    second: str
    kind: Kind
    frames: int
    gaps: int
    start: int
    deepest: float
    deepest_frame: int
    deepest_between: bool
    longest: tuple[int, int]
    depth: Array = field(repr=False)
    between: Array = field(repr=False)

    @property
    def names(self) -> str:
        """Both names, for messages."""
        return f"{self.first} and {self.second}"


class ContactTable:
    """Depths of all pairs of owners, filled frame by frame."""

    def __init__(self, scene: Scene, frames: int) -> None:
        self._owners, self._pairs = scene.piece_owner, scene.pair_table.pairs
        self._scene, self._frames = scene, frames
        self._found: dict[tuple[str, str], tuple[Array, Array]] = {}

    def add(self, place: int, depths: Depths, *, between: bool) -> None:
        """Enter the overlaps of a frame, or of the gap after it."""
        for pair, depth in zip(self._pairs[depths.number].tolist(), depths.depth.tolist(), strict=True):
            names = self._owners[pair[0]], self._owners[pair[1]]
            if names not in self._found:
                self._found[names] = np.zeros(self._frames), np.zeros(max(0, self._frames - 1))
            row = self._found[names][int(between)]
            row[place] = max(row[place], depth)

    def contacts(self, tolerance: float) -> tuple[Contact, ...]:
        """The pairs that overlap by more than the tolerance, the deepest first."""
        found = [
            contact(*names, self._kind(*names), depth, between, tolerance)
            for names, (depth, between) in self._found.items()
            if max(depth.max(), between.max(initial=0.0)) > tolerance
        ]
        return tuple(sorted(found, key=lambda contact: -contact.deepest))

    def deepest(self) -> tuple[Array, Array]:
        """Deepest overlap of any pair in each frame (n,), and in each gap (n - 1,)."""
        depth, between = np.zeros(self._frames), np.zeros(max(0, self._frames - 1))
        for in_frames, in_gaps in self._found.values():
            np.maximum(depth, in_frames, out=depth)
            np.maximum(between, in_gaps, out=between)
        return depth, between

    def _kind(self, first: str, second: str) -> Kind:
        things = [self._scene.objects[name] for name in (first, second) if name in self._scene.objects]
        if not things:
            return "self"
        return "equipment" if all(thing.segment is not None for thing in things) else "thing"


def contact(first: str, second: str, kind: Kind, depth: Array, between: Array, tolerance: float) -> Contact:
    """The contact of two owners, of depths in frames (n,) and gaps (n - 1,), one of them beyond the tolerance."""
    # frames and gaps in the order of time: 2 k is frame k, 2 k + 1 the gap after it
    times = np.zeros(2 * len(depth) - 1)
    times[::2], times[1::2] = depth, between
    touching = times > tolerance
    touched = runs(touching)
    longest = max(touched, key=len)
    deepest = int(np.argmax(times))
    # a gap is never less deep than its ends: the frame is meant where it is as deep, to the accuracy of gaps
    beside = [k for k in (deepest - 1, deepest + 1) if 0 <= k < len(times) and times[k] >= 0.95 * times[deepest]]
    if deepest % 2 and beside:
        deepest = max(beside, key=lambda k: times[k])
    return Contact(
        first=first,
        second=second,
        kind=kind,
        frames=int(touching[::2].sum()),
        gaps=int(touching[1::2].sum()),
        start=touched[0].first // 2,
        deepest=float(times[deepest]),
        deepest_frame=deepest // 2,
        deepest_between=bool(deepest % 2),
        longest=(longest.first // 2, longest.end // 2),
        depth=depth,
        between=between,
    )


def contact_as_dict(contact: Contact, dt: float) -> dict[str, Any]:
    """A contact as JSON has it; lengths in metres, times in seconds."""
    return {
        "first": contact.first,
        "second": contact.second,
        "kind": contact.kind,
        "frames": contact.frames,
        "gaps": contact.gaps,
        "start": {"frame": contact.start, "time": contact.start * dt},
        "deepest": {
            "depth": contact.deepest,
            "frame": contact.deepest_frame,
            "time": contact.deepest_frame * dt,
            "between": contact.deepest_between,
        },
        "longest": {
            "first_frame": contact.longest[0],
            "last_frame": contact.longest[1],
            "seconds": (contact.longest[1] - contact.longest[0]) * dt,
        },
    }
