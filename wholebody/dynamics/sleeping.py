"""Bodies that lie still sleep: they are left out of programs until something touches them."""

from __future__ import annotations

import numpy as np

from wholebody.arrays import Indices
from wholebody.dynamics import contact_kernel
from wholebody.dynamics.bodies_state import BodiesState
from wholebody.geometry.proximity import Contacts

STILL = 5e-3  # m/s of every point of a body: slower bodies may sleep
SLEEP_AFTER = 0.5  # s that all bodies of an island are so slow before they sleep
TOUCHING = 1e-3  # m: nearer bodies wake each other


class Sleepers:
    """Which bodies sleep. A body sleeps and wakes together with all that touch each other."""

    def __init__(self, state: BodiesState, together: Indices) -> None:
        """Let all be awake; `together` (k, 2) are bodies that joints hold together."""
        self._state, self._together = state, together
        self._slow_for = np.zeros(len(state.position))
        self._island = np.arange(len(state.position))

    @property
    def count(self) -> int:
        """How many bodies sleep."""
        return int((self._state.pieces.dynamic & ~self._state.moving).sum())

    def _touching(self, near: Contacts) -> Indices:
        """Bodies (k, 2) that touch, or that a joint holds together."""
        touching: Indices = self._state.pieces.body[near.pair[near.distance < TOUCHING]]
        return np.concatenate([touching, self._together])

    def update(self, near: Contacts, dt: float) -> None:
        """Let islands sleep that have been slow for long; `near` are the pairs at the end of a frame of `dt` s."""
        state = self._state
        speed = np.linalg.norm(state.velocity, axis=1) + np.linalg.norm(state.spin, axis=1) * state.pieces.lever
        slow = speed < STILL
        self._slow_for = np.where(slow, self._slow_for + dt, 0.0)
        if not (self._slow_for[state.moving] >= SLEEP_AFTER).any():
            return
        body = self._touching(near)
        island = np.empty(len(state.position), dtype=np.intp)
        contact_kernel.join(np.arange(len(body)), body, state.pieces.dynamic, island)
        least = np.full(len(island), np.inf)
        waiting = np.where(state.pieces.dynamic, np.where(state.moving, self._slow_for, np.inf), np.inf)
        np.minimum.at(least, island, waiting)
        falling_asleep = state.moving & (least[island] >= SLEEP_AFTER)
        state.moving &= ~falling_asleep
        state.velocity[falling_asleep] = state.spin[falling_asleep] = 0.0
        self._island[falling_asleep] = island[falling_asleep]

    def wake(self, near: Contacts) -> bool:
        """Wake what is touched by a body that moves; whether anything woke."""
        state, woke = self._state, False
        asleep = state.pieces.dynamic & ~state.moving
        if not asleep.any():
            return False
        body = self._touching(near)
        speed = np.linalg.norm(state.velocity, axis=1) + np.linalg.norm(state.spin, axis=1) * state.pieces.lever
        pushing = (speed > STILL) & (state.moving | state.given)
        for one, other in ((0, 1), (1, 0)):
            touched = body[pushing[body[:, one]] & asleep[body[:, other]], other]
            if len(touched):
                woken = asleep & np.isin(self._island, self._island[touched])
                state.moving |= woken
                self._slow_for[woken] = 0.0
                woke = True
        return woke
