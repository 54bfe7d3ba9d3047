"""What a problem of a person has without being told: ranges of motion, balance, and its measures."""

from __future__ import annotations

from collections.abc import Sequence, Set

import numpy as np

from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.figures.state import State
from wholebody.tasks import inputs
from wholebody.tasks.balance import STEADY, Balance, convex_polygon, least_width, standing_points
from wholebody.tasks.base import Bound, Constraint, Goal, Measure, Surroundings
from wholebody.tasks.bounds import Freeze
from wholebody.tasks.distance import Effort
from wholebody.tasks.frame import Hold
from wholebody.tasks.range_of_motion import RangeOfMotion, ReachCones
from wholebody.tasks.rhythm import Rhythm, girdles_of
from wholebody.tasks.sit import Sit
from wholebody.tasks.stand import Stand
from wholebody.tasks.touch import Lean

FEET = ("left_foot", "right_foot")

_effort = Effort()


def default_measures(scene: Surroundings, start: Array, *, ranges: bool) -> tuple[Measure, ...]:
    """`Effort`, and for a person `Rhythm` beside it, resolved."""
    person = ranges and bool(scene.figure.ranges) and bool(girdles_of(scene.figure))
    effort = _effort.resolve(scene, start)
    return (effort, Rhythm().resolve(scene, start)) if person else (effort,)


def default_constraints(
    scene: Surroundings, start: Array, known: Set[type], *, ranges: bool, balance: bool, required: bool
) -> tuple[tuple[Constraint, ...], str]:
    """What is added to the constraints that were stated; a stated term takes the place of the default of its class.

    A person who stands at the start on a line, such as the tips of two toes, keeps no balance that is measured by an
    area. The default is left out there, unless it is required.
    """
    figure = scene.figure
    found: list[Constraint] = []
    if ranges and figure.ranges and RangeOfMotion not in known:
        found.append(RangeOfMotion().resolve(scene, start))
    if ranges and figure.ranges and figure.cones and ReachCones not in known:
        found.append(ReachCones().resolve(scene, start))
    if not balance or known & {Balance, Stand}:
        return tuple(found), ""
    try:
        corners = convex_polygon(standing_points(scene, start, FEET)[:, :2])
        inputs.check_mass(scene, "Balance")
    except InputError as error:
        if required:
            raise
        return tuple(
            found
        ), f"the default Balance is left out: {str(error).removeprefix('Balance: ').partition(';')[0]}"
    return (*found, Balance(margin=STEADY * least_width(corners)).on_polygon(corners, scene)), ""


def stands(
    scene: Surroundings, state: State, stated: Sequence[Constraint], bounds: Sequence[Bound], goals: Sequence[Goal]
) -> bool:
    """Whether a person stands: both feet are held where they are at the start, and nothing else carries it."""
    figure = scene.figure
    if figure.root != "free" or not figure.ranges or not set(FEET) <= set(figure.segments):
        return False
    if any(isinstance(bound, Freeze) and "root" in figure.joint_names(bound.joints) for bound in bounds):
        return False
    if any(isinstance(term, (Sit, Lean)) for term in (*stated, *goals)):
        return False
    feet = {int(scene.model.frames[figure.frame_id(foot)].parentJoint) for foot in FEET}
    holds = [term for term in stated if isinstance(term, Hold) and not term.residual.base.frame]
    if {term.residual.place.joint for term in holds} != feet:
        return False
    # m, rad: a foot held this near to its place at the start stands where the support polygon is computed.
    return all(np.abs(term.value(state)).max() <= 1e-3 for term in holds)
