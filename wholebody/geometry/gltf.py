"""Reads and writes glTF 2 (.glb, .gltf), https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias, TypeVar
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wholebody.base.arrays import Array, Indices
from wholebody.base.errors import FileFormatError, WholebodyError, one_line
from wholebody.base.files import read_bytes

TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Codes of a file to types of numbers."""

SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}

MOST = 10_000_000  # rows of an array that has no part of the buffer: nothing but its own count bounds them

T = TypeVar("T")
Color: TypeAlias = tuple[float, float, float, float]


class GltfDocument:
    """A file: what its JSON says, `tree`, and of its nodes names and parents (k,), -1 for those on top.

    Nodes without a name, or with that of an earlier node, have a number. FileFormatError for what is no glTF 2, is cut
    off, or has nodes that are no trees.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._binary: bytes | None = None
        self._buffers: dict[int, bytes] = {}
        data = read_bytes(path, "glTF")
        self.tree: dict[str, Any] = self.decoded(lambda: self._tree(data))
        self.parents: Indices = self.decoded(self._parents)
        self.names = self.decoded(self._names)

    def decoded(self, read: Callable[[], T]) -> T:
        """What a function reads; what it raises of a file that is wrong becomes one sentence."""
        try:
            return read()
        except WholebodyError:
            raise
        except (ValueError, KeyError, IndexError, TypeError, AttributeError, OverflowError, RecursionError) as error:
            why = one_line(f"{type(error).__name__}: {error}", 100)
            raise FileFormatError(
                f"{self.path.name}: is no glTF 2, or it is cut off or damaged ({why}); export it again"
            ) from None

    def _tree(self, data: bytes) -> dict[str, Any]:
        if data[:4] == b"glTF":
            if int.from_bytes(data[4:8], "little") != 2:
                raise FileFormatError(f"{self.path.name}: is glTF {data[4]}, and 2 is read; export it as glTF 2")
            if int.from_bytes(data[8:12], "little") > len(data):
                raise FileFormatError(f"{self.path.name}: the file is cut off; get it whole")
            length = int.from_bytes(data[12:16], "little")
            rest, data = data[20 + length :], data[20 : 20 + length]
            self._binary = rest[8 : 8 + int.from_bytes(rest[:4], "little")] if rest[4:8] == b"BIN\0" else None
        tree: dict[str, Any] = json.loads(data)
        if not str(tree["asset"]["version"]).startswith("2"):
            raise FileFormatError(f"{self.path.name}: is glTF {tree['asset']['version']}; export it as glTF 2")
        for name in tree.get("extensionsRequired", ()):
            if "compression" in name or name == "KHR_draco_mesh_compression":
                raise FileFormatError(f"{self.path.name}: it is compressed ({name}); export it without compression")
        return tree

    def _parents(self) -> Indices:
        nodes = self.tree.get("nodes", [])
        parents = np.full(len(nodes), -1, dtype=np.intp)
        for node, fields in enumerate(nodes):
            for child in fields.get("children", ()):
                if not 0 <= child < len(nodes) or parents[child] >= 0 or child == node:
                    raise ValueError(f"node {child} has two parents or is none")
                parents[child] = node
        for node in range(len(nodes)):  # a ring has no top
            seen = 0
            while node >= 0:
                node, seen = int(parents[node]), seen + 1
                if seen > len(nodes):
                    raise ValueError("nodes are below themselves")
        return parents

    @cached_property
    def downwards(self) -> list[int]:
        """The nodes, parents before children."""
        order: list[int] = np.flatnonzero(self.parents < 0).tolist()
        for node in order:
            order += self.tree["nodes"][node].get("children", ())
        return order

    def _names(self) -> list[str]:
        found: list[str] = []
        for node, fields in enumerate(self.tree.get("nodes", [])):
            name = str(fields.get("name") or f"node {node}")
            found.append(f"{name} ({node})" if name in found else name)
        return found

    def accessor(self, index: int) -> NDArray[Any]:
        """An array (n, k); whole numbers that stand for parts of one are divided."""
        fields = self.tree["accessors"][index]
        size, kind = SIZES[fields["type"]], np.dtype(TYPES[fields["componentType"]])
        count = int(fields["count"])
        found: NDArray[Any]
        if "bufferView" in fields:
            found = self._view(fields["bufferView"], kind, size, count, fields.get("byteOffset", 0))
        elif 0 <= count <= MOST:
            found = np.zeros((count, size), kind)
        else:
            raise ValueError(f"{count} values are said to be zero; {MOST} are the most")
        if "sparse" in fields:
            sparse = fields["sparse"]
            at, new = sparse["indices"], sparse["values"]
            places = self._view(
                at["bufferView"], np.dtype(TYPES[at["componentType"]]), 1, sparse["count"], at.get("byteOffset", 0)
            )
            found = np.array(found)
            found[places[:, 0]] = self._view(new["bufferView"], kind, size, sparse["count"], new.get("byteOffset", 0))
        if fields.get("normalized") and kind.kind in "iu":
            return np.asarray(np.maximum(found / float(np.iinfo(kind).max), -1.0))
        return found

    def _view(self, index: int, kind: np.dtype[Any], size: int, count: int, offset: int) -> NDArray[Any]:
        view = self.tree["bufferViews"][index]
        stride = int(view.get("byteStride", kind.itemsize * size))
        begin = int(view.get("byteOffset", 0)) + int(offset)
        data = self._buffer(view["buffer"])
        if count < 1 or begin < 0 or begin + stride * (count - 1) + kind.itemsize * size > len(data):
            raise ValueError(f"part {index} of the buffer goes beyond its end")
        found: NDArray[Any] = np.ndarray((count, size), kind, data, begin, (stride, kind.itemsize))
        return found

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            uri = self.tree["buffers"][index].get("uri")
            if uri is None:
                if self._binary is None:
                    raise ValueError("there is no buffer in the file")
                self._buffers[index] = self._binary
            elif uri.startswith("data:"):
                self._buffers[index] = base64.b64decode(uri.partition(",")[2])
            else:
                self._buffers[index] = read_bytes(self.path.parent / unquote(uri).replace("\\", "/"), "buffer of glTF")
        return self._buffers[index]

    def parts(self, node: int) -> tuple[Array, Array, Array]:
        """Translation (3,), rotation (4,), x, y, z, w, and scale (3,) of a node; a matrix is taken apart."""
        fields = self.tree["nodes"][node]
        if "matrix" in fields:
            matrix = np.array(fields["matrix"], dtype=float).reshape(4, 4).T
            scale = np.linalg.norm(matrix[:3, :3], axis=0)
            if np.linalg.det(matrix[:3, :3]) < 0.0:
                scale[0] = -scale[0]
            return matrix[:3, 3], Rotation.from_matrix(matrix[:3, :3] / scale).as_quat(), scale
        standard = {"translation": (0.0,) * 3, "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0,) * 3}
        place, turn, scale = (np.array(fields.get(name, value), dtype=float) for name, value in standard.items())
        return place, turn, scale

    def worlds(self, moved: dict[int, tuple[Array, Array, Array]], frames: int = 1) -> Array:
        """(n, k, 4, 4) placements of all nodes in the world; of `moved` nodes the parts (n, 3), (n, 4), (n, 3)."""
        found = np.empty((frames, len(self.parents), 4, 4))
        for node in self.downwards:
            place, turn, scale = moved.get(node) or (part[None] for part in self.parts(node))
            local = np.zeros((len(place), 4, 4))
            local[:, :3, :3] = Rotation.from_quat(turn).as_matrix() * scale[:, None]
            local[:, :3, 3], local[:, 3, 3] = place, 1.0
            parent = self.parents[node]
            found[:, node] = local if parent < 0 else found[:, parent] @ local
        return found

    def meshes(self) -> list[tuple[Array, NDArray[np.int64], Color]]:
        """Triangles of all nodes in the world, bent by bones as these stand: vertices (n, 3), faces (m, 3), colour."""
        return self.decoded(self._meshes)

    def _meshes(self) -> list[tuple[Array, NDArray[np.int64], Color]]:
        worlds, found = self.worlds({})[0], []
        for node, fields in enumerate(self.tree.get("nodes", [])):
            for part in self.tree["meshes"][fields["mesh"]]["primitives"] if "mesh" in fields else ():
                if part.get("mode", 4) != 4:  # lines, points, strips
                    continue
                vertices = self.accessor(part["attributes"]["POSITION"]).astype(float)
                order = self.accessor(part["indices"])[:, 0] if "indices" in part else np.arange(len(vertices))
                corners = np.c_[vertices, np.ones(len(vertices))]
                if "skin" in fields and "JOINTS_0" in part["attributes"]:
                    placed = self._bent(fields["skin"], part["attributes"], corners, worlds)
                else:
                    placed = corners @ worlds[node, :3].T
                material = self.tree["materials"][part["material"]] if "material" in part else {}
                paint = material.get("pbrMetallicRoughness", {}).get("baseColorFactor", (1.0,) * 4)
                red, green, blue, alpha = (float(value) for value in paint)
                found.append((placed, order.astype(np.int64).reshape(-1, 3), (red, green, blue, alpha)))
        return found

    def _bent(self, skin: int, attributes: dict[str, int], corners: Array, worlds: Array) -> Array:
        """Vertices (n, 3) of corners (n, 4), moved by the joints of a skin (linear blend skinning)."""
        moved = worlds[self.tree["skins"][skin]["joints"]] @ self.inverse_binds(skin)
        found, total = np.zeros((len(corners), 3)), np.zeros((len(corners), 1))
        for number in range(sum(name.startswith("JOINTS_") for name in attributes)):
            bones = self.accessor(attributes[f"JOINTS_{number}"])
            weights = self.accessor(attributes[f"WEIGHTS_{number}"]).astype(float)
            for column in range(4):
                at = np.einsum("nij,nj->ni", moved[bones[:, column], :3], corners)
                found += weights[:, column, None] * at
            total += weights.sum(axis=1, keepdims=True)
        return np.asarray(found / np.where(total > 0.0, total, 1.0))

    def inverse_binds(self, skin: int) -> Array:
        """(j, 4, 4) from the mesh's axes into each joint's where the skin is bound."""
        fields = self.tree["skins"][skin]
        if "inverseBindMatrices" not in fields:
            return np.tile(np.eye(4), (len(fields["joints"]), 1, 1))
        return np.asarray(
            np.swapaxes(self.accessor(fields["inverseBindMatrices"]).astype(float).reshape(-1, 4, 4), 1, 2)
        )


KINDS = {"<f4": 5126, "u1": 5121, "<u2": 5123, "<u4": 5125}  # types of numbers to their codes in a file

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
