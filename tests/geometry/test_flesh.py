"""Flesh spreads where a hip is bent, and only there."""

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.measuring import measure
from wholebody.assessment.all_pairs import AllPairs
from wholebody.geometry.continuous.motion_bounds import MotionBounds
from wholebody.geometry.flesh import flesh_of, settled


def between_rails(figure: wb.Figure, gap: float, flexion: float) -> float:
    """Least distance to two rails beside the hips of who stands or sits with parallel thighs, arms out of the way."""
    scene = wb.Scene({"anna": figure}) if figure.detail == "capsules" else wb.Scene(figure)
    front = "anna/" if figure.detail == "capsules" else ""
    bent = {f"{front}{side}_hip_flexion": flexion for side in ("left", "right")}
    out = {f"{front}{side}_shoulder_abduction": 1.5 for side in ("left", "right")}
    q = scene.figure.with_joints(pin.neutral(scene.model), bent | out)
    for name, side in (("left", 1.0), ("right", -1.0)):
        scene.add(wb.Box((2.0, 0.04, 0.4)), name=f"{name} rail", at=(0.0, side * (0.5 * gap + 0.02), 0.0))
    pairs = AllPairs(scene.built)
    pairs.move(q)
    rails = [k for k, owner in enumerate(scene.piece_owner) if owner.endswith("rail")]
    return float(pairs.distance[np.isin(scene.pair_table.pairs, rails).any(axis=1)].min())


@pytest.mark.parametrize("detail", ["capsules", "hulls"])
def test_passages_are_as_wide_as_hips_that_stand_and_seats_as_hips_that_sit(detail: str) -> None:
    figure = wb.load("human", sex="female", detail=detail)
    size = measure(figure)
    assert size["hip_breadth_sitting"] > size["hip_breadth"] + 0.03
    for gap in (size["hip_breadth"], size["hip_breadth_sitting"]):
        for flexion, breadth in ((0.0, "hip_breadth"), (0.5, "hip_breadth"), (np.pi / 2, "hip_breadth_sitting")):
            assert between_rails(figure, gap, flexion) == pytest.approx(0.5 * (gap - size[breadth]), abs=2e-4)


def test_flesh_of_one_of_two_people_spreads_alone() -> None:
    figure = wb.load("human")
    scene = wb.Scene({"anna": figure, "bert": (figure, (3.0, 0.0, 0.0))})
    q = scene.figure.with_joints(pin.neutral(scene.model), {"bert/left_hip_flexion": 1.5})
    placed = dict(zip(scene.piece_names, scene.workspace().placements(q), strict=True))

    def out(name: str) -> float:
        """How far flesh is from the piece in which it is otherwise."""
        return float(np.abs(placed[f"{name}_thigh:3"] - placed[f"{name}_thigh:0"]).max())

    assert out("bert/left") > 0.01
    assert max(out("bert/right"), out("anna/left"), out("anna/right")) == 0.0


def test_bounds_of_motions_hold_for_flesh() -> None:
    figure = wb.load("human", sex="male", stature=1.75, mass=60.0)
    scene, rng, far = wb.Scene(figure), np.random.default_rng(0), 0.0
    model, space, number = scene.model, scene.workspace(), scene.piece_names.index("left_thigh:3")
    bounds = MotionBounds(model, scene.pair_table.joint, scene.pair_table.reach)
    shape = scene.geometry.geometryObjects[number].geometry
    around = rng.normal(size=(200, 3))
    around *= shape.radius / np.linalg.norm(around, axis=1, keepdims=True)
    points = np.concatenate([around + (0.0, 0.0, side * shape.halfLength) for side in (1.0, -1.0)])
    hips = [model.joints[model.getJointId(f"left_hip_{name}")].idx_v for name in ("flexion", "abduction", "rotation")]
    for _ in range(500):
        drawn = rng.uniform((0.35, -0.2, -0.4), (1.15, 0.5, 0.4))
        angles = dict(zip(("flexion", "abduction", "rotation"), drawn, strict=True))
        q = figure.with_joints(pin.neutral(model), {f"left_hip_{name}": angle for name, angle in angles.items()})
        turn = np.zeros(model.nv)
        turn[rng.permutation(hips)[: rng.integers(1, 3)]] = rng.choice((1e-4, -1e-4))
        before, after = (np.array(space.placements(at)[number]) for at in (q, pin.integrate(model, q, turn)))
        moved = np.linalg.norm(points @ after[:3] + after[3] - points @ before[:3] - before[3], axis=1).max()
        data = model.createData()
        pin.forwardKinematics(model, data, q)
        bounds.update(data, turn, np.array(space.placements(q))[:, 3])
        far = max(far, moved / bounds.speed[number].sum())
    assert 0.5 < far <= 1.0  # 1.03 without what flesh moves beside its limb


@pytest.mark.parametrize("flexion", [0.2, 0.8, 1.5])
def test_flesh_of_a_frozen_hip_is_where_that_of_the_whole_figure_is(flexion: float) -> None:
    figure = wb.load("human")
    model, geometry = figure.model, figure.geometry
    q = figure.with_joints(figure.posture("standing"), {"left_hip_flexion": flexion, "left_hip_abduction": 0.1})
    frozen = [model.getJointId(name) for name in model.names if "left_hip" in name]
    reduced, reduced_geometry = pin.buildReducedModel(model, geometry, frozen, q)
    kept = np.concatenate([range(j.idx_q, j.idx_q + j.nq) for j in list(model.joints)[1:] if j.id not in frozen])
    places = []
    for one, pieces, at in ((model, geometry, q), (reduced, reduced_geometry, q[kept.astype(int)])):
        data = one.createData()
        pin.forwardKinematics(one, data, at)
        places += [flesh.placed(pieces, data.oMi).homogeneous for flesh in flesh_of(pieces)]
    assert np.array(places[:2]) == pytest.approx(np.array(places[2:]), abs=1e-12)


def test_programs_to_which_pieces_are_rigid_get_flesh_of_a_posture() -> None:
    figure = wb.load("human")
    names = [piece.name for piece in figure.geometry.geometryObjects]
    thigh, flesh = (names.index(f"left_thigh:{number}") for number in (0, 3))
    for posture, same in (("standing", thigh), ("sitting", flesh)):
        rigid = settled(figure.model, figure.geometry, figure.posture(posture)).geometryObjects[flesh].placement
        assert rigid.isApprox(figure.geometry.geometryObjects[same].placement, 1e-9)


def test_flesh_meets_what_stands_in_the_world_and_not_what_is_worn() -> None:
    scene = wb.Scene(wb.load("human")).add(wb.Box((0.1, 0.1, 0.1)), name="rail", at=(0.0, 0.5, 0.9))
    scene.attach(wb.Box((0.05, 0.05, 0.1)), to="pelvis", name="pouch", at=(0.0, 0.25, 0.0))
    names = scene.piece_names
    met = {frozenset((names[a], names[b])) for a, b in scene.pair_table.pairs.tolist()}
    flesh = "left_thigh:3"
    assert {frozenset((flesh, "rail:0"))} == {pair for pair in met if flesh in pair}
    assert frozenset(("left_thigh:0", "pouch:0")) in met
