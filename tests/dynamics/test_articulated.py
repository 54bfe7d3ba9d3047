"""A figure that yields: impulses, momentum and energy against closed forms; ragdolls, pushes, catches."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import wholebody as wb
from wholebody.dynamics.articulated import Articulated
from wholebody.dynamics.rigid_bodies import RigidBodies

DT = 1.0 / 60.0
NO_WEIGHT = (0.0, 0.0, 0.0)


def two_links(planar_arm: Callable[..., wb.Figure], material: wb.dynamics.Material, x: float, speed: float) -> Any:
    """An arm of links of 0.5 and 0.4 m, masses in their joints, and a ball of 0.5 kg that flies at the second link."""
    figure = planar_arm([0.5, 0.4])
    ball = wb.Body(mass=0.5, material=material, velocity=(0.0, -speed, 0.0))
    scene = wb.Scene(figure).add(wb.Sphere(0.05), name="ball", at=(x, 0.2, 0.0), body=ball)
    engine = RigidBodies(scene, NO_WEIGHT, figure.neutral)
    free = wb.Actuated(figure, stiffness=0.0, damping=0.0)
    return Articulated(scene, figure.neutral, free, engine), engine, scene


@pytest.mark.parametrize(("x", "bounce"), [(0.65, 0.4), (0.85, 0.0), (0.85, 1.0)])
def test_a_blow_moves_the_whole_arm_as_equation_9_says(planar_arm: Any, bounce: float, x: float) -> None:
    material = wb.dynamics.Material("test", {"human": (bounce, 0.0)})
    arm, engine, scene = two_links(planar_arm, material, x, 2.0)
    segments = {name: scene.frame_id(name) for name in ("link0", "link1")}
    while not arm.impulses:
        arm.advance(arm.q, 1e-3, {}, segments)
    arm.advance(arm.q, 1e-3, {}, segments)  # what does not bounce comes to rest against it in two steps
    own, mass, ball = 0.4 * 0.1**2, 1.0, 0.5
    inertia = np.array([[2.0 * own + mass * 0.5**2, own], [own, own]])  # joint angles, the arm straight
    row = np.array([x, x - 0.5])  # of the place that is hit, along y
    impulse = (1.0 + bounce) * 2.0 / (1.0 / ball + row @ np.linalg.solve(inertia, row))
    met = engine.twist("ball")[1]
    assert met == pytest.approx(-2.0 + impulse / ball, abs=2e-3)
    # the arm turns on freely after the blow: its angular momentum about the fixed joint and its energy stay
    began = 0.5 * ball * 2.0**2
    after = 0.5 * ball * met**2 + arm.energy()
    lost = 0.5 * (1.0 - bounce**2) * 2.0**2 / (1.0 / ball + row @ np.linalg.solve(inertia, row))
    assert after == pytest.approx(began - lost, rel=2e-3)


def test_a_blow_between_a_ball_and_a_hand_in_the_air_keeps_their_momentum() -> None:
    hand = wb.load("hand")
    scene = wb.Scene(hand)
    start = hand.posture("relaxed")
    ball = wb.Body(mass=0.3, velocity=(0.0, 0.0, -2.0))
    scene.add(
        wb.Sphere(0.03), name="ball", at=hand.placement(start, "right_palm").translation + (0, 0.02, 0.2), body=ball
    )
    engine = RigidBodies(scene, NO_WEIGHT, start)
    moving = Articulated(scene, start, wb.Actuated(hand, stiffness=0.0, damping=0.0), engine)
    before, energy = engine.momentum(), engine.energy()
    while not moving.impulses:
        moving.advance(moving.q, 1e-3, {}, {name: scene.frame_id(name) for name in hand.segments})
        after = engine.momentum() + moving.momentum()
        assert after == pytest.approx(before, abs=1e-9)  # N s, N m s
        assert engine.energy() + moving.energy() < energy + 1e-6
    assert np.linalg.norm(moving.momentum()[:3]) > 0.2


def test_a_hand_is_pushed_aside_by_a_swinging_beam_and_comes_back() -> None:
    hand = wb.load("hand")
    start = hand.posture("relaxed")
    x, y, z = hand.placement(start, "right_hand").translation
    hinge = wb.dynamics.Hinge((0.0, 0.0, 0.5), axis=(0.0, 1.0, 0.0))
    beam = wb.Body(mass=3.0, velocity=(2.0, 0.0, 0.0), angular_velocity=(0.0, -4.0, 0.0), joints=[hinge])
    scene = wb.Scene(hand).add(wb.Box((0.04, 0.04, 1.0)), name="beam", at=(x - 0.3, y, z + 0.4), body=beam)
    world = wb.World(scene, start, spring=wb.Actuated(hand))
    away, slowest = [], 9.0
    for _ in range(40):
        frame = world.step(start)
        assert frame.deepest < 1e-3
        away.append(np.linalg.norm(frame.q[:3] - start[:3]))
        slowest = min(slowest, world.engine.twist("beam")[0])  # type: ignore[union-attr]
    assert max(away) > 0.03
    assert slowest < 0.0  # the beam is thrown back
    assert away[-1] < 2e-3


def chain(folder: Path, joints: int, kind: str = "continuous") -> wb.Figure:
    """A chain of rods of 0.4 m and 1 kg on axes that are not parallel."""
    length, text = 0.4, '<robot name="chain"><link name="l0"/>'
    across = length**2 / 12.0
    for k in range(joints):
        text += f"""<link name="l{k + 1}"><inertial><origin xyz="{length / 2} 0 0"/><mass value="1"/>
        <inertia ixx="1e-3" iyy="{across}" izz="{across}" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="j{k}" type="{kind}"><parent link="l{k}"/><child link="l{k + 1}"/><axis xyz="0 {1 - 0.4 * (k % 2)}
        {0.8 * (k % 2)}"/><origin xyz="{length * (k > 0)} 0 0"/><limit lower="-4" upper="4" effort="1" velocity="9"/>
        </joint>"""
    path = folder / "chain.urdf"
    path.write_text(text + "</robot>")
    return wb.load(path)


def test_a_pendulum_swings_with_the_period_of_its_integral_and_keeps_its_energy(tmp_path: Path) -> None:
    figure = chain(tmp_path, 1, "revolute")
    world = wb.World(wb.Scene(figure), dt=1.0 / 240.0, spring=wb.Actuated(figure, stiffness=0.0, damping=0.0))
    began, energies, speeds = world.energy, [], []
    for _ in range(480):
        world.step()
        energies.append(world.energy)
        speeds.append(world.velocity[0])
    assert np.abs(np.array(energies) - began).max() < 1e-9  # J, of 3.9 from end to end of a swing
    turns = np.flatnonzero(np.diff(np.sign(speeds)))  # it began where it turns
    speed = np.array(speeds)
    times = (turns + 1.0 + speed[turns] / (speed[turns] - speed[turns + 1])) / 240.0
    inertia, arm = 0.4**2 / 3.0, 0.2
    half = 2.0 * np.sqrt(inertia / (9.81 * arm)) * ellipk(np.sin(np.pi / 4.0) ** 2)  # of a swing from the horizontal
    assert len(times) > 2
    assert times == pytest.approx(half * np.arange(1, len(times) + 1), rel=2e-4)


def test_a_chain_swings_as_its_equations_of_motion_say(tmp_path: Path) -> None:
    figure = chain(tmp_path, 3)
    free = wb.Actuated(figure, stiffness=0.0, damping=0.0)
    moving = Articulated(wb.Scene(figure), figure.neutral, free, None)
    began = moving.energy()
    for _ in range(60):
        moving.advance(moving.q, DT, {}, {})
        assert moving.energy() == pytest.approx(began, abs=1e-9)
    model, data = figure.model, figure.model.createData()

    def rate(_: float, state: Any) -> Any:
        q = np.stack([np.cos(state[:3]), np.sin(state[:3])], axis=1).ravel()
        return np.concatenate([state[3:], pin.aba(model, data, q, state[3:], np.zeros(3))])

    end = solve_ivp(rate, (0.0, 1.0), np.zeros(6), rtol=1e-10, atol=1e-10).y[:, -1]
    assert np.abs(end[3:]).max() > 2.0  # rad/s
    angles = np.arctan2(moving.q[1::2], moving.q[::2])
    assert np.abs(np.angle(np.exp(1j * (angles - end[:3])))).max() < 2e-3
    assert moving.velocity == pytest.approx(end[3:], abs=2e-2)


def test_a_limp_joint_beyond_a_sprung_one_falls_as_its_equations_of_motion_say(tmp_path: Path) -> None:
    figure = chain(tmp_path, 2, "revolute")
    start, springs = np.array([0.1, -0.2]), np.array([200.0, 0.0])
    dampers = np.array([8.0, 0.0])
    actuated = wb.Actuated(figure, stiffness={"j0": springs[0]}, damping={"j0": dampers[0]})
    moving = Articulated(wb.Scene(figure), start, actuated, None)
    for _ in range(24):
        moving.advance(start, DT, {}, {})
    model, data = figure.model, figure.model.createData()

    def rate(_: float, state: Any) -> Any:
        q, v = state[:2], state[2:]
        borne = np.where(springs > 0.0, pin.computeGeneralizedGravity(model, data, q), 0.0)
        return np.concatenate([v, pin.aba(model, data, q, v, springs * (start - q) - dampers * v + borne)])

    end = solve_ivp(rate, (0.0, 24 * DT), np.concatenate([start, np.zeros(2)]), rtol=1e-9, atol=1e-9).y[:2, -1]
    assert abs(end[1] - start[1]) > 0.5  # rad
    assert moving.q == pytest.approx(end, abs=0.02)


def test_a_joint_that_follows_another_carries_its_mass_with_it(tmp_path: Path) -> None:
    """Two rods that hang on one axis, of which the second turns three times as far as the first."""
    path = tmp_path / "twins.urdf"
    mass = '<origin xyz="0.5 0 0"/><mass value="1"/><inertia ixx="1" iyy="1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
    link = f"<inertial>{mass}</inertial>"
    joint = '<axis xyz="0 -1 0"/><limit lower="-9" upper="9" effort="1" velocity="1"/>'
    path.write_text(
        f'<robot name="twins"><link name="a"/><link name="b">{link}</link><link name="c">{link}</link>'
        f'<joint name="one" type="revolute"><parent link="a"/><child link="b"/>{joint}</joint><joint name="two" '
        f'type="revolute"><parent link="b"/><child link="c"/>{joint}<mimic joint="one" multiplier="2"/></joint></robot>'
    )
    figure = wb.load(path)
    world = wb.World(wb.Scene(figure), spring=wb.Actuated(figure, stiffness=0.0, damping=0.0))

    def rate(_: float, state: np.ndarray) -> list[float]:
        angle, own = state[0], 1.0 + 0.25
        return [state[1], -0.5 * 9.81 * (np.cos(angle) + 3.0 * np.cos(3.0 * angle)) / (own * (1.0 + 9.0))]

    for _ in range(30):
        world.step()
    end = solve_ivp(rate, (0.0, 0.5), [0.0, 0.0], rtol=1e-9, atol=1e-9).y[0, -1]
    assert abs(end) > 0.15
    assert world.q[0] == pytest.approx(end, abs=1e-3)
    with pytest.raises(wb.InputError, match="'two' follows 'one'; give that of 'one'"):
        wb.Actuated(figure, stiffness={"two": 1.0})


def test_a_ball_that_hits_a_joint_that_another_follows_turns_both(tmp_path: Path) -> None:
    """The follower is first in Pinocchio's order, so columns of the Jacobian are not those of freedoms."""
    solid = '<mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
    ball = '<collision><origin xyz="-0.2 0 0"/><geometry><sphere radius="0.05"/></geometry></collision>'
    links = "".join(f'<link name="{name}"><inertial>{solid}</inertial>{ball}</link>' for name in "abc")
    limit = '<limit lower="-1" upper="1" effort="1" velocity="9"/>'
    way = '<parent link="a"/><child link="{}"/><origin xyz="{} 0 0"/><axis xyz="0 1 0"/>'
    follower = (
        f'<joint name="f" type="revolute">{way.format("b", 0.4)}{limit}<mimic joint="l" multiplier="-2"/></joint>'
    )
    leader = f'<joint name="l" type="revolute">{way.format("c", -0.4)}{limit}</joint>'
    path = tmp_path / "wings.urdf"
    path.write_text(f'<robot name="wings">{links}{follower}{leader}</robot>')
    figure = wb.load(path, root="free")
    material = wb.dynamics.Material("hard", others=(1.0, 0.0))
    body = wb.Body(mass=2.0, velocity=(0.0, 0.0, -3.0), material=material)
    scene = wb.Scene(figure).add(wb.Sphere(0.05), name="ball", at=(-0.6, 0.0, 0.3), body=body)
    engine = RigidBodies(scene, NO_WEIGHT, figure.neutral)
    moving = Articulated(scene, figure.neutral, wb.Actuated(figure, stiffness=0.0, damping=0.0), engine)
    began, energy, frames = engine.momentum(), engine.energy(), {name: scene.frame_id(name) for name in figure.segments}
    for _ in range(12):
        moving.advance(moving.q, DT, {}, frames)
    row, model = np.zeros(figure.model.nv), figure.model
    for freedom, step in enumerate(1e-6 * np.eye(model.nv)):
        ends = (figure.placement(pin.integrate(model, figure.neutral, sign * step), "c") for sign in (1.0, -1.0))
        row[freedom] = np.subtract(*(end.act(np.array([-0.2, 0.0, 0.0]))[2] for end in ends)) / 2e-6
    inertia = pin.crba(model, model.createData(), figure.neutral)
    impulse = 2.0 * 3.0 / (1.0 / 2.0 + row @ np.linalg.solve(inertia, row))
    assert engine.twist("ball")[2] == pytest.approx(-3.0 + impulse / 2.0, abs=2e-3)
    assert engine.momentum() + moving.momentum() == pytest.approx(began, abs=1e-9)
    assert engine.energy() + moving.energy() == pytest.approx(energy, rel=5e-3)


