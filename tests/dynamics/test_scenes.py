"""The scenes of `wholebody world`: what is to happen in them happens."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from wholebody.base.errors import InputError, UnknownNameError
from wholebody.dynamics.world import WORLD_SCENES, World, WorldFrame, build_world_scene

SHARES = {"bag": 0.35, "flick": 0.8, "push_box": 0.4, "stairs": 0.15}
"""Of the frames of a scene, those in which what is to happen happens."""


@cache
def played(name: str, share: float) -> tuple[float, list[WorldFrame]]:
    """Energy of a scene at its start, joules, and its frames, or the first of them."""
    scene = build_world_scene(name)
    scene = build_world_scene(name, frames=int(share * len(scene.track.q)))
    world = World(scene.scene, scene.track.q[0], dt=scene.track.dt)
    assert world.engine is not None
    return world.engine.energy(), [world.step(q) for q in scene.track.q]


def test_the_finger_flicks_the_ball_off_the_table() -> None:
    _, frames = played("flick", SHARES["flick"])
    first, last = frames[0].placements["ball"].translation, frames[-1].placements["ball"].translation
    assert first == pytest.approx([0.3, 0.0, 0.77], abs=1e-3)
    assert last[0] > 0.8  # beyond the edge at 0.4
    assert last[2] == pytest.approx(0.02, abs=1e-3)  # on the floor
    given = np.sum([frame.impulses["ball"] for frame in frames if "ball" in frame.impulses], axis=0)
    assert given[0] > 0.0
    falling = [frame.placements["ball"].translation for frame in frames]
    falling = [place for place in falling if 0.1 < place[2] < 0.7]
    # on its way down the ball's centre falls with g: second differences of its height
    drops = np.diff([place[2] for place in falling], n=2)
    assert drops == pytest.approx(-9.81 / 60**2, rel=1e-6)
    assert max(frame.deepest for frame in frames) <= 1e-4


def test_the_hand_in_the_gallery_fells_dominoes_and_nothing_is_in_anything() -> None:
    _, frames = played("gallery", 0.28)
    assert {"egg", "obelisk", "large ball", "carton"} <= build_world_scene("gallery", frames=1).scene.objects.keys()
    for number in range(1, 11):
        assert frames[-1].placements[f"domino {number}"].rotation[2, 2] < 0.7
    assert max(frame.deepest for frame in frames) <= 1e-4


@pytest.mark.parametrize("name", SHARES)
def test_energy_grows_by_no_more_than_the_figure_gives(name: str) -> None:
    energy, frames = played(name, SHARES[name])
    worked = 0.0
    for frame in frames:
        made = frame.engine
        assert made is not None
        # joints are closed to a nanometre, and the bag weighs 150 N
        assert made.energy <= energy + made.work + {"bag": 1e-7}.get(name, 1e-10)
        energy, worked = made.energy, worked + made.work
    assert worked > 0.0 or name == "stairs"


def test_scenes_are_named_and_unknown_ones_are_not_built() -> None:
    assert {"flick", "dominoes", "stairs"} <= set(WORLD_SCENES)
    with pytest.raises(UnknownNameError, match="flick"):
        build_world_scene("flik")
    with pytest.raises(InputError):
        build_world_scene("flick", frames=0)
