"""The person's bench: its small run, its page, and its own ways of measuring."""

from __future__ import annotations

import pytest

import wholebody as wb
from tests.audits import human_postures
from tests.audits.human_contacts import distance
from tests.audits.human_sizes import ranges
from tests.audits.human_tasks import add_seat
from wholebody.figures import load


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


@pytest.mark.parametrize(("sex", "percentile"), [("female", 3), ("male", 97), ("female", None)])
def test_a_stool_is_below_the_thighs_of_who_sits_on_it_and_no_deeper(sex: str, percentile: int | None) -> None:
    hanging = wb.people(12, sex, seed=1)["female 12"] if percentile is None else {}  # her thighs hang below the pelvis
    figure = load("human", **(hanging or {"sex": sex, "percentile": percentile}))
    q, scene = figure.posture("sitting"), wb.Scene(figure)
    add_seat(scene, figure, q)
    seat = {k for k, owner in enumerate(scene.piece_owner) if owner.startswith("seat")}
    contacts = scene.contacts(q, within=1.0)
    met = zip(contacts.distance.tolist(), contacts.pair.tolist(), strict=True)
    assert min(distance for distance, pair in met if seat & set(pair)) > -1e-6


def test_published_postures_are_numbers_with_sources() -> None:
    rows = human_postures.published()
    assert {row["posture"] for row in rows} == set(human_postures.TASKS)
    assert len(human_postures.TASKS) >= 8
    assert {row["half"] for row in rows} == {"fit", "kept"}
    for row in rows:
        assert float(row["sd"]) > 0.0, row
        assert 0.0 < float(row["mean"]) < 180.0, row
        assert row["source"], row
        assert row["spread"] in ("sd", "range", "class"), row


def test_typing_wrists_turn_as_those_of_90_typists_do() -> None:
    """They are extended and turned to the little finger, within a standard deviation (Simoneau et al. 1999)."""
    man = {"fingers": human_postures.median_man()["fingers"]}
    problem = human_postures.typing(man["fingers"])
    q = wb.solve(problem).q
    found = {name: human_postures.angle(man["fingers"], q, name) for name in
             ("left wrist extension", "left wrist ulnar deviation", "left forearm pronation")}  # fmt: skip
    assert found["left wrist extension"] == pytest.approx(21.2, abs=8.8)
    assert found["left forearm pronation"] == pytest.approx(62.2, abs=10.6)
    assert found["left wrist ulnar deviation"] == pytest.approx(15.0, abs=7.7)