def test_a_figure_in_the_air_keeps_its_energy_and_momentum() -> None:
    figure = wb.load("hand")
    start = figure.posture("relaxed")
    moving = Articulated(wb.Scene(figure), start, wb.Actuated(figure, stiffness=0.0, damping=0.0), None)
    moving.velocity = np.concatenate([(0.3, -0.2, 1.0, 2.0, -3.0, 1.0), 0.2 * np.cos(np.arange(figure.model.nv - 6))])
    mass = sum(inertia.mass for inertia in figure.model.inertias)
    began, energy = moving.momentum(), moving.energy()
    centre = pin.centerOfMass(figure.model, figure.model.createData(), start)
    for _ in range(6):
        moving.advance(start, DT, {}, {})
        assert moving.energy() == pytest.approx(energy, abs=1e-12)
    weight, time = np.array((0.0, 0.0, -9.81 * mass)), 6 * DT
    fallen = began[:3] + time * weight
    # the torque of the weight about the origin, of a centre of mass on its parabola
    turned = began[3:] + np.cross(time * centre + 0.5 * time**2 * began[:3] / mass, weight)
    assert moving.momentum() == pytest.approx(np.concatenate([fallen, turned]), abs=1e-9)
    ended = pin.centerOfMass(figure.model, figure.model.createData(), moving.q)
    assert ended == pytest.approx(centre + time * began[:3] / mass + 0.5 * time**2 * weight / mass, abs=1e-9)


