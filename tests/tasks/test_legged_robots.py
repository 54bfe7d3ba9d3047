"""Stand and balance of robots: feet that are balls, and robots whose zero overlaps."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.tasks.balance import standing_points

RADIUS = 0.03
LEGS = {"lf": (0.3, 0.2), "rf": (0.3, -0.2), "lh": (-0.3, 0.2), "rh": (-0.3, -0.2)}
FEET = [f"{leg}_foot" for leg in LEGS]


def _link(name: str, mass: float, shape: str, at: str = "0 0 0") -> str:
    inertia = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    return f"""<link name="{name}"><inertial><origin xyz="{at}"/><mass value="{mass}"/>{inertia}</inertial>
<collision><origin xyz="{at}"/><geometry>{shape}</geometry></collision></link>"""


def _joint(name: str, parent: str, child: str, at: str, axis: str, kind: str = "revolute", most: float = 2.5) -> str:
    return f"""<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>
<axis xyz="{axis}"/><limit lower="-2.5" upper="{most}" effort="99" velocity="9"/></joint>"""


def _ball_mesh(path: Path, knee: tuple[float, ...] = ()) -> str:
    """A ball of the feet's radius as a mesh of 66 corners: an octahedron whose faces are split twice; and a corner."""
    faces = [np.array([(x, 0, 0), (0, y, 0), (0, 0, z)]) for x in (1, -1) for y in (1, -1) for z in (1, -1)]
    faces = [face if np.linalg.det(face) > 0.0 else face[::-1] for face in faces]
    for _ in range(2):
        split = []
        for a, b, c in faces:
            ab, bc, ca = a + b, b + c, c + a
            split += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = [np.array([corner / np.linalg.norm(corner) for corner in face]) for face in split]
    lines = [f"v {x} {y} {z}" for x, y, z in RADIUS * np.concatenate(faces)]
    lines += [f"v {' '.join(map(str, knee))}"] if knee else []
    lines += [f"f {k} {k + 1} {k + 2}" for k in range(1, 3 * len(faces), 3)]
    lines += [f"f 1 2 {3 * len(faces) + 1}"] if knee else []
    path.write_text("\n".join(lines))
    return f'<mesh filename="{path}"/>'


def _quadruped(folder: Path, ball: str, at: str = "0 0 0", most: float = 2.5) -> wb.Figure:
    parts = [_link("trunk", 10.0, '<box size="0.7 0.3 0.12"/>')]
    for leg, (x, y) in LEGS.items():
        parts += [_link(f"{leg}_hip", 0.5, '<sphere radius="0.04"/>')]
        parts += [_link(f"{leg}_thigh", 1.0, '<cylinder radius="0.02" length="0.2"/>', "0 0 -0.15")]
        parts += [_link(f"{leg}_shank", 0.5, '<cylinder radius="0.015" length="0.2"/>', "0 0 -0.14")]
        parts += [_link(f"{leg}_foot", 0.1, ball, at)]
        parts += [_joint(f"{leg}_haa", "trunk", f"{leg}_hip", f"{x} {y} -0.1", "1 0 0")]
        parts += [_joint(f"{leg}_hfe", f"{leg}_hip", f"{leg}_thigh", "0 0 0", "0 1 0")]
        parts += [_joint(f"{leg}_kfe", f"{leg}_thigh", f"{leg}_shank", "0 0 -0.3", "0 1 0", most=most)]
        parts += [_joint(f"{leg}_end", f"{leg}_shank", f"{leg}_foot", "0 0 -0.3", "0 0 1", "fixed")]
    path = folder / "quadruped.urdf"
    path.write_text(f'<robot name="quadruped">{"".join(parts)}</robot>')
    return wb.load(path, root="free")


@pytest.mark.parametrize(("stands", "made_of"), [("stand", "sphere"), ("stand", "mesh"), ("balance", "sphere")])
def test_a_quadruped_stands_on_balls_that_roll(tmp_path: Path, stands: str, made_of: str) -> None:
    ball = f'<sphere radius="{RADIUS}"/>' if made_of == "sphere" else _ball_mesh(tmp_path / "ball.obj")
    robot = _quadruped(tmp_path, ball)
    scene = wb.Scene(robot).add(wb.HalfSpace(), name="floor")
    start = robot.grounded(robot.neutral, scene)
    trunk = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([0.05, 0.02, start[2] - 0.12]))
    held = [wb.Hold(foot, orientation=False) for foot in FEET]
    constraints = [wb.Stand("floor", feet=FEET)] if stands == "stand" else [*held, wb.Balance(FEET)]
    solution = wb.solve(wb.Problem(scene, start, goals=[wb.Frame("trunk", trunk)], constraints=constraints))
    assert solution.solved
    # The lowest point of a ball is below its middle, which a mesh around it has higher by what the mesh adds.
    middles = np.array([robot.placement(solution.q, foot).translation for foot in FEET])
    np.testing.assert_allclose(middles[:, 2], RADIUS, atol=1e-4 if made_of == "sphere" else 5e-3)
    bent = [robot.placement(solution.q, f"{leg}_shank").rotation[2, 2] for leg in LEGS]
    assert min(bent) < np.cos(np.radians(20.0))  # soles that lie flat would keep every shank upright
    data = robot.model.createData()
    center = pin.centerOfMass(robot.model, data, solution.q)
    polygon = middles[[0, 2, 3, 1], :2]  # anticlockwise
    for one, other in pairwise([*polygon, polygon[0]]):
        assert np.linalg.det([other - one, center[:2] - one]) > 0.0


