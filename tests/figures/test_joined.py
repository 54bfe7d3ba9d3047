"""Several figures as one: each is what it is alone, under names of its own."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.flesh import settle
from wholebody.figures import join
from wholebody.figures.self_pairs import random_postures

ARM = Path(__file__).parents[2] / "examples" / "tasks" / "arm.urdf"
TURNED = (1.1, -0.2, 0.4, 0.0, 0.0, np.sin(0.6), np.cos(0.6))

FOLLOWING = """<robot name="gripper"><link name="palm"/><link name="left"/><link name="right"/>
<joint name="close" type="prismatic"><parent link="palm"/><child link="left"/><axis xyz="0 1 0"/>
<limit lower="0" upper="0.04" effort="1" velocity="1"/></joint>
<joint name="follow" type="prismatic"><parent link="palm"/><child link="right"/><axis xyz="0 -1 0"/>
<mimic joint="close" multiplier="0.5" offset="0.01"/><limit lower="0" upper="0.04" effort="1" velocity="1"/></joint>
</robot>"""


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> dict[str, wb.Figure]:
    gripper = tmp_path_factory.mktemp("gripper") / "gripper.urdf"
    gripper.write_text(FOLLOWING)
    return {
        "arm": wb.load(ARM),
        "anna": wb.load("human", sex="female"),
        "gripper": wb.load(gripper),
        "ben": wb.load("avatar"),
    }


@pytest.fixture(scope="module")
def joined(alone: dict[str, wb.Figure]) -> wb.Figure:
    return join({name: (figure, TURNED) for name, figure in alone.items()})


def _postures(alone: dict[str, wb.Figure], seed: int) -> dict[str, np.ndarray]:
    found = {}
    for number, (name, figure) in enumerate(alone.items()):
        q = random_postures(figure.model, 1, seed + number)[0]
        if figure.roots:
            q[:7] = 0.3, -0.8, 1.2, *pin.Quaternion(pin.exp3(np.array((0.3, -0.2, 0.5)))).coeffs()
        found[name] = q
    return found


def test_every_frame_is_where_it_is_alone(alone: dict[str, wb.Figure], joined: wb.Figure) -> None:
    parts = _postures(alone, 5)
    q = joined.posture(parts)
    moved = pin.XYZQUATToSE3(np.array(TURNED))
    assert joined.model.nq == sum(figure.model.nq for figure in alone.values())
    for name, figure in alone.items():
        assert joined.part(name, q) == pytest.approx(parts[name], abs=0.0)
        at = pin.SE3.Identity() if figure.roots else moved
        for frame in (*figure.frames, *figure.segments, *figure.joints):
            expected = at * figure.placement(parts[name], frame)
            found = joined.placement(q, f"{name}/{frame}")
            assert np.abs(found.homogeneous - expected.homogeneous).max() < 1e-12, frame


@pytest.mark.parametrize("order", [("arm", "arm", "arm"), ("arm", "anna", "arm"), ("anna", "arm", "gripper")])
def test_pieces_are_of_the_links_that_they_are_of_alone(alone: dict[str, wb.Figure], order: tuple[str, ...]) -> None:
    """In a scene of three, pieces of the first arm were its joints' by name, and a world of them was a KeyError."""
    members = {f"{name}{k}": alone[name] for k, name in enumerate(order)}
    scene = wb.Scene({name: (figure, (2.0 * k, 0.0, 0.0)) for k, (name, figure) in enumerate(members.items())})
    expected = [
        f"{name}/{figure.model.frames[piece.parentFrame].name}"
        for name, figure in members.items()
        for piece in figure.geometry.geometryObjects
    ]
    assert list(scene.piece_owner) == expected
    scene.add(wb.Sphere(0.05), name="ball", at=(1.0, 5.0, 3.0), body=wb.Body(mass=0.3))
    assert wb.World(scene).step().placements["ball"].translation[2] < 3.0


