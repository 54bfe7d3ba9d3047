"""What must give way in a clip, seen from its original postures, so that it is said before anything is computed."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin

from wholebody.motion.checking import ClipCheck
from wholebody.motion.faults import DEPTH
from wholebody.motion.frame_terms import FrameTerms
from wholebody.motion.judging import HELD

JUMP = 0.35  # rad, m: least change of a coordinate from frame to frame that can be a jump
SUDDEN = 4.0  # a jump is so many times as long as the steps before and after it


def foreseen(terms: FrameTerms, was: ClipCheck, keep_ends: bool) -> str:
    """Sentences, each with its mend: feet held inside things, jumps that collide, ends that cannot be kept; or ""."""
    return "; ".join(said for said in (_feet(terms, was), _jumps(was), _ends(was) if keep_ends else "") if said)


def _feet(terms: FrameTerms, was: ClipCheck) -> str:
    """Which feet are held where they are inside of a thing, so that no method can free them."""
    figure, told = terms.scene.figure, list[str]()
    joints = [{figure.model.frames[figure.frame_id(name)].parentJoint for name in names} for names in terms.stands]
    for contact in was.contacts:
        segment, thing = contact.first, contact.second
        segment, thing = (segment, thing) if segment in figure.segments else (thing, segment)
        if contact.kind != "thing" or segment not in figure.segments:
            continue
        joint = figure.model.frames[figure.frame_id(segment)].parentJoint
        held = np.array([joint in here for here in joints]) & (contact.depth > HELD)
        if held.any():
            told.append(f"{segment} stands up to {1e3 * contact.depth[held].max():.0f} mm inside {thing}")
    if not told:
        return ""
    return (
        f"{', '.join(told)}, and is held there; let feet slide by hold_feet=False (or --no-feet), or retarget "
        "the recording with this scene, which puts feet on what is below them"
    )


def _jumps(was: ClipCheck) -> str:
    """Where the recording jumps while something collides, with what is worn on it."""
    model, q = was.clip.figure.model, was.clip.q
    steps = np.abs([pin.difference(model, *pair) for pair in pairwise(q)]).reshape(-1, model.nv)
    around = np.zeros_like(steps)
    around[1:], around[:-1] = steps[:-1], np.maximum(around[:-1], steps[1:])
    jumps = (steps > np.maximum(JUMP, SUDDEN * around)) & (was.between > was.tolerance)[:, None]
    if not jumps.any():
        return ""
    gap, column = np.unravel_index(int(np.where(jumps, steps, 0.0).argmax()), steps.shape)
    joint = next(name for name, j in zip(model.names, model.joints, strict=True) if 0 <= column - j.idx_v < j.nv)
    met = max(was.contacts, key=lambda contact: contact.between[gap])
    more = int(jumps.any(axis=1).sum()) - 1
    also = f", and jumps {more} times more" if more else ""
    return (
        f"the recording jumps from frame {gap} to {gap + 1} ({joint} by {steps[gap, column]:.2g} rad or m) while "
        f"{met.first} and {met.second} overlap{also}, and the freed clip will jump too; cut it there (clip[:{gap + 1}] "
        f"and clip[{gap + 1}:]), or leave frames out and fill them in by resampled"
    )


def _ends(was: ClipCheck) -> str:
    """Which of the ends that are to be kept collide, and where the clip could begin or end."""
    free = np.flatnonzero(was.depth <= DEPTH)
    told = []
    for word, frame in (("first", 0), ("last", len(was.depth) - 1)):
        if was.depth[frame] > DEPTH:
            worst = max(was.contacts, key=lambda contact: contact.depth[frame], default=None)
            pair = f" ({worst.first} and {worst.second})" if worst is not None else ""
            mend = "leave keep_ends out"
            if len(free):
                mend = f"give clip[{free[0]}:]" if word == "first" else f"give clip[:{free[-1] + 1}]"
            told.append(
                f"the {word} posture overlaps by {1e3 * was.depth[frame]:.1f} mm{pair} and cannot be kept; {mend}"
            )
    return "; ".join(told)