def test_a_figure_with_joints_that_follow_others_keeps_its_energy_and_momentum(tmp_path: Path) -> None:
    """One joint lies beyond the one that follows; Pinocchio's inertia of such joints grew from step to step."""
    inertial = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
    links = "".join(f'<link name="{name}">{inertial}</link>' for name in "abcd")
    way = '<parent link="{}"/><child link="{}"/><origin xyz="{} 0.2 0"/><axis xyz="0 {} 1"/>'
    limit = '<limit lower="-9" upper="9" effort="1" velocity="9"/>'
    ways = way.format("a", "b", 0.5, 1), way.format("a", "c", -0.5, -1), way.format("c", "d", -0.3, 1)
    laws = "", '<mimic joint="j0" multiplier="2"/>', ""
    joints = [f'<joint name="j{k}" type="revolute">{ways[k]}{limit}{laws[k]}</joint>' for k in range(3)]
    (tmp_path / "wings.urdf").write_text(f'<robot name="wings">{links}{"".join(joints)}</robot>')
    figure = wb.load(tmp_path / "wings.urdf", root="free")
    limp = wb.Actuated(figure, stiffness=0.0, damping=0.0)
    moving = Articulated(wb.Scene(figure), figure.neutral, limp, None, np.zeros(3))
    moving.velocity = np.array([0.3, -0.2, 1.0, 2.0, -3.0, 1.0, 1.0, -1.0])

    def kinetic() -> float:
        model = figure.model
        return 0.5 * float(moving.velocity @ pin.crba(model, model.createData(), moving.q) @ moving.velocity)

    began, energy = moving.momentum(), kinetic()
    for _ in range(30):
        moving.advance(figure.neutral, DT, {}, {})
        assert kinetic() == pytest.approx(energy, rel=1e-3)
        assert moving.momentum() == pytest.approx(began, abs=1e-9)


