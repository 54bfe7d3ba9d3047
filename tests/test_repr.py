"""Scenes, problems and solutions are shown in at most three readable lines, with the numbers that count."""

from __future__ import annotations

import numpy as np

import wholebody as wb


def test_scene_problem_and_solution_in_three_lines() -> None:
    scene = wb.Scene(wb.load("human"))
    assert "none" in repr(scene)
    assert "nothing" in repr(scene)
    for k in range(8):
        scene.add(wb.Sphere(0.05), name=f"ball {k}", at=(3.0 + k, 0.0, 1.0))
    scene.attach(wb.Box((0.1, 0.1, 0.1)), to="right_hand", name="parcel", at=(0.0, 0.2, -0.2))
    problem = wb.Problem(
        scene,
        goals=[wb.Point("right_index_tip", (9.0, 0.0, 1.0))],
        constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")],
        clearance=0.002,
    )
    solution = wb.solve(problem)
    for thing in (scene, problem, solution):
        assert len(repr(thing).splitlines()) <= 3
        assert max(map(len, repr(thing).splitlines())) < 300
        assert "array" not in repr(thing)
        assert str(thing) == repr(thing)
    assert "'human'" in repr(scene)
    assert "ball 0" in repr(scene)
    assert "2 more" in repr(scene)
    assert "carried: parcel" in repr(scene)
    assert "Point(right_index_tip)" in repr(problem)
    assert "2 mm" in repr(problem)
    assert "Hold(left_foot), Hold(right_foot)" in repr(problem)
    assert "unreachable" in repr(solution)
    missed = np.linalg.norm(scene.figure.placement(solution.q, "right_index_tip").translation - (9.0, 0.0, 1.0))
    assert f"missed by {1e3 * missed:.3g} mm" in repr(solution)
    assert str(solution.assessment) in repr(solution)


def test_a_frame_of_a_drag_in_one_line() -> None:
    scene = wb.Scene(wb.load("hand"))
    place = scene.figure.placement(scene.figure.neutral, "right_index_tip").translation
    frame = wb.tracking.Drag(wb.Problem(scene, goals=[wb.Point("right_index_tip", place)])).to(place)
    assert repr(frame).startswith("DragFrame: error ")
    assert "array" not in repr(frame)
    assert f"{frame.iterations} iterations" in repr(frame)


def test_what_has_long_arrays_is_shown_in_a_line() -> None:
    figure = wb.load("human")
    q = np.tile(figure.posture("standing"), (200, 1))
    scene = wb.Scene(figure)
    shown = [
        wb.Clip(figure, q, 0.02),
        wb.Hull(np.random.default_rng(0).normal(size=(100, 3))),
        wb.World(scene),
        wb.Viewer(scene),
    ]
    for each in shown:
        assert len(repr(each)) < 200
        assert "\n" not in repr(each)
    assert "200 frames" in repr(shown[0])
    assert "(100, 3)" in repr(shown[1])
