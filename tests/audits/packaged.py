"""The files of the folder `urdf`, made anew from the builders: `python -m tests.audits.packaged` writes them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from wholebody.base.files import write
from wholebody.figures import body_spec
from wholebody.figures.body_spec import urdf_text
from wholebody.figures.hand import MESH, hand_figure, hand_spec
from wholebody.figures.human.figure import avatar_figure, avatar_spec, human_figure
from wholebody.figures.human.spec import human_spec
from wholebody.figures.packaged_urdf import urdf_folder
from wholebody.figures.urdf.extension import extension_text


def packaged_files() -> dict[str, str]:
    """Return the text of every packaged file below ``urdf/``: the median man, his avatar and his right hand."""
    return {
        "human.urdf": urdf_text(human_spec(), extension_text(human_figure())),
        "avatar.urdf": urdf_text(avatar_spec(), extension_text(avatar_figure())),
        "hand.urdf": urdf_text(hand_spec(), extension_text(hand_figure())),
        MESH: ellipsoid_obj(),
    }


def ellipsoid_obj() -> str:
    """Return the unit polyhedron of the hand's parts as an OBJ; of STL files MuJoCo reads binary ones only."""
    vertices = body_spec.unit_sphere()
    triangles = ConvexHull(vertices).simplices
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0.0
    triangles[inward] = triangles[inward][:, [0, 2, 1]]
    lines = [f"v {' '.join(f'{value + 0.0:.12g}' for value in vertex)}" for vertex in vertices.round(15)]
    lines += [f"f {' '.join(str(k + 1) for k in triangle)}" for triangle in triangles.tolist()]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    for name, text in packaged_files().items():
        write(urdf_folder() / name, text)
