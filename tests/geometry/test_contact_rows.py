"""Contact rows: derivatives against differences of coal's distance, places against geometry, arrays against loops."""

from __future__ import annotations

import itertools

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

import wholebody as wb
from tests.reference.contact_rows import ReferenceRowBuilder
from wholebody.geometry import contact_rows as module
from wholebody.geometry.contact_rows import ContactRowBuilder

SHAPES = {
    "sphere": wb.Sphere(0.15),
    "capsule": wb.Capsule(0.09, 0.25),
    "box": wb.Box((0.4, 0.3, 0.24)),
    "hull": wb.Hull(np.random.default_rng(5).normal(size=(30, 3)) * 0.15),
    "ellipsoid": wb.Ellipsoid((0.25, 0.2, 0.16)),
    "half-space": wb.HalfSpace(),
}
GAPS = {
    "apart": 0.03,
    "touching": 2e-5,
    "touching inside": -2e-5,
    "1 cm in": -0.01,
}


def turned(rng):
    return pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()


def distance_of(scene, q):
    """Signed distance of the only pair, from coal."""
    piece = scene.geometry.geometryObjects
    data, placed = scene.model.createData(), pin.GeometryData(scene.geometry)
    pin.updateGeometryPlacements(scene.model, data, scene.geometry, placed, q)
    pair = scene.geometry.collisionPairs[0]
    at = [coal.Transform3s(placed.oMg[i].rotation, placed.oMg[i].translation) for i in (pair.first, pair.second)]
    result = coal.DistanceResult()
    coal.distance(piece[pair.first].geometry, at[0], piece[pair.second].geometry, at[1], coal.DistanceRequest(), result)
    return result.min_distance, np.array(result.normal)


def placed_at(scene, q):
    """Pinocchio's own placements of the pieces."""
    data, placed = scene.model.createData(), pin.GeometryData(scene.geometry)
    pin.updateGeometryPlacements(scene.model, data, scene.geometry, placed, q)
    return placed


def rows_of(scene, q, within=0.1):
    """Contacts, rows and their Jacobian at a posture."""
    with scene.borrow() as workspace:
        contacts = workspace.near(q, within)
    rows = scene.built.rows.rows(contacts)
    return contacts, rows, scene.state(q).rows(rows.wrench, rows.second, rows.first)


def posed(scene, gap, rng):
    """A posture with random turns in which the only pair has this signed distance.

    The pieces are drawn out of each other along the shortest way, so that they do not meet corner to corner, where the
    distance has a kink.
    """
    q = scene.figure.neutral
    pieces, pair = scene.geometry.geometryObjects, scene.geometry.collisionPairs[0]
    for k in range(0, scene.model.nq, 7):
        q[k + 3 : k + 7] = turned(rng)
    if scene.model.nq == 7 and scene.objects["thing"].shape is not SHAPES["half-space"]:
        q[:3] = scene.objects["thing"].placement.translation
    q[:3] += 0.02 * rng.normal(size=3)
    sign = 1.0 if pieces[pair.second].parentJoint == 1 else -1.0
    for _ in range(80):
        distance, normal = distance_of(scene, q)
        if abs(distance - gap) < 1e-9:
            break
        q[:3] += sign * normal * (gap - distance)
    return q


@pytest.mark.parametrize(
    ("moving", "other"),
    [pair for pair in itertools.combinations_with_replacement(SHAPES, 2) if pair != ("half-space", "half-space")],
)
def test_witness_row_is_the_derivative_of_the_distance(free_bodies, moving, other):
    """Central differences of coal's distance, root against a fixed object and two moving bodies."""
    for gap in GAPS.values():
        row_of_one_gap(free_bodies, moving, other, gap)


