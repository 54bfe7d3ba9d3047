"""Accommodation: who reaches and fits follows from the dimensions of ANSUR II."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.methods import QP
from wholebody.studies.accommodation import Accommodation


def upright(figure: wb.Figure, target: Any, layout: Any) -> wb.Problem:
    """Somebody who stands still under a beam, and is to bring the top of the head to 1.70 m."""
    scene = wb.Scene(figure)
    goals = [wb.Point("head_top", (*figure.placement(figure.posture("standing"), "head_top").translation[:2], 1.70))]
    return wb.Problem(scene, goals=goals, constraints=[wb.Freeze("root", *figure.joints)])


def test_only_those_of_the_right_height_are_counted() -> None:
    people = wb.people(1)
    found = wb.accommodation(upright, people, sees=(2.0, 0.0, 1.2))
    assert found.share == 0.0
    assert all(found.fits)
    assert found.sees is not None
    left = [one.goal_error for one in found.records]
    statures = [one["stature"] for one in sorted(people.values(), key=lambda one: (one["sex"], one["stature"]))]
    np.testing.assert_allclose(left, np.abs(np.array(statures) - 1.70), atol=0.02)


def upright_under(height: float) -> Any:
    """Somebody who stands still, and is to fit under a beam."""

    def task(figure: wb.Figure, target: Any, layout: Any) -> wb.Problem:
        scene = wb.Scene(figure)
        scene.add(wb.Box((0.5, 0.5, 0.1)), name="beam", at=(0.0, 0.0, height + 0.05))
        return wb.Problem(scene, constraints=[wb.Freeze("root", *figure.joints)])

    return task


def test_those_who_do_not_fit_are_told_by_their_dimension() -> None:
    found = wb.accommodation(upright_under(1.81), wb.people(25, "male"))
    # The 80th percentile of stature is 1.814 m.
    assert found.by_sex["male"].share == pytest.approx(0.79, abs=0.06)
    assert found.by_sex["male"].low < found.share < found.by_sex["male"].high
    (one,) = found.exclusions
    assert (one.sex, one.verdict, one.dimension, one.side) == ("male", "fit", "stature", "over")
    assert one.value == pytest.approx(1.81, abs=0.01)
    assert one.lift == 1.0
    assert "men do not fit: stature over 1.8" in repr(found)
    (axis,) = found.plot().axes
    drawn = {points.get_label(): points.get_offsets() for points in axis.collections}
    assert (drawn["male, accommodated"][:, 0] < 1.81).all()
    assert (drawn["male, left out"][:, 0] > 1.81).all()
    assert sum(map(len, drawn.values())) == 25


def between_boards(clearance: float) -> Any:
    """Somebody who may only step sideways, between two boards of 4 m that are 0.22 m apart."""

    def task(figure: wb.Figure, target: Any, layout: Any) -> wb.Problem:
        scene, height = wb.Scene(figure), figure.placement(figure.posture("standing"), "gaze").translation[2]
        for side in (-1.0, 1.0):
            scene.add(wb.Box((0.6, 4.0, 0.1)), name=f"board {side:g}", at=(0.0, 0.06 + 2.11 * side, height))
        upright = [wb.Axis("gaze", axis, direction=axis) for axis in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))]
        level = [wb.Plane("gaze", normal) for normal in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))]
        held = [wb.Freeze(*figure.joints), *upright, *level]
        return wb.Problem(scene, "standing", constraints=held, clearance=clearance, balance=False)

    return task


def beside_boards(figure: wb.Figure, target: Any, layout: Any) -> wb.Problem:
    """Somebody stiff, whose eyes may move along a line across two boards: there is room, but not near the start."""
    scene, height = wb.Scene(figure), figure.placement(figure.posture("standing"), "gaze").translation[2]
    for side in (-1.0, 1.0):
        scene.add(wb.Box((0.6, 0.1, 0.1)), name=f"board {side:g}", at=(0.0, 0.04 + 0.15 * side, height))
    held = [wb.Freeze(*figure.joints), wb.Plane("gaze", (0.0, 0.0, 1.0)), wb.Plane("gaze", (1.0, 0.0, 0.0))]
    return wb.Problem(scene, "standing", constraints=held, clearance=0.05, balance=False, range_of_motion=False)


def test_whoever_is_solved_after_a_long_search_is_not_left_out() -> None:
    """Postures are found after 68 to 500 programs; a search of 30 left everybody out."""
    assert wb.accommodation(beside_boards, wb.people(2, seed=2)).share == 1.0


def test_who_comes_nearer_than_the_clearance_does_not_fit() -> None:
    """Heads are 0.14 to 0.18 m broad: 20 to 50 mm are free on each side."""
    people = wb.people(2, seed=1)
    assert all(wb.accommodation(between_boards(0.005), people).fits)
    found = wb.accommodation(between_boards(0.06), people)
    assert not any(found.fits)
    for one in found.records:
        assert one.outcome == "infeasible"
        assert 0.01 < one.clearance_violation < 0.06


def test_the_dimension_that_excludes_is_named_and_not_one_that_goes_with_it() -> None:
    """Half of some women are left out for one dimension, and a little for what is not known of them."""
    people = [{"stature": one["stature"], **one["proportions"]} for one in wb.people(60, "female", seed=3).values()]
    rng, tried = np.random.default_rng(0), [SimpleNamespace(q=())] * len(people)
    for name in people[0]:
        values = np.array([one[name] for one in people])
        score = values + 0.3 * values.std() * rng.normal(size=len(values))
        fits = tuple((score <= np.median(score)).tolist())
        found = Accommodation(tried, ("female",) * len(people), people, fits, (True,) * len(people), None)  # type: ignore[arg-type]
        (told,) = found.exclusions
        assert (told.dimension, told.side) == (name, "over")


def test_the_dimension_of_which_both_ends_are_left_out_is_named() -> None:
    people = [{"stature": one["stature"], **one["proportions"]} for one in wb.people(100, "male", seed=3).values()]
    tried = [SimpleNamespace(q=())] * len(people)
    for name in people[0]:
        low, high = np.quantile([one[name] for one in people], [0.15, 0.85])
        fits = tuple(bool(low <= one[name] <= high) for one in people)
        found = Accommodation(tried, ("male",) * len(people), people, fits, (True,) * len(people), None)  # type: ignore[arg-type]
        assert [one.dimension for one in found.exclusions] == [name]


def standing(figure: wb.Figure, target: Any, layout: Any) -> wb.Problem:
    """Somebody who stands where they are, with a hand forward."""
    goals = [wb.Point("right_index_tip", (0.4, -0.2, 1.2))]
    held = [wb.Hold("left_foot"), wb.Hold("right_foot")]
    return wb.Problem(wb.Scene(figure), "standing", goals=goals, constraints=held)


def test_who_is_solved_from_the_own_start_is_counted_where_that_of_another_is_refused() -> None:
    # ccd holds a foot where it is at the start, and the feet of another are elsewhere
    people = {f"{stature:.2f}": {"sex": "male", "stature": stature} for stature in (1.70, 1.71, 1.80)}
    found = wb.accommodation(standing, people, method="ccd")
    assert found.records.counts() == {"solved": 3}
    assert found.share == 1.0


def test_people_are_design_cases_by_name_too() -> None:
    """A woman of the 5th percentile of stature fits under 1.70 m, and a man of the 95th does not."""
    found = wb.accommodation(upright_under(1.70), {"small": "F5", "tall": "M95"}, sees=(2.0, 0.0, 1.2))
    assert dict(zip((one.name for one in found.records), found.fits, strict=True)) == {"small": True, "tall": False}


def test_those_refused_are_in_no_share() -> None:
    def task(figure: wb.Figure, target: Any, layout: Any) -> wb.Problem:
        if figure.describe().person.stature > 1.85:
            raise wb.InputError("too tall for this task")
        return upright_under(1.75)(figure, target, layout)

    statures = (1.65, 1.70, 1.80, 1.90)
    people = {f"{stature:.2f}": {"sex": "male", "stature": stature} for stature in statures}
    people["woman"] = {"sex": "female", "stature": 1.88}
    found = wb.accommodation(task, people)
    assert found.tried == (False, True, True, True, False)
    assert found.share == pytest.approx(2 / 3)
    assert (found.by_sex["male"].tried, [*found.by_sex]) == (3, ["male"])
    assert [(one.verdict, one.excluded) for one in found.exclusions] == [("fit", 1)]
    assert "by chance" in str(found.exclusions[0])  # 37 dimensions, one of which orders one man and another
    assert "Accommodation of 3 people, 2 more refused: 67%" in repr(found)


def test_a_task_that_refuses_everybody_is_refused() -> None:
    with pytest.raises(wb.InputError, match="everybody is refused; the first, b: the task"):
        wb.accommodation(lambda *given: None, {"a": {"sex": "male"}, "b": {"sex": "female"}})  # type: ignore[arg-type]


def under_a_desk(figure: wb.Figure, target: Any, layout: Any) -> wb.Problem:
    """Somebody who sits as people are measured, with a desk 185 mm over the seat."""
    scene = wb.Scene(figure).add(wb.Box((0.40, 0.6, 0.04)), name="seat", at=(0.2, 0.0, 0.58))
    scene.add(wb.Box((0.03, 0.6, 0.6)), name="back", at=(-0.015, 0.0, 1.0))
    scene.add(wb.Box((0.6, 1.2, 0.03)), name="desk", at=(0.6, 0.0, 0.8))
    return wb.Problem(scene, "sitting", constraints=[wb.Sit(on="seat", back="back", erect=True)])


def test_who_sits_as_people_are_measured_fits_by_the_thighs() -> None:
    thighs = (0.183, 0.187)  # m: of men; the desk leaves 0.185
    people = {f"{1e3 * one:g}": {"sex": "male", "proportions": {"thigh_clearance": one}} for one in thighs}
    found = wb.accommodation(under_a_desk, people)
    fits = {one.factors["person"]: good for one, good in zip(found.records, found.fits, strict=True)}  # type: ignore[index]
    assert fits == {"183": True, "187": False}


def test_people_are_the_same_for_the_same_seed_and_load_as_drawn() -> None:
    first, again, other = (wb.people(3, "female", seed=seed) for seed in (4, 4, 5))
    assert first == again
    assert first != other
    for one in first.values():
        figure = wb.load("human", **one)
        assert figure.notes == ()
        assert dict(figure.describe().person.dimensions) == pytest.approx(one["proportions"])


def test_percentiles_are_of_the_stature() -> None:
    found = wb.people(percentiles=[5, 95], sex="male")
    assert [round(one["stature"], 2) for one in found.values()] == [1.65, 1.87]
    assert list(found) == ["male P5", "male P95"]


def test_percentiles_that_are_nearly_alike_are_different_people() -> None:
    found = wb.people(percentiles=[5, 5.0, 98.0000001, 98.0000002], sex="male")
    assert list(found) == ["male P5", "male P98.0000001", "male P98.0000002"]
    assert len({one["stature"] for one in found.values()}) == 3


def test_boundary_manikins_are_people() -> None:
    found = wb.boundary(0.9, ["stature", "mass"], "female")
    assert len(found) == 1 + 4 + 4
    assert all(wb.load("human", **one).model.nv == 55 for one in list(found.values())[::4])


@pytest.mark.parametrize("name", ["male 5", "male 7", "female 9", "female 23"])
def test_who_fits_only_beside_a_desk_is_found_from_the_task_s_own_start(name: str) -> None:
    # Thighs are not level below a top 185 mm over the seat; turned from it at the seat's edge a hand reaches over it.
    scene = wb.Scene(wb.load("human", **wb.people(25, seed=4)[name])).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.45, 0.45, 0.04)), name="seat", at=(0.0, 0.0, 0.43))
    scene.add(wb.Box((0.8, 1.2, 0.03)), name="desk", at=(0.62, 0.0, 0.65))
    goals = [wb.Sit("seat"), wb.Point("right_index_tip", (0.5, -0.2, 0.70))]
    problem = wb.Problem(scene, "sitting", goals=goals, constraints=[wb.Stand("floor", balance=False)])
    assert wb.solve(problem, method=QP(measures=False)).solved