@pytest.mark.parametrize("free", [0.0, {"root": 0.0}])
def test_a_person_who_falls_keeps_the_angular_momentum_at_joint_limits_too(free: Any) -> None:
    figure = wb.load("human")
    model, data = figure.model, figure.model.createData()
    moving = Articulated(wb.Scene(figure), figure.neutral, wb.Actuated(figure, stiffness=free, damping=free), None)
    moving.velocity = 0.5 * np.random.default_rng(5).normal(size=model.nv)
    began = np.array(pin.computeCentroidalMomentum(model, data, moving.q, moving.velocity).angular)
    limited = False
    for _ in range(15):
        moving.advance(figure.neutral, DT, {}, {})
        limited |= moving.points > 0
        ended = pin.computeCentroidalMomentum(model, data, moving.q, moving.velocity).angular
        assert ended == pytest.approx(began, abs=1e-6)  # N m s, of some to begin with
    assert limited
    assert np.linalg.norm(began) > 1.0


def test_what_drives_a_joint_is_given_by_its_name() -> None:
    figure = wb.load("avatar")
    driven = wb.Actuated(figure, stiffness={"root": 500.0, "left_arm": 20.0}, damping={"left_elbow_flexion": 3.0})
    stiffness, damping = driven.gains(np.ones(figure.model.nv))
    elbow = figure.model.joints[figure.joint_id("left_elbow_flexion")].idx_v
    assert stiffness[:6] == pytest.approx(500.0)
    assert (stiffness[elbow], damping[elbow], damping.sum()) == (20.0, 3.0, 3.0)
    assert stiffness.sum() == 6 * 500.0 + 20.0 * len(figure.groups["left_arm"])
    with pytest.raises(wb.UnknownNameError, match="left_elbow_flexion"):
        wb.Actuated(figure, stiffness={"left_elbow_flexio": 1.0})
    with pytest.raises(wb.InputError, match="damping"):
        wb.Actuated(figure, damping=-1.0)
    with pytest.raises(wb.InputError, match="scene is not one of"):
        wb.World(wb.Scene(wb.load("hand")), spring=wb.Actuated(figure))


