"""Bisection on clips whose collisions are made on purpose: every frame free, nothing changed outside of the groups."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from tests.freeing import Found, freed_by
from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.figures.state import State
from wholebody.methods.control import Progress
from wholebody.methods.qp.method import QP
from wholebody.motion.avoider import AvoidProgress, Run, Watch
from wholebody.motion.bisection import method as method_module
from wholebody.motion.bisection.method import Bisection
from wholebody.motion.bisection.prediction import Predictor
from wholebody.motion.clip import Clip
from wholebody.motion.frame_terms import frame_terms
from wholebody.motion.windows import runs
from wholebody.motion.worn_equipment import equipment

DEEP = 1e-4  # m
LENGTHS = (0.5, 0.4, 0.3)  # m: an arm in the plane
SPREAD = 0.2  # rad: with less, swinging arms are in the trunk


@pytest.fixture(scope="module")
def person() -> Figure:
    """Return an avatar, which is a person with fewer joints."""
    return wb.load("avatar")


@pytest.fixture(scope="module")
def swing(person: Figure) -> Clip:
    return swinging(person)


def swinging(person: Figure) -> Clip:
    """Arms swing as in a walk, a period of 40 frames."""
    phase = 2.0 * np.pi * np.arange(41) / 40.0
    q = [
        person.with_joints(
            person.neutral,
            {
                "left_shoulder_abduction": SPREAD,
                "right_shoulder_abduction": SPREAD,
                "left_shoulder_flexion": 0.5 * np.sin(t),
                "right_shoulder_flexion": -0.5 * np.sin(t),
                "left_elbow_flexion": 0.4 + 0.3 * np.sin(t),
            },
        )
        for t in phase.tolist()
    ]
    return Clip(person, np.array(q), 1 / 30)


def dressed(figure: Figure, name: str) -> wb.Scene:
    scene = wb.Scene(figure)
    for piece in equipment(name, figure):
        piece.attach(scene)
    return scene


def depths(scene: wb.Scene, q: Array) -> Array:
    """Deepest overlap at each posture by coal on all pairs, which the method does not use."""
    model, geometry = scene.model, scene.geometry
    data, results = model.createData(), pin.GeometryData(geometry)
    found = []
    for posture in q:
        pin.updateGeometryPlacements(model, data, geometry, results, posture)
        nearest = pin.computeDistances(geometry, results)
        found.append(max(0.0, -results.distanceResults[nearest].min_distance))
    return np.array(found)


def between(scene: wb.Scene, q: Array, parts: int = 3) -> float:
    """Deepest overlap at postures between those of a clip."""
    steps = [pin.interpolate(scene.model, a, b, k / parts) for a, b in pairwise(q) for k in range(parts)]
    return float(depths(scene, np.array(steps)).max())


def changed(clip: Clip, result: Found) -> Array:
    return np.flatnonzero((result.q != clip.q).any(axis=1))


@pytest.mark.parametrize(("gear", "kind"), [("side_sphere", "linear"), ("pack", "quadratic")])
def test_every_frame_is_free_and_frames_outside_of_the_groups_stay(swing: Clip, gear: str, kind: str) -> None:
    scene = dressed(swing.figure, gear)
    before = depths(scene, swing.q) > DEEP
    assert 10 < before.sum() < len(swing)
    buffer = 20.0
    result = freed_by(Bisection(buffer=buffer, least=1, interpolation=kind, evaluation=()), swing, scene)  # type: ignore[arg-type]
    assert depths(scene, result.q).max() <= DEEP
    assert between(scene, result.q) <= DEEP
    assert result.posture_solves < before.sum()
    allowed = set()
    for first, end in runs(before):
        room = round((end - first) * buffer / 100)
        allowed |= set(range(first - room, end + room))
    assert set(changed(swing, result).tolist()) <= allowed
    assert all(swing.figure.within_limits(q) for q in result.q)
    assert np.array_equal(result.q[:, :7], swing.q[:, :7])  # the root stays


def test_the_original_clip_and_the_answer_do_not_depend_on_earlier_runs(swing: Clip) -> None:
    clip = swing[8:30]
    scene, kept = dressed(swing.figure, "side_sphere"), swing.q.copy()
    first = freed_by(Bisection(), clip, scene)
    second = freed_by(Bisection(), clip, scene)
    assert np.array_equal(swing.q, kept)
    assert np.array_equal(first.q, second.q)


def test_evaluation_points_keep_what_interpolation_smooths_away(swing: Clip) -> None:
    """With pouches every frame collides: without points the whole swing is interpolated, with them it is kept."""
    scene = dressed(swing.figure, "pouches")
    assert (depths(scene, swing.q) > DEEP).all()
    away = {}
    for name, points in (("none", ()), ("turns", (0, 10, 20, 30, 40)), ("chosen", None)):
        result = freed_by(Bisection(evaluation=points), swing, scene)
        assert depths(scene, result.q).max() <= DEEP, name
        away[name] = float(np.abs(result.q - swing.q).max())
    assert away["turns"] < 0.5 * away["none"]
    assert away["chosen"] < 0.5 * away["none"]


def test_a_ring_as_it_stands_is_left_free_between_frames_too(swing: Clip) -> None:
    """Frames inside of the hole and outside of it are free, and the way from one to the other is not."""
    scene, half = dressed(swing.figure, "torus"), swing[:21]
    result = freed_by(Bisection(), half, scene)
    assert depths(scene, result.q).max() <= DEEP
    assert between(scene, result.q) <= DEEP


def test_feet_that_are_held_side_by_side_are_asked_for_no_more_room(person: Figure) -> None:
    """They stand in each other by 4 cm and are held 1 mm apart: with 5 mm of room every posture missed a hold."""
    angles = {"hip_abduction": -0.06, "knee_flexion": 0.2}  # between straight shanks there is no such room either
    close = {f"{side}_{name}": angle for side in ("left", "right") for name, angle in angles.items()}
    q, scene = person.with_joints(person.posture("standing"), close), dressed(person, "pouches")
    terms = frame_terms(scene, np.array([q] * 9), 1 / 30, [wb.motion.StanceFeet(), wb.Freeze("root")])
    with scene.borrow() as workspace:
        method = QP(restarts=0, iterations=50)
        run = Run(Clip(person, terms.q, 1 / 30), terms, workspace, 0.0, Watch(None))
        found = Predictor(run, method, 0.005).predict(4, q, [])
    assert found.good
    assert depths(scene, found.q[None])[0] <= 5e-5
    state = scene.state(found.q)
    for foot in terms.feet(4):
        held = foot.resolve(scene, q).kept_at.translation
        np.testing.assert_allclose(state.frame(person.frame_id(foot.frame)).translation, held, atol=2e-4)


def test_in_the_sphere_mode_no_spheres_of_two_groups_intersect(human: Figure) -> None:
    """Self-collision of the thesis: 39 spheres, and a pouch filled with spheres."""
    swing, figure = swinging(human), wb.load("human", detail="spheres")
    clip, scene = Clip(figure, swing.q[:21], swing.dt), wb.Scene(figure)
    for piece in equipment("pouches", figure):
        piece.filled(8, envelope=True).attach(scene)
    assert (depths(scene, clip.q) > DEEP).any()
    result = freed_by(Bisection(), clip, scene)
    assert depths(scene, result.q).max() <= DEEP


def test_frozen_joints_are_the_original_ones_in_every_frame(human: Figure) -> None:
    swing = swinging(human)
    scene, swing = dressed(swing.figure, "side_sphere"), swing[:15]
    result = freed_by(Bisection(frozen=("root", "lower_body", "spine")), swing, scene)
    columns = [
        swing.figure.model.joints[swing.figure.joint_id(name)].idx_q
        for name in swing.figure.joint_names(["lower_body", "spine"])
    ]
    assert np.array_equal(result.q[:, columns], swing.q[:, columns])
    assert depths(scene, result.q).max() <= DEEP


def test_the_root_moves_where_a_frame_cannot_be_freed_with_it_frozen(swing: Clip) -> None:
    """A block is 5 cm in the pelvis, which moves with the root alone."""
    still, scene = Clip(swing.figure, np.tile(swing.q[0], (3, 1)), swing.dt), wb.Scene(swing.figure)
    scene.add(wb.Box((0.5, 0.5, 0.06)), name="block", at=(-0.35, 0.0, 0.95))
    frozen = freed_by(Bisection(frozen=("root",)), still, scene)
    assert np.array_equal(frozen.q[:, :7], still.q[:, :7])
    assert depths(scene, frozen.q).max() > 0.04
    result = freed_by(Bisection(), still, scene)
    assert depths(scene, result.q).max() <= DEEP
    assert 0.04 < np.linalg.norm(result.q[:, :3] - still.q[:, :3], axis=1).min() < 0.07


def test_a_constraint_freezes_as_the_setting_does(swing: Clip) -> None:
    scene, swing = dressed(swing.figure, "side_sphere"), swing[:15]
    column = swing.figure.model.joints[swing.figure.joint_id("left_elbow_flexion")].idx_q
    result = freed_by(Bisection(), swing, scene, [wb.Freeze("left_elbow_flexion")])
    assert np.array_equal(result.q[:, column], swing.q[:, column])
    assert len(changed(swing, result))


def test_the_second_hand_keeps_its_place_on_the_weapon_in_every_frame(human: Figure) -> None:
    """Both hands hold one weapon; elbows swing into a ball at the side of the torso."""
    scene = dressed(human, "side_sphere")
    held = wb.Problem(
        wb.Scene(human),
        goals=[wb.Point("right_palm", (0.25, -0.12, 1.1)), wb.Point("left_palm", (0.42, 0.06, 1.12))],
        constraints=[wb.Freeze("root", "lower_body", "spine")],
    )
    base = wb.solve(held).q
    ways = 0.1 * np.sin(2 * np.pi * np.arange(6) / 6)
    q = [
        wb.solve(
            wb.Problem(
                wb.Scene(human),
                base,
                goals=[
                    wb.Point("right_palm", (0.22 + way, -0.14, 1.08)),
                    wb.Relative("left_palm", "right_palm", orientation=False),
                ],
                constraints=[wb.Freeze("root", "lower_body", "spine")],
            )
        ).q
        for way in ways.tolist()
    ]
    clip = Clip(human, np.array(q), 1 / 30)
    assert (depths(scene, clip.q) > DEEP).any()
    grip = wb.Hold("left_palm", relative_to="right_palm", orientation=False)
    result = freed_by(Bisection(), clip, scene, [grip])
    assert depths(scene, result.q).max() <= DEEP
    state = State(human.model)
    for before, after in zip(clip.q, result.q, strict=True):
        places = []
        for posture in (before, after):
            state.update(posture)
            left, right = (state.frame(human.frame_id(f"{side}_palm")).copy() for side in ("left", "right"))
            places.append((right.inverse() * left).translation)
        assert np.linalg.norm(places[0] - places[1]) < 1e-3


def test_the_ends_of_the_clip_are_freed(swing: Clip) -> None:
    """Frames 0 to 4 and the last collide; the first and the last frame are predicted, not left out."""
    scene = dressed(swing.figure, "side_sphere")
    clip = swing[0:20]
    assert (depths(scene, clip.q) > DEEP)[[0, -1]].all()
    result = freed_by(Bisection(evaluation=()), clip, scene)
    assert depths(scene, result.q).max() <= DEEP
    assert {0, 19} <= set(changed(clip, result).tolist())


@pytest.mark.parametrize("frames", [1, 3])
def test_short_clips_are_freed(swing: Clip, frames: int) -> None:
    scene = dressed(swing.figure, "side_sphere")
    clip = swing[:frames]
    for kind in ("linear", "quadratic"):
        result = freed_by(Bisection(interpolation=kind), clip, scene)  # type: ignore[arg-type]
        assert depths(scene, result.q).max() <= DEEP
        assert np.isfinite(result.q).all()


def test_a_middle_that_cannot_be_freed_ends_with_a_sentence(swing: Clip) -> None:
    """Everything is frozen: the thesis' recursion would call itself without end."""
    scene, swing = dressed(swing.figure, "side_sphere"), swing[:15]
    names = ("root", "lower_body", "upper_body", "neck")
    result = freed_by(Bisection(frozen=names, evaluation=()), swing, scene)
    assert result.posture_solves < 4 * len(swing)
    assert np.array_equal(result.q, swing.q)


