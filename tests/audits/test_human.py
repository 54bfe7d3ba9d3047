"""The person's bench: its small run, its page, and its own ways of measuring."""

from __future__ import annotations

import pytest

from tests.audits.human_contacts import distance
from tests.audits.human_sizes import dimensions, ranges
from wholebody.figures import load


def test_dimensions_keep_to_what_is_likely() -> None:
    for row in dimensions(["female"]):
        assert abs(row.residual) < 0.003, row


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