def balls_at_hand(balls: Any, material: wb.dynamics.Material) -> tuple[Articulated, RigidBodies, dict[str, int]]:
    """A limp hand without weight, and balls of 0.03 m that fly at it: offsets from the palm, masses, velocities."""
    hand = wb.load("hand")
    start, scene = hand.posture("relaxed"), wb.Scene(hand)
    palm = hand.placement(start, "right_palm").translation
    for k, (off, mass, velocity) in enumerate(balls):
        body = wb.Body(mass=mass, velocity=velocity, material=material)
        scene.add(wb.Sphere(0.03), name=f"ball{k}", at=palm + off, body=body)
    engine = RigidBodies(scene, NO_WEIGHT, start)
    moving = Articulated(scene, start, wb.Actuated(hand, stiffness=0.0, damping=0.0), engine)
    return moving, engine, {name: scene.frame_id(name) for name in hand.segments}


@pytest.mark.parametrize(
    ("masses", "bounce"),
    [((0.05, 0.05, 0.02), 0.0), ((10.0, 10.0, 100.0), 1.0)],
)
def test_balls_that_meet_at_a_hand_keep_the_momentum_of_all(masses: tuple[float, ...], bounce: float) -> None:
    ways = ((0.0, 0.02, 0.2), (0.05, 0.0, -0.2), (-0.02, 0.05, 0.3)), ((0, 0, -2.0), (0, 0, 2.5), (0, 0, -4.0))
    material = wb.dynamics.Material("many", {"human": (bounce, 0.3), "many": (bounce, 0.3)})
    balls = [(np.array(off), mass, speed) for off, mass, speed in zip(ways[0], masses, ways[1], strict=True)]
    moving, engine, segments = balls_at_hand(balls, material)
    began, energy, hits = engine.momentum(), engine.energy(), set[str]()
    for _ in range(12):
        moving.advance(moving.q, DT, {}, segments)
        hits |= moving.impulses.keys()
        together = engine.momentum() + moving.momentum()
        assert together[:3] == pytest.approx(began[:3], abs=1e-9 * sum(masses))
        assert moving.energy() + engine.energy() < energy * (1.0 + 1e-9)
        energy = moving.energy() + engine.energy()
    assert len(hits) > 1


