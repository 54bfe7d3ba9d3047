"""Colours of segments."""

from __future__ import annotations

from pathlib import Path

import pytest

import wholebody as wb
from wholebody.view.composition import Composition
from wholebody.view.scene_graph import SceneGraph

ARM = Path(__file__).resolve().parents[2] / "examples" / "tasks" / "arm.urdf"
BLUE = (0.1, 0.2, 0.9, 1.0)


def test_only_the_pieces_of_a_named_segment_have_its_colour() -> None:
    scene = wb.Scene(wb.load(ARM))
    composition = Composition(scene, SceneGraph(), -1.0, (), False)  # no contact has a colour of its own
    plain = composition.keyframe(scene.figure.neutral, None).colors
    composition.dyed = {"forearm": BLUE}
    dyed = composition.keyframe(scene.figure.neutral, None).colors
    changed = {path for path in plain if plain[path] != dyed[path]}
    assert changed
    assert changed == {path for path in plain if "forearm" in path}
    assert {dyed[path] for path in changed} == {BLUE}


def test_an_unknown_segment_or_colour_is_refused() -> None:
    viewer = wb.Viewer(wb.Scene(wb.load(ARM)))
    with pytest.raises(wb.UnknownNameError, match="forearm"):
        viewer.color({"forarm": BLUE})
    with pytest.raises(wb.InputError, match="color"):
        viewer.color({"forearm": (2.0, 0.0, 0.0)})
