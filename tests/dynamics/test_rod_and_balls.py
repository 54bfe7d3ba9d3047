"""Balls that meet a rod in the air give it the impulses of equation 9."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.dynamics.articulated import Articulated
from wholebody.dynamics.rigid_bodies import RigidBodies

DT = 1.0 / 60.0  # s
NO_WEIGHT = (0.0, 0.0, 0.0)
ROD = """<robot name="rod"><link name="rod"><inertial><mass value="2"/><inertia ixx="0.01" iyy="0.2" izz="0.2" ixy="0"
ixz="0" iyz="0"/></inertial><collision><geometry><box size="1.2 0.1 0.02"/></geometry></collision></link></robot>"""


@pytest.mark.parametrize("bounce", [0.0, 0.6, 1.0])
def test_three_balls_hit_a_rod_in_the_air_at_one_instant(tmp_path: Path, bounce: float) -> None:
    (tmp_path / "rod.urdf").write_text(ROD)
    rod = wb.load(tmp_path / "rod.urdf", root="free")
    scene, places, masses = wb.Scene(rod), np.array([-0.5, 0.1, 0.45]), np.array([0.2, 0.5, 0.3])
    material = wb.dynamics.Material("smooth", {"human": (bounce, 0.0), "smooth": (bounce, 0.0)})
    for k, (x, mass) in enumerate(zip(places, masses, strict=True)):
        body = wb.Body(mass=mass, velocity=(0.0, 0.0, -2.0), material=material)
        scene.add(wb.Sphere(0.05), name=f"ball{k}", at=(x, 0.0, 0.07), body=body)
    engine = RigidBodies(scene, NO_WEIGHT, rod.neutral)
    moving = Articulated(scene, rod.neutral, wb.Actuated(rod, stiffness=0.0, damping=0.0), engine)
    for _ in range(8):
        moving.advance(moving.q, 1.0 / 240.0, {}, {"rod": scene.frame_id("rod")})
    # u+ = -e u at all three: (1 / m_ball + 1 / m_rod + x_i x_j / I) p = (1 + e) 2 m/s, equation 9 for all at once
    mobility = np.diag(1.0 / masses) + 1.0 / 2.0 + np.outer(places, places) / 0.2
    impulse = np.linalg.solve(mobility, np.full(3, (1.0 + bounce) * 2.0))
    assert (impulse > 0.0).all()
    ended = [engine.twist(f"ball{k}")[2] for k in range(3)]
    assert ended == pytest.approx(-2.0 + impulse / masses, abs=0.02)
    assert moving.velocity[2] == pytest.approx(-impulse.sum() / 2.0, abs=0.02)
    assert moving.velocity[4] == pytest.approx(places @ impulse / 0.2, abs=0.02)


def test_a_slow_ball_and_a_rod_in_the_air_go_on_together(tmp_path: Path) -> None:
    (tmp_path / "rod.urdf").write_text(ROD)
    rod = wb.load(tmp_path / "rod.urdf", root="free")
    speed, arm, mass = 0.04, 0.3, 0.5  # m/s: too slow to bounce; m, kg
    body = wb.Body(mass=mass, velocity=(0.0, 0.0, -speed))
    scene = wb.Scene(rod).add(wb.Sphere(0.05), name="ball", at=(arm, 0.0, 0.0605), body=body)
    engine = RigidBodies(scene, NO_WEIGHT, rod.neutral)
    moving = Articulated(scene, rod.neutral, wb.Actuated(rod, stiffness=0.0, damping=0.0), engine)
    began = engine.momentum()
    for _ in range(4):
        moving.advance(moving.q, DT, {}, {"rod": scene.frame_id("rod")})
    impulse = speed / (1.0 / mass + 1.0 / 2.0 + arm**2 / 0.2)  # of equation 9 without restitution
    assert engine.twist("ball")[2] == pytest.approx(-speed + impulse / mass, rel=3e-4)
    assert moving.velocity[[2, 4]] == pytest.approx((-impulse / 2.0, arm * impulse / 0.2), rel=3e-4)
    assert engine.momentum() + moving.momentum() == pytest.approx(began, abs=1e-12)


def test_a_limp_rod_lies_still_on_boxes_that_weigh_less(tmp_path: Path) -> None:
    (tmp_path / "rod.urdf").write_text(ROD)
    rod = wb.load(tmp_path / "rod.urdf", root="free")
    scene, start = wb.Scene(rod).add(wb.HalfSpace(), name="floor"), rod.neutral.copy()
    for k, x in enumerate((-0.4, 0.3)):
        scene.add(wb.Box((0.1, 0.1, 0.1)), name=f"box {k}", at=(x, 0.0, 0.0501), body=wb.Body(mass=0.2))
    start[2] = 0.1105
    world = wb.World(scene, start, spring=wb.Actuated(rod, stiffness=0.0, damping=0.0))
    frames = [world.step() for _ in range(40)]
    assert np.abs(world.velocity).max() < 1e-4
    for frame in frames[-10:]:
        assert frame.engine is not None
        assert not frame.engine.events  # the rod threw its boxes down and was thrown up, eight times a frame
    assert frames[-1].q[2] == pytest.approx(frames[-10].q[2], abs=1e-7)


def rods(folder: Path, *bodies: tuple[float, float]) -> wb.Figure:
    """Rods of lengths and masses in the air along x, round ones of 20 mm, each on a hinge about y at the one before."""
    text = '<robot name="rods">'
    for k, (length, mass) in enumerate(bodies):
        across, middle = mass * length**2 / 12.0, f'<origin xyz="{length / 2} 0 0"'
        text += f"""<link name="l{k}"><inertial>{middle}/><mass value="{mass}"/><inertia ixx="{across / 50}"
        iyy="{across}" izz="{across}" ixy="0" ixz="0" iyz="0"/></inertial><collision>{middle} rpy="0 1.5708 0"/>
        <geometry><cylinder length="{length - 0.06}" radius="0.02"/></geometry></collision></link>"""
        if k:
            text += f"""<joint name="j{k}" type="continuous"><parent link="l{k - 1}"/><child link="l{k}"/>
            <axis xyz="0 1 0"/><origin xyz="{bodies[k - 1][0]} 0 0"/></joint>"""
    (folder / "rods.urdf").write_text(text + "</robot>")
    return wb.load(folder / "rods.urdf", root="free")


def test_a_blow_with_friction_at_the_end_of_two_rods_adds_no_energy(tmp_path: Path) -> None:
    figure = rods(tmp_path, (0.445, 0.7), (0.555, 0.8))
    start = figure.neutral.copy()
    start[7:] = np.cos(-0.127), np.sin(-0.127)
    grips = wb.dynamics.Material("grips", {"human": (1.0, 1.0)})
    spin = (13.4, 0.2, 9.0)
    ball = wb.Body(mass=2.8, velocity=(-1.15, -1.72, 4.65), angular_velocity=spin, material=grips)
    scene = wb.Scene(figure).add(wb.Sphere(0.05), name="ball", at=(1.032, 0.021, -0.04), body=ball)
    engine = RigidBodies(scene, NO_WEIGHT, start)
    moving = Articulated(scene, start, wb.Actuated(figure, stiffness=0.0, damping=0.0), engine)
    moving.velocity = np.array((0.5, -0.4, -0.2, -0.7, -0.6, -0.1, 0.3))
    began = moving.energy() + engine.energy()
    moving.advance(start, DT, {}, {name: scene.frame_id(name) for name in figure.segments})
    assert moving.impulses
    # restitution by Newton's law gains energy where friction turns the blow: 2 % here (Kane and Levinson, 1985)
    assert moving.energy() + engine.energy() <= began * (1.0 + 1e-12)


def test_a_rod_that_is_squeezed_by_things_that_weigh_hundreds_of_times_as_much_adds_no_energy(tmp_path: Path) -> None:
    figure = rods(tmp_path, (0.4616, 0.1205), (0.4031, 0.3759), (0.3572, 0.41))
    elastic = wb.dynamics.Material("elastic", {"human": (1.0, 0.0), "elastic": (0.0, 0.3)})
    scene = wb.Scene(figure)
    for name, x, z, mass, speed in (("below", 0.35, -0.115, 55.0, 5.86), ("above", 0.198, 0.107, 167.0, -1.99)):
        body = wb.Body(mass=mass, velocity=(0.0, 0.0, speed), material=elastic)
        scene.add(wb.Box((0.2, 0.2, 0.15)), name=name, at=(x, 0.0165, z), body=body)
    engine = RigidBodies(scene, NO_WEIGHT, figure.neutral)
    moving = Articulated(scene, figure.neutral, wb.Actuated(figure, stiffness=0.0, damping=0.0), engine)
    energy = engine.energy()
    for _ in range(2):  # blows from below and above alternate: thrown back with all of each, it gained as much again
        moving.advance(figure.neutral, DT, {}, {name: scene.frame_id(name) for name in figure.segments})
        assert moving.energy() + engine.energy() <= energy * (1.0 + 1e-12)
        energy = moving.energy() + engine.energy()