def test_parts_are_those_of_each(alone: dict[str, wb.Figure], joined: wb.Figure) -> None:
    for name, figure in alone.items():
        mine = [joined.model.joints[k] for k in joined.bodies[f"{name}/"]]
        first = mine[0].idx_v
        dofs = slice(first, first + figure.model.nv)
        assert joined.effort_weights[dofs] == pytest.approx(figure.effort_weights, abs=0.0)
        assert joined.neutral_weights[dofs] == pytest.approx(figure.neutral_weights, abs=0.0)
        assert {f"{name}/{group}" for group in figure.groups} <= set(joined.groups)
        assert joined.joint_names(name) == tuple(f"{name}/{joint}" for joint in figure.joints)
        for kind in ("chains", "cones", "ranges", "collision_groups", "followers"):
            own = {key for key in getattr(joined, kind) if key.startswith(f"{name}/")}
            assert own == {f"{name}/{key}" for key in getattr(figure, kind)}
    assert set(joined.roots) == {"anna/root", "ben/root"}
    q = joined.posture(_postures(alone, 8))
    values = joined.joint_values(q)
    for name, figure in alone.items():
        expected = figure.joint_values(joined.part(name, q))
        assert {joint: values[f"{name}/{joint}"] for joint in expected} == pytest.approx(expected)


def test_mass_momentum_and_energy_are_sums(alone: dict[str, wb.Figure]) -> None:
    figures = {name: figure for name, figure in alone.items() if name != "gripper"}  # Pinocchio knows no mimic here
    joined = join({name: (figure, TURNED) for name, figure in figures.items()})
    q, rng = joined.posture(_postures(figures, 11)), np.random.default_rng(2)
    v = rng.normal(size=joined.model.nv)
    data = joined.model.createData()
    pin.computeCentroidalMomentum(joined.model, data, q, v)
    linear, energy, mass = np.zeros(3), 0.0, 0.0
    for name, figure in figures.items():
        first = joined.model.joints[joined.bodies[f"{name}/"][0]].idx_v
        own, mine = figure.model.createData(), v[first : first + figure.model.nv]
        pin.computeCentroidalMomentum(figure.model, own, joined.part(name, q), mine)
        turn = np.eye(3) if figure.roots else pin.XYZQUATToSE3(np.array(TURNED)).rotation
        linear += turn @ own.hg.linear
        energy += pin.computeKineticEnergy(figure.model, own, joined.part(name, q), mine)
        mass += sum(inertia.mass for inertia in figure.model.inertias[1:])
    assert data.hg.linear == pytest.approx(linear, rel=1e-10)
    assert pin.computeKineticEnergy(joined.model, data, q, v) == pytest.approx(energy, rel=1e-10)
    assert sum(inertia.mass for inertia in joined.model.inertias[1:]) == pytest.approx(mass)


def test_centre_of_mass_of_one_of_several(alone: dict[str, wb.Figure], joined: wb.Figure) -> None:
    q = joined.posture(_postures(alone, 3))
    state = wb.Scene(alone["anna"]).state(joined.part("anna", q))
    several = wb.Scene({name: (figure, TURNED) for name, figure in alone.items()}).state(q)
    joints = joined.bodies["anna/"]
    assert several.center_of_mass(joints) == pytest.approx(state.center_of_mass(), abs=1e-12)
    rows = several.center_of_mass_jacobian(joints)
    first = joined.model.joints[joints[0]].idx_v
    assert rows[:, first : first + 55] == pytest.approx(state.center_of_mass_jacobian(), abs=1e-12)
    assert np.abs(np.delete(rows, np.s_[first : first + 55], axis=1)).max() == 0.0


def test_pairs_are_those_of_each_and_all_between(alone: dict[str, wb.Figure], joined: wb.Figure) -> None:
    pieces = joined.geometry.geometryObjects
    owner = [piece.name.partition("/")[0] for piece in pieces]
    count = dict.fromkeys(alone, 0)
    between = 0
    for pair in joined.geometry.collisionPairs:
        if owner[pair.first] == owner[pair.second]:
            count[owner[pair.first]] += 1
        else:
            between += 1
    assert count == {name: len(figure.geometry.collisionPairs) for name, figure in alone.items()}
    still = [piece.parentJoint == 0 for piece in pieces]
    expected = sum(owner[a] != owner[b] and not (still[a] and still[b]) for a in range(len(pieces)) for b in range(a))
    assert between == expected


