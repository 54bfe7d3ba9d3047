"""The exported files: complete, the same each time, as their schemas say, and the same problems as in the package."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.bench.suite.published.published_helpers import SEED, witness
from wholebody.base.errors import InputError
from wholebody.bench.suite.problem_sets.registry import SETS, problem_set
from wholebody.bench.suite.published.bodies import body_files
from wholebody.bench.suite.published.export import export
from wholebody.bench.suite.published.problems import problem_content
from wholebody.bench.suite.published.rebuilt import Rebuilt
from wholebody.cli import main


def test_the_same_seed_gives_the_same_bytes_and_another_gives_others(tmp_path: Path) -> None:
    sets = [problem_set("free_reach"), problem_set("robot_arm")]
    texts = []
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        export(sets, 1, seed, tmp_path / name)
        files = sorted(path for path in (tmp_path / name).rglob("*") if path.is_file())
        texts.append({str(path.relative_to(tmp_path / name)): path.read_bytes() for path in files})
    assert texts[0] == texts[1]
    assert texts[0]["index.json"] != texts[2]["index.json"]
    assert texts[0]["problems/robot_arm/0000.json"] != texts[2]["problems/robot_arm/0000.json"]


def test_all_files_are_there(folder: Path) -> None:
    index = json.loads((folder / "index.json").read_text())
    assert list(index["sets"]) == list(SETS)
    assert "nothing of wholebody is imported" in (folder / "clients" / "plain_pinocchio.py").read_text()
    assert (folder / "LICENSE").read_text().startswith("Creative Commons Legal Code\n\nCC0 1.0 Universal")
    for name, family in index["sets"].items():
        assert family["problems"] == [f"{name}/0000", f"{name}/0001"]
        for seed in ("near", "far"):
            measured = family["difficulty"]["gauss_newton"][seed]
            assert 0 <= measured["solved"] <= measured["of"] == 2
            assert 0.0 <= measured["interval"][0] < measured["interval"][1] <= 1.0
        assert family["difficulty"]["witness_distance_median"] > 0.1


def test_problems_do_not_hold_their_witness(folder: Path, names: list[str]) -> None:
    for name in names:
        found = witness(folder, name)
        postures = found.get("postures", [found.get("posture")])
        text = (folder / "problems" / f"{name}.json").read_text()
        assert repr(postures[0][-1]) not in text or postures[0][-1] == 0.0


def test_files_are_as_their_schemas_say(folder: Path, names: list[str]) -> None:
    for kind, paths in (
        ("problem", [folder / "problems" / f"{name}.json" for name in names]),
        ("body", sorted((folder / "bodies").glob("*.json"))),
    ):
        schema = json.loads((folder / f"{kind}.schema.json").read_text())
        assert paths
        for path in paths:
            check(json.loads(path.read_text()), schema, schema, path.name)
    broken = json.loads((folder / "problems" / f"{names[0]}.json").read_text())
    broken["goals"][0]["quaternion"] = [0.0, 0.0, 1.0]
    schema = json.loads((folder / "problem.schema.json").read_text())
    with pytest.raises(AssertionError, match="goals"):
        check(broken, schema, schema, "broken")


@pytest.mark.parametrize("family", SETS)
def test_the_judge_of_the_files_agrees_with_the_assessment_of_the_package(folder: Path, family: str) -> None:
    """Two codes that share only Pinocchio and coal, at postures that violate everything."""
    case = problem_set(family).make(0, SEED)
    problem, rebuilt = case.problem, Rebuilt(folder, f"{family}/0000")
    model = problem.scene.model
    rng = np.random.default_rng(5)
    order = _order(problem.scene.figure, rebuilt)
    for spread in (0.0, 0.05, 0.3):
        q = pin.integrate(model, case.witness, spread * rng.uniform(-1.0, 1.0, model.nv))
        if case.frames:
            problem.retarget(case.frames[0])
        expected, found = wb.assess(problem, q), rebuilt.score(q[order])
        assert found.goal_error == pytest.approx(expected.goal_error, abs=1e-9)
        assert found.goal_angle == pytest.approx(expected.goal_angle, abs=1e-7)
        assert found.overlap == pytest.approx(expected.penetration, abs=1e-6)
        assert found.clearance == pytest.approx(expected.clearance_violation, abs=1e-6)
        assert found.limits == pytest.approx(expected.limit_violation, abs=1e-9)
        (effort,) = (term for term in problem.measures if isinstance(term, wb.Effort))
        state = problem.scene.state(q)
        assert found.effort == pytest.approx(effort.value(state), rel=1e-9, abs=1e-12)
        # The package's figure is the largest row of a constraint, the files' the length of position and rotation.
        assert expected.constraint_violation - 1e-9 <= found.holds <= 1.8 * expected.constraint_violation + 1e-9


def test_seeds_are_the_start_and_a_random_posture_within_the_limits(folder: Path, names: list[str]) -> None:
    for name in names:
        rebuilt = Rebuilt(folder, name)
        near, far = rebuilt.score(rebuilt.seed("near")), rebuilt.score(rebuilt.seed("far"))
        assert max(near.overlap, near.limits, near.holds) < 1e-6
        assert near.effort == 0.0
        assert far.limits < 1e-9
        assert far.holds < 0.2  # feet stay, and hands that hold one thing; balance may be lost
        assert np.abs(rebuilt.seed("far") - rebuilt.seed("near")).max() > 0.3


ROBOT = """<robot name="crane">
<link name="base"><collision><geometry><box size="0.2 0.3 0.1"/></geometry></collision></link>
<link name="post"><inertial><origin xyz="0.1 0 0.2" rpy="0.3 0 0"/><mass value="2"/>
<inertia ixx="0.1" ixy="0.01" ixz="0" iyy="0.2" iyz="0" izz="0.3"/></inertial></link>
<link name="arm"/><link name="hook"/>
<joint name="z_lift" type="prismatic"><parent link="base"/><child link="post"/>
<origin xyz="0 0.1 0.2" rpy="0.1 1.5707963 2"/><axis xyz="0 0.6 0.8"/>
<limit lower="0" upper="1" effort="1" velocity="1"/></joint>
<joint name="a_turn" type="revolute"><parent link="post"/><child link="arm"/><origin xyz="0.3 0 0" rpy="-2 0.4 1"/>
<axis xyz="0.6 0 -0.8"/><limit lower="-2" upper="1" effort="1" velocity="1"/></joint>
<joint name="end" type="fixed"><parent link="arm"/><child link="hook"/><origin xyz="0 0 0.4" rpy="0 -1.2 3"/></joint>
</robot>"""


def test_a_robot_written_anew_is_the_same_robot(tmp_path: Path) -> None:
    """Every link is where it was, at random postures, and the mass is what it was; no axis is one of the base's."""
    (tmp_path / "crane.urdf").write_text(ROBOT)
    figure = wb.load(tmp_path / "crane.urdf")
    made = body_files(figure, "crane", {})
    again = pin.buildModelFromXML(made.urdf)
    rng = np.random.default_rng(0)
    for _ in range(5):
        q = rng.uniform(0.0, 1.0, figure.model.nq)
        first, second = figure.model.createData(), again.createData()
        pin.framesForwardKinematics(figure.model, first, q)
        pin.framesForwardKinematics(again, second, q[made.order])
        for name in ("base", "post", "arm", "hook"):
            there = first.oMf[figure.frame_id(name)].actInv(second.oMf[again.getFrameId(name)])
            assert np.abs(pin.log6(there).vector).max() < 1e-7  # the file turns by 1.5707963, not by a quarter
        masses = [pin.centerOfMass(model, data, posture) for model, data, posture in (
            (figure.model, first, q), (again, second, q[made.order]))]  # fmt: skip
        assert np.abs(masses[0] - masses[1]).max() < 1e-7


