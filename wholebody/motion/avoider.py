"""The protocol of methods that free a clip, and what they return."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, Protocol

from wholebody.base.arrays import Array
from wholebody.base.checks import function, instance
from wholebody.motion.checking import same_joints
from wholebody.motion.clip import Clip
from wholebody.motion.frame_terms import Given
from wholebody.motion.strength import Strength
from wholebody.scene.scene import Scene


class AvoidProgress(NamedTuple):
    """Told while a clip is freed.

    Attributes:
        share: done so far, from 0 to 1.
        note: what is being done.
    """

    share: float
    note: str


Progress = Callable[[AvoidProgress], Any]
"""Called now and then; if it returns True, the method ends with what it has."""


class MethodResult(NamedTuple):
    """What a method makes of a clip.

    Attributes:
        q: (n, nq) postures.
        posture_solves: how many postures were solved for, each on its own.
        programs: how many quadratic programs were solved.
        message: what did not succeed, one sentence; empty where all did.
        times: (n,) seconds of the clip as it was at which each frame is; None where the timing stays.
        stretch: factor by which the clip was slowed most, anywhere.
    """

    q: Array
    posture_solves: int = 0
    programs: int = 0
    message: str = ""
    times: Array | None = None
    stretch: float = 1.0


class Avoider(Protocol):
    """A method that frees clips: frozen settings."""

    @property
    def name(self) -> str:
        """Name for tables, and by which `avoid` finds it."""

    @property
    def clearance(self) -> float:
        """Least distance of every pair that it keeps, metres."""

    @property
    def dynamics(self) -> Strength | None:
        """The strength within which it keeps torques; None where it looks at none."""

    def avoid(self, clip: Clip, scene: Scene, constraints: Iterable[Given], progress: Progress | None) -> MethodResult:
        """Free a clip.

        Args:
            clip: original postures; they stay as they are.
            scene: its figure with equipment, and the things around.
            constraints: what holds in every frame; see `wholebody.motion.frame_terms`.
            progress: called with the share done; where it returns True, the method ends with what it has.

        Raises:
            InputError: clip and scene are none or of different figures, or a constraint is none.
            UnknownNameError: a constraint names what the figure does not have.
        """


def has_setting(method: Avoider, name: str) -> bool:
    """Whether a method has a setting of a name, such as "dynamics", so that `dataclasses.replace` changes it."""
    return name in getattr(method, "__dataclass_fields__", {})


def check_input(clip: object, scene: object, progress: object) -> None:
    """Check what a method gets.

    Raises:
        InputError: no clip, no scene, a scene of a figure with other joints, or progress that cannot be called.
    """
    instance(clip, Clip, "avoid: clip", "read one with wb.read_clip(path, figure)")
    instance(scene, Scene, "avoid: scene", "make one with wb.Scene(clip.figure)")
    assert isinstance(clip, Clip)
    assert isinstance(scene, Scene)
    same_joints(clip, scene.figure, "avoid")
    function(progress, "avoid: progress")


class Watch:
    """Tells the caller how far a method is, and remembers whether the caller ended it.

    Attributes:
        ended: whether the caller ended it.
    """

    def __init__(self, progress: Progress | None) -> None:
        """Take what is called, or None."""
        self._progress, self.ended = progress, False

    def tell(self, share: float, note: str) -> bool:
        """Report; whether to end now."""
        if self._progress is not None and self._progress(AvoidProgress(min(max(share, 0.0), 1.0), note)) is True:
            self.ended = True
        return self.ended
