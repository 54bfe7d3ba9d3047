"""Two trees of motions that grow towards each other: RRT-Connect (Kuffner and LaValle 2000)."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.planning.tracked_motions import LocalPlanner, TrackedMotions

GEODESICS = 100  # samples that geodesics alone lead to; more = shorter paths, later where these find none


class Tree:
    """Postures that free motions join to its roots."""

    def __init__(self, model: pin.Model, origin: Array, shares: Array) -> None:
        """Take the posture (nq,) from which differences count, and (nv,) weights of these in the distance of two."""
        self._model, self._origin, self._shares = model, origin, shares
        self.postures: list[Array] = []
        self._parents: list[int] = []
        self.grown = 0  # how many postures it has beyond its roots
        self._places = np.zeros((64, model.nv))

    def add(self, q: Array, parent: int = -1) -> int:
        """Join a posture (nq,) to one of the tree, or make it a root; return its number."""
        number = len(self.postures)
        if number == len(self._places):
            self._places = np.concatenate([self._places, np.zeros_like(self._places)])
        self._places[number] = self._place(q)
        self.postures.append(q)
        self._parents.append(parent)
        self.grown += parent >= 0
        return number

    def nearest(self, q: Array) -> int:
        """The number of the posture that is nearest to q (nq,)."""
        apart = self._places[: len(self.postures)] - self._place(q)
        return int(np.argmin(np.einsum("ij,ij->i", apart, apart)))

    def _place(self, q: Array) -> Array:
        return np.asarray(self._shares * pin.difference(self._model, self._origin, q))

    def path(self, number: int) -> list[Array]:
        """Postures from a root to one of the tree."""
        found = []
        while number >= 0:
            found.append(self.postures[number])
            number = self._parents[number]
        return found[::-1]


class RRTConnect:
    """A tree from the start and one from the ends, which `local` lets grow, and `slides` where that is blocked at once.

    So branches towards samples go along things where no straight ones leave (as by retraction, Zhang and Manocha 2008):
    a root is pulled to its place in a sample, and all else gives way, which leads out of narrow places. Paths
    without steps are shorter.
    """

    def __init__(
        self, local: LocalPlanner, slides: TrackedMotions | None, model: pin.Model, start: Array, every: int
    ) -> None:  # fmt: skip
        """Take the posture (nq,) at which the motion begins; `every` how many samples steps are tried once."""
        self._local, self._slides, self._every = local, slides, every
        self._trees = [Tree(model, start, local.shares), Tree(model, start, local.shares)]
        self._trees[0].add(start)
        self.samples = 0  # how many they were extended towards

    def add_end(self, end: Array) -> None:
        """Add a posture (nq,) at which the motion may end."""
        self._trees[1].add(end)

    def grow(self, sample: Array) -> list[Array] | None:
        """Extend the smaller tree to a sample (nq,), the other to what was reached; a path where they meet."""
        # a tree in a narrow place, out of reach of most samples, has them all till it is out
        self.samples += 1
        here = int(self._trees[1].grown < self._trees[0].grown)
        there = 1 - here
        stepped = self.samples > GEODESICS and self.samples % self._every == 0
        number, _ = self._extend(self._trees[here], sample, self._slides if stepped else None)
        if number is None:
            return None
        # steps towards what is behind a thing end at it, and cost as much as ten geodesics
        other, met = self._extend(self._trees[there], self._trees[here].postures[number], None)
        if not met or other is None:
            return None
        branches = {here: self._trees[here].path(number), there: self._trees[there].path(other)}
        return [*branches[0], *branches[1][-2::-1]]

    def _extend(self, tree: Tree, target: Array, slides: TrackedMotions | None) -> tuple[int | None, bool]:
        """Add the motion from the nearest posture towards a target; the last of it, and whether it is there."""
        number = tree.nearest(target)
        motion, met = self._local.towards(tree.postures[number], target)
        if not (motion or met) and slides is not None:
            motion = slides.pulled(tree.postures[number], target)
        for q in motion:
            number = tree.add(q, number)
        return (number if motion or met else None), met
