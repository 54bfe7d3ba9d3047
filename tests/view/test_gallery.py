"""A gallery runs scripts and shows what they made, and which failed."""

from __future__ import annotations

from pathlib import Path

import pytest

from wholebody.cli import main, pose
from wholebody.view.browser import Browser
from wholebody.view.gallery import write_gallery

GOOD = '''"""A <small> story."""
import argparse, base64, pathlib
parser = argparse.ArgumentParser()
parser.add_argument("--out", type=pathlib.Path)
out = parser.parse_args().out
(out / "good.html").write_text("<!doctype html><p id='turned'>the scene</p>")
(out / "good.png").write_bytes(base64.b64decode("iVBORw0KGgo="))
print(f"solved\\n  {out / 'good.png'}")
'''
BAD = '"""It fails."""\nraise ValueError("no such thing")\n'


@pytest.fixture
def scripts(tmp_path: Path) -> list[Path]:
    paths = [tmp_path / "good.py", tmp_path / "bad.py"]
    for path, text in zip(paths, (GOOD, BAD), strict=True):
        path.write_text(text)
    return paths


def test_each_script_is_run_and_told(scripts: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    good, bad = write_gallery(scripts, tmp_path / "gallery.html")
    assert (good.about, good.numbers, good.failed) == ("A <small> story.", "solved", False)
    assert (len(good.pictures), "turned" in good.scene, good.code.startswith("import argparse")) == (1, True, True)
    assert (bad.failed, bad.numbers) == (True, "ValueError: no such thing")
    page = (tmp_path / "gallery.html").read_text()
    assert "A &lt;small&gt; story." in page
    assert 'src="http' not in page
    monkeypatch.setattr(pose, "script_paths", lambda: {path.stem: path for path in scripts})
    assert main(["gallery", "bad", "--out", str(tmp_path / "other.html")]) == 1
    assert main(["gallery", "worse", "--out", str(tmp_path / "other.html")]) == 2


@pytest.mark.browser
def test_a_click_opens_the_scene(scripts: list[Path], tmp_path: Path, browser: Browser) -> None:
    write_gallery(scripts[:1], tmp_path / "gallery.html")
    browser.open((tmp_path / "gallery.html").as_uri(), "document.querySelector('button') !== null")
    browser.evaluate("document.querySelector('button').click()")
    inside = "document.querySelector('iframe').contentDocument"
    for _ in range(50):
        if browser.evaluate(f"{inside}?.getElementById('turned') !== null"):
            break
    assert browser.evaluate(f"{inside}.getElementById('turned').textContent") == "the scene"