def test_postures_pose_those_that_have_them(alone: dict[str, wb.Figure], joined: wb.Figure) -> None:
    sitting = joined.posture("sitting")
    for name in ("anna", "ben"):
        assert joined.part(name, sitting)[7:] == pytest.approx(alone[name].posture("sitting")[7:])
    one = joined.posture("anna/sitting")
    assert joined.part("anna", one) == pytest.approx(joined.part("anna", sitting))
    assert joined.part("ben", one) == pytest.approx(joined.part("ben", joined.neutral))
    assert joined.part("arm", one) == pytest.approx(alone["arm"].neutral)
    root = pin.XYZQUATToSE3(joined.part("anna", joined.neutral)[:7])
    own = pin.XYZQUATToSE3(np.array(alone["anna"].neutral[:7]))
    expected = pin.XYZQUATToSE3(np.array(TURNED)) * own
    assert root.homogeneous == pytest.approx(expected.homogeneous, abs=1e-12)


def test_it_is_pickled_copied_and_reduced(joined: wb.Figure) -> None:
    for other in (pickle.loads(pickle.dumps(joined)), copy.deepcopy(joined)):
        assert other.neutral == pytest.approx(joined.neutral, abs=0.0)
        assert other.roots == joined.roots
        assert tuple(other.members) == tuple(joined.members)
    small = joined.reduced(["ben/root", "anna/left_arm"])
    assert set(small.roots) == {"ben/root"}
    assert small.effort_weights[small.dofs("ben/root")] == pytest.approx(joined.effort_weights[joined.dofs("ben/root")])
    palm = small.placement(small.neutral, "anna/left_palm")
    assert palm.homogeneous == pytest.approx(joined.placement(joined.neutral, "anna/left_palm").homogeneous, abs=1e-12)


def test_a_hand_on_an_arm(alone: dict[str, wb.Figure]) -> None:
    arm, hand = alone["arm"], wb.load("hand")
    tip = next(iter(arm.chains.values())).tip
    at = pin.SE3(pin.exp3(np.array((0.2, 0.1, -0.4))), np.array((0.0, 0.02, 0.05)))
    made = arm.mounted(hand, on=tip, name="hand", at=at)
    assert made.root == "fixed"
    assert made.model.nv == arm.model.nv + hand.model.nv - 6
    assert made.joint_names("hand") == tuple(f"hand/{joint}" for joint in hand.joints)
    rng = np.random.default_rng(4)
    angles = {joint: float(rng.uniform(0.0, 0.5)) for joint in hand.joints}
    arm_q = random_postures(arm.model, 1, 6)[0]
    q = made.with_joints(made.neutral, arm.joint_values(arm_q) | {f"hand/{name}": a for name, a in angles.items()})
    alone_q = hand.with_joints(hand.neutral, angles)
    for frame in (*hand.frames, *hand.segments):
        expected = arm.placement(arm_q, tip) * at * hand.placement(alone_q, frame)
        assert made.placement(q, f"hand/{frame}").homogeneous == pytest.approx(expected.homogeneous, abs=1e-12)
    assert not any(contact < 0.0 for contact in wb.Scene(made).contacts(made.neutral, 0.0).distance)
    tested = {
        frozenset(
            made.model.frames[made.geometry.geometryObjects[k].parentFrame].name for k in (pair.first, pair.second)
        )
        for pair in made.geometry.collisionPairs
    }
    base = arm.model.frames[arm.geometry.geometryObjects[0].parentFrame].name
    assert all(frozenset((base, f"hand/{segment}")) in tested for segment in hand.segments if "distal" in segment)


