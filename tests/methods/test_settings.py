"""Settings of methods are refused when they are given, and not when something is solved long after."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import pytest

import wholebody as wb
from wholebody import InputError

METHODS = (wb.methods.QP, wb.methods.CCD, wb.methods.Newton, wb.methods.Placo, wb.methods.DampedLeastSquares)
NO_NUMBER = (None, "x", "1", math.nan, math.inf, -math.inf, True, 1j, [], [1], {}, object(), 10**400, 10**5000, -1)
WHOLE = ("iterations", "budget", "restarts", "restarts_for_measure", "seed")
REAL = ("tolerance", "damping")


@pytest.mark.parametrize("method", METHODS)
def test_every_setting_that_is_a_number_is_checked(method: Any) -> None:
    settings = {field.name for field in fields(method) if field.init} - {"solver", "algebra", "inequalities", "holds"}
    assert settings - {"measures"} <= {*WHOLE, *REAL, "time_limit"}
    for name in settings & {*WHOLE, *REAL}:
        for wrong in (*NO_NUMBER, *((1.5, 2.0) if name in WHOLE else (0.0, 1e9))):
            with pytest.raises(InputError, match=rf"^\w+: {name} is "):
                method(**{name: wrong})


def test_a_joint_that_was_refused_can_be_added_again() -> None:
    assembly = wb.Assembly().body("rod")
    with pytest.raises(InputError, match="axis"):
        assembly.revolute("world", "rod", at=(0, 0, 0), axis=(0, 0, 0))
    with pytest.raises(InputError, match="leave no room"):
        assembly.revolute("world", "rod", at=(0, 0, 0), axis=(0, 0, 1), limits=(1, 0))
    assembly.revolute("world", "rod", at=(0, 0, 0), axis=(0, 0, 1))
    with pytest.raises(InputError, match="axis"):
        assembly.prismatic("world", "rod", axis="up")  # type: ignore[arg-type]
    assembly.prismatic("world", "rod", axis=(0, 0, 1))
