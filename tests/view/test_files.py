"""Pictures and movies as files, and what is said where they cannot be made."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import wholebody as wb
from wholebody.base.errors import InputError, MissingPackageError, UnknownNameError
from wholebody.view import Viewer
from wholebody.view.browser import Browser, BrowserError, find_chromium
from wholebody.view.screenshot import movie
from wholebody.view.style import LOOK

browser_needed = pytest.mark.browser


@browser_needed
def test_pictures_and_movies(exhibit: Any, chromium: str, tmp_path: Path) -> None:
    with Viewer(exhibit) as viewer:
        q = exhibit.posture(1)
        viewer.show(q)
        path = viewer.picture(tmp_path / "scene.png", size=(401, 300))
        picture = Image.open(path)
        assert picture.size == (401, 300)
        values = np.asarray(picture.convert("RGB")).astype(float)
        tan = np.array(LOOK.figure[:3]) / np.linalg.norm(LOOK.figure[:3])
        alike = (values @ tan) / np.linalg.norm(values, axis=2)
        figure = np.argwhere(alike > 0.999)
        assert len(figure) > 500
        rows, columns = (figure.min(axis=0) + figure.max(axis=0)) / 2
        assert abs(rows - 150) < 45
        assert abs(columns - 200) < 60
        assert figure.min() > 3  # all of it is in the picture

        viewer.play([exhibit.posture(1 + seed) for seed in range(3)], dt=0.1)
        told: list[tuple[int, int]] = []
        drawn = viewer.movie(tmp_path / "scene.gif", size=(96, 64), progress=lambda *counts: told.append(counts))
        assert told == [(number, 3) for number in range(1, 4)]
        with Image.open(drawn) as movie:
            assert (movie.size, movie.n_frames, movie.info["duration"]) == ((96, 64), 3, 100)  # type: ignore[attr-defined]
        if shutil.which("ffmpeg") and shutil.which("ffprobe"):
            viewer.movie(tmp_path / "scene.mp4", size=(97, 64), fps=20)
            asked = [
                "ffprobe",
                "-v",
                "error",
                "-count_frames",
                "-show_entries",
                "stream=nb_read_frames,width,r_frame_rate",
            ]
            found = subprocess.run(
                [*asked, "-of", "csv=p=0", tmp_path / "scene.mp4"],
                check=True,
                capture_output=True,
                text=True,
                timeout=60,
            )
            assert found.stdout.strip() == "98,20/1,5"
    assert sorted(os.listdir(tmp_path))[0][0] != "."  # no temporary file is left


@browser_needed
@pytest.mark.usefixtures("chromium")
def test_a_picture_does_not_depend_on_those_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The browser's page stays open; the picture is that of a page which has drawn nothing else."""
    opened: list[int] = []
    base = Browser.open_html
    monkeypatch.setattr(Browser, "open_html", lambda self, page: (opened.append(1), base(self, page))[1])
    scene = wb.Scene(wb.load("hand")).add(wb.Box((0.1, 0.1, 0.02)), name="plate", at=(0.0, 0.0, -0.1))
    first = scene.figure.neutral
    names = [name for name in scene.figure.joints if "index" in name and "flexion" in name]
    second = scene.figure.with_joints(first, dict.fromkeys(names, 0.3))
    tip = scene.figure.placement(first, "right_index_tip").translation
    problem = wb.Problem(scene, first, goals=[wb.Point("right_index_tip", tip)])
    with Viewer(scene) as viewer, Viewer(scene) as fresh:
        viewer.show(first, problem=problem)
        viewer.play([first, second], dt=0.1)
        viewer.movie(tmp_path / "movie.gif", size=(96, 64))
        opened.clear()
        viewer.show(second, problem=problem)
        viewer.picture(tmp_path / "two.png", size=(200, 120))
        assert not opened
        fresh.show(second, problem=problem)
        fresh.picture(tmp_path / "fresh.png", size=(200, 120))
        assert (tmp_path / "two.png").read_bytes() == (tmp_path / "fresh.png").read_bytes()
        viewer.ghosts([first])
        viewer.picture(tmp_path / "ghost.png", size=(200, 120))
        viewer.ghosts([])  # nodes go, so the page is built anew
        viewer.picture(tmp_path / "three.png", size=(200, 120))
        assert (tmp_path / "three.png").read_bytes() == (tmp_path / "fresh.png").read_bytes()
        assert (tmp_path / "ghost.png").read_bytes() != (tmp_path / "fresh.png").read_bytes()


