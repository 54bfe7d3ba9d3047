"""The last free posture before a wall, whose place is known."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wholebody.geometry.continuous.bisection import last_free


@pytest.mark.parametrize("halvings", [1, 5, 12])
def test_the_end_is_free_and_as_near_to_the_wall_as_was_asked(halvings: int) -> None:
    model, wall, asked = pin.Model(), 0.7, []
    model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")

    def overlaps(q: np.ndarray) -> bool:
        asked.append(float(q[0]))
        return bool(q[0] > wall)

    q = last_free(model, np.array([0.0]), np.array([2.0]), overlaps, halvings)
    assert wall - 2.0 * 0.5**halvings <= q[0] <= wall
    assert len(asked) == halvings
