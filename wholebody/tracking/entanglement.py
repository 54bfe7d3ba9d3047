"""Two limbs that hold each other back from a tracked posture: one of them gives way.

Tracked limbs pass through each other, shown ones go around each other. When the tracked posture is free again, each
may hold the other on the wrong side, and no small motion of both brings them nearer. With a lower weight of one limb
the other pushes it aside.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.geometry.proximity import PENETRATION, Contacts
from wholebody.methods.ccd.resolver import chains_of
from wholebody.scene.scene import Scene
from wholebody.scene.workspace import Workspace


class Entanglement:
    """Looks whether two limbs hold each other, and which gives way; `largest_motion` (nv,) in a frame."""

    def __init__(self, scene: Scene, workspace: Workspace, largest_motion: Array) -> None:
        self._model, self._workspace, self._largest_motion = scene.model, workspace, largest_motion
        limb_of = np.full(scene.model.njoints, -1)
        self._dofs: list[Array] = []
        for number, (joints, _) in enumerate(chains_of(scene.figure).values()):
            limb_of[joints] = number
            spans = [(scene.model.idx_vs[joint], scene.model.nvs[joint]) for joint in joints]  # none of a lone root
            self._dofs.append(np.array([at for first, nv in spans for at in range(first, first + nv)], dtype=np.intp))
        self._limb = limb_of[workspace.table.joint]
        self._holding: tuple[int, int] | None = None
        self._giving, self._frames = 0, 0

    def weights(self, shown: Array, tracked: Array) -> Array:
        """(nv,) factors of the weights for a frame from the posture `shown` towards `tracked`, both (nq,)."""
        factors = np.ones(self._model.nv)
        if self._holding is not None and self._free(tracked):
            away = np.abs(pin.difference(self._model, shown, tracked))
            if not self._frames:  # the limb that is nearer to where it belongs has less to lose
                self._giving = int(np.argmin([away[self._dofs[limb]].max() for limb in self._holding]))
            elif not self._frames % 10:  # frames after which the other limb gives way instead
                self._giving = 1 - self._giving
            self._frames += 1
            # Weight of a limb that gives way, relative to the others. Damping slows it down in
            # proportion: with 0.01 it comes back in a second only after it was pushed aside.
            factors[self._dofs[self._holding[self._giving]]] = 0.1
        else:
            self._frames = 0
        return factors

    def update(self, before: Array, shown: Array, tracked: Array, contacts: Contacts) -> None:
        """Look at a frame that led from `before` to `shown`, at which the contacts touch; all postures are (nq,)."""
        pairs = self._limb[contacts.pair]
        pairs = pairs[(pairs >= 0).all(axis=1) & (pairs[:, 0] != pairs[:, 1])]
        if not len(pairs):
            self._holding = None
            return
        pair = (int(pairs[0, 0]), int(pairs[0, 1]))
        if self._frames and self._holding is not None and set(pair) == set(self._holding):
            return
        self._frames = 0
        dofs = np.concatenate([self._dofs[limb] for limb in pair])
        was, now = (np.abs(pin.difference(self._model, q, tracked))[dofs] for q in (before, shown))
        possible = np.minimum(was, self._largest_motion[dofs]).max()
        # distance of a degree of freedom from its tracked value, radians and metres, below which nothing
        # holds it back: the clearance keeps it off by less
        # Share of the possible approach of a frame below which limbs in contact hold each other. More lets
        # limbs give way that only slide along each other.
        held = now.max() > 0.05 and was.max() - now.max() < 0.2 * possible
        self._holding = pair if held else None

    def _free(self, tracked: Array) -> bool:
        return not len(self._workspace.near(tracked, -PENETRATION).distance)