def test_a_search_that_other_starts_may_end_is_short(swing: Clip, monkeypatch: pytest.MonkeyPatch) -> None:
    lengths, short = list[int](), 25  # programs, as the docstring of `Bisection` says

    class Endless(wb.methods.QP):
        """Has its answer at once, and goes on until it is ended."""

        def solve(self, problem: wb.Problem, progress: Progress | None = None) -> wb.Solution:
            found, told = super().solve(problem), 0
            while progress is not None and told < 10 * short and progress(found.trace[-1]) is not True:
                told += 1
            lengths.append(told if progress is not None else 10 * short)
            return found

    monkeypatch.setattr(method_module, "QP", Endless)
    freed_by(Bisection(), swing[:15], dressed(swing.figure, "torus"))
    assert max(lengths) < short


def test_the_search_goes_on_where_no_start_leads_to_a_free_posture_soon(swing: Clip) -> None:
    scene, kept, swing = dressed(swing.figure, "side_sphere"), list[wb.Solution](), swing[:15]
    overlapping = swing.q[np.argmax(depths(scene, swing.q))]

    class Slow(wb.methods.QP):
        """Has found a posture that overlaps when it is ended."""

        def solve(self, problem: wb.Problem, progress: Progress | None = None) -> wb.Solution:
            found = super().solve(problem)
            if progress is not None:
                return replace(found, q=overlapping)
            kept.append(found)
            return found

    result = freed_by(Bisection(method=Slow(restarts=0), frozen=("root",)), swing, scene)
    assert kept
    assert depths(scene, result.q).max() <= DEEP