@pytest.mark.parametrize("seed", [29, 38, 184])
def test_a_light_hand_between_heavy_balls_keeps_the_momentum_of_all(seed: int) -> None:
    """Its velocity was scaled where it had more energy than things that met it as something that is moved gave it."""
    rng = np.random.default_rng(seed)
    count = rng.integers(1, 6)
    bounce, masses, balls = float(rng.choice([0.0, 0.3, 0.7, 1.0])), 10.0 ** rng.uniform(-1.0, 2.3, count), []
    for k, mass in enumerate(masses):
        off, side = np.array([*rng.uniform(-0.03, 0.03, 2), 0.2 + 0.1 * k]), 1.0 if k % 2 else -1.0
        balls.append((off * (1.0, 1.0, side), mass, (0.0, 0.0, -side * rng.uniform(1.0, 5.0))))
    material = wb.dynamics.Material("many", {"human": (bounce, 0.3), "many": (bounce, 0.3)})
    moving, engine, segments = balls_at_hand(balls, material)
    began, energy, size = engine.momentum()[:3], engine.energy(), 2.0 * np.sqrt(engine.energy() * masses.sum())
    for _ in range(15):
        moving.advance(moving.q, DT, {}, segments)
        assert (engine.momentum() + moving.momentum())[:3] == pytest.approx(began, abs=1e-9 * size)
        assert moving.energy() + engine.energy() < energy * (1.0 + 1e-9)
        energy = moving.energy() + engine.energy()
    assert moving.impulses or np.linalg.norm(moving.momentum()[:3]) > 0.1


def test_a_heavy_ball_that_stays_on_a_falling_person_keeps_the_momentum_of_both() -> None:
    """The weight that the person bears was taken for energy from nowhere: 1.4 N s of 80 were lost."""
    human, slack = wb.load("human"), wb.dynamics.Material("slack", others=(0.0, 0.0))
    start = human.posture("standing").copy()
    start[2] = 50.0
    ball = wb.Body(mass=20.0, velocity=(-4.0, 0.0, 0.0), material=slack)
    scene = wb.Scene(human).add(wb.Sphere(0.15), name="ball", at=(1.5, 0.05, 50.3), body=ball)
    engine = RigidBodies(scene, start=start)
    moving = Articulated(scene, start, wb.Actuated(human, stiffness=0.0, damping=0.0), engine)
    began, mass, met = engine.momentum()[:3], 20.0 + pin.computeTotalMass(human.model), 0
    for number in range(45):
        moving.advance(start, DT, {}, {name: scene.frame_id(name) for name in human.segments})
        met += bool(moving.impulses)
        fallen = (number + 1) * DT * mass * np.asarray(engine.gravity)
        assert (engine.momentum() + moving.momentum())[:3] == pytest.approx(began + fallen, abs=0.01)
    assert met > 4


def test_a_ball_between_a_hand_and_a_table_is_held_there() -> None:
    hand = wb.load("hand")
    start = hand.posture("relaxed")
    x, y, z = hand.placement(start, "right_palm").translation
    scene = wb.Scene(hand).add(wb.HalfSpace(), name="table", at=(0, 0, z - 0.2))
    scene.add(wb.Sphere(0.03), name="ball", at=(x, y, z - 0.1699), body=wb.Body(mass=0.5, material="wood"))
    world = wb.World(scene, start, spring=wb.Actuated(hand))
    tracked = start.copy()
    for _ in range(30):
        tracked[2] = max(tracked[2] - 0.01, start[2] - 0.22)  # into the ball by 0.07 m
        frame = world.step(tracked)
        assert frame.deepest < 1e-4
    assert frame.placements["ball"].translation == pytest.approx((x, y, z - 0.17), abs=0.01)
    assert frame.q[2] - start[2] > -0.18


