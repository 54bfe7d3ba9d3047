"""The person's sizes against ANSUR II, and the postures in which its flesh meets itself and things."""

import math
from functools import cache

import numpy as np
import pinocchio as pin
import pytest

from wholebody.figures import load
from wholebody.figures.anthropometry import body, design_cases, table
from wholebody.figures.measuring import ansur, measure

CASES = tuple(design_cases())
TOLERANCE = {"overhead_reach_sitting": 0.025}


@cache
def person(case="M50", detail="capsules"):
    who = design_cases()[case]
    return load("human", sex=who.sex, stature=who.stature, mass=who.mass, detail=detail)


@pytest.mark.parametrize("case", CASES)
def test_fifteen_dimensions_are_those_of_ansur(case):
    found, wanted = measure(person(case)), ansur(design_cases()[case].sex, int(case[1:]))
    assert set(found) == set(wanted)
    assert len(found) == 15
    off = {name: found[name] - wanted[name] for name in wanted}
    assert {name: round(1e3 * far) for name, far in off.items() if abs(far) > TOLERANCE.get(name, 0.015)} == {}


@pytest.mark.parametrize("case", CASES)
def test_residuals_of_the_fit_are_the_models(case):
    found, wanted = measure(person(case)), ansur(design_cases()[case].sex, int(case[1:]))
    for row in table("residuals"):
        assert found[row["name"]] - wanted[row["name"]] == pytest.approx(float(row[case]), abs=2e-4)


@pytest.mark.parametrize("dimension", ["acromial_height", "bideltoid_breadth", "span", "sitting_height"])
def test_dimensions_are_the_percentiles_of_the_public_table(dimension):
    name = dimension.replace("_", "")
    for row in table("percentiles"):
        if row["dim"] == name:
            sex = "male" if row["sex"] == "M" else "female"
            for percentile in (5, 50, 95):
                assert ansur(sex, percentile)[dimension] == pytest.approx(
                    0.01 * float(row[f"p{percentile:02d}"]), abs=1e-3
                )


@pytest.mark.parametrize("sex", ["male", "female"])
def test_people_in_between_lie_between(sex):
    # 25th and 75th percentiles: sitting height, span and bideltoid breadth are in the public table.
    rows = {row["dim"]: row for row in table("percentiles") if row["sex"] == sex[0].upper()}
    for percentile in ("p25", "p75"):
        stature, mass = 0.01 * float(rows["stature"][percentile]), float(rows["mass"][percentile])
        found = measure(load("human", sex=sex, stature=stature, mass=mass))
        for name in ("sitting_height", "span", "bideltoid_breadth"):
            wanted = 0.01 * float(rows[name.replace("_", "")][percentile])
            assert found[name] == pytest.approx(wanted, abs=0.015)


def test_inertia_of_the_female_thigh_belongs_to_its_sources_segment():
    # de Leva 1996: length 0.2124 of the stature, centre of mass 36.12 % from the hip, gyration 36.9 %.
    who = body("female", 1.626, 66.8)
    assert who.center_of_mass("left_thigh")[2] == pytest.approx(-0.361 * 0.2124 * 1.626, rel=1e-9)
    moment = who.segment_mass("left_thigh") * (0.369 * 0.2124 * 1.626) ** 2
    assert who.inertia("left_thigh")[0] == pytest.approx(moment, rel=1e-9)


@pytest.mark.parametrize("case", CASES)
def test_thighs_and_buttocks_are_level_on_a_seat(case):
    figure = person(case)
    data, geometry_data = figure.model.createData(), pin.GeometryData(figure.geometry)
    names = ("left_hip_flexion", "right_hip_flexion", "left_knee_flexion", "right_knee_flexion")
    q = figure.with_joints(pin.neutral(figure.model), dict.fromkeys(names, math.pi / 2))
    pin.updateGeometryPlacements(figure.model, data, figure.geometry, geometry_data, q)
    lowest = {}
    for piece, placement in zip(figure.geometry.geometryObjects, geometry_data.oMg, strict=True):
        if piece.name in ("pelvis", "left_thigh:0", "right_thigh:0"):
            half = abs(placement.rotation[2, 2]) * piece.geometry.halfLength
            lowest[piece.name] = placement.translation[2] - piece.geometry.radius - half
    assert np.ptp(list(lowest.values())) < 1e-9


def test_calf_and_thigh_give_way_by_what_flesh_does():
    # The pair moves with the knee alone, so its limit stands for it: there they overlap by at most 35 mm.
    import coal

    for case in CASES:
        figure = person(case)
        data, geometry_data = figure.model.createData(), pin.GeometryData(figure.geometry)
        q = figure.with_joints(pin.neutral(figure.model), {"left_knee_flexion": math.radians(150)})
        pin.updateGeometryPlacements(figure.model, data, figure.geometry, geometry_data, q)
        thigh, calf = (figure.geometry.getGeometryId(name) for name in ("left_thigh:0", "left_shank:0"))
        pieces = figure.geometry.geometryObjects
        here, there = (
            coal.Transform3s(geometry_data.oMg[k].rotation, geometry_data.oMg[k].translation) for k in (thigh, calf)
        )
        depth = -coal.distance(
            pieces[thigh].geometry, here, pieces[calf].geometry, there, coal.DistanceRequest(), coal.DistanceResult()
        )
        assert 0.0 < depth < 0.035, case
