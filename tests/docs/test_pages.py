"""The documentation's Python is run as it stands, block after block of a page."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from wholebody.cli.main import main


@pytest.mark.parametrize(
    "page",
    [
        "README.md",
        "docs/index.md",
        "docs/guide.md",
        "docs/figures.md",
        "docs/interaction.md",
        "docs/motion.md",
        "docs/studies.md",
        "docs/comparison.md",
    ],
)
def test_code_on_the_page_runs(page: str, root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names = _run(root / page)
    assert names
    for name in {"solution", "taken", "put"} & names.keys():
        assert names[name].solved, name
    if page == "docs/figures.md" and find_spec("mujoco"):  # a configuration of MuJoCo is a start
        names = _run(root / page, "mujoco", names)
        assert names["arm"].joint_values(names["start"]) == {"turn": 0.6}


def test_a_real_robot_on_the_page(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not os.environ.get("WHOLEBODY_ROBOTS"):
        pytest.skip("no robot descriptions here; WHOLEBODY_ROBOTS names their folder")
    monkeypatch.chdir(tmp_path)
    names = _run(root / "docs/figures.md", "robots")
    assert names["solution"].solved
    hand = names["panda"].placement(names["solution"].q, "panda_hand_tcp")
    np.testing.assert_allclose(hand.translation, (0.54, 0.05, 0.45), atol=1e-4)


def test_the_study_on_the_page(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file and the command of the page, beside the packaged task that the file names."""
    page = (root / "docs/studies.md").read_text()
    block = re.search(r"```toml\n# (\S+)\n(.*?)```", page, re.DOTALL)
    command = re.search(r"^\$ wholebody (study .*)$", page, re.MULTILINE)
    assert block
    assert command
    monkeypatch.chdir(tmp_path)
    shutil.copyfile(root / "examples/tasks/shelf.toml", "shelf.toml")
    Path(block[1]).write_text(block[2])
    assert main(command[1].split()) == 0
    assert "solved" in Path("out/shelf-study/cases.csv").read_text()


def _run(page: Path, needs: str = "", known: Mapping[str, Any] = MappingProxyType({})) -> dict[str, Any]:
    """The names that the blocks of a page define, run one after the other.

    Args:
        page: Markdown.
        needs: what the blocks need that not everybody has, as ``<!-- needs: NAME -->`` before them says.
        known: names that are defined before.
    """
    blocks = re.findall(r"(?:<!-- needs: (\w+) -->\n)?```python\n(.*?)```", page.read_text(), re.DOTALL)
    names = dict(known)
    for block in [text for need, text in blocks if need == needs]:
        exec(compile(block, str(page), "exec"), names)
    return names
