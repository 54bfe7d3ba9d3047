"""An MJCF file as MuJoCo compiles it, and which of its bodies are robots, which are things.

MuJoCo is the reference of its format, so it reads includes, defaults, classes, angles, references, several world bodies
and frames itself: the compiled model holds bodies in the order of the tree, joints with limits in radians, geoms in the
frames of their bodies.
"""

from __future__ import annotations

import codecs
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.base.checks import shown
from wholebody.base.errors import FileFormatError, InputError, MissingPackageError
from wholebody.base.files import is_file, read_bytes
from wholebody.geometry.meshes import check_content

FREE, BALL, SLIDE, HINGE = range(4)
"""Types of joints, as MuJoCo numbers them."""


def is_mjcf(path: Path) -> bool:
    """Whether the first element of a file is <mujoco>. MuJoCo also reads files that are not quite XML."""
    data = read_bytes(path, "URDF or MJCF", 64 * 2**20)
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    text = data.decode("utf-16" if wide else "utf-8-sig", "replace")
    declared = r"<!DOCTYPE[^>\[]*(?:\[.*?\]\s*)?>"
    first = re.match(rf"(?:\s|<\?.*?\?>|<!--.*?-->|{declared})*<([\w:.-]+)", text, re.DOTALL)
    return first is not None and first[1] == "mujoco"


