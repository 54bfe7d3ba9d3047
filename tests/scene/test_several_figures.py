"""Scenes of several figures: each behaves as it does alone, and they meet each other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.base.errors import FileFormatError, InputError, UnknownNameError
from wholebody.bench.suite.problem_sets.robots import known_arm
from wholebody.tasks import Balance
from wholebody.tracking import follow, judge
from wholebody.tracking.live_subjects import handle_frames

TURNED = (1.4, 0.1, 0.0, 0.0, 0.0, 1.0, 0.0)  # faces the other
AWAY = (0.0, 30.0, 0.0)


@pytest.fixture(scope="module")
def anna() -> wb.Figure:
    return wb.load("human", sex="female")


@pytest.fixture(scope="module")
def ben() -> wb.Figure:
    return wb.load("avatar")


@pytest.fixture
def pair(anna: wb.Figure, ben: wb.Figure) -> wb.Scene:
    return wb.Scene({"anna": anna, "ben": (ben, TURNED)}).add(wb.HalfSpace(), name="floor")


def feet(*names: str) -> list[wb.Hold]:
    return [wb.Hold(f"{name}{side}_foot") for name in names for side in ("left", "right")]


def test_figures_are_added_to_a_scene(anna: wb.Figure, ben: wb.Figure, pair: wb.Scene) -> None:
    scene = wb.Scene({"anna": anna}).add(wb.HalfSpace(), name="floor")
    scene.attach(wb.Sphere(0.05), to="anna/right_palm", name="ball", at=(0.0, 0.0, 0.06))
    problem = wb.Problem(scene)
    scene.add_figure(ben, name="ben", at=TURNED)
    assert scene.figure.neutral == pytest.approx(pair.figure.neutral, abs=0.0)
    assert set(scene.objects) == {"floor", "ball"}
    owners = {frozenset((scene.piece_owner[a], scene.piece_owner[b])) for a, b in scene.pair_table.pairs}
    assert frozenset(("ben/left_hand", "ball")) in owners
    assert frozenset(("ben/left_foot", "floor")) in owners
    assert frozenset(("ben/left_foot", "anna/left_foot")) in owners
    with pytest.raises(InputError, match="state the problem anew"):
        wb.solve(problem)
    scene.add_figure(wb.load("hand"), name="hand", at=(0.0, 2.0, 1.0), root="fixed")
    assert "hand/root" not in scene.figure.roots


def test_each_keeps_its_own_defaults(pair: wb.Scene) -> None:
    both = wb.Problem(pair, constraints=feet("anna/", "ben/"))
    assert [term.feet for term in both.defaults if isinstance(term, Balance)] == [
        ("anna/left_foot", "anna/right_foot"),
        ("ben/left_foot", "ben/right_foot"),
    ]
    one = wb.Problem(pair, constraints=[*feet("anna/", "ben/"), wb.Freeze("ben/root")])
    assert [term.feet for term in one.defaults if isinstance(term, Balance)] == [("anna/left_foot", "anna/right_foot")]
    stated = wb.Problem(pair, constraints=[*feet("anna/", "ben/"), Balance(("ben/left_foot", "ben/right_foot"))])
    assert [term.feet for term in stated.defaults if isinstance(term, Balance)] == [
        ("anna/left_foot", "anna/right_foot")
    ]
    assert [type(term).__name__ for term in both.measures] == ["Effort", "Rhythm", "Hang"]


def test_measures_and_ranges_are_sums_and_rows_of_each(anna: wb.Figure, ben: wb.Figure) -> None:
    tall = wb.load("human", stature=1.9)
    pair = wb.Scene({"anna": anna, "ben": (tall, TURNED)}).add(wb.HalfSpace(), name="floor")
    figure, rng = pair.figure, np.random.default_rng(3)
    q = figure.clamp(pin.integrate(figure.model, figure.neutral, 0.2 * rng.normal(size=figure.model.nv)))
    scenes = {"anna": wb.Scene(anna), "ben": wb.Scene(tall)}
    for kind in (
        wb.Effort,
        wb.tasks.Displacement,
        wb.tasks.Discomfort,
        wb.tasks.Rhythm,
        wb.tasks.PotentialEnergy,
        wb.tasks.RotationEffort,
    ):
        together = kind().resolve(pair, figure.neutral)
        apart = 0.0
        for name, scene in scenes.items():
            term = kind().resolve(scene, figure.part(name, figure.neutral))
            apart += term.value(scene.state(figure.part(name, q)))
        assert together.value(pair.state(q)) == pytest.approx(apart, rel=1e-9), kind
    for kind in (wb.tasks.RangeOfMotion, wb.tasks.ReachCones):
        rows = kind().resolve(pair, q).value(pair.state(q))
        own = [
            kind().resolve(scene, figure.part(name, q)).value(scene.state(figure.part(name, q)))
            for name, scene in scenes.items()
        ]
        assert rows == pytest.approx(np.concatenate(own), abs=1e-10)
    small = wb.Scene({"anna": ben, "ben": (ben, TURNED)}).add(wb.HalfSpace(), name="floor")
    assert wb.check_derivatives(wb.Stand("floor", feet=("ben/left_foot", "ben/right_foot")), small).agrees


def test_compiled_rows_of_one_figure_are_those_of_its_terms(pair: wb.Scene) -> None:
    goals = [wb.CenterOfMass((1.4, 0.1, 0.9), figure="ben"), wb.CenterOfMass((0.6, 0.0, 0.9))]
    measures = [
        wb.tasks.Rhythm(),
        wb.tasks.Displacement(),
        wb.tasks.RotationEffort(),
        wb.tasks.PotentialEnergy(),
        wb.tasks.Discomfort(),
    ]
    problem = wb.Problem(pair, goals=goals, constraints=feet("anna/", "ben/"), measures=measures)
    assert sum(isinstance(term, Balance) for term in problem.constraints) == 2
    rng = np.random.default_rng(7)
    q = pin.integrate(pair.model, problem.start, 0.1 * rng.normal(size=pair.model.nv))
    state = pair.state(q)
    with problem.borrow() as workspace:
        at = problem.lineariser(workspace).at(q, 0.0)
    assert at.goal_error == pytest.approx(np.concatenate([goal.error(state) for goal in problem.goals]), abs=1e-9)
    assert at.value == pytest.approx(np.concatenate([term.value(state) for term in problem.constraints]), abs=1e-9)
    rows = np.vstack([state.dense_jacobian(term.jacobian(state)) for term in (*problem.goals, *problem.constraints)])
    assert np.vstack([at.goal_jacobian, at.value_jacobian]) == pytest.approx(rows, abs=1e-9)
    gradient = sum(term.weight * term.gradient(state) for term in problem.measures)
    assert at.gradient == pytest.approx(gradient, abs=1e-8)


@pytest.mark.parametrize("method", ["qp", "dls"])
def test_what_is_far_away_changes_nothing(method: str, anna: wb.Figure, ben: wb.Figure) -> None:
    target = (0.5, -0.3, 1.1)
    alone = wb.Problem(
        wb.Scene(anna).add(wb.HalfSpace(), name="floor"), constraints=feet(""), goals=[wb.Point("right_palm", target)]
    )
    scene = wb.Scene({"anna": anna, "ben": (ben, AWAY)}).add(wb.HalfSpace(), name="floor")
    both = wb.Problem(scene, constraints=feet("anna/", "ben/"), goals=[wb.Point("anna/right_palm", target)])
    one, two = wb.solve(alone, method), wb.solve(both, method)
    assert one.status == two.status
    assert two.assessment.goal_errors[0] < 1e-4
    assert scene.figure.part("anna", two.q) == pytest.approx(one.q, abs=2e-4)
    assert scene.figure.part("ben", two.q) == pytest.approx(scene.figure.part("ben", both.start), abs=2e-4)


def test_hand_in_hand(pair: wb.Scene) -> None:
    goals = [wb.Relative("anna/right_palm", "ben/right_palm", (0.0, 0.0, 0.05), orientation=False)]
    problem = wb.Problem(pair, constraints=feet("anna/", "ben/"), goals=goals)
    solution = wb.solve(problem)
    assert solution.status == "solved"
    state = pair.state(solution.q)
    a, b = (state.frame(pair.figure.frame_id(f"{name}/right_palm")) for name in ("anna", "ben"))
    assert b.actInv(a.translation) == pytest.approx((0.0, 0.0, 0.05), abs=1e-4)
    assert wb.assess(problem, solution.q).penetration < 1e-6


def test_a_closed_chain_of_two_is_kept_by_a_tracker(pair: wb.Scene) -> None:
    figure = pair.figure
    start = wb.solve(
        wb.Problem(
            pair,
            constraints=feet("anna/", "ben/"),
            goals=[
                wb.Point("anna/left_palm", (0.55, 0.2, 1.0)),
                wb.Point("anna/right_palm", (0.55, -0.2, 1.0)),
                wb.Point("ben/right_palm", (0.85, 0.2, 1.0)),
                wb.Point("ben/left_palm", (0.85, -0.2, 1.0)),
            ],
        )
    )
    assert start.status == "solved"
    loop = [
        wb.Hold(palm, relative_to="anna/right_palm", orientation=False)
        for palm in ("anna/left_palm", "ben/left_palm", "ben/right_palm")
    ]
    problem = wb.Problem(
        pair,
        start.q,
        constraints=[*feet("anna/", "ben/"), *loop],
        goals=[wb.Frame("anna/right_palm", figure.placement(start.q, "anna/right_palm"))],
    )
    tracker, q = wb.methods.QP().tracker(problem, dt=0.02), start.q
    place = figure.placement(start.q, "anna/right_palm")
    for step in range(1, 26):
        moved = pin.SE3(place.rotation, place.translation + (0.0, 0.004 * step, 0.006 * step))
        problem.retarget([wb.Frame("anna/right_palm", moved)])
        q = tracker.step(q).q
    assert figure.placement(q, "anna/right_palm").translation == pytest.approx(moved.translation, abs=5e-3)
    # four frames in one plane or not: all six distances stay
    palms = [
        figure.placement(q, f"{name}/{side}_palm").translation for name in ("anna", "ben") for side in ("left", "right")
    ]
    before = [
        figure.placement(start.q, f"{name}/{side}_palm").translation
        for name in ("anna", "ben")
        for side in ("left", "right")
    ]
    for a in range(4):
        for b in range(a):
            assert np.linalg.norm(palms[a] - palms[b]) == pytest.approx(np.linalg.norm(before[a] - before[b]), abs=1e-3)
    assert wb.assess(problem, q).penetration < 1e-4


def test_a_person_who_faces_elsewhere_sits(ben: wb.Figure) -> None:
    place = pin.XYZQUATToSE3(np.array(TURNED))
    scene = wb.Scene({"ben": (ben, AWAY), "carl": (wb.load("human", sex="male", stature=1.75), TURNED)})
    scene.add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.44, 0.48, 0.04)), name="seat", at=place * pin.SE3(np.eye(3), np.array((-0.35, 0.0, 0.38))))
    scene.add(wb.Box((0.03, 0.48, 0.36)), name="back", at=place * pin.SE3(np.eye(3), np.array((-0.57, 0.0, 0.82))))
    sit = wb.Sit("seat", "back", pelvis="carl/pelvis", trunk="carl/thorax")
    standing = wb.Stand("floor", feet=("carl/left_foot", "carl/right_foot"), balance=False)
    problem = wb.Problem(scene, goals=[sit], constraints=[standing, wb.Freeze("ben", "ben/root")], clearance=0.003)
    solution = wb.solve(problem)
    assert solution.status == "solved", solution
    axes = scene.figure.placement(solution.q, "carl/pelvis").rotation
    assert axes[0, 0] < -0.9  # it looks away from the back


def test_a_cell_of_two_arms() -> None:
    (left, ready), (right, other) = known_arm("ur5"), known_arm("panda")
    scene = wb.Scene({"left": (left, (0.0, 0.45, 0.0)), "right": (right, (0.0, -0.45, 0.0))})
    scene.add(wb.HalfSpace(offset=-0.3), name="floor")
    start, rng = scene.figure.posture({"left": ready, "right": other}), np.random.default_rng(1)
    limits = scene.model.lowerPositionLimit, scene.model.upperPositionLimit
    names = ("left/tool", "right/tool")
    while True:  # until a posture is free whose tools are near each other
        witness = rng.uniform(*limits)
        left_tool, right_tool = (scene.figure.placement(witness, name) for name in names)
        apart = left_tool.actInv(right_tool)
        if np.linalg.norm(apart.translation) < 0.3 and not len(scene.contacts(witness, 0.01).distance):
            break
    goals = [wb.Point("left/tool", left_tool.translation), wb.Relative("right/tool", "left/tool", apart)]
    problem = wb.Problem(scene, start, goals=goals, clearance=0.005)
    solution = wb.solve(problem)
    assert solution.status == "solved", solution
    found = [scene.figure.placement(solution.q, name) for name in names]
    assert found[0].actInv(found[1]).homogeneous == pytest.approx(apart.homogeneous, abs=1e-4)
    assert not problem.defaults


def test_overlaps_of_what_stands_are_told() -> None:
    arm = known_arm("ur5")[0]
    scene = wb.Scene({"one": arm, "other": (arm, (0.02, 0.0, 0.0))})
    near = scene.overlapping(scene.figure.neutral)
    owners = [{scene.piece_owner[a], scene.piece_owner[b]} for a, b in near.pair]
    assert {"one/link0", "other/link0"} in owners


def test_a_task_file_states_several_figures(tmp_path: Path, pair: wb.Scene) -> None:
    pair.attach(wb.Box((0.1, 0.1, 0.1)), to="ben/right_palm", name="box", at=(0.0, 0.0, 0.1))
    problem = wb.Problem(
        pair,
        constraints=[*feet("anna/", "ben/"), wb.Freeze("anna/left_arm")],
        goals=[wb.Relative("anna/right_palm", "ben/right_palm", (0.0, 0.0, 0.2), orientation=False)],
    )
    path = wb.taskfile.write_task(problem, tmp_path / "pair.toml")
    read = wb.read_task(path).problem
    assert read.start == pytest.approx(problem.start, abs=1e-9)
    assert read.scene.figure.joints == pair.figure.joints
    assert len(read.clearances) == len(problem.clearances)
    q = problem.start
    for one, other in zip(read.constraints, problem.constraints, strict=True):
        assert one.value(read.scene.state(q)) == pytest.approx(other.value(pair.state(q)), abs=1e-9)
    text = path.read_text()
    for wrong, words in (
        (text.replace('called = "ben"\n', ""), "write called"),
        (text.replace('called = "ben"', 'called = "anna"'), "write called"),
        (text.replace('"ben/root" =', '"bens/root" ='), "no free root is called 'bens/root'"),
    ):
        path.write_text(wrong)
        with pytest.raises((FileFormatError, InputError, UnknownNameError), match=words):
            wb.read_task(path)


def test_a_clip_of_several_has_parts(tmp_path: Path, pair: wb.Scene, anna: wb.Figure) -> None:
    figure = pair.figure
    other = figure.with_joints(figure.neutral, {"ben/right_elbow_flexion": 1.0, "anna/left_elbow_flexion": 0.7})
    clip = wb.Clip(
        figure, np.array([pin.interpolate(figure.model, figure.neutral, other, s) for s in (0.0, 0.5, 1.0)]), 0.1
    )
    part = clip.part("anna")
    assert part.figure is figure.members["anna"].figure
    assert part.q[:, 7:] == pytest.approx(clip.q[:, 7 : anna.model.nq])
    again = wb.read_clip(clip.write(tmp_path / "both.npz"), figure)
    assert again.q == pytest.approx(clip.q)
    with pytest.raises(InputError, match=r"holds one figure.*clip\.part\('anna'\)"):
        clip.write(tmp_path / "both.txt")
    with pytest.raises(InputError, match=r"clip\.part\('anna'\)"):
        wb.motion.torques(clip)
    assert wb.read_clip(part.write(tmp_path / "anna.csv"), part.figure).q == pytest.approx(part.q, abs=1e-8)
    assert wb.check(clip, pair).depth.max() <= 0.0


@pytest.mark.parametrize("ending", [".csv", ".bvh", ".glb"])
def test_a_file_holds_several_figures(tmp_path: Path, ending: str, ben: wb.Figure) -> None:
    pair = wb.Scene({"anna": ben, "ben": (ben, TURNED)})
    pair.add_figure(wb.load("hand"), name="hand", at=(0.3, 2.0, 1.0, 0.0, 0.0, 0.6, 0.8), root="fixed")
    figure = pair.figure
    turned = pin.integrate(figure.model, figure.neutral, 0.2 * np.random.default_rng(3).normal(size=figure.model.nv))
    ways = [pin.interpolate(figure.model, figure.neutral, figure.clamp(turned), share) for share in (0.0, 0.4, 1.0)]
    clip = wb.Clip(figure, np.array(ways), 0.1)
    path = clip.write(tmp_path / f"all{ending}")
    if ending == ".glb":  # a foreign reader sees every figure where it stands
        read = pytest.importorskip("trimesh").load(path)
        for joint in ("anna/left_wrist_flexion", "ben/left_wrist_flexion"):
            x, y, z = figure.placement(figure.neutral, joint).translation
            assert read.graph.get(f"joint {joint}")[0][:3, 3] == pytest.approx((y, z, x), abs=1e-6)  # y up, z forward
        assert {"body anna", "body ben"} <= set(read.graph.nodes)
    again = wb.read_clip(path, figure)
    assert again.dt == pytest.approx(0.1)
    for one, other in zip(again.q, clip.q, strict=True):  # a quaternion may have the other sign
        assert np.abs(pin.difference(figure.model, one, other)).max() < 1e-6
    one = clip.part("ben").write(tmp_path / f"one{ending}")
    with pytest.raises((FileFormatError, UnknownNameError)):  # the file of one is none of all
        wb.read_clip(one, figure)


@pytest.mark.parametrize("ending", [".npz", ".csv", ".bvh", ".glb"])
def test_a_file_of_several_says_so_where_one_is_meant(tmp_path: Path, ending: str, ben: wb.Figure) -> None:
    figure = wb.Scene({"anna": ben, "ben": (ben, TURNED)}).figure
    path = wb.Clip(figure, np.array([figure.neutral] * 3), 0.1).write(tmp_path / f"all{ending}")
    with pytest.raises(FileFormatError, match=r"is of figures that are called anna.*scene\.figure.*--scene"):
        wb.read_clip(path, ben)
    assert wb.read_clip(path, figure).figure is figure


def test_a_tracked_person_is_stopped_by_another(anna: wb.Figure, ben: wb.Figure) -> None:
    scene = wb.Scene({"anna": anna, "ben": (ben, (1.0, 0.05, 0.0, 0.0, 0.0, 1.0, 0.0))})
    figure = scene.figure
    place = figure.model.joints[figure.joint_id("ben/root")].idx_q
    frames = np.tile(figure.neutral, (20, 1))
    frames[:, place] -= np.linspace(0.0, 0.85, len(frames))  # until he is inside of her
    recording = follow(scene, wb.Clip(figure, frames, 1 / 30))
    judged = judge(scene, recording)
    assert judged.tracked_depth.max() > 0.05
    assert judged.depth.max() < 1e-3
    assert not judged.passed
    assert recording.q[-1, place] < 0.75  # he came near


def test_one_of_several_is_named_where_one_is_meant(pair: wb.Scene) -> None:
    figure = pair.figure
    q = wb.Problem(pair, {"anna": "sitting", "ben": pair.figure.part("ben", figure.neutral)}).start
    assert figure.part("anna", q)[7:] == pytest.approx(figure.members["anna"].figure.posture("sitting")[7:])
    assert figure.part("ben", q) == pytest.approx(figure.part("ben", figure.neutral))
    eyes, face = (figure.placement(figure.neutral, f"{name}/gaze").translation for name in ("anna", "ben"))
    beyond = face + 0.5 * (face - eyes)
    assert wb.ergonomics.sight(pair, figure.neutral, beyond, eyes="anna/gaze").hidden_by.startswith("ben/")
    with pytest.raises(InputError, match="has no frame 'gaze'"):
        wb.ergonomics.sight(pair, figure.neutral, beyond)
    for stands in (wb.Balance(), wb.Stand("floor")):
        with pytest.raises(InputError, match=r"name the feet of one, feet=\['anna/left_foot', 'anna/right_foot'\], or"):
            wb.Problem(pair, constraints=[stands])
    with pytest.raises(InputError, match="figure 'both' is several figures"):
        wb.Assembly().figure("both", figure)
    assert handle_frames(figure.frames)[:2] == ["anna/left_palm", "anna/right_palm"]


def test_each_is_put_on_the_ground(pair: wb.Scene) -> None:
    figure = pair.figure
    q = figure.neutral
    heights = [figure.model.joints[joint].idx_q + 2 for joint in figure.roots.values()]
    lifted = q.copy()
    lifted[heights] += (0.2, -0.03)
    assert figure.grounded(lifted, pair) == pytest.approx(q, abs=1e-6)


def test_a_name_is_that_of_one_figure_or_thing_alone(ben: wb.Figure) -> None:
    with pytest.raises(InputError, match=r"a figure is named 'root'.*give it another name"):
        wb.Scene({"root": ben})
    scene = wb.Scene({"ben": ben}).add(wb.Box((0.1, 0.1, 0.1)), name="post", at=(1.0, 0.0, 0.5))
    with pytest.raises(InputError, match="a figure is named 'root'"):
        scene.add_figure(ben, name="root")
    with pytest.raises(InputError, match="the scene has a thing 'post' already; give the figure another name"):
        scene.add_figure(ben, name="post")
    with pytest.raises(InputError, match="the scene already has 'ben'; give the new object another name"):
        scene.add(wb.Sphere(0.1), name="ben")
    with pytest.raises(InputError, match="the scene already has 'ben'; give the new object another name"):
        scene.attach(wb.Sphere(0.1), to="ben/head", name="ben")
    assert (set(scene.figure.members), set(scene.objects)) == ({"ben"}, {"post"})


def test_newton_takes_a_person_beside_an_arm_that_turns_without_end_and_slides(anna: wb.Figure, tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(
        """<robot name="arm"><link name="base"/><link name="turned"/><link name="tip"/>
        <joint name="turn" type="continuous"><parent link="base"/><child link="turned"/><axis xyz="0 0 1"/></joint>
        <joint name="slide" type="prismatic"><parent link="turned"/><child link="tip"/><axis xyz="1 0 0"/>
        <limit lower="0.1" upper="0.9" effort="1" velocity="1"/></joint></robot>"""
    )
    scene = wb.Scene({"anna": anna, "arm": (wb.load(file), (2.0, 0.0, 0.5))})
    goals = [wb.Point("anna/right_palm", (0.4, -0.2, 1.2)), wb.Point("arm/tip", (2.0, 0.5, 0.5))]
    problem = wb.Problem(scene, goals=goals, constraints=feet("anna/"))
    assert any(isinstance(term, wb.tasks.RangeOfMotion) for term in problem.constraints)
    solution = wb.solve(problem, "newton")
    assert solution.status == "solved"
    assert max(solution.assessment.goal_errors) < 1e-4


def test_a_figure_is_neither_removed_nor_moved_as_a_thing(planar_arm: Any) -> None:
    scene = wb.Scene({"one": planar_arm([0.3, 0.2]), "two": (planar_arm([0.3, 0.2]), (2.0, 0.0, 0.0))})
    with pytest.raises(InputError, match="is a figure, which stays in its scene"):
        scene.remove("one")
    with pytest.raises(InputError, match="is a figure, which stays in its scene"):
        scene.move("two", at=(1.0, 0.0, 0.0))