def test_the_arm_is_a_part_of_the_fingers_of_a_hand_on_it(alone: dict[str, wb.Figure]) -> None:
    arm, place = alone["arm"], np.array((0.45, 0.15, 0.4))
    tip = next(iter(arm.chains.values())).tip
    made = arm.mounted(wb.load("hand"), on=tip, name="hand", at=(0.0, 0.0, 0.12))
    limb = next(iter(arm.chains.values())).joints
    assert all(chain.joints[: len(limb)] == limb for name, chain in made.chains.items() if name.startswith("hand/"))
    found = wb.solve(wb.Problem(wb.Scene(made), goals=[wb.Point("hand/right_index_tip", place)]), method="ccd")
    assert found.status == "solved"  # the finger alone left 983 mm
    assert made.placement(found.q, "hand/right_index_tip").translation == pytest.approx(place, abs=2e-3)


def test_penetration_between_figures_is_that_of_coal(alone: dict[str, wb.Figure]) -> None:
    scene = wb.Scene({"anna": alone["anna"], "ben": (alone["ben"], (0.12, 0.1, 0.0, 0.0, 0.0, 1.0, 0.0))})
    q = scene.figure.neutral
    found = {tuple(pair): depth for pair, depth in zip(*_overlaps(scene, q), strict=True)}
    data, pieces = scene.state(q).data, scene.geometry.geometryObjects
    at = pin.GeometryData(scene.geometry)
    pin.updateGeometryPlacements(scene.model, data, scene.geometry, at)
    settle(scene.geometry, at)
    placed = list(at.oMg)
    owner = [name.partition("/")[0] for name in scene.piece_owner]
    deepest = {}
    for a in range(len(pieces)):
        for b in range(a + 1, len(pieces)):
            if owner[a] != owner[b]:
                one, other = (coal.Transform3s(placed[k].rotation, placed[k].translation) for k in (a, b))
                shapes = pieces[a].geometry, one, pieces[b].geometry, other
                gap = coal.distance(*shapes, coal.DistanceRequest(), coal.DistanceResult())
                if gap < 0.0:
                    deepest[a, b] = gap
    assert len(deepest) > 20
    assert set(found) == set(deepest)
    assert [found[pair] for pair in deepest] == pytest.approx(list(deepest.values()), abs=1e-6)


def _overlaps(scene: wb.Scene, q: np.ndarray) -> tuple[list[list[int]], np.ndarray]:
    near = scene.contacts(q, 0.0)
    return near.pair.tolist(), near.distance


def test_a_link_may_have_the_name_of_its_joint(tmp_path: Path) -> None:
    """So it is in files of Nao. Links 0.2 m beside their joints are where they are alone."""
    text = FOLLOWING.replace('"left"', '"close"').replace('xyz="0 1 0"/>', 'xyz="0 1 0"/><origin xyz="0.2 0 0"/>')
    (tmp_path / "one.urdf").write_text(text)
    one = wb.load(tmp_path / "one.urdf")
    both = join({"a": one, "b": (one, (1.0, 0.0, 0.0))})
    q = both.with_joints(both.posture("neutral"), {"a/close": 0.03, "b/close": 0.01})
    for name, place in (("a/close", (0.2, 0.03, 0.0)), ("b/close", (1.2, 0.01, 0.0))):
        np.testing.assert_allclose(both.placement(q, name).translation, place, atol=1e-12)
    kinds = [(frame.name, str(frame.type)) for frame in both.model.frames]
    assert len(set(kinds)) == len(kinds)
    assert {("a/close", "JOINT"), ("a/close", "BODY")} <= set(kinds)


def test_mounting_on_several_figures_says_what_to_do() -> None:
    hand = wb.load("hand")
    both = wb.Scene({"one": hand, "other": (hand, (1.0, 0.0, 0.0))}).figure
    with pytest.raises(wb.InputError, match="'one and other' is several figures; mount one on another before they are"):
        both.mounted(wb.load("hand"), on="one/right_palm")
