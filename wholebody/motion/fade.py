"""Method "fade": the deepest frame of each collision is freed, and its change fades out over the frames around it.

This is what commercial animation tools do. It is repeated on what then collides, so it ends when all is free or when
the rounds are used up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.motion.avoider import MethodResult, Run
from wholebody.motion.frame_terms import FrameTerms
from wholebody.motion.windows import Window, runs


@dataclass(frozen=True)
class Fade:
    """The deepest frame of each collision freed, its change faded over the frames around it.

    Attributes:
        clearance: least distance of every pair in the freed frames, metres.
        fade: seconds before and after a collision over which a change fades.
        rounds: most rounds; each begins with what is left of the one before.
        solves: most postures that are solved for, for a whole clip.

    Raises:
        InputError: a value out of range.
    """

    clearance: float = 0.0
    fade: float = 0.3
    rounds: int = 12
    solves: int = 200

    def __post_init__(self) -> None:
        """Check the settings."""
        checks.settle(self, "clearance", checks.number(self.clearance, "Fade: clearance", 0.0, 0.5, "m"))
        checks.settle(self, "fade", checks.number(self.fade, "Fade: fade", 0.0, 100.0, "s"))
        checks.settle(self, "rounds", checks.whole(self.rounds, "Fade: rounds", 1, 1000))
        checks.settle(self, "solves", checks.whole(self.solves, "Fade: solves", 1, 1_000_000))

    @property
    def name(self) -> str:
        """Name for tables."""
        return "fade"

    @property
    def dynamics(self) -> None:
        """It looks at no torques."""

    def avoid(self, run: Run) -> MethodResult:
        """Free a clip; see `wholebody.motion.avoider.Avoider`."""
        q, fade, total = np.array(run.terms.q), run.frames(self.fade, 1), np.inf
        for number in range(self.rounds):
            found = run.faults(q)
            left = runs(found.frames)
            if not left:
                return MethodResult(q)
            total, before = float(found.depths.sum()) + 1e-4 * len(found.gaps), total  # m that a dip counts for
            if total >= before:
                return MethodResult(q, message="a round made nothing better")
            for place, part in enumerate(left):
                if run.watch.tell((number + place / len(left)) / self.rounds, f"round {number + 1}"):
                    return MethodResult(q)
                if run.work.posture_solves == self.solves:
                    return MethodResult(q, message=f"{self.solves} postures did not free it")
                deepest = part.first + int(np.argmax(found.depths[part.first : part.end]))
                _fade(run.terms, q, part, deepest, run.freed_posture(deepest, q[deepest]), fade)
            q = np.array([run.scene.figure.clamp(posture) for posture in q])
        return MethodResult(q, message="" if not run.faults(q).number else f"{self.rounds} rounds did not free it")


def _fade(terms: FrameTerms, q: Array, part: Window, deepest: int, freed: Array, fade: int) -> None:
    """Add the change of the deepest frame to the frames of its collision, and a share of it to those around."""
    model = terms.scene.model
    change = np.asarray(pin.difference(model, q[deepest], freed))
    for frame in range(max(0, part.first - fade), min(len(q), part.end + fade)):
        if not terms.kept(frame):
            away = max(part.first - frame, frame - part.end + 1, 0) / (fade + 1)
            q[frame] = pin.integrate(model, q[frame], (1.0 - away) ** 2 * (1.0 + 2.0 * away) * change)
