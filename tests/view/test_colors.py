"""Colours of segments."""

from __future__ import annotations

from pathlib import Path

import pytest

import wholebody as wb
from wholebody.tracking.overlaps import overlaps
from wholebody.view.composition import Composition
from wholebody.view.scene_graph import SceneGraph

ARM = Path(__file__).resolve().parents[2] / "examples" / "tasks" / "arm.urdf"
BLUE = (0.1, 0.2, 0.9, 1.0)


def test_only_the_pieces_of_a_named_segment_have_its_colour() -> None:
    scene = wb.Scene(wb.load(ARM))
    composition = Composition(scene, SceneGraph(), -1.0, (), False)  # no contact has a colour of its own
    plain = composition.keyframe(scene.figure.neutral, None).colors
    composition.segment_colors = {"forearm": BLUE}
    colored = composition.keyframe(scene.figure.neutral, None).colors
    changed = {path for path in plain if plain[path] != colored[path]}
    assert changed
    assert changed == {path for path in plain if "forearm" in path}
    assert {colored[path] for path in changed} == {BLUE}


def test_a_colour_leaves_the_rest_of_the_picture_as_it_was_asked_for() -> None:
    scene = wb.Scene(wb.load("human"))
    scene.add(wb.Box((0.3, 0.3, 0.3)), name="box", at=(0.1, 0.0, 1.0))
    q = scene.figure.neutral
    found = overlaps(scene, q)
    assert found
    with wb.Viewer(scene) as viewer:
        viewer.show(q, pieces=True, overlaps=found)
        before = set(viewer._graph.store.nodes)
        viewer.color({"head": BLUE})
        assert set(viewer._graph.store.nodes) == before
        viewer.frames([])
        assert set(viewer._graph.store.nodes) == before


def test_an_assembly_without_a_figure_has_no_segments_to_colour() -> None:
    viewer = wb.Viewer(wb.Assembly().body("board", shape=wb.Box((0.8, 0.3, 0.02))))
    with pytest.raises(wb.InputError, match="no segments to color"):
        viewer.color({"board": BLUE})


def test_an_unknown_segment_or_colour_is_refused() -> None:
    viewer = wb.Viewer(wb.Scene(wb.load(ARM)))
    with pytest.raises(wb.errors.UnknownNameError, match="forearm"):
        viewer.color({"forarm": BLUE})
    with pytest.raises(wb.InputError, match="color"):
        viewer.color({"forearm": (2.0, 0.0, 0.0)})
