"""A figure among things that move by themselves: impulses against closed forms, and nothing in each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.dynamics.coupling import contact_impulse
from wholebody.dynamics.rigid_bodies import RigidBodies
from wholebody.scene.matter.body import Surface
from wholebody.tracking.overlaps import overlaps


@pytest.mark.parametrize("friction", [0.0, 0.1, 1e6])
def test_an_impulse_is_that_of_equations_8_to_10(friction: float) -> None:
    """Two balls that meet off centre: restitution along the normal, momentum, friction's cone, energy."""
    masses, radius = (2.0, 0.5), 0.1
    inertia = [0.4 * mass * radius**2 for mass in masses]
    rng = np.random.default_rng(0)
    for _ in range(50):
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        velocity, spin = rng.normal(size=(2, 3)), 5.0 * rng.normal(size=(2, 3))
        arms = (radius * normal, -radius * normal)
        mobility = sum(
            np.eye(3) / mass - pin.skew(arm) @ pin.skew(arm) / own
            for mass, own, arm in zip(masses, inertia, arms, strict=True)
        )

        def relative(velocity=velocity, spin=spin, arms=arms) -> np.ndarray:
            return velocity[1] + np.cross(spin[1], arms[1]) - velocity[0] - np.cross(spin[0], arms[0])

        def energy(velocity=velocity, spin=spin) -> float:
            linear = sum(m * v @ v for m, v in zip(masses, velocity, strict=True))
            return 0.5 * float(linear + sum(i * w @ w for i, w in zip(inertia, spin, strict=True)))

        before, began = relative(), energy()
        impulse = contact_impulse(before, normal, mobility, Surface(0.4, friction))
        if normal @ before >= 0.0:
            assert impulse is None
            continue
        for k, sign in ((0, -1.0), (1, 1.0)):
            velocity[k] += sign * impulse / masses[k]
            spin[k] += sign * np.cross(arms[k], impulse) / inertia[k]
        after = relative()
        bounce = 0.4 if normal @ before < -0.05 else 0.0  # what comes slowly does not bounce
        assert normal @ after == pytest.approx(-bounce * (normal @ before), abs=1e-9)
        along = impulse - (normal @ impulse) * normal
        assert np.linalg.norm(along) <= friction * (normal @ impulse) + 1e-12
        assert energy() <= began + 1e-12
        slid = after - (normal @ after) * normal
        if friction == 1e6:
            assert np.linalg.norm(slid) == pytest.approx(0.0, abs=1e-9)  # it sticks, and does not slide back


def arm_world(planar_arm, **more: object) -> tuple[wb.World, wb.Scene]:
    """An arm that turns in the plane of a table without friction of its own, and a ball that it pushes."""
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3)))
    scene.add(wb.Box((3.0, 3.0, 0.1)), name="table", at=(0.0, 0.0, -0.2501))
    scene.add(wb.Sphere(0.2), name="ball", at=(0.9, 0.35, 0.0), body=wb.Body(mass=0.5))
    return wb.World(scene, np.zeros(3), **more), scene


@pytest.mark.parametrize(("overlap", "give_way"), [("ccd", "figure"), ("qp", "both")])
def test_an_arm_pushes_a_ball_and_never_is_in_it(planar_arm, overlap: str, give_way: str) -> None:
    world, scene = arm_world(planar_arm, overlap=overlap, give_way=give_way)
    pushed, ball = 0, []
    for frame in range(45):
        made = world.step(np.array([min(0.6, 0.02 * frame), 0.0, 0.0]))
        assert made.deepest <= 1e-4
        assert not made.collisions
        assert not made.overlaps
        assert -scene.contacts(made.q, 0.0).distance.min(initial=0.0) == pytest.approx(made.deepest, abs=1e-9)
        place = made.placements["ball"]
        assert scene.objects["ball"].placement == place
        pushed += bool(made.impulses)
        ball.append(place.translation.copy())
    assert pushed
    assert ball[-1][1] > 0.45  # away, the way the arm turned
    assert made.time == pytest.approx(0.75)


def test_a_ball_goes_on_from_where_half_an_overlap_has_put_it(planar_arm, monkeypatch) -> None:
    world, scene = arm_world(planar_arm, give_way="both")
    engine, shown, moved = world.engine, world.scene.objects["ball"].placement, 0.0
    advance = engine.advance

    def watched(*given: object) -> object:
        nonlocal moved
        moved = max(moved, float(np.linalg.norm(scene.objects["ball"].placement.translation - shown.translation)))
        assert engine.placement("ball").isApprox(scene.objects["ball"].placement, 1e-9)
        return advance(*given)

    monkeypatch.setattr(engine, "advance", watched)
    for frame in range(30):
        shown = world.step(np.array([0.02 * frame, 0.0, 0.0])).placements["ball"]
    assert moved > 1e-4  # by the half of an overlap


