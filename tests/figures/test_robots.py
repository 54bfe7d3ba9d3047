"""Real robots: the wheel example-robot-data, where WHOLEBODY_ROBOTS names its unpacked folder."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody.figures.self_pairs import random_postures

NAMES = (
    "ur_description/urdf/ur5_robot.urdf",  # STL
    "kinova_description/robots/kinova.urdf",  # COLLADA, continuous joints
    "allegro_hand_description/urdf/allegro_left_hand.urdf",
    "panda_description/urdf/panda_collision.urdf",  # mimic
    "pr2_description/urdf/pr2.urdf",  # ten mimic joints
    "alex_description/urdf/alex_nub_hands.urdf",  # a part 98 micrometres thick
    "centauro_description/urdf/centauro.urdf",  # a hull with more neighbours than coal counts
    "talos_data/robots/talos_full_v2.urdf",  # followers before the joint they follow
    "icub_description/robots/icub.urdf",  # overlaps itself at zero in twenty pairs
)


@pytest.fixture(scope="module")
def robots() -> Path:
    named = os.environ.get("WHOLEBODY_ROBOTS")
    if not named:
        pytest.skip("no robot descriptions here; WHOLEBODY_ROBOTS names their folder")
    folders = [Path(named), *Path(named).glob("**/example-robot-data/robots")]
    return next(folder for folder in folders if (folder / NAMES[0]).is_file())


@pytest.mark.parametrize("name", NAMES)
def test_a_robot_loads_begins_free_and_its_pieces_hold_its_meshes(robots: Path, name: str) -> None:
    figure = wb.load(robots / name)
    data, results = figure.model.createData(), pin.GeometryData(figure.geometry)
    pin.updateGeometryPlacements(figure.model, data, figure.geometry, results, figure.neutral)
    pin.computeDistances(figure.geometry, results)
    assert min(result.min_distance for result in results.distanceResults) > 0.0
    assert figure.within_limits(figure.neutral)

    # Pinocchio's own meshes, at a random posture of its own model: every vertex is in a piece of the link
    path, folders = str(robots / name), [str(robots.parents[1])]
    model = pin.buildModelFromUrdf(path)
    meshes = pin.buildGeomFromUrdf(model, path, pin.COLLISION, package_dirs=folders)
    q = random_postures(figure.model, 1, 3)[0]
    full = pin.neutral(model)
    for joint, value in figure.joint_values(q).items():
        made = model.joints[model.getJointId(joint)]
        full[made.idx_q : made.idx_q + made.nq] = [value] if made.nq == 1 else [np.cos(value), np.sin(value)]
    theirs, their_data = model.createData(), pin.GeometryData(meshes)
    pin.updateGeometryPlacements(model, theirs, meshes, their_data, full)
    pin.updateGeometryPlacements(figure.model, data, figure.geometry, results, q)
    planes: dict[str, list[tuple[np.ndarray, pin.SE3]]] = {}
    for piece, at in zip(figure.geometry.geometryObjects, results.oMg, strict=True):
        if type(piece.geometry).__name__ == "Convex":
            link = figure.model.frames[piece.parentFrame].name
            planes.setdefault(link, []).append((_planes(piece.geometry), at))
    looked_at = 0
    for mesh, at in zip(meshes.geometryObjects, their_data.oMg, strict=True):
        link = model.frames[mesh.parentFrame].name
        if hasattr(mesh.geometry, "vertices") and len(mesh.geometry.vertices()):
            world = np.array(mesh.geometry.vertices()) @ at.rotation.T + at.translation
            out = min(
                float((((world - place.translation) @ place.rotation) @ faces[:, :3].T - faces[:, 3]).max())
                for faces, place in planes[link]
            )
            assert out < 1e-5, (link, out)  # meshes are read in single precision by Pinocchio
            looked_at += 1
    assert looked_at or "allegro" in name or "collision" in name


def _planes(hull: object) -> np.ndarray:
    from scipy.spatial import ConvexHull

    equations = ConvexHull(np.array(hull.points())).equations  # type: ignore[attr-defined]
    return np.column_stack([equations[:, :3], -equations[:, 3]])


def test_tips_reach_where_free_postures_have_them(robots: Path) -> None:
    from tests.audits.robots import tip_targets

    for name in (NAMES[0], NAMES[2]):
        figure = wb.load(robots / name)
        scene = wb.Scene(figure)
        for tip, target in tip_targets(figure, scene, 4):
            assert wb.solve(wb.Problem(scene, goals=[wb.Point(tip, target)])).solved
