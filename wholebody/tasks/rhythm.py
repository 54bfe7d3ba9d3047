"""Measure: how shoulder girdle and lumbar spine share the motion of arm and pelvis."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from wholebody.arrays import Array
from wholebody.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.records import with_values
from wholebody.tasks import inputs
from wholebody.tasks.base import Measure, Surroundings, filled
from wholebody.tasks.distance import LEAST_CURVATURE

CLAVICLE_RISE = math.radians(13.0)
"""Elevation of the clavicle where the arm is level, and twice that where it is overhead, radians: 13 degrees times
1 - cos(elevation), which stays within 4 degrees of 0.2 (elevation - 30 degrees). The scapula turns upward by 0.43
degrees for each of the arm in its socket (Braman et al. 2009, Journal of Shoulder and Elbow Surgery 18(6)), about half
of it at the inner end of the clavicle: ESTIMATE."""

LUMBAR_MOST, LUMBAR_RATE = math.radians(46.0), 2.5
"""Flexion of the lumbar spine while the pelvis tips forward: 46 degrees times tanh(2.5 sin(tilt)). Lumbar to hip motion
of 1.9, 0.9 and 0.4 in the three thirds of bending by 90 degrees (Esola et al. 1996, Spine 21(1)) is met to 3 degrees.
"""

CLAVICLE_WEIGHT, LUMBAR_WEIGHT = 100.0, 10.0
"""1/rad^2, beside an effort of 20 for clavicle and spine: the clavicle follows its arm by five sixths, and the lumbar
spine of a bent person is free to do what a goal needs."""


class Girdle(NamedTuple):
    """A clavicle and its arm.

    Attributes:
        idx_q: elevation of the clavicle, flexion and abduction of the shoulder: places in the posture.
        idx_v: the same in the tangent.
    """

    idx_q: tuple[int, int, int]
    idx_v: tuple[int, int, int]


class Lumbar(NamedTuple):
    """The lumbar joints and the free root.

    Attributes:
        idx_q: their flexion: places in the posture.
        idx_v: the same in the tangent.
        rest: what they have beyond their share at the start, radians.
    """

    idx_q: tuple[int, int, int]
    idx_v: tuple[int, int, int]
    rest: float


@dataclass(frozen=True, eq=False)
class Rhythm(Measure):
    """Squared distance of clavicles and lumbar spine from their usual share of a motion [rad^2, weighted].

    ``100 sum (c - 13 deg (1 - cos e))^2 + 10 (l - l_0)^2``: c is the elevation of a clavicle and e that of its arm in
    the clavicle (scapulohumeral rhythm); l is the flexion of the lumbar spine beyond its share of the tilt t of the
    pelvis, ``46 deg tanh(2.5 sin t)``, and l_0 the same at the start (lumbar-pelvic rhythm).

    A problem of a person has this measure by default, beside `Effort`.

    Attributes:
        weight: factor on the measure.
        girdles: clavicles with their arms, once resolved.
        lumbar: the lumbar spine, once resolved; None without a free root.
    """

    weight: float = 1.0
    girdles: tuple[Girdle, ...] = field(init=False, repr=False)
    lumbar: Lumbar | None = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the value."""
        object.__setattr__(self, "weight", inputs.weight(self.weight, "Rhythm: weight"))

    def resolve(self, scene: Surroundings, start: Array) -> Rhythm:
        """Find the joints, and what the lumbar spine has at the start.

        Raises:
            InputError: the figure has neither a clavicle with its arm nor a lumbar spine on a free root.
        """
        figure = scene.figure
        girdles, lumbar = girdles_of(figure), _lumbar(figure, start)
        if not girdles and lumbar is None:
            raise InputError("Rhythm: this figure has no clavicles and no lumbar spine; leave the measure out")
        return filled(self, girdles=girdles, lumbar=lumbar)

    def value(self, state: State) -> float:
        """The measure."""
        q = state.q
        total = sum(CLAVICLE_WEIGHT * _beyond(q, girdle)[0] ** 2 for girdle in self.girdles)
        if self.lumbar is not None:
            total += LUMBAR_WEIGHT * _bent(q, self.lumbar)[0] ** 2
        return float(total)

    def gradient(self, state: State) -> Array:
        """(nv,) derivative [1/rad]."""
        result = np.zeros(state.model.nv)
        for weight, excess, places, slopes in self.parts(state.q):
            result[places] += 2.0 * weight * excess * slopes
        return result

    def curvature(self, state: State) -> Array:
        """(nv,) row sums of the absolute second derivative of the squares, which bound it [1/rad^2]."""
        result = np.full(state.model.nv, LEAST_CURVATURE)
        for weight, _, places, slopes in self.parts(state.q):
            steep = np.abs(slopes)
            result[places] += 2.0 * weight * steep * steep.sum()
        return result

    def parts(self, q: Array) -> list[tuple[float, float, list[int], Array]]:
        """Weight, excess, places in the tangent and slopes there of each square."""
        found: list[tuple[float, float, list[int], Array]] = []
        for girdle in self.girdles:
            excess, slopes = _beyond(q, girdle)
            found.append((CLAVICLE_WEIGHT, excess, list(girdle.idx_v), np.array(slopes)))
        if self.lumbar is not None:
            excess, turn = _bent(q, self.lumbar)
            found.append((LUMBAR_WEIGHT, excess, [*self.lumbar.idx_v, 4, 5], np.array([1.0, 1.0, 1.0, *turn])))
        return found


