"""When enough starts were tried: the rule of Boender and Rinnooy Kan, by its own formula and by simulation."""

from __future__ import annotations

import numpy as np
import pytest

from wholebody.methods.starts import Minima


def descents_needed(values) -> int:
    minima = Minima()
    for count, value in enumerate(values, 1):
        minima.add(value, True)
        if minima.complete:
            return count
    return -1


@pytest.mark.parametrize(("known", "needed"), [(1, 7), (2, 16), (3, 29)])
def test_descents_that_it_takes_to_take_all_minima_for_found(known: int, needed: int) -> None:
    """From w (n - 1) / (n - w - 2) <= w + 1/2, solved for n by hand."""
    assert descents_needed(1.0 + k % known for k in range(100)) == needed


def test_ends_that_did_not_converge_stand_for_minima_not_yet_seen() -> None:
    minima = Minima()
    for k in range(40):
        minima.add(1.0 + k, False)
    assert not minima.complete


def test_the_best_of_several_minima_is_seldom_missed() -> None:
    """Basins of random sizes: where the rule ends the search, the least one was seen in most of 400 runs."""
    rng = np.random.default_rng(0)
    missed = 0
    for _ in range(400):
        sizes = rng.dirichlet(np.ones(int(rng.integers(1, 6))))
        minima, seen = Minima(), set()
        while not minima.complete and len(seen) < 1000:
            end = int(rng.choice(len(sizes), p=sizes))
            seen.add(end)
            minima.add(1.0 + end, True)
        missed += 0 not in seen
    assert missed < 40