def test_a_figure_of_springs_refuses_half_an_overlap(planar_arm) -> None:
    scene = arm_world(planar_arm)[1]
    soft = wb.Actuated(scene.figure)
    with pytest.raises(wb.InputError, match=r"give_way \"both\" is for a figure without wb\.Actuated"):
        wb.World(scene, np.zeros(3), spring=soft, give_way="both")
    world = wb.World(scene, np.zeros(3), spring=soft)
    with pytest.raises(wb.InputError, match=r"without wb\.Actuated"):
        world.give_way = "both"


def test_the_same_seed_gives_the_same_motion(planar_arm) -> None:
    runs = []
    for _ in range(2):
        world, _ = arm_world(planar_arm, seed=3)
        frames = [world.step(np.array([0.015 * k, 0.0, 0.1])) for k in range(25)]
        runs.append([(frame.q, frame.placements["ball"].homogeneous) for frame in frames])
    for (q, place), (other, placed) in zip(*runs, strict=True):
        assert (q == other).all()
        assert (place == placed).all()


def test_a_free_figure_follows_its_tracker(planar_arm) -> None:
    world = wb.World(wb.Scene(planar_arm((0.5, 0.4, 0.3))), np.zeros(3))
    assert world.engine is None
    for frame in range(40):
        tracked = np.array([0.01 * frame, 0.0, 0.0])
        made = world.step(tracked)
    assert made.q == pytest.approx(tracked, abs=2e-3)
    assert made.wanted == pytest.approx(tracked, abs=2e-3)
    made = world.step(np.array([np.nan, 0.0, 0.0]))
    assert "the one before counts" in made.note
    for _ in range(30):
        made = world.step()
    assert made.q == pytest.approx(tracked, abs=1e-3)


def test_what_the_user_moves_pushes_what_moves_by_itself_and_is_kept_off_the_figure(planar_arm) -> None:
    world, scene = arm_world(planar_arm)
    scene.remove("ball").add(wb.Sphere(0.1), name="ball", at=(0.6, 0.6, -0.1), body=wb.Body(mass=0.5))
    scene.add(wb.Box((0.3, 0.05, 0.3)), name="board", at=(0.6, 0.8, 0.0))
    with pytest.raises(wb.InputError, match="make a new world"):
        world.step()
    world, y = wb.World(scene, np.zeros(3)), 0.8
    for _ in range(20):
        y -= 1.0 / 60.0
        scene.move("board", at=(0.6, y, 0.0), over=world.dt)
        made = world.step(np.zeros(3))
        assert made.deepest <= 1e-4
    assert made.placements["ball"].translation[1] < 0.45


def test_overlaps_are_of_objects_and_are_shared_where_both_may_move(planar_arm) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3)))
    scene.add(wb.Box((0.5, 0.2, 0.2)), name="wall", at=(0.5, 0.1, 0.0))
    scene.add(wb.Sphere(0.1), name="ball", at=(1.05, 0.11, 0.0), body=wb.Body())
    found = {one.second: one for one in overlaps(scene, np.zeros(3), "both")}
    assert set(found) == {"wall", "ball"}
    assert {one.first for one in found.values()} == {scene.figure.name}
    wall, ball = found["wall"], found["ball"]
    assert wall.pairs == 2  # two links, one object
    assert wall.depth[1] < 0.0  # out of the wall
    assert wall.moves_first == pytest.approx(wall.depth)
    assert wall.moves_second == pytest.approx(np.zeros(3))
    assert ball.moves_first == pytest.approx(0.5 * ball.depth)
    assert ball.moves_second == pytest.approx(-0.5 * ball.depth)
    alone = next(one for one in overlaps(scene, np.zeros(3)) if one.second == "ball")  # the figure has priority
    assert alone.moves_first == pytest.approx(ball.depth)
    assert not alone.moves_second.any()
    pairs = [
        k
        for k, names in enumerate(scene.contacts(np.zeros(3), 0.0).pair)
        if "wall" in {scene.piece_owner[i] for i in names}
    ]
    near = scene.contacts(np.zeros(3), 0.0)
    depths = -near.distance[pairs]
    assert np.linalg.norm(wall.depth) == pytest.approx(float((depths**2).sum() / depths.sum()), rel=1e-6)


def test_a_thing_of_the_figures_name_overlaps_it(planar_arm) -> None:
    figure = planar_arm((0.5, 0.4, 0.3))
    scene = wb.Scene(figure).add(wb.Sphere(0.1), name=figure.name, at=(1.05, 0.11, 0.0), body=wb.Body())
    assert [one.second for one in overlaps(scene, np.zeros(3))] == [figure.name]