def test_a_joint_that_no_file_says_is_refused(tmp_path: Path) -> None:
    (tmp_path / "wheel.urdf").write_text(ROBOT.replace('"revolute"', '"continuous"'))
    with pytest.raises(InputError, match=r"joint 'a_turn' is a .*; only hinges and slides with limits"):
        body_files(wb.load(tmp_path / "wheel.urdf"), "wheel", {})


def test_a_full_folder_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match="not an empty folder"):
        export([problem_set("free_reach")], 1, 0, folder)


def test_the_command_writes_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "export", str(tmp_path / "out"), "--sets", "robot_arm", "--per-set", "1"]) == 0
    assert "wrote 1 problems" in capsys.readouterr().out
    assert main(["bench", "export", str(tmp_path / "other"), "--per-set", "0"]) != 0
    assert "--per-set is 0" in capsys.readouterr().err


def _order(figure: wb.Figure, rebuilt: Rebuilt) -> Any:
    names = list(rebuilt.model.names)[1:]
    root = 7 if figure.root == "free" else 0
    joints = [name for name in names if name in figure.joints]
    return [*range(root), *(figure.model.joints[figure.joint_id(name)].idx_q for name in joints)]


def check(value: Any, schema: dict[str, Any], root: dict[str, Any], where: str) -> None:
    """Assert that a value is as a JSON schema says; of the keywords those that ours use."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        check(value, root["$defs"][name], root, where)
    if "oneOf" in schema:
        fits = 0
        for option in schema["oneOf"]:
            try:
                check(value, option, root, where)
                fits += 1
            except AssertionError:
                pass
        assert fits == 1, f"{where}: {fits} options fit"
    if "const" in schema:
        assert value == schema["const"], where
    if "enum" in schema:
        assert value in schema["enum"], where
    kinds = {"object": dict, "array": list, "string": str, "number": (int, float), "integer": int, "null": type(None)}
    if "type" in schema:
        wanted = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
        assert any(isinstance(value, kinds[kind]) for kind in wanted), f"{where}: {type(value)}"
    if isinstance(value, dict):
        for key in schema.get("required", []):
            assert key in value, f"{where}: no {key}"
        for key, inner in value.items():
            if key in schema.get("properties", {}):
                check(inner, schema["properties"][key], root, f"{where}.{key}")
            else:
                assert schema.get("additionalProperties", True), f"{where}.{key}"
    if isinstance(value, list):
        assert schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)), where
        for place, inner in enumerate(value):
            check(inner, schema.get("items", {}), root, f"{where}[{place}]")


@pytest.fixture(scope="module")
def figures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two people, two arms, and a person with an arm."""
    made = tmp_path_factory.mktemp("figures") / "out"
    export([problem_set("two_figures")], 3, SEED, made)
    return made