def girdles_of(figure: Figure) -> tuple[Girdle, ...]:
    """The clavicles of a figure that has their arms too."""
    found = []
    for side in ("left", "right"):
        names = [f"{side}_{part}" for part in ("clavicle_elevation", "shoulder_flexion", "shoulder_abduction")]
        if all(name in figure.joints for name in names):
            joints = [figure.model.joints[figure.joint_id(name)] for name in names]
            a, b, c = joints
            found.append(Girdle((a.idx_q, b.idx_q, c.idx_q), (a.idx_v, b.idx_v, c.idx_v)))
    return tuple(found)


def _lumbar(figure: Figure, start: Array) -> Lumbar | None:
    names = [f"spine{level}_flexion" for level in (1, 2, 3)]
    if figure.root != "free" or not all(name in figure.joints for name in names):
        return None
    a, b, c = (figure.model.joints[figure.joint_id(name)] for name in names)
    part = Lumbar((a.idx_q, b.idx_q, c.idx_q), (a.idx_v, b.idx_v, c.idx_v), 0.0)
    return with_values(part, rest=_bent(start, part)[0])


def _beyond(q: Array, girdle: Girdle) -> tuple[float, tuple[float, float, float]]:
    """Elevation of a clavicle beyond its share [rad], and its slopes by clavicle, flexion and abduction."""
    clavicle, flexion, abduction = (float(q[place]) for place in girdle.idx_q)
    height = math.cos(flexion) * math.cos(abduction)
    return clavicle - CLAVICLE_RISE * (1.0 - height), (
        1.0,
        -CLAVICLE_RISE * math.sin(flexion) * math.cos(abduction),
        -CLAVICLE_RISE * math.cos(flexion) * math.sin(abduction),
    )


def _bent(q: Array, lumbar: Lumbar) -> tuple[float, tuple[float, float]]:
    """Flexion of the lumbar spine beyond its share [rad], and its slopes by turns of the root about its y and z."""
    x, y, z, w = (float(value) for value in q[3:7])
    forward, left, up = 2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)
    # The root's x axis dips by sin(tilt) = -forward, the height of that axis.
    share = math.tanh(-LUMBAR_RATE * forward)
    steep = LUMBAR_MOST * LUMBAR_RATE * (1.0 - share * share)
    flexion = sum(float(q[place]) for place in lumbar.idx_q)
    return flexion - LUMBAR_MOST * share - lumbar.rest, (-steep * up, steep * left)
