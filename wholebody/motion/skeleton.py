"""Skeletons that move: joints and their placements, frame by frame, of whatever proportions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wholebody.base.arrays import Array, Indices, brief
from wholebody.base.checks import array as checked_array
from wholebody.base.checks import instance, listed, number, settle, text, time_step, whole
from wholebody.base.errors import InputError
from wholebody.motion.clip import LARGEST

UNITS = {
    "metres": 1.0,
    "units of CMU (0.0564 m)": 0.0254 / 0.45,
    "inches": 0.0254,
    "centimetres": 0.01,
    "millimetres": 1e-3,
}
"""Units of length of motion files, metres; CMU's converted files keep the scale 0.45 of its skeletons."""

RIGID = 1e-6  # by which the product of a rotation and its transpose may differ from the identity


@dataclass(frozen=True, eq=False)
class SkeletonMotion:
    """A skeleton that moves: z up, metres.

    Attributes:
        names: (j,) of the joints; a parent stands before its children. Ends of limbs are joints too.
        parents: (j,) index of each joint's parent; -1 for the one root.
        offsets: (j, 3) place of each joint in its parent's axes, metres; zero for the root.
        rotations: (n, j, 3, 3) orientation of each joint in the world.
        positions: (n, j, 3) place of each joint in the world, metres.
        dt: seconds from frame to frame.
        name: in messages.
        notes: sentences on what was assumed about the file.

    Raises:
        InputError: shapes do not fit, there is not one root, or a value is not finite.

    Examples:
        >>> skeleton.positions.shape == (len(clip), len(skeleton.names), 3)
        True
    """

    __repr__ = brief

    names: tuple[str, ...]
    parents: Indices
    offsets: Array
    rotations: Array
    positions: Array
    dt: float
    name: str = "motion"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        text(self.name, "the name of a motion")
        object.__setattr__(self, "notes", tuple(listed(self.notes, f"{self.name}: notes", "[]")))
        names = tuple(listed(self.names, f"{self.name}: names", "['hips', 'spine']"))
        if not names or not all(isinstance(name, str) for name in names):
            raise InputError(f"{self.name}: names are those of joints, one or more; give texts")
        object.__setattr__(self, "names", names)
        count = len(names)
        object.__setattr__(self, "parents", _parents(self.parents, self.name))
        if len(self.parents) != count:
            raise InputError(f"{self.name}: {len(self.parents)} parents for {count} joints; give one for each")
        settle(self, "dt", time_step(self.dt, f"{self.name}: dt"))
        places = checked_array(self.positions, f"{self.name}: positions", "(n, j, 3), metres")
        frames = len(places) if places.ndim else 0
        shapes = {"offsets": (count, 3), "rotations": (frames, count, 3, 3), "positions": (frames, count, 3)}
        for field, shape in shapes.items():
            value = checked_array(getattr(self, field), f"{self.name}: {field}", f"numbers of shape {shape}").copy()
            if value.shape != shape or not frames:
                raise InputError(f"{self.name}: {field} has shape {value.shape}; give {shape}, one frame or more")
            if not (np.abs(value) <= LARGEST).all():
                raise InputError(f"{self.name}: {field} has values that are not finite or beyond {LARGEST:g}")
            value.setflags(write=False)
            object.__setattr__(self, field, value)
        if np.abs(np.swapaxes(self.rotations, -1, -2) @ self.rotations - np.eye(3)).max() > RIGID:
            raise InputError(f"{self.name}: rotations are no rotations; give orthonormal matrices")

    def __len__(self) -> int:
        return len(self.positions)

    def rest(self) -> Array:
        """(j, 3) places of the joints where all rotations are the identity and the root is at the origin."""
        places = np.zeros((len(self.names), 3))
        for joint in range(1, len(self.names)):
            places[joint] = places[self.parents[joint]] + self.offsets[joint]
        return places

    def part(self, first: int, last: int) -> SkeletonMotion:
        """Frames `first` to `last`, without the last one.

        Raises:
            InputError: there is no frame among them.
        """
        first = whole(first, f"{self.name}: first", 0, len(self))
        last = whole(last, f"{self.name}: last", 0, len(self))
        frames = slice(first, last)
        return replace(self, rotations=self.rotations[frames], positions=self.positions[frames])

    def resized(self, factor: float) -> SkeletonMotion:
        """The same motion of a skeleton of which all lengths are multiplied.

        Raises:
            InputError: the factor is not between 0.0001 and 10,000.
        """
        factor = number(factor, "resized: factor", 1e-4, 1e4)
        return replace(self, offsets=factor * self.offsets, positions=factor * self.positions)

    @classmethod
    def moved(
        cls,
        names: tuple[str, ...],
        parents: Indices,
        offsets: Array,
        local: Array,
        root: Array,
        dt: float,
        name: str = "motion",
        notes: tuple[str, ...] = (),
    ) -> SkeletonMotion:
        """The motion from the rotation (n, j, 3, 3) of each joint in its parent's axes, and the root's place (n, 3).

        The other arguments are the attributes.
        """
        text(name, "the name of a motion")
        local = checked_array(local, f"{name}: local", "rotations, shape (n, j, 3, 3)")
        offsets = checked_array(offsets, f"{name}: offsets", "(j, 3), metres")
        root = checked_array(root, f"{name}: root", "places, shape (n, 3), metres")
        above = _parents(parents, name)
        count = len(above)
        if local.ndim != 4 or local.shape[1:] != (count, 3, 3) or offsets.shape != (count, 3):
            raise InputError(
                f"{name}: local has shape {local.shape} and offsets {offsets.shape}; "
                f"give (n, {count}, 3, 3) and ({count}, 3)"
            )
        if root.shape != (len(local), 3):
            raise InputError(f"{name}: root has shape {root.shape}; give ({len(local)}, 3)")
        for given in (local, offsets, root):
            if not (np.abs(given) <= LARGEST).all():
                raise InputError(f"{name}: a value is not finite or beyond {LARGEST:g}; correct it")
        rotations, positions = np.empty_like(local), np.empty(local.shape[:3])
        for joint, parent in enumerate(above):
            if parent < 0:
                rotations[:, joint], positions[:, joint] = local[:, joint], root
                continue
            rotations[:, joint] = rotations[:, parent] @ local[:, joint]
            positions[:, joint] = positions[:, parent] + rotations[:, parent] @ offsets[joint]
        return cls(names, parents, offsets, rotations, positions, dt, name, notes)


