"""Measure: how shoulder girdle, lumbar spine and knees share the motion of arm, pelvis and hips."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence, Set
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from wholebody.base.arrays import Array, with_values
from wholebody.base.errors import InputError
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.scene.scene import Scene
from wholebody.tasks import inputs
from wholebody.tasks.base import filled
from wholebody.tasks.distance import SumOfSquares

LUMBAR_MOST, LUMBAR_RATE = math.radians(46.0), 2.5
"""Flexion of the lumbar spine while the pelvis tips forward: 46 degrees times tanh(2.5 sin(tilt)). Lumbar to hip motion
of 1.9, 0.9 and 0.4 in the three thirds of bending by 90 degrees (Esola et al. 1996, Spine 21(1)) is met to 3 degrees.
"""

CLAVICLE_WEIGHT, LUMBAR_WEIGHT = 100.0, 20.0
"""1/rad^2, beside an effort of 20 for the clavicle, which follows its arm by five sixths. That of the lumbar spine is
fitted to postures of people (`python -m tests.audits postures --fit`)."""


KNEE_SHARE, KNEE_ONSET, KNEE_WEIGHT = 0.9, 0.4, 25.0
"""Flexion of a knee by that f of its hip, ``0.9 (f + sqrt(f^2 + 0.4^2) - 0.4) / 2`` [rad], and its weight, 1/rad^2.

