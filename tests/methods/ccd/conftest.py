"""Random postures within limits, and what every shown posture must be."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.methods.ccd.guards import Kept, guards
from wholebody.methods.ccd.limbs import Limbs


@pytest.fixture(scope="session")
def avatar() -> wb.Figure:
    return wb.load("avatar")


def _random_joints(figure: wb.Figure, names: Any, rng: np.random.Generator, q: Any = None) -> Any:
    """A posture whose named joints are anywhere within their limits."""
    values = {}
    for name in names:
        place = figure.model.joints[figure.joint_id(name)].idx_q
        low, high = figure.model.lowerPositionLimit[place], figure.model.upperPositionLimit[place]
        values[name] = float(rng.uniform(max(low, -np.pi), min(high, np.pi)))
    return figure.with_joints(figure.neutral if q is None else q, values)


@pytest.fixture(scope="session")
def random_joints() -> Callable[..., Any]:
    """Return a function: figure, joint names, generator -> posture (nq,)."""
    return _random_joints


@pytest.fixture(scope="session")
def deepest(least_distance: Callable[..., float]) -> Callable[..., float]:
    """Return a function: scene, posture -> deepest overlap, metres."""
    return lambda scene, q: max(0.0, -least_distance(scene, q))


@cache
def _data(figure: wb.Figure) -> Any:
    """Pinocchio's data of a figure: to make them takes longer than to use them."""
    return figure.model.createData()


def _outside(figure: wb.Figure, q: Any) -> float:
    """How far the limb that is farthest out of its reach cone is out, radians."""
    data = _data(figure)
    pin.framesForwardKinematics(figure.model, data, q)
    worst = 0.0
    for cone in figure.cones.values():
        turn = data.oMf[figure.frame_id(cone.reference)].rotation
        direction = turn.T @ data.oMf[figure.frame_id(cone.limb)].rotation @ cone.axis
        worst = max(worst, -cone.cone.signed_angle(direction)[0])
    return worst


@pytest.fixture(scope="session")
def outside() -> Callable[..., float]:
    """Return a function: figure, posture -> angle out of the reach cones, radians."""
    return _outside


@pytest.fixture(scope="session")
def brought_back(
    human: wb.Figure, random_joints: Callable[..., Any], outside: Callable[..., float]
) -> Callable[..., int]:
    """Return a function: joints, guards, by how much a posture is out [rad], postures -> how many of them were out.

    Limbs start at the neutral posture, take random ones, and are brought back by the guards.
    """

    def tried(names: Any, kept: Kept, out: Callable[[Any], float], count: int, rng: np.random.Generator) -> int:
        limbs = Limbs(human.model, map(human.joint_id, names))
        made, data, left = guards(human, limbs, kept), human.model.createData(), 0
        for _ in range(count):
            start, q = human.neutral, random_joints(human, names, rng)
            pin.forwardKinematics(human.model, data, start)
            limbs.read(start, data)
            limbs.forward()
            made.read(start, data)
            pin.forwardKinematics(human.model, data, q)
            limbs.read(q, data)
            limbs.forward()
            left += out(q) > 1e-6
            worst = max(out(q), outside(human, q))
            assert made.kept() == (worst == 0.0) or 0.0 < worst < 1e-9
            made.keep()
            assert made.kept()
            limbs.write(q)
            assert out(q) <= 1e-9
            assert outside(human, q) <= 1e-9
            assert human.within_limits(q)
        return left

    return tried


def _track(figure: wb.Figure, *postures: Any, frames: int = 40) -> list[Any]:
    """Postures from one to the next, smoothly."""
    shares = [t * t * (3.0 - 2.0 * t) for t in np.linspace(0.0, 1.0, frames)]
    return [np.asarray(pin.interpolate(figure.model, a, b, share)) for a, b in pairwise(postures) for share in shares]


@pytest.fixture(scope="session")
def track() -> Callable[..., list[Any]]:
    """Return a function: figure, postures -> a track through them."""
    return _track