def row_of_one_gap(free_bodies, moving, other, gap):
    rng = np.random.default_rng([*map(len, (moving, other)), int(1e5 * (gap + 1))])
    fixed = wb.Scene(free_bodies(SHAPES[moving])).add(SHAPES[other], name="thing", at=(0.1, -0.2, 0.05))
    scenes = [fixed] if other == "half-space" else [fixed, wb.Scene(free_bodies(SHAPES[moving], SHAPES[other]))]
    round_off = "ellipsoid" in (moving, other)
    step, tolerance = (1e-3, 1e-2) if round_off else (1e-5, 2e-4)
    for scene in scenes:
        q = posed(scene, gap, rng)
        contacts, rows, jacobian = rows_of(scene, q)
        assert contacts.distance == pytest.approx([gap], abs=1e-5 if round_off else 2e-6)
        assert rows.gap[0] == contacts.distance[0]
        for k, direction in enumerate(np.eye(scene.model.nv)):
            ahead = distance_of(scene, pin.integrate(scene.model, q, step * direction))[0]
            behind = distance_of(scene, pin.integrate(scene.model, q, -step * direction))[0]
            assert jacobian[0, k] == pytest.approx((ahead - behind) / (2 * step), abs=tolerance)


def planes(piece):
    """Faces (f, 4) of a box or hull as [n, b] with n . x <= b inside, from qhull."""
    if isinstance(piece, coal.Box):
        points = np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * piece.halfSide
    else:
        points = np.array(piece.points())
    equations = ConvexHull(points).equations
    return np.column_stack([equations[:, :3], -equations[:, 3]])


def chord(scene, placed, index, point, direction):
    """Where the line point + t direction is inside a piece, to a micrometre: (from, to), or None."""
    piece, at = scene.geometry.geometryObjects[index].geometry, placed.oMg[index]
    x, d = at.actInv(point), at.rotation.T @ direction
    if isinstance(piece, coal.Halfspace):
        rate, room = piece.n @ d, piece.d - piece.n @ x
        return (-np.inf, room / rate) if rate > 0 else (room / rate, np.inf)
    if isinstance(piece, coal.Capsule):
        ends = [np.array([0.0, 0.0, side * piece.halfLength]) for side in (-1.0, 1.0)]
        times = [t for end in ends for t in ball_times(x - end, d, piece.radius)]
        across, flat = d[:2], x[:2]
        roots = np.roots([across @ across, 2 * across @ flat, flat @ flat - piece.radius**2])
        times += [t.real for t in roots if abs(t.imag) < 1e-12 and abs(x[2] + t.real * d[2]) <= piece.halfLength]
        return (min(times), max(times)) if times else None
    low, high = -np.inf, np.inf
    for *normal, offset in planes(piece):
        rate, room = np.dot(normal, d), offset + 1e-6 - np.dot(normal, x)
        if abs(rate) > 1e-12:
            low, high = (low, min(high, room / rate)) if rate > 0 else (max(low, room / rate), high)
        elif room < 0:
            return None
    return (low, high) if low < high else None


def ball_times(x, d, radius):
    roots = np.roots([1.0, 2 * d @ x, x @ x - radius**2])
    return [t.real for t in roots if abs(t.imag) < 1e-12]


def pairs_with_levers():
    flat = ("capsule", "box", "prism")
    return [*itertools.product(flat, flat), *((name, "half-space") for name in flat)]


SHAPES["prism"] = wb.Hull([(0.2 * np.cos(a), 0.15 * np.sin(a), z) for a in range(6) for z in (-0.1, 0.1)])