def _parents(value: object, name: str) -> Indices:
    """Indices of parents (j,), each before its children."""
    found = checked_array(value, f"{name}: parents", "an index for each joint")
    if found.ndim != 1 or not len(found) or found[0] != -1 or not all(0 <= p < k for k, p in enumerate(found[1:], 1)):
        raise InputError(f"{name}: parents are indices of joints before their children; give -1 for the first alone")
    return np.asarray(found.astype(np.intp))


def longest_way(parents: Indices, offsets: Array) -> float:
    """Length of the longest way from one end of a skeleton to another, along its bones."""
    lengths = np.linalg.norm(offsets, axis=1)
    below, longest = np.zeros(len(parents)), 0.0
    for joint in range(len(parents) - 1, 0, -1):
        reach, parent = below[joint] + lengths[joint], parents[joint]
        longest = max(longest, float(below[parent] + reach))
        below[parent] = max(below[parent], reach)
    return longest


UP = {
    "y": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
}
"""Axis that is up in a file to the rotation from its axes into ours; where y is up, z is forward and x is left."""


def checked_motion(value: object, what: str) -> SkeletonMotion:
    """A moving skeleton; anything else is refused."""
    return instance(value, SkeletonMotion, what, "read one with wb.motion.read_skeleton('walk.bvh')")