def test_a_world_begins_in_its_start_and_not_in_the_first_posture() -> None:
    figure = wb.load("avatar")
    first = figure.posture(figure.postures[0])
    at = figure.placement(first, "head").translation
    scene = wb.Scene(figure).add(wb.Box((0.2, 0.2, 0.2)), name="carton", at=at, body=wb.Body(mass=1.0))
    with pytest.raises(wb.InputError, match="overlap by"):
        RigidBodies(scene)
    aside = first.copy()
    aside[0] += 1.5  # the whole figure
    world = wb.World(scene, aside)
    assert world.engine is not None
    head = world.engine.placement("head").translation
    assert head == pytest.approx(figure.placement(world.q, "head").translation, abs=1e-9)
    assert world.step(aside).deepest <= 1e-4
    scene.move("carton", at=figure.placement(aside, "head").translation)
    with pytest.raises(wb.InputError, match="overlap by"):
        RigidBodies(scene, start=aside)


def test_a_tower_that_touches_exactly_gains_no_more_than_its_work() -> None:
    scene = wb.Scene(wb.load("hand")).add(wb.HalfSpace(offset=-2.0), name="floor")
    for k in range(10):
        scene.add(wb.Box((0.2, 0.2, 0.2)), name=f"box {k}", at=(3.0, 0.0, -1.9 + 0.2 * k), body=wb.Body(mass=8.0))
    engine = RigidBodies(scene)
    energy = engine.energy()
    for _ in range(30):
        frame = engine.advance(1 / 60)
        assert frame.energy - energy <= frame.work + 1e-9
        energy = frame.energy


def squeezed(planar_arm) -> tuple[wb.World, wb.Scene]:
    """A ball on a table between two fixed things."""
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3)))
    scene.add(wb.Box((3.0, 3.0, 0.1)), name="table", at=(2.0, 0.0, -1.05))
    scene.add(wb.Sphere(0.1), name="ball", at=(2.0, 0.0, -0.8999), body=wb.Body(mass=1.0))
    scene.add(wb.Box((0.2, 0.4, 0.4)), name="wall", at=(2.2001, 0.0, -0.7999))
    scene.add(wb.Box((0.2, 0.4, 0.4)), name="press", at=(1.7999, 0.0, -0.7999))
    return wb.World(scene, np.zeros(3)), scene


def test_a_ball_that_is_squeezed_is_told(planar_arm) -> None:
    world, scene = squeezed(planar_arm)
    for k in range(4):
        press = 1.7999 + 0.01 * (k + 1)
        scene.move("press", at=(press, 0.0, -0.7999), over=world.dt)
        made = world.step()
    x = made.placements["ball"].translation[0]
    deepest = max(x + 0.1 - 2.1001, press + 0.1 - (x - 0.1))
    assert deepest > 0.015
    assert made.deepest == pytest.approx(deepest, abs=1e-4)
    pairs = {frozenset((one.first, one.second)) for one in made.overlaps}
    assert pairs & {frozenset(("ball", "wall")), frozenset(("ball", "press"))}
    told = {frozenset((one.first, one.second)): one.depth for one in made.collisions}
    assert max(told.values()) == pytest.approx(deepest, abs=1e-4)
    assert "overlap by" in made.note
    found = scene.penetration(made.q)
    assert max(one.deepest for one in found) == pytest.approx(deepest, abs=1e-4)
    for one in made.overlaps:  # only the ball may move
        assert one.moves_first.any() == (one.first == "ball")
        assert one.moves_second.any() == (one.second == "ball")


@pytest.mark.parametrize("depth", [0.002, 0.05])
def test_two_fixed_things_that_the_user_puts_into_each_other_are_told(planar_arm, depth: float) -> None:
    world, scene = squeezed(planar_arm)
    scene.move("wall", at=(2.0, 0.0, 0.5))
    scene.move("press", at=(1.8 + depth, 0.0, 0.5))
    made = world.step()
    assert made.deepest == pytest.approx(depth, abs=1e-4)
    assert {frozenset((one.first, one.second)) for one in made.overlaps} == {frozenset(("wall", "press"))}
    assert [{one.first, one.second} for one in made.collisions] == [{"wall", "press"}]
    assert not any(one.moves_first.any() or one.moves_second.any() for one in made.overlaps)
    assert [{one.a, one.b} for one in scene.penetration(made.q)] == [{"wall", "press"}]
    made = world.step()  # it stays, and nobody moved
    assert made.deepest == pytest.approx(depth, abs=1e-4)
    assert not made.collisions


