"""Bodies that lie still sleep: they are left out of programs until something touches them, or what they touch moves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wholebody.base.arrays import Array, Indices, Mask, cross
from wholebody.dynamics import solve_kernel
from wholebody.dynamics.bodies_state import BodiesState
from wholebody.dynamics.pieces import ContactFinder
from wholebody.geometry.proximity import Contacts

STILL, AFTER = 5e-3, 0.5  # m/s of every point of a body, and s that an island is so slow before it sleeps
TOUCHING = 1e-3  # m: nearer bodies wake each other


class Sleepers:
    """Which bodies sleep: together with all that touch each other, until what touches them moves."""

    def __init__(self, state: BodiesState, together: Indices) -> None:
        """Let all be awake; `together` (k, 2) are bodies that joints hold together."""
        self._state, self._together = state, together
        self._slow_for = np.zeros(len(state.bodies.position))
        self._island = np.arange(len(state.bodies.position))
        self._touched: Indices = np.zeros((0, 2), dtype=np.intp)  # a sleeper, and what touches it
        self._position, self._rotation = np.zeros((0, 3)), np.zeros((0, 3, 3))  # of the latter, when the former slept

    @property
    def count(self) -> int:
        """How many bodies sleep."""
        return int(self._asleep().sum())

    def way_back(self) -> Callable[[], None]:
        """A function that takes back what happens from now on."""
        kept = self._slow_for.copy(), self._island.copy(), self._touched, self._position, self._rotation

        def back() -> None:
            self._slow_for, self._island = kept[0].copy(), kept[1].copy()
            self._touched, self._position, self._rotation = kept[2:]

        return back

    def _asleep(self) -> Mask:
        return self._state.pieces.dynamic & ~self._state.bodies.moving

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
        if not (self._slow_for[state.bodies.moving] >= AFTER).any():
            return
        body = self._touching(near)
        island = np.empty(len(state.bodies.position), dtype=np.intp)
        solve_kernel.join(np.arange(len(body)), body, state.pieces.dynamic, island)
        least = np.full(len(island), np.inf)
        waiting = np.where(state.pieces.dynamic, np.where(state.bodies.moving, self._slow_for, np.inf), np.inf)
        np.minimum.at(least, island, waiting)
        falling_asleep = state.bodies.moving & (least[island] >= AFTER)
        state.bodies.moving[falling_asleep] = False
        state.velocity[falling_asleep] = state.spin[falling_asleep] = 0.0
        self._island[falling_asleep] = island[falling_asleep]
        self._remember(body, falling_asleep)

    def _remember(self, body: Indices, falling_asleep: Mask) -> None:
        """Keep where everything is that touches bodies which fall asleep; `body` (k, 2) touch each other."""
        state = self._state
        both = np.concatenate([body, body[:, ::-1]])
        both = np.unique(both[falling_asleep[both[:, 0]] & ~self._asleep()[both[:, 1]]], axis=0)
        self._touched = np.concatenate([self._touched, both])
        self._position = np.concatenate([self._position, state.bodies.position[both[:, 1]]])
        self._rotation = np.concatenate([self._rotation, state.bodies.rotation[both[:, 1]]])

    def wake(self, near: Contacts, came: Mask | None = None) -> bool:
        """Wake what is touched by a body that moves, or that `came` (n,) where it is; whether anything woke."""
        state, asleep = self._state, self._asleep()
        active = state.active if came is None else state.active | came
        if not (asleep.any() and active.any()):
            return False
        both = self._touching(near)
        both = np.concatenate([both, both[:, ::-1]])
        both = both[asleep[both[:, 0]] & active[both[:, 1]]]
        touched: Indices = self._touched[self._moved() > 3e-5, 0]  # m: less than the gap at which bodies rest
        if len(both):  # few steps have any, and the search takes longer than all else here
            known = np.isin(self._keys(both), self._keys(self._touched))
            touched = np.concatenate([both[~known | (self._speeds(both) > STILL), 0], touched])
        if not len(touched):
            return False
        waking = asleep & np.isin(self._island, self._island[touched])
        state.bodies.moving[waking] = True
        self._slow_for[waking] = 0.0
        self._forget()
        return True

    def wake_where_put(self, finder: ContactFinder, before: tuple[Array, Array, Array]) -> None:
        """Wake what is touched or was left by bodies that were put elsewhere than in `before`, of `state.copies`."""
        state = self._state
        put = (state.bodies.position != before[0]).any(axis=1) | (state.bodies.rotation != before[1]).any(axis=(1, 2))
        if put.any() and self.count:
            margin = np.full(len(put), 0.5 * TOUCHING)
            self.wake(finder.near(state.bodies.position, state.bodies.rotation, margin, put), put)

    def _forget(self) -> None:
        kept = self._asleep()[self._touched[:, 0]]
        if not kept.all():
            self._touched, self._position, self._rotation = (
                self._touched[kept], self._position[kept], self._rotation[kept]
            )  # fmt: skip

    def _keys(self, both: Indices) -> Indices:
        return both[:, 0] * len(self._slow_for) + both[:, 1]

    def _speeds(self, both: Indices) -> Array:
        """Greatest speed (k,), within the first body of each pair, that the second one has as a rigid body, m/s."""
        state, own, other = self._state, both[:, 0], both[:, 1]
        arm = state.bodies.position[own] - state.bodies.position[other]
        at_centre = state.velocity[other] + cross(state.spin[other], arm)
        spin = np.linalg.norm(state.spin[other], axis=1)
        return np.asarray(np.linalg.norm(at_centre, axis=1) + spin * state.pieces.lever[own])

    def _moved(self) -> Array:
        """Most by which what touches each sleeper (k,) is elsewhere, within the sleeper, than when that fell asleep."""
        state, own, other = self._state, self._touched[:, 0], self._touched[:, 1]
        turn = state.bodies.rotation[other] @ self._rotation.transpose(0, 2, 1)
        arm = state.bodies.position[own] - self._position
        at_centre = state.bodies.position[other] + np.einsum("kij,kj->ki", turn, arm) - state.bodies.position[own]
        # the chord of a turn over a lever is the spectral norm of what it changes, Frobenius's over the root of two
        turned = np.linalg.norm(turn - np.eye(3), axis=(1, 2)) / np.sqrt(2.0)
        return np.asarray(np.linalg.norm(at_centre, axis=1) + turned * state.pieces.lever[own])
