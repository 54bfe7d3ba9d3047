"""Seated dimensions of the drawn surface and of the pieces: `python -m tests.audits.seated_surface [COUNT] [SEED]`.

COUNT women and men of `wb.people`, and short heavy and tall light ones, sit upright with right angles at hips, knees
and elbows. Flat planes touch the drawn surface, and the pieces that studies use, where an anthropometer's do (ANSUR II:
Gordon et al. 2014), over the seat and the floor on which the pieces rest. Prints by how much each differs from what the
person was built from. The surface has cloth, and hair that an anthropometer presses flat: sitting height ends at the
skin. "Under the seat" is how far something is in the seat.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from itertools import chain
from math import radians
from typing import Any

import numpy as np
import pinocchio as pin

import wholebody as wb
from tests.measuring import measure
from wholebody.base.arrays import Array
from wholebody.figures.surface import surface_of
from wholebody.figures.surface.garments import halfway

RIGHT_ANGLES = {
    f"{side}_{joint}": radians(90.0)
    for side in ("left", "right")
    for joint in ("hip_flexion", "knee_flexion", "elbow_flexion")
}

SAMPLES = [(i / 6.0, j / 6.0, 1.0 - (i + j) / 6.0) for i in range(7) for j in range(7 - i)]
"""Shares of a triangle's corners in points on it: the largest triangles have sides of 25 mm."""

Points = dict[str, list[Array]]


def drawn(figure: wb.Figure, data: pin.Data) -> Points:
    """Points (n, 3) on the surface by segment."""
    surface, found = surface_of(figure), Points()
    assert surface is not None
    bones = [
        data.oMi[figure.model.getJointId(name)].homogeneous @ at for name, at in surface.attached(figure, np.eye(4))
    ]
    for number, first, second in surface.halves:
        bones[number] = halfway(bones[first], bones[second], surface.bones[number])
    moves = np.array([now @ np.linalg.inv(bone.bind) for now, bone in zip(bones, surface.bones, strict=True)])
    for patch in surface.patches:
        points = np.column_stack((patch.vertices, np.ones(len(patch.vertices))))
        moved = np.einsum("nkij,nj,nk->ni", moves[patch.bones], points, patch.weights)[:, :3]
        if not patch.name.startswith("hair"):
            found.setdefault(patch.segment, []).append(
                np.einsum("sc,tcd->std", SAMPLES, moved[patch.faces]).reshape(-1, 3)
            )
    return found


def pieces(figure: wb.Figure, data: pin.Data) -> Points:
    """Points (n, 3) on the capsules and boxes by segment."""
    placed, found = pin.GeometryData(figure.geometry), Points()
    pin.updateGeometryPlacements(figure.model, data, figure.geometry, placed)
    around, down = (
        angles.ravel() for angles in np.meshgrid(np.radians(np.arange(0, 360, 3)), np.radians(np.arange(0, 181, 3)))
    )
    ball = np.column_stack((np.cos(around) * np.sin(down), np.sin(around) * np.sin(down), np.cos(down)))
    for piece, at in zip(figure.geometry.geometryObjects, placed.oMg, strict=True):
        shape: Any = piece.geometry
        if hasattr(shape, "radius"):
            places = np.linspace(-1.0, 1.0, 100)[:, None, None] * (0.0, 0.0, shape.halfLength)
            points = (places + shape.radius * ball[(abs(ball[:, 2]) < 1e-9)]).reshape(-1, 3)
            ends = [shape.radius * ball + (0.0, 0.0, end * shape.halfLength) for end in (-1.0, 1.0)]
            points = np.concatenate(
                [points, *(end[end[:, 2] * sign >= 0.0] for end, sign in zip(ends, (-1.0, 1.0), strict=True))]
            )
        else:
            points = np.stack(np.meshgrid(*([-half, half] for half in shape.halfSide)), axis=-1).reshape(-1, 3)
        found.setdefault(piece.name.partition(":")[0], []).append(points @ at.rotation.T + at.translation)
    return found


def differences(figure: wb.Figure, points: Callable[[wb.Figure, pin.Data], Points]) -> dict[str, float]:
    """How much larger each seated dimension is than that of the person who was built, mm."""
    data, built = figure.model.createData(), measure(figure)
    pin.framesForwardKinematics(figure.model, data, figure.with_joints(pin.neutral(figure.model), RIGHT_ANGLES))
    by_segment = points(figure, data)
    floor, knee, hip, elbow = (
        data.oMf[figure.frame_id(f"left_{name}")].translation for name in ("sole", "knee", "hip", "elbow")
    )
    seat = floor[2] + built["popliteal_height"]

    def of(*segments: str) -> Array:
        return np.concatenate(list(chain.from_iterable(by_segment[name] for name in segments)))

    thigh, leg, arm = of("left_thigh"), of("left_thigh", "left_shank"), of("left_upper_arm", "left_forearm")
    trunk = of("pelvis", "left_thigh", "right_thigh")
    buttock = trunk[trunk[:, 2] < hip[2] + 0.1][:, 0].min()
    calf = of("left_shank")
    shank = calf[(calf[:, 2] < seat) & (calf[:, 2] > seat - 0.004)]
    found = {
        "sitting_height": of("head")[:, 2].max() - seat,
        "knee_height_sitting": leg[abs(leg[:, 0] - knee[0]) < 0.05][:, 2].max() - floor[2],
        "popliteal_height": thigh[thigh[:, 0] > knee[0] - 0.1][:, 2].min() - floor[2],
        "buttock_knee_length": leg[leg[:, 2] > knee[2] - 0.12][:, 0].max() - buttock,
        "buttock_popliteal_length": shank[:, 0].min() - buttock,
        "elbow_rest_height": arm[abs(arm[:, 0] - elbow[0]) < 0.06][:, 2].min() - seat,
        "thigh_clearance": thigh[thigh[:, 0] < knee[0] - 0.1][:, 2].max() - seat,
        "hip_breadth_sitting": np.ptp(trunk[trunk[:, 2] < hip[2] + 0.1][:, 1]),
    }
    off = {name: float(value - built[name]) for name, value in found.items()}
    off["under the seat"] = float(seat - trunk[trunk[:, 0] < knee[0] - 0.1][:, 2].min())
    return {name: 1000.0 * value for name, value in off.items()}


def people(count: int, seed: int, sex: str) -> Iterator[wb.Figure]:
    """The sampled people of a sex, and both extremes: percentiles 5 and 95 of stature and mass, crosswise."""
    for person in wb.people(count, sex, seed=seed).values():
        yield wb.load("human", **person)
    for tall, heavy in ((5, 95), (95, 5)):
        stature, mass = (wb.load("human", sex=sex, percentile=each).describe().person for each in (tall, heavy))
        assert stature is not None
        assert mass is not None
        yield wb.load("human", sex=sex, stature=stature.stature, mass=mass.mass)


def main(count: int = 16, seed: int = 0) -> None:
    """Measure and print."""
    for sex in ("female", "male"):
        figures = list(people(count, seed, sex))
        for what in (drawn, pieces):
            rows = [differences(figure, what) for figure in figures]
            for name in rows[0]:
                off = np.array([row[name] for row in rows])
                bias, error = off[:count].mean(), np.sqrt((off[:count] ** 2).mean())
                spread = f"bias {bias:+6.1f}  RMSE {error:5.1f}  5/95 {off[-2]:+6.1f}  95/5 {off[-1]:+6.1f} mm"
                sys.stdout.write(f"{sex:6}  {what.__name__:6}  {name:24}  {spread}\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
