"""PD_g of whole objects, drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.errors import InputError
from wholebody.tracking.overlaps import overlaps
from wholebody.view import Viewer
from wholebody.view.composition import Composition, legend
from wholebody.view.scene_graph import SceneGraph
from wholebody.view.style import LOOK


def test_each_of_two_that_may_move_gets_its_half_of_the_depth(planar_arm: Any) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.4, 0.3)))
    scene.add(wb.Box((0.5, 0.2, 0.2)), name="wall", at=(0.5, 0.1, 0.0))
    scene.add(wb.Sphere(0.1), name="ball", at=(1.05, 0.11, 0.0), body=wb.Body())
    q, viewed = np.zeros(3), Composition(scene, SceneGraph(), -1.0, (), False)
    found = overlaps(scene, q, "both")
    keyframe = viewed.keyframe(q, None, overlaps=found)
    arrows = {path: matrix for path, (marker, matrix) in keyframe.markers.items() if marker.kind == "arrow"}
    assert len(arrows) == 3  # the arm out of the wall; the arm and the ball out of each other
    ball = next(number for number, one in enumerate(found) if one.second == "ball")
    first, second = (arrows[f"/contacts/overlap {ball}/{name}"] for name in ("first", "second"))
    ways = [one[:3, 2] / np.linalg.norm(one[:3, 2]) for one in (first, second)]
    assert ways[0] == pytest.approx(-ways[1])
    # the arrow of the ball begins outside of it, and dashes lead there from the overlap
    assert np.linalg.norm(second[:3, 3] - scene.objects["ball"].placement.translation) > 0.1 - 1e-9
    marker, dashes = keyframe.markers[f"/contacts/overlap {ball}/second inside"]
    assert marker.kind == "dashes"
    assert dashes[:3, 3] == pytest.approx(found[ball].point)
    assert dashes[:3, 3] + dashes[:3, 2] == pytest.approx(second[:3, 3])
    labels = [marker.text for marker, _ in keyframe.markers.values() if marker.kind == "label"]
    assert any("mm half each" in text for text in labels)
    assert any(f"mm by {scene.figure.name}" in text for text in labels)
    only_second = [one._replace(moves_first=np.zeros(3)) for one in found if one.second == "ball"]
    assert [meaning for meaning, _ in legend([viewed.keyframe(q, None, overlaps=only_second)])] == [
        "global penetration depth PD_g"
    ]
    with Viewer(scene) as viewer:
        viewer.show(q, overlaps=found)
        viewer.play([q, q], overlaps=[found, ()])
        with pytest.raises(InputError, match="overlaps has 1 entries and the motion 2 postures"):
            viewer.play([q, q], overlaps=[found])
        with pytest.raises(InputError, match="overlaps"):
            viewer.show(q, overlaps=3)  # type: ignore[arg-type]


def test_a_depth_that_cancels_is_a_ball_and_says_how_deep_it_is(planar_arm: Any) -> None:
    scene = wb.Scene(planar_arm((0.5, 0.4)))  # two links from opposite sides, as in figure 4b of Schmidl and Lin
    for name, x in (("near", 0.25), ("far", 0.7)):
        scene.add(wb.Box((0.1, 0.03, 0.2)), name=name, at=(x, 0.03 if name == "near" else -0.03, 0.0))
    q, viewed = np.zeros(2), Composition(scene, SceneGraph(), -1.0, (), False)
    near, far = sorted(overlaps(scene, q), key=lambda one: one.second)[::-1]
    assert near.deepest == far.deepest == pytest.approx(0.005)
    both = near._replace(depth=near.depth + far.depth, moves_first=near.depth + far.depth, pairs=2)
    markers = viewed.keyframe(q, None, overlaps=[both]).markers
    assert {marker.kind for marker, _ in markers.values()} == {"ball", "label"}
    assert any("cancels; 5.0 mm deep" in marker.text for marker, _ in markers.values())


def test_an_arrow_begins_outside_of_both_that_overlap(planar_arm: Any) -> None:
    """A link inside of a board, half a metre from its ends: the arrow out of it can be seen."""
    scene = wb.Scene(planar_arm((0.5, 0.4))).add(wb.Box((1.0, 0.3, 0.3)), name="board", at=(0.4, 0.02, 0.0))
    found = overlaps(scene, np.zeros(2))
    markers = Composition(scene, SceneGraph(), -1.0, (), False).keyframe(np.zeros(2), None, overlaps=found).markers
    arrow = next(place for marker, place in markers.values() if marker.kind == "arrow")
    assert abs(arrow[1, 3] - 0.02) > 0.15 - 1e-9
    assert np.abs(arrow[:3, 3] - (0.4, 0.02, 0.0)).max() < 0.5  # at the board, not at the end of its diagonal
    lifted = [one._replace(depth=up, moves_first=up) for one in found for up in [np.array((0.0, 0.0, 0.02))]]
    markers = Composition(scene, SceneGraph(), -1.0, (), False).keyframe(np.zeros(2), None, overlaps=lifted).markers
    arrow = next(place for marker, place in markers.values() if marker.kind == "arrow")
    words = next(place for marker, place in markers.values() if marker.kind == "label")
    assert words[:3, 3] == pytest.approx(arrow[:3, 3] + arrow[:3, 2])  # at its end, where they hide nothing


def test_what_touches_may_be_a_thing_that_is_carried(planar_arm: Any) -> None:
    """A brush on an arm and a ceiling over it: as a goal, and as a constraint that is in the way of another goal."""
    scene = wb.Scene(planar_arm((0.5, 0.4))).add(wb.Box((4.0, 0.1, 1.0)), name="ceiling", at=(0.0, 0.7, 0.0))
    scene.attach(wb.Sphere(0.05), to="tip", name="brush", at=(0.1, 0.0, 0.0))
    touch = wb.Touch("brush", "ceiling")
    reach = wb.Problem(scene, np.full(2, 0.3), goals=[touch])
    q = wb.solve(reach).q
    kept = wb.Problem(scene, q, goals=[wb.Posture(np.zeros(2))], constraints=[touch])
    found = [one for one in wb.assess(kept, q).blockers if one.kind == "constraint"]
    assert len(found) == 1
    viewed = Composition(scene, SceneGraph(), -1.0, (), False)
    viewed.keyframe(q, reach)
    ball = viewed.keyframe(q, kept, found).markers[f"{LOOK.blocker_node}/0/ball"][1]
    assert ball[1, 3] == pytest.approx(0.65 - 0.05, abs=1e-5)  # the middle of the brush, under the ceiling
