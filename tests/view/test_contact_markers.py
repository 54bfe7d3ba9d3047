"""PD_g of whole objects, drawn."""

from __future__ import annotations

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.errors import InputError
from wholebody.dynamics.overlaps import overlaps
from wholebody.view import Viewer
from wholebody.view.contact_markers import mark_overlaps
from wholebody.view.legend import legend
from wholebody.view.scene_graph import Keyframe


def test_each_of_two_that_may_move_gets_its_half_of_the_depth(planar_arm) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3)))
    scene.add(wb.Box((0.5, 0.2, 0.2)), name="wall", at=(0.5, 0.1, 0.0))
    scene.add(wb.Sphere(0.1), name="ball", at=(1.05, 0.11, 0.0), body=wb.Body())
    q = np.zeros(3)
    found = overlaps(scene, q)
    keyframe = Keyframe()
    mark_overlaps(keyframe, found)
    arrows = {path: matrix for path, (marker, matrix) in keyframe.markers.items() if marker.kind == "arrow"}
    assert len(arrows) == 3  # the arm out of the wall; the arm and the ball out of each other
    ball = next(number for number, one in enumerate(found) if one.second == "ball")
    ways = [arrows[f"/contacts/overlap {ball}/{name}"][:3, 2] for name in ("first", "second")]
    assert ways[0] / np.linalg.norm(ways[0]) == pytest.approx(-ways[1] / np.linalg.norm(ways[1]))
    assert arrows[f"/contacts/overlap {ball}/first"][:3, 3] == pytest.approx(found[ball].point)
    assert any("mm" in marker.text for marker, _ in keyframe.markers.values() if marker.kind == "label")
    only_second = Keyframe()
    mark_overlaps(only_second, [one._replace(moves_first=np.zeros(3)) for one in found if one.second == "ball"])
    assert [meaning for meaning, _ in legend([only_second])] == ["way out of an overlap"]
    with Viewer(scene) as viewer:
        viewer.show(q, overlaps=found)
        viewer.play([q, q], overlaps=[found, ()])
        with pytest.raises(InputError, match="overlaps has 1 entries and the motion 2 postures"):
            viewer.play([q, q], overlaps=[found])
        with pytest.raises(InputError, match="overlaps"):
            viewer.show(q, overlaps=3)  # type: ignore[arg-type]