def model_order(figure: wb.Figure) -> dict[str, int]:
    """Where in a posture each coordinate of the files is."""
    where: dict[str, int] = {}
    for name, joint in zip(list(figure.model.names)[1:], list(figure.model.joints)[1:], strict=True):
        places = ("x", "y", "z", "qx", "qy", "qz", "qw")
        named = [name] if joint.nq == 1 else [f"{name} {place}" for place in places]
        where |= {one: joint.idx_q + k for k, one in enumerate(named)}
    return where


@pytest.mark.parametrize("number", range(3))
def test_several_figures_are_one_body_of_which_free_roots_float(figures: Path, number: int) -> None:
    """The files, read by Pinocchio and coal alone, are judged as the package judges the scene."""
    case, rebuilt = problem_set("two_figures").make(number, SEED), Rebuilt(figures, f"two_figures/{number:04d}")
    body = json.loads((figures / rebuilt.content["body"]).read_text())
    check(body, schema := json.loads((figures / "body.schema.json").read_text()), schema, "body")
    figure, problem = case.problem.scene.figure, case.problem
    where = model_order(figure)
    assert set(where) == set(body["coordinates"])
    assert len(body["root_effort_weights"]) == 6 * len(figure.roots) == 6 * (2, 0, 1)[number]
    order, rng = [where[name] for name in body["coordinates"]], np.random.default_rng(5)
    for spread in (0.0, 0.05, 0.3):
        q = pin.integrate(figure.model, case.witness, spread * rng.uniform(-1.0, 1.0, figure.model.nv))
        expected, found = wb.assess(problem, q), rebuilt.score(q[order])
        assert found.goal_error == pytest.approx(expected.goal_error, abs=1e-9)
        assert found.goal_angle == pytest.approx(expected.goal_angle, abs=1e-7)
        assert found.overlap == pytest.approx(expected.penetration, abs=1e-6)
        assert found.limits == pytest.approx(expected.limit_violation, abs=1e-9)
        (effort,) = (term for term in problem.measures if isinstance(term, wb.Effort))
        assert found.effort == pytest.approx(effort.value(problem.scene.state(q)), rel=1e-9, abs=1e-12)


def test_balance_of_one_of_several_is_that_of_its_links(figures: Path, tmp_path: Path) -> None:
    case, name = problem_set("two_figures").make(2, SEED), "two_figures/0002"
    figure, balance = case.problem.scene.figure, wb.Balance(["one/left_foot", "one/right_foot"])
    stated = balance.resolve(case.problem.scene, case.witness)
    case.problem.constraints = (*case.problem.constraints, stated)
    shutil.copytree(figures, out := tmp_path / "out")
    content = problem_content(case, body_files(figure, "both", {}), case.witness, {})
    content["holds"], content["body"] = [], json.loads((out / "problems" / f"{name}.json").read_text())["body"]
    check(content, schema := json.loads((out / "problem.schema.json").read_text()), schema, name)
    (out / "problems" / f"{name}.json").write_text(json.dumps(content))
    rebuilt = Rebuilt(out, name)
    body = json.loads((out / content["body"]).read_text())
    read = model_order(figure)
    q = case.witness.copy()
    q[read["one/root_joint x"]] += 0.3  # over feet that the balance takes for fixed
    inside = stated.value(case.problem.scene.state(q))
    missed = float(np.maximum(stated.lower - inside, 0.0).max())
    assert missed > 0.01
    order = [read[one] for one in body["coordinates"]]
    assert rebuilt.score(q[order]).holds == pytest.approx(missed, abs=1e-9)
    assert rebuilt.score(case.witness[order]).holds < 1e-6
