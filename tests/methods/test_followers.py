"""Joints that follow another joint move: what is proven about pairs, reach and contradictions counts with it."""

from __future__ import annotations

from pathlib import Path

import pytest

import wholebody as wb


def _link(name: str, shape: str) -> str:
    inertia = '<mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    geometry = f"<collision><geometry>{shape}</geometry></collision>"
    return f'<link name="{name}"><inertial>{inertia}</inertial>{geometry}</link>'


def _finger(name: str, y: float, axis: str, follows: str = "") -> str:
    return f"""<joint name="{name}_slide" type="prismatic"><parent link="palm"/><child link="{name}"/>
<origin xyz="0 {y} 0.2"/><axis xyz="{axis}"/><limit lower="0" upper="0.2" effort="9" velocity="9"/>{follows}</joint>"""


@pytest.fixture
def gripper(tmp_path: Path) -> wb.Figure:
    """A palm that turns, and two fingers, of which the right one slides outwards as the left one does."""
    ball = '<sphere radius="0.02"/>'
    parts = [_link("base", '<box size="0.1 0.1 0.02"/>'), _link("palm", '<box size="0.1 0.3 0.02"/>')]
    parts += [_link("left", ball), _link("right", ball)]
    parts += [
        """<joint name="turn" type="revolute"><parent link="base"/><child link="palm"/><origin xyz="0 0 0.1"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="9" velocity="9"/></joint>"""
    ]
    parts += [_finger("left", 0.03, "0 1 0"), _finger("right", -0.03, "0 -1 0", '<mimic joint="left_slide"/>')]
    path = tmp_path / "gripper.urdf"
    path.write_text(f'<robot name="gripper">{"".join(parts)}</robot>')
    figure = wb.load(path)
    assert list(figure.followers) == ["right_slide"]
    return figure


def test_a_thing_in_a_follower_does_not_contradict_what_is_frozen(gripper: wb.Figure) -> None:
    scene = wb.Scene(gripper).add(wb.Sphere(0.03), name="ball", at=(0.0, -0.03, 0.3))
    solution = wb.solve(wb.Problem(scene, gripper.posture("neutral"), constraints=[wb.Freeze("turn")]))
    assert solution.solved
    # Spheres of 20 and 30 mm about centres that are on one line: the finger has moved out by their sum.
    assert gripper.joint_values(solution.q)["left_slide"] == pytest.approx(0.05, abs=1e-4)


@pytest.mark.parametrize("frozen", [False, True])
def test_simplify_keeps_pairs_of_a_follower(gripper: wb.Figure, frozen: bool) -> None:
    scene = wb.Scene(gripper).add(wb.Sphere(0.03), name="ball", at=(0.0, -0.13, 0.3))
    constraints = [wb.Freeze("turn")] if frozen else []
    small = wb.simplify(wb.Problem(scene, gripper.posture("neutral"), constraints=constraints)).problem.scene
    owners = {frozenset(small.piece_owner[k] for k in pair) for pair in small.pair_table.pairs.tolist()}
    assert frozenset(("right", "ball")) in owners


def test_a_follower_reaches_where_it_slides(gripper: wb.Figure) -> None:
    problem = wb.Problem(wb.Scene(gripper), constraints=[wb.Freeze("turn")])
    found = wb.reach_map(problem, "right", (0.0, -0.26, 0.3), (0.0, -0.06, 0.3), (1.0, 0.1, 1.0))
    assert found.reached.ravel().tolist() == [False, True, True]  # 0.03 to 0.23 m from the middle
