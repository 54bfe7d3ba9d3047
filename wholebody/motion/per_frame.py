"""Method "frames": every frame by tracking the original posture, from the deviation of the frame before.

A forward pass follows the original motion as contacts let it. It is late where contact begins, so a backward pass
follows it from the last frame to the first, and both are blended. What overlaps after that is put right by steps of the
tracker, dips between frames by more room beside them, and what is left then by `wholebody.motion.repair`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.arrays import Array
from wholebody.motion.avoider import MethodResult, Progress, Watch, check_input
from wholebody.motion.clip import Clip
from wholebody.motion.dips import dipping
from wholebody.motion.faults import DEPTH, depth, faults
from wholebody.motion.following import Follower
from wholebody.motion.frame_terms import FrameTerms, Given, frame_terms
from wholebody.motion.repair import Repairer
from wholebody.motion.windows import Window, windows
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import Workspace

MARGIN = 0.3  # s, before and after a collision: in which the pass begins and ends at the original posture
ROOM = 5e-4  # m: more room that the frames beside a dip are first asked for; it doubles from round to round
LIFTS = 3  # rounds of asking for more


@dataclass(frozen=True)
class PerFrame:
    """Every frame by tracking, forward and backward.

    Attributes:
        clearance: least distance of every pair, metres.
        backward: whether a backward pass is blended with the forward pass; twice the time, no lag.

    Raises:
        InputError: a value out of range.
    """

    clearance: float = 0.0
    backward: bool = True

    def __post_init__(self) -> None:
        """Check the settings."""
        checks.settle(self, "clearance", checks.number(self.clearance, "PerFrame: clearance", 0.0, 0.5, "m"))
        checks.settle(self, "backward", checks.flag(self.backward, "PerFrame: backward"))

    @property
    def name(self) -> str:
        """Name for tables."""
        return "frames"

    @property
    def dynamics(self) -> None:
        """It looks at no torques."""

    def avoid(self, clip: Clip, scene: Scene, constraints: Iterable[Given], progress: Progress | None) -> MethodResult:
        """Free a clip; see `wholebody.motion.avoider.Avoider`."""
        check_input(clip, scene, progress)
        terms, watch = frame_terms(scene, clip.q, clip.dt, constraints, self.clearance), Watch(progress)
        q = np.array(clip.q)
        with scene.borrow() as workspace:
            _, wrong, gaps = faults(workspace, terms, q, self.clearance)
            wrong[[frame + end for frame in gaps for end in (0, 1)]] = True
            found = windows(wrong, max(2, round(MARGIN / clip.dt)))
            total = sum(map(len, found))
            follower, done = Follower(terms, self.clearance) if found else None, 0
            for window in found:
                if follower is None or watch.tell(done / total, "frames"):
                    break
                self._free(window, q, terms, follower, workspace)
                _lift(window, q, follower, workspace)
                done += len(window)
            repairer = Repairer(terms, workspace, self.clearance)
            if found and not watch.ended:
                q = repairer.repair(q, watch)
        ended = "the caller ended it" if watch.ended else ""
        return MethodResult(q, 0, repairer.programs + (0 if follower is None else follower.programs), ended)

    def _free(self, window: Window, q: Array, terms: FrameTerms, follower: Follower, workspace: Workspace) -> None:
        forward = _passed(follower, terms, range(window.first, window.end))
        if not self.backward or len(window) < 2:
            q[window.first : window.end] = forward
            return
        backward = _passed(follower, terms, range(window.end - 1, window.first - 1, -1))[::-1]
        model = workspace.model
        for place, share in enumerate(np.linspace(0.0, 1.0, len(window)).tolist()):
            # the forward pass is late at the beginning of contacts, the backward pass at their ends
            blended = np.asarray(pin.interpolate(model, backward[place], forward[place], _smooth(share)))
            if depth(workspace, blended, self.clearance) > DEPTH or terms.kept(window.first + place):
                blended = follower.frame(window.first + place, blended)
            q[window.first + place] = blended


def _passed(follower: Follower, terms: FrameTerms, frames: range) -> Array:
    """(n, nq) postures of frames, each begun at its original posture with the deviation of the one before."""
    model, figure, found = terms.scene.model, terms.scene.figure, list[Array]()
    away = np.zeros(model.nv)
    for frame in frames:
        # the motion goes on as the original one does; without that a foot would wait behind the one that stands
        here = figure.clamp(np.asarray(pin.integrate(model, terms.q[frame], away)))
        here = follower.frame(frame, here)
        found.append(here)
        away = np.asarray(pin.difference(model, terms.q[frame], here))
    return np.array(found)


def _lift(window: Window, q: Array, follower: Follower, workspace: Workspace) -> None:
    """Ask for more room in the frames on both sides of motions that dip, a few times.

    Most dips are arcs between two postures in contact, and less than a millimetre deep.
    """
    more = np.zeros(len(q))
    gaps = list(range(max(0, window.first - 1), min(len(q) - 1, window.end)))
    for _ in range(LIFTS):
        frames = sorted({frame + end for frame in dipping(workspace, q, gaps) for end in (0, 1)})
        for frame in frames:
            more[frame] = 2.0 * more[frame] + ROOM
            q[frame] = follower.frame(frame, q[frame], float(more[frame]))
        gaps = sorted({gap for frame in frames for gap in (frame - 1, frame) if 0 <= gap < len(q) - 1})


def _smooth(share: float) -> float:
    """From 0 to 1 with no rate at both ends."""
    return share * share * (3.0 - 2.0 * share)