class Compiled:
    """A compiled MJCF file.

    Attributes:
        path: of the file.
        model: `mujoco.MjModel`.
        notes: sentences on what could not be read.
        names: "body", "joint", "geom", "site", "key" -> the name of each, made from its body and number where the file
            has none.
    """

    def __init__(self, path: Path) -> None:
        """Compile a file; a `FileFormatError` has what MuJoCo says, a `MissingPackageError` that it is not there."""
        self.path = path
        self.model, self.notes = _compile(path)
        self.names = _names(self.model)

    @property
    def name(self) -> str:
        """Of the model, or of the file where it has none."""
        names: bytes = self.model.names
        return names[: names.index(b"\0")].decode() or self.path.stem

    @cached_property
    def children(self) -> list[list[int]]:
        """Bodies that hang on each body."""
        found: list[list[int]] = [[] for _ in range(self.model.nbody)]
        for body in range(1, self.model.nbody):
            found[self.model.body_parentid[body]].append(body)
        return found

    def tree(self, top: int) -> list[int]:
        """A body and all that hang on it, parents first."""
        found = [top]
        for body in found:
            found += self.children[body]
        return sorted(found)

    def joints(self, body: int) -> range:
        """Joints between a body and its parent, from the parent outwards."""
        return _run(self.model.body_jntadr[body], self.model.body_jntnum[body])

    def geoms(self, body: int) -> range:
        """Geoms of a body."""
        return _run(self.model.body_geomadr[body], self.model.body_geomnum[body])

    def place(self, body: int) -> pin.SE3:
        """Placement of a body in its parent, before its joints."""
        return placement(self.model.body_pos[body], self.model.body_quat[body])

    def places(self, top: int, at: pin.SE3) -> dict[int, pin.SE3]:
        """Placements of a body, which is at `at`, and of all that hang on it and do not move."""
        found = {top: at}
        for body in self.tree(top)[1:]:
            found[body] = found[int(self.model.body_parentid[body])] * self.place(body)
        return found

    def is_free(self, body: int) -> bool:
        """Whether a body has a free joint."""
        return any(self.model.jnt_type[joint] == FREE for joint in self.joints(body))

    @cached_property
    def robots(self) -> tuple[int, ...]:
        """Bodies on the world with joints below them; otherwise bodies with a free joint; otherwise all."""
        # Bodies without a shape are left out if others have one: families of robots park unused joints there.
        tops = self.children[0]
        kinds = {top: [self.model.jnt_type[k] for body in self.tree(top) for k in self.joints(body)] for top in tops}
        inner = [top for top in tops if any(kind != FREE for kind in kinds[top])]
        inner = list(filter(self.has_shape, inner)) or inner
        return tuple(inner or [top for top in tops if self.is_free(top)] or tops)

    def has_shape(self, top: int) -> bool:
        """Whether a body or one that hangs on it has a geom."""
        return any(len(self.geoms(body)) for body in self.tree(top))

    def robot(self, name: str | None) -> int:
        """The body of a robot on the world, by its name, or None where the file has one robot."""
        known = {self.names["body"][top]: top for top in self.robots}
        if not known:
            raise FileFormatError(f"{self.path}: there are no bodies in it; give an MJCF of a robot")
        if name is not None:
            if name not in known:
                wanted = f"'fixed' or 'free', or the name of a robot in it: {', '.join(known)}"
                raise InputError(f"{self.path}: root is {shown(name)}; give {wanted}")
            return known[name]
        if len(known) > 1:
            raise InputError(
                f"{self.path}: there are {len(known)} robots in it; choose one with root=: {', '.join(known)}"
            )
        return next(iter(known.values()))

    def mesh(self, geom: int) -> tuple[Array, Any]:
        """Vertices (n, 3) and faces (m, 3) of a geom's mesh, in the geom's frame."""
        model, mesh = self.model, int(self.model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        face, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        return (
            np.array(model.mesh_vert[first : first + count], dtype=float),
            np.array(model.mesh_face[face : face + faces], dtype=np.int64),
        )

    def collides(self, geom: int) -> bool:
        """Whether a geom can touch another one: its contact bits are not all zero, or the file names a pair with it."""
        bits = self.model.geom_contype[geom] or self.model.geom_conaffinity[geom]
        return bool(bits) or any(geom in pair for pair in self.pairs)

    @cached_property
    def pairs(self) -> frozenset[frozenset[int]]:
        """Pairs of geoms that the file names (<pair>); they can touch whatever their contact bits are."""
        ends = zip(self.model.pair_geom1.tolist(), self.model.pair_geom2.tolist(), strict=True)
        return frozenset(frozenset(pair) for pair in ends)

    @cached_property
    def excluded(self) -> frozenset[frozenset[int]]:
        """Pairs of bodies that the file excludes (<exclude>)."""
        return frozenset(frozenset((value >> 16, value & 0xFFFF)) for value in map(int, self.model.exclude_signature))

    def meet(self, first: int, second: int) -> bool:
        """Whether the contact bits of two geoms let them touch."""
        types, affinities = self.model.geom_contype, self.model.geom_conaffinity
        return bool((types[first] & affinities[second]) | (types[second] & affinities[first]))

    def color(self, geom: int) -> tuple[float, float, float, float] | None:
        """A geom's own colour, else that of its material times the mean of its texture; None without both."""
        model, material = self.model, int(self.model.geom_matid[geom])
        color = model.geom_rgba[geom].astype(float)
        if np.allclose(color, (0.5, 0.5, 0.5, 1.0)):  # MuJoCo's own, where the file has none
            if material < 0:
                return None
            color = model.mat_rgba[material].astype(float)
            texture = int(model.mat_texid[material][1])  # the colour, as MuJoCo numbers what a texture is for
            if texture >= 0:
                first, channels = int(model.tex_adr[texture]), int(model.tex_nchannel[texture])
                count = int(model.tex_height[texture]) * int(model.tex_width[texture]) * channels
                mean = model.tex_data[first : first + count].reshape(-1, channels).mean(axis=0) / 255.0
                color[:3] *= mean[:3] if channels >= 3 else mean[0]
        red, green, blue, alpha = (float(value) for value in color)
        return red, green, blue, alpha


def _run(first: Any, count: Any) -> range:
    """Numbers of what belongs to a body; MuJoCo's first one is -1 where there is nothing."""
    return range(int(first), int(first) + int(count)) if first >= 0 else range(0)


def placement(position: Array, quaternion: Array) -> pin.SE3:
    """A placement from MuJoCo's position and quaternion, scalar first."""
    w, x, y, z = (float(value) for value in quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().matrix(), np.array(position, dtype=float))


def _compile(path: Path) -> tuple[Any, tuple[str, ...]]:
    """MuJoCo's model of a file, and sentences on what could not be read of it."""
    try:
        import mujoco
    except ImportError:
        raise MissingPackageError(
            f"{path}: MJCF files are read by MuJoCo, which is not installed; run: pip install 'wholebody[mjcf]'"
        ) from None

    def read(*, textures: bool) -> Any:
        spec = mujoco.MjSpec.from_file(str(path))
        if not textures:
            _without_textures(spec)
        return spec.compile()

    wrong = (ValueError, mujoco.FatalError)
    with _unlogged(mujoco):
        try:
            return read(textures=True), ()
        except wrong as error:
            reason = _said(error)
        try:
            return read(textures=False), (f"textures are left out: {reason}",)
        except wrong as error:
            for named in [*map(Path, re.findall("'([^']+)'", str(error))), *_meshes(mujoco, path)]:
                if is_file(named) and named != path:
                    check_content(named)
            raise FileFormatError(f"{path}: MuJoCo cannot read it ({_said(error)}); correct the file") from None


@contextmanager
def _unlogged(mujoco: Any) -> Iterator[None]:
    """Without MuJoCo's warnings, which tell of simulations: as Python's, and in a MUJOCO_LOG.TXT in this folder."""
    handler = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        mujoco.set_mju_user_warning(handler)


def _said(error: Exception) -> str:
    return " ".join(str(error).split()).removeprefix("Error: ").removeprefix("XML Error: ")


def _meshes(mujoco: Any, path: Path) -> list[Path]:
    """Files of the meshes of a description that can be read but not compiled; MuJoCo's message may not name them."""
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, mujoco.FatalError):
        return []
    return [path.parent / spec.compiler.meshdir / mesh.file for mesh in spec.meshes]


def _without_textures(spec: Any) -> None:
    """Leave out textures: their files are often left behind."""
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for texture in list(spec.textures):
        spec.delete(texture)


def _names(model: Any) -> dict[str, list[str]]:
    import mujoco

    found: dict[str, list[str]] = {}
    for kind, count in (
        ("body", model.nbody), ("joint", model.njnt), ("geom", model.ngeom), ("site", model.nsite), ("key", model.nkey),
    ):  # fmt: skip
        number = getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
        given = [mujoco.mj_id2name(model, number, k) or "" for k in range(count)]
        taken = set(given)
        bodies = {"joint": model.jnt_bodyid, "geom": model.geom_bodyid, "site": model.site_bodyid}.get(kind)
        for k, name in enumerate(given):
            if not name:
                base = f"{kind}{k}" if bodies is None else f"{found['body'][bodies[k]]}_{kind}"
                others = (f"{base}_{n}" for n in range(2, count + 2))
                given[k] = next(each for each in (base, *others) if each not in taken)
                taken.add(given[k])
        found[kind] = given
    return found
