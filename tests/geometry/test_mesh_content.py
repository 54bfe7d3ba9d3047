"""Files that are no meshes whatever their names say, and axes and names of those that are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import wholebody as wb
from wholebody.base.errors import FileFormatError

POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"


@pytest.mark.parametrize("suffix", [".stl", ".obj", ".glb", ".dae", ".ply"])
def test_pointers_and_web_pages_are_named(suffix: str, tmp_path: Path) -> None:
    for text, words in ((POINTER, "pointer of Git LFS.*git lfs pull"), ("<!DOCTYPE html><html>", "web page")):
        (tmp_path / f"part{suffix}").write_text(text)
        with pytest.raises(FileFormatError, match=words):
            wb.Mesh(tmp_path / f"part{suffix}")


def test_a_link_does_not_lose_its_shape_on_a_note(tmp_path: Path) -> None:
    (tmp_path / "part.obj").write_text(POINTER)
    mesh = '<collision><geometry><mesh filename="part.obj"/></geometry></collision>'
    (tmp_path / "r.urdf").write_text(f'<robot name="r"><link name="a">{mesh}</link></robot>')
    with pytest.raises(FileFormatError, match=r"link 'a'.*Git LFS"):
        wb.load(tmp_path / "r.urdf")


def test_a_cut_stl_is_refused(tmp_path: Path) -> None:
    whole = trimesh.creation.icosphere(1).export(file_type="stl")
    (tmp_path / "ball.stl").write_bytes(whole)
    assert len(wb.Mesh(tmp_path / "ball.stl").faces) == 80
    (tmp_path / "ball.stl").write_bytes(whole[:-70])
    with pytest.raises(FileFormatError, match="it is truncated"):
        wb.Mesh(tmp_path / "ball.stl")


def test_an_stl_in_capitals_and_one_with_more_at_its_end_are_read(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(1)
    (tmp_path / "capitals.stl").write_text(str(ball.export(file_type="stl_ascii")).upper())
    (tmp_path / "longer.stl").write_bytes(ball.export(file_type="stl") + b"made by nobody" * 9)
    for name in ("capitals", "longer"):
        mesh = wb.Mesh(tmp_path / f"{name}.stl")
        assert len(mesh.faces) == 80
        assert np.ptp(mesh.vertices, axis=0) == pytest.approx(np.ptp(ball.vertices, axis=0), abs=1e-6)


def test_an_obj_with_a_byte_order_mark_keeps_its_first_corner(tmp_path: Path) -> None:
    corners = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 3.0)]
    lines = ["v {} {} {}".format(*corner) for corner in corners] + ["f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4"]
    (tmp_path / "a.obj").write_text("\n".join(lines), encoding="utf-8-sig")
    mesh = wb.Mesh(tmp_path / "a.obj")
    assert sorted(map(tuple, mesh.vertices.tolist())) == sorted(corners)


def test_ply_is_read_and_gltf_is_y_up(tmp_path: Path) -> None:
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    for suffix in ("ply", "glb"):
        (tmp_path / f"box.{suffix}").write_bytes(box.export(file_type=suffix))
    assert np.ptp(wb.Mesh(tmp_path / "box.ply").vertices, axis=0) == pytest.approx([1.0, 2.0, 3.0])
    assert np.ptp(wb.Mesh(tmp_path / "box.glb").vertices, axis=0) == pytest.approx([3.0, 1.0, 2.0])
    assert np.ptp(wb.Mesh(tmp_path / "box.glb", up="y").vertices, axis=0) == pytest.approx([1.0, 3.0, 2.0])
    assert np.ptp(wb.Mesh(tmp_path / "box.glb", up="z").vertices, axis=0) == pytest.approx([1.0, 2.0, 3.0])


def test_names_of_meshes_are_decoded(tmp_path: Path) -> None:
    (tmp_path / "my parts").mkdir()
    (tmp_path / "my parts" / "box.stl").write_bytes(trimesh.creation.box().export(file_type="stl"))
    for name in ("my%20parts/box.stl", "my parts\\box.stl"):
        mesh = f'<collision><geometry><mesh filename="{name}"/></geometry></collision>'
        (tmp_path / "r.urdf").write_text(f'<robot name="r"><link name="a">{mesh}</link></robot>')
        assert wb.load(tmp_path / "r.urdf").geometry.ngeoms == 1
