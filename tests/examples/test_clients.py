"""Clients that answer published problems without wholebody: run as scripts, judged by `wholebody bench judge`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.bench.suite.published.published_helpers import short_drag
from wholebody.bench.suite.problem_sets.registry import problem_set
from wholebody.bench.suite.published.answers import read_answers
from wholebody.bench.suite.published.export import export
from wholebody.bench.suite.published.judging import Verdict, judge

SETS = ("free_reach", "robot_arm", "balance", "closed_loop")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return an export of one problem of some sets."""
    found = tmp_path_factory.mktemp("clients") / "problems"
    export([*map(problem_set, SETS), short_drag()], 1, 0, found)
    return found


def answered(script: Path, folder: Path, tmp_path: Path, python: str = sys.executable) -> Verdict:
    """Run a client where wholebody cannot be imported, and judge what it wrote."""
    out = tmp_path / "answers.json"
    code = f"import sys, runpy; sys.modules['wholebody'] = None; sys.argv = {[str(script), str(folder), str(out)]!r}; "
    done = subprocess.run(
        [python, "-c", code + f"runpy.run_path({str(script)!r}, run_name='__main__')"],
        cwd=tmp_path, capture_output=True, text=True, timeout=200, env={**os.environ, "OMP_NUM_THREADS": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return judge(read_answers(out, folder), folder)


@pytest.fixture(scope="module")
def small(root: Path, folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Verdict:
    """Return what the small client of Pinocchio comes to."""
    return answered(root / "examples" / "clients" / "small_pinocchio.py", folder, tmp_path_factory.mktemp("small"))


def outcomes(verdict: Verdict) -> dict[tuple[str, str], Any]:
    return {
        (one.problem.rsplit("/", 1)[0], one.seed): one.solved if one.outcome == "answered" else one.said
        for one in verdict.judged
    }


def test_plain_pinocchio(root: Path, folder: Path, tmp_path: Path) -> None:
    verdict = answered(root / "examples" / "clients" / "plain_pinocchio.py", folder, tmp_path)
    found = outcomes(verdict)
    assert len(found) == 2 * (len(SETS) + 1)
    assert all(found[name, "near"] is True for name in ("free_reach", "robot_arm", "closed_loop"))
    assert found["drag", "far"] == "goals that move are not followed"
    assert all(one.seconds > 0.0 for one in verdict.judged if one.outcome == "answered")


def test_small_pinocchio(root: Path, small: Verdict) -> None:
    """It reaches an arm's goal; it does not look at contacts, and says what it does not express."""
    script = root / "examples" / "clients" / "small_pinocchio.py"
    assert len(script.read_text().splitlines()) <= 60
    found = outcomes(small)
    assert len(found) == 2 * (len(SETS) + 1)
    assert {found[name, "near"] for name in ("balance", "drag")} == {"only places in the world are expressed"}
    (arm,) = [one for one in small.judged if (one.problem.rsplit("/", 1)[0], one.seed) == ("robot_arm", "near")]
    assert arm.score.goal_error < 2e-3


def test_small_mujoco_answers_as_small_pinocchio_does(root: Path, small: Verdict, folder: Path, tmp_path: Path) -> None:
    """The same steps by two engines: a reader of the one understands the other.

    From the start they end in the same place. From the random seed they take many steps along the limits, in which the
    rounding of a processor grows.
    """
    pytest.importorskip("mujoco")
    script = root / "examples" / "clients" / "small_mujoco.py"
    assert len(script.read_text().splitlines()) <= 60
    first, second = answered(script, folder, tmp_path).judged, small.judged
    assert [one.outcome for one in first] == [one.outcome for one in second]
    for one, other in zip(first, second, strict=True):
        if one.outcome == "answered":
            apart = 1e-7 if one.seed == "near" else 2e-5
            assert one.score.goal_error == pytest.approx(other.score.goal_error, abs=apart)


def test_plain_mujoco(root: Path, folder: Path, tmp_path: Path) -> None:
    """Another engine reads the same files: what it takes for free of overlap is so for Pinocchio and coal."""
    pytest.importorskip("mujoco")
    found = outcomes(answered(root / "examples" / "clients" / "plain_mujoco.py", folder, tmp_path))
    assert all(found[name, "near"] is True for name in ("free_reach", "robot_arm", "closed_loop"))
    assert found["balance", "near"] == "balance is not expressed"


def test_oink(root: Path, folder: Path, tmp_path: Path) -> None:
    """A tool that needs another Pinocchio answers in an environment of its own, whose python WHOLEBODY_OINK names."""
    python = os.environ.get("WHOLEBODY_OINK")
    if python is None:
        pytest.skip("WHOLEBODY_OINK names no python that has roboplan-oink")
    verdict = answered(root / "examples" / "clients" / "oink.py", folder, tmp_path, python)
    found = outcomes(verdict)
    assert len(found) == 2 * (len(SETS) + 1)
    assert all(found[name, "near"] is True for name in ("free_reach", "robot_arm", "closed_loop"))
    assert found["balance", "near"] == "balance is not expressed"
    assert found["drag", "far"] == "goals that move are not followed"
    near = [one for one in verdict.judged if one.seed == "near" and one.outcome == "answered"]
    assert all(one.score.overlap < 1e-5 for one in near)


def test_another_engine_places_every_link_where_pinocchio_does(folder: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    import numpy as np
    import pinocchio as pin

    body = json.loads((folder / "bodies" / "human.json").read_text())
    urdf = str(folder / body["urdf"])
    spec = mujoco.MjSpec.from_file(urdf)
    spec.compiler.fusestatic = False
    spec.worldbody.first_body().add_freejoint()
    other = spec.compile()
    model = pin.buildModelFromUrdf(urdf, pin.JointModelFreeFlyer())
    q = np.array(json.loads((folder / "problems" / "free_reach" / "0000.json").read_text())["seeds"]["far"])
    data, there = model.createData(), mujoco.MjData(other)
    pin.framesForwardKinematics(model, data, q)
    there.qpos[:7] = q[[0, 1, 2, 6, 3, 4, 5]]
    for name, value in zip(body["coordinates"][7:], q[7:], strict=True):
        there.qpos[other.joint(name).qposadr[0]] = value
    mujoco.mj_kinematics(other, there)
    links = [other.body(k).name for k in range(1, other.nbody)]
    assert {"left_palm", "gaze", "right_index_tip"} <= set(links)
    for name in links:
        place = data.oMf[model.getFrameId(name, pin.FrameType.BODY)]
        assert there.body(name).xpos == pytest.approx(place.translation, abs=1e-9)
        assert there.body(name).xmat.reshape(3, 3) == pytest.approx(place.rotation, abs=1e-9)
