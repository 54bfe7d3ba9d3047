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


def _track(figure: wb.Figure, *postures: Any, frames: int = 40) -> list[Any]:
    """Postures from one to the next, smoothly."""
    shares = [t * t * (3.0 - 2.0 * t) for t in np.linspace(0.0, 1.0, frames)]
    return [np.asarray(pin.interpolate(figure.model, a, b, share)) for a, b in pairwise(postures) for share in shares]


@pytest.fixture(scope="session")
def track() -> Callable[..., list[Any]]:
    """Return a function: figure, postures -> a track through them."""
    return _track
