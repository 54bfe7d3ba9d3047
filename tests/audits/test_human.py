"""The person's bench: its small run, its page, and its own ways of measuring."""

from __future__ import annotations

import numpy as np
import pytest

from tests.audits.human_contacts import distance
from tests.audits.human_sizes import _girth, dimensions, ranges
from wholebody.figures import load
from wholebody.figures.surface.fields import ball, round_cone, union


def test_a_girth_is_that_of_the_hull() -> None:
    middle = np.zeros(2)
    assert _girth(ball((0.0, 0.0, 0.0), 0.05), middle, 0.03) == pytest.approx(2.0 * np.pi * 0.04, rel=2e-3)
    beside = union([round_cone((x, 0.0, -1.0), (x, 0.0, 1.0), 0.02, 0.02) for x in (-0.03, 0.03)])
    band = 2.0 * np.pi * 0.02 + 2.0 * 0.06  # a tape around two equal rods
    assert _girth(union([beside, ball((0.0, 0.0, 0.0), 0.011)]), middle, 0.0) == pytest.approx(band, rel=0.03)


def test_dimensions_keep_to_what_is_asked() -> None:
    for row in dimensions(["F50", "M50"]):
        assert abs(row.residual) < (0.025 if "overhead" in row.name else 0.015), row


def test_a_straight_leg_ends_before_a_bent_one() -> None:
    found = {row.motion: row.model for row in ranges(load("human"))}
    assert found["hip, straight-leg raise of men"] < found["hip, flexion with the knee at 120"]
    assert found["spine, flexion"] == pytest.approx(80.0, abs=0.5)


def test_distances_are_those_of_the_scene() -> None:
    import wholebody as wb

    figure = load("human")
    q = figure.posture("standing")
    scene = wb.Scene(figure)
    contacts = scene.contacts(q, within=1.0)
    owners = [{scene.piece_owner[int(k)] for k in pair} for pair in contacts.pair]
    tested = min(d for d, pair in zip(contacts.distance, owners, strict=True) if pair == {"left_hand", "left_thigh"})
    assert distance(figure, q, ["left_hand"], ["left_thigh"]) == pytest.approx(tested, abs=1e-6)
