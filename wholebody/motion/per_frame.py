"""Method "frames": every frame by tracking the original posture, from the deviation of the frame before.

A forward pass follows the original motion as contacts let it. It is late where contact begins, so a backward pass
follows it from the last frame to the first, and both are blended. What overlaps after that is corrected by steps of the
tracker, and what is left then, such as dips between frames, by the shared repair.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.fields import Checked
from wholebody.motion.avoider import CLEARANCE, MethodResult, Run
from wholebody.motion.faults import DEPTH, depth
from wholebody.motion.windows import Window


@dataclass(frozen=True)
class PerFrame(Checked):
    """Every frame by tracking, forward and backward, with a least distance of every pair, metres.

    Raises:
        InputError: a value of the wrong kind, shape or range.

    Examples:
        >>> wb.avoid(clip, scene, method=wb.motion.PerFrame(clearance=0.002)).report.method
        'frames'
    """

    name: ClassVar[str] = "frames"
    dynamics: ClassVar[None] = None

    clearance: Annotated[float, CLEARANCE] = 0.0

    def avoid(self, run: Run) -> MethodResult:
        """Free a clip; see `wholebody.motion.avoider.Avoider`."""
        q = np.array(run.terms.q)
        # a collision is followed from 0.3 s before it to 0.3 s after it
        found, done = run.windows(run.faults(q).frames, 0.3, 2), 0
        for window in found:
            if run.watch.tell(done / sum(map(len, found)), "frames"):
                break
            self._free(run, window, q)
            done += len(window)
        return MethodResult(q, repair=True)

    def _free(self, run: Run, window: Window, q: Array) -> None:
        """Free the frames of a window of q (n, nq) in place."""
        forward = _passed(run, range(window.first, window.end))
        if len(window) < 2:
            q[window.first : window.end] = forward
            return
        backward = _passed(run, range(window.end - 1, window.first - 1, -1))[::-1]
        for place, share in enumerate(np.linspace(0.0, 1.0, len(window)).tolist()):
            # the forward pass is late at the beginning of contacts, the backward pass at their ends
            frame, smooth = window.first + place, share * share * (3.0 - 2.0 * share)
            blended = np.asarray(pin.interpolate(run.scene.model, backward[place], forward[place], smooth))
            if depth(run.workspace, blended, self.clearance) > DEPTH or run.terms.kept(frame):
                blended = run.follower.frame(frame, blended)
            q[frame] = blended


def _passed(run: Run, frames: range) -> Array:
    """(n, nq) postures of frames, each begun at its original posture with the deviation of the one before."""
    model, original, found = run.scene.model, run.terms.q, list[Array]()
    away = np.zeros(model.nv)
    for frame in frames:
        # the motion goes on as the original one does; without that a foot would wait behind the one that stands
        here = run.follower.frame(frame, np.asarray(pin.integrate(model, original[frame], away)))
        found.append(here)
        away = np.asarray(pin.difference(model, original[frame], here))
    return np.array(found)