def test_the_balance_of_balls_is_over_the_points_on_which_they_stand(tmp_path: Path) -> None:
    # The polygon of the balls' middles: 0.6 by 0.4 m, and not longer by the parts of a mesh that are nearly as low.
    robot = _quadruped(tmp_path, _ball_mesh(tmp_path / "ball.obj"))
    scene = wb.Scene(robot).add(wb.HalfSpace(), name="floor")
    balance = wb.Balance(FEET).resolve(scene, robot.grounded(robot.neutral, scene))
    found = sorted(map(tuple, np.column_stack([balance.normals, balance.offsets]).round(2)))
    assert found == [(-1.0, 0.0, -0.3), (0.0, -1.0, -0.2), (0.0, 1.0, -0.2), (1.0, 0.0, -0.3)]


@pytest.mark.parametrize("lean", [0.5, 0.8, 1.2])  # rad
def test_feet_that_are_capsules_that_lean_stand_on_their_lower_ends(tmp_path: Path, lean: float) -> None:
    # Turned by 60 degrees they stand on the upper ends: they were balls between both, and 4 cm beside the lower ones.
    robot = _quadruped(tmp_path, '<capsule radius="0.02" length="0.2"/>', f'0 0 0" rpy="0 {lean} 0')
    scene = wb.Scene(robot).add(wb.HalfSpace(), name="floor")
    balance = wb.Balance(FEET).resolve(scene, robot.grounded(robot.neutral, scene))
    found = dict(zip(map(tuple, balance.normals.round(6) + 0.0), balance.offsets, strict=True))
    assert found[1.0, 0.0] == pytest.approx(-0.3 - 0.1 * np.sin(lean), abs=1e-6)
    assert found[-1.0, 0.0] == pytest.approx(-0.3 + 0.1 * np.sin(lean), abs=1e-6)


@pytest.mark.parametrize("knee", ["bent", "of one piece with the foot"])
def test_shanks_that_are_never_upright_stand_on_their_feet(tmp_path: Path, knee: str) -> None:
    """Knees that stay bent, as those of most quadrupeds: tilted by 60 degrees, a knee may be lower than its foot."""
    one_piece = knee != "bent"
    ball = _ball_mesh(tmp_path / "ball.obj", (0.15, 0.0, 0.06)) if one_piece else f'<sphere radius="{RADIUS}"/>'
    robot = _quadruped(tmp_path, ball, most=2.5 if one_piece else -0.9)
    legs = {f"{leg}_hfe": 0.7 for leg in LEGS} | {f"{leg}_kfe": -1.4 for leg in LEGS}
    start = robot.neutral if one_piece else robot.with_joints(robot.neutral, legs)
    points = standing_points(wb.Scene(robot), start, FEET)
    middles = np.array([robot.placement(start, foot).translation for foot in FEET])
    nearest = np.linalg.norm(points[:, None, :2] - middles[:, :2], axis=2).argmin(axis=1)
    for number, middle in enumerate(middles):
        own = points[nearest == number]
        np.testing.assert_allclose(
            own[own[:, 2].argmin()], middle - (0.0, 0.0, RADIUS), atol=6e-3 if one_piece else 1e-9
        )


def test_soles_are_level_of_a_robot_whose_zero_overlaps(tmp_path: Path) -> None:
    # Thighs that overlap at zero: the first posture moves the joints, and its feet are not level.
    parts = [_link("trunk", 8.0, '<box size="0.2 0.2 0.3"/>', "0 0 0.2")]
    for side, y in (("left", 0.05), ("right", -0.05)):
        parts += [_link(f"{side}_hip", 0.3, '<sphere radius="0.02"/>')]
        parts += [_link(f"{side}_thigh", 1.0, '<cylinder radius="0.055" length="0.2"/>', "0 0 -0.16")]
        parts += [_link(f"{side}_shank", 0.6, '<cylinder radius="0.02" length="0.18"/>', "0 0 -0.14")]
        parts += [_link(f"{side}_ankle", 0.2, '<sphere radius="0.02"/>')]
        parts += [_link(f"{side}_foot", 0.2, '<box size="0.16 0.07 0.03"/>', "0.03 0 -0.05")]
        parts += [_joint(f"{side}_hip_roll", "trunk", f"{side}_hip", f"0 {y} 0", "1 0 0")]
        parts += [_joint(f"{side}_hip_pitch", f"{side}_hip", f"{side}_thigh", "0 0 0", "0 1 0")]
        parts += [_joint(f"{side}_knee", f"{side}_thigh", f"{side}_shank", "0 0 -0.3", "0 1 0")]
        parts += [_joint(f"{side}_ankle_pitch", f"{side}_shank", f"{side}_ankle", "0 0 -0.28", "0 1 0")]
        parts += [_joint(f"{side}_ankle_roll", f"{side}_ankle", f"{side}_foot", "0 0 0", "1 0 0")]
    path = tmp_path / "biped.urdf"
    path.write_text(f'<robot name="biped">{"".join(parts)}</robot>')
    robot = wb.load(path, root="free")
    assert "zero" in robot.postures
    tilted = [robot.placement(robot.neutral, f"{side}_foot").rotation[2, 2] for side in ("left", "right")]
    assert min(tilted) < 0.999  # the first posture's soles are not level
    scene = wb.Scene(robot).add(wb.HalfSpace(), name="floor")
    solution = wb.solve(wb.Problem(scene, robot.grounded(robot.neutral, scene), constraints=[wb.Stand("floor")]))
    assert solution.solved
    for side in ("left", "right"):
        foot = robot.placement(solution.q, f"{side}_foot")
        assert foot.rotation[2, 2] == pytest.approx(1.0, abs=1e-9)
        assert foot.translation[2] == pytest.approx(0.065, abs=1e-4)
