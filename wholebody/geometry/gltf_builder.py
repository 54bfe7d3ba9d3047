"""Writes glTF 2 as one binary file (.glb), https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wholebody.base.arrays import Array

KINDS = {"<f4": 5126, "u1": 5121, "<u2": 5123, "<u4": 5125}
"""Types of numbers to their codes in a file."""

SHAPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
VERTICES, INDICES = 34962, 34963  # what a part of the buffer is for

Node = int


class GltfBuilder:
    """A file while it is made. Everything added has an index by which others refer to it."""

    def __init__(self) -> None:
        self._tree: dict[str, Any] = {"asset": {"version": "2.0", "generator": "wholebody"}, "scene": 0}
        self._data = bytearray()
        self._roots: list[Node] = []
        self._materials: dict[tuple[Any, ...], int] = {}
        self._channels: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []

    def node(self, name: str, parent: Node | None = None, matrix: Array | None = None, **fields: Any) -> Node:
        """Add a node below another one, at a placement (4, 4)."""
        if matrix is not None and not np.array_equal(matrix, np.eye(4)):
            fields["matrix"] = matrix.T.ravel().tolist()
        index = self._added("nodes", {"name": name, **fields})
        if parent is None:
            self._roots.append(index)
        else:
            self._tree["nodes"][parent].setdefault("children", []).append(index)
        return index

    def moving_node(self, name: str, parent: Node | None, keys: tuple[Array, Array], times: int | None) -> Node:
        """Add a node with rotations (n, 4), x, y, z, w, and translations (n, 3); animated if there are `times`."""
        turns, places = keys
        index = self.node(name, parent, rotation=turns[0].tolist(), translation=places[0].tolist())
        for path, values in (("rotation", turns), ("translation", places)):
            # the first one always: the number of frames of a motion that rests is kept
            if times is not None and (not self._channels or np.ptp(values, axis=0).max() > 1e-9):  # metres, quaternion
                output = self.accessor(values, "<f4")
                self._samplers.append({"input": times, "output": output, "interpolation": "LINEAR"})
                target = {"node": index, "path": path}
                self._channels.append({"sampler": len(self._samplers) - 1, "target": target})
        return index

    def accessor(self, values: Any, kind: str, target: int | None = None, *, bounded: bool = False) -> int:
        """Add an array (n,) or (n, k); `bounded` says its least and greatest values too."""
        data = np.ascontiguousarray(values, dtype=kind)
        flat = data.reshape(len(data), -1)
        self._data.extend(bytes(-len(self._data) % 4))
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": data.nbytes}
        self._data.extend(data.tobytes())
        index = self._added("bufferViews", view if target is None else {**view, "target": target})
        found = {
            "bufferView": index, "componentType": KINDS[kind], "count": len(data), "type": SHAPES[flat.shape[1]],
        }  # fmt: skip
        if bounded:
            found |= {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()}
        return self._added("accessors", found)

    def material(self, color: Sequence[float], *, both_sides: bool = False) -> int:
        """A material of a colour, red, green, blue, alpha from 0 to 1; the same one for the same colour."""
        key = (*(round(float(part), 4) for part in color), both_sides)
        if key not in self._materials:
            paint = {"baseColorFactor": list(key[:4]), "roughnessFactor": 0.8, "metallicFactor": 0.0}
            fields = {"pbrMetallicRoughness": paint} | ({"doubleSided": True} if both_sides else {})
            self._materials[key] = self._added("materials", fields | ({"alphaMode": "BLEND"} if key[3] < 1.0 else {}))
        return self._materials[key]

    def primitive(
        self, vertices: Array, faces: NDArray[Any], material: int, normals: Array | None = None, **more: int
    ) -> dict[str, Any]:
        """Triangles (m, 3) of vertices (n, 3), of one material; `more` attributes are accessors."""
        attributes = {"POSITION": self.accessor(vertices, "<f4", VERTICES, bounded=True)} | more
        if normals is not None:
            attributes["NORMAL"] = self.accessor(normals, "<f4", VERTICES)
        indices = self.accessor(faces.reshape(-1), "<u2" if len(vertices) < 65535 else "<u4", INDICES)
        return {"attributes": attributes, "indices": indices, "material": material}

    def mesh(self, name: str, primitives: Sequence[dict[str, Any]]) -> int:
        """Add a mesh of primitives."""
        return self._added("meshes", {"name": name, "primitives": list(primitives)})

    def skin(self, name: str, joints: Sequence[Node], inverse_binds: Array) -> int:
        """Add a skin: nodes, and (j, 4, 4) from the mesh's axes into each node's in the binding posture."""
        matrices = self.accessor(np.swapaxes(inverse_binds, 1, 2).reshape(-1, 16), "<f4")
        return self._added("skins", {"name": name, "joints": list(joints), "inverseBindMatrices": matrices})

    def glb(self, title: str) -> bytes:
        """The bytes of the file; `title` names the animation."""
        self._tree["scenes"] = [{"nodes": self._roots}]
        if self._channels:
            self._tree["animations"] = [{"name": title, "samplers": self._samplers, "channels": self._channels}]
        if self._data:
            self._data.extend(bytes(-len(self._data) % 4))
            self._tree["buffers"] = [{"byteLength": len(self._data)}]
        text = json.dumps(self._tree, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = [(b"JSON", text)] + ([(b"BIN\0", bytes(self._data))] if self._data else [])
        body = b"".join(len(data).to_bytes(4, "little") + kind + data for kind, data in chunks)
        return b"glTF" + (2).to_bytes(4, "little") + (12 + len(body)).to_bytes(4, "little") + body

    def _added(self, kind: str, what: dict[str, Any]) -> int:
        self._tree.setdefault(kind, []).append(what)
        return len(self._tree[kind]) - 1