def test_without_a_browser_pages_are_saved_and_pictures_refused(
    exhibit: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WHOLEBODY_CHROMIUM", "/nowhere/chromium")
    assert find_chromium() is None
    viewer = Viewer(exhibit)
    viewer.play([exhibit.posture(1), exhibit.posture(2)], dt=0.1)
    viewer.save(tmp_path / "scene.html")
    for attempt in (lambda: viewer.picture(tmp_path / "x.png"), lambda: viewer.movie(tmp_path / "x.gif")):
        with pytest.raises(MissingPackageError, match="apt-get install chromium"):
            attempt()
    assert os.listdir(tmp_path) == ["scene.html"]


def test_a_program_that_is_no_browser_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """However early it has ended when it is asked."""
    monkeypatch.setenv("WHOLEBODY_CHROMIUM", "true")
    for seconds in (0.0, 0.1):
        with Browser() as browser:
            time.sleep(seconds)
            with pytest.raises(BrowserError, match=r"/true --headless"):
                browser.evaluate("0")


def test_saving_the_same_twice_gives_the_same_bytes(exhibit: Any, tmp_path: Path) -> None:
    texts = []
    for _ in range(2):
        viewer = Viewer(exhibit, names=True)
        viewer.play([exhibit.posture(1), exhibit.posture(2)], dt=0.1)
        texts.append(viewer.save(tmp_path / "scene.html").read_bytes())
    assert texts[0] == texts[1]


def test_mistakes_are_named(exhibit: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    viewer = Viewer(exhibit)
    q = exhibit.posture(1)
    with pytest.raises(InputError, match="nothing is shown"):
        viewer.save(tmp_path / "x.html")
    with pytest.raises(InputError, match="shape"):
        viewer.show(q[:-1])
    with pytest.raises(InputError, match="not finite"):
        viewer.show(np.full_like(q, np.nan))
    with pytest.raises(InputError, match="list of postures"):
        viewer.play([])
    with pytest.raises(InputError, match="dt"):
        viewer.play([q], dt=0.0)
    viewer.show(q)
    with pytest.raises(InputError, match="call play"):
        viewer.movie(tmp_path / "x.gif")
    viewer.play([q])
    with pytest.raises(InputError, match=r"\.gif or \.mp4"):
        viewer.movie(tmp_path / "x.avi")
    with pytest.raises(InputError, match="fps"):
        viewer.movie(tmp_path / "x.gif", fps=0)
    with pytest.raises(InputError, match="size"):
        viewer.picture(tmp_path / "x.png", size=(0, 100))
    with pytest.raises(InputError, match="make the folder"):
        viewer.save(tmp_path / "absent" / "x.html")
    with pytest.raises(InputError, match="both"):
        viewer.look(eye=(1, 0, 0))
    with pytest.raises(InputError, match="different places"):
        viewer.look((1, 0, 0), (1, 0, 0))
    with pytest.raises(UnknownNameError, match="table"):
        Viewer(exhibit, see_through=["tabel"])
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(MissingPackageError, match="ffmpeg"):
        viewer.movie(tmp_path / "x.mp4")
    assert os.listdir(tmp_path) == []


def test_a_gif_keeps_the_colours_of_what_is_small() -> None:
    """A face is one part in fifty of a picture, and the rest are greys."""
    picture = np.zeros((120, 160, 3), dtype=np.uint8)
    picture[:] = np.linspace(150, 250, 160)[None, :, None]
    picture[:, :, 2] += (np.arange(120) // 30)[:, None].astype(np.uint8)
    face = np.linspace((120, 80, 50), (235, 180, 140), 400).reshape(20, 20, 3)
    picture[50:70, 70:90] = face
    file = io.BytesIO()
    Image.fromarray(picture).save(file, "PNG")
    made = Image.open(io.BytesIO(movie(".gif", [file.getvalue()] * 3, 10.0)))
    shown = np.asarray(made.convert("RGB")).astype(int)
    assert np.abs(shown[50:70, 70:90] - face).mean() < 4.0
    assert np.abs(shown - picture).mean() < 4.0


def test_the_shell_draws_where_it_is_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("WHOLEBODY_CHROMIUM", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    for name in ("google-chrome", "chromium", "chromium-headless-shell"):
        (tmp_path / name).touch(0o755)
        assert find_chromium() == str(tmp_path / name)
