"""The NIOSH equation: examples of the applications manual, in pounds and inches, and its limits."""

from __future__ import annotations

from math import inf, radians

import numpy as np
import pytest

import wholebody as wb
from wholebody.ergonomics.observation import published

INCH, POUND = 0.0254, 0.45359237


def pounds(limit: float) -> float:
    return limit / POUND


@pytest.mark.parametrize(
    ("height", "limit", "index"),
    [(15.0, 16.3, 2.7), (63.0, 14.5, 3.0)],  # at the origin and at the destination
)
def test_loading_punch_press_stock(height: float, limit: float, index: float) -> None:
    """Example 1 of the manual: 44 lb, H 23 in, D 48 in, fewer than 0.2 lifts a minute, less than an hour, fair grip.

    The manual has 51 lb for 23 kg and 10 in for 25 cm, and rounds each multiplier to two digits, up to 4 % together.
    """
    lift = wb.ergonomics.Lift(23 * INCH, height * INCH, 48 * INCH, coupling="fair", load=44 * POUND)
    assert pounds(lift.limit) == pytest.approx(limit, rel=0.045)
    assert lift.index == pytest.approx(index, abs=0.2)
    assert lift.multipliers["HM"] == pytest.approx(0.44, abs=0.013)
    assert lift.multipliers["DM"] == pytest.approx(0.86, abs=0.006)


def test_package_inspection() -> None:
    """Example 4 of the manual, figure 14: 51 x 1.0 x .94 x .87 x 1.0 x .88 x .95 = 34.9 lb at the origin, D 37 in.

    The printed multipliers give the rest: H 10 in, V 22 in, no turn, three lifts a minute for less than an hour, fair.
    """
    lift = wb.ergonomics.Lift(0.25, 22 * INCH, 37 * INCH, 0.0, 3.0, 1.0, "fair")
    printed = {"HM": 1.0, "VM": 0.94, "DM": 0.87, "AM": 1.0, "FM": 0.88, "CM": 0.95}
    assert lift.multipliers == pytest.approx(printed, abs=0.007)
    assert pounds(lift.limit) == pytest.approx(34.9, rel=0.015)


def test_the_ideal_lift_is_the_load_constant() -> None:
    lift = wb.ergonomics.Lift(0.25, 0.75, 0.25, load=11.5)
    assert lift.limit == pytest.approx(23.0)
    assert lift.index == pytest.approx(0.5)


def test_each_multiplier_by_hand() -> None:
    """By the formulas in centimetres and degrees, and table 5 at 3 lifts a minute for two hours."""
    lift = wb.ergonomics.Lift(0.5, 0.35, 0.6, radians(45.0), 3.0, 2.0, "poor")
    wanted = {"HM": 0.5, "VM": 0.88, "DM": 0.895, "AM": 0.856, "FM": 0.79, "CM": 0.9}
    assert lift.multipliers == pytest.approx(wanted)
    assert lift.limit == pytest.approx(23.0 * np.prod(list(wanted.values())))


@pytest.mark.parametrize(
    "lift",
    [
        wb.ergonomics.Lift(0.64, 0.75, 0.25, load=1.0),
        wb.ergonomics.Lift(0.25, 1.76, 0.25, load=1.0),
        wb.ergonomics.Lift(0.25, 0.75, 1.76, load=1.0),
        wb.ergonomics.Lift(0.25, 0.75, 0.25, radians(136.0), load=1.0),
        wb.ergonomics.Lift(0.25, 0.75, 0.25, frequency=16.0, load=1.0),
        wb.ergonomics.Lift(0.25, 0.7, 0.25, frequency=13.0, load=1.0),
    ],
)
def test_beyond_the_limits_nothing_may_be_lifted(lift: wb.ergonomics.Lift) -> None:
    assert lift.limit == 0.0
    assert lift.index == inf


def test_more_often_and_longer_is_never_more() -> None:
    tables = {hours: (low, high) for hours, low, high in published("niosh")["multipliers"]}
    for low, high in tables.values():
        assert len(low) == len(high) == len(published("niosh")["frequencies"])
        assert (np.diff(low) <= 0).all()
        assert (np.array(high) >= np.array(low)).all()
    for short, longer in ((1.0, 2.0), (2.0, 8.0)):
        assert (np.array(tables[short][1]) >= np.array(tables[longer][1])).all()


def test_a_lift_is_measured_between_two_postures() -> None:
    person = wb.load("human")
    upright = person.posture("standing")
    bent = {"shoulder_flexion": 0.4, "elbow_flexion": 1.2}
    both = {f"{side}_{joint}": value for side in ("left", "right") for joint, value in bent.items()}
    raised = person.with_joints(upright, both)
    first, second = wb.ergonomics.lift_between(person, upright, raised, load=5.0)
    palms = [
        np.mean([person.placement(q, f"{side}_palm").translation for side in ("left", "right")], axis=0)
        for q in (upright, raised)
    ]
    assert first.vertical == pytest.approx(palms[0][2])
    assert second.vertical == pytest.approx(palms[1][2])
    assert first.travel == second.travel == pytest.approx(palms[1][2] - palms[0][2])
    ankle = person.placement(raised, "left_ankle").translation
    assert second.horizontal == pytest.approx(palms[1][0] - ankle[0], abs=1e-6)
    assert second.asymmetry == pytest.approx(0.0, abs=1e-6)
