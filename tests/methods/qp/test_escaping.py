"""The end of a frame beside a thing that came too fast: a point that has to leave a disc within what bounds allow."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wholebody.methods.qp.settings import ESCAPE
from wholebody.methods.qp.tracking import ProjectionRows, free_end

RADIUS = 0.1


def point() -> pin.Model:
    """A point in the plane."""
    model = pin.Model()
    along = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    model.addJoint(along, pin.JointModelPY(), pin.SE3.Identity(), "y")
    return model


def around(begun: np.ndarray, most: np.ndarray, wall: float = np.inf):
    """What a point sees around it: the disc, a wall at some x, and what is left of the way that it may go."""

    def look(q: np.ndarray) -> ProjectionRows:
        far = float(np.linalg.norm(q))
        rows, room = np.array([q / far, [-1.0, 0.0]]), np.array([far - RADIUS - ESCAPE.gap, min(wall, 9.0) - q[0]])
        return ProjectionRows(max(RADIUS - far, 0.0), rows, room, np.array([begun - most, begun + most]) - q)

    return look


def test_it_goes_the_way_that_bounds_allow_and_no_farther() -> None:
    begun, most = np.array([0.05, 0.02]), np.array([0.02, 0.09])  # along x it would be out after 48 mm, and may go 20
    found = free_end(point(), begun, 1e-6, around(begun, most))
    assert found is not None
    assert np.linalg.norm(found) >= RADIUS - 1e-6
    assert (np.abs(found - begun) <= most + 1e-12).all()


def test_it_finds_the_far_side_where_the_near_one_is_barred() -> None:
    begun, most = np.array([0.02, 0.0]), np.array([0.2, 0.01])
    found = free_end(point(), begun, 1e-6, around(begun, most, wall=0.05))
    assert found is not None
    assert found[0] < -0.09


@pytest.mark.parametrize("most", [0.0, 0.03])
def test_there_is_none_where_bounds_end_inside(most: float) -> None:
    begun = np.array([0.05, 0.01])
    assert free_end(point(), begun, 1e-6, around(begun, np.array([most, most]))) is None
