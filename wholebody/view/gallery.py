"""A gallery: example scripts, each run anew, on one page with picture, docstring, code, numbers and a scene to turn."""

from __future__ import annotations

import ast
import base64
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from wholebody.base.files import Scratch, read_text, templates, write
from wholebody.view.page import player

LONGEST = 600.0  # s: of one script


class Exhibit(NamedTuple):
    """What one script made."""

    name: str  # of the script
    about: str  # its docstring
    code: str  # its text, without the docstring
    numbers: str  # what it printed, without the paths of its files
    seconds: float  # that it ran
    pictures: tuple[str, ...]  # PNG files, base64
    scene: str  # the page with the first scene, HTML; "" where it made none
    failed: bool  # whether it ended with an error, which `numbers` ends with


def exhibit(script: Path) -> Exhibit:
    """Run a script that writes its pictures and pages into the folder of its option --out, and gather what it made."""
    text = read_text(script, "script")
    module = ast.parse(text)
    after = module.body[0].end_lineno or 0
    with Scratch() as folder:
        began = time.perf_counter()
        # the package of this process, from wherever the script is
        paths = os.pathsep.join([str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")])
        command = [sys.executable, str(script), "--out", str(folder)]
        environment = {**os.environ, "PYTHONPATH": paths.strip(os.pathsep)}
        try:
            ran = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST, env=environment, check=False)
            said, failed = ran.stdout, ran.returncode != 0
            said += ran.stderr.strip().splitlines()[-1] if failed and ran.stderr.strip() else ""
        except subprocess.TimeoutExpired:
            said, failed = f"it was ended after {LONGEST:g} s", True
        pages, pictures = sorted(folder.rglob("*.html")), folder.rglob("*.png")
        return Exhibit(
            name=script.stem,
            about=ast.get_docstring(module) or "",
            code="\n".join(text.splitlines()[after:]).strip(),
            numbers="\n".join(line for line in said.splitlines() if str(folder) not in line),
            seconds=time.perf_counter() - began,
            pictures=tuple(
                base64.b64encode(file.read_bytes()).decode("ascii")
                for file in sorted(pictures, key=lambda file: file.stat().st_mtime_ns)  # in the order of the script
            ),
            scene=pages[0].read_text("utf-8") if pages else "",
            failed=failed,
        )


def write_gallery(
    scripts: Sequence[Path], path: Path, say: Callable[[Exhibit], None] = lambda made: None
) -> list[Exhibit]:
    """Run scripts, each with a docstring and an option --out, and write one page that opens without a network."""
    made = []
    for script in scripts:
        made.append(exhibit(script))
        say(made[-1])
    page = templates(Path(__file__).parent).get_template("gallery.html.jinja")
    write(path, page.render(exhibits=made, player=player(), slot="<!-- player -->"))
    return made