def test_the_caller_may_end_it(swing: Clip) -> None:
    told: list[AvoidProgress] = []

    def end(progress: AvoidProgress) -> bool:
        told.append(progress)
        return len(told) > 2

    freed_by(Bisection(), swing, dressed(swing.figure, "side_sphere"), (), end)
    assert len(told) < 10
    assert all(0.0 <= progress.share <= 1.0 for progress in told)


def test_ctrl_c_in_a_prediction_ends_all(swing: Clip) -> None:
    """A solve on its own answers Ctrl-C with the best posture so far; the others would go on."""
    begun = list[float]()

    class Interrupted(wb.methods.QP):
        def solve(self, problem: wb.Problem, progress: Progress | None = None) -> wb.Solution:
            begun.append(0.0)
            return super().solve(problem, lambda entry: os.kill(os.getpid(), signal.SIGINT))

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            wb.avoid(swing, dressed(swing.figure, "side_sphere"), method=Bisection(method=Interrupted(restarts=0)))
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert len(begun) == 1


def test_a_clip_beyond_its_limits_comes_back_within_them(swing: Clip) -> None:
    figure = swing.figure
    column = figure.model.joints[figure.joint_id("left_elbow_flexion")].idx_q
    swing = swing[:15]
    q = swing.q.copy()
    q[10, column] = figure.model.upperPositionLimit[column] + 0.1
    result = freed_by(Bisection(), swing.with_q(q), dressed(figure, "side_sphere"))
    assert all(figure.within_limits(posture) for posture in result.q)


def test_a_figure_without_root_and_elbows_is_freed(planar_arm: Callable[..., Figure]) -> None:
    """An arm in the plane folds into itself and opens again."""
    figure = planar_arm([0.3, 0.3, 0.3, 0.3])
    fold = 2.2 * np.sin(np.pi * np.arange(31) / 30)
    q = np.zeros((31, 4))
    q[:, 1], q[:, 2] = fold, fold
    clip, scene = Clip(figure, q, 0.05), wb.Scene(figure)
    assert (depths(scene, clip.q) > DEEP).any()
    result = freed_by(Bisection(buffer=0.0), clip, scene)
    assert depths(scene, result.q).max() <= DEEP
    assert between(scene, result.q) <= DEEP
