"""Pieces of meshes on disk: the same pieces again, whatever happens to the files, and never too many of them."""

from __future__ import annotations

import multiprocessing
import os
from pathlib import Path

import numpy as np
import pytest
import trimesh

from wholebody.geometry import convex, mesh_cache
from wholebody.geometry.convex import convex_pieces, mesh_hull
from wholebody.geometry.mesh_cache import ConvexPieces, cache_state, cached, clear_cache


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(mesh_cache.VARIABLE, str(tmp_path / "cache"))
    monkeypatch.setattr(mesh_cache, "_writes", 0)
    convex._decomposed.cache_clear()
    return tmp_path / "cache"


def made(size: float = 1.0, what: str = "mesh a") -> ConvexPieces:
    ball = trimesh.creation.icosphere(subdivisions=1, radius=size)
    return mesh_hull(ball.vertices, ball.faces[1:], what=what)


def points(found: ConvexPieces) -> list[np.ndarray]:
    return [np.array(piece.geometry.points()) + piece.placement.translation for piece in found.pieces]


def test_what_was_kept_is_what_was_made_under_another_name_too(folder: Path) -> None:
    first = cached((b"content",), "settings", "mesh a", made)
    again = cached((b"content",), "settings", "mesh b", lambda: pytest.fail("made again"))
    assert points(first)[0] == pytest.approx(points(again)[0])
    assert again.pieces[0].geometry.computeVolume() == pytest.approx(first.pieces[0].volume)
    assert again.added_volume == first.added_volume
    assert [note.replace("mesh a", "mesh b") for note in first.notes] == list(again.notes)
    assert cache_state().entries == 1
    assert cache_state().folder == folder


def test_other_content_or_settings_are_made_anew(folder: Path) -> None:
    asked = []
    for content, settings in ((b"a", "s"), (b"b", "s"), (b"a", "t"), (b"a", "s")):
        cached((content,), settings, "mesh a", lambda: asked.append(1) or made())
    assert len(asked) == 3
    cut, other = (b"ab", b"c"), (b"a", b"bc")
    cached(cut, "s", "mesh a", lambda: asked.append(1) or made())
    cached(other, "s", "mesh a", lambda: asked.append(1) or made())
    assert len(asked) == 5


@pytest.mark.parametrize("harm", [b"", b"x" * 100, None])
def test_a_damaged_entry_is_made_anew(folder: Path, harm: bytes | None) -> None:
    cached((b"a",), "s", "mesh a", made)
    (file,) = folder.iterdir()
    data = file.read_bytes()
    file.write_bytes(data[:-1] + bytes([data[-1] ^ 1]) if harm is None else harm)
    asked = []
    cached((b"a",), "s", "mesh a", lambda: asked.append(1) or made())
    assert asked
    assert file.read_bytes() == data


def test_the_oldest_go_when_there_is_too_much(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cached((b"0",), "s", "mesh a", made)
    size = cache_state().size
    monkeypatch.setattr(mesh_cache, "LARGEST_CACHE", 4 * size)
    monkeypatch.setattr(mesh_cache, "LOOKED_AT_EVERY", 1)
    for k in range(1, 9):
        for age, file in enumerate(sorted(folder.glob("*.pieces"), key=lambda path: path.stat().st_mtime)):
            os.utime(file, (1e9 + age, 1e9 + age))
        cached((str(k).encode(),), "s", "mesh a", made)
        assert cache_state().size <= 4 * size
    cached((b"8",), "s", "mesh a", lambda: pytest.fail("the newest is gone"))
    asked = []
    cached((b"0",), "s", "mesh a", lambda: asked.append(1) or made())
    assert asked


def test_clearing_removes_everything(folder: Path) -> None:
    cached((b"a",), "s", "mesh a", made)
    assert clear_cache().entries == 1
    assert not list(folder.iterdir())


def test_without_a_folder_nothing_is_kept_and_all_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv(mesh_cache.VARIABLE, str(tmp_path / "file" / "cache"))
    assert len(cached((b"a",), "s", "mesh a", made).pieces) == 1
    assert cache_state().entries == 0


def test_a_decomposition_is_not_made_twice(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = trimesh.creation.torus(0.3, 0.1, major_sections=12, minor_sections=8)
    half = mesh.vertices[mesh.vertices[:, 0] > 0.0], mesh.vertices[mesh.vertices[:, 0] < 0.0]
    monkeypatch.setattr(convex, "_coacd", lambda *_: list(half))
    first = convex_pieces(mesh.vertices, mesh.faces, threshold=0.2)
    convex._decomposed.cache_clear()
    monkeypatch.setattr(convex, "_coacd", lambda *_: pytest.fail("decomposed again"))
    again = convex_pieces(mesh.vertices, mesh.faces, threshold=0.2)
    for a, b in zip(points(first), points(again), strict=True):
        assert a == pytest.approx(b)


def test_several_processes_write_one_entry_at_once(folder: Path) -> None:
    def work() -> None:
        for k in range(40):
            found = cached((str(k % 4).encode(),), "s", "m", made)
            assert len(found.pieces) == 1

    running = [multiprocessing.get_context("fork").Process(target=work) for _ in range(2)]
    for process in running:
        process.start()
    for process in running:
        process.join(120)
    assert [process.exitcode for process in running] == [0, 0]
    assert cache_state().entries == 4
    assert not list(folder.glob("*.part"))