def test_things_that_a_joint_holds_together_and_half_spaces_are_no_overlap(planar_arm) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3)))
    scene.add(wb.HalfSpace((0.0, 0.0, 1.0), -2.0), name="floor").add(wb.HalfSpace((0.0, -1.0, 0.0), -3.0), name="wall")
    scene.add(wb.Box((0.2, 0.2, 0.2)), name="post", at=(2.0, 0.0, 0.0))
    hinge = wb.dynamics.Hinge(at=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), to="post")
    scene.add(wb.Box((0.5, 0.1, 0.5)), name="door", at=(2.1, 0.0, 0.0), body=wb.Body(mass=5.0, joints=[hinge]))
    made = wb.World(scene, np.zeros(3)).step()
    assert made.deepest == 0.0
    assert made.overlaps == made.collisions == ()
    assert scene.penetration(np.zeros(3)) == []


def test_a_body_that_is_put_elsewhere_wakes_and_its_weight_was_lifted_by_work() -> None:
    scene = wb.Scene(wb.load("hand")).add(wb.HalfSpace(), name="floor", at=(0.0, 0.0, -1.0))
    scene.add(wb.Sphere(0.1), name="ball", at=(1.0, 0.0, -0.8999), body=wb.Body(mass=2.0))
    engine = RigidBodies(scene)
    for _ in range(60):
        frame = engine.advance(1 / 60)
    assert frame.sleeping == 1
    before, place = engine.energy(), engine.placement("ball").translation
    engine.put("ball", pin.SE3(np.eye(3), place + (0.0, 0.0, 0.5)))
    frame = engine.advance(1 / 60)
    assert frame.work == pytest.approx(2.0 * 9.81 * 0.5, rel=1e-6)
    assert engine.energy() - before == pytest.approx(frame.work, rel=1e-6)
    assert engine.placement("ball").translation[2] == pytest.approx(place[2] + 0.5 - 0.5 * 9.81 / 60**2, abs=1e-4)


def test_a_body_that_the_user_moves_in_the_scene_goes_on_from_there(planar_arm) -> None:
    scene = wb.Scene(planar_arm([0.5, 0.4]))
    scene.add(wb.Sphere(0.1), name="ball", at=(0.0, 0.0, 3.0), body=wb.Body(mass=1.0))
    world = wb.World(scene)
    for _ in range(3):
        world.step()
    scene.move("ball", at=(1.0, 0.0, 4.0))
    frame = world.step()
    fallen = 0.5 * 9.81 * world.dt**2 * (4**2 - 3**2)
    assert frame.placements["ball"].translation == pytest.approx((1.0, 0.0, 4.0 - fallen), abs=1e-9)


def test_a_ragdoll_that_squeezes_boxes_gives_them_no_energy_from_nowhere() -> None:
    scene = wb.Scene(wb.load("avatar")).add(wb.HalfSpace(), name="floor")
    for k in range(4):
        at = (0.15 + 0.31 * (k % 2), -0.16 + 0.32 * (k // 2), 0.1002)
        scene.add(wb.Box((0.3, 0.3, 0.2)), name=f"box {k}", at=at, body=wb.Body(density=200.0))
    start = scene.figure.posture("standing").copy()
    start[:7] = (0.5, 0.0, 1.3, np.sin(0.5), 0.0, 0.0, np.cos(0.5))
    world = wb.World(scene, start, spring=wb.Actuated(scene.figure, stiffness=0.0, damping=1.0))
    energies = [world.energy]
    for _ in range(32):
        world.step()
        energies.append(world.energy)
    assert np.diff(energies).max() < 1e-6  # J; 10 kJ where all blows on a box between thigh and floor were taken back
    assert energies[-1] < 0.6 * energies[0]


@pytest.mark.parametrize("yields", [False, True])
def test_a_figure_without_pieces_touches_nothing(tmp_path: Path, yields: bool) -> None:
    body = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
    (tmp_path / "link.urdf").write_text(f'<robot name="one"><link name="link">{body}</link></robot>')
    figure = wb.load(tmp_path / "link.urdf", root="free")
    scene = wb.Scene(figure).add(wb.Sphere(0.05), name="ball", at=(0.0, 0.0, 0.3), body=wb.Body(mass=0.5))
    world = wb.World(scene, spring=wb.Actuated(figure, stiffness=0.0, damping=0.0) if yields else None)
    for _ in range(30):
        world.step()
    fallen = 0.3 - 0.5 * 9.81 * world.time**2
    assert scene.objects["ball"].placement.translation == pytest.approx((0.0, 0.0, fallen), abs=1e-9)


def test_what_falls_out_of_the_world_falls_on_without_a_word(recwarn: pytest.WarningsRecorder) -> None:
    scene = wb.Scene(wb.load("hand")).add(wb.Sphere(0.1), name="ball", at=(2.0, 0.0, 0.0), body=wb.Body(mass=1.0))
    world = wb.World(scene, dt=0.1)
    for _ in range(60):
        frame = world.step()
    assert frame.placements["ball"].translation[2] == pytest.approx(-0.5 * 9.81 * 6.0**2)
    assert not [one for one in recwarn if issubclass(one.category, UserWarning)]  # each frame beyond 100 m had one