def nearly_flat(scene, kind, gap, rng):
    """A posture in which the first body lies over the second, tilted by little, so that faces look at each other."""
    q = scene.figure.neutral
    for k in range(0, scene.model.nq, 7):
        lying = pin.exp3(np.array([0.0, np.pi / 2, 0.0])) if kind[k // 7] == "capsule" else np.eye(3)
        turn = pin.exp3(rng.normal(size=3) * [0.02, 0.02, 1.0]) @ lying
        q[k + 3 : k + 7] = pin.Quaternion(turn).coeffs()
    q[:3] = *rng.uniform(-0.15, 0.15, 2), 0.5
    for _ in range(80):
        distance, normal = distance_of(scene, q)
        if abs(distance - gap) < 1e-9:
            break
        q[2] += distance_step(distance - gap, normal)
    return q


def distance_step(too_far, normal):
    return -too_far / max(abs(normal[2]), 0.3)


def two_bodies(free_bodies, kind):
    if kind[1] == "half-space":
        return wb.Scene(free_bodies(SHAPES[kind[0]])).add(SHAPES["half-space"], name="floor")
    return wb.Scene(free_bodies(*(SHAPES[name] for name in kind)))


@pytest.mark.parametrize("gap", [0.02, -0.004])
@pytest.mark.parametrize("kind", pairs_with_levers(), ids="-".join)
def test_lever_rows_tell_the_gap_where_they_stand(free_bodies, kind, gap):
    """Not less than the distance, nor more than what is really between the pieces there, along the normal.

    Less than that is allowed: it only keeps round flanks a little farther apart.
    """
    rng = np.random.default_rng(8)
    scene = two_bodies(free_bodies, kind)
    levers = 0
    for _ in range(6):
        q = nearly_flat(scene, kind, gap, rng)
        contacts, rows, _ = rows_of(scene, q)
        placed, normal = placed_at(scene, q), contacts.normal[0]
        assert (rows.gap >= contacts.distance[0] - 1e-12).all()
        assert np.array_equal(rows.contact, np.zeros(len(rows.gap)))
        first, second = contacts.pair[0]
        for gap_there, wrench in zip(rows.gap[1:], rows.wrench[1:], strict=True):
            assert wrench[:3] == pytest.approx(normal)
            point = np.cross(normal, wrench[3:])  # of the line along the normal that the row's point is on
            spans = [chord(scene, placed, index, point, normal) for index in (int(first), int(second))]
            assert None not in spans, "a row hangs over an edge"
            between = spans[1][0] - spans[0][1]
            assert gap_there <= between + module.INSET
            levers += 1
    assert levers >= 6


def test_what_lies_on_an_edge_tilts_about_it_and_not_into_the_face(free_bodies):
    """Past the edge the face falls away: at an angle of 0.05 a turn by 0.04 towards it is free, by 0.06 overlaps."""
    scene = wb.Scene(free_bodies(wb.Box((0.2, 0.2, 0.02))))
    scene.add(wb.Box((0.4, 0.4, 0.2)), name="table", at=(-0.2, 0.0, -0.1))  # its edge is the world's y axis

    def tilted(angle):
        turn = pin.exp3(np.array([0.0, angle, 0.0]))
        return np.concatenate([turn @ (0.0, 0.0, 0.01), pin.Quaternion(turn).coeffs()])

    contacts, rows, jacobian = rows_of(scene, tilted(0.05))
    assert contacts.distance == pytest.approx([0.0], abs=1e-7)
    for angle, fits in ((0.01, True), (-0.01, False)):
        ahead = rows.gap + jacobian @ pin.difference(scene.model, tilted(0.05), tilted(angle))
        assert (ahead.min() > -1e-6) == fits == (distance_of(scene, tilted(angle))[0] > -1e-6)


def places(scene, q):
    """Where the rows stand, (m, 3), in the plane through the origin along the normal."""
    contacts, rows, _ = rows_of(scene, q)
    return np.cross(contacts.normal[rows.contact], rows.wrench[:, 3:]), rows


def on_table(free_bodies, size, table):
    scene = wb.Scene(free_bodies(wb.Box(size))).add(wb.Box(table), name="table", at=(0.0, 0.0, -table[2] / 2))
    q = scene.figure.neutral
    q[2] = size[2] / 2 + 0.004
    return scene, q


@pytest.mark.parametrize(("size", "table"), [((0.4, 0.2, 0.1), (1.0, 1.0, 0.05)), ((1.0, 1.0, 0.1), (0.4, 0.2, 0.05))])
def test_box_on_a_table_has_a_row_at_every_corner_of_the_patch(free_bodies, size, table):
    scene, q = on_table(free_bodies, size, table)
    found, rows = places(scene, q)
    assert rows.gap == pytest.approx(0.004, abs=1e-6)
    for corner in itertools.product((-0.2, 0.2), (-0.1, 0.1)):
        assert np.linalg.norm(found[:, :2] - corner, axis=1).min() < 2e-3
    assert (np.abs(found[:, :2]) <= np.array([0.2, 0.1]) + 2e-3).all()


def test_round_face_has_few_rows_that_keep_it_from_rocking(free_bodies):
    """A disc of 48 corners: whichever way it tips, some row lowers nearly as much as its lowest corner does."""
    rim = np.array([(np.cos(a), np.sin(a)) for a in np.linspace(0.0, 2 * np.pi, 48, endpoint=False)])
    disc = wb.Hull([(*(0.1 * corner), z) for corner in rim for z in (-0.02, 0.02)])
    scene = wb.Scene(free_bodies(disc)).add(wb.Box((1.0, 1.0, 0.1)), name="table", at=(0.0, 0.0, -0.05))
    q = scene.figure.neutral
    q[2] = 0.021
    _, rows, jacobian = rows_of(scene, q)
    assert 5 <= len(rows.gap) <= module.MOST_ENDS + 1
    for angle in np.linspace(0.0, 2 * np.pi, 60):
        tip = np.array([0.0, 0.0, 0.0, np.cos(angle), np.sin(angle), 0.0])
        falls = -(jacobian @ tip).min()
        assert falls >= 0.1 * np.cos(np.pi / 6)  # the rim itself falls by 0.1 m a radian


def test_plank_over_an_edge_may_tip(free_bodies):
    scene, q = on_table(free_bodies, (1.0, 0.1, 0.02), (0.4, 1.0, 0.05))
    q[0] = 0.3  # from -0.2 to 0.8, over a table that ends at 0.2
    found, rows = places(scene, q)
    assert found[:, 0].max() == pytest.approx(0.2, abs=2e-3)
    assert found[:, 0].min() == pytest.approx(-0.2, abs=2e-3)
    contacts, _, jacobian = rows_of(scene, q)
    tip = np.zeros(6)
    tip[4] = 0.1  # about y: the far end goes down, the near one up
    tip[2] = 0.1 * (q[0] - 0.2)  # so that it turns about the edge
    lifted = rows.gap + jacobian @ tip
    assert (lifted >= contacts.distance[0] - 1e-3 * 0.1 * 2).all()


def test_crossed_capsules_have_no_rows_far_from_the_crossing(free_bodies):
    long = wb.Capsule(0.04, 0.6)
    scene = wb.Scene(free_bodies(long, long))
    q = scene.figure.neutral
    q[3:7] = pin.Quaternion(pin.exp3(np.array([0.0, np.pi / 2, 0.0]))).coeffs()
    q[10:14] = pin.Quaternion(pin.exp3(np.array([np.pi / 2, 0.0, 0.0]))).coeffs()
    q[9] = 0.085
    found, _ = places(scene, q)
    assert np.linalg.norm(found[:, :2], axis=1).max(initial=0.0) < 0.02


@pytest.mark.parametrize("shift", [0.0, 0.2])
def test_parallel_capsules_have_a_row_at_either_end_of_what_they_share(free_bodies, shift):
    long = wb.Capsule(0.04, 0.6)
    scene = wb.Scene(free_bodies(long, long))
    q = scene.figure.neutral
    q[7:10] = 0.085, 0.0, shift
    found, rows = places(scene, q)
    assert rows.gap == pytest.approx(0.005, abs=1e-5)
    assert found[:, 2].min() == pytest.approx(-0.3 + shift, abs=5e-3)
    assert found[:, 2].max() == pytest.approx(0.3, abs=5e-3)


def test_a_row_on_a_round_flank_knows_how_far_it_has_fallen(free_bodies):
    """A capsule lies over the end of a table, whose two corners are drawn back to the flank: it falls as a circle does.

    Along the capsule's own axis the gap is the distance; beside it the gap is larger by r - sqrt(r^2 - x^2).
    """
    radius = 0.04
    scene = wb.Scene(free_bodies(wb.Capsule(radius, 0.6))).add(wb.Box((0.4, 0.2, 0.05)), name="table")
    q = scene.figure.neutral
    q[3:7] = pin.Quaternion(pin.exp3(np.array([0.0, np.pi / 2, 0.0]))).coeffs()
    q[:3] = 0.2, 0.0, 0.025 + radius + 0.004
    found, rows = places(scene, q)
    beside = np.abs(found[:, 1])
    assert rows.gap == pytest.approx(0.004 + radius - np.sqrt(radius**2 - beside**2), abs=5e-6)
    assert (beside > 5e-3).any()  # where the flank has fallen by a third of a millimetre


def test_normals_that_coal_leaves_open_are_those_of_the_face(free_bodies):
    """Coal ends within a micrometre of the distance: at 2 cm its normal may be 6e-3 rad off, and the distance the same.

    Over a forearm's length of 0.25 m that would be 1.5 mm between what the rows say and what is there.
    """
    scene = wb.Scene(free_bodies(wb.Capsule(0.04, 0.25))).add(wb.Box((1.0, 1.0, 0.05)), name="table")
    q = scene.figure.neutral
    q[3:7] = pin.Quaternion(pin.exp3(np.array([0.0, np.pi / 2, 0.0]))).coeffs()
    q[:3] = 0.05, 0.0, 0.025 + 0.04 + 0.02
    with scene.borrow() as workspace:
        contacts = workspace.near(q, 0.1)
    up = np.sign(contacts.normal[0, 2])
    contacts.normal[:] = pin.exp3(np.array([0.0, 6e-3, 0.0])) @ (0.0, 0.0, up)
    rows = scene.built.rows.rows(contacts)
    assert len(rows.gap) > 1
    assert rows.wrench[:, :3] == pytest.approx(np.tile((0.0, 0.0, up), (len(rows.gap), 1)), abs=1e-12)
    assert rows.gap == pytest.approx(0.02, abs=5e-6)
    contacts.normal[:] = pin.exp3(np.array([0.0, 0.02, 0.0])) @ (0.0, 0.0, up)  # more than rounding: another normal
    rows = scene.built.rows.rows(contacts)
    assert np.abs(rows.wrench[:, 0]) == pytest.approx(np.sin(0.02))


def test_round_shapes_and_far_ones_need_no_more_than_the_witness(free_bodies):
    for shape, height in ((SHAPES["sphere"], 0.16), (SHAPES["ellipsoid"], 0.17), (SHAPES["box"], 0.2)):
        scene = wb.Scene(free_bodies(shape)).add(SHAPES["half-space"], name="floor")
        q = scene.figure.neutral
        q[2] = height
        contacts, rows, _ = rows_of(scene, q)
        assert len(contacts.distance) == len(rows.gap) == 1


def test_near_ends_are_not_left_out_for_far_ones_that_stand_back(free_bodies):
    """A foot of eight corners below a rim of forty: whichever way it tips, its lowest corner is foreseen."""
    turns = np.linspace(0.0, 2 * np.pi, 40, endpoint=False)
    rim = np.column_stack([0.06 * np.cos(turns), 0.06 * np.sin(turns), np.full(40, 0.008)])
    foot = np.column_stack([0.025 * np.cos(turns[::5]), 0.025 * np.sin(turns[::5]), np.zeros(8)])
    scene = wb.Scene(free_bodies(wb.Hull(np.vstack([rim, foot]))))
    scene.add(wb.Box((1.0, 1.0, 0.1)), name="table", at=(0.0, 0.0, -0.05))
    q = scene.figure.neutral
    q[2] = 3e-4
    _, rows, jacobian = rows_of(scene, q)
    assert len(rows.gap) == module.MOST_ENDS + 1
    for angle in np.linspace(0.0, 2 * np.pi, 60):
        tip = 0.01 * np.array([0.0, 0.0, 0.0, np.cos(angle), np.sin(angle), 0.0])
        lowest = min((pin.exp3(tip[3:]) @ corner)[2] for corner in foot) + q[2]
        assert (rows.gap + jacobian @ tip).min() == pytest.approx(lowest, abs=3e-5)


def test_compiled_rows_are_those_of_array_code_entry_by_entry(free_bodies):
    """Flat and round pieces, rims of 48 corners of which eight are kept, and faces that lie on faces."""
    rim = np.array([(np.cos(a), np.sin(a)) for a in np.linspace(0.0, 2 * np.pi, 48, endpoint=False)])
    wide = np.random.default_rng(3).uniform(0.1999, 0.2, (48, 2))  # no corner is as far out as another
    disc = wb.Hull(
        [
            (*(far * at), z)
            for at, pair in zip(rim, wide, strict=True)
            for far, z in zip(pair, (-0.02, 0.02), strict=True)
        ]
    )
    scene = wb.Scene(free_bodies(SHAPES["box"], SHAPES["capsule"], SHAPES["hull"], disc))
    scene.add(wb.Box((1.0, 1.0, 0.1)), name="table", at=(0.0, 0.0, -0.05))
    scene.add(wb.Capsule(0.05, 0.8), name="rail", at=(0.3, 0.0, 0.05)).add(SHAPES["half-space"], name="floor")
    compiled, reference = ContactRowBuilder(scene.pair_table), ReferenceRowBuilder(scene.pair_table)
    rng, levers, snapped = np.random.default_rng(11), 0, 0
    for _ in range(60):
        q = scene.figure.neutral
        for k in range(0, scene.model.nq, 7):
            q[k : k + 3] = *rng.uniform(-0.4, 0.4, 2), rng.uniform(0.0, 0.2)
            q[k + 3 : k + 7] = pin.Quaternion(pin.exp3(rng.normal(size=3) * rng.choice([1e-3, 0.02, 1.0]))).coeffs()
        with scene.borrow() as workspace:
            contacts = workspace.near(q, 0.1)
        twin = contacts._replace(normal=contacts.normal.copy())
        found = contacts.normal.copy()
        rows, wanted = compiled.rows(contacts), reference.rows(twin)
        assert contacts.normal == pytest.approx(twin.normal, abs=1e-12)
        assert np.array_equal(rows.contact, wanted.contact)
        assert np.array_equal(rows.first, wanted.first)
        assert np.array_equal(rows.second, wanted.second)
        # ends that are equally far out may come in another order
        mine, theirs = (np.column_stack([each.contact, each.gap, each.wrench]) for each in (rows, wanted))
        mine, theirs = (each[np.lexsort(np.round(each, 9).T[::-1])] for each in (mine, theirs))
        assert mine == pytest.approx(theirs, abs=1e-11)
        levers += len(rows.gap) - len(contacts.distance)
        snapped += int((contacts.normal != found).any(axis=1).sum())
    assert levers > 400
    assert snapped > 5


def test_rows_are_between_the_joints_of_the_pieces(free_bodies):
    scene = wb.Scene(free_bodies(SHAPES["box"], SHAPES["prism"])).add(SHAPES["half-space"], name="floor")
    q = scene.figure.neutral
    q[2], q[9] = 0.12, 0.33
    contacts, rows, _ = rows_of(scene, q)
    joint = np.array([piece.parentJoint for piece in scene.geometry.geometryObjects])
    assert np.array_equal(rows.first, joint[contacts.pair[rows.contact, 0]])
    assert np.array_equal(rows.second, joint[contacts.pair[rows.contact, 1]])
    assert np.array_equal(rows.contact[: len(contacts.distance)], np.arange(len(contacts.distance)))