A man who bends down to the floor again and again and rises (recording 02_06 of the CMU Graphics Lab Motion Capture
Database, 559 frames) has knees of 28, 47, 68 and 89 degrees beyond those of standing at hips of 25, 45, 75 and 95; this
is 16, 32, 58 and 75. He squats more than most: people who lift as they like neither stoop with straight knees nor squat
(Davis et al. 2002, Occupational Ergonomics 3(2)), so the share, and the weight, are an ESTIMATE beside his."""

Style: TypeAlias = Literal["free", "stoop", "squat"]


class Sharing(NamedTuple):
    """How a style shares a bend; weights in 1/rad^2."""

    knee: float  # of the flexion of a hip
    knee_weight: float
    lumbar: float  # most of the lumbar spine, radians
    lumbar_weight: float


STYLES = {
    "free": Sharing(KNEE_SHARE, KNEE_WEIGHT, LUMBAR_MOST, LUMBAR_WEIGHT),
    "stoop": Sharing(0.0, 4.0 * KNEE_WEIGHT, LUMBAR_MOST, LUMBAR_WEIGHT),
    "squat": Sharing(1.5 * KNEE_SHARE, 4.0 * KNEE_WEIGHT, 0.5 * LUMBAR_MOST, 5.0 * LUMBAR_WEIGHT),
}
"""Who stoops keeps the knees as they are; who squats bends them by 118 degrees at hips of 100 and keeps the back. The
weights, ESTIMATES, make a style of what is only a tendency in who does as he likes."""


Three: TypeAlias = tuple[int, int, int]


class Elevation(NamedTuple):
    """A joint that follows the elevation e of a limb: its usual angle is ``most (1 - cos e) + rest``.

    With an onset o it follows the flexion f alone: ``most (f + sqrt(f^2 + o^2) - o) / 2 + rest``, which is about
    ``most f`` where f is much more than o, and does not change where the limb is bent back.
    """

    idx_q: Three  # the joint, flexion and abduction of the limb: places in the posture
    idx_v: Three  # the same in the tangent
    weight: float  # of the square, 1/rad^2
    most: float  # the share where the limb is level, radians; with an onset, radians for each of the flexion
    rest: float = 0.0  # what the joint has beyond its share at the start, radians
    onset: float = 0.0  # flexion about which the share begins, radians; zero for a share of the elevation


class Lumbar(NamedTuple):
    """The lumbar joints and the free root."""

    idx_q: Three  # their flexion: places in the posture
    idx_v: Three  # the same in the tangent
    root: tuple[int, int]  # of the root: its first place in the posture, and in the tangent
    rest: float = 0.0  # what they have beyond their share at the start, radians
    weight: float = LUMBAR_WEIGHT  # of the square, 1/rad^2
    most: float = LUMBAR_MOST  # of their share, radians


@dataclass(frozen=True, eq=False)
class Rhythm(SumOfSquares):
    """Squared distance of clavicles, lumbar spine and knees from their usual share of a motion [rad^2, weighted].

    ``100 sum (c - 13 deg (1 - cos e))^2 + 25 sum (k - k_0)^2 + 20 (l - l_0)^2``:

    - c is the elevation of a clavicle and e that of its arm in the clavicle (scapulohumeral rhythm);
    - k is the flexion of a knee beyond its share of the flexion f of its hip,
      ``0.9 (f + sqrt(f^2 + 0.4^2) - 0.4) / 2`` in radians, and k_0 the same at the start;
    - l is the flexion of the lumbar spine beyond its share of the tilt t of the pelvis, ``46 deg tanh(2.5 sin t)``, and
      l_0 the same at the start (lumbar-pelvic rhythm).

    A problem of a person has this measure by default, beside `Effort`. Another style is a choice of how to bend:
    ``measures=[wb.Effort(), wb.tasks.Rhythm(style="stoop")]`` keeps the knees as they are, "squat" bends them by 1.5
    times as much as "free" and keeps the back straighter.

    Attributes:
        weight: factor on the measure.
        style: how knees and hips share a bend: "free", "stoop" or "squat".
        girdles: clavicles with their arms, once resolved; those of each of several figures.
        knees: knees with their hips; they count where there is a lumbar spine.
        lumbar: the lumbar spine of each figure with a free root.

    Raises:
        InputError: a weight out of range, or in a problem a figure that is no person.

    Examples:
        >>> upright_back = wb.tasks.Rhythm(style="squat")
    """

    weight: inputs.Weight = 1.0
    style: Style = "free"
    girdles: tuple[Elevation, ...] = field(init=False, repr=False)
    knees: tuple[Elevation, ...] = field(init=False, repr=False)
    lumbar: tuple[Lumbar, ...] = field(init=False, repr=False)

    def resolve(self, scene: Scene, start: Array) -> Rhythm:
        """Find the joints, and what the lumbar spine has at the start."""
        girdles, knees, spines = inputs.once(scene, (Rhythm, self.style), partial(_parts, scene.figure, self.style))
        if not girdles and not spines:
            raise InputError("Rhythm: this figure has no clavicles and no lumbar spine; leave the measure out")
        at = start.tolist()  # a few numbers are read faster from a list
        knees = tuple([with_values(knee, rest=_beyond(at, knee)[0]) for knee in knees])
        lumbar = tuple([with_values(spine, rest=_bent(at, spine)[0]) for spine in spines])
        return filled(self, girdles=girdles, knees=knees, lumbar=lumbar)

    def of_arms(self, idx_v: Set[int]) -> Rhythm:
        """Itself, resolved, without the knees and the lumbar spine of those joints; clavicles still follow arms."""
        knees = tuple(knee for knee in self.knees if knee.idx_v[0] not in idx_v)
        lumbar = tuple(spine for spine in self.lumbar if spine.idx_v[0] not in idx_v)
        return filled(self, knees=knees, lumbar=lumbar)

    def squares(self, state: State) -> tuple[Array, Array]:
        """Residuals (k,) and their derivatives (k, nv): of each clavicle and knee, then of the lumbar spine."""
        parts: tuple[Any, ...] = (*self.girdles, *self.knees, *self.lumbar)
        residuals, rows, at = np.zeros(len(parts)), np.zeros((len(parts), state.model.nv)), state.q.tolist()
        for row, part in enumerate(parts):
            bends = isinstance(part, Lumbar)
            excess, slopes = _bent(at, part) if bends else _beyond(at, part)
            places = [*part.idx_v, part.root[1] + 4, part.root[1] + 5] if bends else list(part.idx_v)
            root = math.sqrt(part.weight)
            residuals[row], rows[row, places] = root * excess, root * np.array(slopes)
        return residuals, rows


def girdles_of(figure: Figure) -> tuple[Elevation, ...]:
    """The clavicles of a figure that has their arms too."""
    parts = ("clavicle_elevation", "shoulder_flexion", "shoulder_abduction")
    # Elevation of the clavicle where the arm is level, and twice that where it is overhead, radians: 13 degrees times 1
    # - cos(elevation), which stays within 4 degrees of 0.2 (elevation - 30 degrees). The scapula turns upward by 0.43
    # degrees for each of the arm in its socket (Braman et al. 2009, Journal of Shoulder and Elbow Surgery 18(6)), about
    # half of it at the inner end of the clavicle: ESTIMATE.
    return _elevations(figure, parts, CLAVICLE_WEIGHT, math.radians(13.0), 0.0, figure.bodies)


def _parts(figure: Figure, style: str) -> tuple[tuple[Elevation, ...], tuple[Elevation, ...], tuple[Lumbar, ...]]:
    """Clavicles, knees and lumbar spines in a style, at rest at zero."""
    spines = {body: spine for body in figure.bodies for spine in _lumbar(figure, body)}
    names = ("knee_flexion", "hip_flexion", "hip_abduction")
    own = STYLES[style]
    knees = _elevations(figure, names, own.knee_weight, own.knee, KNEE_ONSET, spines)
    lumbar = (with_values(spine, most=own.lumbar, weight=own.lumbar_weight) for spine in spines.values())
    return girdles_of(figure), knees, tuple(lumbar)


def _elevations(
    figure: Figure, parts: tuple[str, str, str], weight: float, most: float, onset: float, bodies: Iterable[str]
) -> tuple[Elevation, ...]:
    sides = ([f"{body}{side}_{part}" for part in parts] for body in bodies for side in ("left", "right"))
    found = [Elevation(*_places(figure, names), weight, most, onset=onset) for names in sides if _has(figure, names)]
    return tuple(found)


def _has(figure: Figure, names: Sequence[str]) -> bool:
    return set(names) <= set(figure.joints)


def _places(figure: Figure, names: Sequence[str]) -> tuple[Three, Three]:
    """Places of three joints in the posture, and in the tangent."""
    a, b, c = (figure.model.joints[figure.joint_id(name)] for name in names)
    return (a.idx_q, b.idx_q, c.idx_q), (a.idx_v, b.idx_v, c.idx_v)


def _lumbar(figure: Figure, body: str) -> tuple[Lumbar, ...]:
    """The lumbar spine of the figure whose names begin with `body`; none without it or without a free root."""
    names = [f"{body}spine{level}_flexion" for level in (1, 2, 3)]
    if f"{body}root" not in figure.roots or not _has(figure, names):
        return ()
    root = figure.model.joints[figure.roots[f"{body}root"]]
    return (Lumbar(*_places(figure, names), (int(root.idx_q), int(root.idx_v))),)


def _beyond(q: Sequence[float], part: Elevation) -> tuple[float, tuple[float, float, float]]:
    """Angle of a joint beyond its share [rad], and its slopes by the joint, flexion and abduction."""
    angle, flexion, abduction = [q[place] for place in part.idx_q]
    if part.onset:
        root = math.hypot(flexion, part.onset)
        share, slope = 0.5 * (flexion + root - part.onset), 0.5 * (1.0 + flexion / root)
        return angle - part.most * share - part.rest, (1.0, -part.most * slope, 0.0)
    height = math.cos(flexion) * math.cos(abduction)
    return angle - part.most * (1.0 - height) - part.rest, (
        1.0,
        -part.most * math.sin(flexion) * math.cos(abduction),
        -part.most * math.cos(flexion) * math.sin(abduction),
    )


def _bent(q: Sequence[float], lumbar: Lumbar) -> tuple[float, tuple[float, ...]]:
    """Flexion of the lumbar spine beyond its share [rad], its slopes by its joints and turns of the root about y, z."""
    x, y, z, w = q[lumbar.root[0] + 3 : lumbar.root[0] + 7]
    forward, left, up = 2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)
    share = math.tanh(-LUMBAR_RATE * forward)  # the root's x axis dips by sin(tilt) = -forward, the height of that axis
    steep = lumbar.most * LUMBAR_RATE * (1.0 - share * share)
    flexion = sum([q[place] for place in lumbar.idx_q])
    return flexion - lumbar.most * share - lumbar.rest, (1.0, 1.0, 1.0, -steep * up, steep * left)