def test_limp_hands_that_collide_keep_their_angular_momentum() -> None:
    scene = wb.Scene({"one": wb.load("hand"), "other": wb.load("hand", side="left")})
    model, figure = scene.model, scene.figure
    (low, high), start = sorted(figure.roots.values()), figure.posture(figure.postures[0]).copy()
    at, first = model.idx_qs[high], model.idx_vs[high]
    start[at : at + 3] = start[model.idx_qs[low] :][:3] + (0.02, 0.0, 0.25)
    moving = Articulated(
        scene, start, wb.Actuated(figure, stiffness=0.0, damping=0.0), None, gravity=np.array(NO_WEIGHT)
    )
    moving.velocity[:6] = np.concatenate([pin.XYZQUATToSE3(start[:7]).rotation.T @ (0.0, 0.0, 1.0), (0.3, -0.2, 1.3)])
    down = pin.XYZQUATToSE3(start[at : at + 7]).rotation.T @ (0.0, 0.0, -1.0)
    moving.velocity[first : first + 6] = np.concatenate([down, (-1.0, 0.7, 0.2)])
    began, energy, met = moving.momentum(), moving.energy(), 0
    for _ in range(14):
        moving.advance(start, DT, {}, {})
        met += moving.points
    assert moving.momentum() == pytest.approx(began, abs=1e-12)  # it changed by 3e-4 of 0.014 N m s
    assert met > 0
    assert moving.energy() < 0.5 * energy


def test_a_box_comes_to_rest_on_a_hand() -> None:
    hand = wb.load("hand")
    start = hand.posture("open").copy()
    start[3:7] = pin.Quaternion(pin.utils.rotate("x", np.pi) @ pin.XYZQUATToSE3(start[:7]).rotation).coeffs()
    place = hand.placement(start, "right_palm").translation + (0.031, 0.012, 0.03)
    scene = wb.Scene(hand)
    scene.add(wb.Box((0.05, 0.05, 0.03)), name="box", at=place, body=wb.Body(mass=0.5, material="human"))
    stiff = wb.Actuated(hand, stiffness={"root": 3000.0, **dict.fromkeys(hand.joints, 5.0)})
    world, fastest = wb.World(scene, start, spring=stiff), 0.0
    for number in range(60):
        frame = world.step(start)
        fastest = max(fastest, np.abs(world.engine.twist("box")).max() if number > 50 else 0.0)  # type: ignore[union-attr]
    assert frame.impulses["box"] == pytest.approx((0.0, 0.0, 0.5 * 9.81 * DT), abs=1e-3)
    assert fastest < 5e-3  # m/s, rad/s; 0.05 where a step moved it as if nothing bore it


def test_friction_stops_nothing_where_a_figure_moves_along_the_normal_alone(tmp_path: Path) -> None:
    path = tmp_path / "ram.urdf"
    path.write_text(
        """<robot name="ram"><link name="frame"/><link name="head"><inertial><mass value="2"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
        <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
        <joint name="slide" type="prismatic"><parent link="frame"/><child link="head"/><origin xyz="0 0 0.5"/>
        <axis xyz="0 0 1"/><limit lower="-5" upper="5" effort="1" velocity="9"/></joint></robot>"""
    )
    ram = wb.load(path)
    scene = wb.Scene(ram).add(wb.Box((1.0, 1.0, 0.2)), name="block", at=(0.0, 0.0, -0.1))
    world = wb.World(scene, ram.neutral, spring=wb.Actuated(ram, stiffness=0.0, damping=0.0))
    heights = np.array([world.step().q[0] for _ in range(60)])
    falling = 0.5 * 9.81 * (DT * np.arange(1, 17)) ** 2  # it meets the block after 0.286 s
    assert heights[:16] == pytest.approx(-falling, abs=1e-6)
    assert heights[-1] == pytest.approx(-0.4, abs=1e-3)
    assert np.abs(world.velocity).max() < 1e-3
